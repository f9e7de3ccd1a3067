"""Camera of a survey: assumed from the tags of a photo, and learnt from the survey itself.

The best available source is used: the maker's calibration in the photo, otherwise the sensor's
resolution in EXIF, otherwise the table of drone cameras with the focal length of EXIF, otherwise
the 35 mm equivalent. Without any of these an ordinary drone camera, if that is allowed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.camera.lens import largest_radius
from uavgram.geometry.camera.properties import equivalent_focal_px, focal_plane_px, is_strip
from uavgram.model.arrays import Floats
from uavgram.model.camera import (
    CROPPED_CENTRE_SIGMA,
    CROPPED_FOCAL_SIGMA,
    DRONE_TABLE,
    EQUIVALENT_FOCAL_SIGMA,
    FACTORY,
    FOCAL_PLANE_SIGMA,
    ORDINARY_EQUIVALENTS_MM,
    UNKNOWN_RADIAL_SIGMAS,
    AssumedErrors,
    Calibration,
    CameraTags,
    DroneCamera,
    describe_part,
    make_assumed_covariance,
)
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.result.result import CameraUpdate

REMEDY = (
    "calibrate the camera (`uavgram calibrate`) and name its camera.yaml, or write a camera.yaml "
    "by hand"
)
WITHOUT = "or write `camera: unknown` in the project, for an ordinary drone camera with wide errors"
UNKNOWN_CAMERA, ASSUMED_CAMERA = "camera-unknown", "camera-assumed"
"""Codes of the messages on an unknown camera, and on one assumed from the tags of photos."""

CALIBRATED_FOCAL = 0.002
"""Relative sigma of the focal length by an ordinary calibration (the published calibration of a
Phantom 3 by 30 photos has 0.15 % of fy)."""

_SAME_SHAPE = 0.01  # of width / height
_CONTRADICTION = 0.12  # of two focal lengths: more than a strip of a sensor, or a rounded one


@dataclass(frozen=True, eq=False)
class _Source:
    """Parameters of a camera, their source in words, and their errors."""

    parameters: Floats
    words: str
    errors: AssumedErrors


def assume_camera(
    tags: CameraTags, table: tuple[DroneCamera, ...], *, may_be_unknown: bool = False
) -> tuple[Calibration, tuple[Message, ...]]:
    """Assume a camera from the tags of a photo.

    Parameters
    ----------
    tags
        Tags of one photo.
    table
        Known drone cameras.
    may_be_unknown
        Whether an ordinary drone camera is assumed where the tags are insufficient.

    Returns
    -------
    calibration
        Brown model, with the covariance of its source.
    messages
        The source, and the gain of a calibration.

    Raises
    ------
    InputError
        The camera is unknown, or the photo was taken with digital zoom, and `may_be_unknown` is
        false; or it has a fisheye lens, which an ordinary camera cannot replace.
    """
    is_fisheye = _is_fisheye(tags, table)
    source = _factory(tags)
    if source is None and not is_fisheye:
        source = _from_sensor(tags, _from_table(tags, table) or _from_equivalent(tags))
    if source is not None:
        return _calibration(tags, source), (_report_assumed_camera(tags, source),)
    why = _explain_unknown_camera(tags, table)
    if is_fisheye or not may_be_unknown:
        or_not = "" if is_fisheye else f"; {WITHOUT}"
        raise InputError(tags.path, f"{why}: {REMEDY}{or_not}")
    source = _ordinary(tags)
    camera = replace(_calibration(tags, source), is_unknown=True)
    return camera, (_report_unknown_camera(tags, source, why),)


def _calibration(tags: CameraTags, source: _Source) -> Calibration:
    return Calibration(
        name=tags.camera_name or "camera",
        model="brown",
        width_px=tags.width_px,
        height_px=tags.height_px,
        parameters=source.parameters,
        covariance=make_assumed_covariance(
            "brown", source.parameters, tags.width_px, source.errors
        ),
    )


def _report_assumed_camera(tags: CameraTags, source: _Source) -> Message:
    """Report the assumed camera, and the gain of a calibration."""
    focal_px, errors = source.parameters[0], source.errors
    text = (
        f"Camera {tags.camera_name or 'camera'!r} is assumed, not calibrated: {source.words}. "
        f"Focal length {focal_px:.0f} ± {errors.focal * focal_px:.0f} px "
        f"({100 * errors.focal:.1f} %), principal point ± {errors.centre * tags.width_px:.0f} px; "
        f"with a calibration the focal length would be known to about "
        f"{100 * CALIBRATED_FOCAL:.1f} %: photograph a chessboard, 15 times or more, and run "
        "`uavgram calibrate PHOTOS --board chessboard:9x6:25mm`."
    )
    return Message("warning", ASSUMED_CAMERA, text)


def _report_unknown_camera(tags: CameraTags, source: _Source, why: str) -> Message:
    """Report the assumptions on an unknown camera, their consequences, and the action."""
    focal_px, errors = source.parameters[0], source.errors
    text = (
        f"Nothing is known of this camera: the first photo {why}. {source.words} is assumed, with "
        f"a focal length of {focal_px:.0f} ± {errors.focal * focal_px:.0f} px "
        f"({100 * errors.focal:.0f} %) and errors of the lens of up to "
        f"± {_corner_sigma_px(tags, source):.0f} px at the corners of a photo. A length from one "
        f"photo alone is as uncertain, ± {100 * errors.focal:.0f} %. The ± of each measurement "
        "includes this, but for a telephoto, zoom or fisheye lens the numbers are wrong. Tape six "
        "lengths or more. To do better, photograph a chessboard 15 times with this camera, and "
        "calibrate it from these photos."
    )
    return Message("warning", UNKNOWN_CAMERA, text)


def _corner_sigma_px(tags: CameraTags, source: _Source) -> float:
    """Compute the effect of the assumed errors of the radial distortion at the image's corners."""
    focal_px = source.parameters[0]
    radius = math.hypot(tags.width_px, tags.height_px) / (2 * focal_px)
    terms = (sigma * radius**k for k, sigma in zip((3, 5, 7), source.errors.radial, strict=True))
    return float(focal_px * math.hypot(*terms))


