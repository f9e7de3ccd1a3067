"""Write a project file for a folder of photos, with the files found in it.

Where several files are possible, a person has to choose.
"""

from __future__ import annotations

import errno
import glob
import os
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from uavgram.config.project_text import ProjectText, project_text
from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.input_files import UnusableFile, describe_files
from uavgram.io.files import find_matching_files
from uavgram.io.folders import (
    FolderContents,
    PhotoGroup,
    TableRole,
    group_photos,
    number_kinds,
    search_folder,
)
from uavgram.io.outputs import replace_text
from uavgram.io.photos.catalogue import (
    PASSED_OVER,
    find_photos,
    name_format,
    read_photos,
    report_unusable_photos,
    separate_unread,
)
from uavgram.io.photos.metadata import read_image_size
from uavgram.io.photos.pose_sources import FROM_PHOTOS
from uavgram.io.tables.updates import (
    CONTROL_HEADER,
    LINES_HEADER,
    MEASURE_HEADER,
    PICKS_HEADER,
    create_table,
)
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.options import CAMERA_OF_PHOTOS, CAMERA_UNKNOWN, TimeOptions
from uavgram.pipeline.cameras import assume_photo_camera, read_camera
from uavgram.pipeline.check import find_missing_inputs
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.measure.pose import (
    ABOVE_GROUND_SIGMA_M,
    assume_ground_below,
    has_place,
    pose_frames,
)
from uavgram.stages.messages import order_messages
from uavgram.stages.seed.photo_exposures import DEFAULT_HEIGHT_M

PROJECT = "project.yaml"
PICKED = {"picks": PICKS_HEADER, "lines": LINES_HEADER, "measure": MEASURE_HEADER}
"""Tables that the picking page makes, and their columns."""

HEADERS = PICKED | {"control": CONTROL_HEADER}
"""Columns of tables that may have to be written for a new project."""

_TABLES: tuple[TableRole, ...] = (
    *("picks", "lines", "known", "measure", "control", "control_lines", "check", "plan"),
)


@dataclass(frozen=True, kw_only=True)
class Choices:
    """Choices of a person where a folder holds several files; paths are relative to the folder.

    A camera is a file, ``auto`` or ``unknown``, as in a project. A log is a file or ``none``: the
    project goes without one, though the folder may hold some.
    """

    images: tuple[str, ...] = ()
    log: Path | Literal["none"] | None = None
    camera: Path | None = None
    poses: Path | None = None


WITHOUT_LOG = (
    "Without a flight log, the photos are placed by their own positions, if they have some, or "
    "else by taped lengths alone."
)


@dataclass
class Notes:
    """Findings and messages of the search through a folder."""

    found: list[str] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)

    def warn(self, code: str, text: str, *files: str) -> None:
        """Add a warning, with the `files` concerned."""
        self.messages.append(Message("warning", code, text, files=files))


def choose_photos(
    folder: Path, holdings: FolderContents, choices: Choices
) -> tuple[PhotoGroup, ...]:
    """Return groups of photos to take, all of one size.

    Parameters
    ----------
    folder
        The project folder.
    holdings
        Its content.
    choices
        Patterns that a person chose.
    """
    groups = holdings.photos
    if choices.images:
        named = {
            path
            for pattern in choices.images
            for path in find_matching_files(make_absolute(folder, pattern), "correct --images")
        }
        groups, _ = group_photos(sorted(named))
        if not groups:
            read_image_size(min(named))  # raises the reason
            wanted = ", ".join(choices.images)
            raise InputError(folder, f"no photo is named {wanted}: correct --images")
    if not groups:
        unusable = order_messages(*report_unusable_photos(holdings.unusable_photos))
        what = "photo that can be used" if unusable else "photo"
        texts = *(one.text for one in unusable), describe_files(holdings.others)
        raise InputError(
            folder,
            f"holds no {what} (.jpg, .png, .tif), nor do the folders in it: name the folder of the "
            f"flight, or copy the photos there. {' '.join(texts)}".rstrip(),
        )
    if max(number_kinds(groups)):
        raise InputError(folder, _kinds(folder, groups))
    return groups


