"""Expected survey of a flight and its possible references: noise-free, in the real likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.propagation import Measurand, propagate
from uavgram.estimation.reliability.redundancy import (
    compute_minimal_detectable_bias,
    compute_reliability,
)
from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block, NormalEquations
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observed import Observations
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.figures import mark_points_inside
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import Frames, PhotoExposures, Telemetry
from uavgram.model.naming import MIN_SIDE_PX, PLATE_CORNERS, corner_label
from uavgram.model.observations import KnownLines, Picks
from uavgram.model.options import SolveOptions
from uavgram.stages.assemble import assemble
from uavgram.stages.plates import OWN_SIGMA_SHARE, PLATE_TAPE, SIDES, SQUARE, make_scale_prior
from uavgram.stages.seed.poses import seed
from uavgram.synthetic.plan import layouts
from uavgram.synthetic.plan.flights import (
    PlannedCameras,
    VisiblePoints,
    find_visible,
    remove_small_plates,
)
from uavgram.synthetic.plan.scene import (
    MAX_SPOTS,
    LoggedAccuracy,
    PlanScene,
    WantedValues,
    compute_equal_weights,
    join_spots,
    make_spots,
)

CORNER_SIGMA_PX = 0.1
WEAK_POSE_SIGMAS = (300.0, 3.0)
"""Sigmas of a nearly unknown pose [m, rad], since layouts start without any line."""


@dataclass(frozen=True, eq=False)
class GroundMarks:
    """K marks on the ground and their pixels in photos.

    Attributes
    ----------
    label, world_m
        (K,), (K, 3) of each.
    seen
        In F photos.
    corners
        Number of marks at the end that are corners of plates.
    """

    label: tuple[str, ...]
    world_m: Floats
    seen: VisiblePoints
    corners: int = 0


@dataclass(frozen=True, eq=False)
class Lines:
    """L known lengths between marks, taped ones or those of plates: (L,) names, (L, 2) rows."""

    name: tuple[str, ...]
    ends: Ints
    of_plates: bool = False


@dataclass(frozen=True, eq=False)
class PlannedSurvey:
    """A survey at its truth.

    Attributes
    ----------
    problem
        The likelihood.
    state
        The truth.
    frames
        The photos' times.
    mark
        (K,) index of each label's mark.
    """

    problem: SurveyProblem
    state: State
    frames: Frames
    mark: Ints

    def blocks(self) -> dict[str, Block]:
        """Return all observations at the truth: residuals are zero."""
        blocks = self.problem.evaluate(self.state)
        if blocks is None:
            raise ValueError("a planned survey is seen from above the ground")
        return blocks

    def adjust(self, blocks: dict[str, Block], *, weakly: bool = False) -> Adjustment:
        """Return the adjustment of some of the observations.

        Parameters
        ----------
        blocks
            Observations to use.
        weakly
            Add a prior of `WEAK_POSE_SIGMAS` to the poses: without a line they may be undetermined.
        """
        layout = self.problem.layout
        rows = [*blocks.values(), *([make_weak_priors(self.problem)] if weakly else [])]
        factor = NormalEquations(rows, layout.size, layout.structure).factor()
        minimum = Minimum(self.state, blocks, factor, 0.0, 0, converged=True)
        return Adjustment(self.problem, minimum, factor.covariance())


def make_weak_priors(problem: SurveyProblem) -> Block:
    """Return prior rows for poses with sigmas `WEAK_POSE_SIGMAS`, or smaller with sharper picks.

    With very sharp picks such a weak prior would be lost in the rounding of the sums.
    """
    count = problem.layout.frames
    sharp = min(float(problem.survey.pick_sigma_px.min()) / CORNER_SIGMA_PX, 1.0)
    weight = np.diag(1.0 / np.repeat(WEAK_POSE_SIGMAS, 3)) / sharp
    columns = problem.layout.frame_columns(np.arange(count))
    return Block(np.zeros((count, 6)), columns, np.broadcast_to(weight, (count, 6, 6)))


def simulate_planned_survey(
    scene: PlanScene, cameras: PlannedCameras, marks: GroundMarks, lines: Lines
) -> PlannedSurvey:
    """Return the future picks and tape readings, without noise, as one survey.

    Parameters
    ----------
    scene
        The ground, and the sigmas of all errors.
    cameras
        The photos.
    marks
        Marks that are picked in each photo that shows them for certain; others are left out.
    lines
        Known lengths between marks.
    """
    plates = scene.plates
    name = tuple(f"P{i + 1}" for i in range(len(cameras.center_m)))
    # picks: every certain sighting; lengths: between the marks, without errors
    mark, frame = np.nonzero(marks.seen.certain.T)
    length = np.linalg.norm(np.diff(marks.world_m[lines.ends], axis=1)[:, 0], axis=1)
    frames = _frames(name, cameras)
    exposures = None if scene.logged is None else _exposures(name, cameras, scene.logged)
    survey = assemble(
        Observations(
            calibration=scene.calibration,
            picks=Picks(
                image=tuple(name[i] for i in frame),
                label=tuple(marks.label[k] for k in mark),
                pixel_px=marks.seen.pixel_px[frame, mark],
                sigma_px=np.where(
                    mark < len(marks.label) - marks.corners, scene.picks_sigma_px, plates.corner_px
                ),
                height_m=np.full(len(mark), np.nan),
            ),
            lines=KnownLines(
                name=lines.name,
                start=tuple(marks.label[k] for k in lines.ends[:, 0]),
                end=tuple(marks.label[k] for k in lines.ends[:, 1]),
                length_m=length,
                sigma_m=np.full(
                    len(length),
                    OWN_SIGMA_SHARE * plates.sigma_m if lines.of_plates else scene.tape_sigma_m,
                ),
                adjust=np.ones(len(length), dtype=np.bool_),
                tape=(PLATE_TAPE,) * len(length) if lines.of_plates else (),
            ),
            telemetry=None if exposures is None else _telemetry(frames, exposures, scene),
            ground=replace(scene.ground, height_m=scene.height_m),
            picks_sigma_px=scene.picks_sigma_px,
            tape=scene.tape,
            own_scale_sigma=make_scale_prior(SQUARE * plates.side_m, plates.sigma_m)
            if lines.of_plates
            else (),
            photos=name,
        )
    ).survey
    # rows of marks and photos that are in the survey, in its order
    row = {one: k for k, one in enumerate(marks.label)}
    mark = np.array([row[one] for one in survey.label])
    flown = {one: k for k, one in enumerate(name)}
    used = np.array([flown[one] for one in survey.frame_id])
    problem = SurveyProblem(survey, scene.pivot_m, np.ones(len(survey.line_start), dtype=np.bool_))
    truth = _truth(scene, cameras, problem, marks.world_m[mark], used)
    return PlannedSurvey(problem, truth, frames, mark)


def _frames(name: tuple[str, ...], cameras: PlannedCameras) -> Frames:
    count = len(name)
    return Frames(
        frame_id=name,
        time_utc_s=cameras.time_s,
        sigma_time_s=np.zeros(count),
        matched=np.ones(count, dtype=np.bool_),
        reason=("",) * count,
        clock_offset_s=0.0,
        clock_offset_sigma_s=0.05,
    )


def _exposures(
    name: tuple[str, ...], cameras: PlannedCameras, logged: LoggedAccuracy
) -> PhotoExposures:
    body = cameras.world_from_body
    count = len(name)
    return PhotoExposures(
        frame_id=name,
        position_world_m=cameras.center_m - body @ np.array(logged.mount.lever_arm_m),
        world_from_body=body,
        world_from_gimbal=cameras.world_from_gimbal,
        sigma_position_m=np.tile(logged.position_sigma_m, (count, 1)),
        sigma_attitude_rad=np.deg2rad(np.tile(logged.attitude_sigma_deg, (count, 1))),
        by_mount=np.zeros(count, dtype=np.bool_),
        source="the plan",
    )


def _telemetry(frames: Frames, exposures: PhotoExposures, scene: PlanScene) -> Telemetry:
    logged = scene.logged
    assert logged is not None  # noqa: S101  (there are exposures)
    return seed(frames, exposures, logged.mount, logged.telemetry)


def _truth(
    scene: PlanScene, cameras: PlannedCameras, problem: SurveyProblem, world_m: Floats, used: Ints
) -> State:
    """Return the true unknowns, in the gauge of the survey."""
    layout = problem.layout
    center, rotation = cameras.center_m[used], cameras.world_from_camera[used]
    plane = np.array([scene.height_m, *scene.slope])
    if problem.survey.gauge == "plane":
        world_m, center, rotation = transform_to_plane_gauge(scene, world_m, center, rotation)
        plane = np.zeros(3)
    point = np.zeros((layout.points, layout.point_size))
    point[:, :2] = world_m[:, :2]
    return State(
        point=point,
        center=center,
        rotation=rotation,
        intrinsic=np.zeros(layout.intrinsics),
        plane=plane,
        relief=np.zeros(layout.relief),
        telemetry=problem.telemetry_mean if layout.telemetry else np.zeros(0),
        tape=np.zeros(layout.tape),
        readout=np.zeros(layout.readout),
        tie=np.zeros((0, layout.point_size)),
    )


def transform_to_plane_gauge(
    scene: PlanScene, world_m: Floats, center_m: Floats, rotation: Floats
) -> tuple[Floats, Floats, Floats]:
    """Transform points (K, 3) and poses (F, 3), (F, 3, 3) to the gauge of a survey without a log.

    The ground is z = 0, the first camera is above x = y = 0, and up in its image is north.

    Parameters
    ----------
    scene
        The ground.
    world_m
        (K, 3) points.
    center_m, rotation
        (F, 3), (F, 3, 3) poses.
    """
    up = np.array([*-scene.slope, 1.0])
    up /= np.linalg.norm(up)
    # up in the image is -y of the camera; its component along the ground is north
    image_up = -rotation[0, :, 1]
    north = image_up - (image_up @ up) * up
    north /= np.linalg.norm(north)
    axes = np.stack([np.cross(north, up), north, up])
    above = center_m[0] - scene.on_ground(center_m[0, :2])
    foot = center_m[0] - (above @ up) * up
    return (world_m - foot) @ axes.T, (center_m - foot) @ axes.T, axes @ rotation


@dataclass(frozen=True, eq=False)
class PredictedValues:
    """M values with their predicted sigmas.

    Attributes
    ----------
    name, kind, unit, value, sigma
        (M,) of each.
    request
        (M,) index of the request of each.
    redundancy, mdb_m
        (L,) of the lines, of plates of each of their lengths: see `PlannedLines`.
    """

    name: tuple[str, ...]
    kind: tuple[str, ...]
    unit: tuple[str, ...]
    value: Floats
    sigma: Floats
    request: tuple[int, ...]
    redundancy: Floats
    mdb_m: Floats


def make_survey(
    scene: PlanScene, cameras: PlannedCameras, wanted: WantedValues, ends_m: Floats
) -> PlannedSurvey:
    """Return the survey of wanted points, and of lines or plates on the ground.

    Parameters
    ----------
    scene, cameras, wanted
        Ground, photos, and wanted measurements.
    ends_m
        (L, 2, 2) ends of the lines, or (L, 4, 2) corners of the plates.
    """
    count, (laid, marks_each) = len(wanted.label), ends_m.shape[:2]
    of_plates = marks_each == PLATE_CORNERS
    world = scene.on_ground(np.concatenate([wanted.point_m, ends_m.reshape(-1, 2)]))
    own = [
        corner_label(i, c) if of_plates else f"L{i + 1}{'ab'[c]}"
        for i, c in np.ndindex(laid, marks_each)
    ]
    found = find_visible(scene.calibration, cameras, world, scene.deviation)
    found = remove_small_plates(found, count) if of_plates else found
    marks = GroundMarks((*wanted.label, *own), world, found, len(own) if of_plates else 0)
    groups = count + np.arange(len(own)).reshape(laid, marks_each)
    pairs = groups[:, np.array(SIDES if of_plates else ((0, 1),))].reshape(-1, 2)
    names = tuple(f"L{i + 1}" for i in range(len(pairs)))
    return simulate_planned_survey(scene, cameras, marks, Lines(names, pairs, of_plates))


def predict_values(
    scene: PlanScene, cameras: PlannedCameras, wanted: WantedValues, ends_m: Floats
) -> PredictedValues:
    """Predict the sigmas of the wanted values, and the reliability of the lines.

    Parameters
    ----------
    scene, cameras
        Ground and photos.
    wanted
        Wanted measurements.
    ends_m
        (L, 2, 2) ends of the reference lines, or (L, 4, 2) corners of the plates.

    Raises
    ------
    SingularError
        The poses are undetermined with these lines.
    """
    planned = make_survey(scene, cameras, wanted, ends_m)
    blocks = planned.blocks()
    adjustment = planned.adjust(blocks)
    values = propagate(adjustment, wanted.requests, planned.frames)
    redundancy = np.zeros(0)
    if len(ends_m):
        redundancy = compute_reliability(blocks["lengths"], adjustment.covariance).redundancy[:, 0]
    sigma = planned.problem.survey.length_sigma_m
    place = {request.name: k for k, request in enumerate(wanted.requests)}
    return PredictedValues(
        name=values.name,
        kind=tuple(row.request.kind for row in values.rows),
        unit=values.unit,
        value=values.value,
        sigma=values.sigma,
        request=tuple(place[row.request.name] for row in values.rows),
        redundancy=redundancy,
        mdb_m=compute_minimal_detectable_bias(redundancy, sigma, SolveOptions().significance),
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

    aim: layouts.Objective
    candidates: layouts.Candidates
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
    points = layouts.eliminate_points(problem, blocks | {"hardly known": weak})
    values = propagate(planned.adjust(blocks, weakly=True), wanted.requests, planned.frames)
    if values.why_not:
        raise GeometryError(": ".join(values.why_not[0]))
    asked = layouts.combine_functions(points, layout, values.gradient.toarray())
    others = np.array([sum(part**2 for part in row.others.values()) for row in values.rows])
    asked = layouts.Functions(asked.gradient, asked.variance + others)
    # rows of the possible ends that are visible in a photo
    row_of = np.full(len(world), -1)
    row_of[planned.mark] = np.arange(len(planned.mark))
    used = np.flatnonzero(row_of[count:] >= 0)
    renumbered = np.full(len(spot), -1)
    renumbered[used] = np.arange(len(used))
    wanted_rows = row_of[:count]
    by_group = (len(groups), len(known), -1)
    whitened = layouts.whiten_readings(
        points,
        layout,
        tapes.columns.reshape(by_group),
        tapes.jacobian.reshape(by_group),
        row_of[count:][groups],
    )
    candidates = layouts.Candidates(whitened, renumbered[groups], points.root[row_of[count:][used]])
    information = points.base + points.information(wanted_rows)
    aim = layouts.Objective(information, asked, np.full(len(values.rows), 1.0 / len(values.rows)))
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
        free &= ~mark_points_inside(polygon, corner[..., :2].reshape(-1, 2)).reshape(-1, 4).any(
            axis=1
        )
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
    aim: layouts.Objective,
    candidates: layouts.Candidates,
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
    steps = layouts.add_greedily(aim, candidates, FIRST_LINE_COUNT)
    lines = steps[-1].lines if steps else ()
    sigma = aim.sigma(layouts.invert(aim.information + candidates.information(lines)))
    usual = float(sigma @ equal)
    stated = ~np.isnan(enough)
    size = np.where(stated, enough, np.where(lengths, usual, sigma))
    typical = float(np.median(enough[stated & lengths])) if (stated & lengths).any() else usual
    return np.asarray(typical / size / len(size))
