"""The answer to the question where the same ground lies in the other photos."""

from __future__ import annotations

from collections.abc import Mapping

from uavgram.picking.document.commands import SameGround
from uavgram.picking.protocol.encode_survey import Json
from uavgram.pipeline.pick.live import Adjusted, LiveSurvey
from uavgram.pipeline.pick.other_photos import same_ground


def same_ground_json(
    survey: LiveSurvey, last: Adjusted | None, asked: SameGround, index: Mapping[str, int]
) -> Json:
    """Pixel and scale by photo number."""
    found = same_ground(survey, last, asked.image, (asked.u_px, asked.v_px))
    return {"places": {str(index[name]): list(place) for name, place in found.items()}}
