"""Unknowns of a survey: their order in the vector, their values, and their updates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.estimation.survey.ground_planes import PLANE_SIZE, count_fixed_planes, count_relief
from uavgram.geometry.motion.camera_motion import SHARED_SIZE
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey


@dataclass(frozen=True)
class Layout:
    """Order of the unknowns: points, picked points, ties, frames, then the shared unknowns.

    The shared ones are intrinsics, planes, relief, telemetry, tapes, readout.

    Attributes
    ----------
    points
        K, each with `point_size` unknowns: east, north and, if a point of the survey may depart
        from the ground and its stated height, that departure.
    picked
        Q, each with `point_size` unknowns: the picked points of labels whose meant point may be
        another (`Survey.identified`).
    ties
        T, each with `point_size` unknowns as well: chains of matches first (as of their labels),
        then tie points (east, north, up).
    frames
        F, each with six: δcentre in world [m], δθ in camera [rad]; and with `turning`, three more:
        its turn during the readout beyond that of the log [rad], in camera axes.
    intrinsics
        Number of unknown combinations of the interior orientation, in sigmas.
    plane
        3 (height, slope east, slope north) for each area whose plane is not the gauge.
    relief
        Coefficients of all areas' relief.
    telemetry
        12 (see geometry/motion/camera_motion.py), or 0 without a log.
    tape
        Number of tapes with an unknown scale (see estimation/survey/observations/lengths.py).
    readout
        1 where the readout time of a rolling shutter is an unknown, else 0.
    free_gauge
        Whether position and heading are fixed only by a choice.
    """

    points: int
    point_size: int
    frames: int
    intrinsics: int
    plane: int
    relief: int
    telemetry: int
    tape: int
    free_gauge: bool
    readout: int = 0
    picked: int = 0
    ties: int = 0
    turning: bool = False

    @property
    def frame_size(self) -> int:
        """Unknowns of a frame: its pose, and its turning if that is unknown."""
        return 9 if self.turning else 6

    @cached_property
    def first_tie(self) -> int:
        """Column of the first tie point's east."""
        return (self.points + self.picked) * self.point_size

    @cached_property
    def first_frame(self) -> int:
        """Column of the first frame's first unknown."""
        return self.first_tie + self.ties * self.point_size

    @cached_property
    def first_intrinsic(self) -> int:
        """Column of the first unknown of the interior orientation."""
        return self.first_frame + self.frame_size * self.frames

    @cached_property
    def first_plane(self) -> int:
        """Column of the plane's height."""
        return self.first_intrinsic + self.intrinsics

    @cached_property
    def first_relief(self) -> int:
        """Column of the first coefficient of relief."""
        return self.first_plane + self.plane

    @cached_property
    def first_telemetry(self) -> int:
        """Column of the first unknown shared by the telemetry."""
        return self.first_relief + self.relief

    @cached_property
    def first_readout(self) -> int:
        """Column of the readout time."""
        return self.first_tape + self.tape

    @cached_property
    def first_tape(self) -> int:
        """Column of the first tape's scale."""
        return self.first_telemetry + self.telemetry

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return self.first_readout + self.readout

    @cached_property
    def structure(self) -> Structure:
        """Structure for the elimination order."""
        return Structure(
            size=self.size,
            points=self.points + self.picked + self.ties,
            point_size=self.point_size,
            block_size=self.frame_size,
            first_shared=self.first_intrinsic,
        )

    def point_columns(self, index: Ints) -> Ints:
        """Return the (n, point_size) unknowns of n points."""
        return index[:, None] * self.point_size + np.arange(self.point_size)

    def picked_columns(self, index: Ints) -> Ints:
        """Return the (n, point_size) unknowns of n picked points."""
        return self.point_columns(self.points + index)

    def label_of(self, index: int, survey: Survey) -> int:
        """Return the label of the unknown at `index`, of a point or a picked point."""
        point = index // self.point_size
        return point if point < self.points else int(survey.identified[point - self.points])

    def tie_columns(self, index: Ints) -> Ints:
        """Return the (n, point_size) unknowns of n tie points."""
        return self.first_tie + self.point_columns(index)

    def frame_columns(self, index: Ints) -> Ints:
        """Return the (n, 6) unknowns of the poses of n frames."""
        return self.first_frame + index[:, None] * self.frame_size + np.arange(6)

    def turning_columns(self, index: Ints) -> Ints:
        """Return the (n, 3) unknowns of the turning of n frames; (n, 0) if it is no unknown."""
        own = np.arange(6, self.frame_size)
        return self.first_frame + index[:, None] * self.frame_size + own

    def shared_columns(self, first: int, count: int, rows: int) -> Ints:
        """Return (rows, count), the same shared unknowns in every row.

        Parameters
        ----------
        first, count
            Index of the first of these unknowns, and their number.
        rows
            Number of rows.
        """
        return np.broadcast_to(first + np.arange(count), (rows, count))

    def describe(self, index: int, survey: Survey) -> str:
        """Describe the unknown at `index` in words."""
        if self.first_tie <= index < self.first_frame:
            return "the position of a tie point"
        if index < self.first_tie:
            return f"the position of point {survey.label[self.label_of(index, survey)]!r}"
        if index < self.first_intrinsic:
            frame = (index - self.first_frame) // self.frame_size
            return f"the pose of frame {survey.frame_id[frame]!r}"
        if index < self.first_plane:
            return "the interior orientation"
        if index < self.first_relief:
            place = (index - self.first_plane) // PLANE_SIZE
            return f"the plane of area {survey.grounds[place + count_fixed_planes(survey)].name!r}"
        shared = (
            (self.first_telemetry, "the relief of the ground"),
            (self.first_tape, "the telemetry's biases"),
            (self.first_readout, "the scale of a tape"),
            (self.size, "the readout time"),
        )
        return next(words for end, words in shared if index < end)


