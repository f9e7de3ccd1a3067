"""Setup of a project before picking: content of a folder, and how photos and lengths were taken.

The settings are written into project.yaml, in the places where a person would write them.
"""

from __future__ import annotations

import glob
import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.config.project import load_project
from uavgram.config.project_text import Settings, apply_settings
from uavgram.errors import InputError, UavgramError
from uavgram.input_files import describe_files, is_unread_photo, read_text
from uavgram.io.folders import (
    MAX_LOG_BYTES,
    FolderContents,
    PhotoGroup,
    number_kinds,
    search_folder,
)
from uavgram.io.imports import GcpSigmas
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.outputs import replace_text
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.photos.pose_sources import FROM_PHOTOS, read_photo_poses
from uavgram.model.frames import PhotoPoses, Photos
from uavgram.model.naming import METRIC, SHORT_FORMS, Units
from uavgram.model.options import Auto, Project, TimeOptions
from uavgram.model.provenance import Case
from uavgram.pipeline.cameras import assume_photo_camera, read_camera
from uavgram.pipeline.import_picks import ControlFiles, import_picks
from uavgram.pipeline.new import (
    PROJECT,
    Choices,
    find_own_pattern,
    make_absolute,
    new_project,
    report_unusable,
)
from uavgram.stages.messages import order_messages

MAX_NAMES = 30
"""Largest number of files of a kind that are offered to a person."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Setup of photos and tape.

    Attributes
    ----------
    pitch_deg
        Pitch of a fixed camera: -90 looked straight down, 0 forward; ``auto``: as recorded by the
        drone.
    yaw_deg, roll_deg
        Yaw and roll of the optical axis on the drone; ``auto``: 0, or as recorded by the drone.
    reading_sigma_m
        Sigma of a reading of the tape.
    units
        Units for display.
    case
        Case for the head of the report.
    """

    pitch_deg: float | Auto = "auto"
    yaw_deg: float | Auto = "auto"
    roll_deg: float | Auto = "auto"
    reading_sigma_m: float = 0.01
    units: Units = METRIC
    case: Case = field(default_factory=Case)


@dataclass(frozen=True, kw_only=True)
class FoundPhotos:
    """Photos of one folder and size.

    Attributes
    ----------
    pattern
        Their pattern, relative to the folder of the search.
    names
        Their names where the pattern matches others too; else none.
    count, width_px, height_px, example
        Number, size, and the name of the first.
    camera
        Camera by the tags of the first; empty where it cannot be assumed.
    looks_deg
        Angle of the camera below the horizon by the first; None where not stated.
    has_position
        Whether the first states its position.
    kind
        Number of its kind: a project takes photos of one kind, of one size and each name once.
    """

    pattern: str
    names: tuple[str, ...]
    count: int
    width_px: int
    height_px: int
    example: str
    camera: str
    looks_deg: float | None
    has_position: bool
    kind: int


@dataclass(frozen=True, kw_only=True)
class FoundCamera:
    """Camera file, for photos of one size."""

    name: str
    width_px: int
    height_px: int


@dataclass(frozen=True, kw_only=True)
class FolderSummary:
    """Content of a folder for a project; names are relative to it.

    Attributes
    ----------
    has_project
        Whether it holds a project already.
    photos, cameras, logs, poses, gcp_lists, tables
        Usable files; with a project, `poses` are those that it names.
    unusable
        Messages on files with the names of photos, logs or tables that cannot be used.
    passed_over
        Description of files of other kinds; empty without any.
    setup
        Setup by the project, or the defaults.
    camera, log
        Camera and log by the project; None without one.
    has_gimbal
        Whether the log in the folder has the attitude of a gimbal; None if unknown: several logs,
        or one too large to be read for that.
    fault
        Reason why the existing project cannot be read; empty where it can.
    """

    has_project: bool
    photos: tuple[FoundPhotos, ...]
    cameras: tuple[FoundCamera, ...]
    logs: tuple[str, ...]
    poses: tuple[str, ...]
    gcp_lists: tuple[str, ...]
    tables: tuple[str, ...]
    unusable: tuple[str, ...]
    passed_over: str
    setup: Setup
    camera: str | None
    log: str | None
    has_gimbal: bool | None
    fault: str


