"""Withheld lengths and check points against the result, as one compares with a total station."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.survey.reliability import overall_words
from uavgram.views.survey.verdict import THREE_SIGMA


class ChecksSummary(NamedTuple):
    """How many lie inside three sigma, and all of them together.

    Attributes
    ----------
    inside, overall
        The two sentences.
    good
        Whether all lie inside, and fit together too.
    line_row
        Row of each withheld length among the lengths, by its name.
    point_z
        (C, 3) errors of the check points over their sigmas.
    """

    inside: str
    good: bool
    overall: str
    line_row: dict[str, int]
    point_z: Floats


def checks_summary(result: Result) -> ChecksSummary | None:
    """All checks in two sentences; None where nothing was withheld."""
    lines, points = result.lines, result.point_checks
    z = points.error_m / points.sigma_m
    outside = [
        *(np.abs(result.line_checks.z) > THREE_SIGMA),
        *np.asarray((np.abs(z) > THREE_SIGMA).any(axis=1)),
    ]
    if not outside:
        return None
    bad = int(np.sum(outside))
    inside = f"{len(outside) - bad} of {len(outside)} lie inside three sigma"
    # each alone may lie inside, where all have a large sigma in common
    off = any(message.code == "checks-misfit" for message in result.messages)
    if bad:
        inside += f", {bad} OUTSIDE"
    elif off:
        inside += ", but TOGETHER they are further off than their uncertainties allow"
    return ChecksSummary(
        inside=f"{inside}.",
        good=not (bad or off),
        overall=overall_words(result),
        line_row={lines.name[i]: i for i, s in enumerate(lines.status) if s == "checked"},
        point_z=np.asarray(z),
    )
