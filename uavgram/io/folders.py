"""Search of folders for inputs of a project and for photos, and folders that a page may show.

Files are recognised by their content where names are ambiguous, such as ``.log`` or ``.bin``.
"""

from __future__ import annotations

import csv
import os
import re
import string
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Literal, get_args

from uavgram.errors import InputError, describe_non_file
from uavgram.input_files import UnusableFile, read_text, unread_format
from uavgram.io.cameras import is_colmap_cameras, is_odm_cameras, is_opencv_calibration
from uavgram.io.files import PHOTO_SUFFIXES, limit_entries
from uavgram.io.logs.flight_log import LOG_SUFFIXES, find_log_fault
from uavgram.io.photos.metadata import read_image_size, read_image_sizes
from uavgram.io.results.command_json import is_plan

MAX_DEPTH = 3
"""Levels of folders below the project's own that are searched."""

MAX_LOG_BYTES = 50_000_000
"""Logs up to this size are read to see whether they can be used: half a second at most."""

MAX_SEARCHED_FOLDERS = 400
"""Limit of searched folders, so that a home folder does not take minutes."""

MAX_SEARCH_S = 1.0
"""Limit of the search for flights."""

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
    inside = _walk_folders(folder, MAX_DEPTH)
    beside = (path for path in _subfolders(folder.parent) if path != folder)
    found: list[PhotoFolder] = []
    for count, path in enumerate((*inside, *beside)):
        if count >= MAX_SEARCHED_FOLDERS:
            break
        one = _find_photo_folder(path, least)
        if one is not None:
            found.append(one)
    return tuple(found)


def _walk_folders(folder: Path, depth: int) -> Iterator[Path]:
    """Iterate over a folder and its subfolders to a depth; outer ones first."""
    yield folder
    if depth:
        for inner in _subfolders(folder):
            yield from _walk_folders(inner, depth - 1)


def _subfolders(folder: Path) -> list[Path]:
    try:
        inner = [entry for entry in os.scandir(folder) if entry.is_dir(follow_symlinks=False)]
    except OSError:
        return []
    paths = sorted(Path(entry.path) for entry in inner if not entry.name.startswith("."))
    return [path for path in paths if not any((path / name).exists() for name in _RESULTS)]


def _find_photo_folder(folder: Path, least: int) -> PhotoFolder | None:
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
_OTHER_INPUTS = {*LOG_SUFFIXES, *_CAMERA_SUFFIXES, ".csv"}
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
    """Files of a folder, each kind in the order of paths.

    Attributes
    ----------
    photos, logs, cameras, poses, gcp_lists, tables
        Usable files.
    unusable_photos, unusable_logs, unusable_texts
        Files with the names of such that are empty, damaged or something else.
    others
        All the rest.
    """

    photos: tuple[PhotoGroup, ...]
    logs: tuple[Path, ...]
    cameras: tuple[Path, ...]
    poses: tuple[Path, ...]
    gcp_lists: tuple[Path, ...]
    tables: Mapping[TableRole, tuple[Path, ...]]
    unusable_photos: tuple[UnusableFile, ...]
    unusable_logs: tuple[UnusableFile, ...]
    unusable_texts: tuple[UnusableFile, ...]
    others: tuple[Path, ...]


def search_folder(folder: Path) -> FolderContents:
    """Search a folder and its subfolders; hidden ones and those of results are skipped.

    From a calibration's results the camera file is used.

    Raises
    ------
    InputError
        It cannot be read, or is not a folder.
    """
    found = tuple(limit_entries(_files(folder), folder))
    files = tuple(path for path in found if not describe_non_file(path))
    roles = {path: role for path in files if (role := _role(path)) is not None}
    marks = tuple(p for p in files if p.suffix.lower() == ".mrk" or p.name.lower() == "geo.txt")
    texts = (path for path in files if path.suffix.lower() == ".txt")
    gcp = tuple(p for p in texts if "gcp" in p.stem.lower() and unread_format(p) is None)
    no_texts = _find_unusable((*roles, *marks, *gcp), _find_text_fault)
    foreign = (path for path in files if path.name.lower() in _OWN_TABLES and path not in roles)
    no_texts = (*no_texts, *(UnusableFile(path, _FOREIGN) for path in foreign))
    bad = {path for path, _ in no_texts}
    tables: dict[TableRole, tuple[Path, ...]] = {}
    for path, role in roles.items():
        if path not in bad:
            tables[role] = (*tables.get(role, ()), path)
    photos, no_photos = group_photos(p for p in found if _is_of(PHOTO_SUFFIXES, p))
    named_logs = tuple(path for path in found if _is_of(LOG_SUFFIXES, path))
    are_small = sum(path.stat().st_size for path in named_logs if path.exists()) <= MAX_LOG_BYTES
    no_logs = _find_unusable(named_logs, partial(find_log_fault, whole=are_small))
    logs = tuple(path for path in named_logs if path not in {one.path for one in no_logs})
    cameras = tuple(path for path in files if _is_camera(path))
    unusable = *no_texts, *no_photos, *no_logs
    groups = (*(group.files for group in photos), *tables.values())
    known = {*logs, *cameras, *marks, *gcp, *(path for group in groups for path in group)}
    known |= {path for path, _ in unusable}
    return FolderContents(
        photos=photos,
        logs=logs,
        cameras=cameras,
        poses=tuple(p for p in (*marks, *tables.get("poses", ())) if p not in bad),
        gcp_lists=tuple(path for path in gcp if path not in bad),
        tables=tables,
        unusable_photos=no_photos,
        unusable_logs=no_logs,
        unusable_texts=no_texts,
        others=tuple(path for path in found if path not in known),
    )


