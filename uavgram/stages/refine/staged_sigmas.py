"""Adjust surveys that begin far from their minimum with larger sigmas first.

Where the camera is poorly known, focal length, heights and tilts change together. A length to a
point with a free height has two solutions, and first poses may begin it at the wrong one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import (
    MAX_ITERATIONS,
    MIN_REDUCTION,
    Minimum,
    minimise,
)
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.survey import Survey

POOR_FOCAL_SIGMA = 0.05
"""Relative sigma of the focal length above which a camera is poorly known."""

ITERATIONS_FACTOR = 3
"""Factor of the usual number of iterations. Two strips of ten photos without a log, each with six
ordinary drone cameras of 20 to 32 mm in place of its own, took 20 to 72 iterations."""

SIGMA_FACTORS = (30.0, 5.0)
"""Factors of the sigmas of picks, lengths and known things, with which such a survey is adjusted
first. From first values by a wrong focal length and without distortion, exact picks lead along a
bent valley (40 to 111 iterations in those strips) or into a wrong one (2 of the 12, before photos
joined by the pose of either tilt); larger sigmas leave the lens near its prior until the photos are
about where they belong."""

INITIAL_LENGTH_SIGMA = 0.5
"""Relative sigma of a length to a point with a free height, until its rays have led to the correct
side."""

SIGHTING_SIGMA_FACTORS = (30.0, 5.0)
"""Factors of the sigmas of matches and ties with which a survey is adjusted first: they are good to
a tenth of a pixel, but tens of pixels off where a log begins the photos."""

DAMPING = 1e-9
"""Damping of undetermined unknowns, as a share of the normal matrix's diagonal."""

ITERATIONS_EACH = 20
"""Iterations for each factor."""


def max_iterations(camera: Calibration) -> int:
    """Return the number of iterations after which a survey is taken as not convergent."""
    return ITERATIONS_FACTOR * MAX_ITERATIONS if is_poorly_known(camera) else MAX_ITERATIONS


def is_poorly_known(camera: Calibration) -> bool:
    """Return whether the focal length is that uncertain."""
    return bool(np.sqrt(camera.covariance[0, 0]) > POOR_FOCAL_SIGMA * camera.parameters[0])


def approach_minimum(survey: Survey, state: State, pivot: Floats, line_used: Bools) -> State:
    """Move first values nearer to the minimum, where they may be far from it.

    A poorly known camera needs that where no telemetry gives the places of the photos. Undetermined
    unknowns are no fault here: the adjustment that follows reports them.

    Parameters
    ----------
    survey
        All observations.
    state
        First values.
    pivot
        (A, 2) pivots of the slopes of each area [m].
    line_used
        (L,) known lengths that take part.

    Raises
    ------
    SingularError
        No observation depends on an unknown.
    """
    for soft in _enlarge_sigmas(survey):
        state = iterate(
            SurveyProblem(soft, pivot, line_used), state, ITERATIONS_EACH, DAMPING
        ).state
    return state


def _enlarge_sigmas(survey: Survey) -> Iterator[Survey]:
    """Yield the survey with larger sigmas, largest first; nothing where it needs none."""
    if survey.telemetry is None and is_poorly_known(survey.calibration):
        for softer in SIGMA_FACTORS:
            yield replace(
                survey,
                pick_sigma_px=softer * survey.pick_sigma_px,
                length_sigma_m=softer * survey.length_sigma_m,
                known=tuple(replace(one, sigma=softer * one.sigma) for one in survey.known),
            )
    if survey.matches.points + survey.ties.points:
        beside = survey.ties.constraints
        for softer in SIGHTING_SIGMA_FACTORS:
            # These are predicted by ties that are still off.
            told = replace(beside, sigma_m=softer * beside.sigma_m)
            yield replace(
                survey,
                matches=replace(survey.matches, sigma_px=softer * survey.matches.sigma_px),
                ties=replace(survey.ties, sigma_px=softer * survey.ties.sigma_px, constraints=told),
            )
    to_free = survey.is_free[survey.line_start] | survey.is_free[survey.line_end]
    if to_free.any():
        soft = np.maximum(survey.length_sigma_m, INITIAL_LENGTH_SIGMA * survey.length_m)
        yield replace(survey, length_sigma_m=np.where(to_free, soft, survey.length_sigma_m))


def iterate(
    problem: SurveyProblem,
    state: State,
    most: int,
    slack: float = 0.0,
    at_rest: float = MIN_REDUCTION,
    goal: float = np.inf,
) -> Minimum[State]:
    """Iterate from a state to a minimum.

    Parameters
    ----------
    problem
        The likelihood.
    state
        First values.
    most
        Largest number of iterations.
    slack
        Damping of undetermined unknowns, as a share of the normal matrix's diagonal.
    at_rest
        Predicted decrease of the sum of squares below which the iterations end.
    goal
        Sum of squares above which the result is of no use.

    Raises
    ------
    SingularError
        The observations do not determine an unknown.
    """
    layout = problem.layout
    return minimise(
        state,
        problem.evaluate,
        lambda now, step: advance_state(layout, now, step),
        layout.size,
        layout.structure,
        most,
        at_rest=at_rest,
        slack=slack,
        goal=goal,
    )
