"""Predicted accuracy of a layout: measurements, lines, the map, and gains of alternatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.model.arrays import Floats
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
from uavgram.model.target_families import plate_label
from uavgram.synthetic.plan.cameras import large_enough, seen
from uavgram.synthetic.plan.choose import SPOTS_AT_FIRST, Choice, good_enough, lengths
from uavgram.synthetic.plan.flights import Flight, flight
from uavgram.synthetic.plan.layouts import (
    Aim,
    Chosen,
    best_layout,
    covariance_of,
    criterion_of,
    surviving,
    with_one_more,
    without_each,
)
from uavgram.synthetic.plan.possible import Possible
from uavgram.synthetic.plan.possible import possible as lines_or_plates
from uavgram.synthetic.plan.scene import PlanScene
from uavgram.synthetic.plan.survey import Predicted, predicted
from uavgram.synthetic.plan.wanted import Wanted, equal_weights, lengths_over

MAP_CELLS = 140
UNDETERMINED_RATIO = 100.0
"""Ratio of the criterion without a line to that of the layout at which it is undetermined."""


def ends_of(possible: Possible, lines: Sequence[int]) -> Floats:
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


def plain_mean(possible: Possible) -> Aim:
    """Return the aim with weights that make the criterion a plain mean of lengths' sigmas."""
    return replace(possible.aim, weight=equal_weights(possible.kind, possible.unit))


def mean_sigma(found: Predicted) -> float:
    """Return the mean sigma of the lengths among the values; of all where there are none."""
    return float(equal_weights(found.kind, found.unit) @ found.sigma)


def chosen_by(possible: Possible) -> ChosenBy:
    """Return the criterion of the layouts: a plain mean where all weights are equal."""
    weight = possible.aim.weight
    return "mean" if np.allclose(weight, weight[0], rtol=1e-9, atol=0.0) else "shares"


