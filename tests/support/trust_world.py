"""True worlds for the study of trust, in plain numpy: mathematics of their own.

World: east, north, up [m]. Camera axes: x right, y down, z forward. Body axes: forward, right,
down. Pixels: (0, 0) is the centre of the top-left pixel.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pymavlink.dialects.v20 import all as dialect

Floats = NDArray[np.float64]

HOME = (52.2741, 9.8105, 88.0)
"""Degrees, metres above mean sea level."""
UNDULATION_M = 44.0
START_UTC_S = 1_782_640_800.0
BOOT_S = 100.0
SEMI_MAJOR_M, FLATTENING = 6378137.0, 1 / 298.257223563
ENU_FROM_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
LENS_NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


# --- cameras ------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class Lens:
    """A calibrated camera: its stated parameters and sigmas (9,), and its true parameters (9,)."""

    width: int
    height: int
    stated: Floats
    sigma: Floats
    true: Floats


def draw_lens(rng: np.random.Generator, size: tuple[int, int] = (4000, 3000)) -> Lens:
    """Draw a camera whose true parameters differ from the stated ones by the stated sigmas."""
    width, height = size
    focal = 0.74 * width
    middle = np.array([width - 1, height - 1]) / 2 + rng.normal(0, 8, 2)
    stated = np.array([focal, focal * 1.0004, *middle, -0.04, 0.02, 2e-4, -3e-4, 0.0])
    sigma = np.array([2.5, 2.5, 3.0, 3.0, 0.0015, 0.004, 0.00015, 0.00015, 0.003])
    true = stated + sigma * rng.standard_normal(9)
    return Lens(width=width, height=height, stated=stated, sigma=sigma, true=true)


SEEN_COSINE = 0.6
"""Cosine of the largest angle from the optical axis that a photo shows; 0.76 in its corners."""


def project(lens: Floats, camera: Pose, world: Floats) -> tuple[Floats, Floats]:
    """Project points (n, 3) with Brown's distortion: pixels (n, 2), depths (n,)."""
    seen = (world - camera.center) @ camera.rotation
    depth = np.where(np.abs(seen[:, 2]) < 1e-6, 1e-6, seen[:, 2])
    x, y = seen[:, 0] / depth, seen[:, 1] / depth
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.column_stack([fx * u + cx, fy * v + cy]), seen[:, 2]


@dataclass(kw_only=True)
class Pose:
    """Centre (3,) in the world, and rotation (3, 3) from camera to world."""

    center: Floats
    rotation: Floats


def about(axis: int, angle: float) -> Floats:
    """Turn (3, 3) about a coordinate axis by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn


def turn_of(vector: Floats) -> Floats:
    """Turn (3, 3) of a rotation vector [rad], after Rodrigues."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def body_turn(roll: float, pitch: float, yaw: float) -> Floats:
    """Turn (3, 3) from body to east, north, up of an attitude [rad] from north, east, down."""
    return np.asarray(ENU_FROM_NED @ about(2, yaw) @ about(1, pitch) @ about(0, roll))


def mount_turn(pitch: float) -> Floats:
    """Turn (3, 3) from camera to body of a camera that looks forward at 0, down at -pi/2."""
    c, s = np.cos(pitch), np.sin(pitch)
    return np.array([[0.0, s, c], [1.0, 0.0, 0.0], [0.0, c, -s]])


# --- ground -------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class Ground:
    """A road: plane, vertical curve, kerb, relief that is alike nearby, and each point's own.

    Attributes
    ----------
    middle
        (2,) about which slopes turn.
    slope
        (2,) up per metre to the east and to the north.
    curve
        Metres of height per square metre along the first axis: 1 / (2 radius).
    kerb_m, kerb_along
        Step up on one side of a line through `middle` and the unit vector (2,) across it.
    waves, size
        (w, 2), (2, w) of the relief.
    own_m
        Sigma of each point's own departure.
    """

    middle: Floats
    height: float
    slope: Floats
    curve: float = 0.0
    kerb_m: float = 0.0
    kerb_across: Floats = field(default_factory=lambda: np.array([1.0, 0.0]))
    kerb_shift_m: float = 0.0
    waves: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    size: Floats = field(default_factory=lambda: np.zeros((2, 0)))

    def up(self, place: Floats) -> Floats:
        """Heights (n,) at places (n, 2)."""
        local = place - self.middle
        angle = local @ self.waves.T
        relief = np.cos(angle) @ self.size[0] + np.sin(angle) @ self.size[1]
        step = self.kerb_m * (local @ self.kerb_across > self.kerb_shift_m)
        return np.asarray(
            self.height + local @ self.slope + self.curve * local[:, 0] ** 2 + step + relief
        )


