"""Writes a rendered street as the folder that the program takes, and its truth beside it.

Files are in a world of east, north, up about the take-off, which lies in the street's middle.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from hostile_log import BOOT_S, HOME, START_UTC_S, TO_WORLD, UNDULATION_M
from hostile_world import Smooth
from scipy.spatial.transform import Rotation

from streets.street import Street
from uavgram.io.logs.tlog.writer import write_tlog
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import SimulatedLog

Seeds = Literal["log", "csv", "places", "times", "none"]
"""What says where the photos were taken: a log, a table of poses, one of places only, nothing but
when (by the names of the photos, as EXIF states it with sub-seconds), nothing."""

PLACE_SIGMA_M, ANGLE_SIGMA_DEG = 0.7, 0.7
BIAS_M, TURN_DEG = 0.7, 0.7  # common to the flight: with the former 1 m and 1 degree
WANDER_S = 10.0
LENS_SIGMA = (2.4, 2.4, 1.6, 1.6, 1.5e-3, 3e-3, 1e-4, 1e-4, 1e-5)
JPEG = 85


@dataclass(frozen=True, kw_only=True)
class Pick:
    """A picked pixel."""

    photo: str
    label: str
    u_px: float
    v_px: float
    sigma_px: float


@dataclass(frozen=True, kw_only=True)
class Tables:
    """What a person made: picks, lengths (from, to, metres, sigma), pairs to measure."""

    picks: Sequence[Pick]
    lengths: Sequence[tuple[str, str, float, float]] = ()
    distances: Sequence[tuple[str, str]] = ()


def turn(street: Street) -> Floats:
    """(3, 3) from the street's frame to the world's."""
    heading = np.random.default_rng((99, street.seed)).uniform(0, 2 * np.pi)
    return np.asarray(Rotation.from_euler("z", heading).as_matrix())


def photo_names(street: Street) -> tuple[str, ...]:
    """Names of the photos: when they were taken, UTC."""
    start = datetime.fromtimestamp(START_UTC_S, UTC)
    times = (start + timedelta(seconds=float(t)) for t in street.flight.exposure_s)
    return tuple(f"{time:%Y%m%d_%H%M%S_%f}.jpg" for time in times)


def picked(
    street: Street,
    kinds: str,
    photos_each: int,
    noise_px: float,
    rng: np.random.Generator,
) -> list[Pick]:
    """Pick points of some kinds, each in so many photos that show it best.

    Parameters
    ----------
    street
        Whose points.
    kinds
        First letters of labels.
    photos_each
        In how many photos each, those first where it is nearest to the middle; 0: in all.
    noise_px
        Of each coordinate; 0: exact, with a stated sigma of 0.05 px.
    rng
        Draws the noise.
    """
    names = photo_names(street)
    wanted = [k for k, label in enumerate(street.label) if label[0] in kinds]
    pixel, seen = sightings(street, street.point[wanted])
    middle = np.array([street.camera.width_px, street.camera.height_px]) / 2
    picks = []
    for j, k in enumerate(wanted):
        away = np.where(seen[:, j], np.linalg.norm(pixel[:, j] - middle, axis=1), np.inf)
        for photo in np.argsort(away)[: photos_each or None]:
            if not np.isfinite(away[photo]):
                continue
            u, v = pixel[photo, j] + noise_px * rng.standard_normal(2)
            picks.append(
                Pick(
                    photo=names[photo],
                    label=street.label[k],
                    u_px=float(u),
                    v_px=float(v),
                    sigma_px=noise_px or 0.05,
                )
            )
    return picks


def sightings(street: Street, point: Floats) -> tuple[Floats, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Exact pixels (photos, n, 2) of points (n, 3), and whether each is visible."""
    both = [street.sighted(photo, point) for photo in range(len(street.view))]
    return np.stack([pixel for pixel, _ in both]), np.stack([seen for _, seen in both])


