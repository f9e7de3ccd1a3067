"""Adjust again where the readout time was looked for in the wrong way.

That is where the adjusted clock puts the exposures into another moment of the flight, or where
the readout time took up errors of another kind.
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
"""Prior sigmas from what is known of the readout time: 150 ms where nothing is."""


def with_sound_readout(
    survey: Survey, refined: Refined
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Survey and result with the camera's motion at the exposures as they were found.

    The motion while a photo is read is looked up at the clock beforehand, which may be off by
    tenths of a second: by then a copter in the wind turns another way. A readout time that no
    camera has is left out, and said.

    Parameters
    ----------
    survey
        As it was handed in.
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
    except ValueError:  # the found clock lies at the log's very end
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
    """The same observations with another motion, or none, from where the result stands."""
    try:
        return replace(refined, adjustment=continued(refined.adjustment, survey))
    except (SingularError, ValueError):  # only by rounding; or the other motion is impossible here
        return refined
