"""Measurements of the report: sampled intervals, second order, other solutions, error budget."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.error_budget import SOURCES
from uavgram.model.arrays import Floats
from uavgram.model.naming import format_digits
from uavgram.model.result.reliability import ErrorBudget, Noise
from uavgram.model.result.result import Alternative, Result
from uavgram.stages.measure import MAX_BIAS_SIGMAS, MAX_SIGMA_DIFFERENCE
from uavgram.views.formatting import (
    number,
    order_computed_first,
    relief_text,
    select_least_certain,
    shift_text,
)
from uavgram.views.survey.reliability import second_order_rows
from uavgram.views.tables import Table, make_table
from uavgram.views.units import format_value, units_of

MAX_RELIEF = 10
"""Largest number of single-photo measurements with a sentence of their own, the least certain."""

MAX_DIFFERENT = 10
"""Number of measurements shown for another solution: those that it changes most."""

MIN_SIGMA_CHANGE = 0.05
"""Relative change of a sigma, or of an error's size, that is not mentioned."""


def describe_sampling(result: Result) -> str:
    """Explain the sampled columns; empty if nothing was sampled."""
    sampled = result.monte_carlo
    if sampled is None:
        return ""
    left_out = f"; {sampled.failed} more did not converge and are left out"
    return (
        f"Sampled: all observations and everything known beforehand were drawn anew "
        f"{sampled.samples} times (seed {sampled.seed}), and everything adjusted and measured "
        f"again{left_out if sampled.failed else ''}; the interval is from the 2.5 % to the 97.5 % "
        "quantile."
    )


class ReliefNotes(NamedTuple):
    """Dependence of single photos on the ground's shape: sentences, and number of the others."""

    sentences: tuple[str, ...]
    more: int


def relief_notes(result: Result) -> ReliefNotes:
    """Describe each measurement whose points are seen in one photo only."""
    rows, points = result.measurements, result.points
    photos = dict(zip(points.label, points.frames, strict=True))
    alone = [
        i
        for i in order_computed_first(rows)
        if np.isfinite(rows.shift_relief_10cm[i])
        and all(len(photos.get(label, ())) == 1 for label in rows.points[i])
    ]
    relief = relief_text(units_of(result))
    sentences = tuple(
        f"{rows.name[i]}: each of its points is seen in one photo only, so no observation "
        f"checks the height of the ground there. If that is {relief} higher or lower than assumed, "
        f"this value shifts by up to {shift_text(rows.shift_relief_10cm[i], rows.unit[i])}."
        for i in select_least_certain(rows, alone, MAX_RELIEF)
    )
    return ReliefNotes(sentences, len(alone) - len(sentences))


def describe_learnt_noise(result: Result) -> str:
    """Compare the uncertainties with those for errors as stated; empty if they are alike."""
    rows, noise = result.measurements, result.noise
    known = np.isfinite(rows.sigma) & (rows.sigma_stated > 0)
    ratio = rows.sigma[known] / rows.sigma_stated[known]
    if noise is None or np.abs(ratio - 1.0).max(initial=0.0) <= MIN_SIGMA_CHANGE:
        return ""
    low, high = number(float(ratio.min()), 1), number(float(ratio.max()), 1)
    times = high if low == high else f"{low} to {high}"
    causes = _causes(noise)
    because = f", because {' and '.join(causes)}" if causes else ""
    return f"The uncertainties are {times} times as large as with errors as stated{because}."


def _causes(noise: Noise) -> list[str]:
    causes = []
    if any(area.size_m > (1.0 + MIN_SIGMA_CHANGE) * area.stated_m for area in noise.roughness):
        causes.append("the ground is not a plane")
    for picks in noise.picks:
        if abs(picks.factor - 1.0) > MIN_SIGMA_CHANGE:
            found = picks.stated_px * picks.factor
            how = "less" if picks.factor > 1.0 else "more"
            sizes = f"{format_digits(picks.stated_px)} px stated, {format_digits(found)} px found"
            causes.append(
                f"the {noise.describe_picks(picks)} are {how} exact than stated ({sizes})"
            )
    return causes


class SecondOrderNote(NamedTuple):
    """Return whether first-order propagation is good enough.

    Attributes
    ----------
    sentence
        Result for all measurements.
    doubtful
        A sentence for each measurement for which it is not.
    advice
        How to treat these.
    """

    sentence: str
    doubtful: tuple[str, ...]
    advice: str


def second_order_note(result: Result) -> SecondOrderNote | None:
    """Describe the second-order check; return None if there was none."""
    second, rows = result.second_order, result.measurements
    if second is None or not np.isfinite(rows.value).any():
        return None
    computed = np.isfinite(rows.value) & (rows.sigma > 0)
    sigma = rows.sigma[computed]
    change = np.nan_to_num(np.abs(second.sigma[computed] / sigma - 1.0))
    shift = np.nan_to_num(np.abs(second.bias[computed] / sigma))
    sentence = (
        "The ± are computed by a linear approximation. It was checked for each value: it changes a "
        f"± by {100 * change.max(initial=0.0):.1f} % at most, and a value by "
        f"{shift.max(initial=0.0):.2f} of its ± at most. It is good enough up to "
        f"{100 * MAX_SIGMA_DIFFERENCE:.0f} % and {MAX_BIAS_SIGMAS} of the ±."
    )
    advice = (
        "run again with --monte-carlo and use its intervals"
        if result.monte_carlo is None
        else "use the sampled intervals"
    )
    return SecondOrderNote(sentence, tuple(second_order_rows(result)), advice)