def write_street(
    street: Street,
    folder: Path,
    tables: Tables,
    seeds: Seeds = "log",
    options: Mapping[str, Any] | None = None,
) -> Path:
    """Write a project with its photos, and truth.json; gives the project's file.

    Parameters
    ----------
    street
        To write.
    folder
        Made where it is missing. Photos that it holds are not rendered again.
    tables
        Picks, lengths, what to measure.
    seeds
        What says where the photos were taken, with errors of about 1 m and 1 degree, most of
        them common to the flight or slow.
    options
        Further keys of project.yaml; those of `camera` go to camera.yaml.
    """
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    render_to(street, folder / "photos")
    options = dict(options or {})
    project: dict[str, Any] = {
        "name": f"street {street.seed}",
        "images": "photos/*.jpg",
        "camera": "camera.yaml",
        "picks": "picks.csv",
        "time": {
            "source": "filename",
            "filename_format": "%Y%m%d_%H%M%S_%f",
            "offset_s": 0.0,
            "offset_sigma_s": 0.05,
        },
        "mount": {"boresight_sigma_deg": 1.0, "lever_arm_sigma_m": 0.02},
    }
    _write_tables(folder, tables, project)
    camera = _camera_file(street) | options.pop("camera", {})
    if seeds == "log":
        write_tlog(folder / "flight.tlog", _log(street))
        project["log"] = "flight.tlog"
    elif seeds != "times":
        del project["time"]
    if seeds in ("csv", "places"):
        del project["mount"]
        (folder / "poses.csv").write_text("\n".join(_pose_rows(street, seeds)) + "\n")
        origin = dict(zip(("latitude_deg", "longitude_deg", "height_m"), HOME, strict=True))
        project |= {"poses": "poses.csv", "world": {"origin": origin}}
    project |= options
    for name, content in (("camera", camera), ("project", project)):
        (folder / f"{name}.yaml").write_text(json.dumps(content, indent=1))  # JSON is YAML
    (folder / "truth.json").write_text(json.dumps(truth(street)))
    return folder / "project.yaml"


def render_to(street: Street, folder: Path) -> None:
    """Write the photos that the folder does not hold."""
    names = photo_names(street)
    if all((folder / name).exists() for name in names):
        return
    for name, photo in zip(names, street.photos(), strict=True):
        cv2.imwrite(str(folder / name), photo, [cv2.IMWRITE_JPEG_QUALITY, JPEG])


def truth(street: Street) -> dict[str, Any]:
    """Poses, points, exact pixels with visibility, plates; in the world of the files."""
    world, names = turn(street), photo_names(street)
    pixel, seen = sightings(street, street.point)
    frames, pixels = {}, {}
    for k, (name, view) in enumerate(zip(names, street.view, strict=True)):
        frames[name] = {
            "center_world_m": (world @ view.center).tolist(),
            "world_from_camera": (world @ view.rotation).tolist(),
            "velocity_world_m_s": (world @ view.velocity).tolist(),
            "rate_camera_rad_s": view.rate.tolist(),
            "time_utc_s": float(START_UTC_S + street.flight.exposure_s[k]),
        }
        pixels[name] = {
            label: [*map(float, pixel[k, j]), bool(seen[k, j])]
            for j, label in enumerate(street.label)
            if np.isfinite(pixel[k, j]).all()
        }
    plates = [
        {
            "id": plate.number,
            "family": street.wish.family,
            "side_m": street.wish.plate_m,
            "corners": (plate.corner @ world.T).tolist(),
            "shadowed": plate.shadowed,
            "occluded": plate.occluded,
            "pixels": {
                name: [
                    [*map(float, uv), bool(ok)]
                    for uv, ok in zip(*street.sighted(k, plate.corner), strict=True)
                ]
                for k, name in enumerate(names)
            },
        }
        for plate in street.plates
    ]
    points = dict(zip(street.label, (street.point @ world.T).tolist(), strict=True))
    return {
        "intrinsics": street.camera.lens.tolist(),
        "readout_s": street.camera.readout_s,
        "frames": frames,
        "points": points,
        "pixels": pixels,
        "plates": plates,
    }


def _camera_file(street: Street) -> dict[str, Any]:
    camera = street.camera
    scale = camera.width_px / 2400
    lens = np.array([1800.0, 1801.0, 1204.0, 893.0, -0.08, 0.03, 3e-4, -2e-4, 0.0])
    lens[:4] = lens[:4] * scale + 0.5 * (scale - 1) * np.array([0, 0, 1, 1])
    sigma = np.array(LENS_SIGMA) * np.array([scale] * 4 + [1.0] * 5)
    covariance = np.diag(sigma**2)
    covariance[0, 1] = covariance[1, 0] = 0.95 * sigma[0] * sigma[1]
    result: dict[str, Any] = {
        "name": "made-up camera",
        "model": "brown",
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "parameters": lens.tolist(),
        "covariance": covariance.tolist(),
    }
    if camera.readout_s:
        result |= {"readout_ms": 1e3 * camera.readout_s, "readout_sigma_ms": 3.0}
    return result


def _errors(street: Street) -> tuple[Floats, Floats, Smooth, Smooth, np.random.Generator]:
    rng = np.random.default_rng((5, street.seed))
    bias = BIAS_M * rng.standard_normal(3)
    common = np.deg2rad(TURN_DEG) * rng.standard_normal(3)
    wander = Smooth(rng, np.full(3, PLACE_SIGMA_M), WANDER_S)
    sway = Smooth(rng, np.full(3, np.deg2rad(ANGLE_SIGMA_DEG)), WANDER_S)
    return bias, common, wander, sway, rng


