"""A made-up but consistent survey: what a run would hand to the views.

The projections are OpenCV's, so
that what the views draw can be compared with a second opinion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypedDict

import cv2
import numpy as np
from numpy.typing import ArrayLike
from pyproj import Transformer
from pyproj.enums import TransformDirection

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.observations import MeasurementKind
from uavgram.model.provenance import InputDigest, Provenance
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import (
    Alternative,
    AreaPlane,
    Estimate,
    GroupFactor,
    Result,
    SharedResult,
    SolutionSummary,
)
from uavgram.model.result.tables import (
    FrameResults,
    FrameStatus,
    LineChecks,
    LineResults,
    LineStatus,
    MeasurementResults,
    PickResults,
    PickStatus,
    PlanarUncertainty,
    PointChecks,
    PointResults,
    PoseTable,
)
from uavgram.model.survey import Geodetic, World

WIDTH_PX, HEIGHT_PX = 1640, 1232
LENS = np.array([1310.0, 1312.0, 818.0, 617.0, -0.11, 0.05, 4e-4, -3e-4, -0.01])
LENS_SIGMA = np.array([2.0, 2.0, 1.5, 1.5, 2e-3, 3e-3, 1e-4, 1e-4, 2e-3])
EAST_M, NORTH_M = 70.0, 50.0
HEIGHT_M = 42.0
TO_EARTH = Transformer.from_pipeline(
    "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
    "+lat_0=48.1372 +lon_0=11.5755 +h_0=519.2"
)
START_UTC_S = 1_767_607_200.0

Line = tuple[str, str, str, LineStatus, float]
Measure = tuple[str, MeasurementKind, tuple[str, ...], str]

# (name, from, to, status, error [m]): one of each kind.
LINES: tuple[Line, ...] = (
    ("R1 kerb", "P00", "P05", "used", 0.006),
    ("R2 lane", "P06", "P12", "used", -0.004),
    ("R3 hedge", "P17", "P23", "suspect", 0.21),
    ("R4 wall", "P24", "P28", "checked", 0.017),
    ("R5 gate", "P02", "P14", "used", 0.002),
    ("R6 fence", "P03", "Q99", "unseen", np.nan),
)
SUSPECT = Verdict(
    level="amber",
    reasons=(
        Reason(
            cause="line-suspect",
            text="Line 'R3 hedge' disagrees by 0.21 m (w = 13.5): read the tape again.",
            lengths=("R3 hedge",),
        ),
        Reason(cause="measurement-null", text="'to the tree' cannot be measured."),
    ),
)
MEASURES: tuple[Measure, ...] = (
    ("skid left", "distance", ("P01", "P10"), "m"),
    ("skid right", "distance", ("P07", "P16"), "m"),
    ("road width", "line_distance", ("P08", "P12", "P15"), "m"),
    ("path", "polyline", ("P18", "P19", "P20", "P26"), "m"),
    ("patch", "area", ("P03", "P04", "P09", "P10"), "m2"),
    ("bend", "angle", ("P00", "P05", "P11"), "deg"),
    ("rest position east", "coordinate", ("P13",), "m"),
    ("rest position north", "coordinate", ("P13",), "m"),
    ("skid speed", "skid_speed", ("P01", "P10"), "m/s"),
    ("to the tree", "distance", ("P01", "tree"), "m"),
)


class _Points(TypedDict):
    position: Floats
    covariance: Floats
    ellipse: Floats
    azimuth: Floats
    geo: Floats
    relative: PlanarUncertainty


class _Frames(TypedDict):
    id: list[str]
    status: list[FrameStatus]
    reason: list[str]
    time: Floats
    center: Floats
    rotation: Floats
    seed_center: Floats
    seed_rotation: Floats
    refined: Bools


class _Picks(TypedDict):
    image: list[str]
    label: list[str]
    pixel: list[Floats]
    residual: Floats
    status: list[PickStatus]


def ground_rgb(east_m: Floats, north_m: Floats) -> Image:
    """Colour of the made-up ground: a road with a dashed centre line through grass."""
    grass = 90 + 25 * np.sin(east_m * 1.7) * np.sin(north_m * 1.3)
    rgb = np.stack([0.55 * grass, grass, 0.45 * grass], axis=-1)
    road = np.abs(north_m - 0.1 * east_m) < 6
    rgb[road] = (96, 96, 100)
    dash = road & (np.abs(north_m - 0.1 * east_m) < 0.3) & ((east_m % 6) < 3)
    rgb[dash] = (235, 235, 225)
    field = (np.abs(east_m + 15) < 14) & (np.abs(north_m + 18) < 7)
    rgb[field] = (150, 110, 80)
    return rgb.astype(np.uint8)


def poses(count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """(F, 3) centres and (F, 3, 3) rotations: two strips flown back and forth, slightly tilted."""
    strip = np.arange(count) % max(1, (count + 1) // 2)
    lane = np.arange(count) // max(1, (count + 1) // 2)
    along = np.linspace(-0.4, 0.4, max(2, (count + 1) // 2))[strip] * EAST_M
    center = np.stack(
        [
            np.where(lane == 0, along, -along),
            np.where(lane == 0, -11.0, 11.0),
            0 * along + HEIGHT_M,
        ],
        1,
    ) + rng.normal(0, [0.4, 0.4, 0.3], (count, 3))
    down = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])  # image up is north
    vectors = rng.normal(0, [0.05, 0.05, 0.03], (count, 3))
    turns = np.stack([cv2.Rodrigues(v)[0] for v in vectors])
    return center, down @ turns


def project(center: Floats, rotation: Floats, points: Floats) -> Floats:
    """(K, 2) pixels after OpenCV."""
    if not len(points):
        return np.zeros((0, 2))
    k = np.array([[LENS[0], 0, LENS[2]], [0, LENS[1], LENS[3]], [0, 0, 1.0]])
    rvec = cv2.Rodrigues(rotation.T)[0]
    image, _ = cv2.projectPoints(points, rvec, -rotation.T @ center, k, LENS[4:])
    return np.asarray(image[:, 0], np.float64)


def render(center: Floats, rotation: Floats, scale: int) -> Image:
    """RGB photo of the ground z = 0, reduced by `scale`."""
    w, h = WIDTH_PX // scale, HEIGHT_PX // scale
    u, v = np.meshgrid((np.arange(w) + 0.5) * scale - 0.5, (np.arange(h) + 0.5) * scale - 0.5)
    k = np.array([[LENS[0], 0, LENS[2]], [0, LENS[1], LENS[3]], [0, 0, 1.0]])
    pixels = np.stack([u.ravel(), v.ravel()], 1)[:, None]
    rays = cv2.undistortPoints(pixels, k, LENS[4:])[:, 0]
    world = np.concatenate([rays, np.ones((len(rays), 1))], 1) @ rotation.T
    ground = center[:2] + world[:, :2] * (-center[2] / world[:, 2])[:, None]
    return ground_rgb(ground[:, 0], ground[:, 1]).reshape(h, w, 3)


def _table(center: Floats, rotation: Floats, sigma: Floats) -> PoseTable:
    covariance = np.tile(np.diag(sigma**2), (len(center), 1, 1))
    covariance[np.isnan(center[:, 0])] = np.nan
    return PoseTable(center_world_m=center, world_from_camera=rotation, covariance=covariance)


def _estimate(value: ArrayLike, sigma: ArrayLike) -> Estimate:
    return Estimate(value=np.atleast_1d(value), sigma=np.atleast_1d(sigma))


def _points(count: int, rng: np.random.Generator, *, on_earth: bool) -> _Points:
    grid = np.stack(np.meshgrid(np.linspace(-0.45, 0.45, 6), np.linspace(-0.42, 0.42, 5)), -1)
    spots = grid.reshape(-1, 2) * [EAST_M, NORTH_M] + rng.normal(0, 1.2, (30, 2))
    if count > len(spots):
        spots = np.concatenate([spots, rng.uniform(-0.5, 0.5, (count - 30, 2)) * [EAST_M, NORTH_M]])
    spots = spots[:count]
    major = 0.02 + 0.0015 * np.linalg.norm(spots, axis=1)
    minor = 0.6 * major
    azimuth = rng.uniform(0, np.pi, count)
    # within the survey: smaller, and turned by half a radian
    within = (azimuth + 0.5) % np.pi
    geo = np.full((count, 2), np.nan)
    if on_earth:
        longitude, latitude, _ = TO_EARTH.transform(
            spots[:, 0], spots[:, 1], np.zeros(count), direction=TransformDirection.INVERSE
        )
        geo = np.stack([latitude, longitude], 1)
    return {
        "position": np.concatenate([spots, np.zeros((count, 1))], 1),
        "covariance": _covariance(major, minor, azimuth),
        "ellipse": 2.4477 * np.stack([major, minor], 1),
        "azimuth": azimuth,
        "geo": geo,
        "relative": PlanarUncertainty(
            covariance_m2=_covariance(major / 4, minor / 4, within),
            ellipse_95_m=2.4477 * np.stack([major, minor], 1) / 4,
            ellipse_azimuth_rad=within,
        ),
    }


def _covariance(major: Floats, minor: Floats, azimuth: Floats) -> Floats:
    """(K, 2, 2) of east and north from sigmas along and across an azimuth."""
    axis = np.stack([np.sin(azimuth), np.cos(azimuth)], 1)
    side = np.stack([axis[:, 1], -axis[:, 0]], 1)
    along = (major**2)[:, None, None] * axis[:, :, None] * axis[:, None, :]
    covariance: Floats = along + (minor**2)[:, None, None] * side[:, :, None] * side[:, None, :]
    return covariance


def _picks(frames: _Frames, labels: list[str], spots: Floats, rng: np.random.Generator) -> _Picks:
    image: list[str] = []
    label: list[str] = []
    pixel: list[Floats] = []
    for index, frame_id in enumerate(frames["id"]):
        if frames["status"][index] not in ("refined", "rejected"):
            continue
        seen = project(frames["center"][index], frames["rotation"][index], spots)
        inside = ((seen > 20) & (seen < [WIDTH_PX - 20, HEIGHT_PX - 20])).all(axis=1)
        for k in np.flatnonzero(inside):
            image.append(frame_id)
            label.append(labels[k])
            pixel.append(seen[k])
    residual = rng.normal(0, 0.7, (len(image), 2))
    status: list[PickStatus] = ["used"] * len(image)
    rejected = {i for i, s in zip(frames["id"], frames["status"], strict=True) if s == "rejected"}
    unused = np.array([i in rejected for i in image], dtype=bool)
    residual[unused] = np.nan
    status = ["unused" if no else "used" for no in unused]
    if len(image) > 12:
        residual[7], status[7] = (5.5, -4.0), "suspect"
    return {"image": image, "label": label, "pixel": pixel, "residual": residual, "status": status}


def _lines(labels: list[str], spots: Floats, wanted: tuple[Line, ...]) -> LineResults:
    at = dict(zip(labels, spots, strict=True))
    rows = [r for r in wanted if r[1] in at]
    fits = np.array([np.linalg.norm(at[r[1]] - at[r[2]]) if r[2] in at else np.nan for r in rows])
    error = np.array([r[4] for r in rows], dtype=float)
    taped = np.where(np.isfinite(fits), fits - np.nan_to_num(error), 12.0)
    judged = np.array([r[3] in ("used", "suspect") for r in rows], dtype=bool)
    return LineResults(
        name=tuple(r[0] for r in rows),
        start=tuple(r[1] for r in rows),
        end=tuple(r[2] for r in rows),
        length_m=taped,
        sigma_m=np.full(len(rows), 0.01),
        adjusted_m=fits,
        adjusted_sigma_m=np.where(np.isfinite(fits), 0.012, np.nan),
        residual_m=fits - taped,
        w=(fits - taped) / 0.0156,
        redundancy=np.where(judged, 0.6, np.nan),
        mdb_m=np.where(judged, 0.053, np.nan),
        status=tuple(r[3] for r in rows),
    )


def _measurements(
    labels: list[str], spots: Floats, wanted: tuple[Measure, ...], *, clean: bool
) -> MeasurementResults:
    at = dict(zip(labels, spots, strict=True))
    value = np.full(len(wanted), np.nan)
    for row, (name, kind, points, _) in enumerate(wanted):
        if any(p not in at for p in points):
            continue
        corner = np.array([at[p] for p in points])
        value[row] = {
            "area": 143.0,
            "angle": 87.5,
            "coordinate": corner[0, 0] if "east" in name else corner[0, 1],
            "line_distance": 6.31,
            "skid_speed": 13.9,
        }.get(kind, np.linalg.norm(np.diff(corner, axis=0), axis=1).sum())
    sigma = np.where(
        np.isfinite(value), np.resize([0.021, 0.034, 0.012, 0.06, 0.9, 0.11], len(wanted)), np.nan
    )
    correlation = np.eye(len(wanted))
    correlation[np.isnan(value)] = np.nan
    correlation[:, np.isnan(value)] = np.nan
    return MeasurementResults(
        name=tuple(w[0] for w in wanted),
        kind=tuple(w[1] for w in wanted),
        points=tuple(w[2] for w in wanted),
        value=value,
        sigma=sigma,
        unit=tuple(w[3] for w in wanted),
        interval_95=value[:, None] + 1.959964 * sigma[:, None] * [-1, 1],
        correlation=correlation,
        status=tuple(
            "not-checked" if np.isnan(one) else "ok" if clean else "doubtful" for one in value
        ),
    )


def _frames(count: int, rng: np.random.Generator, *, telemetry: bool) -> _Frames:
    center, rotation = poses(count, rng)
    status: list[FrameStatus] = ["refined"] * count
    if count >= 20:
        status[5], status[11], status[14] = "unmatched", "rejected", "seeded"
    unmatched = np.array([s == "unmatched" for s in status], dtype=bool)
    seeded = ~unmatched & telemetry
    reason = {
        "unmatched": "outside the flight log by 12.4 s",
        "rejected": "its picks contradict all other frames",
        "seeded": "no picks",
    }
    shift = rng.normal([1.2, -0.8, 1.5], 0.3, (count, 3))
    turns = np.stack([cv2.Rodrigues(v)[0] for v in rng.normal(0, 0.02, (count, 3))])
    return {
        "id": [f"DSC_{i:04d}.jpg" for i in range(count)],
        "status": status,
        "reason": [reason.get(s, "") for s in status],
        "time": np.where(unmatched, np.nan, START_UTC_S + 2.0 * np.arange(count, dtype=float)),
        "center": center,
        "rotation": rotation,
        "seed_center": np.where(seeded[:, None], center + shift, np.nan),
        "seed_rotation": np.where(seeded[:, None, None], rotation @ turns, np.nan),
        "refined": np.array([s == "refined" for s in status], dtype=bool),
    }


class Variant(TypedDict, total=False):
    """What a test may ask of `build`."""

    frame_count: int
    point_count: int
    telemetry: bool
    lines: tuple[Line, ...]
    measures: tuple[Measure, ...]
    label: str
    clean: bool


def build(
    *,
    frame_count: int = 20,
    point_count: int = 30,
    telemetry: bool = True,
    lines: tuple[Line, ...] = LINES,
    measures: tuple[Measure, ...] = MEASURES,
    label: str = "P{:02d}",
    clean: bool = False,
) -> Result:
    """One survey; `clean` leaves out everything that deserves a second look."""
    rng = np.random.default_rng(7)
    frames = _frames(frame_count, rng, telemetry=telemetry)
    if clean:
        frames["status"] = ["refined"] * frame_count
        frames["reason"] = [""] * frame_count
        frames["refined"][:] = True
        frames["time"] = START_UTC_S + 2.0 * np.arange(frame_count, dtype=float)
        lines = tuple((*r[:3], "used" if r[3] == "suspect" else r[3], 0.005) for r in lines[:5])
        measures = measures[:9]
    verdict = Verdict(level="green") if clean else SUSPECT
    labels = [label.format(i) for i in range(point_count)]
    points = _points(point_count, rng, on_earth=telemetry)
    picks = _picks(frames, labels, points["position"], rng)
    status: list[PickStatus] = ["used" if clean and s == "suspect" else s for s in picks["status"]]
    residual = (
        np.where(np.abs(picks["residual"]) > 3, 0.5, picks["residual"])
        if clean
        else picks["residual"]
    )
    refined = frames["refined"]
    line_results = _lines(labels, points["position"], lines)
    checked = [i for i, s in enumerate(line_results.status) if s == "checked"]
    none = np.full(len(picks["image"]), np.nan)
    return Result(
        name="crossing",
        provenance=Provenance(
            program="uavgram",
            version="0.1.0",
            created_utc="2026-01-05T11:00:00Z",
            made_by="Ada Lovelace",
            inputs=(
                InputDigest(path="project.yaml", sha256="ab" * 32, size_bytes=812),
                InputDigest(path="flight.BIN", sha256="c0" * 32, size_bytes=5_812_001),
            ),
            options=(("ground.height_sigma_m", 0.3), ("solve.outliers", "report")),
            seed=None,
            packages=(("numpy", "2.3.1"), ("rerun-sdk", "0.41.0")),
        ),
        world=World(
            origin=Geodetic(48.1372, 11.5755, 519.2) if telemetry else None,
            height_datum="msl",
            gauge="world" if telemetry else "plane",
        ),
        camera=Calibration(
            name="test camera",
            model="brown",
            width_px=WIDTH_PX,
            height_px=HEIGHT_PX,
            parameters=LENS * np.where(np.arange(9) < 2, 1.001, 1.0),
            covariance=np.diag(LENS_SIGMA**2),
        ),
        shared=SharedResult(
            boresight_deg=_estimate([0.2, -0.1, 0.4], [0.05] * 3) if telemetry else None,
            lever_arm_m=_estimate([0.0, 0.0, 0.02], [0.1] * 3) if telemetry else None,
            position_bias_m=_estimate([1.2, -0.8, 1.5], [0.3, 0.3, 0.4]) if telemetry else None,
            heading_bias_deg=_estimate([0.7], [0.2]) if telemetry else None,
            clock_offset_s=_estimate([0.31], [0.04]) if telemetry else None,
            intrinsics=_estimate(LENS, 0.5 * LENS_SIGMA),
        ),
        areas=(
            AreaPlane(
                name="default",
                height_m=_estimate([0.0], [0.05]),
                slope_deg=_estimate([0.0, 0.0], [0.1, 0.1]),
                pivot_m=np.zeros(2),
            ),
        ),
        frames=FrameResults(
            frame_id=tuple(frames["id"]),
            path=tuple(f"photos/{i}" for i in frames["id"]),
            time_utc_s=frames["time"],
            status=tuple(frames["status"]),
            reason=tuple(frames["reason"]),
            seed=_table(
                frames["seed_center"],
                frames["seed_rotation"],
                np.array([1.5, 1.5, 2.0, 0.02, 0.02, 0.04]),
            ),
            refined=_table(
                np.where(refined[:, None], frames["center"], np.nan),
                np.where(refined[:, None, None], frames["rotation"], np.nan),
                np.array([0.12, 0.12, 0.15, 0.003, 0.003, 0.002]),
            ),
        ),
        points=PointResults(
            label=tuple(labels),
            position_world_m=points["position"],
            covariance_m2=points["covariance"],
            ellipse_95_m=points["ellipse"],
            ellipse_azimuth_rad=points["azimuth"],
            relative=points["relative"],
            departure_m=np.zeros(len(labels)),
            departure_sigma_m=np.zeros(len(labels)),
            height_above_ground_m=np.zeros(len(labels)),
            height_sigma_m=np.zeros(len(labels)),
            height_source=tuple("ground" for _ in labels),
            covariance_m3=np.zeros((len(labels), 3, 3)),
            latitude_deg=points["geo"][:, 0],
            longitude_deg=points["geo"][:, 1],
            frames=tuple(
                tuple(i for i, p in zip(picks["image"], picks["label"], strict=True) if p == name)
                if point_count <= 100
                else (frames["id"][0],)
                for name in labels
            ),
        ),
        lines=line_results,
        picks=PickResults(
            image=tuple(picks["image"]),
            label=tuple(picks["label"]),
            pixel_px=np.reshape(picks["pixel"], (-1, 2)),
            sigma_px=np.ones(len(picks["image"])),
            residual_px=np.reshape(residual, (-1, 2)),
            w=np.where(np.isfinite(residual[:, 0]), np.abs(residual).max(axis=1), np.nan)
            if len(none)
            else none,
            redundancy=np.where(np.isfinite(residual[:, 0]), 0.7, np.nan) if len(none) else none,
            status=tuple(status),
        ),
        measurements=_measurements(labels, points["position"], measures, clean=clean),
        point_checks=PointChecks(
            label=("P21", "P29")[: 2 if point_count >= 30 and telemetry else 0],
            error_m=np.array([[0.012, -0.020, 0.03], [0.05, 0.004, -0.01]])[
                : 2 if point_count >= 30 and telemetry else 0
            ],
            sigma_m=np.full((2 if point_count >= 30 and telemetry else 0, 3), 0.03),
            mahalanobis=np.array([1.2, 1.7])[: 2 if point_count >= 30 and telemetry else 0],
        ),
        line_checks=LineChecks(
            name=tuple(line_results.name[i] for i in checked),
            error_m=line_results.residual_m[checked],
            sigma_m=np.full(len(checked), 0.0156),
            z=line_results.residual_m[checked] / 0.0156,
        ),
        solution=SolutionSummary(
            degrees_of_freedom=41,
            variance_factor=1.08 if clean else 1.62,
            chi2_probability=0.33 if clean else 0.0004,
            iterations=6,
            converged=True,
            alternatives=()
            if telemetry
            else (
                Alternative(
                    frame_id=frames["id"][0], cost=12.5, height_m=43.0, tilt_deg=9.0, values=(1.0,)
                ),
            ),
            groups=(
                GroupFactor(
                    name="pixels",
                    observations=240,
                    redundancy=36.0,
                    variance_factor=1.02,
                    probability=0.4,
                ),
                GroupFactor(
                    name="lengths",
                    observations=4,
                    redundancy=2.4,
                    variance_factor=9.1,
                    probability=1e-5,
                ),
            ),
        ),
        verdict=replace(verdict, level=verdict.level if measures else None),
        messages=(Message("info", "origin-home", "The origin is home."),)
        if clean
        else (
            Message(
                "info",
                "origin-home",
                "The origin is home: 48.1372, 11.5755, 519.2 m above mean sea level.",
            ),
            Message("warning", "line-suspect", SUSPECT.reasons[0].text),
            Message(
                "error",
                "label-unseen",
                "Measurement 'to the tree': label 'tree' was never picked; did you mean 'three'?",
            ),
        ),
    )


def jpeg(rgb: Image) -> bytes:
    """Encoded photo."""
    return cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
