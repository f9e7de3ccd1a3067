"""Adjust again where the adjusted clock puts the exposures into another moment of the flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.rolling import FELT_PX, edge_shift_px, with_readout
from uavgram.stages.refine.poor_camera import iterate, iterations_for


def at_found_clock(refined: Refined) -> Refined:
    """The result with the camera's motion at the exposures as they were found.

    The motion while a photo is read is looked up at the clock beforehand, which may be off by
    tenths of a second: by then a copter in the wind turns another way.
    """
    before = refined.adjustment
    survey, state = before.survey, before.state
    if survey.rolling is None:
        return refined
    try:
        moved = with_readout(survey, state.telemetry).rolling
    except ValueError:  # the found clock lies at the log's very end
        return refined
    if moved is None:
        return refined
    longest_s = float(np.abs(state.readout[0])) + survey.rolling.readout.sigma_s
    if edge_shift_px(survey, longest_s * (moved.motion - survey.rolling.motion)) < FELT_PX:
        return refined
    used = np.isin(np.arange(len(survey.line_start)), before.problem.line_index)
    problem = SurveyProblem(replace(survey, rolling=moved), before.problem.pivot_m, used)
    try:
        minimum = iterate(problem, state, iterations_for(survey.calibration))
    except SingularError:  # it was determined before, so only by rounding
        return refined
    adjustment = Adjustment(problem, minimum, minimum.factor.covariance())
    return replace(refined, adjustment=adjustment)
