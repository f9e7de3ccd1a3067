"""Search for files by patterns, within limits; only regular files are accepted."""

from __future__ import annotations

import glob
import itertools
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from uavgram.errors import InputError, no_file
from uavgram.model.limits import escape_unshowable, find_unshowable

PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")

MAX_ENTRIES = 200_000
"""Largest number of files and folders searched for photos: a few seconds, not a whole disk."""


def find_matching_files(pattern: str, way_out: str) -> list[Path]:
    """Find the files of an absolute pattern, in the order of their paths.

    Folders that match a wildcard are skipped; any other match that is not a regular file is an
    error, as it was probably intended.

    Parameters
    ----------
    pattern
        May hold ``*``, ``**`` and ``[..]``.
    way_out
        Remedy in the message where nothing matches.

    Raises
    ------
    InputError
        Nothing matches, a match is not a regular file, or too many match to be intended.
    """
    start, recursive, _ = pattern.partition("**")
    if recursive:
        _require_few(pattern, start)
    # patterns are absolute texts that may hold ** and [..], which only glob supports
    found = glob.iglob(pattern, recursive=True)  # noqa: PTH207
    names = sorted(itertools.islice(found, MAX_ENTRIES + 1))
    if len(names) > MAX_ENTRIES:
        raise InputError(pattern, f"names more than {MAX_ENTRIES:,} files: {_NARROWER}")
    kinds = {name: no_file(name) for name in names}
    odd = [name for name, kind in kinds.items() if kind and not Path(name).is_dir()]
    files = [Path(name) for name, kind in kinds.items() if not kind]
    if odd or (names and not files):
        name = odd[0] if odd else names[0]
        raise InputError(
            escape_unshowable(name), f"is {kinds[name]}: take it out of {pattern!r}, or replace it"
        )
    if not files:
        folder = Path(pattern).parent
        if folder.is_dir() and not os.access(folder, os.R_OK | os.X_OK):
            raise InputError(folder, "cannot be read: ask for the right to, or copy the photos")
        raise InputError(pattern, f"matches no file; {way_out}")
    return files


_NARROWER = "name the folder that holds the photos, such as photos/*.jpg"


def _require_few(pattern: str, start: str) -> None:
    """Raise an error for ``**`` below folders with more files than a project can have.

    Links to folders are followed, as ``**`` does, so a circle of links ends here too.
    """
    head, slash, _ = start.rpartition("/")
    folders = glob.iglob(f"{head}{slash}" or ".")  # noqa: PTH207
    entries = itertools.chain.from_iterable(_entries(folder) for folder in folders)
    if sum(1 for _ in itertools.islice(entries, MAX_ENTRIES + 1)) > MAX_ENTRIES:
        raise InputError(
            pattern,
            f"looks through more than {MAX_ENTRIES:,} files and folders (** means all "
            f"folders, however deep): {_NARROWER}",
        )


def _entries(folder: str) -> Iterator[str]:
    for _, folders, files in os.walk(folder, followlinks=True):
        yield from folders
        yield from files


def limit_entries(paths: Iterable[Path], folder: Path) -> Iterator[Path]:
    """Yield the results of a walk through a folder, up to the same limit.

    Raises
    ------
    InputError
        There are more.
    """
    for count, path in enumerate(paths):
        if count >= MAX_ENTRIES:
            raise InputError(
                folder,
                f"holds more than {MAX_ENTRIES:,} files: name the folder of one flight, not a "
                "whole disk",
            )
        yield path


def check_name(path: Path) -> None:
    """Check that a file name can be written in other files.

    Raises
    ------
    InputError
        Names the character.
    """
    written = os.fsencode(path).decode(errors="backslashreplace")
    if written != str(path):
        raise InputError(
            escape_unshowable(written), "the photo's name is no text that can be written: rename it"
        )
    if fault := find_unshowable(path.name):
        raise InputError(escape_unshowable(str(path)), f"the photo's name holds {fault}: rename it")
