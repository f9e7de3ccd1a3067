"""What a photo says of its camera, and what a table of cameras says of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays


def named_camera(make: str, model: str) -> str:
    """Make and model in words; many models begin with the make: "Canon", "Canon EOS 6D"."""
    first, stated = make.casefold().split()[:1], model.casefold().split()[:1]
    return model if first and first == stated else " ".join(filter(None, (make, model)))


@dataclass(frozen=True, kw_only=True)
class CameraTags:
    """Tags of one photo about its camera; NaN or empty for what they do not say.

    Attributes
    ----------
    path
        The photo.
    width_px, height_px
        Its size.
    make, model
        EXIF Make and Model.
    serial
        EXIF BodySerialNumber, or the maker's own tag.
    focal_mm, focal_step_mm
        EXIF FocalLength, and the step it is rounded to.
    focal_35mm_mm
        EXIF FocalLengthIn35mmFilm.
    focal_plane_per_mm
        EXIF FocalPlaneXResolution and FocalPlaneYResolution: pixels of the original photo.
    original_px
        EXIF PixelXDimension and PixelYDimension: the size of the original photo.
    focus_m
        EXIF SubjectDistance.
    digital_zoom
        EXIF DigitalZoomRatio; 1 where none was used.
    dewarp
        The maker's calibration, DJI's DewarpData: fx fy cx cy k1 k2 p1 p2 k3, and k4 k5 k6 of
        DewarpDataK6; cx and cy from the image's centre. Empty where there is none.
    dewarped
        The maker's program took the distortion out of the photo already (DJI's DewarpFlag).
    """

    path: str
    width_px: int
    height_px: int
    make: str = ""
    model: str = ""
    serial: str = ""
    focal_mm: float = math.nan
    focal_step_mm: float = math.nan
    focal_35mm_mm: float = math.nan
    focal_plane_per_mm: tuple[float, float] = (math.nan, math.nan)
    original_px: tuple[float, float] = (math.nan, math.nan)
    focus_m: float = math.nan
    digital_zoom: float = 1.0
    dewarp: tuple[float, ...] = ()
    dewarped: bool = False

    @property
    def camera_name(self) -> str:
        """Make and model, as a person would say them."""
        return named_camera(self.make, self.model)


@dataclass(frozen=True, kw_only=True, eq=False)
class DroneCamera(FrozenArrays):
    """One camera of the table of drone cameras.

    Attributes
    ----------
    make_model
        Make in lower case, and model, without a blank between them.
    comment
        The table's own words for it.
    is_thermal
        One of two cameras of one name may be.
    width_px, height_px
        A whole frame.
    pitch_mm
        Width and height of a pixel.
    focal_mm
        Of a lens that the photos do not state; NaN where EXIF does.
    is_perspective
        False: a fisheye, with a polynomial of its own.
    distortion
        k1 k2 p1 p2 k3; all zero where the table knows none.
    """

    make_model: str
    comment: str
    is_thermal: bool
    width_px: int
    height_px: int
    pitch_mm: tuple[float, float]
    focal_mm: float
    is_perspective: bool
    distortion: Annotated[Floats, 5]
