"""Files that the patterns of a person name: looked for within bounds, each of them a real file."""

from __future__ import annotations

import glob
import itertools
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from uavgram.errors import InputError, no_file
from uavgram.model.limits import shown, unshowable

PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")

MOST_ENTRIES = 200_000
"""Files and folders that are looked through for photos: a few seconds, not a whole disk."""


def matching_files(pattern: str, way_out: str) -> list[Path]:
    """Files that an absolute pattern names, in the order of their paths.

    Folders that a wildcard meets are passed over; whatever else is no file is an error, as it was
    meant to be one.

    Parameters
    ----------
    pattern
        May hold ``*``, ``**`` and ``[..]``.
    way_out
        What to do where it names nothing.

    Raises
    ------
    InputError
        It names nothing, something that is no file, or so much that it cannot be meant.
    """
    start, recursive, _ = pattern.partition("**")
    if recursive:
        _require_few(pattern, start)
    # patterns are text, absolute, and may hold ** and [..]: glob's own language
    found = glob.iglob(pattern, recursive=True)  # noqa: PTH207
    names = sorted(itertools.islice(found, MOST_ENTRIES + 1))
    if len(names) > MOST_ENTRIES:
        raise InputError(pattern, f"names more than {MOST_ENTRIES:,} files: {_NARROWER}")
    kinds = {name: no_file(name) for name in names}
    odd = [name for name, kind in kinds.items() if kind and not Path(name).is_dir()]
    files = [Path(name) for name, kind in kinds.items() if not kind]
    if odd or (names and not files):
        name = odd[0] if odd else names[0]
        raise InputError(
            shown(name), f"is {kinds[name]}: take it out of {pattern!r}, or replace it"
        )
    if not files:
        folder = Path(pattern).parent
        if folder.is_dir() and not os.access(folder, os.R_OK | os.X_OK):
            raise InputError(folder, "cannot be read: ask for the right to, or copy the photos")
        raise InputError(pattern, f"matches no file; {way_out}")
    return files


_NARROWER = "name the folder that holds the photos, such as photos/*.jpg"


def _require_few(pattern: str, start: str) -> None:
    """Refuse ``**`` below folders that hold more than anyone's photos.

    Links to folders are followed, as ``**`` does, so a circle of them ends here too.
    """
    head, slash, _ = start.rpartition("/")
    folders = glob.iglob(f"{head}{slash}" or ".")  # noqa: PTH207
    entries = itertools.chain.from_iterable(_entries(folder) for folder in folders)
    if sum(1 for _ in itertools.islice(entries, MOST_ENTRIES + 1)) > MOST_ENTRIES:
        raise InputError(
            pattern,
            f"looks through more than {MOST_ENTRIES:,} files and folders (** stands for all "
            f"folders, however deep): {_NARROWER}",
        )


def _entries(folder: str) -> Iterator[str]:
    for _, folders, files in os.walk(folder, followlinks=True):
        yield from folders
        yield from files


def bounded(paths: Iterable[Path], folder: Path) -> Iterator[Path]:
    """Pass on what a walk through a folder finds, up to the same bound.

    Raises
    ------
    InputError
        There is more.
    """
    for count, path in enumerate(paths):
        if count >= MOST_ENTRIES:
            raise InputError(
                folder,
                f"holds more than {MOST_ENTRIES:,} files: name the folder of one flight, not a "
                "whole disk",
            )
        yield path


def check_name(path: Path) -> None:
    """Refuse a name that no other file could hold.

    Raises
    ------
    InputError
        Names the character.
    """
    written = os.fsencode(path).decode(errors="backslashreplace")
    if written != str(path):
        raise InputError(
            shown(written), "the photo's name is no text that can be written: rename it"
        )
    if fault := unshowable(path.name):
        raise InputError(shown(str(path)), f"the photo's name holds {fault}: rename it")