def draw_ground(
    rng: np.random.Generator,
    middle: Floats,
    *,
    relief_m: float = 0.0,
    relief_length_m: float = 1.5,
    slope: Floats | None = None,
    kerb_m: float = 0.0,
    curve: float = 0.0,
) -> Ground:
    """Draw a ground near home's height: nearly level where no slope is given."""
    count = 60
    azimuth = rng.uniform(0, 2 * np.pi)
    return Ground(
        middle=middle,
        height=0.25 * rng.standard_normal(),
        slope=rng.normal(0, 0.02, 2) if slope is None else slope,
        curve=curve,
        kerb_m=kerb_m,
        kerb_across=np.array([np.cos(azimuth), np.sin(azimuth)]),
        kerb_shift_m=rng.uniform(-1.5, 1.5),
        waves=rng.standard_normal((count, 2)) / relief_length_m,
        size=rng.standard_normal((2, count)) * relief_m / np.sqrt(count),
    )


# --- a survey -----------------------------------------------------------------------------------


@dataclass(kw_only=True)
class Pick:
    """A row of picks.csv."""

    photo: int
    label: str
    at: Floats
    extra: dict[str, object] = field(default_factory=dict)


@dataclass(kw_only=True)
class Line:
    """A row of lines.csv."""

    name: str
    ends: tuple[str, str]
    length: float
    sigma: float
    extra: dict[str, object] = field(default_factory=dict)


@dataclass(kw_only=True)
class Survey:
    """A survey as its user has it, beside the truth.

    Attributes
    ----------
    meant
        {label: (3,)} the points that are taped, controlled and measured.
    picked
        {label: (3,)} the points that are clicked: identification moves them.
    measure
        (name, kind, labels) of each measurement.
    control
        {label: (3,)} as it is stated.
    wrong
        Names of what a fault touched: labels, lengths, frames.
    redundant
        Whether others check the observation that a fault touched.
    """

    lens: Lens
    ground: Ground
    poses: list[Pose]
    meant: dict[str, Floats]
    picked: dict[str, Floats]
    log: Log | None = None
    picks: list[Pick] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    measure: list[tuple[str, str, tuple[str, ...]]] = field(default_factory=list)
    control: dict[str, Floats] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    camera_auto: dict[str, object] | None = None
    photo_time_s: Floats = field(default_factory=lambda: np.zeros(0))
    wrong: dict[str, set[str]] = field(default_factory=dict)
    redundant: bool = True

    def photo(self, number: int) -> str:
        """Name of a photo, with its time by the camera's clock."""
        if not len(self.photo_time_s):
            return f"IMG_{100 + number}.jpg"
        time = np.datetime64(round((START_UTC_S + self.photo_time_s[number]) * 1e6), "us")
        text = str(time).replace("-", "").replace(":", "").replace("T", "_").replace(".", "_")
        return f"{text}.jpg"

    def blame(self, **names: Iterable[str]) -> None:
        """Note what is wrong."""
        for kind, some in names.items():
            self.wrong.setdefault(kind, set()).update(some)


def photograph(
    survey: Survey,
    rng: np.random.Generator,
    *,
    sigma_px: float = 1.0,
    share: float = 1.0,
    clicks: int = 1,
) -> None:
    """Pick each label in the photos that show it, with noise; each label at least once."""
    labels = list(survey.picked)
    world = np.array([survey.picked[label] for label in labels])
    visible = np.zeros((len(survey.poses), len(labels)), bool)
    pixels = np.zeros((*visible.shape, 2))
    for k, pose in enumerate(survey.poses):
        pixels[k], depth = project(survey.lens.true, pose, world)
        inside = (pixels[k] > 25).all(axis=1) & (
            pixels[k] < [survey.lens.width - 26, survey.lens.height - 26]
        ).all(axis=1)
        slant = np.linalg.norm(world - pose.center, axis=1)
        # Far beside the picture the polynomial folds back into it: no light comes from there.
        visible[k] = inside & (depth > SEEN_COSINE * slant) & (depth > 1.0)
    taken = visible & (rng.random(visible.shape) < share)
    for column in np.flatnonzero(~taken.any(axis=0) & visible.any(axis=0)):
        taken[rng.choice(np.flatnonzero(visible[:, column])), column] = True
    for k, column in zip(*np.nonzero(taken), strict=True):
        for _ in range(clicks):
            at = pixels[k, column] + sigma_px * rng.standard_normal(2)
            survey.picks.append(Pick(photo=int(k), label=labels[column], at=at))


