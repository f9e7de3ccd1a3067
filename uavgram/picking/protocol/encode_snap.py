"""The answer to a request to snap."""

from __future__ import annotations

from uavgram.imaging.photos.tiles import Pixels
from uavgram.imaging.snap import Snapped, snap_circle, snap_corner
from uavgram.picking.document.commands import Snap
from uavgram.picking.protocol.encode_survey import Json


def snap_json(photo: Pixels, asked: Snap) -> Json:
    """The exact place with its sigma, or why there is none."""
    find = snap_corner if asked.target == "corner" else snap_circle
    found = find(photo, asked.u_px, asked.v_px)
    if not isinstance(found, Snapped):
        return {"why": found}
    return {"u_px": found.u_px, "v_px": found.v_px, "sigma_px": round(found.sigma_px, 3)}
