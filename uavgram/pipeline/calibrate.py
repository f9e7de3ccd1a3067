"""Calibrate a camera from photos of a board: named ones, or a folder near a project."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.config.board_text import parse_board
from uavgram.config.camera import camera_text
from uavgram.config.project import load_project
from uavgram.config.project_text import apply_settings
from uavgram.errors import InputError, UavgramError
from uavgram.estimation.calibration.problem import make_focal_and_center_prior
from uavgram.imaging.photos.preview import Preview, make_preview
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.boards import collect_observations, detect_in_photos, draw_board
from uavgram.imaging.targets.corners import Sighting
from uavgram.io.cameras import opencv_text, read_drone_cameras
from uavgram.io.files import check_no_originals
from uavgram.io.folders import PhotoFolder, find_photo_folders
from uavgram.io.outputs import replace_text, stage_output
from uavgram.io.photos.catalogue import (
    LEAST_PHOTOS,
    CalibrationFiles,
    find_calibration_photos,
    read_grey,
)
from uavgram.io.photos.metadata import read_camera_tags
from uavgram.io.results.command_json import write_calibration
from uavgram.model.board import (
    Board,
    BoardPhoto,
    CalibrationAccount,
    CalibrationOptions,
    CalibrationResult,
    LensSetting,
    PhotoReason,
)
from uavgram.model.camera import Calibration, CameraProvenance, CameraTags, OptionValue
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.pipeline.versions import package_versions, stamp
from uavgram.stages.calibrate.assessment import (
    add_common_error,
    common_error_message,
    describe_lens_effects,
    find_unexplained_error,
)
from uavgram.stages.calibrate.calibration import calibrate as estimate
from uavgram.stages.camera import assume_camera
from uavgram.stages.messages import order_messages
from uavgram.views.calibration.drawings import residual_factor, rows_by_photo
from uavgram.views.calibration.report import render_calibration_report

FOLDER = "calibration"
FOUND = "found"
CAMERA, OPENCV, NUMBERS = "camera.yaml", "opencv.yml", "calibration.json"
REPORT, RECORDING = "calibration.html", "calibration.rrd"
PACKAGES = ("numpy", "scipy", "opencv-python-headless")

PriorChoice = Literal["none", "exif"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationOutput:
    """Result of a calibration, and its files."""

    account: CalibrationAccount
    folder: Path
    files: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Detections:
    """Photos by unique names, and the boards found in them."""

    files: CalibrationFiles
    names: tuple[str, ...]
    sightings: tuple[Sighting, ...]
    previews: Mapping[str, Preview]


@limit_blas_threads
def calibrate(
    images: Sequence[str],
    board: str,
    output: str | os.PathLike[str] = FOLDER,
    options: CalibrationOptions | None = None,
    *,
    prior: PriorChoice = "none",
    name: str | None = None,
    progress: Progress = silent,
) -> CalibrationOutput:
    """Calibrate a camera from photos of a board.

    Parameters
    ----------
    images
        Photos, or patterns of their names.
    board
        As ``chessboard:9x6:25mm``; see `uavgram.config.board_text`.
    output
        Folder for the results.
    options
        Parameters to estimate, and method; its `prior` is set by the next parameter.
    prior
        ``exif``: focal length and principal point by EXIF and the table of drone cameras take part
        in the estimate.
    name
        Name of the camera; by default the one in EXIF.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve. Earlier results are untouched.
    """
    target = parse_board(board)
    files = find_calibration_photos(images)
    folder = Path(output).absolute()
    check_no_originals(folder / FOUND, files.path)
    tags = read_camera_tags(files.path[0])
    assumed = _assume_camera(tags, is_needed=prior == "exif")
    files = _fill_focal_length(files, assumed)
    options = CalibrationOptions() if options is None else options
    if prior == "exif" and assumed is not None:
        source = "EXIF and the table of drone cameras"
        known = make_focal_and_center_prior(assumed, options.model, source)
        options = replace(options, prior=known)
    seen = _detect_boards(files, target, progress)
    account = _account(seen, target, board, options, tags, name)
    with stage_output(folder, photos=files.path) as staging:
        written = _write(account, seen, staging, progress)
    return CalibrationOutput(account=account, folder=folder, files=written)


def _assume_camera(tags: CameraTags, *, is_needed: bool) -> Calibration | None:
    """Return the camera by tags and table; None where it is unknown.

    Raises
    ------
    InputError
        It is unknown, but needed.
    """
    try:
        return assume_camera(tags, read_drone_cameras())[0]
    except InputError as fault:
        if is_needed:
            raise InputError("--prior exif", str(fault)) from fault
        return None


def _fill_focal_length(files: CalibrationFiles, assumed: Calibration | None) -> CalibrationFiles:
    if assumed is None:
        return files
    focal_px = float(assumed.parameters[0])
    settings: list[LensSetting] = [replace(one, focal_length_px=focal_px) for one in files.setting]
    return replace(files, setting=tuple(settings))


def _detect_boards(files: CalibrationFiles, board: Board, progress: Progress) -> _Detections:
    """Detect the board in all photos, in parallel; each is decoded once."""
    names = _unique_names(files.path)
    previews: dict[str, Preview] = {}

    def load(path: str) -> Image:
        grey = read_grey(path)
        previews[path] = make_preview(grey)
        return grey

    found = detect_in_photos(files.path, board, load, os.cpu_count())
    sightings = tuple(progress(found, "looking for the board", len(names)))
    by_name = {name: previews[path] for name, path in zip(names, files.path, strict=True)}
    return _Detections(files, names, sightings, by_name)


def _unique_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Return unique names of the files, with as much of their folders as necessary."""
    names = tuple(Path(path).name for path in paths)
    if len(set(names)) == len(names):
        return names
    common = os.path.commonpath([Path(path).absolute().parent for path in paths])
    return tuple(Path(path).absolute().relative_to(common).as_posix() for path in paths)