def _is_of(suffixes: tuple[str, ...], path: Path) -> bool:
    """Return whether a name is that of a photo or log, and the format is not a known other one."""
    return path.suffix.lower() in suffixes and unread_format(path) is None


def _find_unusable(
    paths: Iterable[Path], find_fault: Callable[[Path], str]
) -> tuple[UnusableFile, ...]:
    return tuple(UnusableFile(path, fault) for path in paths if (fault := find_fault(path)))


def _find_text_fault(path: Path) -> str:
    """Return why a text cannot be read; empty if it can."""
    try:
        read_text(path, "save it as UTF-8")
    except InputError as why:
        return why.message
    return ""


def _role(path: Path) -> TableRole | None:
    """Return the kind of a table, or ``plan``; None for other files."""
    if path.suffix.lower() == ".csv":
        return _table_role(path)
    return "plan" if path.suffix.lower() == ".json" and is_plan(path) else None


def group_photos(
    photos: Iterable[Path],
) -> tuple[tuple[PhotoGroup, ...], tuple[UnusableFile, ...]]:
    """Group photos by folder, suffix and size; list the files that cannot be used."""
    sizes, unusable = read_image_sizes(photos)
    groups: dict[tuple[Path, str, tuple[int, int]], list[Path]] = {}
    for path, size in sizes.items():
        groups.setdefault((path.parent, path.suffix, size), []).append(path)
    grouped = tuple(
        PhotoGroup(folder=folder, suffix=suffix, size_px=size, files=tuple(files))
        for (folder, suffix, size), files in groups.items()
    )
    return grouped, unusable


def number_kinds(groups: Iterable[PhotoGroup]) -> tuple[int, ...]:
    """Return the kind of each group; photos of one kind have one size, and different file names.

    Parameters
    ----------
    groups
        Groups of photos.

    Returns
    -------
    tuple[int, ...]
        Kind of each group, from 0.
    """
    kinds: list[tuple[tuple[int, int], set[str]]] = []
    numbers = []
    for group in groups:
        names = {path.name for path in group.files}
        fitting = (
            k
            for k, (size, taken) in enumerate(kinds)
            if size == group.size_px and not names & taken
        )
        kind = next(fitting, len(kinds))
        if kind == len(kinds):
            kinds.append((group.size_px, set()))
        kinds[kind][1].update(names)
        numbers.append(kind)
    return tuple(numbers)


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


_OWN_TABLES = {f"{role}.csv" for role in get_args(TableRole)}
_FOREIGN = "has not the columns of such a table: it may be of another program"


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


MAX_LISTED_FOLDERS = 500
"""Limit of the listed subfolders; the next two limit entries and inner folders counted in each."""
MAX_ENTRIES = 5000
MAX_SUBFOLDERS = 20

PROJECT, RESULTS = "project.yaml", "results.json"
_MOUNTS = {"linux": ("/media/{user}", "/run/media/{user}", "/mnt"), "darwin": ("/Volumes",)}
"""Folders in which a system mounts drives."""


@dataclass(frozen=True, kw_only=True)
class ListedFolder:
    """A listed folder.

    Attributes
    ----------
    path
        Without links.
    photos
        Number of files with a photo's name in it; if there are none, in its subfolders.
    are_inner
        Whether they are in its subfolders.
    has_project
        Whether it contains a project file.
    """

    path: Path
    photos: int
    are_inner: bool
    has_project: bool

    def is_flight(self, collections: Collection[Path]) -> bool:
        """Return whether it is likely one flight: it has a project, photos, or folders of photos.

        Parameters
        ----------
        collections
            Folders with any content, such as a home or a drive: photos in subfolders do not count.
        """
        inner = self.photos > 0 and self.path.resolve() not in collections
        return self.has_project or (self.photos > 0 and not self.are_inner) or inner