@dataclass(frozen=True, kw_only=True)
class SetupChoices:
    """Choices of a person for a folder.

    Attributes
    ----------
    choices
        Files of a new project.
    setup
        Setup of photos and tape.
    gcp_list
        A gcp_list.txt to take points with known coordinates from; None: none.
    gcp_sigma_m
        Sigma of those coordinates.
    """

    choices: Choices
    setup: Setup
    gcp_list: str | None = None
    gcp_sigma_m: float = 0.02


def inspect_folder(folder: Path) -> FolderSummary:
    """Search a folder and its subfolders; nothing is written.

    Raises
    ------
    InputError
        It cannot be read, or holds too much for one flight.
    """
    folder = folder.absolute()
    holdings = search_folder(folder)
    project, fault = None, ""
    if (folder / PROJECT).exists():
        try:
            project = load_project(folder / PROJECT, unfinished=True)
        except UavgramError as why:
            fault = str(why)
    own = {folder / PROJECT}
    others = tuple(path for path in holdings.others if path not in own)
    tables = (path for several in holdings.tables.values() for path in several)
    gcp = tuple(path for path in holdings.gcp_lists if _names_a_photo(path, holdings))
    strange = (
        f"{name} is not used: it names none of the photos here."
        for name in _names(folder, tuple(p for p in holdings.gcp_lists if p not in gcp))
    )
    unusable = (one.text for one in order_messages(*report_unusable(folder, holdings)))
    used = {photo.stem for group in holdings.photos for photo in group.files}
    unread = {path for path in others if path.stem not in used and is_unread_photo(path)}
    return FolderSummary(
        has_project=(folder / PROJECT).exists(),
        photos=tuple(
            _photos(folder, group, holdings, kind)
            for group, kind in zip(
                holdings.photos[:MAX_NAMES], number_kinds(holdings.photos), strict=False
            )
        ),
        cameras=tuple(_cameras(folder, holdings)),
        logs=_names(folder, holdings.logs),
        poses=_poses(folder, holdings.poses, project),
        gcp_lists=_names(folder, gcp),
        tables=_names(folder, tuple(sorted(tables))),
        unusable=(*unusable, *strange, *filter(None, [describe_files(sorted(unread))])),
        passed_over=describe_files(path for path in others if path not in unread),
        setup=Setup() if project is None else read_setup(project),
        camera=None if project is None else _camera_of(folder, project),
        log=None if project is None or project.log is None else _inside(folder, project.log),
        has_gimbal=_has_gimbal(holdings.logs),
        fault=fault,
    )


def _names_a_photo(table: Path, holdings: FolderContents) -> bool:
    """Return whether a list of control points names one of the photos."""
    try:
        text = read_text(table, "save it as UTF-8")
    except InputError:
        return False
    return any(path.name in text for group in holdings.photos for path in group.files)


def _names(folder: Path, paths: tuple[Path, ...]) -> tuple[str, ...]:
    return tuple(path.relative_to(folder).as_posix() for path in paths[:MAX_NAMES])


def _poses(folder: Path, found: tuple[Path, ...], project: Project | None) -> tuple[str, ...]:
    if project is None:
        return _names(folder, found)
    return tuple(_inside(folder, one) for one in project.pose_sources if one != FROM_PHOTOS)


