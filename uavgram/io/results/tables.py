"""The batched parts of `Result` <-> lists of records; both directions of a table side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats
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

Record = dict[str, Any]
Word = TypeVar("Word", bound=str)

_POSE_KEYS: dict[str, tuple[int, ...]] = {
    "center_world_m": (3,),
    "world_from_camera": (3, 3),
    "covariance": (6, 6),
}


def plain(value: ArrayLike) -> Any:  # noqa: ANN401
    """Plain lists and floats of an array or a number; NaN becomes None."""
    return _none_for_nan(np.asarray(value, dtype=np.float64).tolist())


def _none_for_nan(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, list):
        return [_none_for_nan(item) for item in value]
    return None if math.isnan(value) else value


def column(records: Sequence[Record], key: str, *shape: int) -> Floats:
    """(N, *shape) numbers of a key of N records; None becomes NaN."""
    return numbers([record[key] for record in records], len(records), *shape)


def numbers(value: Any, *shape: int) -> Floats:  # noqa: ANN401
    """Array of nested lists; None becomes NaN. Raises ValueError where its shape is another."""
    # Strings would be converted by numpy without a word.
    _refuse_text(value)
    array = np.array(value, dtype=np.float64).reshape(shape if 0 in shape else np.shape(value))
    if array.shape != shape:
        raise ValueError(f"expected numbers of shape {shape}, got {array.shape}")
    return array


def _refuse_text(value: Any) -> None:  # noqa: ANN401
    if isinstance(value, list):
        for item in value:
            _refuse_text(item)
    elif isinstance(value, str | bool | dict):
        raise TypeError(f"expected a number, got {value!r}")


def text(value: object) -> str:
    """Text as it is; anything else is a TypeError."""
    if not isinstance(value, str):
        raise TypeError(f"expected text, got {value!r}")
    return value


def texts(records: Sequence[Record], key: str) -> tuple[str, ...]:
    """(N,) texts of a key of N records."""
    return tuple(text(record[key]) for record in records)


def word(literal: Any, value: object) -> Any:  # noqa: ANN401
    """One of a Literal's words; anything else is a ValueError."""
    if value not in get_args(literal):
        raise ValueError(f"expected one of {', '.join(map(str, get_args(literal)))}, got {value!r}")
    return value


def one_of(owner: type, field: str, value: object) -> Any:  # noqa: ANN401
    """Check that a value is one of the words that a dataclass's field allows."""
    return word(get_type_hints(owner)[field], value)


def dump_records(**columns: Sequence[Any]) -> list[Record]:
    """Columns as a list of records; an underscore at the end of a key is dropped."""
    keys = [key.rstrip("_") for key in columns]
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def dump_frames(frames: FrameResults) -> list[Record]:
    """Frames; a pose that a frame does not have is null."""
    return dump_records(
        frame_id=frames.frame_id,
        path=frames.path,
        time_utc_s=plain(frames.time_utc_s),
        status=frames.status,
        reason=frames.reason,
        seed=_dump_poses(frames.seed),
        refined=_dump_poses(frames.refined),
    )


def load_frames(records: Sequence[Record]) -> FrameResults:
    """Inverse of `dump_frames`."""
    return FrameResults(
        frame_id=texts(records, "frame_id"),
        path=texts(records, "path"),
        time_utc_s=column(records, "time_utc_s"),
        status=tuple(word(FrameStatus, record["status"]) for record in records),
        reason=texts(records, "reason"),
        seed=_load_poses([record["seed"] for record in records]),
        refined=_load_poses([record["refined"] for record in records]),
    )


def _dump_poses(poses: PoseTable) -> list[Record | None]:
    rows: list[Record | None] = []
    for i in range(len(poses.center_world_m)):
        row = {key: getattr(poses, key)[i] for key in _POSE_KEYS}
        is_absent = all(np.isnan(value).all() for value in row.values())
        rows.append(None if is_absent else {key: plain(value) for key, value in row.items()})
    return rows


def _load_poses(rows: Sequence[Record | None]) -> PoseTable:
    absent = {key: plain(np.full(shape, np.nan)) for key, shape in _POSE_KEYS.items()}
    present = [absent if row is None else row for row in rows]
    return PoseTable(**{key: column(present, key, *shape) for key, shape in _POSE_KEYS.items()})


def dump_points(points: PointResults) -> list[Record]:
    """Ground points; degrees for people, and the radians that they are made of."""
    relative = dump_records(
        covariance_m2=plain(points.relative.covariance_m2),
        ellipse_95=_dump_ellipses(points.relative),
    )
    return dump_records(
        label=points.label,
        position_world_m=plain(points.position_world_m),
        covariance_m2=plain(points.covariance_m2),
        ellipse_95=_dump_ellipses(points),
        relative=relative,
        latitude_deg=plain(points.latitude_deg),
        longitude_deg=plain(points.longitude_deg),
        frames=[list(names) for names in points.frames],
    )


def load_points(records: Sequence[Record]) -> PointResults:
    """Inverse of `dump_points`."""
    return PointResults(
        label=texts(records, "label"),
        position_world_m=column(records, "position_world_m", 3),
        **_load_uncertainty(records),
        relative=PlanarUncertainty(**_load_uncertainty([r["relative"] for r in records])),
        latitude_deg=column(records, "latitude_deg"),
        longitude_deg=column(records, "longitude_deg"),
        frames=tuple(tuple(text(name) for name in record["frames"]) for record in records),
    )


