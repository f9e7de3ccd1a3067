"""A calibration beside a project: from a folder of photos near it to a camera file of its own."""

from __future__ import annotations

import glob
import re
from pathlib import Path

from uavgram.config.project import load_project
from uavgram.config.project_text import with_settings
from uavgram.errors import InputError, UavgramError
from uavgram.io.discovery.photo_folders import PhotoFolder, folders_with_photos
from uavgram.io.outputs import replace_text
from uavgram.io.photos.board_photos import LEAST_PHOTOS
from uavgram.model.camera.board import CalibrationOptions
from uavgram.pipeline.cameras.calibrate import FOLDER, Calibrated, calibrate
from uavgram.pipeline.progress import Progress, silent

_NUMBERED = re.compile(rf"{FOLDER}(?:-(\d+))?")


def board_folders(project: Path) -> tuple[PhotoFolder, ...]:
    """Folders near a project that hold enough photos for a calibration."""
    return folders_with_photos(project.absolute().parent, LEAST_PHOTOS)


def calibrate_folder(
    project: Path,
    folder: PhotoFolder,
    board: str,
    options: CalibrationOptions,
    progress: Progress = silent,
) -> Calibrated:
    """Calibrate a camera from a folder's photos, into a new folder beside the project file.

    Parameters
    ----------
    project
        The project file.
    folder
        Holds the photos of the board.
    board, options, progress
        As of `uavgram.pipeline.cameras.calibrate.calibrate`.

    Raises
    ------
    UavgramError
        A problem that the user can solve.
    """
    images = [glob.escape(str(file)) for file in folder.files]
    output = _free_folder(project.absolute().parent)
    return calibrate(images, board, output, options, progress=progress)


def use_camera(project: Path, camera: Path) -> None:
    """Name another camera file in a project; everything else in it stays as it is.

    Raises
    ------
    UavgramError
        The file does not name its camera in a line of its own, or it cannot be written.
    """
    try:
        before = project.read_bytes().decode()  # as it is: line ends stay
    except OSError as fault:
        raise InputError(project, f"cannot be read: {fault.strerror}") from fault
    beside = project.absolute().parent
    name = camera.relative_to(beside).as_posix() if camera.is_relative_to(beside) else str(camera)
    after = with_settings(before, {"camera": name})
    if after is None:
        raise InputError(project, f"does not name its camera in one line: write `camera: {name}`")
    replace_text(project, after)
    try:
        load_project(project, unfinished=True)
    except UavgramError:
        replace_text(project, before)
        raise


def _free_folder(beside: Path) -> Path:
    """A folder that is not there yet: earlier calibrations are never written over."""
    numbers = [0]
    for path in beside.iterdir():
        match = _NUMBERED.fullmatch(path.name)
        if match:
            numbers.append(int(match[1] or 1))
    last = max(numbers)
    return beside / (f"{FOLDER}-{last + 1}" if last else FOLDER)
