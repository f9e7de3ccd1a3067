"""Search of a folder for inputs of a project, and for folders of photos near it.

Files are recognised by their content where names are ambiguous, such as ``.log`` or ``.bin``.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from uavgram.errors import InputError
from uavgram.input_files import unread_format
from uavgram.io.cameras.colmap import is_colmap_cameras
from uavgram.io.cameras.odm import is_odm_cameras
from uavgram.io.cameras.opencv import is_opencv_calibration
from uavgram.io.logs.flight_log import is_flight_log
from uavgram.io.photos.files import PHOTO_SUFFIXES, limit_entries
from uavgram.io.photos.metadata import read_image_size
from uavgram.io.results.plan_json import is_plan

MAX_DEPTH = 3
"""Levels of folders below the project's own that are searched."""

MAX_FOLDERS = 400
"""Limit of searched folders, so that a home folder does not take minutes."""

_RESULTS = {"results.json", "calibration.json"}


@dataclass(frozen=True, kw_only=True)
class PhotoFolder:
    """A folder with photos.

    Attributes
    ----------
    path
        The folder.
    files
        Its photos, in the order of their names.
    size_px
        Width and height of the first one.
    """

    path: Path
    files: tuple[Path, ...]
    size_px: tuple[int, int]


def find_photo_folders(folder: Path, least: int) -> tuple[PhotoFolder, ...]:
    """Return subfolders and neighbouring folders with at least a number of photos.

    Hidden folders, those of results and unreadable ones are skipped.
    """
    inside = _folders(folder, MAX_DEPTH)
    beside = (path for path in _subfolders(folder.parent) if path != folder)
    found: list[PhotoFolder] = []
    for count, path in enumerate((*inside, *beside)):
        if count >= MAX_FOLDERS:
            break
        one = _with_photos(path, least)
        if one is not None:
            found.append(one)
    return tuple(found)


def _folders(folder: Path, depth: int) -> Iterator[Path]:
    """Iterate over a folder and its subfolders to a depth; outer ones first."""
    yield folder
    if depth:
        for inner in _subfolders(folder):
            yield from _folders(inner, depth - 1)


def _subfolders(folder: Path) -> list[Path]:
    try:
        inner = [entry for entry in os.scandir(folder) if entry.is_dir(follow_symlinks=False)]
    except OSError:
        return []
    paths = sorted(Path(entry.path) for entry in inner if not entry.name.startswith("."))
    return [path for path in paths if not any((path / name).exists() for name in _RESULTS)]


def _with_photos(folder: Path, least: int) -> PhotoFolder | None:
    try:
        names = sorted(os.listdir(folder))  # noqa: PTH208  (names alone: files are not opened)
        files = tuple(
            folder / name
            for name in names
            if Path(name).suffix.lower() in PHOTO_SUFFIXES and not name.startswith(".")
        )
        if len(files) < least:
            return None
        return PhotoFolder(path=folder, files=files, size_px=read_image_size(files[0]))
    except (OSError, InputError):
        return None


_CAMERA_SUFFIXES = (".yaml", ".yml", ".json", ".xml", ".txt")
_RESULTS_FILE = "results.json"
_CALIBRATION, _CALIBRATED = "calibration.json", "camera.yaml"
_LARGEST_CAMERA_BYTES = 1_000_000
_HIDDEN = re.compile(r"\.(?!_)")  # the companion files of macOS, ._x, are kept and reported

TableRole = Literal[
    "picks", "lines", "known", "measure", "control", "control_lines", "check", "poses", "plan"
]

# columns by which a table is recognised, the most specific first
_TABLES: tuple[tuple[TableRole, frozenset[str]], ...] = (
    ("picks", frozenset({"image", "label", "u_px", "v_px"})),
    ("lines", frozenset({"name", "from", "to", "length_m"})),
    ("known", frozenset({"name", "kind", "points", "sigma"})),
    ("measure", frozenset({"name", "kind", "points"})),
    ("poses", frozenset({"image", "latitude_deg", "longitude_deg", "height_m"})),
    ("control", frozenset({"label", "latitude_deg", "longitude_deg"})),
    ("control", frozenset({"label", "east_m", "north_m"})),
    ("control_lines", frozenset({"name", "points", "start_east_m", "end_east_m"})),
    ("control_lines", frozenset({"name", "points", "start_latitude_deg", "end_latitude_deg"})),
)