def _kinds(folder: Path, groups: Sequence[PhotoGroup]) -> str:
    """Describe the kinds of photos, and how to choose one."""
    patterns = [find_own_pattern(folder, group, groups) for group in groups]
    rows = "\n".join(
        f"  {pattern}: {len(group.files)} of {group.size_px[0]} x {group.size_px[1]} px, such as "
        f"{group.files[0].name}"
        for pattern, group in zip(patterns, groups, strict=True)
    )
    most = max(range(len(groups)), key=lambda k: len(groups[k].files))
    way = f"--images '{patterns[most]}'"
    if patterns.count(patterns[most]) > 1:
        way = f"--images with the names of one size, or '{groups[most].files[0].name}' alone"
    counts = Counter(path.name for group in groups for path in group.files)
    twice = [name for name, count in counts.items() if count > 1]
    why = "photos of several sizes, and a project has one camera of one size"
    if twice:
        why = (
            f"photos of the same file name in several folders ({len(twice)} names, such as "
            f"{twice[0]}), and a project tells photos apart by their file names"
        )
    return f"holds {why}:\n{rows}\nchoose, such as with {way}"


def find_own_pattern(folder: Path, group: PhotoGroup, groups: Sequence[PhotoGroup]) -> str:
    """Return a group's pattern, with the common beginning of its names if that separates it.

    Parameters
    ----------
    folder
        The project folder.
    group
        The group.
    groups
        All groups of the folder.
    """
    beside = [
        other
        for other in groups
        if other is not group and (other.folder, other.suffix) == (group.folder, group.suffix)
    ]
    start = os.path.commonprefix([path.stem for path in group.files])  # noqa: RUF071  (of names)
    others = [path.name for other in beside for path in other.files]
    if not beside or not start or any(name.startswith(start) for name in others):
        return pattern_of(folder, group)
    plain = pattern_of(folder, group)
    return f"{plain.removesuffix(f'*{group.suffix}')}{glob.escape(start)}*{group.suffix}"


def pattern_of(folder: Path, group: PhotoGroup) -> str:
    """Return the pattern of a group, relative to the folder."""
    inside = group.folder.relative_to(folder).as_posix()
    start = "" if inside == "." else f"{glob.escape(inside)}/"
    return f"{start}*{group.suffix}"


def _list_damaged(
    folder: Path, groups: Sequence[PhotoGroup], patterns: Sequence[str]
) -> tuple[str, ...]:
    """List the names of photos that the patterns match and that cannot be used."""
    wanted = {path for group in groups for path in group.files}
    absolute = tuple(make_absolute(folder, pattern) for pattern in patterns)
    photos, _ = separate_unread(find_photos(absolute), absolute)
    return tuple(path.name for path in photos if path not in wanted)


def make_absolute(folder: Path, pattern: str) -> str:
    """Return a pattern relative to the folder as an absolute one, for `read_photos`."""
    return pattern if Path(pattern).is_absolute() else f"{glob.escape(str(folder))}/{pattern}"


def choose_only(
    folder: Path, what: str, option: str, candidates: Sequence[Path], chosen: Path | None
) -> str | None:
    """Return the only candidate, or the chosen one, relative to the folder.

    Parameters
    ----------
    folder
        The project folder.
    what
        Description of the file.
    option
        The option of the command that chooses one.
    candidates
        Possible files.
    chosen
        The choice of a person; None without one.
    """
    if chosen is not None:
        path = chosen if chosen.is_absolute() else folder / chosen
        if not path.is_file():
            raise InputError(path, f"is no file: correct --{option} (relative to {folder})")
        return _relative(folder, path)
    names = [_relative(folder, path) for path in candidates]
    if len(names) > 1:
        raise InputError(
            folder,
            f"holds {len(names)} files that could be the {what}: {', '.join(names)}; choose with "
            f"--{option}, such as --{option} '{names[0]}'",
        )
    return names[0] if names else None


def _relative(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)