class AlternativeTable(NamedTuple):
    """Another solution and its effect on the measurements.

    Attributes
    ----------
    solution
        The other one.
    table
        The measurements that it changes most.
    others
        A sentence on those that it changes less; empty if there are none.
    """

    solution: Alternative
    table: Table
    others: str


def alternative_tables(result: Result) -> list[AlternativeTable]:
    """Return the other solutions, each with its effect on the measurements."""
    return [_alternative(result, one) for one in result.solution.alternatives]


def _alternative(result: Result, other: Alternative) -> AlternativeTable:
    rows = result.measurements
    values = np.array(other.values, dtype=np.float64)
    count = len(values)
    difference = values - rows.value[:count]
    sigmas = np.abs(difference) / np.where(rows.sigma > 0, rows.sigma, np.nan)[:count]
    order = np.argsort(-np.nan_to_num(sigmas, nan=-1.0), kind="stable")
    order = order[np.isfinite(sigmas[order])]
    shown, rest = order[:MAX_DIFFERENT], order[MAX_DIFFERENT:]
    most = number(float(sigmas[rest].max(initial=0.0)), 1)
    others = f"All others ({len(rest)}) differ by at most {most} sigmas." if len(rest) else ""
    value_text = partial(format_value, units=units_of(result))
    cells = []
    for i in shown.tolist():
        own = float(rows.sigma[i]), rows.unit[i]
        cells.append(
            (
                rows.name[i],
                value_text(float(rows.value[i]), *own),
                value_text(values[i], *own),
                "+" * bool(difference[i] > 0) + value_text(difference[i], *own),
                number(sigmas[i], 1),
            )
        )
    titles = "name | >in this result | >in the other | >difference | >in sigmas"
    return AlternativeTable(other, make_table(titles, cells), others)


# Okabe and Ito (2008): distinguishable for colour-blind readers; in the order of the bars.
COLOURS = {
    "picks": "#0072b2",
    "identification": "#332288",
    "matches": "#88ccee",
    "tie points": "#b3b35c",
    "lens": "#cc79a7",
    "known lengths": "#009e73",
    "known things": "#44aa44",
    "tape": "#66c2a5",
    "ground": "#8c6d31",
    "flight log": "#e69f00",
    "control points": "#56b4e9",
    "rolling shutter": "#f0e442",
    "friction and times": "#d55e00",
    "choice of axes": "#999999",
    "other explanations": "#aa4466",
}
OTHER_COLOUR = "#333333"
"""Colour of sources that are not among these."""

MAX_ROWS = 40
"""Number of measurements whose budget is printed, the least certain; results.json has all."""

MIN_DRAWN_SHARE = 0.0005
"""Share that rounds to 0.1 %: smaller ones are not drawn."""


class Segment(NamedTuple):
    """Segment of a bar: start and length in percent, and colour."""

    start: float
    length: float
    colour: str


class BudgetRow(NamedTuple):
    """Budget of one measurement: name, bar, largest source, and the shares in percent."""

    name: str
    bar: list[Segment]
    largest: str
    shares: list[str]


class BudgetTable(NamedTuple):
    """Error budgets of all measurements that have a value.

    Attributes
    ----------
    sources
        Name and colour of each, in the order of the bars and of the columns.
    rows
        In the order of the project; of many, those that are not ok, and the least certain.
    more
        Number of measurements not shown.
    summary
        A sentence for each source that is the largest of some measurement.
    """

    sources: tuple[tuple[str, str], ...]
    rows: tuple[BudgetRow, ...]
    more: int
    summary: tuple[str, ...]


def budget_table(result: Result) -> BudgetTable | None:
    """Lay out the bars; return None if there is no budget or no measurement has a value."""
    budget = result.error_budget
    if budget is None or not np.isfinite(budget.share).any():
        return None
    rank = {source: r for r, source in enumerate(COLOURS)}
    order = sorted(range(len(budget.source)), key=lambda s: rank.get(budget.source[s], len(rank)))
    sources = tuple(budget.source[s] for s in order)
    share = budget.share[:, order]
    shown = [
        int(i) for i in order_computed_first(result.measurements) if np.isfinite(share[i]).all()
    ]
    return BudgetTable(
        sources=tuple((source, _colour(source)) for source in sources),
        rows=tuple(
            BudgetRow(
                name=result.measurements.name[i],
                bar=_bar(sources, share[i]),
                largest=sources[int(np.argmax(share[i]))],
                shares=[number(100 * part, 1) for part in share[i]],
            )
            for i in select_least_certain(result.measurements, shown, MAX_ROWS)
        ),
        more=len(shown[MAX_ROWS:]),
        summary=_summary(ErrorBudget(source=sources, share=share[shown])),
    )


def _colour(source: str) -> str:
    return COLOURS.get(source, OTHER_COLOUR)


def _bar(sources: tuple[str, ...], share: Floats) -> list[Segment]:
    # stack the segments: cumulative shares
    ends = np.cumsum(share)
    return [
        Segment(round(100 * (end - part), 2), round(100 * part, 2), _colour(source))
        for source, part, end in zip(sources, share.tolist(), ends.tolist(), strict=True)
        if part >= MIN_DRAWN_SHARE
    ]


def _summary(budget: ErrorBudget) -> tuple[str, ...]:
    """Describe the largest sources, the most frequent one first."""
    largest = np.bincount(np.argmax(budget.share, axis=1), minlength=len(budget.source))
    sentences = []
    for s in np.argsort(-largest, kind="stable"):
        if largest[s]:
            source = SOURCES[budget.source[s]]
            sentences.append(
                f"Largest in {largest[s]} of {len(budget.share)}: {source.name} ({source.words}). "
                f"{source.advice}"
            )
    return tuple(sentences)
