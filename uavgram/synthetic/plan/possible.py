"""Possible reference lines or plates of a flight, and their information on the wanted values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.kinds import Measurand
from uavgram.estimation.measuring.propagation import propagate
from uavgram.geometry.ground.figures import contains
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.naming import MIN_SIDE_PX
from uavgram.stages.plate_sides import SIDES
from uavgram.synthetic.plan.cameras import PlannedCameras, find_visible, remove_small_plates
from uavgram.synthetic.plan.elimination import (
    Functions,
    combine_functions,
    eliminate_points,
    whiten_readings,
)
from uavgram.synthetic.plan.layouts import Candidates, Objective, add_greedily, invert
from uavgram.synthetic.plan.scene import PlanScene
from uavgram.synthetic.plan.survey import (
    GroundMarks,
    Lines,
    make_weak_priors,
    simulate_planned_survey,
)
from uavgram.synthetic.plan.wanted import (
    MAX_SPOTS,
    WantedValues,
    compute_equal_weights,
    join_spots,
    make_spots,
)

PLATE_GRID_M = 8.0
"""Size that sets the grid of possible plates: it need not be finer than a third of that."""

FIRST_LINE_COUNT = 3
"""Number of lines at which sigmas of other units than metres are compared."""


@dataclass(frozen=True, eq=False)
class PossibleReferences:
    """Lines, or plates, that could be laid out for a flight.

    Attributes
    ----------
    aim
        Wanted values.
    candidates
        Each line.
    spot_m
        (K, 2) possible ends, or corners, the nodes of `Candidates.ends`.
    kind, unit, enough
        (M,) of the wanted values, and the required sigma; NaN where none was given.
    """

    aim: Objective
    candidates: Candidates
    spot_m: Floats
    kind: tuple[str, ...]
    unit: tuple[str, ...]
    enough: Floats


def compute_possible(
    scene: PlanScene,
    cameras: PlannedCameras,
    wanted: WantedValues,
    lengths_m: tuple[float, float] | None,
    good_enough: Floats | None = None,
    most_spots: int = MAX_SPOTS,
) -> PossibleReferences:
    """Compute the information of each line between any two ends, or of a plate anywhere.

    Parameters
    ----------
    scene, cameras
        Ground and photos.
    wanted
        Wanted measurements.
    lengths_m
        Shortest and longest line; None: plates.
    good_enough
        (requests,) required sigmas; NaN where none was given.
    most_spots
        Number of possible line ends.

    Raises
    ------
    GeometryError
        A wanted point is not visible for certain in any photo, or no line is.
    """
    # marks: the wanted points, then all possible ends
    spot = _places(scene, lengths_m, most_spots)
    world = np.concatenate([scene.on_ground(wanted.point_m), spot])
    found = find_visible(scene.calibration, cameras, world, scene.deviation)
    require_seen(wanted, found.certain)
    count = len(wanted.label)
    found = found if lengths_m is not None else remove_small_plates(found, count)
    groups, known = _groups(scene, spot, found.certain[:, count:], lengths_m)
    corners = len(spot) if lengths_m is None else 0
    label = (*wanted.label, *(f"spot{i}" for i in range(len(spot))))
    pairs = groups[:, known].reshape(-1, 2)
    lines = Lines(tuple(f"line{i}" for i in range(len(pairs))), pairs + count, bool(corners))
    planned = simulate_planned_survey(
        scene, cameras, GroundMarks(label, world, found, corners), lines
    )
    problem, layout = planned.problem, planned.problem.layout
    # eliminate the points; gradients of the wanted values by the core
    blocks = planned.blocks()
    tapes = blocks.pop("lengths")
    weak = make_weak_priors(problem)
    points = eliminate_points(problem, blocks | {"hardly known": weak})
    values = propagate(planned.adjusted(blocks, weakly=True), wanted.requests, planned.frames)
    if values.why_not:
        raise GeometryError(": ".join(values.why_not[0]))
    asked = combine_functions(points, layout, values.gradient.toarray())
    others = np.array([sum(part**2 for part in row.others.values()) for row in values.rows])
    asked = Functions(asked.gradient, asked.variance + others)
    # rows of the possible ends that are visible in a photo
    row_of = np.full(len(world), -1)
    row_of[planned.mark] = np.arange(len(planned.mark))
    used = np.flatnonzero(row_of[count:] >= 0)
    renumbered = np.full(len(spot), -1)
    renumbered[used] = np.arange(len(used))
    wanted_rows = row_of[:count]
    by_group = (len(groups), len(known), -1)
    whitened = whiten_readings(
        points,
        layout,
        tapes.columns.reshape(by_group),
        tapes.jacobian.reshape(by_group),
        row_of[count:][groups],
    )
    candidates = Candidates(whitened, renumbered[groups], points.root[row_of[count:][used]])
    information = points.base + points.information(wanted_rows)
    aim = Objective(information, asked, np.full(len(values.rows), 1.0 / len(values.rows)))
    enough = _list_required(values.rows, wanted, good_enough)
    kind = tuple(row.request.kind for row in values.rows)
    aim = replace(aim, weight=_weights(aim, candidates, (kind, values.unit), enough))
    return PossibleReferences(aim, candidates, spot[used, :2], kind, values.unit, enough)


def _places(scene: PlanScene, lengths_m: tuple[float, float] | None, most: int) -> Floats:
    """Return (K, 3) possible line ends, or the corners of all possible plates, plate by plate."""
    if lengths_m is not None:
        return scene.on_ground(make_spots(scene.area_m, scene.no_go_m, lengths_m[1], most))
    middle = make_spots(scene.area_m, scene.no_go_m, PLATE_GRID_M, most)
    corner = scene.plates_at(middle)
    free = np.ones(len(middle), dtype=np.bool_)
    for polygon in scene.no_go_m:
        free &= ~contains(polygon, corner[..., :2].reshape(-1, 2)).reshape(-1, 4).any(axis=1)
    return corner[free].reshape(-1, 3)


def _groups(
    scene: PlanScene, spot_m: Floats, certain: Bools, lengths_m: tuple[float, float] | None
) -> tuple[Ints, Ints]:
    """Return (N, m) spots of each candidate, and (q, 2) pairs of them with known lengths."""
    # pairs of ends that a photo shows together; plates that are completely in a photo
    shown = certain.astype(np.float64)
    if lengths_m is None:
        four = np.arange(len(spot_m)).reshape(-1, 4)
        groups = four[certain[:, four].all(axis=2).any(axis=0)]
        what, known = "plate", np.array(SIDES)
    else:
        groups = join_spots(spot_m, scene.no_go_m, shown.T @ shown > 0, lengths_m)
        what, known = f"line of {lengths_m[0]:g} to {lengths_m[1]:g} m", np.array([[0, 1]])
    if not len(groups):
        way_out = (
            "fly higher, take more photos, or allow shorter lines (shortest_line_m)"
            if lengths_m
            else f"fly lower or lay larger ones, of {MIN_SIDE_PX:.0f} pixels or more in the "
            "photos, or take more photos"
        )
        raise GeometryError(
            f"no {what} fits into the area, clear of the parts out of bounds (no_go), and is in a "
            f"photo for certain: {way_out}"
        )
    return groups, known


def require_seen(wanted: WantedValues, certain: Bools) -> None:
    """Check that each point is in a photo.

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