class Browsable:
    """Folders below a few roots; none above them, none hidden, and none behind a link.

    Parameters
    ----------
    roots
        Such as `find_home_and_drives()`; missing ones are left out.
    """

    def __init__(self, roots: Sequence[Path]) -> None:
        found = (root.resolve() for root in roots if root.is_dir())
        self.roots = tuple(dict.fromkeys(found))

    def check_folder(self, folder: Path) -> Path:
        """Return the folder itself, if it may be shown.

        Raises
        ------
        InputError
            It is outside of the roots, hidden, behind a link, gone, or not a folder.
        """
        root = self.root_of(folder)
        inside = () if root is None else folder.relative_to(root).parts
        if root is None or any(part in {os.curdir, os.pardir} for part in folder.parts):
            raise InputError(folder, "is not one of the folders that this page may show")
        if any(part.startswith(".") for part in inside) or folder.resolve() != folder:
            raise InputError(folder, "is hidden or a link: choose the folder that it leads to")
        if not folder.is_dir():
            raise InputError(folder, "is not there any more: choose another folder")
        return folder

    def root_of(self, folder: Path) -> Path | None:
        """Return the innermost root that contains the folder; None without any."""
        holding = [root for root in self.roots if folder.is_relative_to(root)]
        return max(holding, key=lambda root: len(root.parts), default=None)

    def folders_in(self, folder: Path) -> tuple[ListedFolder, ...]:
        """Return the subfolders by their names, without hidden ones and links.

        Raises
        ------
        InputError
            It may not be shown, or cannot be read.
        """
        try:
            inner = _list_folders(self.check_folder(folder))
        except OSError as fault:
            raise InputError(
                folder,
                f"cannot be read ({fault.strerror}): choose another folder, or ask who looks after "
                "this computer for the right to read it",
            ) from fault
        return tuple(count_photos(path) for path in inner)


def count_photos(folder: Path) -> ListedFolder:
    """Count the photos of a folder, or of its subfolders, by their names."""
    names = _names(folder)
    photos = own = _photos(names)
    if not own:
        try:
            inner = [_names(one) for one in _list_folders(folder)[:MAX_SUBFOLDERS]]
        except OSError:
            inner = []
        photos = sum(_photos(one) for one in inner if RESULTS not in one)
    return ListedFolder(path=folder, photos=photos, are_inner=not own, has_project=PROJECT in names)


def find_flights(roots: Collection[Path]) -> list[ListedFolder]:
    """Find the folders of flights below some folders, the newest first.

    Each has a project, photos, or folders of photos beside a log or another file of a flight. The
    search goes from the outer folders to the inner ones and ends after `MAX_SEARCHED_FOLDERS`, or
    `MAX_SEARCH_S` on a slow drive.
    """
    until = time.monotonic() + MAX_SEARCH_S
    found: list[ListedFolder] = []
    queue = deque(roots)
    for _ in range(MAX_SEARCHED_FOLDERS):
        if not queue or time.monotonic() > until:
            break
        folder = queue.popleft()
        one = count_photos(folder)
        holds_inner = one.are_inner and folder not in roots and _has_other_inputs(folder)
        if one.has_project or (one.photos and (holds_inner or not one.are_inner)):
            found.append(one)
            continue
        with suppress(OSError):
            queue.extend(_list_folders(folder))
    return sorted(found, key=lambda one: _changed_s(one.path), reverse=True)


def _has_other_inputs(folder: Path) -> bool:
    return any(Path(name).suffix.lower() in _OTHER_INPUTS for name in _names(folder))


def _changed_s(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0


def _names(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in islice(entries, MAX_ENTRIES)]
    except OSError:
        return []


def _photos(names: list[str]) -> int:
    return sum(not name.startswith(".") and name.lower().endswith(PHOTO_SUFFIXES) for name in names)


def _list_folders(folder: Path) -> list[Path]:
    with os.scandir(folder) as entries:
        inner = (
            Path(entry.path)
            for entry in entries
            if not entry.name.startswith((".", "$")) and entry.is_dir(follow_symlinks=False)
        )
        found = list(islice(inner, MAX_LISTED_FOLDERS))
    return sorted(found, key=lambda path: path.name.lower())


def find_home_and_drives(
    platform: str = sys.platform, environ: Mapping[str, str] = os.environ
) -> tuple[Path, ...]:
    """Return the user's home, and mounted drives: memory cards, disks, shares.

    Parameters
    ----------
    platform, environ
        Of the computer.
    """
    return Path.home(), *_drives(platform, environ)


def _drives(platform: str, environ: Mapping[str, str]) -> Iterator[Path]:
    if platform == "win32":
        drives = (Path(f"{letter}:\\") for letter in string.ascii_uppercase)
        yield from (drive for drive in drives if drive.exists())
        return
    user = environ.get("USER", "")
    for pattern in _MOUNTS.get(platform, ()):
        mounts = Path(pattern.format(user=user))
        if "{user}" in pattern and not user:
            continue
        try:
            inner = sorted(path for path in mounts.iterdir() if not path.is_symlink())
        except OSError:
            continue
        yield from (path for path in inner if path.is_dir())