@dataclass(frozen=True, eq=False)
class State:
    """Values of the unknowns.

    Attributes
    ----------
    point
        (K, point_size) east, north [and departure] in metres.
    center, rotation
        (F, 3), (F, 3, 3) world from camera.
    intrinsic
        (I,) departures from the calibration, in sigmas.
    plane
        (3A,) height at the pivot [m] and slopes of each area's plane, the gauge's included.
    relief
        (R,) coefficients of the areas' relief [m].
    telemetry
        (12,) or (0,).
    tape
        (T,) scales: +0.01 for a tape that is 1 % too long.
    readout
        (1,) or (0,) readout time [s].
    picked
        (Q, point_size) of the picked points, as `point`.
    tie
        (T, point_size) of chains of matches as `point`; of tie points east, north, up [m].
    turning
        (F, 3), or (F, 0) if it is no unknown: turns beyond those of the log [rad].
    """

    point: Floats
    center: Floats
    rotation: Floats
    intrinsic: Floats
    plane: Floats
    relief: Floats
    telemetry: Floats
    tape: Floats = field(default_factory=lambda: np.zeros(0))
    readout: Floats = field(default_factory=lambda: np.zeros(0))
    picked: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    tie: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    turning: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not len(self.turning):
            object.__setattr__(self, "turning", np.zeros((len(self.center), 0)))
        for name in ("picked", "tie"):  # empty arrays get the width of the points
            if not getattr(self, name).size:
                none = np.zeros((*self.point.shape[:-2], 0, self.point.shape[-1]))
                object.__setattr__(self, name, none)


def unstack(states: State) -> Iterator[State]:
    """Yield each of the states whose arrays have one leading axis, as by `apply_increment`."""
    arrays = [getattr(states, field.name) for field in fields(states)]
    return (State(*each) for each in zip(*arrays, strict=True))


def select_states(states: State, rows: Ints | int | slice) -> State:
    """Return the stacked states at `rows`, stacked as well; for a single row, that state."""
    return State(*(getattr(states, field.name)[rows] for field in fields(states)))


def stack(states: Sequence[State]) -> State:
    """Stack states into one, whose arrays have a leading axis."""
    return State(*(np.stack([getattr(s, f.name) for s in states]) for f in fields(State)))


