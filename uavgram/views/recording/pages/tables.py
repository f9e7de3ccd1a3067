"""Tables of measurements, known lengths, points and messages."""

from __future__ import annotations

from collections import Counter
from typing import Literal

import numpy as np

from uavgram.model.result.result import Result
from uavgram.model.result.tables import MeasurementResults
from uavgram.views.markdown import MOST_ROWS, plain, table
from uavgram.views.survey.reliability import effect_words, second_order_rows, weakest_links
from uavgram.views.wording import (
    KIND_WORDS,
    LINE_STATUS_WORDS,
    NOT_UNIQUE,
    WHY_TWO_ELLIPSES,
    alternatives_text,
    axes_text,
    computed_first,
    interval,
    number,
    with_sigma,
)

LEVELS: tuple[Literal["error", "warning", "info"], ...] = ("error", "warning", "info")


def measured_table(result: Result, most: int = MOST_ROWS) -> str:
    """Measurements, the least certain first; at most so many."""
    rows = result.measurements
    if not rows.name:
        return "Nothing was asked for."
    cells = [
        (
            plain(rows.name[i]),
            f"**{with_sigma(float(rows.value[i]), float(rows.sigma[i]), rows.unit[i])}** "
            f"{alternatives_text(rows, int(i))}".rstrip(),
            _interval(rows, int(i)),
            KIND_WORDS.get(rows.kind[i], rows.kind[i]),
        )
        for i in computed_first(rows)
    ]
    shown = table(("name", "value ± 1 σ", "95 % interval", "kind"), cells[:most])
    if rows.is_ambiguous.any():
        shown = f"{shown}\n\n{NOT_UNIQUE}"
    more = len(cells) - most
    return f"{shown}\n\n{more} more are on the page *Measured*." if more > 0 else shown


def _interval(rows: MeasurementResults, row: int) -> str:
    low, high = map(float, rows.interval_95[row])
    return interval(low, high, float(rows.sigma[row]), rows.unit[row])


def measured_page(result: Result) -> str:
    """Everything measured, and how far an error that nobody notices could move it."""
    parts = ["# Measured", measured_table(result)]
    links = [(plain(one["name"]), plain(one["weakest"])) for one in weakest_links(result)]
    if links:
        header = ("name", "largest effect of an error that no test would find")
        parts += ["## Weakest links", table(header, links)]
        alone = [
            (plain(one["name"]), plain(one["unchecked"]))
            for one in weakest_links(result)
            if one["unchecked"]
        ]
        if alone:
            parts += ["## What nothing checks", table(("name", "rests on"), alone)]
    second = second_order_rows(result)
    if second:
        parts += ["## First order is not good enough", "\n".join(f"- {plain(s)}" for s in second)]
    return "\n\n".join(parts)


def lengths_page(result: Result) -> str:
    """Known lengths, the worst fit first, with what the tests can see."""
    lines = result.lines
    if not lines.name:
        return "# Known lengths\n\nNone were given."
    order = np.argsort(-np.nan_to_num(np.abs(lines.w), nan=-1.0), kind="stable")
    header = [
        *("name", "ends", "taped [m]", "found [m]", "difference [m]", "w", "status"),
        *("redundancy", "smallest error that would show [m]"),
    ]
    rows = [
        [
            plain(lines.name[i]),
            f"{plain(lines.start[i])} – {plain(lines.end[i])}",
            f"{number(lines.length_m[i])} ± {number(lines.sigma_m[i])}",
            f"{number(lines.adjusted_m[i])} ± {number(lines.adjusted_sigma_m[i])}",
            number(lines.residual_m[i], signed=True),
            number(lines.w[i], 1, signed=True),
            _loud(lines.status[i]),
            number(lines.redundancy[i], 2),
            number(lines.mdb_m[i]),
        ]
        for i in order
    ]
    if result.evidence is not None:
        header.append("it would move")
        for cells, i in zip(rows, order, strict=True):
            cells.append(plain(effect_words(result, result.evidence.lines, int(i))))
    return "# Known lengths\n\n" + table(header, rows)


def _loud(status: str) -> str:
    words = LINE_STATUS_WORDS.get(status, status)
    return f"**{words}**" if status in ("suspect", "removed") else words


def points_page(result: Result) -> str:
    """Ground points, the least certain within the survey first."""
    points = result.points
    rows = [
        (
            plain(points.label[k]),
            *(number(x) for x in points.position_world_m[k]),
            f"**{axes_text(points.relative.ellipse_95_m[k])}**",
            f"{np.degrees(points.relative.ellipse_azimuth_rad[k]):.0f}°",
            axes_text(points.ellipse_95_m[k]),
            str(len(points.frames[k])),
        )
        for k in np.argsort(-points.relative.ellipse_95_m[:, 0], kind="stable")[: MOST_ROWS + 1]
    ]
    header = (
        "label",
        "east [m]",
        "north [m]",
        "up [m]",
        "95 % half axes within the survey",
        "azimuth",
        "on the earth",
        "frames",
    )
    shown = f"{WHY_TWO_ELLIPSES}\n\n{table(header, rows)}" if rows else "No point was picked."
    return f"# Points\n\n{shown}"


def messages_page(result: Result) -> str:
    """What the run had to say, the worst first."""
    said = sorted(result.messages, key=lambda message: LEVELS.index(message.level))
    lines = [f"- **{message.level}** {plain(message.text)}" for message in said]
    return "# Messages\n\n" + ("\n".join(lines) if lines else "None.")


def messages_title(result: Result) -> str:
    """``Messages: 1 error, 2 warnings``."""
    counts = Counter(message.level for message in result.messages)
    loud = [
        f"{counts[level]} {level}{'' if counts[level] == 1 else 's'}"
        for level in LEVELS[:2]
        if counts[level]
    ]
    return "Messages" + (f": {', '.join(loud)}" if loud else "")
