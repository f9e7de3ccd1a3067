"""Predicted accuracy of a layout, and choice of flight and lines that meet the requirements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.model.arrays import Floats
from uavgram.model.naming import plate_label
from uavgram.model.planned import (
    AccuracyGrid,
    ChosenBy,
    Gain,
    PlannedLines,
    PlannedMeasurements,
    PlannedPlates,
    PlanRequest,
    ReferenceKind,
)
from uavgram.pipeline.parallel import Progress
from uavgram.synthetic.plan.flights import Flight, find_visible, make_flight, remove_small_plates
from uavgram.synthetic.plan.layouts import (
    ChosenLines,
    Objective,
    add_greedily,
    compute_criterion,
    compute_criterion_with_one_more,
    compute_criterion_without_each,
    exchange_lines,
    find_best_layout,
    find_robust_layout,
    invert,
)
from uavgram.synthetic.plan.scene import (
    PlanScene,
    WantedValues,
    compute_equal_weights,
    make_lengths,
)
from uavgram.synthetic.plan.survey import (
    PossibleReferences,
    PredictedValues,
    compute_possible,
    predict_values,
)
from uavgram.synthetic.plan.survey import compute_possible as lines_or_plates

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


MAP_CELL_COUNT = 140
UNDETERMINED_RATIO = 100.0
"""Ratio of the criterion without a line to that of the layout at which it is undetermined."""


def list_ends(possible: PossibleReferences, lines: Sequence[int]) -> Floats:
    """Return the (L, 2, 2) ends of lines, from west to east, the southernmost line first.

    For plates the corners (L, 4, 2), counterclockwise.
    """
    ends = possible.spot_m[possible.candidates.ends[list(lines)]]
    ends = ends.reshape(-1, possible.candidates.ends.shape[1], 2)
    if ends.shape[1] == 2:
        turned = ends[:, 0, 0] > ends[:, 1, 0]
        ends[turned] = ends[turned, ::-1]
    middle = ends.mean(axis=1)
    return ends[np.lexsort((middle[:, 0], middle[:, 1]))] if len(ends) else ends


def weight_equally(possible: PossibleReferences) -> Objective:
    """Return the aim with weights that make the criterion a plain mean of lengths' sigmas."""
    return replace(possible.aim, weight=compute_equal_weights(possible.kind, possible.unit))


def compute_mean_sigma(found: PredictedValues) -> float:
    """Return the mean sigma of the lengths among the values; of all where there are none."""
    return float(compute_equal_weights(found.kind, found.unit) @ found.sigma)


def get_criterion_name(possible: PossibleReferences) -> ChosenBy:
    """Return the criterion of the layouts: a plain mean where all weights are equal."""
    weight = possible.aim.weight
    return "mean" if np.allclose(weight, weight[0], rtol=1e-9, atol=0.0) else "shares"


def list_planned_lines(
    scene: PlanScene, choice: Choice, lines: Sequence[int], found: PredictedValues
) -> PlannedLines:
    """Return the lines of a layout; `found` is its prediction, in the order of `list_ends`.

    Parameters
    ----------
    scene, choice
        The ground; flight and candidates.
    lines
        The layout: candidates by index.
    found
        Predicted accuracy.
    """
    possible = choice.possible
    ends = list_ends(possible, lines) if choice.laid == "lines" else np.zeros((0, 2, 2))
    world = scene.on_ground(ends)
    seen_in, without = _count_seen(scene, choice, lines, world)
    return PlannedLines(
        name=tuple(f"L{i + 1}" for i in range(len(ends))),
        start_world_m=world[:, 0],
        end_world_m=world[:, 1],
        length_m=np.linalg.norm(world[:, 1] - world[:, 0], axis=1),
        sigma_m=np.full(len(ends), scene.tape_sigma_m),
        frames_seen=seen_in,
        redundancy=found.redundancy[: len(ends)],
        mdb_m=found.mdb_m[: len(ends)],
        mean_sigma_without=without,
    )


def list_planned_plates(scene: PlanScene, choice: Choice, plates: Sequence[int]) -> PlannedPlates:
    """Return the plates of a layout, or none for lines.

    Parameters
    ----------
    scene, choice
        The ground; flight and candidates.
    plates
        The layout: candidates by index.
    """
    if choice.laid == "lines":
        return PlannedPlates()
    corner = scene.on_ground(list_ends(choice.possible, plates))
    seen_in, without = _count_seen(scene, choice, plates, corner)
    return PlannedPlates(
        name=tuple(plate_label(i) for i in range(len(corner))),
        corner_world_m=corner,
        side_m=scene.plates.side_m,
        frames_seen=seen_in,
        mean_sigma_without=without,
    )


