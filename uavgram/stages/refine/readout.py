"""Adjust again where the readout time was looked for in the wrong way.

That is where the adjusted clock puts the exposures into another moment of the flight, or where
the readout time took up errors of another kind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.rolling import FELT_PX, edge_shift_px, with_readout
from uavgram.estimation.survey.unknowns import State
from uavgram.model.camera.readout import Readout
from uavgram.model.message import Message
from uavgram.model.survey.rolling_shutter import RollingShutter
from uavgram.stages.refine.poor_camera import iterate, iterations_for

BEYOND_BELIEF = 5.0
"""Prior sigmas from what is known of the readout time: 150 ms where nothing is."""


def with_sound_readout(refined: Refined) -> tuple[Refined, tuple[Message, ...]]:
    """The result with the camera's motion at the exposures as they were found.

    The motion while a photo is read is looked up at the clock beforehand, which may be off by
    tenths of a second: by then a copter in the wind turns another way. A readout time that no
    camera has is left out, and said.
    """
    survey, state = refined.adjustment.survey, refined.adjustment.state
    if survey.rolling is None:
        return refined, ()
    known, found_s = survey.rolling.readout, float(state.readout[0])
    if abs(found_s - known.value_s) > BEYOND_BELIEF * known.sigma_s:
        without = replace(state, readout=np.zeros(0))
        return _again(refined, None, without), (_absurd(known, found_s),)
    try:
        moved = with_readout(survey, state.telemetry).rolling
    except ValueError:  # the found clock lies at the log's very end
        return refined, ()
    change = np.zeros((0, 6)) if moved is None else moved.motion - survey.rolling.motion
    longest_s = abs(found_s) + known.sigma_s
    if moved is None or edge_shift_px(survey, longest_s * change) < FELT_PX:
        return refined, ()
    return _again(refined, moved, state), ()


def _absurd(known: Readout, found_s: float) -> Message:
    text = (
        f"The picks ask for a camera that reads a photo in {1e3 * found_s:.0f} ms, row after row. "
        f"That cannot be (known: {1e3 * known.value_s:.0f} ± {1e3 * known.sigma_s:.0f} ms), so "
        "something else does not fit, and the readout time was left out. Look at the warnings: "
        "points that do not lie on the ground do this."
    )
    return Message("info", "readout-left-out", text)


def _again(refined: Refined, rolling: RollingShutter | None, state: State) -> Refined:
    """The same observations with another motion, or none, from the state that was found."""
    before = refined.adjustment
    survey = before.survey
    used = np.isin(np.arange(len(survey.line_start)), before.problem.line_index)
    problem = SurveyProblem(replace(survey, rolling=rolling), before.problem.pivot_m, used)
    try:
        minimum = iterate(problem, state, iterations_for(survey.calibration))
    except SingularError:  # it was determined before, so only by rounding
        return refined
    adjustment = Adjustment(problem, minimum, minimum.factor.covariance())
    return replace(refined, adjustment=adjustment)
