"""Measured values of an adjusted survey, and their derivatives by its unknowns.

A kind of measurement is one function of the world coordinates of its points, and, if it is measured
from the ground, of the places on the ground straight below them; the gradients are turned into
sigmas here, and stages may sample the values.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from uavgram.errors import suggest_spelling
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.ground_planes import find_ground_below
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground import measurements
from uavgram.geometry.ground.measurements import UnmeasurableError
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.message import FREE_HEIGHT
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementRequest
from uavgram.model.survey import Survey

STANDARD_GRAVITY = 9.80665
"""Standard gravity [m/s^2] (CGPM 1901); the local value differs by less than 0.3 %, a speed by less
than 0.15 %."""

AXES = ("east", "north")

BELOW_PREFIX = "roughness of the ground below "
"""Prefix of the label in the name of such a source of error."""


class Measurand(NamedTuple):
    """One measured number and its derivatives by its points and by other sources with a sigma."""

    name: str
    request: MeasurementRequest
    value: float
    gradient: Floats | None
    """(k, 3) by the request's points; None if there is no value."""
    others: Mapping[str, float]
    """Other sources of error by name (``time of IMG_1.jpg``): signed derivative times sigma. Two
    values that share a source are correlated through it."""
    by_feet: Floats | None = None
    """(k, 3) by the places on the smooth ground straight below the points; None: no dependence."""


def no_error(source: str) -> float:  # noqa: ARG001  (the error of every source)
    """Return no error for any source."""
    return 0.0


def require_picked(
    request: MeasurementRequest, known: Collection[str], picked: Collection[str] = ()
) -> None:
    """Check that every point of a request is among the known labels.

    Parameters
    ----------
    request
        Requested measurement.
    known
        Labels that were adjusted.
    picked
        Labels with picks, which may have been left out.

    Raises
    ------
    UnmeasurableError
        Names the labels that are missing, with the nearest spelling.
    """
    words = []
    for label in request.points:
        if label not in known:
            near = "" if label in picked else suggest_spelling(label, known)
            words.append(f"point {label!r} has no usable pick" + (f" ({near})" if near else ""))
    if words:
        raise UnmeasurableError(", ".join(words))


def compute_measurands(
    request: MeasurementRequest,
    points: Floats,
    survey: Survey,
    frames: Frames,
    error: Callable[[str], float] = no_error,
    feet: Floats | None = None,
) -> list[Measurand]:
    """Compute the values of one request, with gradients.

    Parameters
    ----------
    request
        Requested measurement.
    points
        (k, 3) world coordinates of its points.
    survey, frames
        For ``speed``: the frames that see the points, and their times. For measurements from the
        ground: the points off it, and its roughness.
    error
        Function that returns the error of another source (friction, a time) by its name, in its
        sigmas; used to sample them.
    feet
        (k, 3) places on the smooth ground straight below the points; needed if `refers_to_ground`.

    Raises
    ------
    UnmeasurableError
        There is no value, or no derivative, for these points.
    """
    kind = request.kind
    if kind == "coordinate":
        return [
            Measurand(f"{request.name} {axis}", request, float(points[0, i]), np.eye(3)[[i]], {})
            for i, axis in enumerate(AXES)
        ]
    if kind == "skid_speed":
        return [_compute_skid_speed(request, points, error)]
    if kind == "speed":
        return [_compute_speed(request, points, survey, frames, error)]
    if refers_to_ground(request):
        if feet is None:
            raise ValueError(f"{kind} of {request.points} needs the feet of its points")
        return [_measure_over_ground(request, points, feet, survey, error)]
    value, gradient = measurements.measure_shape(kind, points, dict(request.parameters))
    return [Measurand(request.name, request, value, gradient, {})]


def refers_to_ground(request: MeasurementRequest) -> bool:
    """Return whether a request is measured from the ground straight below its points."""
    parameters = dict(request.parameters)
    return measurements.refers_to_ground(request.kind, len(request.points), parameters)


