"""Camera tags of a photo, and published readout times of rolling shutters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays

TABLE_SIGMA_S = 0.005
"""Standard deviation of a published readout time [s]: other firmware, mode, or measurement."""


@dataclass(frozen=True, kw_only=True)
class Readout:
    """A readout time and its standard deviation [s].

    Row v of a photo of height h is exposed at time + value (v - (h - 1) / 2) / h. It is 0 where a
    shutter exposes all rows at once, negative where the last row is read first.
    """

    value_s: float
    sigma_s: float


UNKNOWN_READOUT = Readout(value_s=0.0, sigma_s=0.030)
"""Prior for an unknown camera: all rows at once, or about as slow as most in the table."""

# Readout times [ms] by the upper limit of a photo's megapixels. From OpenDroneMap's
# opendm/rollingshutter.py (values measured by its users with a blinking light,
# https://github.com/OpenDroneMap/RSCalibration). The Phantom 4 Pro (FC6310) is omitted: like the
# Mavic 3 Enterprise and others with a mechanical shutter, it has two kinds of shutter, and its
# photos do not record which one was used.
_ANY = float("inf")
_PUBLISHED_MS: dict[str, tuple[tuple[float, float], ...]] = {
    "autel robotics xl724": ((_ANY, 29),),  # Nano+
    "autel robotics xt701": ((_ANY, 25),),  # Evo II 8k
    "autel robotics xt705": ((_ANY, 30),),  # Evo II Pro
    "dji phantom vision fc200": ((_ANY, 74),),  # Phantom 2 Vision
    "dji fc2103": ((_ANY, 32),),  # Mavic Air
    "dji fc220": ((_ANY, 64),),  # Mavic Pro
    "dji fc300c": ((_ANY, 33),),  # Phantom 3 Standard
    "dji fc300s": ((_ANY, 33),),  # Phantom 3 Advanced
    "dji fc300x": ((_ANY, 33),),  # Phantom 3 Professional
    "dji fc3170": ((_ANY, 27),),  # Mavic Air 2
    "dji fc330": ((_ANY, 33),),  # Phantom 4
    "dji fc3411": ((_ANY, 32),),  # Air 2S
    "dji fc350": ((_ANY, 30),),  # Inspire 1
    "dji fc3582": ((48, 26), (_ANY, 60)),  # Mini 3 Pro
    "dji fc3682": ((_ANY, 23),),  # Mini 3
    "dji fc7203": ((10, 19), (_ANY, 25)),  # Mavic Mini
    "dji fc8482": ((12, 16), (20, 21), (45, 43), (_ANY, 58)),  # Mini 4 Pro
    "dji mavic2-enterprise-advanced": ((_ANY, 31),),
    "dji zenmuse z30": ((_ANY, 8),),
    "gopro hero4 black": ((_ANY, 30),),
    "gopro hero8 black": ((_ANY, 17),),
    "hasselblad l1d-20c": ((17, 47), (_ANY, 56)),  # Mavic 2 Pro
    "hasselblad l2d-20c": ((_ANY, 16.6),),  # Mavic 3, not the Enterprise
    "parrot anafi": ((_ANY, 39),),
    "yuneec e90": ((_ANY, 44),),
}


def published_readout(make: str, model: str, width_px: int, height_px: int) -> Readout | None:
    """Return the published readout time of a camera; None where there is none.

    Parameters
    ----------
    make, model
        As in EXIF.
    width_px, height_px
        Size of the photos: some cameras have several modes.
    """
    modes = _PUBLISHED_MS.get(f"{make.strip()} {model.strip()}".casefold().strip())
    if modes is None:
        return None
    megapixels = width_px * height_px / 1e6
    value_ms = next(ms for most, ms in modes if megapixels < most)
    return Readout(value_s=value_ms / 1e3, sigma_s=TABLE_SIGMA_S)


def named_camera(make: str, model: str) -> str:
    """Join make and model; many models begin with the make: "Canon", "Canon EOS 6D"."""
    first, stated = make.casefold().split()[:1], model.casefold().split()[:1]
    return model if first and first == stated else " ".join(filter(None, (make, model)))


@dataclass(frozen=True, kw_only=True)
class CameraTags:
    """Camera tags of one photo; NaN or empty where missing.

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
        EXIF FocalLength, and its rounding step.
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
        The maker's program has already removed the distortion from the photo (DJI's DewarpFlag).
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
        """Make and model, as displayed."""
        return named_camera(self.make, self.model)


@dataclass(frozen=True, kw_only=True, eq=False)
class DroneCamera(FrozenArrays):
    """One camera of the table of drone cameras.

    Attributes
    ----------
    make_model
        Make in lower case, and model, without a blank between them.
    comment
        Comment in the table.
    is_thermal
        True for the thermal one of two cameras of the same name.
    width_px, height_px
        Size of a full frame.
    pitch_mm
        Width and height of a pixel.
    focal_mm
        Focal length of a lens whose photos do not state it; NaN where EXIF does.
    is_perspective
        False: a fisheye, with a polynomial of its own.
    distortion
        k1 k2 p1 p2 k3; all zero where the table has none.
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
