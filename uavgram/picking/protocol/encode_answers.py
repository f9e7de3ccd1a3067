"""Answers to questions about places in photos: an exact target, the same ground elsewhere."""

from __future__ import annotations

from collections.abc import Mapping

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.snap import Snapped, snap_circle, snap_corner
from uavgram.picking.document.commands import SameGround, Snap
from uavgram.picking.protocol.encode_survey import Json
from uavgram.pipeline.pick.live import Adjusted, LiveSurvey
from uavgram.pipeline.pick.other_photos import same_ground


def snap_json(photo: Pixels, asked: Snap) -> Json:
    """The exact place with its sigma, or why there is none."""
    find = snap_corner if asked.target == "corner" else snap_circle
    found = find(photo, asked.u_px, asked.v_px)
    if not isinstance(found, Snapped):
        return {"why": found}
    return {"u_px": found.u_px, "v_px": found.v_px, "sigma_px": round(found.sigma_px, 3)}


def same_ground_json(
    survey: LiveSurvey, last: Adjusted | None, asked: SameGround, index: Mapping[str, int]
) -> Json:
    """Where other photos show the same ground: u, v [px] and scale by photo number.

    Parameters
    ----------
    survey, last
        The project, and its last full adjustment, where there is one.
    asked
        Photo and pixel.
    index
        Numbers of the photos by name.
    """
    found = same_ground(survey, last, asked.image, (asked.u_px, asked.v_px))
    return {"places": {str(index[name]): list(place) for name, place in found.items()}}