def _dump_ellipses(points: PointResults | PlanarUncertainty) -> list[Record]:
    return dump_records(
        semi_major_m=plain(points.ellipse_95_m[:, 0]),
        semi_minor_m=plain(points.ellipse_95_m[:, 1]),
        azimuth_deg=plain(np.rad2deg(points.ellipse_azimuth_rad)),
        azimuth_rad=plain(points.ellipse_azimuth_rad),
    )


def _load_uncertainty(records: Sequence[Record]) -> dict[str, Floats]:
    ellipses = [record["ellipse_95"] for record in records]
    axes = [[ellipse["semi_major_m"], ellipse["semi_minor_m"]] for ellipse in ellipses]
    return {
        "covariance_m2": column(records, "covariance_m2", 2, 2),
        "ellipse_95_m": numbers(axes, len(records), 2),
        "ellipse_azimuth_rad": column(ellipses, "azimuth_rad"),
    }


_LINE_NUMBERS = (
    "length_m", "sigma_m", "adjusted_m", "adjusted_sigma_m", "residual_m", "w", "redundancy",
    "mdb_m",
)  # fmt: skip


def dump_lines(lines: LineResults) -> list[Record]:
    """Known lengths."""
    return dump_records(
        name=lines.name,
        from_=lines.start,
        to=lines.end,
        **{key: plain(getattr(lines, key)) for key in _LINE_NUMBERS},
        status=lines.status,
    )


def load_lines(records: Sequence[Record]) -> LineResults:
    """Inverse of `dump_lines`."""
    return LineResults(
        name=texts(records, "name"),
        start=texts(records, "from"),
        end=texts(records, "to"),
        status=tuple(word(LineStatus, record["status"]) for record in records),
        **{key: column(records, key) for key in _LINE_NUMBERS},
    )


def dump_picks(picks: PickResults) -> list[Record]:
    """Picked pixels."""
    return dump_records(
        image=picks.image,
        label=picks.label,
        u_px=plain(picks.pixel_px[:, 0]),
        v_px=plain(picks.pixel_px[:, 1]),
        sigma_px=plain(picks.sigma_px),
        residual_px=plain(picks.residual_px),
        w=plain(picks.w),
        redundancy=plain(picks.redundancy),
        status=picks.status,
    )


def load_picks(records: Sequence[Record]) -> PickResults:
    """Inverse of `dump_picks`."""
    return PickResults(
        image=texts(records, "image"),
        label=texts(records, "label"),
        pixel_px=np.stack([column(records, "u_px"), column(records, "v_px")], axis=1),
        sigma_px=column(records, "sigma_px"),
        residual_px=column(records, "residual_px", 2),
        w=column(records, "w"),
        redundancy=column(records, "redundancy"),
        status=tuple(word(PickStatus, record["status"]) for record in records),
    )


def dump_measurements(measurements: MeasurementResults) -> list[Record]:
    """Measured values; their correlation stands apart."""
    return dump_records(
        name=measurements.name,
        kind=measurements.kind,
        points=[list(labels) for labels in measurements.points],
        value=plain(measurements.value),
        sigma=plain(measurements.sigma),
        unit=measurements.unit,
        interval_95=plain(measurements.interval_95),
        alternative_values=[plain(values) for values in measurements.alternative_values],
    )


def load_measurements(records: Sequence[Record], correlation: Any) -> MeasurementResults:  # noqa: ANN401
    """Inverse of `dump_measurements`."""
    n = len(records)
    return MeasurementResults(
        name=texts(records, "name"),
        kind=texts(records, "kind"),
        points=tuple(tuple(text(label) for label in record["points"]) for record in records),
        value=column(records, "value"),
        sigma=column(records, "sigma"),
        unit=texts(records, "unit"),
        interval_95=column(records, "interval_95", 2),
        correlation=numbers(correlation, n, n),
        alternative_values=tuple(_alternative_values(record) for record in records),
    )


def _alternative_values(record: Record) -> tuple[float, ...]:
    """Of one measurement; files of before have none."""
    values = record.get("alternative_values", [])
    return tuple(numbers(values, len(values)).tolist())


def dump_point_checks(checks: PointChecks) -> list[Record]:
    """Check points."""
    return dump_records(
        label=checks.label,
        error_m=plain(checks.error_m),
        sigma_m=plain(checks.sigma_m),
        mahalanobis=plain(checks.mahalanobis),
    )


def load_point_checks(records: Sequence[Record]) -> PointChecks:
    """Inverse of `dump_point_checks`."""
    return PointChecks(
        label=texts(records, "label"),
        error_m=column(records, "error_m", 3),
        sigma_m=column(records, "sigma_m", 3),
        mahalanobis=column(records, "mahalanobis"),
    )


def dump_line_checks(checks: LineChecks) -> list[Record]:
    """Withheld lengths."""
    return dump_records(
        name=checks.name,
        error_m=plain(checks.error_m),
        sigma_m=plain(checks.sigma_m),
        z=plain(checks.z),
    )


def load_line_checks(records: Sequence[Record]) -> LineChecks:
    """Inverse of `dump_line_checks`."""
    return LineChecks(
        name=texts(records, "name"),
        error_m=column(records, "error_m"),
        sigma_m=column(records, "sigma_m"),
        z=column(records, "z"),
    )
