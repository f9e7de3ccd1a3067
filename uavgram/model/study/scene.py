"""One photo of level ground as a study varies it: every number of it, with what is usual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Log = Literal["none", "consumer", "rtk"]
Layout = Literal["spread", "corner", "side", "plates"]


@dataclass(frozen=True, kw_only=True)
class StudyScene:
    """A photo, what is taped in it, and how wrong everything is.

    Attributes
    ----------
    height_m, tilt_deg
        Of the camera over the ground; of the view from straight down.
    lines, line_m, layout
        Taped lengths: how many, how long, and where: ``spread`` around the scene, all in a
        ``corner``, all on one ``side``; or ``plates``: as many plates of that size, of whose four
        corners all distances are known.
    pick_px, mark_px
        Of a pick; of the ends of the lengths, where that is another one (0: the same).
    tape_m, tape_scale
        Of a length; of the tape, a share of all lengths.
    focal_share, centre_px
        Standard deviations of the focal length, a share of it, and of the principal point.
    log
        What says beforehand where the camera was.
    relief_m
        Ups and downs of the ground that nobody states, alike over 5 m.
    readout_ms, speed_m_s
        In which the photo is read row after row, in flight at that speed, and nobody says so.
    bulge
        Radial distortion k1 of the lens that the camera file leaves out.
    blunder_m
        By which the first length was misread.
    """

    height_m: float = 40.0
    tilt_deg: float = 20.0
    lines: int = 6
    line_m: float = 10.0
    layout: Layout = "spread"
    pick_px: float = 0.8
    mark_px: float = 0.0
    tape_m: float = 0.01
    tape_scale: float = 0.0
    focal_share: float = 0.0
    centre_px: float = 0.0
    log: Log = "consumer"
    relief_m: float = 0.0
    readout_ms: float = 0.0
    speed_m_s: float = 5.0
    bulge: float = 0.0
    blunder_m: float = 0.0

    @property
    def is_model(self) -> bool:
        """Whether the world is what the program takes for granted."""
        return not (self.relief_m or self.readout_ms or self.bulge or self.blunder_m)