def _count_seen(
    scene: PlanScene, choice: Choice, lines: Sequence[int], world_m: Floats
) -> tuple[Floats, Floats]:
    """Return the number of photos with each of (L, k, 3), and the criterion without it."""
    cameras, possible = choice.flight.cameras, choice.possible
    found = find_visible(scene.calibration, cameras, world_m.reshape(-1, 3), scene.deviation)
    shown = (remove_small_plates(found, 0) if choice.laid == "plates" else found).certain
    whole = shown.reshape(len(shown), *world_m.shape[:2]).all(axis=2)
    aim = weight_equally(possible)
    left = np.array(
        [_compute_criterion_without(aim, possible, lines, end) for end in world_m[..., :2]]
    )
    limit = UNDETERMINED_RATIO * compute_criterion(aim, possible.candidates, lines)
    return np.count_nonzero(whole, axis=0).astype(np.float64), np.where(left < limit, left, np.nan)


def _compute_criterion_without(
    aim: Objective, possible: PossibleReferences, lines: Sequence[int], end: Floats
) -> float:
    """Return the criterion without the line or plate that has these ends (k, 2)."""
    middle = possible.spot_m[possible.candidates.ends[list(lines)]].mean(axis=1)
    lost = int(np.argmin(np.linalg.norm(middle - end.mean(axis=0), axis=1)))
    return float(compute_criterion_without_each(aim, possible.candidates, lines)[lost])


def list_planned_measurements(
    request: PlanRequest, wanted: WantedValues, found: PredictedValues
) -> PlannedMeasurements:
    """Return the wanted values with their predicted sigmas.

    Parameters
    ----------
    request, wanted
        Required sigmas, and wanted values.
    found
        Predicted accuracy.
    """
    asked = [wanted.requests[k] for k in found.request]
    return PlannedMeasurements(
        name=found.name,
        kind=found.kind,
        unit=found.unit,
        points=tuple(one.points for one in asked),
        value=found.value,
        sigma=found.sigma,
        wanted_sigma=list_required_sigmas(request, wanted)[list(found.request)],
    )


def map_accuracy(scene: PlanScene, choice: Choice, lines: Sequence[int]) -> AccuracyGrid:
    """Return the map of the accuracy of lengths over the area.

    Parameters
    ----------
    scene, choice
        The ground; flight and candidates.
    lines
        The layout: candidates by index.
    """
    over = make_lengths(scene.area_m, MAP_CELL_COUNT)
    found = predict_values(
        scene, choice.flight.cameras, over.wanted, list_ends(choice.possible, lines)
    )
    pairs = found.sigma.reshape(-1, 2)
    return AccuracyGrid(
        center_world_m=scene.on_ground(over.middle_m),
        cell_m=over.cell_m,
        length_m=over.length_m,
        sigma_m=np.sqrt(np.mean(pairs**2, axis=1)),
    )


def compute_gain(possible: PossibleReferences, lines: Sequence[int]) -> float:
    """Return the relative reduction of the mean sigma by lines; near 1 if undetermined without."""
    aim = weight_equally(possible)
    whole = compute_criterion(aim, possible.candidates, lines)
    return 1.0 - whole / compute_criterion(aim, possible.candidates, ())


