"""Withheld lengths and check points compared with the result, as with a total station."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.survey.reliability import overall_words
from uavgram.views.survey.verdict import THREE_SIGMA


class ChecksSummary(NamedTuple):
    """Number of checks within three times their uncertainty, and the joint test of all.

    Attributes
    ----------
    inside, overall
        The two sentences.
    look
        "good" if all are inside and agree together too, "bad" if not; "none" if they agree but the
        verdict is red.
    line_row
        Row of each withheld length among the lengths, by its name.
    point_z
        (C, 3) errors of the check points over their sigmas.
    """

    inside: str
    look: Literal["good", "bad", "none"]
    overall: str
    line_row: dict[str, int]
    point_z: Floats


def checks_summary(result: Result) -> ChecksSummary | None:
    """Describe all checks in two sentences; return None if nothing was withheld."""
    lines, points = result.lines, result.point_checks
    z = points.error_m / points.sigma_m
    outside = [
        *(np.abs(result.line_checks.z) > THREE_SIGMA),
        *np.asarray((np.abs(z) > THREE_SIGMA).any(axis=1)),
    ]
    if not outside:
        return None
    bad = int(np.sum(outside))
    inside = f"{len(outside) - bad} of {len(outside)} are within three times their uncertainty"
    # each alone may be inside if all share a large sigma
    off = any(message.code == "checks-misfit" for message in result.messages)
    if bad:
        inside += f", {bad} OUTSIDE"
    elif off:
        inside += ", but TOGETHER they are further off than their uncertainties allow"
    overall, look = overall_words(result, in_statistics=False), _look(result, fits=not (bad or off))
    if look == "none":
        overall = f"{overall} But the verdict on the whole is red: see the first page.".lstrip()
    return ChecksSummary(
        inside=f"{inside}.",
        look=look,
        overall=overall,
        line_row={lines.name[i]: i for i, s in enumerate(lines.status) if s == "checked"},
        point_z=np.asarray(z),
    )


def _look(result: Result, *, fits: bool) -> Literal["good", "bad", "none"]:
    if not fits:
        return "bad"
    return "none" if result.verdict.level == "red" else "good"
