"""Readjust where the readout time was estimated with the wrong motion.

This happens where the adjusted clock moves the exposures to another moment of the flight, or where
the readout time absorbed errors of another kind.
"""

from __future__ import annotations

from dataclasses import replace

from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.rolling import FELT_PX, edge_shift_px, with_readout
from uavgram.model.camera.tags import Readout
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.continued import continued

BEYOND_BELIEF = 5.0
"""Largest deviation of the readout time in prior sigmas: 150 ms without prior knowledge."""


def with_sound_readout(
    survey: Survey, refined: Refined
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Update the camera's motion at the exposures to the adjusted clock, and readjust.

    The motion while a photo is read is looked up at the clock beforehand, which may be wrong by
    tenths of a second: by then a copter in the wind turns another way. An impossible readout time
    is left out, and reported.

    Parameters
    ----------
    survey
        The original survey.
    refined
        Its adjustment.
    """
    adjustment = refined.adjustment
    own, state = adjustment.survey, adjustment.state
    if own.rolling is None or own.rolling.by_photos:
        return survey, refined, ()
    known, found_s = own.rolling.readout, float(state.readout[0])
    if abs(found_s - known.value_s) > BEYOND_BELIEF * known.sigma_s:
        without = replace(own, rolling=None)
        absurd = (_absurd(known, found_s),)
        return replace(survey, rolling=None), _again(refined, without), absurd
    try:
        moved = with_readout(own, state.telemetry)
        whole = with_readout(survey, state.telemetry)
    except ValueError:  # the adjusted clock is at the very end of the log
        return survey, refined, ()
    if moved.rolling is None:
        return survey, refined, ()
    longest_s = abs(found_s) + known.sigma_s
    if edge_shift_px(own, longest_s * (moved.rolling.motion - own.rolling.motion)) < FELT_PX:
        return survey, refined, ()
    return whole, _again(refined, moved), ()


def _absurd(known: Readout, found_s: float) -> Message:
    text = (
        f"The picks ask for a camera that reads a photo in {1e3 * found_s:.0f} ms, row after row. "
        f"That cannot be (known: {1e3 * known.value_s:.0f} ± {1e3 * known.sigma_s:.0f} ms), so "
        "something else does not fit, and the readout time was left out. Look at the warnings: "
        "points that do not lie on the ground do this."
    )
    return Message("info", "readout-left-out", text)


def _again(refined: Refined, survey: Survey) -> Refined:
    """Readjust the same observations with another motion, or none, from the current estimate."""
    try:
        return replace(refined, adjustment=continued(refined.adjustment, survey))
    except (SingularError, ValueError):  # by rounding only, or the other motion is impossible here
        return refined