def list_gains(
    scene: PlanScene,
    request: PlanRequest,
    wanted: WantedValues,
    choice: Choice,
    lines: Sequence[int],
) -> Iterator[Gain]:
    """Iterate over the effects of one more line or photo, one line less, or a robust layout.

    Parameters
    ----------
    scene, request, wanted
        Purpose of the plan.
    choice
        Flight and candidates.
    lines
        The layout: candidates by index.
    """
    options = choice.possible
    aim, candidates = weight_equally(options), options.candidates
    one_each = choice.laid.removesuffix("s")
    # the best of the remaining candidates, with the layout fixed
    information = options.aim.information + candidates.information(lines)
    among = np.flatnonzero(candidates.apart_from(lines))
    larger = None
    if len(among):
        found = compute_criterion_with_one_more(options.aim, candidates, invert(information), among)
        best = int(among[np.argmin(found)])
        larger = ChosenLines((*lines, best), compute_criterion(aim, candidates, [*lines, best]))
        yield Gain(what=f"one more {one_each}", mean_sigma=larger.criterion)
    if len(lines) > 1:
        fewer = find_best_layout(options.aim, candidates, len(lines) - 1)
        yield Gain(
            what=f"one {one_each} less", mean_sigma=compute_criterion(aim, candidates, fewer.lines)
        )
    if request.lay == "either":
        yield from _evaluate_other_kind(scene, request, wanted, choice, len(lines))
    differs = set(choice.robust_layout.lines) != set(choice.layout.lines)
    if request.robust and differs:
        yield _evaluate_with_loss(aim, choice, choice.layout, "for the best result if none is lost")
    elif not request.robust:
        if differs:
            yield _evaluate_with_loss(aim, choice, choice.robust_layout, "to bear a loss best")
        if larger is not None and len(lines) > 1:
            robust_layout = find_robust_layout(options.aim, candidates, larger)
            yield _evaluate_with_loss(aim, choice, robust_layout, "to bear a loss best")
    yield from _evaluate_photo_more(scene, request, wanted, choice, lines)


def _evaluate_photo_more(
    scene: PlanScene,
    request: PlanRequest,
    wanted: WantedValues,
    choice: Choice,
    lines: Sequence[int],
) -> Iterator[Gain]:
    """Evaluate one more photo, with the same lines, or with new ones where these do not fit it."""
    more = add_photo(scene, request, choice.flight)
    if more is None:
        return
    aim, candidates = weight_equally(choice.possible), choice.possible.candidates
    now = compute_criterion(aim, candidates, lines)
    try:
        after = predict_values(scene, more.cameras, wanted, list_ends(choice.possible, lines))
        same = compute_mean_sigma(after)
    except (GeometryError, SingularError):
        same = np.inf
    if same <= now:
        yield Gain(what="one more photo", mean_sigma=same)
        return
    between = get_length_limits(request, choice.laid)
    try:
        options = lines_or_plates(
            scene,
            more.cameras,
            wanted,
            between,
            list_required_sigmas(request, wanted),
            FIRST_SPOT_COUNT,
        )
    except GeometryError:
        return
    laid = find_best_layout(options.aim, options.candidates, len(lines)).lines
    anew = compute_criterion(weight_equally(options), options.candidates, laid)
    if np.isfinite(anew):
        what = f"one more photo, and other places for the {choice.laid}"
        yield Gain(what=what, mean_sigma=anew)


def _evaluate_with_loss(aim: Objective, choice: Choice, layout: ChosenLines, aimed: str) -> Gain:
    """Evaluate another layout, with and without its most important line."""
    candidates = choice.possible.candidates
    whole = compute_criterion(aim, candidates, layout.lines)
    worst = float(compute_criterion_without_each(aim, candidates, layout.lines).max())
    return Gain(
        what=f"{len(layout.lines)} {choice.laid} laid {aimed}",
        mean_sigma=whole,
        worst_without=worst if worst < UNDETERMINED_RATIO * whole else None,
    )


def _evaluate_other_kind(
    scene: PlanScene, request: PlanRequest, wanted: WantedValues, choice: Choice, count: int
) -> Iterator[Gain]:
    """Evaluate the same number of plates instead of lines, or lines instead of plates."""
    laid: ReferenceKind = "plates" if choice.laid == "lines" else "lines"
    try:
        options = lines_or_plates(
            scene, choice.flight.cameras, wanted, get_length_limits(request, laid)
        )
    except GeometryError:
        return
    found = find_best_layout(options.aim, options.candidates, count).lines
    sigma = compute_criterion(weight_equally(options), options.candidates, found)
    yield Gain(what=f"{len(found)} {laid} in place of these {choice.laid}", mean_sigma=sigma)


def add_photo(scene: PlanScene, request: PlanRequest, flown: Flight) -> Flight | None:
    """Return the flight with one more photo; None for a grid, whose overlap fixes the number.

    Parameters
    ----------
    scene, request
        Purpose of the plan.
    flown
        The flight.
    """
    if flown.pattern == "grid":
        return None
    pattern = "strip" if flown.pattern == "single" else flown.pattern
    kind = (pattern, flown.height_m, flown.pitch_deg)
    return make_flight(scene, request, kind, flown.photos + 1)
