"""What a chosen layout will reach: measurements, lines, the map, and what other choices would."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.planning.layouts import (
    Aim,
    best_layout,
    covariance_of,
    criterion_of,
    with_one_more,
)
from uavgram.estimation.planning.losses import without_each
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.model.arrays import Floats
from uavgram.model.planned.parts import AccuracyGrid, PlannedLines, PlannedMeasurements
from uavgram.model.planned.plan import Gain
from uavgram.model.planned.request import PlanRequest
from uavgram.pipeline.plan.choose import Choice, good_enough
from uavgram.pipeline.plan.possible import Possible
from uavgram.pipeline.plan.predicted import Predicted, predicted
from uavgram.stages.plan.cameras import seen
from uavgram.stages.plan.flights import Flight, flight
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.wanted import Wanted, equal_weights, lengths_over

MAP_CELLS = 140
NOTHING_HOLDS = 100.0
"""Times the criterion beyond which a layout without one of its lines holds nothing any more."""


def ends_of(possible: Possible, lines: Sequence[int]) -> Floats:
    """(L, 2, 2) where lines begin and end, from west to east, the southernmost first."""
    ends = possible.spot_m[possible.candidates.ends[list(lines)]]
    ends = ends.reshape(-1, 2, 2)
    turned = ends[:, 0, 0] > ends[:, 1, 0]
    ends[turned] = ends[turned, ::-1]
    middle = ends.mean(axis=1)
    return ends[np.lexsort((middle[:, 0], middle[:, 1]))] if len(ends) else ends


def plain_mean(possible: Possible) -> Aim:
    """What is wanted with weights that make the criterion a plain mean of lengths' sigmas."""
    return replace(possible.aim, weight=equal_weights(possible.kind, possible.unit))


def mean_sigma(found: Predicted) -> float:
    """Mean sigma of the lengths among the values; of all where there are none."""
    return float(equal_weights(found.kind, found.unit) @ found.sigma)


def planned_lines(
    scene: PlanScene, choice: Choice, lines: Sequence[int], found: Predicted
) -> PlannedLines:
    """The lines of a layout; `found` is what it will reach, its lines as `ends_of` orders them.

    Parameters
    ----------
    scene, choice
        The ground; flight and candidates.
    lines
        The layout: candidates by index.
    found
        What it will reach.
    """
    possible = choice.possible
    ends = ends_of(possible, lines)
    world = scene.on_ground(ends)
    shown = seen(
        scene.calibration, choice.flight.cameras, world.reshape(-1, 3), scene.deviation
    ).certain.reshape(-1, len(ends), 2)
    aim = plain_mean(possible)
    left = np.array([_without(aim, possible, lines, end) for end in ends])
    whole = criterion_of(aim, possible.candidates, lines)
    return PlannedLines(
        name=tuple(f"L{i + 1}" for i in range(len(ends))),
        start_world_m=world[:, 0],
        end_world_m=world[:, 1],
        length_m=np.linalg.norm(world[:, 1] - world[:, 0], axis=1),
        sigma_m=np.full(len(ends), scene.tape_sigma_m),
        frames_seen=np.count_nonzero(shown.all(axis=2), axis=0),
        redundancy=found.redundancy,
        mdb_m=found.mdb_m,
        mean_sigma_without=np.where(left < NOTHING_HOLDS * whole, left, np.nan),
    )


def _without(aim: Aim, possible: Possible, lines: Sequence[int], end: Floats) -> float:
    """The criterion without the line that has these ends (2, 2)."""
    middle = possible.spot_m[possible.candidates.ends[list(lines)]].mean(axis=1)
    lost = int(np.argmin(np.linalg.norm(middle - end.mean(axis=0), axis=1)))
    return float(without_each(aim, possible.candidates, lines)[lost])


def planned_measurements(
    request: PlanRequest, wanted: Wanted, found: Predicted
) -> PlannedMeasurements:
    """The values that are wanted, as they will be known.

    Parameters
    ----------
    request, wanted
        What is good enough, and of what.
    found
        What will be reached.
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
    """The map: how well lengths will be known over the area.

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
    """Share of the mean sigma that lines take away; nearly 1 where nothing holds without them."""
    aim = plain_mean(possible)
    whole = criterion_of(aim, possible.candidates, lines)
    return 1.0 - whole / criterion_of(aim, possible.candidates, ())


def gains(
    scene: PlanScene, request: PlanRequest, wanted: Wanted, choice: Choice, lines: Sequence[int]
) -> Iterator[Gain]:
    """What one more line or photo, one line less, or a sturdier layout would bring.

    Parameters
    ----------
    scene, request, wanted
        What the plan is for.
    choice
        Flight and candidates.
    lines
        The layout: candidates by index.
    """
    options = choice.possible
    aim, candidates = plain_mean(options), options.candidates
    information = options.aim.information + candidates.information(lines)
    among = np.flatnonzero(candidates.apart_from(lines))
    if len(among):
        found = with_one_more(options.aim, candidates, covariance_of(information), among)
        best = int(among[np.argmin(found)])
        yield Gain(what="one more line", mean_sigma=criterion_of(aim, candidates, [*lines, best]))
    if len(lines) > 1:
        fewer = best_layout(options.aim, candidates, len(lines) - 1)
        yield Gain(what="one line less", mean_sigma=criterion_of(aim, candidates, fewer.lines))
    other = choice.layout if request.robust else choice.sturdy
    if set(other.lines) != set(lines):
        aimed = "for the best result if none is lost" if request.robust else "to bear a loss best"
        whole = criterion_of(aim, candidates, other.lines)
        worst = float(without_each(aim, candidates, other.lines).max())
        yield Gain(
            what=f"{len(other.lines)} lines laid {aimed}",
            mean_sigma=whole,
            worst_without=worst if worst < NOTHING_HOLDS * whole else None,
        )
    more = one_photo_more(scene, request, choice.flight)
    if more is not None:
        try:
            after = predicted(scene, more.cameras, wanted, ends_of(options, lines))
        except (GeometryError, SingularError):
            return
        yield Gain(what="one more photo", mean_sigma=mean_sigma(after))


def one_photo_more(scene: PlanScene, request: PlanRequest, flown: Flight) -> Flight | None:
    """The same flight with one photo more; None of a grid, whose photos the overlap counts.

    Parameters
    ----------
    scene, request
        What the plan is for.
    flown
        The flight.
    """
    if flown.pattern == "grid":
        return None
    pattern = "strip" if flown.pattern == "single" else flown.pattern
    kind = (pattern, flown.height_m, flown.pitch_deg)
    return flight(scene, request, kind, flown.photos + 1)
