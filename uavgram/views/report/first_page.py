"""First page of the report: plan on the ground, measurements, and limits of their checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import join_names
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Pictures, Result
from uavgram.views.formatting import order_shapes_first
from uavgram.views.report.checks import checks_summary
from uavgram.views.report.pictures import GROUND, picture_mark
from uavgram.views.survey.key_facts import accuracy_words, note_automatic_values
from uavgram.views.survey.sheet import WIDTH
from uavgram.views.survey.top_view import TopView, fit_layout, mark_used_points, top_view
from uavgram.views.survey.verdict import verdict_words


def ground_extent(result: Result) -> tuple[Floats, Floats] | None:
    """Return south-west and north-east corner (2,) of the report's plan; None without one."""
    plan = fit_layout(result, lay_out_brief(result).plan_height, mark_used_points(result))
    return None if plan is None else plan.sheet.extent_m


def report_plan(result: Result, first: Brief, pictures: Pictures) -> TopView | None:
    """Draw the plan of the first page; return None if there is no point to draw.

    Parameters
    ----------
    result
        Result of the run.
    first
        Content of the page.
    pictures
        Pictures; one of them may show the ground.
    """
    shown, address = mark_used_points(result), picture_mark(GROUND)
    return top_view(result, first.plan_height, shown, pictures.ground, address)


MAX_ROWS = 12
"""Largest number of measurements on the first page; of more, the least certain ones."""

MIN_ROWS = 3

FEW_ROWS = 2
"""Number of measurements without room up to which the plan is made lower for them."""

PAGE_MM, UNIT_MM = 243.0, 182.0 / WIDTH
"""Height of a printed page for text and plan (letter is lower), and unit of a drawing [mm]."""

MIN_PLAN, GOOD_PLAN, MAX_PLAN = 220.0, 330.0, 640.0
"""Limits of the plan's height, in its units; for a good one, rows of the table are left out."""

HEAD_MM, ROW_MM, LINE_MM, GAP_MM = 20.0, 6.3, 4.8, 2.0
"""Heights of title and legend, table row and line of text, and gap around a paragraph."""

LINE, STRONG_LINE, TITLE = 96, 76, 20
"""Letters of a line: of text, of strong text, and of a name beside the words of the title."""

MAX_REASONS = 2
"""Number of reasons of the verdict beside the first; the warnings have them all."""

MAX_NAMES = 8
LIMITS = "What was checked, and what was not. "


class Brief(NamedTuple):
    """Content of the first page beside the verdict.

    Attributes
    ----------
    case
        Names and texts of its head.
    rows, more
        Rows of the measurements that are shown, and number of the others.
    plan_height
        Height of the plan, in units of its drawing: the room left by the measurements.
    reasons, reasons_more
        Reasons of the verdict beside the first, and number of those not shown.
    accuracy
        Accuracy of distances and of coordinates.
    limits
        Sentences on values that were not checked, or are not reliable.
    """

    case: tuple[tuple[str, str], ...]
    rows: tuple[int, ...]
    more: int
    plan_height: float
    reasons: tuple[str, ...]
    reasons_more: int
    accuracy: str
    limits: tuple[str, ...]


def lay_out_brief(result: Result) -> Brief:
    """Choose the content of the first page: lengths and angles before coordinates."""
    order = order_shapes_first(result.measurements)
    case = case_from_options(result.provenance.options)
    others = [reason.text for reason in result.verdict.reasons[1:]]
    reasons = others[:MAX_REASONS]
    # a red result has no accuracy that could be stated
    accuracy = "" if result.verdict.level == "red" else accuracy_words(result)
    limits = tuple(_limits(result))
    words = verdict_words(result)
    left_mm = PAGE_MM - HEAD_MM - ROW_MM * (1 + len(case)) - _text_mm(result.name, TITLE) - GAP_MM
    left_mm -= _text_mm(words.sentence, STRONG_LINE)
    left_mm -= sum(_text_mm(text) for text in (*reasons, words.scale, words.counts, accuracy))
    left_mm -= _text_mm(LIMITS + " ".join(limits))
    room = int((left_mm - GOOD_PLAN * UNIT_MM) // ROW_MM)
    count = min(len(order), max(MIN_ROWS, min(MAX_ROWS, room)))
    if len(order) - count <= FEW_ROWS:
        count = len(order)
    left_mm -= ROW_MM * count
    return Brief(
        case=case,
        rows=tuple(order[:count]),
        more=len(order[count:]),
        plan_height=min(max(left_mm / UNIT_MM, MIN_PLAN), MAX_PLAN),
        reasons=tuple(reasons),
        reasons_more=len(others[MAX_REASONS:]),
        accuracy=accuracy,
        limits=limits,
    )


def _text_mm(text: str, letters: int = LINE) -> float:
    """Return the height of a paragraph on paper."""
    return math.ceil(len(text) / letters) * LINE_MM + GAP_MM if text else 0.0


def _listed_or_all(names: Sequence[str], every: Sequence[str]) -> str:
    """List the names; those of all measurements, if there are several, are counted."""
    if 1 < len(names) == len(every):
        return f"all {len(names)} measurements"
    return join_names(names, MAX_NAMES)


def _limits(result: Result) -> list[str]:
    rows = result.measurements
    known = np.isfinite(rows.value)
    named = list(zip(rows.name, rows.status, known.tolist(), strict=True))
    several = {
        "No check would detect an error in": [n for n, s, ok in named if ok and s == "not-checked"],
        "Doubtful, as an observation on which they depend does not fit": [
            n for n, s, ok in named if ok and s == "doubtful"
        ],
        "Contradicted, and not to be used": [n for n, s, ok in named if ok and s == "contradicted"],
        "Requested, but not computed": [n for n, _, ok in named if not ok],
        "No person picked the points of": [
            name
            for name, alone in zip(rows.name, note_automatic_values(result), strict=True)
            if alone
        ],
    }
    sentences = [
        f"{words}: {_listed_or_all(names, rows.name)}." for words, names in several.items() if names
    ]
    checks = checks_summary(result)
    if checks is None:
        none = "No length and no point was withheld for a comparison with the result"
        alone = ": the only check is the agreement of the observations with one another"
        return [*sentences, f"{none}{alone if 'ok' in rows.status else ''}."]
    return [*sentences, f"Of the lengths and points that were withheld as checks, {checks.inside}"]
