"""One photo of level ground as a study varies it: every number of it, with what is usual."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class StudyScene:
    """A photo, what is taped in it, and how wrong everything is.

    Attributes
    ----------
    height_m, tilt_deg
        Of the camera over the ground; of the view from straight down.
    lines
        Taped lengths around the scene.
    pick_px
        Of a pick.
    tape_m, tape_scale
        Of a length; of the tape, a share of all lengths.
    focal_share, centre_px
        Standard deviations of the focal length, a share of it, and of the principal point.
    """

    height_m: float = 40.0
    tilt_deg: float = 20.0
    lines: int = 6
    pick_px: float = 0.8
    tape_m: float = 0.01
    tape_scale: float = 0.0
    focal_share: float = 0.0
    centre_px: float = 0.0
