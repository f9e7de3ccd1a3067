"""Readjust from the current estimate, after a change of the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.softened import iterate, iterations_for


def continued(adjustment: Adjustment, survey: Survey) -> Adjustment:
    """Readjust from the current estimate with other sigmas or another ground.

    Raises
    ------
    SingularError
        An unknown is not determined.
    """
    problem = SurveyProblem(survey, adjustment.problem.pivot_m, lines_used(adjustment))
    start = carried(adjustment, problem)
    minimum = iterate(problem, start, iterations_for(survey.calibration))
    return Adjustment(problem, minimum, minimum.factor.covariance())


def carried(adjustment: Adjustment, problem: SurveyProblem) -> State:
    """Convert the state of an adjustment to the unknowns of another likelihood of the same survey.

    Unknowns that the adjustment does not have begin at zero.
    """
    state, before, survey = adjustment.state, adjustment.problem, problem.survey
    # Coordinates that both have; others, such as heights, begin at zero.
    point = np.zeros((problem.layout.points, problem.layout.point_size))
    shared = min(point.shape[1], state.point.shape[1])
    point[:, :shared] = state.point[:, :shared]
    picked = np.array(point[survey.identified])
    _, new, kept = np.intersect1d(survey.identified, before.survey.identified, return_indices=True)
    picked[new, :shared] = state.picked[kept, :shared]
    tie = np.zeros((problem.layout.ties, problem.layout.point_size))
    tie[:, :shared] = state.tie[:, :shared]
    # Relief of areas with the same kind of surface.
    relief = np.zeros(problem.layout.relief)
    for area, ground in enumerate(survey.grounds):
        old = before.survey.grounds[area].relief
        if ground.relief is not None and old is not None and old.kind == ground.relief.kind:
            relief[problem.ground.relief_rows(area)] = state.relief[before.ground.relief_rows(area)]
    turning = np.zeros((problem.layout.frames, problem.layout.frame_size - 6))
    if turning.shape == state.turning.shape:
        turning = state.turning
    readout = state.readout
    if len(readout) != problem.layout.readout:
        readout = np.zeros(0) if survey.rolling is None else survey.rolling.first_value
    scale = dict(zip(before.tapes, state.tape.tolist(), strict=True))
    tape = np.array([scale.get(name, 0.0) for name in problem.tapes])
    return replace(
        state,
        point=point,
        picked=picked,
        tie=tie,
        relief=relief,
        readout=readout,
        turning=turning,
        tape=tape,
    )


def lines_used(adjustment: Adjustment) -> Bools:
    """Mark the known lengths (L,) that take part."""
    used = np.zeros(len(adjustment.survey.line_start), dtype=np.bool_)
    used[adjustment.problem.line_index] = True
    return used
