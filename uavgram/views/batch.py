"""Results of a batch of surveys: sentences, map, and batch.html, one self-contained page."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from uavgram.geometry.geodesy import EARTH_RADIUS_M
from uavgram.model.batch import Batch, Drift, PooledRatio, SurveyRow
from uavgram.model.naming import format_digits, round_down
from uavgram.model.result.reliability import VerdictLevel
from uavgram.views.formatting import number
from uavgram.views.pages import page
from uavgram.views.survey.drawing import PAPER, Drawing, Look
from uavgram.views.survey.sheet import lay_sheet
from uavgram.views.survey.text_placement import Letters
from uavgram.views.tables import Cell, Row, make_table

KINDS = {
    "checks": "withheld lengths and check points",
    "pixels": "picks",
    "lengths": "known lengths",
    "telemetry": "the flight log",
}
FEW_SURVEYS = 3
"""Number of surveys below which correct and wrong sigmas cannot be distinguished."""


class Headline(NamedTuple):
    """Summary of a batch: colour, sentence and reasons."""

    level: VerdictLevel
    sentence: str
    reasons: list[str]


def summarise_batch(batch: Batch) -> Headline:
    """Summarise a batch: surveys not measured, stated sigmas that are wrong, cameras that drift."""
    reasons = [
        f"{describe_kind(one)}: {describe_pooled(one)}" for one in batch.pooled if _is_bad(one)
    ]
    reasons += [
        f"camera {one.camera}: {describe_drift(one)}"
        for one in batch.drifts
        if one.is_off or one.drifts
    ]
    failed, waiting = batch.count("failed"), batch.count("waiting")
    if failed:
        names = ", ".join(display_name(row) for row in batch.rows if row.status == "failed")
        reasons.insert(0, f"not measured: {names}; the table gives the reasons")
    level: VerdictLevel = "red" if failed else "amber" if reasons or waiting else "green"
    return Headline(level, count_surveys(batch), reasons)


def count_surveys(batch: Batch) -> str:
    """Count the surveys: ``12 surveys: 9 measured, 2 unchanged, 1 failed; 5 green, 6 amber...``."""
    parts = [f"{batch.count('done')} measured", f"{batch.count('unchanged')} unchanged"]
    parts += [f"{count} failed" for count in [batch.count("failed")] if count]
    parts += [f"{count} not begun" for count in [batch.count("waiting")] if count]
    levels = [row.level for row in batch.rows]
    lights = ", ".join(f"{levels.count(one)} {one}" for one in ("green", "amber", "red"))
    total = len(batch.rows)
    return f"{total} survey{'s' * (total != 1)}: {', '.join(parts)}; {lights}."


def _is_bad(one: PooledRatio) -> bool:
    """Return whether pooled statistics of all surveys belong into the summary.

    Those of single cameras and drones are in their table.
    """
    return one.of == "all" and (one.is_small or (one.is_large and one.kind == "checks"))


def describe_kind(one: PooledRatio) -> str:
    """Return the words for the kind of the observations, such as ``withheld lengths``."""
    return KINDS.get(one.kind, one.kind)


def describe_pooled(one: PooledRatio) -> str:
    """Judge the stated sigmas: ``the stated ± are too small: errors are 1.4 times as large``."""
    if one.is_small:
        return f"the stated ± are too small: errors are {format_digits(one.ratio)} times as large"
    if one.is_large:
        return f"the stated ± are too large: errors are only {format_digits(one.ratio)} of them"
    if one.surveys < FEW_SURVEYS:
        return "no sign that the stated ± are wrong, but there are few surveys"
    return "the stated ± are right"


def describe_drift(one: Drift) -> str:
    """Describe a camera's drift (``fx drifts by 3.2 ± 0.4 a year``) and whether to recalibrate."""
    said = []
    if one.is_off:
        said.append(
            f"{one.parameter} is off by {format_digits(one.offset, 3, sign='+')} ± "
            f"{format_digits(one.offset_sigma)} from its file"
        )
    if one.drifts:
        said.append(
            f"{one.parameter} drifts by {format_digits(one.per_year, 3, sign='+')} ± "
            f"{format_digits(one.per_year_sigma)} a year"
        )
    return " and ".join(said) + ": calibrate the camera again" if said else "agrees with its file"


