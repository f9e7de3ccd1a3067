"""Every input of a project, read and checked against the others."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from uavgram.config.camera import load_camera
from uavgram.config.project import load_project
from uavgram.errors import InputError
from uavgram.geometry.back_projection import share_without_rays
from uavgram.io.digest import digest_inputs
from uavgram.io.flight_log import read_flight_log
from uavgram.io.known_points import read_known_points
from uavgram.io.lines import read_lines
from uavgram.io.measure import read_measure
from uavgram.io.opencv_calibration import is_opencv_calibration, read_opencv_calibration
from uavgram.io.photo_poses import FROM_PHOTOS, read_photo_poses
from uavgram.io.photo_tags import first_maker
from uavgram.io.photos import read_photos
from uavgram.io.picks import read_picks
from uavgram.model.camera import Calibration
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.observations import KnownLines, KnownPoints, MeasurementRequest, Picks
from uavgram.model.options import Project
from uavgram.model.photo_poses import PhotoPoses
from uavgram.model.result import InputDigest
from uavgram.model.telemetry import FlightLog

NO_LINES = KnownLines(
    name=(),
    start=(),
    end=(),
    length_m=np.empty(0),
    sigma_m=np.empty(0),
    adjust=np.empty(0, dtype=np.bool_),
)
NO_POINTS = KnownPoints(
    label=(), kind="local", coordinates=np.empty((0, 3)), sigma_m=np.empty((0, 3))
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """Everything that a project names, as read.

    `digests` is the chain of custody: every file that was read, the project file first.
    """

    project_path: str
    project: Project
    calibration: Calibration
    photos: Photos
    picks: Picks
    lines: KnownLines
    requests: tuple[MeasurementRequest, ...]
    control: KnownPoints
    check: KnownPoints
    log: FlightLog | None
    poses: PhotoPoses | None
    digests: tuple[InputDigest, ...]
    messages: tuple[Message, ...]


def read_inputs(path: Path) -> Inputs:
    """Read and validate every input of a project; run nothing.

    Raises
    ------
    InputError
        The first problem found, with file, line, frame or label.
    """
    project = load_project(path)
    calibration, messages = _camera(Path(project.camera))
    picks = read_picks(project.picks)
    lines = read_lines(project.lines) if project.lines else NO_LINES
    requests = read_measure(project.measure) if project.measure else ()
    control = read_known_points(project.control) if project.control else NO_POINTS
    check = read_known_points(project.check) if project.check else NO_POINTS
    photos, photo_messages = read_photos(project.images, project.time)
    _check_sizes(project, calibration, photos)
    _check_picks(project, picks, photos)
    log = read_flight_log(project.log) if project.log else None
    poses, pose_messages = _poses(project, photos)
    notes = () if log is None else _log_notes(log)
    pose_file = None if project.poses == FROM_PHOTOS else project.poses
    named = (project.camera, project.picks, project.log, pose_file, project.lines, project.measure)
    files = [str(path), *(f for f in (*named, project.control, project.check) if f), *photos.path]
    return Inputs(
        project_path=str(path),
        project=project,
        calibration=calibration,
        photos=photos,
        picks=picks,
        lines=lines,
        requests=requests,
        control=control,
        check=check,
        log=log,
        poses=poses,
        digests=digest_inputs(files, path.absolute().parent),
        messages=(*messages, *_lens_messages(calibration), *photo_messages, *pose_messages, *notes),
    )


def _log_notes(log: FlightLog) -> tuple[Message, ...]:
    name = Path(log.path).name
    return tuple(Message("warning", "log-note", f"{name}: {note}") for note in log.notes)


def _lens_messages(calibration: Calibration) -> tuple[Message, ...]:
    """Say so where part of the image has no rays: picks there cannot be used."""
    share = share_without_rays(
        calibration.model, calibration.parameters, calibration.width_px, calibration.height_px
    )
    if share == 0:
        return ()
    text = (
        f"The lens model of camera {calibration.name!r} cannot be inverted over {share:.1%} of the "
        "image, at its rim: picks there are left out."
    )
    return (Message("info", "lens-rim", text),)


def _camera(path: Path) -> tuple[Calibration, tuple[Message, ...]]:
    if is_opencv_calibration(path):
        return read_opencv_calibration(path)
    return load_camera(path), ()


def _poses(project: Project, photos: Photos) -> tuple[PhotoPoses | None, tuple[Message, ...]]:
    """Poses that the project names; where it names none, nor a log, a hint at those it could."""
    if project.poses is not None:
        return read_photo_poses(project.poses, photos, project.world.heights)
    maker = "" if project.log else first_maker(photos)
    if not maker:
        return None, ()
    text = (
        f"The photos carry poses ({maker}) that were not used: `poses: {FROM_PHOTOS}` in the "
        "project would use them."
    )
    return None, (Message("info", "poses-available", text),)


def _check_sizes(project: Project, calibration: Calibration, photos: Photos) -> None:
    width, height = calibration.width_px, calibration.height_px
    wrong = np.flatnonzero((photos.width_px != width) | (photos.height_px != height))
    if wrong.size:
        i = int(wrong[0])
        raise InputError(
            photos.path[i],
            f"is {photos.width_px[i]:.0f} x {photos.height_px[i]:.0f} px, but {project.camera} "
            f"describes {width} x {height} px ({wrong.size} of {len(photos.path)} photos differ): "
            "give the camera file of this camera and resolution, or leave these photos out",
        )


def _check_picks(project: Project, picks: Picks, photos: Photos) -> None:
    size = {name: k for k, name in enumerate(photos.frame_id)}
    for i, image in enumerate(picks.image):
        if image not in size:
            near = get_close_matches(image, photos.frame_id, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise InputError(
                project.picks,
                f"the pick of {picks.label[i]!r} names the photo {image!r}, which is not among "
                f"the project's images{hint}",
            )
        u, v = picks.pixel_px[i]
        width, height = photos.width_px[size[image]], photos.height_px[size[image]]
        if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
            raise InputError(
                project.picks,
                f"the pick of {picks.label[i]!r} at ({u:g}, {v:g}) lies outside {image!r} "
                f"({width:.0f} x {height:.0f} px, original and unrotated)",
            )