def report_unusable(folder: Path, holdings: FolderContents) -> tuple[Message, ...]:
    """Report the files that look like photos, logs or tables and cannot be used.

    Parameters
    ----------
    folder
        The project folder.
    holdings
        Its content.
    """

    def report(code: str, files: Iterable[UnusableFile], what: str, then: str) -> Iterator[Message]:
        for path, reason in files:
            name = _relative(folder, path)
            text = f"The {what} {name} is not used, as it {reason}.{then}"
            yield Message("warning", code, text, files=(name,))

    instead = "" if holdings.logs else f" {WITHOUT_LOG}"
    return (
        *report("log-unusable", holdings.unusable_logs, "flight log", instead),
        *report_unusable_photos(holdings.unusable_photos),
        *report("table-unusable", holdings.unusable_texts, "table", ""),
    )


def choose_camera(
    folder: Path,
    candidates: Sequence[Path],
    chosen: Path | None,
    photos: Photos,
    notes: Notes,
) -> str:
    """Return the camera file that fits the photos, ``auto``, or ``unknown``.

    Parameters
    ----------
    folder
        The project folder.
    candidates
        Camera files in it.
    chosen
        The choice of a person; None without one.
    photos
        Photos to take.
    notes
        Findings and messages; the choice is added.
    """
    size = round(float(photos.width_px[0])), round(float(photos.height_px[0]))
    if chosen is not None and str(chosen) == CAMERA_UNKNOWN:
        return _use_ordinary_camera(photos, notes)
    of_photos = chosen is not None and str(chosen) == CAMERA_OF_PHOTOS
    fitting: list[Path] = []
    for path in candidates if chosen is None else ():
        candidate = _relative(folder, path)
        try:
            camera = read_camera(path).calibration
        except InputError as why:
            text = f"{candidate} was passed over: {why.message}."
            notes.warn("camera-passed-over", text, candidate)
            continue
        own = camera.width_px, camera.height_px
        if own == size:
            fitting.append(path)
            continue
        text = (
            f"{candidate} was passed over: it is for {own[0]} x {own[1]} px, the photos have "
            f"{size[0]} x {size[1]}."
        )
        notes.warn("camera-passed-over", text, candidate)
    name = None if of_photos else choose_only(folder, "camera", "camera", fitting, chosen)
    if name is not None:
        notes.found.append(f"camera: {name}")
        return name
    try:
        assume_photo_camera(photos)
    except InputError:
        if of_photos:
            raise
        return _use_ordinary_camera(photos, notes)
    notes.found.append("camera: auto, as the photos name it (with large sigmas)")
    return CAMERA_OF_PHOTOS


def _use_ordinary_camera(photos: Photos, notes: Notes) -> str:
    """Use an ordinary camera where neither a file nor the photos state theirs.

    Raises
    ------
    InputError
        No ordinary camera can replace it, or those of all photos.
    """
    try:
        assume_photo_camera(photos, may_be_unknown=True)
    except InputError as why:
        way = "Put a camera file beside the photos, or choose photos with --images; then try again"
        raise InputError(why.path, f"{why.message}. {way}") from why
    notes.found.append("camera: unknown, so an ordinary drone camera, with very wide errors")
    return CAMERA_UNKNOWN


def choose_tables(folder: Path, holdings: FolderContents, notes: Notes) -> dict[str, str]:
    """Return tables by role; those that the picking page makes have a name even if missing.

    Parameters
    ----------
    folder
        The project folder.
    holdings
        Its content.
    notes
        Findings and messages; the choice is added.
    """
    names: dict[str, str] = {role: _free_name(folder, role) for role in PICKED}
    for role in _TABLES:
        candidates = holdings.tables.get(role, ())
        is_plan = role == "plan"
        what = "plans" if is_plan else f"tables of {role}"
        usual = folder / f"{role}.{'json' if is_plan else 'csv'}"
        if usual in candidates:
            candidates = (usual,)
        if len(candidates) > 1:
            names_of = ", ".join(_relative(folder, path) for path in candidates)
            raise InputError(
                folder,
                f"holds {len(candidates)} {what}: {names_of}; call the one to use {usual.name}, in "
                "the folder itself",
            )
        if candidates:
            names[role] = _relative(folder, candidates[0])
            notes.found.append(f"{role}: {names[role]}")
    if holdings.gcp_lists and "control" not in names:
        names["control"] = _free_name(folder, "control")
        file = holdings.gcp_lists[0]
        tables = f"--output={folder / names['picks']}", f"--control={folder / names['control']}"
        command = shlex.join(["uavgram", "picks", "import", str(file), *tables])
        text = (
            f"{_relative(folder, file)} holds picks of points with known coordinates. To use them: "
            f"{command} --control-sigma-m=0.02; write how well the coordinates are known, in "
            "metres, instead of 0.02."
        )
        notes.messages.append(Message("info", "gcp-list-found", text, files=(file.name,)))
    return names


