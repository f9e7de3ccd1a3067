"""What reference lines are possible with a flight, and what each would tell of what is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.kinds import Measurand
from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.planning.elimination import (
    Functions,
    eliminated,
    of_all_points,
    of_points,
)
from uavgram.estimation.planning.layouts import Aim, Candidates, covariance_of, greedy
from uavgram.model.arrays import Bools, Floats
from uavgram.pipeline.plan.survey import Lines, Marks, hardly_known, planned_survey
from uavgram.stages.plan.cameras import Cameras, seen
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.spots import MOST_SPOTS, joined, spots
from uavgram.stages.plan.wanted import Wanted, equal_weights

LINES_AT_FIRST = 3
"""With which the sigmas of what is measured in other units than metres are compared."""


@dataclass(frozen=True, eq=False)
class Possible:
    """Lines that could be laid out for a flight.

    Attributes
    ----------
    aim
        What is wanted.
    candidates
        Each line.
    spot_m
        (K, 2) where ends may lie: `Candidates.ends` counts them.
    kind, unit, enough
        (M,) of what is wanted, and the sigma that is good enough; NaN where nobody said.
    """

    aim: Aim
    candidates: Candidates
    spot_m: Floats
    kind: tuple[str, ...]
    unit: tuple[str, ...]
    enough: Floats


def possible(
    scene: PlanScene,
    cameras: Cameras,
    wanted: Wanted,
    lengths_m: tuple[float, float],
    good_enough: Floats | None = None,
    most_spots: int = MOST_SPOTS,
) -> Possible:
    """Reckon what each line between any two places would tell.

    Parameters
    ----------
    scene, cameras
        Ground and photos.
    wanted
        What is measured.
    lengths_m
        Shortest and longest line.
    good_enough
        (requests,) sigmas that are good enough; NaN where nobody said.
    most_spots
        Places for ends of lines.

    Raises
    ------
    GeometryError
        A point that is wanted is in no photo for certain, or no line is.
    """
    spot = spots(scene.area_m, scene.no_go_m, lengths_m[1], most_spots)
    world = scene.on_ground(np.concatenate([wanted.point_m, spot]))
    found = seen(scene.calibration, cameras, world, scene.deviation)
    require_seen(wanted, found.certain)
    count = len(wanted.label)
    shown = found.certain[:, count:].astype(np.float64)
    pairs = joined(world[count:], scene.no_go_m, shown.T @ shown > 0, lengths_m)
    if not len(pairs):
        raise GeometryError(
            f"no line of {lengths_m[0]:g} to {lengths_m[1]:g} m fits into the area, clear of what "
            "is out of bounds, and lies in a photo for certain: fly higher, take more photos, or "
            "allow shorter lines (shortest_line_m)"
        )
    marks = Marks((*wanted.label, *(f"spot{i}" for i in range(len(spot)))), world, found)
    names = tuple(f"line{i}" for i in range(len(pairs)))
    planned = planned_survey(scene, cameras, marks, Lines(names, pairs + count))
    problem, layout = planned.problem, planned.problem.layout
    blocks = planned.blocks()
    tapes = blocks.pop("lengths")
    weak = hardly_known(problem)
    points = eliminated(problem, blocks | {"hardly known": weak})
    values = propagate(planned.adjusted(blocks, weakly=True), wanted.requests, planned.frames)
    if values.why_not:
        raise GeometryError(": ".join(values.why_not[0]))
    asked = of_all_points(points, layout, values.gradient)
    others = np.array([sum(part**2 for part in row.others.values()) for row in values.rows])
    asked = Functions(asked.gradient, asked.variance + others)
    readings = of_points(points, layout, tapes.columns, tapes.jacobian[:, 0])
    readings = Functions(  # the rows are whitened: a reading's own variance is one
        readings.gradient, readings.variance + 1.0
    )
    row_of = np.full(len(world), -1)
    row_of[planned.mark] = np.arange(len(planned.mark))
    used = np.flatnonzero(row_of[count:] >= 0)
    renumbered = np.full(len(spot), -1)
    renumbered[used] = np.arange(len(used))
    wanted_rows = row_of[:count]
    candidates = Candidates(readings, renumbered[pairs], points.root[row_of[count:][used]])
    information = points.base + points.information(wanted_rows)
    aim = Aim(information, asked, np.full(len(values.rows), 1.0 / len(values.rows)))
    enough = _by_value(values.rows, wanted, good_enough)
    kind = tuple(row.request.kind for row in values.rows)
    aim = replace(aim, weight=_weights(aim, candidates, (kind, values.unit), enough))
    return Possible(aim, candidates, spot[used], kind, values.unit, enough)


def require_seen(wanted: Wanted, certain: Bools) -> None:
    """Make sure that each point is in a photo.

    Raises
    ------
    GeometryError
        Names those that are not.
    """
    shown = np.flatnonzero(np.count_nonzero(certain, axis=0))
    hidden = [one for k, one in enumerate(wanted.label) if k not in shown]
    if hidden:
        raise GeometryError(
            f"in no photo for certain: {', '.join(hidden[:6])}. Fly higher or take more photos, or "
            "make the area smaller"
        )


def _by_value(rows: Sequence[Measurand], wanted: Wanted, good_enough: Floats | None) -> Floats:
    """(M,) sigma that is good enough for each value; a request may give several."""
    enough = np.full(len(wanted.requests), np.nan) if good_enough is None else good_enough
    place = {request.name: k for k, request in enumerate(wanted.requests)}
    return np.array([enough[place[row.request.name]] for row in rows])


def _weights(
    aim: Aim,
    candidates: Candidates,
    kind_unit: tuple[tuple[str, ...], tuple[str, ...]],
    enough: Floats,
) -> Floats:
    """(M,) of the sigmas in the criterion: a mean in metres, others in proportion.

    What states a sigma that is good enough counts by its share of that. Square metres and degrees
    count as if their sigmas with a few lines were those of the lengths.
    """
    equal = equal_weights(*kind_unit)
    lengths = equal > 0
    if lengths.all() and np.isnan(enough).all():
        return aim.weight
    steps = greedy(aim, candidates, LINES_AT_FIRST)
    lines = steps[-1].lines if steps else ()
    sigma = aim.sigma(covariance_of(aim.information + candidates.information(lines)))
    usual = float(sigma @ equal)
    stated = ~np.isnan(enough)
    size = np.where(stated, enough, np.where(lengths, usual, sigma))
    typical = float(np.median(enough[stated & lengths])) if (stated & lengths).any() else usual
    return np.asarray(typical / size / len(size))