def make_layout(survey: Survey, point_size: int, intrinsics: int, tapes: int) -> Layout:
    """Return the layout of the unknowns of a survey.

    Parameters
    ----------
    survey
        Observations.
    point_size
        Number of each point's unknowns.
    intrinsics
        Number of unknown combinations of the interior orientation.
    tapes
        Number of tapes with an unknown scale.
    """
    return Layout(
        points=len(survey.label),
        point_size=point_size,
        frames=len(survey.frame_id),
        intrinsics=intrinsics,
        plane=PLANE_SIZE * (len(survey.grounds) - count_fixed_planes(survey)),
        relief=count_relief(survey),
        telemetry=SHARED_SIZE if survey.telemetry is not None else 0,
        tape=tapes,
        free_gauge=survey.gauge == "plane",
        readout=int(survey.rolling is not None),
        picked=len(survey.identified),
        ties=survey.matches.points + survey.ties.points,
        turning=is_turning_unknown(survey),
    )


def is_turning_unknown(survey: Survey) -> bool:
    """Return whether the turns of the camera during the readout are unknowns.

    The log does not resolve them. Picks by people, accurate to a pixel, never show them; a few
    hundred sightings that are ten times as accurate do.
    """
    return survey.rolling is not None and bool(survey.matches.points + survey.ties.points)


def apply_increment(layout: Layout, state: State, step: Floats) -> State:
    """Add an increment (size,) of the unknowns to a state.

    Parameters
    ----------
    layout
        Order of the unknowns in the vector.
    state
        Initial state; or as many states as steps, with the same leading axes.
    step
        (size,) increment; for (..., size) as many states, their arrays with the same leading axes.
    """
    many = step.shape[:-1]
    frame_step = _view_frames(layout, step)
    # The gauge's plane, if fixed, comes first and does not move.
    plane = np.empty((*many, state.plane.shape[-1]))
    plane[:] = state.plane
    plane[..., plane.shape[-1] - layout.plane :] += step[
        ..., layout.first_plane : layout.first_relief
    ]
    return State(
        point=state.point + _view_points(layout, step),
        center=state.center + frame_step[..., :3],
        rotation=state.rotation @ exp_so3(frame_step[..., 3:6]),
        intrinsic=state.intrinsic + step[..., layout.first_intrinsic : layout.first_plane],
        plane=plane,
        relief=state.relief + step[..., layout.first_relief : layout.first_telemetry],
        telemetry=state.telemetry + step[..., layout.first_telemetry : layout.first_tape],
        tape=state.tape + step[..., layout.first_tape : layout.first_readout],
        readout=state.readout + step[..., layout.first_readout :],
        picked=state.picked + _view_picked(layout, state, step),
        tie=state.tie + _view_ties(layout, state, step),
        turning=state.turning + frame_step[..., 6:],
    )


def _view_points(layout: Layout, step: Floats) -> Floats:
    """Return the (..., K, point_size) part of a step, a view of it."""
    own = step[..., : layout.points * layout.point_size]
    return own.reshape(*step.shape[:-1], layout.points, layout.point_size)


def _view_picked(layout: Layout, state: State, step: Floats) -> Floats:
    """Return the (..., Q, point_size) part of a step, a view of it."""
    own = step[..., layout.points * layout.point_size : layout.first_tie]
    return own.reshape(*step.shape[:-1], *state.picked.shape[-2:])


def _view_ties(layout: Layout, state: State, step: Floats) -> Floats:
    """Return the (..., T, point_size) part of a step, a view of it."""
    own = step[..., layout.first_tie : layout.first_frame]
    return own.reshape(*step.shape[:-1], *state.tie.shape[-2:])


def _view_frames(layout: Layout, step: Floats) -> Floats:
    """Return the (..., F, frame_size) part of a step, a view of it."""
    own = step[..., layout.first_frame : layout.first_intrinsic]
    return own.reshape(*step.shape[:-1], layout.frames, layout.frame_size)


