"""Error budget: sources of the variance of each measurement, as bars and in words."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.reliability import ErrorBudget
from uavgram.model.result.result import Result
from uavgram.views.formatting import number, order_computed_first

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
}

# Description of each source, and how to reduce it.
WORDS = {
    "picks": (
        "how exactly the points were picked in the photos",
        "Picking them in more photos, or with more care, would help there.",
    ),
    "identification": (
        "how far the picked points are from the intended ones, the same in all photos",
        "Sharp marks or targets would help there; more photos do not.",
    ),
    "matches": (
        "how exactly picked points were found in other photos",
        "Sharper photos, or picks on distinct objects, would help there.",
    ),
    "tie points": (
        "how exactly the program measured tie points in the photos",
        "Photos that overlap more would help there.",
    ),
    "lens": (
        "how well the camera is calibrated",
        "A better calibration would help there.",
    ),
    "known lengths": (
        "how exactly the known lengths were taped",
        "More, longer or better taped lengths would help there.",
    ),
    "known things": (
        "how well the known distances, angles and conditions hold (known.csv)",
        "More or better known things would help there.",
    ),
    "tape": (
        "how well the scale of the tape is known, which all its lengths share",
        "A tape that was compared with a better one would help there (tape: scale_sigma).",
    ),
    "ground": (
        "how well the height and slope of the ground are known",
        "Points picked in more photos, from other sides, or a stated height would help there.",
    ),
    "flight log": (
        "position, attitude and time of the photos in the flight log",
        "More known lengths or control points would help there.",
    ),
    "control points": (
        "how well the control points are known",
        "More or better control points would help there.",
    ),
    "rolling shutter": (
        "how well it is known in which time the camera reads a photo, row after row",
        "Flying slower, or `readout_ms` in camera.yaml, would help there.",
    ),
    "friction and times": (
        "the stated friction, and the times of the exposures",
        "A drag test on the spot, or exposure times that are known better, would help there.",
    ),
    "choice of axes": (
        "where the origin and north of the survey were put",
        "A flight log or control points would fix them.",
    ),
}

MAX_ROWS = 40
"""Number of measurements whose budget is printed, the least certain; results.json has all."""

FELT = 0.0005
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
        The least certain measurement first.
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
    order = sorted(range(len(budget.source)), key=lambda s: rank[budget.source[s]])
    sources = tuple(budget.source[s] for s in order)
    share = budget.share[:, order]
    shown = [
        int(i) for i in order_computed_first(result.measurements) if np.isfinite(share[i]).all()
    ]
    return BudgetTable(
        sources=tuple((source, COLOURS[source]) for source in sources),
        rows=tuple(
            BudgetRow(
                name=result.measurements.name[i],
                bar=_bar(sources, share[i]),
                largest=sources[int(np.argmax(share[i]))],
                shares=[number(100 * part, 1) for part in share[i]],
            )
            for i in shown[:MAX_ROWS]
        ),
        more=len(shown[MAX_ROWS:]),
        summary=_summary(ErrorBudget(source=sources, share=share[shown])),
    )


def _bar(sources: tuple[str, ...], share: Floats) -> list[Segment]:
    # stack the segments: cumulative shares
    ends = np.cumsum(share)
    return [
        Segment(round(100 * (end - part), 2), round(100 * part, 2), COLOURS[source])
        for source, part, end in zip(sources, share.tolist(), ends.tolist(), strict=True)
        if part >= FELT
    ]


def _summary(budget: ErrorBudget) -> tuple[str, ...]:
    """Describe the largest sources, the most frequent one first."""
    largest = np.bincount(np.argmax(budget.share, axis=1), minlength=len(budget.source))
    sentences = []
    for s in np.argsort(-largest, kind="stable"):
        if largest[s]:
            what, help_ = WORDS[budget.source[s]]
            sentences.append(
                f"Largest in {largest[s]} of {len(budget.share)}: {budget.source[s]} ({what}). "
                f"{help_}"
            )
    return tuple(sentences)
