"""Tables of a result for people: titles, units and decimals of each column, defined once.

The terminal, the report, its annex and the recording show the columns defined here, as their
`places` state. Numbers are in the project's units, which the titles name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.result.result import Result
from uavgram.views.formatting import (
    LINE_STATUS_WORDS,
    MeasurementText,
    axes_text,
    format_interval,
    height_text,
    measurement_text,
    number,
    plus_minus,
    relief_text,
    shift_text,
    size_text,
)
from uavgram.views.survey.heights import collect_departures, height_of
from uavgram.views.survey.key_facts import has_automatic_picks, note_automatic_values, point_origins
from uavgram.views.survey.reliability import (
    effect_words,
    line_limits,
)
from uavgram.views.survey.verdict import status_text
from uavgram.views.tables import Cell, Row, Table, draw_gauge, make_table
from uavgram.views.units import format_length, format_sigma, table_unit, units_of

Place = Literal["terminal", "first page", "report", "annex", "recording"]
TableName = Literal["measured", "lengths", "points"]
PAPER: tuple[Place, ...] = ("first page", "report", "annex")
FULL: tuple[Place, ...] = ("annex", "recording")
ALL: tuple[Place, ...] = ("terminal", *PAPER, "recording")

STATUS_LOOKS = {"ok": "good", "not-checked": "look", "doubtful": "look", "contradicted": "bad"}
BAD_LINES = ("suspect", "removed")


@dataclass(frozen=True, eq=False)
class Source:
    """Result with values that several cells need, each computed once."""

    result: Result

    @cached_property
    def units(self) -> Units:
        """Units in which the result is shown."""
        return units_of(self.result)

    @cached_property
    def alone(self) -> Sequence[str]:
        """(M,) note on measurements that depend on no pick of a person."""
        return note_automatic_values(self.result)

    @cached_property
    def limits(self) -> Floats:
        """(L,) absolute w from which a length is suspect."""
        return line_limits(self.result)

    @cached_property
    def made(self) -> Sequence[str]:
        """(K,) origin of the picks of each point; empty if a person made all."""
        return point_origins(self.result) if has_automatic_picks(self.result) else ()

    @cached_property
    def sigma_m(self) -> Floats:
        """(K, 3) standard deviations east, north and up."""
        covariance = self.result.points.covariance_m3
        return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))

    @cached_property
    def is_uneven(self) -> bool:
        """Return whether the ground is uneven."""
        return collect_departures(self.result) is not None

    @property
    def is_on_earth(self) -> bool:
        """Return whether the world is tied to the earth."""
        return self.result.world.gauge == "world"

    @property
    def has_heights(self) -> bool:
        """Return whether any point is off the ground."""
        return bool(self.result.points.is_off_ground.any())

    @property
    def has_three_sigmas(self) -> bool:
        """Return whether heights of points have sigmas of their own."""
        return self.has_heights or self.is_uneven

    def measured(self, row: int) -> MeasurementText:
        """Return a measurement in words."""
        return measurement_text(self.result.measurements, row, self.units)

    def length(self, value_m: float, decimals: int = 3, *, signed: bool = False) -> str:
        """Return a length in the unit of the titles.

        Parameters
        ----------
        value_m
            The length.
        decimals, signed
            See `number`.
        """
        return number(table_unit(self.units).factor * float(value_m), decimals, signed=signed)

    def found_length(self, row: int) -> str:
        """Return a known length as adjusted, as tapes are read."""
        lines = self.result.lines
        if not np.isfinite(lines.adjusted_m[row]):
            return "–"
        return self.like_tape(lines.adjusted_m[row], lines.adjusted_sigma_m[row])

    def like_tape(self, value_m: float, sigma_m: float, *, signed: bool = False) -> str:
        """Return a length and its sigma as tapes are read: in feet and inches, these with units.

        Parameters
        ----------
        value_m, sigma_m, signed
            See `length_with_sigma`.
        """
        if self.units.length != "ft-in":
            return self.length_with_sigma(value_m, sigma_m, signed=signed)
        words = format_length(float(value_m), self.units, 3, signed=signed)
        return f"{words} ± {format_sigma(float(sigma_m), 'm', self.units)}"

    def length_with_sigma(self, value_m: float, sigma_m: float, *, signed: bool = False) -> str:
        """Return a length and its sigma in the unit of the titles.

        Parameters
        ----------
        value_m, sigma_m
            The length and its standard deviation.
        signed
            Whether a positive length has a plus sign.
        """
        factor = table_unit(self.units).factor
        return plus_minus(factor * float(value_m), factor * float(sigma_m), signed=signed)


def _always(_: Source) -> bool:
    return True


@dataclass(frozen=True)
class TableColumn:
    """Column of a table for people.

    Attributes
    ----------
    title
        Heading, as in `make_table`; ``[relief]`` becomes the height to which shifts by relief
        refer.
    cell
        Function that makes the cell of a row.
    places
        Places that show the column, in the order of the table.
    titles
        Other titles, by place.
    when
        Function that returns whether a result has the column.
    """

    title: str
    cell: Callable[[Source, int], Cell | str]
    places: tuple[Place, ...] = ALL
    titles: Mapping[str, str] = field(default_factory=dict)
    when: Callable[[Source], bool] = _always


def _kind(source: Source, row: int) -> Cell:
    second, words = source.result.second_order, source.measured(row)
    tags = ["not unique"] if words.others else []
    tags += ["± is approximate"] if second is not None and second.off[row] else []
    return Cell(words.kind, tags=tuple(tags))


def _what(source: Source, row: int) -> str:
    """Return kind and points of a measurement: up to three points, else the first and the last."""
    words = source.measured(row)
    points = words.points if len(words.points) <= 3 else (words.points[0], "…", words.points[-1])
    return f"{words.kind}, {' – '.join(points)}" if points else words.kind


def _value(source: Source, row: int) -> Cell:
    words, status = source.measured(row), source.result.measurements.status[row]
    look = {"contradicted": "struck", "doubtful": "doubt"}.get(status, "value")
    return Cell(words.value, words.others, look=look)


def _status(source: Source, row: int) -> Cell:
    rows = source.result.measurements
    return Cell(
        status_text(rows, row), below=source.alone[row], look=STATUS_LOOKS[rows.status[row]]
    )


def _sampled_sigma(source: Source, row: int) -> str:
    sampled = source.result.monte_carlo
    unit = source.result.measurements.unit[row]
    return "–" if sampled is None else format_sigma(float(sampled.sigma[row]), unit, source.units)


def _sampled_interval(source: Source, row: int) -> str:
    sampled, rows = source.result.monte_carlo, source.result.measurements
    if sampled is None:
        return "–"
    low, high = map(float, sampled.interval_95[row])
    return format_interval(low, high, float(rows.sigma[row]), rows.unit[row], source.units)


def _relief(source: Source, row: int) -> str:
    rows = source.result.measurements
    return shift_text(float(rows.shift_relief_10cm[row]), rows.unit[row])


def _tape(source: Source, row: int) -> str:
    rows = source.result.measurements
    return shift_text(float(rows.shift_tape_1pct[row]), rows.unit[row])


_WHAT_ELSE: tuple[Place, ...] = ("terminal", "report", "annex")
_SHORT = dict.fromkeys(("first page", "report"), ">value ± standard uncertainty")
_SHORT_95 = dict.fromkeys(("first page", "report"), ">true in 19 of 20 cases within")

MEASURED = (
    TableColumn(
        "measured", lambda source, row: source.measured(row).name, titles={"annex": "name"}
    ),
    TableColumn("what", _what, ("first page",)),
    TableColumn("kind", _kind, _WHAT_ELSE),
    TableColumn("points", lambda source, row: " – ".join(source.measured(row).points), _WHAT_ELSE),
    TableColumn(">value ± 1 sigma", _value, titles=_SHORT),
    TableColumn("status", _status, ("recording",)),
    TableColumn(
        ">95 % interval",
        lambda source, row: source.measured(row).interval,
        titles=_SHORT_95,
    ),
    TableColumn(
        ">sigma/value",
        lambda source, row: source.measured(row).relative,
        ("terminal", "annex"),
    ),
    TableColumn("status", _status, ("terminal", *PAPER)),
    TableColumn(
        "fits as well",
        lambda source, row: source.measured(row).others,
        ("terminal",),
        when=lambda source: bool(source.result.measurements.is_ambiguous.any()),
    ),
    TableColumn("kind", _kind, ("recording",)),
    TableColumn(
        ">sampled sigma",
        _sampled_sigma,
        ("annex",),
        when=lambda source: source.result.monte_carlo is not None,
    ),
    TableColumn(
        ">sampled 95 % interval",
        _sampled_interval,
        ("annex",),
        when=lambda source: source.result.monte_carlo is not None,
    ),
    TableColumn(">[relief] of relief", _relief, ("annex",)),
    TableColumn(">1 % of tape", _tape, ("annex",)),
)
"""Columns of the measurements."""


def _ends(source: Source, row: int) -> str:
    lines = source.result.lines
    return f"{lines.start[row]} – {lines.end[row]}"


def _taped(source: Source, row: int) -> str:
    lines = source.result.lines
    return source.like_tape(lines.length_m[row], lines.sigma_m[row])


def _difference(source: Source, row: int) -> str:
    residual_m = float(source.result.lines.residual_m[row])
    if source.units.length == "ft-in" and np.isfinite(residual_m):
        return format_length(residual_m, source.units, 3, signed=True)
    return source.length(residual_m, signed=True)


def _w(source: Source, row: int) -> Cell:
    w = float(source.result.lines.w[row])
    return Cell(number(w, 1, signed=True), gauge=draw_gauge(w, float(source.limits[row])))


def _line_effect(source: Source, row: int) -> str:
    evidence = source.result.evidence
    return "–" if evidence is None else effect_words(source.result, evidence.lines, row)


def _line_status(source: Source, row: int) -> Cell:
    status = source.result.lines.status[row]
    return Cell(LINE_STATUS_WORDS[status], look="bad" if status in BAD_LINES else "")


_LENGTH_PLACES: tuple[Place, ...] = ("report", *FULL)
LENGTHS = (
    TableColumn(
        "name and ends",
        lambda source, row: Cell(source.result.lines.name[row], below=_ends(source, row)),
        ("annex",),
    ),
    TableColumn(
        "between",
        lambda source, row: f"{source.result.lines.name[row]}: {_ends(source, row)}",
        ("report",),
    ),
    TableColumn("length", lambda source, row: source.result.lines.name[row], ("recording",)),
    TableColumn("ends", _ends, ("recording",)),
    TableColumn(">taped [tape]", _taped, _LENGTH_PLACES),
    TableColumn(">found [tape]", Source.found_length, _LENGTH_PLACES),
    TableColumn(">difference [tape]", _difference, _LENGTH_PLACES),
    TableColumn(">w", _w, FULL),
    TableColumn("status", _line_status, ("recording",)),
    TableColumn(
        ">redun\u00addancy",
        lambda source, row: number(float(source.result.lines.redundancy[row]), 2),
        FULL,
    ),
    TableColumn(
        ">smallest error that shows [m]",
        lambda source, row: source.length(source.result.lines.mdb_m[row]),
        FULL,
    ),
    TableColumn("which, unseen, would move", _line_effect, FULL),
    TableColumn("status", _line_status, PAPER),
)
"""Columns of the known lengths."""


def _place(source: Source, row: int) -> Cell:
    place = (source.length(x) for x in source.result.points.position_world_m[row])
    return Cell(", ".join(place))


def _place_with_sigmas(source: Source, row: int) -> Cell:
    sigmas = ", ".join(source.length(x) for x in source.sigma_m[row])
    return _place(source, row)._replace(below=f"± {sigmas}")


def _height(source: Source, row: int) -> Cell:
    points = source.result.points
    text, _, who = height_text(
        float(points.height_above_ground_m[row]),
        float(points.height_sigma_m[row]),
        points.height_source[row],
    ).partition(", ")
    return Cell(text, below=who)


def _off_plane(source: Source, row: int) -> str:
    points = source.result.points
    if not points.departs[row]:
        return "–"
    return source.length_with_sigma(
        points.departure_m[row], points.departure_sigma_m[row], signed=True
    )


def _latitude_longitude(source: Source, row: int) -> Cell:
    points = source.result.points
    latitude, longitude = float(points.latitude_deg[row]), float(points.longitude_deg[row])
    if not np.isfinite(latitude):
        return Cell("–")
    return Cell(f"{number(latitude, 8)},", number(longitude, 8))


def _to_neighbours(source: Source, row: int) -> Cell:
    points = source.result.points
    if not points.neighbours[row]:
        return Cell("–")
    return Cell(
        size_text(float(points.neighbour_sigma_m[row]), source.units),
        look="value",
        hint=", ".join(points.neighbours[row]),
    )


def _photos(source: Source, row: int) -> Cell:
    made = source.made[row] if source.made else ""
    return Cell(str(len(source.result.points.frames[row])), below=made)


POINTS = (
    TableColumn("label", lambda source, row: source.result.points.label[row], FULL),
    TableColumn(
        ">east, north, up [m]",
        _place,
        FULL,
        when=lambda source: not source.has_three_sigmas,
    ),
    TableColumn(
        ">east, north, up, and their sigmas on the earth [m]",
        _place_with_sigmas,
        FULL,
        when=lambda source: source.has_three_sigmas and source.is_on_earth,
    ),
    TableColumn(
        ">east, north, up, and their sigmas against photo 1 [m]",
        _place_with_sigmas,
        FULL,
        when=lambda source: source.has_three_sigmas and not source.is_on_earth,
    ),
    TableColumn(
        ">height over the ground",
        _height,
        ("annex",),
        when=lambda source: source.has_heights,
    ),
    TableColumn(
        ">above the ground",
        lambda source, row: (
            height_of(source.result.points, row) if source.result.points.is_off_ground[row] else "–"
        ),
        ("recording",),
        when=lambda source: source.has_heights,
    ),
    TableColumn(
        ">ground off its plane [m]",
        _off_plane,
        FULL,
        when=lambda source: source.is_uneven,
    ),
    TableColumn(
        ">latitude, longitude [°]",
        _latitude_longitude,
        ("annex",),
        when=lambda source: source.is_on_earth,
    ),
    TableColumn(">± to its neighbours", _to_neighbours, FULL),
    TableColumn(
        ">95 % half axes within the survey",
        lambda source, row: axes_text(
            source.result.points.relative.ellipse_95_m[row], source.units
        ),
        FULL,
    ),
    TableColumn(
        ">azimuth",
        lambda source, row: (
            f"{np.degrees(source.result.points.relative.ellipse_azimuth_rad[row]):.0f}°"
        ),
        FULL,
    ),
    TableColumn(
        ">95 % half axes on the earth",
        lambda source, row: axes_text(source.result.points.ellipse_95_m[row], source.units),
        FULL,
        when=lambda source: source.is_on_earth,
    ),
    TableColumn(
        ">95 % half axes against photo 1",
        lambda source, row: axes_text(source.result.points.ellipse_95_m[row], source.units),
        FULL,
        when=lambda source: not source.is_on_earth,
    ),
    TableColumn(">photos", _photos, FULL),
)
"""Columns of the ground points."""


TABLES: dict[TableName, tuple[TableColumn, ...]] = {
    "measured": MEASURED,
    "lengths": LENGTHS,
    "points": POINTS,
}


def result_table(name: TableName, result: Result, rows: Sequence[int], where: Place) -> Table:
    """Assemble a table.

    Parameters
    ----------
    name
        Name of the table.
    result
        Result of a run.
    rows
        Rows to show, in their order.
    where
        The place.
    """
    source = Source(result)
    own = [one for one in TABLES[name] if where in one.places and one.when(source)]
    relief = relief_text(source.units)
    titles = (one.titles.get(where, one.title).replace("[relief]", relief) for one in own)
    cells = (
        Row([one.cell(source, int(row)) for one in own], _is_bad(name, result, int(row)))
        for row in rows
    )
    return make_table(" | ".join(titles), cells, source.units)


def _is_bad(name: TableName, result: Result, row: int) -> bool:
    if name == "lengths":
        return result.lines.status[row] in BAD_LINES
    return name == "measured" and not np.isfinite(result.measurements.value[row])


MAX_ROWS = 1_000
"""Largest number of rows of one table."""


def select_most_doubtful(doubt: Floats) -> tuple[int, ...]:
    """Select the rows with the most doubt, in their order.

    Parameters
    ----------
    doubt
        (N,) amount of doubt; NaN is none.
    """
    first = np.argsort(-np.nan_to_num(doubt, nan=-np.inf), kind="stable")[:MAX_ROWS]
    return tuple(np.sort(first).tolist())


def select_rows(result: Result) -> dict[str, tuple[int, ...]]:
    """Select rows of photos, those without a place first; of points, least certain; of files."""
    frames = result.frames
    is_lost = np.array([status in ("rejected", "unmatched") for status in frames.status])
    return {
        "photos_told": select_most_doubtful(is_lost.astype(np.float64)),
        "points_told": select_most_doubtful(result.points.relative.ellipse_95_m[:, 0]),
        "files_told": select_most_doubtful(np.zeros(len(result.provenance.inputs))),
    }