def _photos(folder: Path, group: PhotoGroup, holdings: FolderContents, kind: int) -> FoundPhotos:
    first = group.files[0]
    camera, poses = "", None
    try:
        photos, _ = read_photos(
            (make_absolute(folder, _pattern_of_one(folder, first)),), TimeOptions()
        )
        poses = _read_tagged_poses(photos)
        camera = assume_photo_camera(photos)[0].name
    except UavgramError:  # not stated, or reported when the project is made
        pass
    pattern = find_own_pattern(folder, group, holdings.photos)
    others = {path for other in holdings.photos if other is not group for path in other.files}
    is_own = others.isdisjoint(folder.glob(pattern))
    return FoundPhotos(
        pattern=pattern,
        names=() if is_own else tuple(_pattern_of_one(folder, file) for file in group.files),
        count=len(group.files),
        width_px=group.size_px[0],
        height_px=group.size_px[1],
        example=first.name,
        camera=camera,
        looks_deg=None if poses is None else _looks_deg(poses),
        has_position=poses is not None,
        kind=kind,
    )


def _pattern_of_one(folder: Path, file: Path) -> str:
    return glob.escape(file.relative_to(folder).as_posix())


def _read_tagged_poses(photos: Photos) -> PhotoPoses | None:
    try:
        return read_photo_poses(FROM_PHOTOS, photos, "msl")[0]
    except UavgramError:
        return None


def _looks_deg(poses: PhotoPoses) -> float | None:
    pitch = float(np.degrees(poses.ypr_rad[0, 1]))
    return -pitch if math.isfinite(pitch) else None


def _cameras(folder: Path, holdings: FolderContents) -> list[FoundCamera]:
    found = []
    for path in holdings.cameras[:MAX_NAMES]:
        try:
            camera = read_camera(path).calibration
        except UavgramError:
            continue
        name = path.relative_to(folder).as_posix()
        size = camera.width_px, camera.height_px
        found.append(FoundCamera(name=name, width_px=size[0], height_px=size[1]))
    return found


def _has_gimbal(logs: tuple[Path, ...]) -> bool | None:
    try:
        if len(logs) != 1 or logs[0].stat().st_size > MAX_LOG_BYTES:
            return None
        log = read_flight_log(logs[0], positions_needed=False)
    except (UavgramError, OSError):  # told of when it is used
        return None
    return any(boot.gimbal is not None for boot in log.boots)


def _camera_of(folder: Path, project: Project) -> str:
    return _inside(folder, project.camera)


def _inside(folder: Path, file: str) -> str:
    """Return the name of a file in a project of the folder."""
    path = Path(file)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else file


def read_setup(project: Project) -> Setup:
    """Return the setup by a project."""
    mount = project.mount
    fixed: float | Auto = mount.pitch_deg
    if mount.gimbal == "none" and fixed == "auto":
        fixed = -90.0
    return Setup(
        pitch_deg=fixed,
        yaw_deg=mount.yaw_deg,
        roll_deg=mount.roll_deg,
        reading_sigma_m=project.tape.reading_sigma_m,
        units=project.units,
        case=project.case,
    )


def set_up(folder: Path, wanted: SetupChoices) -> Path:
    """Write a project file for a folder, or change the existing one; return it.

    Raises
    ------
    UavgramError
        The photos cannot be used, or nothing can be written. A new project is removed then, and an
        existing one is unchanged.
    """
    folder = folder.absolute()
    path = folder / PROJECT
    is_new = not path.exists()
    if is_new:
        before = {one.name for one in folder.iterdir()}
        new_project(folder, wanted.choices)
        made = [one for one in folder.iterdir() if one.name not in before and one.is_file()]
    else:
        made = []
    try:
        change_setup(path, wanted.setup)
        if not is_new:
            _change_files(folder, path, wanted.choices)
        if wanted.gcp_list is not None:
            _import_points(folder, path, wanted)
    except BaseException:
        for one in made:
            one.unlink(missing_ok=True)
        raise
    return path


def change_setup(path: Path, setup: Setup) -> None:
    """Write changed settings into a project; the rest of the file is unchanged.

    Raises
    ------
    UavgramError
        The file cannot be changed in those places; the message names the settings.
    """
    _write(path, _changes(read_setup(load_project(path, unfinished=True)), setup))


