"""A project file for a folder of photos: what is there is found, what is not is said."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.config.project_text import ProjectText, project_text
from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.io.discovery.project import search_folder
from uavgram.io.outputs import replace_text
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.photos.name_times import name_format
from uavgram.io.photos.poses.read import FROM_PHOTOS
from uavgram.io.tables.rewrite import new_table
from uavgram.model.flight.frames import Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.pipeline.check import missing
from uavgram.pipeline.measure.ground_below import ABOVE_GROUND_SIGMA_M, ground_below, has_place
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.new.choices import (
    HEADERS,
    PROJECT,
    Choices,
    Notes,
    absolute,
    choose_camera,
    choose_photos,
    choose_tables,
    only_one,
    passed_over,
    pattern_of,
)
from uavgram.stages.messages import in_order
from uavgram.stages.seed.photo_exposures import ABOVE_GROUND_M

Attempt = tuple[ProjectText, Message | None]


@dataclass(frozen=True, kw_only=True)
class NewProject:
    """A project that was written.

    Attributes
    ----------
    path
        The project file.
    found
        What it names, in words.
    messages
        What is still missing, and what is odd.
    """

    path: Path
    found: tuple[str, ...]
    messages: tuple[Message, ...]


def new_project(folder: Path, choices: Choices | None = None) -> NewProject:
    """Write project.yaml for a folder, and empty tables for what is to be picked.

    Files that are there are never written over. Nothing is written where something is found
    twice and it is not said which to take, or where a file that is there is wrong.

    Parameters
    ----------
    folder
        It, or folders in it, holds the photos.
    choices
        Which photos, log or camera to take.

    Raises
    ------
    InputError
        The folder holds no photo, or several sizes, logs, cameras or tables of one kind: lists
        them. Or it holds a project file already, or a file in it is wrong, or no camera can be
        assumed for the photos.
    OutputError
        It cannot be written to.
    """
    choices = choices or Choices()
    folder = folder.absolute()
    project = folder / PROJECT
    if project.exists():
        raise InputError(project, "is there already: edit it, or move it away first")
    notes = Notes()
    text, photos = _described(folder, choices, notes)
    made = _make_files(folder, text)
    try:
        _try(project, text, photos, notes)
    except BaseException:
        for path in made:
            path.unlink(missing_ok=True)
        raise
    return NewProject(path=project, found=tuple(notes.found), messages=in_order(*notes.messages))


def _described(folder: Path, choices: Choices, notes: Notes) -> tuple[ProjectText, Photos]:
    """What the project file is to say, with poses only attempted; and the photos."""
    holdings = search_folder(folder)
    groups = choose_photos(folder, holdings, choices)
    images = choices.images or tuple(pattern_of(folder, group) for group in groups)
    photos, _ = read_photos(tuple(absolute(folder, image) for image in images), TimeOptions())
    width, height = groups[0].size_px
    count, listed = len(photos.frame_id), ", ".join(images)
    what = "photo" if count == 1 else "photos"
    notes.found.append(f"{count} {what} of {width} x {height} px: {listed}")
    camera = choose_camera(folder, holdings.cameras, choices.camera, photos, notes)
    log = only_one(folder, "flight log", "log", holdings.logs, choices.log)
    poses = None if log else only_one(folder, "poses", "poses", holdings.poses, choices.poses)
    for what, name in (("flight log", log), ("poses", poses)):
        if name is not None:
            notes.found.append(f"{what}: {name}")
    if others := passed_over(holdings):
        notes.messages.append(Message("info", "files-passed-over", others))
    text = ProjectText(
        name=folder.name or "survey",
        images=images,
        camera=camera,
        log=log,
        poses=poses,
        tables=choose_tables(folder, holdings, notes),
    )
    return text, photos


def _make_files(folder: Path, text: ProjectText) -> list[Path]:
    """Write the tables that are not there, and the project last; none over another."""
    contents = {
        folder / text.tables[role]: new_table(header, ()).decode()
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
    """Read the project as `uavgram check` does, and say what it still lacks.

    Where the photos cannot be placed as it stands, what else can be tried without asking is tried.

    Raises
    ------
    InputError
        A file that is named is wrong.
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
        notes.messages += [*inputs.messages, *posed.messages, *missing(inputs)]
        return
    replace_text(project, project_text(text))
    inputs = read_inputs(project, unpicked=True)
    notes.warn("not-posed", f"The photos cannot be placed yet: {why}")
    notes.messages += [*inputs.messages, *missing(inputs)]


def _attempts(text: ProjectText, photos: Photos) -> list[Attempt]:
    """Project files to try, the first that works is taken; and what is to be said of each."""
    if text.log is not None:
        return [(text, None), _on_utc(text, ""), *_by_names(text, photos.frame_id)]
    if text.poses is not None:
        return [(text, None), *_above_ground(text, photos, "")]
    why = "The photos state where they were taken: `poses: exif` uses that."
    posed = replace(text, poses=FROM_PHOTOS)
    return [
        (posed, Message("info", "poses-found", why)),
        *_above_ground(posed, photos, f"{why} "),
        (text, None),
    ]


def _above_ground(text: ProjectText, photos: Photos, also: str) -> list[Attempt]:
    """The same with an assumed height above the ground, for poses that say nothing of it."""
    origin = ground_below(str(text.poses), photos)
    if origin is None:
        return []
    why = (
        f"{also}They do not say how high that is above the ground: {ABOVE_GROUND_M:.0f} m ± "
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


def _by_names(text: ProjectText, names: Sequence[str]) -> list[Attempt]:
    """The same with times from the photos' names, where these hold some."""
    form = name_format([Path(name).stem for name in names])
    if form is None:
        return []
    named = replace(text, name_format=form)
    why = f"The photos' names were read as their times: {names[0]} by {form}. "
    return [
        (named, Message("warning", "times-from-names", why.strip())),
        _on_utc(named, why),
    ]
