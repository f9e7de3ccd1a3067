"""Read cameras from files of any program, by name, or from photos; write camera files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.config.camera import camera_text, load_camera_file
from uavgram.errors import InputError
from uavgram.input_files import UnusableFile, binary_kind, read_bytes
from uavgram.io import cameras
from uavgram.io.files import digest_file
from uavgram.io.logs.flight_log import is_flight_log
from uavgram.io.outputs import replace_text
from uavgram.io.photos.catalogue import UnusablePhotosError
from uavgram.io.photos.metadata import read_all_camera_tags, read_camera_tags
from uavgram.model.camera import (
    ORDINARY_EQUIVALENTS_MM,
    Calibration,
    CameraProvenance,
    CameraTags,
    OptionValue,
)
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.pipeline.versions import stamp
from uavgram.stages.camera import REMEDY, assume_camera, find_camera, make_key


def assume_drone_camera(name: str) -> Calibration | None:
    """Return the assumed calibration of a drone's main camera; None where it is unknown.

    Parameters
    ----------
    name
        Name of the drone (``DJI Mavic 2 Pro``) or of its camera (``L1D-20c``), as in the table.
    """
    known = [
        camera
        for camera in cameras.read_drone_cameras()
        if camera.make_model in ORDINARY_EQUIVALENTS_MM and not camera.is_thermal
    ]
    wanted = make_key(name)
    named = [one for one in known if wanted == make_key(one.make_model)] or [
        one for one in known if wanted and wanted in make_key(one.comment)
    ]
    if not named:
        return None
    # The shortest name of several, such as a Phantom 4 Pro beside its second version.
    camera = min(named, key=lambda one: len(one.comment))
    tags = CameraTags(
        path=name,
        width_px=camera.width_px,
        height_px=camera.height_px,
        model=camera.make_model,
        focal_35mm_mm=ORDINARY_EQUIVALENTS_MM[camera.make_model],
    )
    return assume_camera(tags, cameras.read_drone_cameras())[0]


CameraFormat = Literal["uavgram", "opencv", "colmap"]

NO_OPTIONS: Mapping[str, OptionValue] = {}
CAMERA_FILES = (
    "camera.yaml, a calibration of OpenCV, cameras.txt of COLMAP, cameras.json of OpenDroneMap, "
    "or a photo"
)
_PHOTOS = {".jpg", ".jpeg", ".dng", ".tif", ".tiff", ".png"}
# Focal lengths of one zoom setting, as EXIF rounds them.
_SAME_FOCAL = 0.005


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraRead:
    """Camera as read.

    Attributes
    ----------
    path
        The file, or the photo.
    calibration, messages
        The camera, and messages on it.
    provenance
        Provenance in the file; None where it has none.
    tags
        Camera tags of the photo; None where the camera comes from a file.
    """

    path: Path
    calibration: Calibration
    messages: tuple[Message, ...] = ()
    provenance: CameraProvenance | None = None
    tags: CameraTags | None = None


def read_camera(path: str | Path, wanted: str | None = None) -> CameraRead:
    """Read a camera: camera.yaml, OpenCV's, COLMAP's or OpenDroneMap's file, or a photo's tags.

    Parameters
    ----------
    path
        The file.
    wanted
        Name of the camera, where COLMAP's or OpenDroneMap's file holds several.

    Raises
    ------
    InputError
        The file is wrong, or holds several cameras, which the message lists.
    """
    path = Path(path)
    if path.suffix.lower() in _PHOTOS:
        _refuse(wanted, path)
        tags = read_camera_tags(path)
        calibration, messages = assume_camera(tags, cameras.read_drone_cameras())
        return CameraRead(path=path, calibration=calibration, messages=messages, tags=tags)
    if kind := "a flight log" if is_flight_log(path) else binary_kind(path):
        raise InputError(path, f"is {kind}: name {CAMERA_FILES}")
    text = read_bytes(path).decode("utf-8-sig", errors="replace")
    if cameras.is_odm_cameras(text):
        calibration, messages = cameras.read_odm_camera(path, wanted)
    elif cameras.is_colmap_cameras(text):
        calibration, messages = cameras.read_colmap_camera(path, wanted)
    elif cameras.is_opencv_calibration(path) or text.lstrip().startswith("<"):
        _refuse(wanted, path)
        calibration, messages = cameras.read_opencv_calibration(path)
    else:
        _refuse(wanted, path)
        calibration, provenance = load_camera_file(path)
        return CameraRead(path=path, calibration=calibration, provenance=provenance)
    return CameraRead(path=path, calibration=calibration, messages=messages)


def _refuse(wanted: str | None, path: Path) -> None:
    if wanted is not None:
        raise InputError(path, f"holds one camera: leave out --camera {wanted!r}")


def assume_photo_camera(
    photos: Photos, *, may_be_unknown: bool = False
) -> tuple[Calibration, tuple[Message, ...]]:
    """Assume the camera of a project's photos from their tags.

    Parameters
    ----------
    photos
        Photos of one camera.
    may_be_unknown
        Whether an ordinary drone camera is assumed where the tags are insufficient.

    Raises
    ------
    UnusablePhotosError
        Some photos come from another camera or zoom setting than most others.
    InputError
        The camera of the photos cannot be assumed.
    """
    kinds: list[list[CameraTags]] = []
    for tags in read_all_camera_tags(photos.path):
        own = next((kind for kind in kinds if not _difference(kind[0], tags)), None)
        if own is None:
            kinds.append([tags])
        else:
            own.append(tags)
    # Of as many photos turned as not, drones take the broad ones.
    most = max(kinds, key=lambda kind: (len(kind), kind[0].width_px > kind[0].height_px))
    if others := [tags for kind in kinds if kind is not most for tags in kind]:
        raise UnusablePhotosError(
            [UnusableFile(Path(tags.path), _difference(most[0], tags)) for tags in others]
        )
    return assume_camera(most[0], cameras.read_drone_cameras(), may_be_unknown=may_be_unknown)


def describe_size(size_px: tuple[int, int], usual_px: tuple[int, int]) -> str:
    """Describe the size of a photo that differs from the others, as a clause; empty if equal.

    Parameters
    ----------
    size_px
        Width and height of the photo.
    usual_px
        Those of the others.
    """
    if size_px == usual_px:
        return ""
    what = "is turned by 90 degrees" if size_px == usual_px[::-1] else "has another size"
    sizes = f"{size_px[0]} x {size_px[1]} px, the others {usual_px[0]} x {usual_px[1]}"
    return f"{what} ({sizes}): copy it from the camera once more"


def _difference(first: CameraTags, other: CameraTags) -> str:
    """Describe why a photo cannot share the camera of another; empty if it can."""
    sizes = (other.width_px, other.height_px), (first.width_px, first.height_px)
    if size := describe_size(*sizes):
        return size
    if first.camera_name and not other.camera_name:
        return (
            "does not state its camera, as the others do: another program saved it again, and may "
            "have turned or reduced it. Copy it from the camera once more"
        )
    if setting := _compare_settings(first, other):
        name = Path(first.path).name
        return f"{setting} {name}, so one assumed camera cannot serve both: {REMEDY}"
    return ""


def _compare_settings(first: CameraTags, other: CameraTags) -> str:
    """Describe a difference in camera, corrections or zoom, up to the first one's name."""
    if (other.camera_name, other.serial) != (first.camera_name, first.serial):
        return f"comes from another camera ({other.camera_name or 'unnamed'}) than"
    if other.dewarped != first.dewarped:
        return "differs by its DewarpFlag (distortion taken out or not) from"
    for name in ("focal_mm", "focal_35mm_mm", "digital_zoom"):
        have, want = getattr(other, name), getattr(first, name)
        if not np.isclose(have, want, rtol=_SAME_FOCAL, atol=0, equal_nan=True):
            return f"was taken at another focal length or zoom ({have:g}, not {want:g}) than"
    return ""


