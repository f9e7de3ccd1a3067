"""Tables of a result in results.json; their data classes name the keys (`Column`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.io.results.codec import Json, Record, Table, encode, join_records, numbers
from uavgram.model.naming import row_shapes
from uavgram.model.result.known import ControlLineResults, KnownResults
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
    ProfileResults,
)

_ELLIPSE = ("ellipse_95_m", "ellipse_azimuth_rad")
FRAMES = Table(FrameResults, elsewhere=("seed", "refined", "folder"))
POSES = Table(PoseTable)
POINTS = Table(PointResults, elsewhere=(*_ELLIPSE, "relative"))
RELATIVE = Table(PlanarUncertainty, elsewhere=_ELLIPSE)
LINES = Table(LineResults)
KNOWN = Table(KnownResults)
CONTROL_LINES = Table(ControlLineResults)
PICKS = Table(PickResults)
MEASUREMENTS = Table(MeasurementResults, elsewhere=("correlation",))
PROFILES = Table(ProfileResults)
POINT_CHECKS = Table(PointChecks)
LINE_CHECKS = Table(LineChecks)
PRIORS = Table(PriorResults, elsewhere=("effects",))
EFFECTS = Table(Effects)
WEAKEST = Table(WeakestLinks)
SECOND_ORDER = Table(SecondOrder)


def dump_frames(frames: FrameResults) -> list[Record]:
    """Return the frames; a missing pose is null."""
    seed, refined = _dump_poses(frames.seed), _dump_poses(frames.refined)
    poses = [{"seed": a, "refined": b} for a, b in zip(seed, refined, strict=True)]
    return join_records(FRAMES.dump(frames), poses)


def load_frames(records: Sequence[Record]) -> FrameResults:
    """Invert `dump_frames`."""
    return FRAMES.load(
        records, **{key: _load_poses([row[key] for row in records]) for key in ("seed", "refined")}
    )


def _dump_poses(poses: PoseTable) -> list[Record | None]:
    present = [bool(np.isfinite(center).any()) for center in poses.center_world_m]
    return [row if there else None for there, row in zip(present, POSES.dump(poses), strict=True)]


def _load_poses(rows: Sequence[Record | None]) -> PoseTable:
    shapes = row_shapes(PoseTable).items()
    absent = {key: encode(np.full(shape, np.nan)) for key, shape in shapes}
    return POSES.load([row or absent for row in rows])


def dump_points(points: PointResults) -> list[Record]:
    """Return the ground points; angles in degrees for people, and in the original radians."""
    relative = join_records(RELATIVE.dump(points.relative), _dump_ellipses(points.relative))
    for row, off_ground in zip(relative, points.is_off_ground, strict=True):
        if not off_ground:
            del row["covariance_m3"]
    return join_records(
        POINTS.dump(points), _dump_ellipses(points), [{"relative": row} for row in relative]
    )


def load_points(records: Sequence[Record]) -> PointResults:
    """Invert `dump_points`."""
    nothing = {"covariance_m3": [[None] * 3] * 3}  # left out for points on the ground
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
    """Read the measured values with their correlation."""
    n = len(records)
    return MEASUREMENTS.load(
        records,
        correlation=numbers(correlation, n, n),
    )


def add_evidence(result: Result, content: Record) -> Record:
    """Add the reliability of lengths, picks, priors and measurements, row by row."""
    if (evidence := result.evidence) is not None:
        content["lines"] = join_records(content["lines"], EFFECTS.dump(evidence.lines))
        content["picks"] = join_records(content["picks"], EFFECTS.dump(evidence.picks))
        content["measurements"] = join_records(
            content["measurements"], _dump_weakest(evidence.weakest)
        )
        priors = evidence.priors
        content["priors"] = join_records(PRIORS.dump(priors), EFFECTS.dump(priors.effects))
    if result.second_order is not None:
        content["measurements"] = join_records(
            content["measurements"], SECOND_ORDER.dump(result.second_order)
        )
    return content


def load_evidence(content: Record) -> Evidence | None:
    """Read the evidence of a results file; None where it has none."""
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
    """Read the second-order terms of the measurements; None where there are none."""
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
