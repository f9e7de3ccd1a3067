"""Surveys that begin far from their minimum, led there by softer observations.

Where the camera is hardly known, focal length, heights and tilts change together. A length to a
point whose height is free is met on two sides, and first poses may begin it on the wrong one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import (
    CONVERGED,
    MAX_ITERATIONS,
    Minimum,
    minimise,
)
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State, advance
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.survey.survey import Survey

POOR_FOCAL = 0.05
"""Sigma of the focal length, as a share of it, from which a camera is hardly known."""

PATIENCE = 3
"""So many times the usual iterations. Of two strips of ten photos without a log, each with six
ordinary drone cameras of 20 to 32 mm in the place of its own, the adjustments took 20 to 72."""

SOFTER = (30.0, 5.0)
"""Factors of the sigmas of picks, lengths and known things, with which such a survey is adjusted
first. From first values by a wrong focal length and without distortion, exact picks lead along a
bent valley
(40 to 111 iterations in those strips) or into a wrong one (2 of the 12, before photos joined by the
pose of either tilt); soft ones leave the lens near its prior until the photos lie about where they
belong."""

SOFT_LENGTH = 0.5
"""Sigma of a length to a point whose height is free, as a share of it, until its rays have led to
the side where it is."""

SOFT_SIGHTINGS = (30.0, 5.0)
"""Factors of the sigmas of matches and ties with which a survey is adjusted first: they are good to
a tenth of a pixel, and where a log begins the photos they are tens of pixels off."""

SLACK = 1e-9
"""Damping, as a share of the normal matrix's diagonal, by which what nothing determines may end."""

EACH = 20
"""Iterations for each factor."""


def iterations_for(camera: Calibration) -> int:
    """Iterations after which a survey that has not come to rest never will."""
    return PATIENCE * MAX_ITERATIONS if is_hardly_known(camera) else MAX_ITERATIONS


def is_hardly_known(camera: Calibration) -> bool:
    """Whether the focal length is that uncertain."""
    return bool(np.sqrt(camera.covariance[0, 0]) > POOR_FOCAL * camera.parameters[0])


def settled(survey: Survey, state: State, pivot: Floats, line_used: Bools) -> State:
    """First values nearer to the minimum, where they may be far from it; else `state` itself.

    A camera that is hardly known needs that where no telemetry says where the photos lie. What
    nothing determines is no fault here: the adjustment that follows says so.

    Parameters
    ----------
    survey
        All observations.
    state
        First values.
    pivot
        (A, 2) of the slopes of each area [m].
    line_used
        (L,) known lengths that take part.

    Raises
    ------
    SingularError
        No observation says anything of an unknown.
    """
    for soft in _softer(survey):
        state = iterate(SurveyProblem(soft, pivot, line_used), state, EACH, SLACK).state
    return state


def _softer(survey: Survey) -> Iterator[Survey]:
    """The survey with larger sigmas, softest first; nothing where it needs none."""
    if survey.telemetry is None and is_hardly_known(survey.calibration):
        for softer in SOFTER:
            yield replace(
                survey,
                pick_sigma_px=softer * survey.pick_sigma_px,
                length_sigma_m=softer * survey.length_sigma_m,
                known=tuple(replace(one, sigma=softer * one.sigma) for one in survey.known),
            )
    if survey.matches.points + survey.ties.points:
        beside = survey.ties.beside
        for softer in SOFT_SIGHTINGS:
            told = replace(beside, sigma_m=softer * beside.sigma_m)  # by ties that are off yet
            yield replace(
                survey,
                matches=replace(survey.matches, sigma_px=softer * survey.matches.sigma_px),
                ties=replace(survey.ties, sigma_px=softer * survey.ties.sigma_px, beside=told),
            )
    to_free = survey.is_free[survey.line_start] | survey.is_free[survey.line_end]
    if to_free.any():
        soft = np.maximum(survey.length_sigma_m, SOFT_LENGTH * survey.length_m)
        yield replace(survey, length_sigma_m=np.where(to_free, soft, survey.length_sigma_m))


def iterate(
    problem: SurveyProblem,
    state: State,
    most: int,
    slack: float = 0.0,
    at_rest: float = CONVERGED,
) -> Minimum[State]:
    """The minimum that iterations from a state lead to.

    Parameters
    ----------
    problem
        The likelihood.
    state
        First values.
    most
        Iterations.
    slack
        Damping of what nothing determines, as a share of the normal matrix's diagonal.
    at_rest
        Predicted fall of the sum of squares that is not worth a step.

    Raises
    ------
    SingularError
        The observations leave an unknown free.
    """
    layout = problem.layout
    return minimise(
        state,
        problem.evaluate,
        lambda now, step: advance(layout, now, step),
        layout.size,
        layout.structure,
        most,
        at_rest=at_rest,
        slack=slack,
    )