@dataclass(frozen=True, kw_only=True)
class PhotoGroup:
    """Photos of one folder, suffix and size."""

    folder: Path
    suffix: str
    size_px: tuple[int, int]
    files: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class FolderContents:
    """Usable files of a folder, each kind in the order of paths; `others` are all the rest."""

    photos: tuple[PhotoGroup, ...]
    logs: tuple[Path, ...]
    cameras: tuple[Path, ...]
    poses: tuple[Path, ...]
    gcp_lists: tuple[Path, ...]
    tables: Mapping[TableRole, tuple[Path, ...]]
    others: tuple[Path, ...]


def search_folder(folder: Path) -> FolderContents:
    """Search a folder and its subfolders; hidden ones and those of results are skipped.

    From a calibration's results the camera file is used.

    Raises
    ------
    InputError
        It cannot be read, or is not a folder.
    """
    files = tuple(path for path in limit_entries(_files(folder), folder) if path.is_file())
    tables: dict[TableRole, tuple[Path, ...]] = {}
    for path in files:
        role = _role(path)
        if role is not None:
            tables[role] = (*tables.get(role, ()), path)
    marks = tuple(p for p in files if p.suffix.lower() == ".mrk" or p.name.lower() == "geo.txt")
    photos = group_photos(path for path in files if path.suffix.lower() in PHOTO_SUFFIXES)
    logs = tuple(path for path in files if is_flight_log(path))
    cameras = tuple(path for path in files if _is_camera(path))
    texts = (path for path in files if path.suffix.lower() == ".txt")
    gcp = tuple(p for p in texts if "gcp" in p.stem.lower() and unread_format(p) is None)
    groups = (*(group.files for group in photos), *tables.values())
    known = {*logs, *cameras, *marks, *gcp, *(path for group in groups for path in group)}
    return FolderContents(
        photos=photos,
        logs=logs,
        cameras=cameras,
        poses=(*marks, *tables.get("poses", ())),
        gcp_lists=gcp,
        tables=tables,
        others=tuple(path for path in files if path not in known),
    )


def _role(path: Path) -> TableRole | None:
    """Return the kind of a table, or ``plan``; None for other files."""
    if path.suffix.lower() == ".csv":
        return _table_role(path)
    return "plan" if path.suffix.lower() == ".json" and is_plan(path) else None


def group_photos(photos: Iterable[Path]) -> tuple[PhotoGroup, ...]:
    """Group photos by folder, suffix and size; files that are not photos are left out."""
    groups: dict[tuple[Path, str, tuple[int, int]], list[Path]] = {}
    for path in photos:
        try:
            size = read_image_size(path)
        except InputError:
            continue
        groups.setdefault((path.parent, path.suffix, size), []).append(path)
    return tuple(
        PhotoGroup(folder=folder, suffix=suffix, size_px=size, files=tuple(files))
        for (folder, suffix, size), files in groups.items()
    )


def _files(folder: Path) -> Iterable[Path]:
    def refuse(fault: OSError) -> None:
        raise InputError(fault.filename or folder, f"cannot be read: {fault.strerror}") from fault

    if not folder.is_dir():
        raise InputError(folder, "is no folder: name the one that holds the photos")
    for here, folders, files in os.walk(folder, onerror=refuse):
        names = files
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        if _RESULTS_FILE in names and Path(here) != folder:
            folders.clear()
            continue
        if _CALIBRATION in names and Path(here) != folder:  # its pictures are not photos
            folders.clear()
            names = [name for name in names if name == _CALIBRATED]
        yield from (Path(here, name) for name in sorted(names) if not _HIDDEN.match(name))


def _table_role(path: Path) -> TableRole | None:
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            header = {cell.strip() for cell in next(csv.reader(stream), [])}
    except (OSError, csv.Error):
        return None
    role = next((role for role, columns in _TABLES if columns <= header), None)
    return "check" if role == "control" and "check" in path.stem.lower() else role


def _is_camera(path: Path) -> bool:
    if path.suffix.lower() not in _CAMERA_SUFFIXES:
        return False
    try:
        if path.stat().st_size > _LARGEST_CAMERA_BYTES:
            return False
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError:
        return False
    if path.suffix.lower() == ".txt":
        return is_colmap_cameras(text)
    lines = text.splitlines()
    ours = {"model", "parameters"} <= {line.partition(":")[0] for line in lines}
    return ours or is_odm_cameras(text) or is_opencv_calibration(path)
