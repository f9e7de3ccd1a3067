"""Checks and known things compared with the result, and the scale of their misfits."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.formatting import (
    KNOWN_STATUS_WORDS,
    KNOWN_WORDS,
    format_with_sigma,
    number,
    order_worst_fit_first,
)
from uavgram.views.survey.reliability import overall_words
from uavgram.views.survey.verdict import THREE_SIGMA
from uavgram.views.units import format_sigma, format_value, units_of

GAUGE_SIGMAS = 6.0
"""Sigmas from the middle of a gauge to its ends; larger values are drawn at the end."""


class Gauge(NamedTuple):
    """Number of sigmas as a mark on a scale from minus to plus `GAUGE_SIGMAS`.

    Attributes
    ----------
    at, low, high
        Positions of the mark and of the ends of the zone within the limit, in percent of the scale.
    outside
        Whether the mark is beyond the limit.
    """

    at: float
    low: float
    high: float
    outside: bool


def draw_gauge(sigmas: float, limit: float) -> Gauge | None:
    """Draw a number of sigmas against a limit; return None if it is not finite."""
    if not np.isfinite(sigmas):
        return None
    at = float(np.clip(sigmas, -GAUGE_SIGMAS, GAUGE_SIGMAS))
    return Gauge(
        at=_percent(at),
        low=_percent(-limit),
        high=_percent(limit),
        outside=abs(sigmas) > limit,
    )


def _percent(sigmas: float) -> float:
    return round(50.0 + 50.0 * sigmas / GAUGE_SIGMAS, 1)


class KnownRow(NamedTuple):
    """Known observation: its kind, and numbers as they are shown."""

    name: str
    what: str
    points: tuple[str, ...]
    given: str
    found: str
    difference: str
    w: str
    redundancy: str
    least: str
    status: str
    is_bad: bool


def known_table(result: Result) -> tuple[KnownRow, ...]:
    """Return the rows of all known observations, the worst fit first."""
    return tuple(_row(result, int(i)) for i in order_worst_fit_first(result.known.w))


def _row(result: Result, i: int) -> KnownRow:
    known, units = result.known, units_of(result)
    unit, sigma = known.unit[i], float(known.sigma[i])
    is_condition = bool(np.isnan(known.value[i]))
    found = format_value(float(known.adjusted[i]), sigma, unit, units)
    if known.adjusted_sigma[i] > 0 and not is_condition:
        found = format_with_sigma(
            float(known.adjusted[i]), float(known.adjusted_sigma[i]), unit, units
        )
    return KnownRow(
        name=known.name[i],
        what=KNOWN_WORDS.get(known.kind[i], known.kind[i]),
        points=known.points[i],
        given=f"± {format_sigma(sigma, unit, units)}"
        if is_condition
        else format_with_sigma(float(known.value[i]), sigma, unit, units),
        found="–" if is_condition else found,
        difference="–"
        if np.isnan(known.residual[i])
        else ("+" if known.residual[i] > 0 else "")
        + format_value(float(known.residual[i]), sigma, unit, units),
        w=number(float(known.w[i]), 1, signed=True),
        redundancy=number(float(known.redundancy[i]), 2),
        least="–"
        if np.isnan(known.mdb[i])
        else format_value(float(known.mdb[i]), sigma, unit, units),
        status=KNOWN_STATUS_WORDS[known.status[i]],
        is_bad=known.status[i] in ("suspect", "removed"),
    )


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
    overall, look = (
        overall_words(result, in_statistics=False),
        _colour_class(result, fits=not (bad or off)),
    )
    if look == "none":
        overall = f"{overall} But the verdict on the whole is red: see the first page.".lstrip()
    return ChecksSummary(
        inside=f"{inside}.",
        look=look,
        overall=overall,
        line_row={lines.name[i]: i for i, s in enumerate(lines.status) if s == "checked"},
        point_z=np.asarray(z),
    )


def _colour_class(result: Result, *, fits: bool) -> Literal["good", "bad", "none"]:
    if not fits:
        return "bad"
    return "none" if result.verdict.level == "red" else "good"