def _free_name(folder: Path, role: str) -> str:
    """Return a name for a table to be made that no file has, of this program or of another."""
    names = (f"{role}.csv", *(f"{role}-{k}.csv" for k in range(2, 100)))
    paths = (folder / name for name in names)
    return next(p for p in paths if not p.exists() and not p.is_symlink()).name


Attempt = tuple[ProjectText, Message | None]


@dataclass(frozen=True, kw_only=True)
class NewProject:
    """Written project.

    Attributes
    ----------
    path
        The project file.
    found
        Files that it names, in words.
    messages
        Messages on missing inputs, and on anomalies.
    """

    path: Path
    found: tuple[str, ...]
    messages: tuple[Message, ...]


def new_project(folder: Path, choices: Choices | None = None) -> NewProject:
    """Write project.yaml for a folder, and empty tables for picks.

    Existing files are never overwritten. Nothing is written where several files are possible
    without a choice, or where an existing file is wrong.

    Parameters
    ----------
    folder
        Folder with the photos, in it or in its subfolders.
    choices
        Photos, log or camera to take.

    Raises
    ------
    InputError
        The folder holds no photo, or several sizes, logs, cameras or tables of one kind, which the
        message lists. Or it holds a project file already, or a file in it is wrong, or no camera
        can be assumed for the photos.
    OutputError
        It cannot be written to.
    """
    choices = choices or Choices()
    folder = folder.absolute()
    project = folder / PROJECT
    if project.exists():
        raise InputError(project, "is there already: edit it, or move it away first")
    notes = Notes()
    text, photos = _describe_project(folder, choices, notes)
    made = _make_files(folder, text)
    try:
        _try(project, text, photos, notes)
    except BaseException:
        for path in made:
            path.unlink(missing_ok=True)
        raise
    return NewProject(
        path=project, found=tuple(notes.found), messages=order_messages(*notes.messages)
    )


def _describe_project(folder: Path, choices: Choices, notes: Notes) -> tuple[ProjectText, Photos]:
    """Return the content of the project file, with poses only attempted; and the photos."""
    holdings = search_folder(folder)
    groups = choose_photos(folder, holdings, choices)
    patterns = choices.images or [pattern_of(folder, group) for group in groups]
    leave_out = _list_damaged(folder, groups, patterns)
    photos, _ = read_photos(
        tuple(make_absolute(folder, image) for image in patterns), TimeOptions(), leave_out
    )
    width, height = groups[0].size_px
    count, names = len(photos.frame_id), join_names(patterns)
    what = "photo" if count == 1 else "photos"
    notes.found.append(f"{count} {what} of {width} x {height} px: {names}")
    camera = choose_camera(folder, holdings.cameras, choices.camera, photos, notes)
    log = None
    if choices.log != "none":
        log = choose_only(folder, "flight log", "log", holdings.logs, choices.log)
    poses = None if log else choose_only(folder, "poses", "poses", holdings.poses, choices.poses)
    for what, name in (("flight log", log), ("poses", poses)):
        if name is not None:
            notes.found.append(f"{what}: {name}")
    notes.messages += report_unusable(folder, holdings)
    if others := describe_files(holdings.others):
        notes.messages.append(Message("info", PASSED_OVER, others))
    text = ProjectText(
        name=folder.name or "survey",
        images=patterns,
        leave_out=leave_out,
        camera=camera,
        log=log,
        poses=poses,
        tables=choose_tables(folder, holdings, notes),
    )
    return text, photos