def _account(
    seen: _Detections,
    board: Board,
    board_text: str,
    options: CalibrationOptions,
    tags: CameraTags,
    name: str | None,
) -> CalibrationAccount:
    files = seen.files
    observations, messages = collect_observations(
        board, seen.names, (files.width_px, files.height_px), files.setting, seen.sightings
    )
    name = name or tags.camera_name or "camera"
    result = estimate(observations, options, name)
    error_px = find_unexplained_error(result)
    if error_px:
        result = estimate(add_common_error(observations, error_px), options, name)
    return CalibrationAccount(
        result=result,
        provenance=_provenance(result, files, board_text, tags),
        packages=package_versions(PACKAGES),
        without_board=_list_photos_without_board(seen),
        common_error_px=error_px,
        effects=describe_lens_effects(result),
        messages=order_messages(*messages, *common_error_message(error_px), *result.messages),
    )


def _list_photos_without_board(seen: _Detections) -> tuple[PhotoReason, ...]:
    reasons: list[PhotoReason] = []
    for name, sighting in zip(seen.names, seen.sightings, strict=True):
        if sighting.is_other_board:
            reasons.append((name, "shows another board"))
        elif not len(sighting.corner):
            reasons.append((name, "no board was found"))
    return tuple(reasons)


def _provenance(
    result: CalibrationResult, files: CalibrationFiles, board: str, tags: CameraTags
) -> CameraProvenance:
    used = sum(status != "removed" for status in result.photos.status)
    quality = result.quality
    return CameraProvenance(
        **stamp(),
        source=f"calibrated from {used} photos of a board",
        inputs=files.digest,
        board=board,
        options=_option_values(result.options),
        variance_factor=quality.variance_factor,
        make=tags.make,
        camera_model=tags.model,
        focal_mm=None if np.isnan(tags.focal_mm) else tags.focal_mm,
        focus_m=None if np.isnan(tags.focus_m) else tags.focus_m,
    )


def _option_values(options: CalibrationOptions) -> dict[str, OptionValue]:
    return {
        "model": options.model,
        "coefficients": options.coefficients,
        "aspect": "estimated" if options.aspect is None else options.aspect,
        "fixed_principal_point": options.fixed_principal_point,
        "bow": options.bow,
        "corner_sigma": options.corner_sigma,
        "outliers": options.outliers,
        "significance": options.significance,
        "prior": "none" if options.prior is None else options.prior.source,
    }