def true_value(survey: Survey, kind: str, labels: tuple[str, ...]) -> float:
    """Value of a measurement between the meant points: metres, square metres, degrees."""
    p = np.array([survey.meant[label] for label in labels])
    if kind == "distance":
        value = np.linalg.norm(p[1] - p[0])
    elif kind == "area":
        local = p - p[0]
        value = np.linalg.norm(np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0)) / 2
    elif kind == "angle":
        one, two = p[0] - p[1], p[2] - p[1]
        value = np.degrees(np.arctan2(np.linalg.norm(np.cross(one, two)), one @ two))
    elif kind == "line_distance":
        along = p[2] - p[1]
        value = np.linalg.norm(np.cross(p[0] - p[1], along)) / np.linalg.norm(along)
    elif kind in {"vertical_distance", "height"} and len(p) == 2:
        value = p[1, 2] - p[0, 2]
    else:  # height of one point over the ground below it
        value = p[0, 2] - survey.ground.up(p[:1, :2])[0]
    return float(value)


# --- flight log ---------------------------------------------------------------------------------


class Wander:
    """Smooth random process of d components with sigma (d,) and a correlation time [s]."""

    def __init__(self, rng: np.random.Generator, sigma: Iterable[float], time_s: float) -> None:
        self.rate = rng.standard_normal(24) / time_s
        scale = np.array(list(sigma)) / np.sqrt(24)
        self.size = rng.standard_normal((2, 24, len(scale))) * scale

    def __call__(self, time: Floats) -> Floats:
        """Values (n, d)."""
        angle = time[:, None] * self.rate
        return np.asarray(np.cos(angle) @ self.size[0] + np.sin(angle) @ self.size[1])


@dataclass(kw_only=True)
class Log:
    """What the autopilot wrote: times (n,) [s], places (n, 3) of the world, attitudes (n, 3)."""

    time: Floats
    position: Floats
    rpy: Floats
    fix: int
    accuracy_m: tuple[float, float]


def write_log(path: Path, log: Log) -> None:
    """Write a telemetry log of MAVLink 2 messages."""
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    velocity = np.gradient(log.position, log.time, axis=0)
    geodetic = geodetic_from_enu(log.position)
    home_mm = round(HOME[2] * 1000)
    out = bytearray()

    def put(time: float, *messages: Any) -> None:  # noqa: ANN401
        stamp = struct.pack(">Q", round((START_UTC_S + time + 0.05) * 1e6))
        for message in messages:
            out.extend(stamp + message.pack(link))

    for k, time in enumerate(log.time):
        boot_ms = round((time + BOOT_S) * 1000)
        lat, lon = (round(x * 1e7) for x in geodetic[k, :2])
        height_mm = round(geodetic[k, 2] * 1000)
        roll, pitch, yaw = log.rpy[k]
        yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
        east, north, up = (round(100 * v) for v in velocity[k])
        if k % 10 == 0:
            put(
                time,
                dialect.MAVLink_heartbeat_message(2, 3, 217, 3, 4, 3),
                dialect.MAVLink_system_time_message(round((START_UTC_S + time) * 1e6), boot_ms),
                dialect.MAVLink_home_position_message(
                    *(round(HOME[0] * 1e7), round(HOME[1] * 1e7), home_mm, 0, 0, 0),
                    *((1, 0, 0, 0), 0, 0, 0, boot_ms * 1000),
                ),
            )
        if k % 2 == 0:
            put(
                time,
                dialect.MAVLink_gps_raw_int_message(
                    *(boot_ms * 1000, log.fix, lat, lon, height_mm, 70, 100, 65535, 65535, 20),
                    alt_ellipsoid=height_mm + round(UNDULATION_M * 1000),
                    h_acc=round(log.accuracy_m[0] * 1000),
                    v_acc=round(log.accuracy_m[1] * 1000),
                ),
            )
        put(
            time,
            dialect.MAVLink_global_position_int_message(
                *(boot_ms, lat, lon, height_mm, height_mm - home_mm, north, east, -up),
                round(np.degrees(yaw) * 100) % 36000,
            ),
            dialect.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0, 0, 0),
        )
    path.write_bytes(out)