def format_camera(
    camera: CameraRead, form: CameraFormat, options: Mapping[str, OptionValue] = NO_OPTIONS
) -> str:
    """Return the text of a camera file for one program.

    Parameters
    ----------
    camera
        The camera; its `path` is the source file.
    form
        Format of the program.
    options
        Changes since, for its provenance.
    """
    if form == "colmap":
        return cameras.colmap_text(camera.calibration)
    provenance = _make_converted_provenance(camera, options)
    if form == "opencv":
        return cameras.opencv_text(camera.calibration, provenance.created_utc)
    return camera_text(camera.calibration, provenance)


def write_camera(
    path: Path,
    camera: CameraRead,
    form: CameraFormat,
    options: Mapping[str, OptionValue] = NO_OPTIONS,
) -> None:
    """Write a camera in one step; see `format_camera`.

    Parameters
    ----------
    path
        The file to write.
    camera
        The camera.
    form
        Format of the program.
    options
        Changes since.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is untouched.
    """
    replace_text(path, format_camera(camera, form, options))


def focal_on_sensor_mm(camera: CameraRead) -> float | None:
    """Return the focal length on the sensor by the table of drone cameras; None where unknown.

    For photos of the sensor's whole width.
    """
    calibration, tags = camera.calibration, camera.tags
    if tags is None and camera.provenance is not None:
        tags = CameraTags(
            path=str(camera.path),
            width_px=calibration.width_px,
            height_px=calibration.height_px,
            make=camera.provenance.make,
            model=camera.provenance.camera_model,
        )
    known = None if tags is None else find_camera(tags, cameras.read_drone_cameras())
    if known is None:
        return None
    sensor_width_mm = known.pitch_mm[0] * known.width_px
    return float(calibration.parameters[0] / calibration.width_px * sensor_width_mm)


def _make_converted_provenance(
    camera: CameraRead, options: Mapping[str, OptionValue]
) -> CameraProvenance:
    """Return the provenance of a converted camera, with that of its source."""
    made, inputs = stamp(), (digest_file(camera.path),)
    base = CameraProvenance(**made, source="converted", inputs=inputs, options=options)
    earlier, tags = camera.provenance, camera.tags
    if earlier is not None:
        return replace(
            earlier,
            **made,
            source=f"converted; before that, {earlier.source}",
            inputs=inputs,
            options={**earlier.options, **options},
        )
    if tags is None:
        return base
    return replace(
        base,
        source="assumed from the tags of a photo",
        make=tags.make,
        camera_model=tags.model,
        focal_mm=_or_none(tags.focal_mm),
        focus_m=_or_none(tags.focus_m),
    )


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value