def _centre(tags: CameraTags) -> list[float]:
    return [(tags.width_px - 1) / 2, (tags.height_px - 1) / 2]


def _factory(tags: CameraTags) -> _Source | None:
    """Return the maker's calibration of the individual lens.

    The camera matrix is [fx 0 width / 2 + cx; 0 fy height / 2 + cy; 0 0 1] for OpenCV's undistort
    (DJI, Mavic 3M Image Processing Guide 2023, page 9, step 2).
    """
    if not tags.dewarp:
        return None
    fx, fy, cx, cy, *lens = tags.dewarp
    words = "the maker's calibration in the photo (DewarpData)"
    if tags.dewarped:
        lens = [0.0] * 5
        words += "; by its own data the photo is already free of distortion"
    parameters = np.array([fx, fy, tags.width_px / 2 + cx, tags.height_px / 2 + cy, *lens])
    return _Source(parameters, words, FACTORY)


def _from_table(tags: CameraTags, table: tuple[DroneCamera, ...]) -> _Source | None:
    """Compute the focal length from EXIF and the table's pixel size, with the table's distortion.

    For cameras with a perspective lens only.
    """
    camera = find_camera(tags, table)
    if camera is None or tags.digital_zoom > 1:
        return None
    focal_mm = tags.focal_mm if math.isfinite(tags.focal_mm) else camera.focal_mm
    if math.isnan(focal_mm):
        return None
    reduction = tags.width_px / camera.width_px
    focal_px = [focal_mm / pitch * reduction for pitch in camera.pitch_mm]
    parameters = np.array([*focal_px, *_centre(tags), *camera.distortion])
    # Whether the camera has removed the distortion from its photos is not known.
    k1, k2, k3 = np.hypot(DRONE_TABLE.radial, camera.distortion[[0, 1, 4]]).tolist()
    errors = replace(DRONE_TABLE, radial=(k1, k2, k3))
    if math.isfinite(tags.focal_step_mm):  # the step's own error is uniform
        rounding = tags.focal_step_mm / focal_mm / math.sqrt(12)
        errors = replace(errors, focal=math.hypot(errors.focal, rounding))
    words = f"the table of drone cameras ({camera.comment}) with {focal_mm:g} mm"
    shape = camera.width_px / camera.height_px
    if abs(tags.width_px / tags.height_px / shape - 1) > _SAME_SHAPE:
        errors = _widen_for_cropping(errors)
        words += (
            f"; the photo is no whole {camera.width_px} x {camera.height_px} frame of its sensor, "
            "and the width of its strip is unknown"
        )
    if not camera.distortion.any() or _folds_in_view(parameters, tags):
        parameters[4:] = 0.0
        errors = replace(errors, radial=UNKNOWN_RADIAL_SIGMAS)
        words += "; its distortion is unknown"
    return _Source(parameters, words, errors)