def _log(street: Street) -> SimulatedLog:
    """An autopilot's log; its errors are log minus truth."""
    flight, world = street.flight, turn(street)
    bias, common, wander, sway, rng = _errors(street)
    position_s, attitude_s, gps_s = (
        np.arange(flight.start_s, flight.end_s, 1 / rate) for rate in (10.0, 20.0, 5.0)
    )

    def geodetic(time: Floats) -> Floats:
        place = flight.center(time) @ world.T + bias + wander(time)
        longitude, latitude, up = TO_WORLD.transform(
            place[:, 0], place[:, 1], place[:, 2], direction="INVERSE"
        )
        return np.column_stack([latitude, longitude, np.asarray(up) - UNDULATION_M])

    east, north, up = (flight.velocity(position_s) @ world.T).T
    # The camera hangs in a gimbal under a vehicle that stays level; the mount's own error is the
    # log's too, so that the boresight is what all photos have in common.
    turned = Rotation.from_rotvec(sway(attitude_s))
    ned = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    street_ned = Rotation.from_matrix(ned @ world @ np.diag([1.0, -1.0, -1.0]))
    mount = turned * street_ned * flight.ned_from_mount(attitude_s) * Rotation.from_rotvec(common)
    level = street_ned.as_euler("ZYX")[0] * np.ones(len(attitude_s))
    body = turned * Rotation.from_euler("Z", level[:, None])
    angles = body.as_euler("ZYX")
    gimbal = (Rotation.from_euler("Z", -angles[:, :1]) * mount).as_euler("ZYX")
    none = np.zeros((0, 3))
    return SimulatedLog(
        boot_utc_s=START_UTC_S - BOOT_S,
        home_geodetic=np.array(HOME),
        undulation_m=UNDULATION_M,
        position_time_s=BOOT_S + position_s,
        position_geodetic=geodetic(position_s),
        velocity_ned_m_s=np.column_stack([north, east, -up]),
        attitude_time_s=BOOT_S + attitude_s,
        attitude_rpy_rad=angles[:, ::-1],
        gimbal_time_s=BOOT_S + attitude_s,
        gimbal_rpy_rad=gimbal[:, ::-1],
        gps_time_s=BOOT_S + gps_s,
        gps_geodetic=geodetic(gps_s) + rng.normal(0, [2e-6, 2e-6, 0.25], (len(gps_s), 3)),
        gps_accuracy_m=np.full((len(gps_s), 2), PLACE_SIGMA_M),
        event_time_s=np.zeros(0),
        event_geodetic=none,
        event_rpy_rad=none,
    )


def _pose_rows(street: Street, seeds: Seeds) -> Iterable[str]:
    flight, world = street.flight, turn(street)
    bias, common, wander, sway, _ = _errors(street)
    time = flight.exposure_s
    place = flight.center(time) @ world.T + bias + wander(time)
    longitude, latitude, up = TO_WORLD.transform(
        place[:, 0], place[:, 1], place[:, 2], direction="INVERSE"
    )
    ned = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    street_ned = Rotation.from_matrix(ned @ world @ np.diag([1.0, -1.0, -1.0]))
    mount = Rotation.from_rotvec(sway(time)) * street_ned * flight.ned_from_mount(time)
    yaw, pitch, roll = np.rad2deg((mount * Rotation.from_rotvec(common)).as_euler("ZYX")).T
    yield "image,latitude_deg,longitude_deg,height_m,sigma_horizontal_m,sigma_vertical_m" + (
        ",yaw_deg,pitch_deg,roll_deg,sigma_attitude_deg" if seeds == "csv" else ""
    )
    for k, name in enumerate(photo_names(street)):
        height = up[k] - UNDULATION_M
        row = f"{name},{latitude[k]:.9f},{longitude[k]:.9f},{height:.4f}"
        row += f",{PLACE_SIGMA_M},{PLACE_SIGMA_M}"
        angles = f",{yaw[k]:.5f},{pitch[k]:.5f},{roll[k]:.5f},{ANGLE_SIGMA_DEG}"
        yield row + (angles if seeds == "csv" else "")


def _write_tables(folder: Path, tables: Tables, project: dict[str, Any]) -> None:
    rows = {
        "picks": ["image,label,u_px,v_px,sigma_px"]
        + [f"{p.photo},{p.label},{p.u_px:.4f},{p.v_px:.4f},{p.sigma_px}" for p in tables.picks]
    }
    if tables.lengths:
        rows["lines"] = ["name,from,to,length_m,sigma_m"] + [
            f"L{k + 1},{a},{b},{length:.5f},{sigma}"
            for k, (a, b, length, sigma) in enumerate(tables.lengths)
        ]
    if tables.distances:
        rows["measure"] = ["name,kind,points"] + [
            f"{a} to {b},distance,{a};{b}" for a, b in tables.distances
        ]
    for name, lines in rows.items():
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
        project[name] = f"{name}.csv"
