"""Parts of photos that a report shows, and the ground picture of its plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Subject = Literal["overview", "point", "measurement"]


@dataclass(frozen=True, kw_only=True)
class Region:
    """Part of a photo to be shown.

    Attributes
    ----------
    subject, row
        Kind of subject, and its row among the points or the measurements; 0 for an overview.
    frame
        Row of the photo among the frames.
    left_px, top_px, width_px, height_px
        Whole pixels of the photo: the first column and row, and their numbers.
    """

    subject: Subject
    row: int
    frame: int
    left_px: int
    top_px: int
    width_px: int
    height_px: int


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Picture of a region.

    Attributes
    ----------
    region
        Region of the photo.
    jpeg
        Image of that part, perhaps reduced.
    shown_px
        Its width in its own pixels: less than the region's where it is reduced.
    stretch
        Values of the photo that are shown as black and as white, and gamma; None where it is shown
        unchanged.
    """

    region: Region
    jpeg: bytes = field(repr=False)
    shown_px: int
    stretch: tuple[float, float, float] | None


@dataclass(frozen=True, kw_only=True)
class GroundPicture:
    """Top view of the ground, composed from photos.

    Attributes
    ----------
    jpeg
        White where no photo shows the ground.
    west_m, north_m
        World coordinates of the north-western corner.
    width_m, height_m
        On the ground.
    brightened
        Whether it is shown brighter than the photos are.
    """

    jpeg: bytes = field(repr=False)
    west_m: float
    north_m: float
    width_m: float
    height_m: float
    brightened: bool


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """All pictures in a report.

    Attributes
    ----------
    shown
        The overview first, then points and measurements by their rows.
    left_out
        Names of points and measurements without a picture.
    ground
        Top view below the plan; None where photos show none of it.
    """

    shown: tuple[Picture, ...] = ()
    left_out: tuple[str, ...] = ()
    ground: GroundPicture | None = None


NO_PICTURES = Pictures()
"""Pictures of a report without photos."""