def find_camera(tags: CameraTags, table: tuple[DroneCamera, ...]) -> DroneCamera | None:
    """Find a photo's camera in the table; of a colour and a thermal one, the nearer in size."""
    name = make_key(tags.make + tags.model)
    named = [camera for camera in table if name and make_key(camera.make_model) == name]
    return min(named, key=lambda c: abs(math.log(c.width_px / tags.width_px)), default=None)


def make_key(name: str) -> str:
    """Return the letters of a camera's name, without spaces and case."""
    return "".join(name.split()).casefold()


def _widen_for_cropping(errors: AssumedErrors) -> AssumedErrors:
    return replace(errors, focal=CROPPED_FOCAL_SIGMA, centre=CROPPED_CENTRE_SIGMA)


def _folds_in_view(parameters: Floats, tags: CameraTags) -> bool:
    """Return whether the distortion folds back inside the image, outside the range of its fit."""
    corner = np.hypot(tags.width_px, tags.height_px) / (2 * parameters[0])
    return bool(largest_radius("brown", parameters) < corner)


def _from_equivalent(tags: CameraTags) -> _Source | None:
    """Use the 35 mm equivalent of EXIF; its distortion is unknown."""
    if math.isnan(tags.focal_35mm_mm) or tags.digital_zoom > 1:
        return None
    errors = replace(DRONE_TABLE, focal=EQUIVALENT_FOCAL_SIGMA, radial=UNKNOWN_RADIAL_SIGMAS)
    words = f"the 35 mm equivalent in EXIF ({tags.focal_35mm_mm:g} mm); its distortion is unknown"
    if is_strip(tags):
        errors = _widen_for_cropping(errors)
        words += ", and so is how wide a strip of the sensor the photo is"
    return _Source(_pinhole(tags, equivalent_focal_px(tags, tags.focal_35mm_mm)), words, errors)


def _from_sensor(tags: CameraTags, other: _Source | None) -> _Source | None:
    """Compute the focal length by the sensor's resolution; the rest is from the other source.

    A copy whose EXIF states its own size as the original's cannot be detected from EXIF alone: the
    focal length must agree with the other source; without one, the original's size must be stated.
    """
    focal_px, apart = focal_plane_px(tags)
    if math.isnan(focal_px):
        return other
    if other is None and not all(map(math.isfinite, tags.original_px)):
        return None
    if other is not None and abs(focal_px / other.parameters[0] - 1) > _CONTRADICTION:
        but = f"{other.words}; FocalPlaneXResolution in EXIF contradicts that ({focal_px:.0f} px)"
        return replace(other, words=f"{but} and was not used: a copy of another size?")
    rounding = tags.focal_step_mm / tags.focal_mm / math.sqrt(12)
    focal = math.hypot(FOCAL_PLANE_SIGMA, apart, 0.0 if math.isnan(rounding) else rounding)
    words = f"FocalPlaneXResolution in EXIF with {tags.focal_mm:g} mm"
    parameters = _pinhole(tags, focal_px)
    errors = replace(DRONE_TABLE, focal=focal, radial=UNKNOWN_RADIAL_SIGMAS)
    if other is not None and other.parameters[4:].any():
        parameters[4:], errors = other.parameters[4:], replace(other.errors, focal=focal)
        words += ", and the distortion of the table of drone cameras"
    else:
        words += "; its distortion is unknown"
    return _Source(parameters, words, errors)


