"""First page of the report: plan on the ground, measurements, and limits of their checks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import join_names
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Pictures, Result
from uavgram.views.formatting import order_shapes_first, select_least_certain
from uavgram.views.report.pictures import GROUND, picture_mark
from uavgram.views.survey.fit import checks_summary
from uavgram.views.survey.key_facts import accuracy_words, note_automatic_values
from uavgram.views.survey.top_view import TopView, fit_layout, mark_used_points, top_view
from uavgram.views.survey.verdict import describe_undetectable, verdict_sentence


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


MAX_ROWS = 10
"""Largest number of measurements on the first page; of more, those that are not ok, and the
least certain."""

FEW_ROWS = 2
"""Number of measurements more than that which are shown too, rather than counted."""

MIN_PLAN, MAX_PLAN, OWN_PAGE_PLAN = 330.0, 680.0, 860.0
"""Limits of the plan's height on the first page, and its height on a page of its own, in units of
its drawing (a quarter of a millimetre on paper)."""

PAGE, HEAD, ROW, LINE, LETTERS = 1060.0, 240.0, 22.0, 18.0, 110
"""Height of a page between its margins, of title and captions, of a row of a table and of a line of
text, in the same units; and number of letters of a line."""

MAX_REASONS = 2
"""Number of reasons of the verdict beside the first; the warnings have them all."""

MAX_NAMES = 8


class Brief(NamedTuple):
    """Content of the first page beside the verdict.

    Attributes
    ----------
    case
        Names and texts of its head.
    rows, more
        Rows of the measurements that are shown, and number of the others.
    plan_height
        Height of the plan as it is drawn; on paper it is as high as there is room.
    has_own_page
        Whether the plan is on a page of its own, as there is too little room.
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
    has_own_page: bool
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
    count = len(order) if len(order) <= MAX_ROWS + FEW_ROWS else MAX_ROWS
    texts = [verdict_sentence(result), *reasons, accuracy, " ".join(limits)]
    lines = sum(-(-len(text) // LETTERS) for text in texts)
    room = PAGE - HEAD - ROW * (count + len(case)) - LINE * lines
    return Brief(
        case=case,
        rows=select_least_certain(result.measurements, order, count),
        more=len(order[count:]),
        plan_height=min(room, MAX_PLAN) if room > MIN_PLAN else OWN_PAGE_PLAN,
        has_own_page=room <= MIN_PLAN,
        reasons=tuple(reasons),
        reasons_more=len(others[MAX_REASONS:]),
        accuracy=accuracy,
        limits=limits,
    )


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
    if unnoticed := describe_undetectable(result):
        sentences.append(unnoticed)
    checks = checks_summary(result)
    if checks is None:
        agree = "The observations check one another by their agreement. "
        none = "No length and no point was withheld for a comparison with the result."
        return [*sentences, f"{agree if 'ok' in rows.status else ''}{none}"]
    return [*sentences, f"Of the lengths and points that were withheld as checks, {checks.inside}"]
