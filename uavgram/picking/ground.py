"""The answer to the question where the same ground lies in the other photos."""

from __future__ import annotations

from collections.abc import Mapping

from uavgram.picking.answers import Json
from uavgram.picking.commands import SameGround
from uavgram.pipeline.live import Adjusted, LiveSurvey
from uavgram.pipeline.same_ground import same_ground


def same_ground_json(
    survey: LiveSurvey, last: Adjusted | None, asked: SameGround, index: Mapping[str, int]
) -> Json:
    """Pixel and scale by photo number."""
    found = same_ground(survey, last, asked.image, (asked.u_px, asked.v_px))
    return {"places": {str(index[name]): list(place) for name, place in found.items()}}