def _ordinary(tags: CameraTags) -> _Source:
    """Return an average drone camera; the used width of its sensor is unknown."""
    logarithm = np.log(list(ORDINARY_EQUIVALENTS_MM.values()))
    spread = float(np.std(logarithm, ddof=1))
    equivalent_mm = math.exp(np.mean(logarithm)) * tags.digital_zoom
    errors = _widen_for_cropping(replace(DRONE_TABLE, radial=UNKNOWN_RADIAL_SIGMAS))
    errors = replace(
        errors,
        focal=math.hypot(errors.focal, spread),
        centre=errors.centre * tags.digital_zoom,
    )
    words = f"An ordinary drone camera of {equivalent_mm:.0f} mm (35 mm equivalent)"
    return _Source(_pinhole(tags, equivalent_focal_px(tags, equivalent_mm)), words, errors)


def _pinhole(tags: CameraTags, focal_px: float) -> Floats:
    """Return parameters (9,) without distortion."""
    return np.array([focal_px, focal_px, *_centre(tags), 0.0, 0.0, 0.0, 0.0, 0.0])


def _is_fisheye(tags: CameraTags, table: tuple[DroneCamera, ...]) -> bool:
    camera = find_camera(tags, table)
    return camera is not None and not camera.is_perspective


def _explain_unknown_camera(tags: CameraTags, table: tuple[DroneCamera, ...]) -> str:
    if _is_fisheye(tags, table):
        return (
            f"was taken with a fisheye lens ({tags.camera_name}), of which nothing can be assumed"
        )
    if tags.digital_zoom > 1:
        return f"was taken with digital zoom ({tags.digital_zoom:g} times)"
    if not tags.camera_name:
        return "does not name its camera"
    return (
        f"was taken with {tags.camera_name!r}, and does not state a focal length that can be used"
    )


CONTRADICTION_SIGMAS = 3.0
"""Prior sigmas above which a parameter's shift contradicts the calibration."""


def report_learnt_camera(camera: CameraUpdate, *, is_assumed: bool = False) -> tuple[Message, ...]:
    """Report which parameters the survey determines better than the calibration, and which not.

    Parameters
    ----------
    camera
        Camera before and after.
    is_assumed
        Whether the camera is not calibrated: its values and sigmas before are a guess.

    Returns
    -------
    One message; a second one, a warning, where the survey contradicts the calibration; none where
    the calibration holds every parameter fixed.
    """
    if np.isnan(camera.ratio).all():
        return ()
    source = "the program assumed" if is_assumed else "its calibration states"
    # Of the parameters of each part, the one that improved or moved most.
    gains, shifts = dict[str, float](), dict[str, float]()
    every = [describe_part(name) for name in camera.names]
    for i in np.flatnonzero(camera.learnt).tolist():
        part = every[i]
        gains[part] = max(1 / float(camera.ratio[i]), gains.get(part, 0.0))
        shifts[part] = max(abs(float(camera.shift[i])), shifts.get(part, 0.0))
    tried = np.flatnonzero(~np.isnan(camera.ratio)).tolist()
    rest = join_names(f"the {every[i]}" for i in tried if every[i] not in gains)
    if not gains:
        text = (
            f"Picks and lengths do not show {rest} of the camera better than {source}. The "
            "results use these values; no action is needed."
        )
        return (Message("info", "camera-not-learnt", text),)
    better = join_names(f"the {part} {gain:.1f} times as exactly" for part, gain in gains.items())
    text = (
        f"Picks and lengths show the camera better than {source}: {better}. The results use the "
        f"better values; no action is needed.{f' They do not show {rest} better.' if rest else ''}"
    )
    messages = [Message("info", "camera-learnt", text)]
    far = {part: shift for part, shift in shifts.items() if shift > CONTRADICTION_SIGMAS}
    if far:
        moved = join_names(
            f"the {part} by {shift:.1f} times its uncertainty" for part, shift in far.items()
        )
        text = _describe_contradiction(moved, is_assumed=is_assumed)
        messages.append(Message("warning", "camera-contradicted", text))
    return tuple(messages)


def _describe_contradiction(moved: str, *, is_assumed: bool) -> str:
    if is_assumed:
        return (
            f"Picks and lengths fit only another camera than the program assumed ({moved}): "
            "another kind of camera, a zoom or a cropped photo, or gross errors in picks and "
            "lengths. Check these, and calibrate the camera."
        )
    return (
        f"Picks and lengths fit only another camera than the calibrated one ({moved}): another "
        "camera, resolution, zoom or focus, or gross errors in picks and lengths. Check these, and "
        "calibrate the camera as it was used."
    )
