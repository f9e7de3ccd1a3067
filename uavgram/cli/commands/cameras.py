"""Commands on cameras: `uavgram camera` and `uavgram calibrate`."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Decimal, Flag, Json, app
from uavgram.cli.terminal import print_json, print_lines, print_written_files, progress
from uavgram.errors import InputError

if TYPE_CHECKING:
    from uavgram.pipeline.cameras import CameraRead

_SIZE = re.compile(r"([1-9]\d*)x([1-9]\d*)")
_PART = re.compile(r"(\d+),(\d+),([1-9]\d*)x([1-9]\d*)")


def _is_size(_type: object, value: str | None) -> None:
    if value is not None and not _SIZE.fullmatch(value):
        raise ValueError("must be WIDTHxHEIGHT in pixels, such as 2000x1500")


def _is_part(_type: object, value: str | None) -> None:
    if value is not None and not _PART.fullmatch(value):
        raise ValueError("must be LEFT,TOP,WIDTHxHEIGHT in pixels, such as 0,375,4000x2250")


@app.command
def camera(
    file: Path,
    /,
    *,
    name: Annotated[str | None, Parameter(name="--camera")] = None,
    crop: Annotated[str | None, Parameter(validator=_is_part)] = None,
    size: Annotated[str | None, Parameter(validator=_is_size)] = None,
    compare: Path | None = None,
    to: Literal["uavgram", "opencv", "colmap"] | None = None,
    output: Path | None = None,
    json: Json = False,
) -> int:
    """Show a camera, convert it for another program or image size, or compare it with another.

    Parameters
    ----------
    file
        camera.yaml, a calibration of OpenCV, cameras.txt of COLMAP, cameras.json of OpenDroneMap,
        or a photo (its tags).
    name
        Name of the camera, where the file holds several.
    crop
        LEFT,TOP,WIDTHxHEIGHT: the camera of photos that are this part of the whole ones.
    size
        WIDTHxHEIGHT: the camera of photos that were resized to this; after cropping.
    compare
        Another camera of the same image size: differences of its projections.
    to
        Convert for uavgram, opencv or colmap; without --output to the terminal.
    output
        File to write.
    json
        Print a JSON object instead of text: of the camera, or of the differences of the other one's
        projections.
    """
    from uavgram.cli.json_objects import camera_object
    from uavgram.pipeline.cameras import format_camera, read_camera, write_camera
    from uavgram.views.terminal import message_lines

    read = read_camera(file, name)
    changed = _convert(read, crop, size)
    if to is None and output is None:
        if compare is not None:
            _compare(changed, compare, json=json)
        elif json:
            print_json(camera_object(changed))
        else:
            print_lines(*_show(changed))
        return DONE
    if json:
        raise InputError("--json", "describes a camera: leave out --to and --output")
    form = "uavgram" if to is None else to
    options = {key: value for key, value in (("crop", crop), ("size", size)) if value is not None}
    if output is None:
        print_lines(format_camera(changed, form, options).rstrip("\n"))
        return DONE
    write_camera(output, changed, form, options)
    print_lines(*message_lines(changed.messages), f"written: {output}")
    if form == "colmap":
        print_lines("info: COLMAP's file has no place for the covariance: keep the original too.")
    return DONE


def _convert(read: CameraRead, crop: str | None, size: str | None) -> CameraRead:
    from uavgram.geometry.camera.properties import crop_calibration, scale_calibration

    calibration = read.calibration
    if crop is not None:
        left, top, width, height = map(int, re.split("[,x]", crop))
        try:
            calibration = crop_calibration(calibration, left, top, width, height)
        except ValueError as fault:
            raise InputError(read.path, f"--crop: {fault}") from fault
    if size is not None:
        width, height = map(int, size.split("x"))
        calibration = scale_calibration(calibration, width, height)
    return replace(read, calibration=calibration)


def _show(read: CameraRead) -> list[str]:
    from uavgram.geometry.camera.properties import compute_camera_properties
    from uavgram.pipeline.cameras import focal_on_sensor_mm
    from uavgram.views.calibration.report import camera_lines
    from uavgram.views.terminal import message_lines

    lines = camera_lines(
        read.calibration,
        compute_camera_properties(read.calibration),
        read.provenance,
        focal_on_sensor_mm(read),
    )
    notes = message_lines(read.messages)
    return [*lines, *([""] if notes else []), *notes]


def _compare(first: CameraRead, other: Path, *, json: bool) -> None:
    from uavgram.cli.json_objects import difference_object
    from uavgram.estimation.calibration.projection import compare_cameras
    from uavgram.pipeline.cameras import read_camera
    from uavgram.views.calibration.report import difference_lines
    from uavgram.views.terminal import message_lines

    second = read_camera(other)
    difference = compare_cameras(first.calibration, second.calibration)
    if json:
        print_json(difference_object(first, second, difference))
        return
    lines = difference_lines(first.calibration, second.calibration, difference)
    notes = message_lines((*first.messages, *second.messages))
    print_lines(*lines, *([""] if notes else []), *notes)


Model = Literal["brown", "fisheye"]
Coefficients = Literal["auto", "3", "4", "5", "8"]
Share = Annotated[Decimal, Parameter(validator=validators.Number(gt=0, lt=1))]


@app.command
def calibrate(  # noqa: PLR0913  (one for each option)
    images: Annotated[tuple[str, ...], Parameter(negative=())],
    /,
    *,
    board: str,
    output: Path | None = None,
    name: str | None = None,
    model: Model = "brown",
    coefficients: Coefficients = "auto",
    fix_aspect: Flag = False,
    fix_principal_point: Flag = False,
    bow: Literal["flat", "bowl", "paraboloid"] = "flat",
    prior: Literal["none", "exif"] = "none",
    outliers: Literal["report", "remove"] = "report",
    significance: Share = 0.001,
) -> int:
    """Calibrate a camera from photos of a board: camera.yaml with its covariance, and a report.

    Parameters
    ----------
    images
        Photos of the board, or patterns of their names: 15 to 30, the board tilted to all sides,
        half of them with the camera rolled by a quarter turn, in all corners of the image.
    board
        chessboard:9x6:25mm (inner corners; side of a square) or charuco:8x6:30mm:22mm:DICT_5X5_100
        (squares; sides of a square and of a marker; dictionary).
    output
        Folder of the results; by default `calibration`.
    name
        Name of the camera; by default the one in EXIF.
    model
        Lens model.
    coefficients
        Distortion coefficients: 3 (k1 k2 k3), 5 (and p1 p2) or 8 (rational); fisheye has 4. auto:
        the fewest that predict photos left out.
    fix_aspect
        Pixels are square: fx = fy.
    fix_principal_point
        Fix it in the middle of the image.
    bow
        Estimate the shape of a board that is not flat.
    prior
        exif: focal length and principal point by EXIF and the table of drone cameras take part.
    outliers
        Report corners and photos that do not fit, or remove them one at a time.
    significance
        Probability of a false suspicion in photos without outliers.
    """
    from uavgram.model.board import CalibrationOptions
    from uavgram.pipeline.calibrate import FOLDER
    from uavgram.pipeline.calibrate import calibrate as make
    from uavgram.views.calibration.report import calibration_lines

    options = CalibrationOptions(
        model=model,
        coefficients=_count(model, coefficients),
        aspect=1.0 if fix_aspect else None,
        fixed_principal_point=fix_principal_point,
        bow=bow,
        outliers=outliers,
        significance=significance,
    )
    folder = Path(FOLDER) if output is None else output
    done = make(images, board, folder, options, prior=prior, name=name, progress=progress())
    print_lines(*calibration_lines(done.account))
    print_written_files(done.folder, done.files)
    return DONE


def _count(model: Model, coefficients: Coefficients) -> int:
    """Return the number of distortion coefficients, 0 for automatic; check it for the model."""
    if coefficients == "auto":
        return 0
    count = int(coefficients)
    allowed = (3, 5, 8) if model == "brown" else (4,)
    if count not in allowed:
        words = " or ".join(map(str, allowed))
        raise InputError("--coefficients", f"a {model} lens has {words} of them, not {count}")
    return count