def _write(
    account: CalibrationAccount, seen: _Detections, folder: Path, progress: Progress
) -> tuple[str, ...]:
    """Write all files; return their names, the camera first."""
    result, provenance = account.result, account.provenance
    camera = result.calibration
    pictures = _pictures(result, seen)
    writers: dict[str, Callable[[Path], object]] = {
        CAMERA: lambda path: path.write_text(camera_text(camera, provenance), encoding="utf-8"),
        OPENCV: lambda path: path.write_text(
            opencv_text(camera, provenance.created_utc), encoding="utf-8"
        ),
        NUMBERS: lambda path: write_calibration(account, path),
        REPORT: lambda path: path.write_text(
            render_calibration_report(account, pictures), encoding="utf-8"
        ),
        RECORDING: lambda path: _write_recording(account, seen.previews, path),
    }
    for name, write in progress(writers.items(), "writing", len(writers)):
        write(folder / name)
    (folder / FOUND).mkdir()
    for name, jpeg in pictures.items():
        (folder / FOUND / _picture_name(name)).write_bytes(jpeg)
    return (*writers, f"{FOUND}/ ({len(pictures)} pictures)")


def _write_recording(
    account: CalibrationAccount, previews: Mapping[str, Preview], path: Path
) -> None:
    # The viewer's library takes half a second and 30 MB to load.
    from uavgram.views.calibration.recording import write_calibration_recording  # noqa: PLC0415

    write_calibration_recording(account, previews, path)


def _pictures(result: CalibrationResult, seen: _Detections) -> dict[str, bytes]:
    """Draw the detected board in every photo, with residuals where it took part."""
    rows = rows_by_photo(result)
    factor = residual_factor(result)
    pictures = {}
    for name, sighting in zip(seen.names, seen.sightings, strict=True):
        used = rows.get(name)
        if used is None:
            corner, pixel, residual = sighting.corner, sighting.pixel_px, None
        else:
            corners = result.corners
            corner, pixel = corners.corner[used], corners.pixel_px[used]
            residual = corners.residual_px[used]
        photo = BoardPhoto(
            file=name,
            width_px=seen.files.width_px,
            height_px=seen.files.height_px,
            corner=corner,
            pixel_px=pixel,
            sigma_px=np.ones(len(corner)),
        )
        preview = seen.previews[name]
        pictures[name] = draw_board(preview, result.board, photo, residual, factor)
    return pictures


def _picture_name(photo: str) -> str:
    flat = photo.replace("/", "_")
    return flat if flat.lower().endswith((".jpg", ".jpeg")) else f"{flat}.jpg"


_NUMBERED = re.compile(rf"{FOLDER}(?:-(\d+))?")


def find_board_folders(project: Path) -> tuple[PhotoFolder, ...]:
    """Return folders near a project with enough photos for a calibration."""
    return find_photo_folders(project.absolute().parent, LEAST_PHOTOS)


def calibrate_folder(
    project: Path,
    folder: PhotoFolder,
    board: str,
    options: CalibrationOptions,
    progress: Progress = silent,
) -> CalibrationOutput:
    """Calibrate a camera from a folder's photos, into a new folder beside the project file.

    Parameters
    ----------
    project
        The project file.
    folder
        Folder with the photos of the board.
    board, options, progress
        As for `uavgram.pipeline.calibrate.calibrate`.

    Raises
    ------
    UavgramError
        A problem that the user can solve.
    """
    images = [glob.escape(str(file)) for file in folder.files]
    output = _free_folder(project.absolute().parent)
    return calibrate(images, board, output, options, progress=progress)


def use_camera(project: Path, camera: Path) -> None:
    """Set another camera file in a project; the rest of the file is unchanged.

    Raises
    ------
    UavgramError
        The file does not name its camera in a line of its own, or it cannot be written.
    """
    try:
        before = project.read_bytes().decode()  # unchanged line ends
    except OSError as fault:
        raise InputError(project, f"cannot be read: {fault.strerror}") from fault
    beside = project.absolute().parent
    name = camera.relative_to(beside).as_posix() if camera.is_relative_to(beside) else str(camera)
    after = apply_settings(before, {"camera": name})
    if after is None:
        raise InputError(project, f"does not name its camera in one line: write `camera: {name}`")
    replace_text(project, after)
    try:
        load_project(project, unfinished=True)
    except UavgramError:
        replace_text(project, before)
        raise


def _free_folder(beside: Path) -> Path:
    """Return a new folder: earlier calibrations are never overwritten."""
    numbers = [0]
    for path in beside.iterdir():
        match = _NUMBERED.fullmatch(path.name)
        if match:
            numbers.append(int(match[1] or 1))
    last = max(numbers)
    return beside / (f"{FOLDER}-{last + 1}" if last else FOLDER)