def _compute_skid_speed(
    request: MeasurementRequest, points: Floats, error: Callable[[str], float]
) -> Measurand:
    """Compute the speed at the start of a skid to rest: v = sqrt(2 mu g d) (friction = energy)."""
    parameters = dict(request.parameters)
    source, mu_sigma = f"friction of {request.name}", parameters["mu_sigma"]
    mu = parameters["mu"] + mu_sigma * error(source)
    if mu <= 0:
        raise UnmeasurableError("its friction is not positive")
    length, gradient = measurements.polyline(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise UnmeasurableError("its points coincide")
    speed = float(np.sqrt(2.0 * mu * STANDARD_GRAVITY * length))
    by_mu = speed / (2.0 * mu)
    friction = {source: by_mu * mu_sigma}
    return Measurand(request.name, request, speed, gradient * (speed / (2.0 * length)), friction)


def _compute_speed(
    request: MeasurementRequest,
    points: Floats,
    survey: Survey,
    frames: Frames,
    error: Callable[[str], float],
) -> Measurand:
    """Compute the mean speed between two exposures: distance over the difference of their times.

    The camera's clock offset cancels; each frame's own timing error remains.
    """
    times, sources = [], []
    for label in request.points:
        seen = survey.pick_frame[survey.pick_label == survey.label.index(label)]
        if len(seen) != 1:
            raise UnmeasurableError(f"{label!r} is picked in {len(seen)} frames, a speed needs one")
        row = frames.frame_id.index(survey.frame_id[seen[0]])
        sources.append((f"time of {frames.frame_id[row]}", float(frames.sigma_time_s[row])))
        times.append(frames.time_utc_s[row] + sources[-1][1] * error(sources[-1][0]))
    elapsed = times[1] - times[0]
    if not np.isfinite(elapsed) or elapsed == 0:
        raise UnmeasurableError("its two frames have no time, or the same")
    length, gradient = measurements.distance(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise UnmeasurableError("its points coincide")
    speed = float(length / abs(elapsed))
    by_time = (speed / elapsed, -speed / elapsed)  # by the first and by the second time
    timing = {
        source: derivative * sigma
        for (source, sigma), derivative in zip(sources, by_time, strict=True)
    }
    return Measurand(request.name, request, speed, gradient / abs(elapsed), timing)


def _measure_over_ground(
    request: MeasurementRequest,
    points: Floats,
    feet: Floats,
    survey: Survey,
    error: Callable[[str], float],
) -> Measurand:
    """Measure from the ground below, with the contribution of its roughness to the sigma."""
    label = np.array([survey.label.index(one) for one in request.points])
    below = find_ground_below(survey, label, points, feet)
    if request.kind == "height" and below.is_determined.all():
        raise UnmeasurableError(
            _explain_height(request.points[0], float(survey.height_above_m[label][0]))
        )
    sources = [f"{BELOW_PREFIX}{one}" for one in request.points]
    lifted = below.feet.copy()
    lifted[:, 2] += below.sigma_m * [error(one) for one in sources]
    value, by_points, by_feet = measurements.measure_over_ground(
        request.kind, points, lifted, dict(request.parameters)
    )
    effects = dict(zip(sources, (by_feet[:, 2] * below.sigma_m).tolist(), strict=True))
    is_determined = below.is_determined[:, None]
    return Measurand(
        request.name,
        request,
        value,
        by_points + np.where(is_determined, by_feet, 0.0),
        {source: effect for source, effect in effects.items() if effect},
        np.where(is_determined, 0.0, by_feet),
    )


def _explain_height(label: str, height_m: float) -> str:
    """Explain why the height of a point cannot be measured."""
    where = f"is {height_m:g} m over it, as stated" if height_m else "is a point on it"
    return (
        f"the height is that over the ground, and {label!r} {where}: let its height "
        f"be found from the photos {FREE_HEIGHT}"
    )


def make_unmeasured(request: MeasurementRequest) -> list[Measurand]:
    """Return NaN rows for a request that cannot be measured."""
    names = [request.name]
    if request.kind == "coordinate":
        names = [f"{request.name} {axis}" for axis in AXES]
    return [Measurand(name, request, np.nan, None, {}) for name in names]


MIN_DERIVATIVE_SHARE = 1e-12
"""Share of its parts below which a derivative is only their rounding error."""


@dataclass(frozen=True, eq=False)
class MeasuredValues:
    """M measured values of an adjustment.

    Attributes
    ----------
    rows
        (M,) values; a request may give several.
    gradient
        (size, M) derivatives by the unknowns of the adjustment, sparse, as a value depends directly
        on few of them; zero if there is no value.
    solved
        (size, M) S times the gradient, S the covariance of the unknowns.
    covariance
        (M, M) covariance, including other sources with a sigma (friction, times); NaN if there is
        no value.
    why_not
        Names of the requests that cannot be measured, and the reasons.
    """

    rows: tuple[Measurand, ...]
    gradient: csc_array
    solved: Floats
    covariance: Floats
    why_not: tuple[tuple[str, str], ...]

    @property
    def name(self) -> tuple[str, ...]:
        """(M,) names of the values."""
        return tuple(row.name for row in self.rows)

    @property
    def unit(self) -> tuple[str, ...]:
        """(M,) units of the values."""
        return tuple(MEASUREMENT_FORMS[row.request.kind].unit for row in self.rows)

    @property
    def value(self) -> Floats:
        """(M,) values, in the unit of each."""
        return np.array([row.value for row in self.rows])

    @property
    def sigma(self) -> Floats:
        """(M,) standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


class _Sparse(NamedTuple):
    """Derivatives by some unknowns; those by all others are zero."""

    column: Ints
    by_column: Floats


_NO_COLUMN: Ints = np.zeros(0, dtype=np.int64)
_NO_STEP: Floats = np.zeros(0)
_NO_DERIVATIVES = _Sparse(_NO_COLUMN, _NO_STEP)


def propagate(
    adjustment: Adjustment,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    picked: Collection[str] = (),
) -> MeasuredValues:
    """Measure all requests, with the joint covariance of all values.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    requests
        Requested measurements.
    frames
        Times of the exposures, for ``speed``.
    picked
        Labels with any pick, adjusted or not.
    """
    place = adjustment.survey.row_of_label
    rows: list[Measurand] = []
    parts: list[_Sparse] = []
    why_not: list[tuple[str, str]] = []
    size = adjustment.problem.layout.size
    for request in requests:
        try:
            require_picked(request, place, picked)
            found = _measure(adjustment, request, frames, place)
        except UnmeasurableError as why:
            found = [(row, _NO_DERIVATIVES) for row in make_unmeasured(request)]
            why_not.append((request.name, str(why)))
        rows += [row for row, _ in found]
        parts += [part for _, part in found]
    gradient = _assemble_gradients(parts, size)
    # Error propagation: G^T S G, plus the covariance by other sources.
    solved = adjustment.minimum.factor.solve(gradient)
    covariance = gradient.T @ solved + _other_covariance(rows)
    without = [row.gradient is None for row in rows]
    covariance[without] = covariance[:, without] = np.nan
    return MeasuredValues(
        tuple(rows), gradient, solved, 0.5 * (covariance + covariance.T), tuple(why_not)
    )


def _measure(
    adjustment: Adjustment,
    request: MeasurementRequest,
    frames: Frames,
    place: Mapping[str, int],
) -> list[tuple[Measurand, _Sparse]]:
    """Measure the values of one request, with their derivatives."""
    survey = adjustment.survey
    label = np.array([place[p] for p in request.points], dtype=np.int64)
    world, jacobian, unknowns = adjustment.points_with_jacobian(label)
    feet, feet_jacobian, feet_unknowns = (None, jacobian, unknowns)
    if refers_to_ground(request):
        feet, feet_jacobian, feet_unknowns = adjustment.ground_with_jacobian(label)
    found = []
    for row in compute_measurands(request, world, survey, frames, feet=feet):
        # Chain rule: derivatives by points and ground points times theirs by the unknowns.
        by_points, by_feet = row.gradient, row.by_feet
        parts = [] if by_points is None else [(unknowns, by_points, jacobian)]
        parts += [] if by_feet is None else [(feet_unknowns, by_feet, feet_jacobian)]
        columns, steps, largest = [_NO_COLUMN], [_NO_STEP], 0.0
        for where, gradient, by_unknowns in parts:
            part = np.einsum("ni,nik->nk", gradient, by_unknowns)
            columns.append(where.ravel())
            steps.append(part.ravel())
            largest = max(largest, float(np.abs(part).max()))
        found_at, which = np.unique(np.concatenate(columns), return_inverse=True)
        # Sum the derivatives by the same unknown: a point may occur twice in one outline.
        column = np.bincount(which, np.concatenate(steps), len(found_at)).astype(np.float64)
        if not row.others and np.abs(column).max(initial=0.0) <= MIN_DERIVATIVE_SHARE * largest:
            raise UnmeasurableError(
                "nothing that was observed bears on it: its heights are all stated, or up is "
                "only known as at right angles to the ground, for want of a flight log"
            )
        found.append((row, _Sparse(found_at, column)))
    return found


def _assemble_gradients(parts: list[_Sparse], size: int) -> csc_array:
    """Assemble the (size, M) gradients of all values."""
    ends = np.cumsum([0, *(len(part.column) for part in parts)])
    column = np.concatenate([_NO_COLUMN, *(part.column for part in parts)])
    step = np.concatenate([_NO_STEP, *(part.by_column for part in parts)])
    return csc_array((step, column, ends), shape=(size, len(parts)))


def _other_covariance(rows: list[Measurand]) -> Floats:
    """Compute the (M, M) covariance by friction and times; values may share such a source."""
    sources = sorted({source for row in rows for source in row.others})
    if not sources:
        return np.zeros((len(rows), len(rows)))
    others = np.array([[row.others.get(s, 0.0) for s in sources] for row in rows])
    return np.asarray(others @ others.T)


def compute_values(
    problem: SurveyProblem,
    state: State,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    error: Callable[[str], float] = no_error,
) -> Floats:
    """Compute (M,) values under another state of the unknowns; NaN if there is none.

    Parameters
    ----------
    problem
        Likelihood, which defines the unknowns.
    state
        Values of the unknowns.
    requests, frames
        Requested measurements; times of the exposures, for ``speed``.
    error
        Function that returns the error of another source (friction, a time) by its name, in its
        sigmas.
    """
    values: list[float] = []
    for request in requests:
        try:
            where = _places(problem, state, request)
        except UnmeasurableError:
            values += [row.value for row in make_unmeasured(request)]
        else:
            values += _values(request, *where, problem.survey, frames, error)
    return np.array(values)


def compute_values_of_request(
    problem: SurveyProblem, states: State, request: MeasurementRequest, frames: Frames
) -> Floats:
    """Compute (m, M) values of one request with all points picked, under each of m states.

    Parameters
    ----------
    problem
        Likelihood, which defines the unknowns.
    states
        Values of the unknowns, with a leading axis.
    request, frames
        Requested measurement; times of the exposures, for ``speed``.
    """
    world, feet = _places(problem, states, request)
    below = [None] * len(world) if feet is None else feet
    return np.array(
        [
            _values(request, one, under, problem.survey, frames, no_error)
            for one, under in zip(world, below, strict=True)
        ]
    )


def _places(
    problem: SurveyProblem, state: State, request: MeasurementRequest
) -> tuple[Floats, Floats | None]:
    """Return (..., k, 3) points of a request, and the ground below them if it is needed."""
    place = problem.survey.row_of_label
    require_picked(request, place)
    label = np.array([place[p] for p in request.points], dtype=np.int64)
    world, _, _ = problem.world_points(state, label)
    if not refers_to_ground(request):
        return world, None
    feet, _, _ = problem.ground_points(state, label)
    return world, feet


def _values(
    request: MeasurementRequest,
    world: Floats,
    feet: Floats | None,
    survey: Survey,
    frames: Frames,
    error: Callable[[str], float],
) -> list[float]:
    """Compute values of a request from the positions of its points; NaN if there is none."""
    try:
        found = compute_measurands(request, world, survey, frames, error, feet)
    except UnmeasurableError:
        found = make_unmeasured(request)
    return [row.value for row in found]
