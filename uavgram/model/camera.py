"""Interior orientation with its covariance, errors assumed where none are stated, and camera tags.

The source of each number is given next to it. The assumed errors are generous: the observations of
a survey reduce them, and a calibration replaces them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import Bools, Floats, FrozenArrays, freeze
from uavgram.model.provenance import InputDigest

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


def find_published_readout(make: str, model: str, width_px: int, height_px: int) -> Readout | None:
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


def join_make_and_model(make: str, model: str) -> str:
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
        return join_make_and_model(self.make, self.model)


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


OptionValue = bool | int | float | str


@dataclass(frozen=True, kw_only=True)
class CameraProvenance:
    """Chain of custody of a calibration.

    Attributes
    ----------
    program, version
        Program that wrote the file.
    created_utc
        ISO 8601.
    source
        In words: calibrated from photos, converted, scaled.
    inputs
        Files from which it was made: photos, or an earlier camera file.
    board
        The target, in words; empty where there was none.
    options
        By name; read-only.
    variance_factor
        Of the adjustment; None where there was none.
    make, camera_model, focal_mm, focus_m
        EXIF of the photos, where known.
    """

    program: str
    version: str
    created_utc: str
    source: str
    inputs: tuple[InputDigest, ...] = ()
    board: str = ""
    options: Mapping[str, OptionValue] = field(default_factory=dict)
    variance_factor: float | None = None
    make: str = ""
    camera_model: str = ""
    focal_mm: float | None = None
    focus_m: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", MappingProxyType(dict(self.options)))


LensModel = Literal["brown", "fisheye"]

PARAMETER_NAMES: dict[LensModel, tuple[str, ...]] = {
    "brown": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
}

_RATIONAL_NAMES = ("k4", "k5", "k6")


def parameter_counts(model: LensModel) -> tuple[int, ...]:
    """Return the permitted numbers of parameters of a camera of this model.

    A brown camera has 9, or 12 with the rational coefficients k4 k5 k6 (OpenCV's 8 coefficients).
    """
    basic = len(PARAMETER_NAMES[model])
    return (basic, basic + len(_RATIONAL_NAMES)) if model == "brown" else (basic,)


_PARTS = {"f": "focal length", "c": "image centre", "k": "lens distortion", "p": "lens distortion"}
"""Parts of a camera, in words, by the first letter of a parameter's name."""


def describe_part(name: str) -> str:
    """Return the part of a camera to which a parameter belongs: ``focal length`` for ``fx``."""
    return _PARTS[name[0]]


def parameter_names(model: LensModel, count: int) -> tuple[str, ...]:
    """Return the names of the parameters of a camera that has `count` of them.

    Raises
    ------
    ValueError
        No camera of this model has that many.
    """
    if count not in parameter_counts(model):
        raise ValueError(
            f"a {model} camera has {' or '.join(map(str, parameter_counts(model)))} parameters, "
            f"got {count}"
        )
    return (PARAMETER_NAMES[model] + _RATIONAL_NAMES)[:count]


POOR_FOCAL_SIGMA = 0.05
"""Relative sigma of the focal length above which a camera is poorly known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Interior orientation of a camera with its covariance.

    Attributes
    ----------
    name
        The camera's name.
    model
        ``brown`` (OpenCV's k1 k2 p1 p2 k3, and k4 k5 k6 where there are 12 parameters) or
        ``fisheye`` (OpenCV's k1 k2 k3 k4).
    width_px, height_px
        Size of the original image.
    parameters
        (P,) in the order of `parameter_names`: px, then dimensionless coefficients.
    covariance
        (P, P), same order.
    readout
        Readout time of a photo; None where it is unknown.
    is_unknown
        Whether nothing is known of it: then the sigma of a focal length is that of its logarithm.
    """

    name: str
    model: LensModel
    width_px: int
    height_px: int
    parameters: Annotated[Floats, "n"]
    covariance: Annotated[Floats, "n", "n"]
    readout: Readout | None = None
    is_unknown: bool = False

    def __post_init__(self) -> None:
        freeze(self, n=len(self.parameter_names))
        if self.width_px <= 0 or self.height_px <= 0:
            raise ValueError(
                f"width_px and height_px must be positive, got {self.width_px} x {self.height_px}"
            )
        if min(self.parameters[:2]) <= 0:
            raise ValueError(f"fx and fy must be positive, got {self.parameters[:2].tolist()}")

    @property
    def is_poorly_known(self) -> bool:
        """Whether the focal length is so uncertain that it changes along with heights and tilts."""
        return bool(np.sqrt(self.covariance[0, 0]) > POOR_FOCAL_SIGMA * self.parameters[0])

    @property
    def correlation(self) -> Floats:
        """(P, P) correlations of the parameters; 0 where one is known exactly."""
        return correlation_of(self.covariance)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(P,) names of the parameters."""
        return parameter_names(self.model, len(self.parameters))

    def is_in_photo(self, pixel_px: Floats, beyond_px: Floats | float = 0.0) -> Bools:
        """Mark pixels (..., 2) inside the photo, or beyond its edge by a distance; NaN is outside.

        Parameters
        ----------
        pixel_px
            (..., 2) u and v.
        beyond_px
            Distance from the edge; negative: inside the photo by at least this.
        """
        size = np.array([self.width_px, self.height_px])
        with np.errstate(invalid="ignore"):
            inside = (pixel_px >= -0.5 - beyond_px) & (pixel_px <= size - 0.5 + beyond_px)
        return np.asarray(inside.all(axis=-1))


def correlation_of(covariance: Floats) -> Floats:
    """Return the (P, P) correlations of a covariance, so that its elements are comparable.

    A variance of 0, which holds a parameter fixed, stays 0.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(sigma > 0, sigma, 1.0)
    return np.asarray(covariance / np.outer(scale, scale))


ASPECT_SIGMA = 0.005
"""Standard deviation of fx / fy.

Pixels are square, but calibrations give fy / fx = 1.0036 (Phantom 3), 1.0053 (Phantom 3, video) and
0.9997 (Mavic Pro, video).
"""


@dataclass(frozen=True, kw_only=True)
class AssumedErrors:
    """Assumed standard deviations of a camera without stated ones.

    Attributes
    ----------
    focal
        Of fx and of fy, relative to each. Their ratio is known to `ASPECT_SIGMA`.
    centre
        Of cx and cy, relative to the image's width.
    radial
        Of k1 k2 k3 (brown), and of k4 k5 k6 where there are any.
    tangential
        Of p1 and p2.
    fisheye
        Of k1 k2 k3 k4 (fisheye).
    """

    focal: float
    centre: float
    radial: tuple[float, float, float] = (0.03, 0.1, 0.2)
    tangential: float = 0.002
    fisheye: tuple[float, float, float, float] = (0.02, 0.05, 0.05, 0.05)


CALIBRATION_FILE = AssumedErrors(focal=0.01, centre=0.005)
"""Errors of a calibration by another program that states none."""

FACTORY = AssumedErrors(focal=0.005, centre=0.005)
"""Errors of the maker's calibration of the individual lens, stored in its photos.

In two recorded Phantom 4 RTK the factory's focal lengths (3659.8, 3684.5 px) differ by -0.2 and
+0.5 % from the design's 3666.7 px: a lens that has aged, or was refocused, is assumed to differ by
as much.
"""

# The table of drone cameras compared with available calibrations, none of a full 4:3 frame:
#   Phantom 3 photo (FC300X, 4000 x 2250): table 2285.7 px; published fx 2302.0, fy 2310.2: +0.9 %;
#     principal point +5 and +55 px from the centre; k1 k2 k3 -0.010 +0.015 -0.018; p1 p2 0.0064,
#     0.0005 from the table's
#   Phantom 3 video (3840 px wide, table's pixels): published fx 2298.6, fy 2310.9: +0.8 %;
#     principal point +38 and +9 px
#   Mavic Pro while filming (FC220, 4000 x 2250): table 2971 px at 4.7 mm; published 3320 px,
#     +11.7 % (the camera crops its sensor); principal point -161 and +11 px; k1 k2 k3 -0.017
#     +0.113 -0.077; p1 p2 0.0104, 0.0008
#   Phantom 3 photos (FC300S, 4000 x 2250): free of distortion. In a bundle adjustment of three with
#     772 points, k1 k2 are 0.009 0.019 (table: -0.132 0.111), its cost 331 (with the table: 3216)
# EXIF rounds the focal length too: 4.7 mm for 4.73 mm is 0.6 %.
DRONE_TABLE = AssumedErrors(
    focal=0.02, centre=0.01, radial=(0.02, 0.1, 0.1), tangential=0.006, fisheye=(0.1,) * 4
)
"""Errors of the sensor size and distortion in the table, for a full frame of the sensor.

Those of the distortion apply to a camera that does not remove it from its photos.
"""

CROPPED_FOCAL_SIGMA = 0.08
"""Relative focal error of a photo that is not a full frame: 0.9 and 11.7 % above, rms 8.3 %."""

CROPPED_CENTRE_SIGMA = 0.02
"""Principal point error of such a photo: rms of the six coordinates above, 1.9 % of the width."""

UNKNOWN_RADIAL_SIGMAS = (0.16, 0.25, 0.23)
"""Standard deviations of k1 k2 k3 of an unknown lens.

Two thirds of the 57 colour cameras with distortion in the table have smaller values.
"""

EQUIVALENT_FOCAL_SIGMA = 0.03
"""Relative error of a focal length from its 35 mm equivalent, full frame.

Rounded to whole millimetres (1.4 % at 20 mm), and by the diagonal or by the width (4 % apart at
4:3): CIPA DC-008 leaves it open.
"""

FOCAL_PLANE_SIGMA = 0.02
"""Relative error of a focal length from EXIF's FocalPlaneXResolution and FocalPlaneYResolution.

Canon's EOS 5D Mark II states a sensor of 37.06 x 24.33 mm (5616 x 3744 px at 3849.21 and 3908.14
per inch), by its specification 35.8 x 23.9 mm: 2.7 % in the mean of both. Others are closer, at
some 0.5 %.
"""

ORDINARY_EQUIVALENTS_MM = {
    "djiFC300X": 20.0,  # Phantom 3; EXIF of its photos
    "djiFC330": 20.0,  # Phantom 4; "FOV 94°, 20 mm"
    "djiFC3411": 22.0,  # Air 2S; "FOV 88°, 22 mm"
    "djiFC230": 24.0,  # Mavic Air; "FOV 85°, 24 mm"
    "djiFC7203": 24.0,  # Mavic Mini; "FOV 83°, 24 mm"
    "djiFC7303": 24.0,  # Mini 2; "FOV 83°, 24 mm"
    "djiFC8482": 24.0,  # Mini 4 Pro; "FOV 82.1°, 24 mm"
    "djiFC3170": 24.0,  # Mavic Air 2; "FOV 84°, 24 mm"
    "djiFC6310": 24.0,  # Phantom 4 Pro; "FOV 84°, 8.8 mm / 24 mm"
    "djiM2EA": 24.0,  # Mavic 2 Enterprise Advanced; "24 mm"
    "djiM3E": 24.0,  # Mavic 3 Enterprise; "FOV 84°, 24 mm"
    "hasselbladL2D-20C": 24.0,  # Mavic 3; "FOV 84°, 24 mm"
    "djiFC220": 26.0,  # Mavic Pro; "FOV 78.8°, 26 mm", and EXIF
    "hasselbladL1D-20C": 28.0,  # Mavic 2 Pro; "FOV about 77°, 28 mm"
    "djiFC550": 29.7,  # Zenmuse X5 with its 15 mm lens; by the table's sensor
    "djiZP1": 36.1,  # Zenmuse P1 with its 35 mm lens; likewise
    "djiFC6540": 36.9,  # Zenmuse X7 with its 24 mm lens; likewise
    "djiXT2": 37.0,  # Zenmuse XT2, 8 mm, colour; likewise
}
"""35 mm equivalents of main colour cameras of drones, from their makers' specifications.

Keys are names in the table of drone cameras, which has no focal lengths of these cameras. The
ordinary drone camera and the range of such cameras are derived from these values.
"""


def make_assumed_covariance(
    model: LensModel, parameters: Floats, width_px: int, errors: AssumedErrors
) -> Floats:
    """Return the (P, P) covariance of a camera with assumed errors; fx and fy are correlated.

    Parameters
    ----------
    model, parameters
        The lens; (P,).
    width_px
        Width of the image.
    errors
        Assumed standard deviations.
    """
    fx, fy = parameters[:2].tolist()
    centre_px = errors.centre * width_px
    radial, tangential = errors.radial, errors.tangential
    if model == "brown":
        lens = [*radial[:2], tangential, tangential, radial[2], *radial]
    else:
        lens = list(errors.fisheye)
    sigma = np.array(
        [errors.focal * fx, errors.focal * fy, centre_px, centre_px, *lens][: len(parameters)]
    )
    covariance = np.diag(sigma**2)
    # correlation of fx and fy from var(fx / fy) = 2 focal^2 (1 - correlation), relative
    correlation = max(0.0, 1.0 - 0.5 * (ASPECT_SIGMA / errors.focal) ** 2)
    covariance[0, 1] = covariance[1, 0] = correlation * sigma[0] * sigma[1]
    return covariance