def _changes(before: Setup, after: Setup) -> Settings:
    """Return the changes by section and key."""
    changes: dict[str, str | float | Mapping[str, str | float | None] | None] = {}
    angles = {
        name: getattr(after, name)
        for name in ("pitch_deg", "yaw_deg", "roll_deg")
        if getattr(after, name) != getattr(before, name)
    }
    if "pitch_deg" in angles:
        angles = {"gimbal": "auto" if after.pitch_deg == "auto" else "none", **angles}
    if angles:
        changes["mount"] = angles
    if after.reading_sigma_m != before.reading_sigma_m:
        changes["tape"] = {"reading_sigma_m": after.reading_sigma_m}
    if after.units != before.units:
        words = {units: word for word, units in SHORT_FORMS.items()}
        changes["units"] = words.get(after.units) or {**asdict(after.units)}
    texts = {key: (getattr(before.case, key), getattr(after.case, key)) for key in CASE}
    case: dict[str, str | float | None] = {
        k: now for k, (then, now) in texts.items() if then != now
    }
    if case:
        changes["case"] = case
    return changes


def change_left_out(path: Path, names: Collection[str], *, is_taken_back: bool) -> None:
    """Leave photos out of a project, or take them back; their picks stay in the table.

    Parameters
    ----------
    path
        The project file.
    names
        Names of photos.
    is_taken_back
        Whether they take part again.

    Raises
    ------
    UavgramError
        The file cannot be changed in that place.
    """
    before = load_project(path, unfinished=True).leave_out
    kept = [name for name in before if name not in names]
    _write(path, {"leave_out": kept if is_taken_back else [*kept, *sorted(names)]})


def use_recorded_angles(path: Path) -> None:
    """Take the direction of a project's camera as recorded, instead of as its mount states.

    Parameters
    ----------
    path
        The project file.

    Raises
    ------
    UavgramError
        The file cannot be changed in that place.
    """
    before = read_setup(load_project(path, unfinished=True))
    change_setup(path, replace(before, pitch_deg="auto", yaw_deg="auto", roll_deg="auto"))


CASE: tuple[Literal["number", "title", "place", "date", "agency"], ...] = (
    *("number", "title", "place", "date", "agency"),
)
"""Fields of a case that are asked for."""


def _change_files(folder: Path, path: Path, choices: Choices) -> None:
    """Name another camera or flight log, where that was chosen."""
    project = load_project(path, unfinished=True)
    changes: dict[str, str | None] = {}
    if choices.camera is not None and choices.camera.as_posix() != _camera_of(folder, project):
        changes["camera"] = choices.camera.as_posix()
    if choices.log is not None:
        now = None if project.log is None else _inside(folder, project.log)
        log = None if choices.log == "none" else choices.log.as_posix()
        if log != now:
            changes["log"] = log
    _write(path, changes)


def _write(path: Path, changes: Settings) -> None:
    if not changes:
        return
    before = path.read_bytes().decode("utf-8-sig")
    after = apply_settings(before, changes)
    if after is None:
        keys = " and ".join(changes)
        raise InputError(
            path, f"is written in a way that only an editor can change: set {keys} in it by hand"
        )
    replace_text(path, after)
    try:
        load_project(path, unfinished=True)
    except UavgramError:
        replace_text(path, before)
        raise


def _import_points(folder: Path, path: Path, wanted: SetupChoices) -> None:
    """Import picks and coordinates of a gcp_list.txt."""
    project = load_project(path, unfinished=True)
    control = Path(project.control or folder / "control.csv")
    sigmas = GcpSigmas(sigma_m=wanted.gcp_sigma_m)
    file = folder / str(wanted.gcp_list)
    import_picks([file], Path(project.picks), ControlFiles(path=control, sigmas=sigmas))
