"""Folders near a project that hold photos: where those of a calibration board could be."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.photos.files import PHOTO_SUFFIXES
from uavgram.io.photos.size import image_size

DEEPEST = 3
"""Levels of folders that are looked into below the project's own."""

MOST_FOLDERS = 400
"""Folders that are looked into: a home folder must not take minutes."""

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


def folders_with_photos(folder: Path, least: int) -> tuple[PhotoFolder, ...]:
    """Folders in a folder, and those beside it, that hold at least so many photos.

    Hidden folders and those of results are passed over, and so is what cannot be read.
    """
    inside = _folders(folder, DEEPEST)
    beside = (path for path in _subfolders(folder.parent) if path != folder)
    found: list[PhotoFolder] = []
    for count, path in enumerate((*inside, *beside)):
        if count >= MOST_FOLDERS:
            break
        one = _with_photos(path, least)
        if one is not None:
            found.append(one)
    return tuple(found)


def _folders(folder: Path, depth: int) -> Iterator[Path]:
    """A folder and those in it, down to a depth; outer ones first."""
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
        names = sorted(os.listdir(folder))  # noqa: PTH208  (names alone: no file is looked at)
        files = tuple(
            folder / name
            for name in names
            if Path(name).suffix.lower() in PHOTO_SUFFIXES and not name.startswith(".")
        )
        if len(files) < least:
            return None
        return PhotoFolder(path=folder, files=files, size_px=image_size(files[0]))
    except (OSError, InputError):
        return None
