"""The first page, for who reads no other: what was measured, and what nothing checks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from uavgram.model.case import case_from_options
from uavgram.model.result.result import Result
from uavgram.views.report.checks import checks_summary
from uavgram.views.survey.sources import measured_alone
from uavgram.views.wording import computed_first

MOST_ROWS = 8
"""Measurements on the first page; the least certain ones, where there are more."""

LEAST_ROWS = 3

PLAN, LEAST_PLAN = 290.0, 260.0
"""Height of the plan beside as many measurements, one reason and no case; and at the least."""

ROW, REASON = 24.0, 45.0
"""What a row of measurements or of the case, and a reason, take of the page, in the same units."""

MOST_REASONS = 3
"""Of the verdict, beside the first; warnings tell them all."""

MOST_NAMES = 8


class Brief(NamedTuple):
    """What the first page says beside the verdict.

    Attributes
    ----------
    case
        Names and texts of its head.
    rows, more
        Rows of the measurements that are shown, and how many are not.
    plan_height
        Of the plan, in units of its drawing: what the measurements leave of the page.
    reasons, reasons_more
        Of the verdict beside the first, and how many are not shown.
    limits
        Sentences on what was not checked, or cannot be relied on.
    """

    case: tuple[tuple[str, str], ...]
    rows: tuple[int, ...]
    more: int
    plan_height: float
    reasons: tuple[str, ...]
    reasons_more: int
    limits: tuple[str, ...]


def brief(result: Result) -> Brief:
    """Choose what stands on the first page."""
    order = [int(i) for i in computed_first(result.measurements)]
    case = case_from_options(result.provenance.options)
    others = [reason.text for reason in result.verdict.reasons[1:]]
    reasons = others[:MOST_REASONS]
    count = min(len(order), max(LEAST_ROWS, MOST_ROWS - len(reasons) - len(case) // 2))
    taken = ROW * (count - MOST_ROWS + len(case)) + REASON * (len(reasons) - 1)
    return Brief(
        case=case,
        rows=tuple(order[:count]),
        more=len(order[count:]),
        plan_height=max(PLAN - taken, LEAST_PLAN),
        reasons=tuple(reasons),
        reasons_more=len(others[MOST_REASONS:]),
        limits=tuple(_limits(result)),
    )


def _limits(result: Result) -> list[str]:
    rows = result.measurements
    known = np.isfinite(rows.value)
    named = list(zip(rows.name, rows.status, known.tolist(), strict=True))
    several = {
        "Nothing would show an error in": [n for n, s, ok in named if ok and s == "not-checked"],
        "Doubtful, as something that they rest on does not fit": [
            n for n, s, ok in named if ok and s == "doubtful"
        ],
        "Contradicted, and not to be used": [n for n, s, ok in named if ok and s == "contradicted"],
        "Asked for, but not computed": [n for n, _, ok in named if not ok],
        "No person picked the points of": [
            name for name, alone in zip(rows.name, measured_alone(result), strict=True) if alone
        ],
    }
    told = [f"{words}: {_listed(names)}." for words, names in several.items() if names]
    checks = checks_summary(result)
    if checks is None:
        return [*told, "No length and no point was withheld, with which to compare the result."]
    return [*told, f"Of the lengths and points that were withheld as checks, {checks.inside}"]


def _listed(names: Iterable[str]) -> str:
    every = list(names)
    more = len(every) - MOST_NAMES
    return ", ".join(every[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