def display_name(row: SurveyRow) -> str:
    """Return a survey's name, followed by its folder if that differs: names are often all alike."""
    path = Path(row.project)
    folder = path.parent.name if path.stem == "project" else path.stem
    return row.name if folder in {"", row.name} else f"{row.name} ({folder})"


def survey_line(row: SurveyRow) -> str:
    """Return the line for a survey that has ended: its name, and its verdict or its problem."""
    if row.status == "failed":
        return f"{display_name(row)}: failed. {row.message}"
    again = " (unchanged, not measured again)" if row.status == "unchanged" else ""
    return f"{display_name(row)}: {row.level or 'no verdict'}{again}"


def format_time_left(seconds: float) -> str:
    """Format the remaining time: ``about 3 min left``."""
    if seconds < 60.0:
        return f"about {seconds:.0f} s left"
    if seconds < 5400.0:
        return f"about {seconds / 60.0:.0f} min left"
    return f"about {seconds / 3600.0:.1f} h left"


WIDTH, MAX_HEIGHT, MARGIN = 1000.0, 620.0, 46.0
_MIN_SPAN_DEG = 0.002
"""Least span of the map, about 200 m, so that a batch at one place has an area."""
METRES_OF_DEGREE = math.radians(1.0) * EARTH_RADIUS_M
LETTERS = {"scale": Letters(13.0, colour="#5b6470")}
DOT, DOT_COLOURS = 7.0, {"green": "#28965a", "amber": "#c77700", "red": "#b3261e", "": "#8c919b"}
AXIS = Look("#e3e6ea", 1.0)


class BatchMap(NamedTuple):
    """Map, and number of the surveys on it."""

    drawing: Drawing
    shown: int


def batch_map(batch: Batch, links: dict[str, str]) -> BatchMap | None:
    """Lay out the surveys in an equirectangular map that is true to scale in its middle.

    Parameters
    ----------
    batch
        The surveys.
    links
        Address of each project's report, by project; surveys without one have no link.

    Returns
    -------
    BatchMap
        None if no survey has a place on the earth.
    """
    rows = [row for row in batch.rows if math.isfinite(row.latitude_deg + row.longitude_deg)]
    if not rows:
        return None
    south, north = _widen([row.latitude_deg for row in rows])
    west, east = _widen([row.longitude_deg for row in rows])
    # equirectangular: degrees of longitude shrink with the cosine of the latitude
    squeeze = max(math.cos(math.radians((south + north) / 2.0)), 0.05)
    size = METRES_OF_DEGREE * np.array([squeeze, 1.0])
    sheet = lay_sheet(
        size * [west, south], size * [east, north], MAX_HEIGHT,
        width=WIDTH, least_height=0.0, margin=MARGIN,
    )  # fmt: skip
    drawing = Drawing("Map of the surveys", WIDTH, sheet.height, letters=LETTERS)
    for at, text in _ticks(west, east, "E", "W"):
        x, _ = sheet(size * [at, south])
        drawing.lines("meridian", [np.array([[x, 0.0], [x, sheet.height - 22.0]])], AXIS)
        drawing.write((x, sheet.height - 7.0), text)
    for at, text in _ticks(south, north, "N", "S"):
        _, y = sheet(size * [west, at])
        drawing.lines("parallel", [np.array([[0.0, y], [WIDTH, y]])], AXIS)
        drawing.write((6.0, y - 4.0), text, side=-1)
    long = round_down(WIDTH / sheet.scale / 4.0)
    bar = long * sheet.scale
    words = (
        f"{format_digits(long / 1000.0, 6)} km" if long >= 1000.0 else f"{format_digits(long, 6)} m"
    )
    drawing.scale_bar(WIDTH - 20.0 - bar, 12.0, bar, words)
    for row in rows:
        drawing.signs(
            "surveys",
            sheet(size * [row.longitude_deg, row.latitude_deg])[None],
            DOT,
            Look(PAPER, 1.5, fill=DOT_COLOURS[row.level or ""]),
            title=f"{display_name(row)}: {row.sentence}",
            link=links.get(row.project, ""),
        )
    return BatchMap(drawing, len(rows))


