"""Measured values of an adjusted survey, and their derivatives by its unknowns."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from uavgram.estimation.measuring.kinds import (
    Measurand,
    compute_measurands,
    make_unmeasured,
    no_error,
    refers_to_ground,
    require_picked,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.measurements import UnmeasurableError
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementRequest
from uavgram.model.survey import Survey

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