def geodetic_from_enu(world: Floats) -> Floats:
    """Latitude, longitude [deg] and height above mean sea level [m] of world points (n, 3)."""
    lat, lon = np.radians(HOME[:2])
    e2 = FLATTENING * (2 - FLATTENING)
    height = HOME[2] + UNDULATION_M
    normal = SEMI_MAJOR_M / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    home = np.array(
        [
            (normal + height) * np.cos(lat) * np.cos(lon),
            (normal + height) * np.cos(lat) * np.sin(lon),
            (normal * (1 - e2) + height) * np.sin(lat),
        ]
    )
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    x, y, z = (home + world @ np.array([east, np.cross(up, east), up])).T
    across = np.hypot(x, y)
    phi = np.arctan2(z, across * (1 - e2))
    for _ in range(8):
        normal_here = SEMI_MAJOR_M / np.sqrt(1 - e2 * np.sin(phi) ** 2)
        above = across / np.cos(phi) - normal_here
        phi = np.arctan2(z, across * (1 - e2 * normal_here / (normal_here + above)))
    return np.column_stack([np.degrees(phi), np.degrees(np.arctan2(y, x)), above - UNDULATION_M])


# --- files --------------------------------------------------------------------------------------


@lru_cache
def blank_jpeg(width: int, height: int, tags: tuple[tuple[str, Any], ...] = ()) -> bytes:
    """Black picture, with make, model and focal length in EXIF where given."""
    image, buffer = Image.new("L", (width, height)), io.BytesIO()
    exif = Image.Exif()
    given = dict(tags)
    if given:
        exif[0x010F], exif[0x0110] = given["make"], given["model"]
        exif.get_ifd(0x8769)[0x920A] = given["focal_mm"]
        exif.get_ifd(0x8769)[0xA405] = given["equivalent_mm"]
    image.save(buffer, "JPEG", quality=30, exif=exif)
    return buffer.getvalue()


def write_survey(survey: Survey, folder: Path) -> Path:
    """Write a survey as its user would have it; return its project file."""
    folder.mkdir(parents=True, exist_ok=True)
    tags = tuple(sorted((survey.camera_auto or {}).items()))
    plain = blank_jpeg(survey.lens.width, survey.lens.height, tags)
    for k in range(len(survey.poses)):  # no two alike: they would count as copies
        (folder / survey.photo(k)).write_bytes(plain + survey.photo(k).encode())
    rows = [
        {"image": survey.photo(p.photo), "label": p.label, "u_px": _text(p.at[0], 2)}
        | {"v_px": _text(p.at[1], 2), **p.extra}
        for p in survey.picks
    ]
    _write_table(folder / "picks.csv", ("image", "label", "u_px", "v_px"), rows)
    rows = [
        {"name": one.name, "from": one.ends[0], "to": one.ends[1]}
        | {"length_m": _text(one.length, 3), "sigma_m": one.sigma, **one.extra}
        for one in survey.lines
    ]
    _write_table(folder / "lines.csv", ("name", "from", "to", "length_m", "sigma_m"), rows)
    rows = [
        {"name": name, "kind": kind, "points": ";".join(labels)}
        for name, kind, labels in survey.measure
    ]
    _write_table(folder / "measure.csv", ("name", "kind", "points"), rows)
    project: dict[str, Any] = {"name": "trust", "images": "*.jpg", "picks": "picks.csv"}
    project |= {"measure": "measure.csv", "camera": "camera.yaml"}
    if survey.lines:
        project["lines"] = "lines.csv"
    if survey.log is not None:
        write_log(folder / "flight.tlog", survey.log)
        project["log"] = "flight.tlog"
    if survey.control:
        places = geodetic_from_enu(np.array(list(survey.control.values())))
        rows = [
            {"label": label, "latitude_deg": f"{lat:.9f}", "longitude_deg": f"{lon:.9f}"}
            | {"height_m": _text(up, 3), "sigma_m": 0.02}
            for label, (lat, lon, up) in zip(survey.control, places, strict=True)
        ]
        _write_table(folder / "control.csv", tuple(rows[0]), rows)
        project["control"] = "control.csv"
    if survey.camera_auto is None:
        lens = survey.lens
        camera = {"name": "study camera", "model": "brown", "width_px": lens.width}
        camera |= {"height_px": lens.height, "parameters": lens.stated.tolist()}
        camera["sigma"] = lens.sigma.tolist()
        (folder / "camera.yaml").write_text(json.dumps(camera))
    else:
        project["camera"] = "auto"
    project |= survey.options
    (folder / "project.yaml").write_text(json.dumps(project, indent=1))  # JSON is YAML
    return folder / "project.yaml"


def _write_table(
    path: Path, columns: tuple[str, ...], rows: Sequence[Mapping[str, object]]
) -> None:
    names = [*columns, *dict.fromkeys(name for row in rows for name in row if name not in columns)]
    lines = [",".join(str(row.get(name, "")) for name in names) for row in rows]
    path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}"
