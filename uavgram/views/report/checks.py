"""Withheld lengths and check points against the result, as one compares with a total station."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.views.report.known_lengths import found_text
from uavgram.views.report.rows import Row, gauge
from uavgram.views.survey.reliability import overall_words
from uavgram.views.survey.verdict import THREE_SIGMA
from uavgram.views.wording import number


@dataclass(frozen=True)
class ChecksSummary:
    """How many lie inside three sigma, and all of them together."""

    inside: str
    good: bool
    overall: str


def line_check_rows(result: Result) -> list[Row]:
    """The withheld lengths, in the order of the file."""
    lines, checks = result.lines, result.line_checks
    withheld = {lines.name[i]: i for i, s in enumerate(lines.status) if s == "checked"}
    return [
        Row(
            name=name,
            ends=f"{lines.start[i]} – {lines.end[i]}",
            taped=f"{number(lines.length_m[i])} ± {number(lines.sigma_m[i])}",
            found=found_text(result, i),
            error=f"{number(error, signed=True)} ± {number(sigma)}",
            z=number(z, 1, signed=True),
            gauge=gauge(float(z), THREE_SIGMA),
            bad=bool(abs(z) > THREE_SIGMA),
        )
        for name, error, sigma, z in zip(
            checks.name, checks.error_m, checks.sigma_m, checks.z, strict=True
        )
        for i in (withheld[name],)
    ]


def point_check_rows(result: Result) -> list[Row]:
    """The check points: east, north and up, each with its sigma."""
    checks = result.point_checks
    ratio, outside = _in_sigmas(result), _points_outside(result)
    return [
        Row(
            label=label,
            axes=[
                (
                    f"{number(error, signed=True)} ± {number(sigma)}",
                    gauge(float(sigmas), THREE_SIGMA),
                )
                for error, sigma, sigmas in zip(
                    checks.error_m[i], checks.sigma_m[i], ratio[i], strict=True
                )
            ],
            distance=number(checks.mahalanobis[i], 1),
            bad=bool(outside[i]),
        )
        for i, label in enumerate(checks.label)
    ]


def checks_summary(result: Result) -> ChecksSummary | None:
    """All checks in two sentences; None where nothing was withheld."""
    outside = [*(np.abs(result.line_checks.z) > THREE_SIGMA), *_points_outside(result)]
    if not outside:
        return None
    bad = int(np.sum(outside))
    inside = f"{len(outside) - bad} of {len(outside)} lie inside three sigma"
    return ChecksSummary(
        inside=f"{inside}, {bad} OUTSIDE." if bad else f"{inside}.",
        good=not bad,
        overall=overall_words(result),
    )


def _in_sigmas(result: Result) -> Floats:
    """(C, 3) errors of the check points over their sigmas."""
    checks = result.point_checks
    return np.asarray(checks.error_m / checks.sigma_m, dtype=np.float64)


def _points_outside(result: Result) -> Bools:
    """(C,) check points of which an axis is outside."""
    return np.asarray((np.abs(_in_sigmas(result)) > THREE_SIGMA).any(axis=1), dtype=np.bool_)