def planned_lines(
    scene: PlanScene, choice: Choice, lines: Sequence[int], found: Predicted
) -> PlannedLines:
    """Return the lines of a layout; `found` is its prediction, in the order of `ends_of`.

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
    ends = ends_of(possible, lines) if choice.laid == "lines" else np.zeros((0, 2, 2))
    world = scene.on_ground(ends)
    seen_in, without = _seen_and_lost(scene, choice, lines, world)
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


def planned_plates(scene: PlanScene, choice: Choice, plates: Sequence[int]) -> PlannedPlates:
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
    corner = scene.on_ground(ends_of(choice.possible, plates))
    seen_in, without = _seen_and_lost(scene, choice, plates, corner)
    return PlannedPlates(
        name=tuple(plate_label(i) for i in range(len(corner))),
        corner_world_m=corner,
        side_m=scene.plates.side_m,
        frames_seen=seen_in,
        mean_sigma_without=without,
    )


def _seen_and_lost(
    scene: PlanScene, choice: Choice, lines: Sequence[int], world_m: Floats
) -> tuple[Floats, Floats]:
    """Return the number of photos with each of (L, k, 3), and the criterion without it."""
    cameras, possible = choice.flight.cameras, choice.possible
    found = seen(scene.calibration, cameras, world_m.reshape(-1, 3), scene.deviation)
    shown = (large_enough(found, 0) if choice.laid == "plates" else found).certain
    whole = shown.reshape(len(shown), *world_m.shape[:2]).all(axis=2)
    aim = plain_mean(possible)
    left = np.array([_without(aim, possible, lines, end) for end in world_m[..., :2]])
    limit = UNDETERMINED_RATIO * criterion_of(aim, possible.candidates, lines)
    return np.count_nonzero(whole, axis=0).astype(np.float64), np.where(left < limit, left, np.nan)


def _without(aim: Aim, possible: Possible, lines: Sequence[int], end: Floats) -> float:
    """Return the criterion without the line or plate that has these ends (k, 2)."""
    middle = possible.spot_m[possible.candidates.ends[list(lines)]].mean(axis=1)
    lost = int(np.argmin(np.linalg.norm(middle - end.mean(axis=0), axis=1)))
    return float(without_each(aim, possible.candidates, lines)[lost])


def planned_measurements(
    request: PlanRequest, wanted: Wanted, found: Predicted
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
        wanted_sigma=good_enough(request, wanted)[list(found.request)],
    )


def accuracy_grid(scene: PlanScene, choice: Choice, lines: Sequence[int]) -> AccuracyGrid:
    """Return the map of the accuracy of lengths over the area.

    Parameters
    ----------
    scene, choice
        The ground; flight and candidates.
    lines
        The layout: candidates by index.
    """
    over = lengths_over(scene.area_m, MAP_CELLS)
    found = predicted(scene, choice.flight.cameras, over.wanted, ends_of(choice.possible, lines))
    pairs = found.sigma.reshape(-1, 2)
    return AccuracyGrid(
        center_world_m=scene.on_ground(over.middle_m),
        cell_m=over.cell_m,
        length_m=over.length_m,
        sigma_m=np.sqrt(np.mean(pairs**2, axis=1)),
    )


def gained_by(possible: Possible, lines: Sequence[int]) -> float:
    """Return the relative reduction of the mean sigma by lines; near 1 if undetermined without."""
    aim = plain_mean(possible)
    whole = criterion_of(aim, possible.candidates, lines)
    return 1.0 - whole / criterion_of(aim, possible.candidates, ())


def gains(
    scene: PlanScene, request: PlanRequest, wanted: Wanted, choice: Choice, lines: Sequence[int]
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
    aim, candidates = plain_mean(options), options.candidates
    one_each = choice.laid.removesuffix("s")
    # the best of the remaining candidates, with the layout fixed
    information = options.aim.information + candidates.information(lines)
    among = np.flatnonzero(candidates.apart_from(lines))
    larger = None
    if len(among):
        found = with_one_more(options.aim, candidates, covariance_of(information), among)
        best = int(among[np.argmin(found)])
        larger = Chosen((*lines, best), criterion_of(aim, candidates, [*lines, best]))
        yield Gain(what=f"one more {one_each}", mean_sigma=larger.criterion)
    if len(lines) > 1:
        fewer = best_layout(options.aim, candidates, len(lines) - 1)
        yield Gain(
            what=f"one {one_each} less", mean_sigma=criterion_of(aim, candidates, fewer.lines)
        )
    if request.lay == "either":
        yield from _instead(scene, request, wanted, choice, len(lines))
    differs = set(choice.robust_layout.lines) != set(choice.layout.lines)
    if request.robust and differs:
        yield _borne(aim, choice, choice.layout, "for the best result if none is lost")
    elif not request.robust:
        if differs:
            yield _borne(aim, choice, choice.robust_layout, "to bear a loss best")
        if larger is not None and len(lines) > 1:
            robust_layout = surviving(options.aim, candidates, larger)
            yield _borne(aim, choice, robust_layout, "to bear a loss best")
    yield from _photo_more(scene, request, wanted, choice, lines)


def _photo_more(
    scene: PlanScene, request: PlanRequest, wanted: Wanted, choice: Choice, lines: Sequence[int]
) -> Iterator[Gain]:
    """Evaluate one more photo, with the same lines, or with new ones where these do not fit it."""
    more = one_photo_more(scene, request, choice.flight)
    if more is None:
        return
    aim, candidates = plain_mean(choice.possible), choice.possible.candidates
    now = criterion_of(aim, candidates, lines)
    try:
        after = predicted(scene, more.cameras, wanted, ends_of(choice.possible, lines))
        same = mean_sigma(after)
    except (GeometryError, SingularError):
        same = np.inf
    if same <= now:
        yield Gain(what="one more photo", mean_sigma=same)
        return
    between = lengths(request, choice.laid)
    try:
        options = lines_or_plates(
            scene, more.cameras, wanted, between, good_enough(request, wanted), SPOTS_AT_FIRST
        )
    except GeometryError:
        return
    laid = best_layout(options.aim, options.candidates, len(lines)).lines
    anew = criterion_of(plain_mean(options), options.candidates, laid)
    if np.isfinite(anew):
        what = f"one more photo, and other places for the {choice.laid}"
        yield Gain(what=what, mean_sigma=anew)


def _borne(aim: Aim, choice: Choice, layout: Chosen, aimed: str) -> Gain:
    """Evaluate another layout, with and without its most important line."""
    candidates = choice.possible.candidates
    whole = criterion_of(aim, candidates, layout.lines)
    worst = float(without_each(aim, candidates, layout.lines).max())
    return Gain(
        what=f"{len(layout.lines)} {choice.laid} laid {aimed}",
        mean_sigma=whole,
        worst_without=worst if worst < UNDETERMINED_RATIO * whole else None,
    )


def _instead(
    scene: PlanScene, request: PlanRequest, wanted: Wanted, choice: Choice, count: int
) -> Iterator[Gain]:
    """Evaluate the same number of plates instead of lines, or lines instead of plates."""
    laid: ReferenceKind = "plates" if choice.laid == "lines" else "lines"
    try:
        options = lines_or_plates(scene, choice.flight.cameras, wanted, lengths(request, laid))
    except GeometryError:
        return
    found = best_layout(options.aim, options.candidates, count).lines
    sigma = criterion_of(plain_mean(options), options.candidates, found)
    yield Gain(what=f"{len(found)} {laid} in place of these {choice.laid}", mean_sigma=sigma)


def one_photo_more(scene: PlanScene, request: PlanRequest, flown: Flight) -> Flight | None:
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
    return flight(scene, request, kind, flown.photos + 1)