def _widen(values: list[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    more = max(0.06 * (high - low), (_MIN_SPAN_DEG - (high - low)) / 2.0)
    return low - more, high + more


def _ticks(low: float, high: float, above: str, below: str) -> list[tuple[float, str]]:
    """Return the round degrees within a range, with their texts."""
    step = round_down((high - low) / 2.0)
    digits = max(0, -math.floor(math.log10(step)))
    first, last = math.ceil(low / step), math.floor(high / step)
    return [(k * step, _degrees(k * step, digits, above, below)) for k in range(first, last + 1)]


def _degrees(value: float, digits: int, above: str, below: str) -> str:
    return f"{abs(value):.{digits}f}° {above if value >= 0 else below}"


REPORT = "report.html"
_ORDER = {"failed": 0, "waiting": 3}
_LEVELS = {"red": 1, "amber": 2, "green": 4}


def render_batch_page(batch: Batch, folder: Path) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    links = {row.project: _report_address(row, folder) for row in batch.rows if row.output}
    return page(
        "batch.html",
        batch=batch,
        verdict=summarise_batch(batch),
        map=batch_map(batch, links),
        surveys=make_table(
            "survey | verdict | *mean ± [m] | >worst misfit [σ] | taken | camera, drone | warnings",
            (_survey_row(row, links) for row in sorted(batch.rows, key=_sort_worst_first)),
        ),
        pooled=make_table(
            "surveys of | what | >surveys | >numbers | *error / ± | >95 % range | ",
            map(_pooled_row, batch.pooled),
        ),
        drifts=make_table(
            "camera | parameter | >surveys | >surveys minus file | >change a year | ",
            map(_drift_row, batch.drifts),
        ),
    )


def _survey_row(row: SurveyRow, links: dict[str, str]) -> Row:
    """Return the cells of a survey; below its verdict is its problem, or the first reason."""
    why = row.message or row.sentence.partition(". ")[2]
    looks = {"green": "good", "amber": "look"}
    cells = (
        Cell(display_name(row), link=links.get(row.project, "")),
        Cell(
            row.level or row.status,
            below=why if row.level != "green" else "",
            look=looks.get(row.level or "", "bad"),
        ),
        number(row.mean_sigma_m),
        number(row.worst_w, 1, signed=True),
        row.taken_utc[:10],
        Cell(row.camera, below=row.drone),
        ", ".join(row.warnings),
    )
    return Row(cells, row.status == "failed")


def _pooled_row(one: PooledRatio) -> Row:
    cells = (
        "all" if one.of == "all" else f"{one.of} {one.name}",
        KINDS[one.kind],
        str(one.surveys),
        number(one.freedom, 0),
        number(one.ratio, 2),
        f"{number(one.low, 2)} to {number(one.high, 2)}",
        describe_pooled(one),
    )
    return Row(cells, one.is_small)


def _drift_row(one: Drift) -> Row:
    change = f"{format_digits(one.per_year, 3, sign='+')} ± {format_digits(one.per_year_sigma)}"
    cells = (
        one.camera,
        one.parameter,
        str(one.surveys),
        f"{format_digits(one.offset, 3, sign='+')} ± {format_digits(one.offset_sigma)}",
        change if math.isfinite(one.per_year_sigma) else "–",
        describe_drift(one),
    )
    return Row(cells, one.is_off or one.drifts)


def _sort_worst_first(row: SurveyRow) -> tuple[int, float]:
    rank = _ORDER.get(row.status, _LEVELS.get(row.level or "", 3))
    return rank, -abs(row.worst_w) if math.isfinite(row.worst_w) else 0.0


def _report_address(row: SurveyRow, folder: Path) -> str:
    """Return the address of a survey's report: relative if both are on one disk."""
    report = Path(row.output) / REPORT
    try:
        return quote(Path(os.path.relpath(report, folder.absolute())).as_posix())
    except ValueError:  # another drive
        return report.as_uri()