def _list_required(
    rows: Sequence[Measurand], wanted: WantedValues, good_enough: Floats | None
) -> Floats:
    """Return the (M,) required sigma of each value; a request may give several values."""
    enough = np.full(len(wanted.requests), np.nan) if good_enough is None else good_enough
    place = {request.name: k for k, request in enumerate(wanted.requests)}
    return np.array([enough[place[row.request.name]] for row in rows])


def _weights(
    aim: Objective,
    candidates: Candidates,
    kind_unit: tuple[tuple[str, ...], tuple[str, ...]],
    enough: Floats,
) -> Floats:
    """Compute (M,) weights of the sigmas in the criterion: a mean in metres, others in proportion.

    Values with a required sigma are relative to it. Square metres and degrees count as if their
    sigmas with a few lines were those of the lengths.
    """
    equal = compute_equal_weights(*kind_unit)
    lengths = equal > 0
    if lengths.all() and np.isnan(enough).all():
        return aim.weight
    steps = add_greedily(aim, candidates, FIRST_LINE_COUNT)
    lines = steps[-1].lines if steps else ()
    sigma = aim.sigma(invert(aim.information + candidates.information(lines)))
    usual = float(sigma @ equal)
    stated = ~np.isnan(enough)
    size = np.where(stated, enough, np.where(lengths, usual, sigma))
    typical = float(np.median(enough[stated & lengths])) if (stated & lengths).any() else usual
    return np.asarray(typical / size / len(size))
