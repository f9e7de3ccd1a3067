"""The tables of a result in results.json: which field of a row stands under which key."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.io.results.codec import Json, Record, Table, encode, joined, numbers
from uavgram.model.result.control_lines import ControlLineResults
from uavgram.model.result.known import KnownResults
from uavgram.model.result.profiles import COLUMNS, ProfileResults
from uavgram.model.result.reliability import (
    Effects,
    Evidence,
    PriorResults,
    SecondOrder,
    WeakestLinks,
)
from uavgram.model.result.result import Result
from uavgram.model.result.tables import (
    FrameResults,
    LineChecks,
    LineResults,
    MeasurementResults,
    PickResults,
    PlanarUncertainty,
    PointChecks,
    PointResults,
    PoseTable,
)

_ELLIPSE = ("ellipse_95_m", "ellipse_azimuth_rad")
FRAMES = Table(
    FrameResults,
    keys={"sweep": "moved_while_read"},
    shape={"sweep": (6,)},
    elsewhere=("seed", "refined"),
)
POSES = Table(
    PoseTable,
    shape={"center_world_m": (3,), "world_from_camera": (3, 3), "covariance": (6, 6)},
)
POINTS = Table(
    PointResults,
    shape={"position_world_m": (3,), "covariance_m2": (2, 2), "covariance_m3": (3, 3)},
    elsewhere=(*_ELLIPSE, "relative"),
)
RELATIVE = Table(
    PlanarUncertainty,
    shape={"covariance_m2": (2, 2), "covariance_m3": (3, 3)},
    elsewhere=_ELLIPSE,
)
LINES = Table(LineResults, keys={"start": "from", "end": "to"})
KNOWN = Table(KnownResults)
CONTROL_LINES = Table(ControlLineResults, shape={"start_world_m": (3,), "end_world_m": (3,)})
PICKS = Table(PickResults, keys={"pixel_px": ("u_px", "v_px")}, shape={"residual_px": (2,)})
MEASUREMENTS = Table(MeasurementResults, shape={"interval_95": (2,)}, elsewhere=("correlation",))
PROFILES = Table(
    ProfileResults,
    keys={
        "place_m": tuple(f"{name}_m" for name in COLUMNS),
        "sigma_m": tuple(f"{name}_sigma_m" for name in COLUMNS),
    },
)
POINT_CHECKS = Table(PointChecks, shape={"error_m": (3,), "sigma_m": (3,)})
LINE_CHECKS = Table(LineChecks)
PRIORS = Table(
    PriorResults, keys={"residual": "residual_sigmas", "bias": "mdb"}, elsewhere=("effects",)
)
EFFECTS = Table(
    Effects, keys={"on": "external_on", "change": "external", "sigmas": "external_sigmas"}
)
WEAKEST = Table(WeakestLinks, keys={"bias": "mdb"})
SECOND_ORDER = Table(
    SecondOrder,
    keys={"bias": "second_order_bias", "sigma": "second_order_sigma", "off": "first_order_off"},
)


def dump_frames(frames: FrameResults) -> list[Record]:
    """Frames; a pose that a frame does not have is null."""
    seed, refined = _dump_poses(frames.seed), _dump_poses(frames.refined)
    poses = [{"seed": a, "refined": b} for a, b in zip(seed, refined, strict=True)]
    return joined(FRAMES.dump(frames), poses)


def load_frames(records: Sequence[Record]) -> FrameResults:
    """Inverse of `dump_frames`."""
    return FRAMES.load(
        records, **{key: _load_poses([row[key] for row in records]) for key in ("seed", "refined")}
    )


def _dump_poses(poses: PoseTable) -> list[Record | None]:
    present = [bool(np.isfinite(center).any()) for center in poses.center_world_m]
    return [row if there else None for there, row in zip(present, POSES.dump(poses), strict=True)]


def _load_poses(rows: Sequence[Record | None]) -> PoseTable:
    absent = {key: encode(np.full(shape, np.nan)) for key, shape in POSES.shape.items()}
    return POSES.load([row or absent for row in rows])


def dump_points(points: PointResults) -> list[Record]:
    """Ground points; degrees for people, and the radians that they are made of."""
    relative = joined(RELATIVE.dump(points.relative), _dump_ellipses(points.relative))
    for row, off_ground in zip(relative, points.is_off_ground, strict=True):
        if not off_ground:
            del row["covariance_m3"]
    return joined(
        POINTS.dump(points), _dump_ellipses(points), [{"relative": row} for row in relative]
    )


def load_points(records: Sequence[Record]) -> PointResults:
    """Inverse of `dump_points`."""
    nothing = {"covariance_m3": [[None] * 3] * 3}  # left out of points on the ground
    relative = [nothing | row["relative"] for row in records]
    return POINTS.load(
        records,
        **_load_ellipses(records),
        relative=RELATIVE.load(relative, **_load_ellipses(relative)),
    )


def _dump_ellipses(points: PointResults | PlanarUncertainty) -> list[Record]:
    axes, azimuth = points.ellipse_95_m, points.ellipse_azimuth_rad
    keys = ("semi_major_m", "semi_minor_m", "azimuth_deg", "azimuth_rad")
    rows = np.column_stack([axes, np.rad2deg(azimuth), azimuth]).tolist()
    return [{"ellipse_95": dict(zip(keys, row, strict=True))} for row in rows]


def _load_ellipses(records: Sequence[Record]) -> Record:
    ellipses = [row["ellipse_95"] for row in records]
    axes = [[ellipse["semi_major_m"], ellipse["semi_minor_m"]] for ellipse in ellipses]
    azimuth = [ellipse["azimuth_rad"] for ellipse in ellipses]
    return {
        "ellipse_95_m": numbers(axes, len(records), 2),
        "ellipse_azimuth_rad": numbers(azimuth, len(records)),
    }


def load_measurements(records: Sequence[Record], correlation: Json) -> MeasurementResults:
    """Measured values, their correlation beside them."""
    n = len(records)
    return MEASUREMENTS.load(
        records,
        correlation=numbers(correlation, n, n),
    )


def with_evidence(result: Result, content: Record) -> Record:
    """What is known of the reliability of lengths, picks, priors and measurements, row by row."""
    if (evidence := result.evidence) is not None:
        content["lines"] = joined(content["lines"], EFFECTS.dump(evidence.lines))
        content["picks"] = joined(content["picks"], EFFECTS.dump(evidence.picks))
        content["measurements"] = joined(content["measurements"], _dump_weakest(evidence.weakest))
        priors = evidence.priors
        content["priors"] = joined(PRIORS.dump(priors), EFFECTS.dump(priors.effects))
    if result.second_order is not None:
        content["measurements"] = joined(
            content["measurements"], SECOND_ORDER.dump(result.second_order)
        )
    return content


def load_evidence(content: Record) -> Evidence | None:
    """Evidence of a results file; None where it has none."""
    if "priors" not in content:
        return None
    priors = content["priors"]
    return Evidence(
        lines=EFFECTS.load(content["lines"]),
        picks=EFFECTS.load(content["picks"]),
        priors=PRIORS.load(priors, effects=EFFECTS.load(priors)),
        weakest=_load_weakest(content["measurements"]),
    )


def load_second_order(records: Sequence[Record]) -> SecondOrder | None:
    """Second-order terms of the measurements; None where there are none."""
    if not records or "second_order_sigma" not in records[0]:
        return None
    return SECOND_ORDER.load(records)


def _dump_weakest(weakest: WeakestLinks) -> list[Record]:
    rows = WEAKEST.dump(weakest)
    unchecked = [row.pop("unchecked") for row in rows]
    return [
        {"weakest": row if row["what"] else None, "unchecked": names}
        for row, names in zip(rows, unchecked, strict=True)
    ]


def _load_weakest(records: Sequence[Record]) -> WeakestLinks:
    none = {"what": "", "mdb": None, "unit": "", "change": None}
    return WEAKEST.load(
        [(row["weakest"] or none) | {"unchecked": row["unchecked"]} for row in records]
    )
