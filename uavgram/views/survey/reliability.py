"""Reliability of the result in words, and the limits of its test statistics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_critical_value, compute_level
from uavgram.model.arrays import Floats
from uavgram.model.naming import format_count, format_digits, join_names
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import ChecksOverall, Effects, PriorResults, RemovalRecord
from uavgram.model.result.result import Result
from uavgram.stages.measure import describe_approximation
from uavgram.views.formatting import UNIT_WORDS, chance, number, order_computed_first
from uavgram.views.tables import Cell, Row, Table, make_table
from uavgram.views.units import format_sigma, units_of


def significance_of(result: Result) -> float:
    """Return the significance that a run used; the default if its result does not state it."""
    stated = dict(result.provenance.options).get("solve.significance")
    return stated if isinstance(stated, float) else SolveOptions().significance


def pick_limit(result: Result) -> float:
    """Return the critical absolute w of the picks under test, of two coordinates each.

    For a significance of one in a thousand: 3.29 up to five picks, 4.1 for a hundred.
    """
    return _limit(result, 2 * int(np.isfinite(result.picks.w).sum()))


def line_limits(result: Result) -> Floats:
    """Return the (L,) critical absolute w of known lengths; each withheld one is tested alone."""
    checked = np.array([status == "checked" for status in result.lines.status], dtype=bool)
    together = int((np.isfinite(result.lines.w) & ~checked).sum())
    return np.where(checked, _limit(result, 1), _limit(result, together))


def prior_limits(result: Result) -> Floats:
    """Return the (N,) critical absolute w of priors; control points share a limit of their own."""
    if result.evidence is None:
        return np.zeros(0)
    control = np.array([kind == "control" for kind in result.evidence.priors.kind], dtype=bool)
    counts = int(control.sum()), int((~control).sum())
    return np.where(control, *(_limit(result, count) for count in counts))


def _limit(result: Result, tests: int) -> float:
    return compute_critical_value(compute_level(significance_of(result), tests))


MAX_PRIORS = 20
"""Number of priors shown: those with the largest test statistics."""

MAX_UNCHECKED = 6
"""Number of unchecked observations named for a measurement."""

MAX_MOVED = 5
"""Number of measurements named as moved by a removal."""


class WeakestLink(NamedTuple):
    """Measurement with the error that moves it most undetected, and its unchecked observations."""

    name: str
    weakest: str
    unchecked: str


def weakest_links(result: Result) -> list[WeakestLink]:
    """Describe the weakest link of each measurement, the least certain one first."""
    if result.evidence is None:
        return []
    rows, links = result.measurements, result.evidence.weakest
    table = []
    for i in order_computed_first(rows):
        name = rows.name[i]
        if not np.isfinite(rows.value[i]):
            continue
        unit = UNIT_WORDS.get(rows.unit[i], rows.unit[i])
        weakest = "no checked observation moves it"
        if links.what[i]:
            weakest = (
                f"an undetected error of {_amount(links.bias[i], links.unit[i])} in the "
                f"{links.what[i]} would move it by {number(abs(links.change[i]))} {unit}"
            )
        unchecked = join_names(links.unchecked[i], MAX_UNCHECKED)
        table.append(WeakestLink(name, weakest, unchecked))
    return table


def effect_words(result: Result, effects: Effects, i: int) -> str:
    """Format the effect of an undetected error in one observation: ``+0.042 m in 'whole'``.

    Parameters
    ----------
    result
        Result of the run.
    effects
        Effects of one kind of observation.
    i
        Row of the observation.
    """
    name = effects.on[i]
    if not name:
        return "–"
    unit = result.measurements.unit[result.measurements.name.index(name)]
    return f"{number(effects.change[i], signed=True)} {UNIT_WORDS.get(unit, unit)} in {name!r}"


def weakest_table(result: Result) -> Table:
    """Return the table of `weakest_links`."""
    links = (link._replace(unchecked=link.unchecked or "–") for link in weakest_links(result))
    return make_table("name | weakest link | checked by nothing else", links)


def prior_table(result: Result) -> Table:
    """Return the table of the priors that fit worst."""
    rows = []
    if result.evidence is not None:
        priors: PriorResults = result.evidence.priors
        limit = prior_limits(result)
        for i in np.argsort(-np.abs(priors.w), kind="stable")[:MAX_PRIORS].tolist():
            is_bad = bool(abs(priors.w[i]) > limit[i])
            cells = (
                priors.name[i],
                priors.frame_id[i] or "–",
                number(priors.residual[i], 1, signed=True),
                Cell(number(priors.w[i], 1, signed=True), look="bad" * is_bad),
                number(priors.redundancy[i], 2),
                _amount(priors.bias[i], priors.unit[i]),
                effect_words(result, priors.effects, i),
            )
            rows.append(Row(cells, is_bad))
    return make_table(
        "what | photo | >moved by [its sigmas] | >w | >redun\u00addancy | "
        ">smallest error that shows | which, unseen, would move",
        rows,
    )


def removal_rows(result: Result) -> list[str]:
    """Describe the removed observations, a sentence each."""
    sentences = []
    for step, one in enumerate(result.removals, start=1):
        what = f"The {one.what}"
        if one.cause:
            what = f"{one.what} It was corrected: {one.mended[0]}; now {one.mended[1]}"
        text = (
            f"{step}. {what} (w = {number(one.w, 1, signed=True)}); variance factor "
            f"{number(one.variance_factor_before, 2)} before, "
            f"{number(one.variance_factor_after, 2)} after."
        )
        if one.group:
            text += f" No test can distinguish it from: {', '.join(one.group)}."
        if one.rivals:
            text += f" It could also have been: {', '.join(one.rivals)}."
        moved = _list_moved(result, one)
        sentences.append(f"{text} That moved {moved}." if moved else text)
    return sentences


def _list_moved(result: Result, one: RemovalRecord) -> str:
    """List the measurements that a removal moved by most of their sigmas; count the others."""
    rows, change = result.measurements, np.array(one.change, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = np.abs(change) / rows.sigma
    order = np.argsort(-np.nan_to_num(sigmas, nan=-1.0), kind="stable")
    order = order[np.isfinite(change[order])]
    named = [
        f"{rows.name[i]!r} by {number(change[i], signed=True)} "
        f"{UNIT_WORDS.get(rows.unit[i], rows.unit[i])}"
        for i in order[:MAX_MOVED]
    ]
    more = len(order) - len(named)
    return ", ".join(named) + (f" and {more} more by fewer of their sigmas" if more else "")


def second_order_rows(result: Result) -> list[str]:
    """Describe the measurements for which the linear model is too rough, a sentence each."""
    second, rows = result.second_order, result.measurements
    if second is None:
        return []
    return [
        f"{rows.name[i]}: "
        + describe_approximation(
            float(rows.sigma[i]),
            float(second.sigma[i]),
            float(second.bias[i]),
            UNIT_WORDS.get(rows.unit[i], rows.unit[i]),
        )
        + "."
        for i in np.flatnonzero(second.off)
    ]


def overall_words(result: Result, *, in_statistics: bool = True) -> str:
    """Describe all checks together, in a sentence; empty if nothing was withheld.

    Parameters
    ----------
    result
        Result of a run.
    in_statistics
        Whether to mention the chi-square test.
    """
    checks = result.checks_overall
    if checks is None:
        return ""
    together = f"Root mean square errors: {'; '.join(_errors_by_kind(result, checks))}"
    if not in_statistics:
        percent = 100.0 * checks.probability
        often = format_digits(percent) if percent > 0.1 else "fewer than 0.1"
        often = "nearly 100" if percent > 99 else often
        return f"{together}. Errors as large as these are to be expected in {often} of 100 surveys."
    return (
        f"{together}; chi-square {number(checks.chi2, 1)} with their joint covariance, chance of "
        f"one as large {chance(checks.probability)}."
    )


def _errors_by_kind(result: Result, checks: ChecksOverall) -> Iterator[str]:
    """Summarise the errors of lengths, and those of points in position and height."""
    units = units_of(result)

    def size(error_m: Floats) -> str:
        return format_sigma(float(np.sqrt(np.mean(np.square(error_m)))), "m", units)

    lengths_m, points_m = result.line_checks.error_m, result.point_checks.error_m
    if len(lengths_m):
        percent = number(checks.mean_error_percent, 2)
        yield f"{format_count(len(lengths_m), 'length')} {size(lengths_m)} ({percent} % on average)"
    if len(points_m):
        across, up = size(points_m[:, :2]), size(points_m[:, 2])
        yield f"{format_count(len(points_m), 'point')} {across} in east and north, {up} in height"


def _amount(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "–"
    text = format_digits(value, 3)
    return text if unit == "1" else f"{text} {UNIT_WORDS.get(unit, unit)}"
