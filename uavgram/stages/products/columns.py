"""Columns of results for maps, drawings and spreadsheets: a number or text for each row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Literal

import numpy as np

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps import Attribute
from uavgram.model.result.result import Result
from uavgram.model.result.tables import find_sources

File = Literal["csv", "geojson", "map"]
"""Kinds of files: measurements.csv; points.geojson; layers of survey.gpkg, survey.kml and
drawings."""

Values = Floats | Sequence[str] | Sequence[tuple[str, ...]] | Sequence[tuple[float, ...]]


@dataclass(frozen=True)
class FileColumn:
    """Column of a table in files.

    Attributes
    ----------
    name
        Name with its unit.
    values
        (N,) values of a result: numbers, NaN where there is none; texts; or lists of them.
    files
        Files with this column, in the order of the table.
    listed
        Its name in GeoJSON, which has lists, where that differs.
    joint
        Separator of the entries of a list in a map.
    has_own_digits
        Whether its numbers are rounded by their own size; otherwise by the sigma of their row.
    """

    name: str
    values: Callable[[Result], Values]
    files: tuple[File, ...] = ("csv", "geojson", "map")
    listed: str = ""
    joint: str = "; "
    has_own_digits: bool = False


def _fields(
    table: str, *names: str, files: tuple[File, ...] = ("csv", "geojson", "map")
) -> tuple[FileColumn, ...]:
    """Make columns of a table's fields that have the same names there."""
    return tuple(FileColumn(name, attrgetter(f"{table}.{name}"), files) for name in names)


def heights_above_datum(result: Result) -> Floats:
    """Compute heights (K,) of the points above the world's datum [m]; NaN without an origin."""
    if result.world.origin is None:
        return np.full(len(result.points.label), np.nan)
    return geodetic_from_enu(result.points.position_world_m, result.world.origin)[2]


def _datum(result: Result) -> tuple[str, ...]:
    """Return the datum (K,) of the heights on a map; empty without a map."""
    datum = "" if result.world.origin is None else result.world.height_datum
    return (datum,) * len(result.points.label)


MAPS: tuple[File, ...] = ("geojson", "map")

MEASUREMENTS = (
    *_fields("measurements", "name", "kind"),
    FileColumn("points", attrgetter("measurements.points"), joint=";"),
    *_fields("measurements", "value", "sigma", "unit"),
    FileColumn("lower_95", lambda result: result.measurements.interval_95[:, 0]),
    FileColumn("upper_95", lambda result: result.measurements.interval_95[:, 1]),
    FileColumn(
        "alternatives",
        attrgetter("measurements.alternative_values"),
        listed="alternative_values",
        joint=";",
    ),
    FileColumn(
        "shift_relief_10cm",
        attrgetter("measurements.shift_relief_10cm"),
        files=("csv",),
        has_own_digits=True,
    ),
    FileColumn(
        "shift_tape_1pct",
        attrgetter("measurements.shift_tape_1pct"),
        files=("csv",),
        has_own_digits=True,
    ),
    FileColumn("sigma_stated", attrgetter("measurements.sigma_stated"), files=("csv",)),
    FileColumn("status", attrgetter("measurements.status")),
    FileColumn("picked_by", lambda result: find_sources(result.picks, result.measurements.points)),
)

POINTS = (
    FileColumn("label", attrgetter("points.label"), MAPS),
    FileColumn("east_m", lambda result: result.points.position_world_m[:, 0], MAPS),
    FileColumn("north_m", lambda result: result.points.position_world_m[:, 1], MAPS),
    FileColumn("up_m", lambda result: result.points.position_world_m[:, 2], MAPS),
    FileColumn("sigma_east_m", lambda result: np.sqrt(result.points.covariance_m2[:, 0, 0]), MAPS),
    FileColumn("sigma_north_m", lambda result: np.sqrt(result.points.covariance_m2[:, 1, 1]), MAPS),
    FileColumn("covariance_m2", attrgetter("points.covariance_m2"), ("geojson",)),
    FileColumn(
        "covariance_east_north_m2", lambda result: result.points.covariance_m2[:, 0, 1], ("map",)
    ),
    FileColumn("sigma_up_m", lambda result: np.sqrt(result.points.covariance_m3[:, 2, 2]), MAPS),
    FileColumn("covariance_m3", attrgetter("points.covariance_m3"), ("geojson",)),
    FileColumn(
        "covariance_east_up_m2", lambda result: result.points.covariance_m3[:, 0, 2], ("map",)
    ),
    FileColumn(
        "covariance_north_up_m2", lambda result: result.points.covariance_m3[:, 1, 2], ("map",)
    ),
    FileColumn("neighbour_sigma_m", attrgetter("points.neighbour_sigma_m"), ("geojson",)),
    *_fields("points", "height_above_ground_m", "height_sigma_m", "height_source", files=MAPS),
    FileColumn("height_m", heights_above_datum, ("geojson",)),
    FileColumn("height_datum", _datum, MAPS),
    FileColumn("semi_major_95_m", lambda result: result.points.ellipse_95_m[:, 0], MAPS),
    FileColumn("semi_minor_95_m", lambda result: result.points.ellipse_95_m[:, 1], MAPS),
    FileColumn("azimuth_deg", lambda result: np.rad2deg(result.points.ellipse_azimuth_rad), MAPS),
    FileColumn(
        "semi_major_95_within_survey_m",
        lambda result: result.points.relative.ellipse_95_m[:, 0],
        ("map",),
    ),
    FileColumn("frames", attrgetter("points.frames"), MAPS),
    FileColumn(
        "picked_by",
        lambda result: find_sources(result.picks, [(one,) for one in result.points.label]),
        MAPS,
    ),
)

LENGTHS = (
    *_fields("lines", "name", files=("map",)),
    FileColumn("from", attrgetter("lines.start"), ("map",)),
    FileColumn("to", attrgetter("lines.end"), ("map",)),
    *_fields("lines", "status", "length_m", "sigma_m", "adjusted_m", files=("map",)),
    *_fields("lines", "adjusted_sigma_m", "residual_m", "w", files=("map",)),
)

CONTROL_LINES = (
    *_fields("control_lines", "name", files=("map",)),
    FileColumn("points", attrgetter("control_lines.points"), ("map",), joint=";"),
    *_fields("control_lines", "status", "sigma_m", "offset_m", "w", files=("map",)),
)


def make_geojson_columns(table: Sequence[FileColumn], result: Result) -> dict[str, Values]:
    """Return the columns of a table for GeoJSON, where lists stay lists."""
    return {one.listed or one.name: one.values(result) for one in table if "geojson" in one.files}


def attributes(
    table: Sequence[FileColumn], result: Result, rows: Sequence[int] | None = None
) -> dict[str, Attribute]:
    """Return the columns of a table for layers of a map, where lists become one text.

    Parameters
    ----------
    table
        `POINTS`, `MEASUREMENTS`, `LENGTHS` or `CONTROL_LINES`.
    result
        Result of a run.
    rows
        Rows in the layer; None: all.
    """
    found = {one.name: _cells(one, result) for one in table if "map" in one.files}
    if rows is None:
        return found
    return {name: tuple(cells[i] for i in rows) for name, cells in found.items()}  # type: ignore[misc]


def _cells(column: FileColumn, result: Result) -> Attribute:
    values = column.values(result)
    if isinstance(values, np.ndarray):
        return tuple(values.tolist())
    return tuple(
        one
        if isinstance(one, str)
        else column.joint.join(each if isinstance(each, str) else f"{each:.4f}" for each in one)
        for one in values
    )
