"""Choice of the flight and the number of lines that meet the requirements with least effort."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.model.arrays import Floats
from uavgram.model.planned import PlanRequest, ReferenceKind
from uavgram.pipeline.progress import Progress
from uavgram.synthetic.plan.flights import Flight
from uavgram.synthetic.plan.layouts import (
    ChosenLines,
    add_greedily,
    exchange_lines,
    find_best_layout,
    find_robust_layout,
    invert,
)
from uavgram.synthetic.plan.possible import PossibleReferences, compute_possible
from uavgram.synthetic.plan.scene import PlanScene
from uavgram.synthetic.plan.wanted import WantedValues

FIRST_SPOT_COUNT = 100
"""Number of possible line ends while flights are compared."""

MINUTES_PER_LINE = 3.0
"""Time to mark both ends of a line, tape it, read twice, and write it down."""

MINUTES_PER_PLATE = 1.0
"""Time to lay out a plate flat and to collect it; its corners are found by the program."""

MINUTES_PER_PHOTO = 0.25
"""Time to pick a photo's points with the program's help, or to check its matches."""

MAX_CRITERION_RATIO = 1.25
"""Accepted criterion relative to the best one where no sigma is required."""

MIN_LINES = 3
"""Smallest number of lines that fixes the photos.

A single photo takes one more, to detect a wrong reading; so does a survey without a log, whose
photo may have another pose.
"""


class Choice(NamedTuple):
    """A flight with its layout.

    Attributes
    ----------
    flight, possible, laid
        The flight, and its possible lines or plates.
    layout, robust_layout
        The best one, and one of as many lines that tolerates the loss of any.
    """

    flight: Flight
    possible: PossibleReferences
    layout: ChosenLines
    robust_layout: ChosenLines
    laid: ReferenceKind = "lines"


class _Candidate(NamedTuple):
    flight: Flight
    laid: ReferenceKind
    lines: int
    criterion: float
    worst: float  # largest ratio of sigma to required sigma; NaN without any
    minutes: float


def choose_flight(
    scene: PlanScene,
    request: PlanRequest,
    wanted: WantedValues,
    flown: list[Flight],
    progress: Progress,
) -> Choice:
    """Compare flights with few possible line ends, then lay out the best one with many.

    Plates are treated the same way, where they are requested.

    Parameters
    ----------
    scene, request
        Purpose of the plan.
    wanted
        Wanted measurements.
    flown
        Flights that show everything.
    progress
        Shows the comparison.

    Raises
    ------
    GeometryError
        No flight allows any line.
    """
    enough = list_required_sigmas(request, wanted)
    tried: list[_Candidate] = []
    refused: GeometryError | None = None
    for one in progress(flown, "comparing flights", len(flown)):
        for laid in list_kinds(request):
            try:
                tried += _evaluate(scene, request, wanted, (one, laid), enough)
            except GeometryError as why:
                refused = refused or why
    if not tried:
        raise refused or GeometryError("no line fits into the area: allow shorter ones")
    best = _find_least_effort(tried)
    options = compute_possible(
        scene, best.flight.cameras, wanted, get_length_limits(request, best.laid), enough
    )
    layout = find_best_layout(options.aim, options.candidates, best.lines)
    if request.lines is None and best.worst <= 1.0:  # exchanges may save a line
        layout = _remove_lines(options, layout, count_min_lines(scene, best.flight))
    robust_layout = layout
    if len(layout.lines) > 1:
        robust_layout = find_robust_layout(options.aim, options.candidates, layout)
    if robust_layout.criterion < layout.criterion:  # the exchanges found a better one from there
        layout = exchange_lines(options.aim, options.candidates, robust_layout)
    return Choice(best.flight, options, layout, robust_layout, best.laid)


def list_kinds(request: PlanRequest) -> tuple[ReferenceKind, ...]:
    """Return the kinds of references that may be laid out."""
    return ("lines", "plates") if request.lay == "either" else (request.lay,)


def get_length_limits(request: PlanRequest, laid: ReferenceKind) -> tuple[float, float] | None:
    """Return the limits of the length of lines; None for plates."""
    return (request.shortest_line_m, request.longest_tape_m) if laid == "lines" else None


def count_min_lines(scene: PlanScene, flight: Flight) -> int:
    """Return the smallest number of lines that the program proposes for a flight."""
    return MIN_LINES + int(flight.photos == 1 or scene.logged is None)


def list_required_sigmas(request: PlanRequest, wanted: WantedValues) -> Floats:
    """Return (requests,) required sigmas; NaN where none was given."""
    stated = {one.name: one.sigma_m for one in request.wanted}
    sigma = [stated.get(one.name) for one in wanted.requests]
    return np.array([np.nan if one is None else one for one in sigma], dtype=np.float64)


def _evaluate(
    scene: PlanScene,
    request: PlanRequest,
    wanted: WantedValues,
    way: tuple[Flight, ReferenceKind],
    enough: Floats,
) -> list[_Candidate]:
    """Evaluate a flight with each number of lines or plates, chosen greedily."""
    one, laid = way
    between = get_length_limits(request, laid)
    options = compute_possible(scene, one.cameras, wanted, between, enough, FIRST_SPOT_COUNT)
    each = MINUTES_PER_LINE if laid == "lines" else MINUTES_PER_PLATE
    most = request.lines if request.lines is not None else request.most_lines
    least = request.lines if request.lines is not None else count_min_lines(scene, one)
    start = ChosenLines((), options.aim.criterion(invert(options.aim.information)))
    layouts = (start, *add_greedily(options.aim, options.candidates, most))
    return [
        _Candidate(
            one,
            laid,
            len(layout.lines),
            layout.criterion,
            compute_worst_ratio(options, layout),
            one.duration_s / 60.0 + MINUTES_PER_PHOTO * one.photos + each * len(layout.lines),
        )
        for layout in layouts
        if len(layout.lines) >= min(least, len(layouts) - 1)
    ]


def compute_worst_ratio(options: PossibleReferences, layout: ChosenLines) -> float:
    """Return the largest ratio of sigma to required sigma; NaN without any."""
    information = options.aim.information + options.candidates.information(layout.lines)
    share = options.aim.sigma(invert(information)) / options.enough
    return float(np.nanmax(share)) if np.isfinite(share).any() else float("nan")


def _find_least_effort(tried: list[_Candidate]) -> _Candidate:
    """Return the candidate of least effort that meets the requirements; else the best one."""
    reached = [one for one in tried if one.worst <= 1.0]
    if reached:
        return min(reached, key=lambda one: (one.minutes, one.criterion))
    if not np.isnan(tried[0].worst):
        return min(tried, key=lambda one: (one.worst, one.minutes))
    best = min(one.criterion for one in tried)
    nearly = [one for one in tried if one.criterion <= MAX_CRITERION_RATIO * best]
    return min(nearly, key=lambda one: (one.minutes, one.criterion))


def _remove_lines(options: PossibleReferences, layout: ChosenLines, least: int) -> ChosenLines:
    """Remove lines one by one as long as the requirements are met."""
    while len(layout.lines) > least:
        fewer = find_best_layout(options.aim, options.candidates, len(layout.lines) - 1)
        if not compute_worst_ratio(options, fewer) <= 1.0:
            break
        layout = fewer
    return layout
