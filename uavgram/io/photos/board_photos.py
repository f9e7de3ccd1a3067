"""Photo files of a calibration board: search, checks, and grey values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import decode_photo
from uavgram.input_files import read_bytes
from uavgram.io.digest import digest_inputs
from uavgram.io.photos.camera_tags import read_all_camera_tags
from uavgram.io.photos.files import find_matching_files
from uavgram.model.camera.board import LensSetting
from uavgram.model.camera.tags import CameraTags
from uavgram.model.provenance import InputDigest

LEAST_PHOTOS = 3  # of a plane: two hardly separate principal point and focal length
_SAME_FOCAL = 0.005  # relative difference: EXIF rounds


@dataclass(frozen=True, kw_only=True)
class CalibrationFiles:
    """Photos of one camera, all of one size, in the order of their names.

    Attributes
    ----------
    path
        (M,) files.
    width_px, height_px
        Size of the stored, unrotated photos.
    setting
        (M,) lens settings from EXIF.
    digest
        (M,) chain of custody.
    """

    path: tuple[str, ...]
    width_px: int
    height_px: int
    setting: tuple[LensSetting, ...]
    digest: tuple[InputDigest, ...]


def find_calibration_photos(patterns: Sequence[str]) -> CalibrationFiles:
    """Find photos, and check that they can be of one camera.

    Parameters
    ----------
    patterns
        File names or patterns.

    Raises
    ------
    InputError
        A pattern matches nothing, there are too few photos, one is not a photo or is a copy of
        another, or they differ in size, camera, lens or focal length.
    """
    paths = sorted({name for pattern in patterns for name in _files(pattern)})
    if len(paths) < LEAST_PHOTOS:
        raise InputError(
            paths[0] if paths else "IMAGES",
            f"{len(paths)} of the {LEAST_PHOTOS} photos that a calibration needs; better are 15 to "
            "30, with the board tilted in different directions and the camera also turned by 90 "
            "degrees",
        )
    digests = digest_inputs(paths)
    _refuse_copies(digests)
    tags = read_all_camera_tags(paths)
    for other in tags[1:]:
        _refuse_difference(tags[0], other)
    return CalibrationFiles(
        path=tuple(paths),
        width_px=tags[0].width_px,
        height_px=tags[0].height_px,
        setting=tuple(map(_setting, tags)),
        digest=digests,
    )


_GREY = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}


def read_grey(path: str | Path, reduction: int = 1) -> NDArray[np.uint8]:
    """Read grey values (height, width) of a photo as stored: EXIF rotation is not applied.

    Parameters
    ----------
    path
        File of the photo.
    reduction
        Original pixels per pixel each way: 1, 2, 4 or 8.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    return decode_photo(path, read_bytes(path), _GREY[reduction])


def _files(pattern: str) -> list[str]:
    return [str(path) for path in find_matching_files(pattern, "name the photos of the board")]


def _refuse_copies(digests: Sequence[InputDigest]) -> None:
    first: dict[str, str] = {}
    for digest in digests:
        other = first.setdefault(digest.sha256, digest.path)
        if other != digest.path:
            raise InputError(
                digest.path,
                f"is a copy of {other}: a photo counts once, leave one of the two out",
            )


def _refuse_difference(first: CameraTags, other: CameraTags) -> None:
    one, two = (f"{tags.width_px} x {tags.height_px}" for tags in (first, other))
    name = Path(first.path).name
    if one != two:
        raise InputError(
            other.path,
            f"has {two} pixels, but {name} has {one}: a calibration is of one size; leave the "
            "others out, or calibrate each size by itself",
        )
    facts = (
        ("camera", first.camera_name, other.camera_name),
        ("serial number", first.serial, other.serial),
    )
    for what, wanted, found in facts:
        if wanted and found and wanted != found:
            raise InputError(
                other.path,
                f"was taken by another camera than {name} ({what} {found!r}, not {wanted!r}): "
                "calibrate each camera by itself",
            )
    if abs(other.focal_mm - first.focal_mm) > _SAME_FOCAL * first.focal_mm:  # False for NaN
        raise InputError(
            other.path,
            f"was taken at a focal length of {other.focal_mm:g} mm, but {name} at "
            f"{first.focal_mm:g} mm: calibrate each zoom by itself",
        )


def _setting(tags: CameraTags) -> LensSetting:
    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return LensSetting(
        camera=tags.camera_name,
        focal_length_mm=known(tags.focal_mm),
        focal_length_35mm=known(tags.focal_35mm_mm),
        focus_distance_m=known(tags.focus_m),
    )