def _make_files(folder: Path, text: ProjectText) -> list[Path]:
    """Write the missing tables, and the project last; none over an existing file."""
    contents = {
        folder / text.tables[role]: create_table(header, ()).decode()
        for role, header in HEADERS.items()
        if role in text.tables and not (folder / text.tables[role]).exists()
    }
    contents[folder / PROJECT] = project_text(text)
    made: list[Path] = []
    try:
        for path, content in contents.items():
            with path.open("x", encoding="utf-8", newline="") as stream:
                made.append(path)
                stream.write(content)
    except OSError as fault:
        for path in made:
            with suppress(OSError):
                path.unlink()
        way = "copy the photos to a folder of your own, or ask for the right to write"
        if fault.errno == errno.ENOSPC:
            way = "free some space, and try again"
        raise OutputError(f"{folder}: cannot be written to ({fault.strerror}); {way}") from fault
    return made


def _try(project: Path, text: ProjectText, photos: Photos, notes: Notes) -> None:
    """Read the project as `uavgram check` does, and report missing inputs.

    Where the photos cannot be placed with it, alternatives that need no question are tried.

    Raises
    ------
    InputError
        A named file is wrong.
    """
    why = last = ""
    for attempt, note in _attempts(text, photos):
        replace_text(project, project_text(attempt))
        try:
            inputs = read_inputs(project, unpicked=True)
            posed = pose_frames(inputs)
        except UavgramError as fault:
            last = str(fault)
            if isinstance(fault, InputError) and fault.path == attempt.poses:
                last = fault.message
            why = why or str(fault)
            continue
        if note is not None:
            notes.messages.append(note)
        if last and attempt.log is None and attempt.poses is None and has_place(photos):
            notes.warn("poses-unusable", f"The photos state where they were taken, but: {last}.")
        notes.messages += [*_select_messages(inputs), *posed.messages, *find_missing_inputs(inputs)]
        return
    replace_text(project, project_text(text))
    inputs = read_inputs(project, unpicked=True)
    notes.warn("not-posed", f"The photos cannot be placed yet: {why}")
    notes.messages += [*_select_messages(inputs), *find_missing_inputs(inputs)]


def _select_messages(inputs: Inputs) -> list[Message]:
    """Return the messages on inputs; all files passed over in the folder are listed already."""
    return [one for one in inputs.messages if one.code != PASSED_OVER]


def _attempts(text: ProjectText, photos: Photos) -> list[Attempt]:
    """List project files to try, of which the first that works is taken; with their messages."""
    if text.log is not None:
        return [(text, None), _on_utc(text, ""), *_attempts_by_names(text, photos.frame_id)]
    if text.poses is not None:
        return [(text, None), *_attempt_above_ground(text, photos, "")]
    why = "The photos state where they were taken: `poses: exif` uses that."
    posed = replace(text, poses=FROM_PHOTOS)
    return [
        (posed, Message("info", "poses-found", why)),
        *_attempt_above_ground(posed, photos, f"{why} "),
        (text, None),
    ]


def _attempt_above_ground(text: ProjectText, photos: Photos, also: str) -> list[Attempt]:
    """Return an attempt with an assumed height above the ground, for poses without one."""
    origin = assume_ground_below(str(text.poses), photos)
    if origin is None:
        return []
    why = (
        f"{also}They do not state the height above the ground: {DEFAULT_HEIGHT_M:.0f} m ± "
        f"{ABOVE_GROUND_SIGMA_M:.0f} m was assumed. Write the height of the ground (from a map, or "
        "the place of take-off) into world.origin, and how well you know it into "
        "ground.height_sigma_m."
    )
    return [(replace(text, origin=origin), Message("warning", "ground-assumed", why))]


def _on_utc(text: ProjectText, also: str) -> Attempt:
    why = (
        f"{also}The camera's clock is taken to show UTC, up to 1 s: the photos fit the log's "
        "camera events at several offsets, or it has none, and this one places them. Compare a "
        "photo with the flight, and correct time.offset_s in the project if it is another."
    )
    return replace(text, offset_s=0.0), Message("warning", "clock-assumed", why)


def _attempts_by_names(text: ProjectText, names: Sequence[str]) -> list[Attempt]:
    """Return attempts with times from the photos' names, if these contain any."""
    form = name_format([Path(name).stem for name in names])
    if form is None:
        return []
    named = replace(text, name_format=form)
    why = f"The photos' names were read as their times: {names[0]} by {form}. "
    return [
        (named, Message("warning", "times-from-names", why.strip())),
        _on_utc(named, why),
    ]