def advance_state(layout: Layout, state: State, step: Floats) -> State:
    """Update a state by an increment, to first order equal to `apply_increment`, in iterations.

    A common rotation of points and cameras about the vertical changes only the misfits of telemetry
    and control. `apply_increment` moves the points along the tangent of such a rotation, which
    takes them off their pixels by half the squared angle times the size of the scene. This function
    rotates them (a retraction along the group, Absil, Mahony and Sepulchre 2008, ch. 4). With a
    free gauge it also moves the state back to the conditions of the gauge (see ``SurveyProblem``),
    which an increment meets to first order only.

    Parameters
    ----------
    layout, state, step
        As for `apply_increment`.
    """
    middle = state.point[..., :2].mean(axis=-2)
    arm = state.point[..., :2] - middle[..., None, :]
    size = (arm * arm).sum(axis=(-2, -1))
    if not np.all(size):  # a single point has no heading
        return apply_increment(layout, state, step)
    across = arm[..., ::-1] * (-1.0, 1.0)
    # Common turn about the vertical: least-squares fit of the step to the points' arms.
    angle = (across * _view_points(layout, step)[..., :2]).sum(axis=(-2, -1)) / size
    by = angle[..., None]
    # Remove the common turn from the step, apply it as a rotation, and add the rest.
    rest = np.array(step)
    rest_frame = _view_frames(layout, rest)
    _view_points(layout, rest)[..., :2] -= by[..., None] * across
    for places, own in ((state.picked, _view_picked), (state.tie, _view_ties)):
        far = (places[..., :2] - middle[..., None, :])[..., ::-1] * (-1.0, 1.0)
        own(layout, state, rest)[..., :2] -= by[..., None] * far
    rest_frame[..., 0] += by * (state.center[..., 1] - middle[..., 1:])
    rest_frame[..., 1] -= by * (state.center[..., 0] - middle[..., :1])
    rest_frame[..., 3:6] -= by[..., None] * state.rotation[..., 2, :]
    turned = _rotate_about(state, middle, np.cos(angle), np.sin(angle))
    moved = apply_increment(layout, turned, rest)
    return _move_to_gauge(moved) if layout.free_gauge else moved


def _move_to_gauge(state: State) -> State:
    """Move a state on the plane z = 0 to its gauge: first frame above x = y = 0, image up north."""
    image_up = -state.rotation[..., 0, :2, 1]
    size = np.linalg.norm(image_up, axis=-1)
    is_level = size == 0  # up has no direction in the plan
    size = np.where(is_level, 1.0, size)
    sine = np.where(is_level, 0.0, image_up[..., 0] / size)
    cosine = np.where(is_level, 1.0, image_up[..., 1] / size)
    foot = np.where(is_level[..., None], 0.0, state.center[..., 0, :2])
    turned = _rotate_about(state, foot, cosine, sine)
    names = ("point", "picked", "tie", "center")
    places = {name: np.array(getattr(turned, name)) for name in names}
    for place in places.values():
        place[..., :2] -= foot[..., None, :]
    return replace(turned, **places)


def _rotate_about(state: State, about: Floats, cosine: Floats, sine: Floats) -> State:
    """Turn all points and cameras about the verticals through (..., 2) `about`."""
    turn = np.zeros((*np.shape(cosine), 3, 3))
    turn[..., 0, 0] = turn[..., 1, 1] = cosine
    turn[..., 1, 0], turn[..., 0, 1] = sine, -np.asarray(sine)
    turn[..., 2, 2] = 1.0
    flat, about = np.swapaxes(turn[..., :2, :2], -1, -2), about[..., None, :]

    def of(places: Floats) -> Floats:
        placed = np.empty((*np.shape(cosine), *places.shape[-2:]))
        if placed.size:
            placed[..., :2] = about + (places[..., :2] - about) @ flat
            placed[..., 2:] = places[..., 2:]
        return placed

    rotation = turn[..., None, :, :] @ state.rotation
    return replace(
        state,
        point=of(state.point),
        picked=of(state.picked),
        tie=of(state.tie),
        center=of(state.center),
        rotation=rotation,
    )
