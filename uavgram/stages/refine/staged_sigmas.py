"""Adjust surveys that begin far from their minimum with larger sigmas first.

Matches and ties are exact, and a log may begin the photos tens of pixels off. A length to a point
with a free height has two solutions, and first poses may begin it at the wrong one.
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
from uavgram.model.survey import Survey

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


def approach_minimum(survey: Survey, state: State, pivot: Floats, line_used: Bools) -> State:
    """Move first values nearer to the minimum, where they may be far from it.

    Undetermined unknowns are no fault here: the adjustment that follows reports them.

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
    most: int = MAX_ITERATIONS,
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
        bends=problem.survey.calibration.is_poorly_known,
    )
