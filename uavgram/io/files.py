"""Files below a folder: search within limits, protected writing, and SHA-256 digests."""

from __future__ import annotations

import fnmatch
import glob
import hashlib
import itertools
import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from uavgram.errors import InputError, OutputError, describe_non_file, describe_unread
from uavgram.model.limits import escape_unshowable, find_unshowable
from uavgram.model.provenance import InputDigest
from uavgram.model.result.tables import FrameResults

# missing on Windows, where links need a rare right
NO_FOLLOW: int = getattr(os, "O_NOFOLLOW", 0)
# only on Windows, which otherwise writes two bytes for the end of a line
_BINARY: int = getattr(os, "O_BINARY", 0)


def open_own(path: Path, flags: int, mode: int = 0o600) -> int:
    """Open a file that only this program writes; return its handle.

    Parameters
    ----------
    path
        The file.
    flags, mode
        As of ``os.open``.

    Raises
    ------
    OutputError
        The path is a link, a pipe or a device, or has a second name elsewhere.
    OSError
        It cannot be opened for another reason.
    """
    check_own(path)
    return os.open(path, flags | NO_FOLLOW | _BINARY, mode)


def check_own(path: Path) -> None:
    """Reject a link, a pipe or a device, and a file with a second name elsewhere.

    Raises
    ------
    OutputError
        The path is one of these.
    """
    try:
        status = path.lstat()
    except OSError:
        return
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        raise OutputError(
            f"{path}: is a link to another file, or no file at all, and is left alone: remove it"
        )


def read_own(path: Path) -> bytes:
    """Read the content of a file written by this program, without following links.

    Raises
    ------
    OutputError
        The path is a link, a pipe or a device, or has a second name elsewhere.
    OSError
        It cannot be read for another reason.
    """
    with os.fdopen(open_own(path, os.O_RDONLY), "rb") as stream:
        return stream.read()


def remove_link(path: Path) -> Path:
    """Remove a link at a path and return the path: a file written there stays there."""
    if path.is_symlink():
        path.unlink()
    return path


def check_folder_of_project(folder: Path, home: Path) -> None:
    """Reject an output folder that appears to be inside the project, but is a link out of it.

    Parameters
    ----------
    folder
        Path in the project file.
    home
        The project's folder.

    Raises
    ------
    OutputError
        It leads elsewhere.
    """
    if _lies_in(folder, home):
        check_inside(folder, home, f"The output folder {folder}")


def check_inside(path: Path, home: Path, what: str) -> None:
    """Reject a path that is outside a folder after its links are followed.

    Parameters
    ----------
    path, home
        The file or folder, and the folder that must contain it.
    what
        Name of the path in messages.

    Raises
    ------
    OutputError
        It is elsewhere.
    """
    real, own = path.resolve(), home.resolve()
    if real.is_relative_to(own):
        return
    if _lies_in(path, home):
        raise OutputError(
            f"{what} is a link, or is in one, that leads out of the project's folder, to {real}. "
            "Nothing is written there: remove the link, or put a copy in its place"
        )
    raise OutputError(
        f"{what} is outside the project's folder {own}. The page writes nothing outside it: name "
        "a place inside it in the project file"
    )


def _lies_in(path: Path, home: Path) -> bool:
    """Return whether a path is textually inside a folder, without following links."""
    return Path(os.path.abspath(path)).is_relative_to(os.path.abspath(home))  # noqa: PTH100


def check_no_originals(folder: Path, photos: Iterable[str]) -> None:
    """Refuse to write pictures into a folder that contains the photos themselves.

    Raises
    ------
    OutputError
        One of them is in it.
    """
    if any(Path(path).resolve().parent == folder.resolve() for path in photos):
        raise OutputError(
            f"{folder}: holds the photos themselves, which are never written to; choose another "
            "folder with --output"
        )


PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")

MAX_ENTRIES = 200_000
"""Largest number of files and folders searched for photos: a few seconds, not a whole disk."""


def find_matching_files(pattern: str, way_out: str) -> list[Path]:
    """Find the files of an absolute pattern, in the order of their paths.

    Folders that match a wildcard are skipped. Broken links, pipes and devices are among the files
    if there are other ones: the reader of the files names them.

    Parameters
    ----------
    pattern
        May hold ``*``, ``**`` and ``[..]``. Capitals in names of files count.
    way_out
        Remedy in the message where nothing matches.

    Raises
    ------
    InputError
        Nothing matches, no match is a regular file, or too many match to be intended.
    """
    start, recursive, _ = pattern.partition("**")
    if recursive:
        _require_few(pattern, start)
    # patterns are absolute texts that may hold ** and [..], which only glob supports
    found = glob.iglob(pattern, recursive=True)  # noqa: PTH207
    found = (name for name in found if _has_case(name, pattern))
    names = sorted(itertools.islice(found, MAX_ENTRIES + 1))
    if len(names) > MAX_ENTRIES:
        raise InputError(pattern, f"names more than {MAX_ENTRIES:,} files: {_NARROWER}")
    kinds = {name: describe_non_file(name) for name in names}
    odd = [name for name, kind in kinds.items() if kind and not Path(name).is_dir()]
    files = [Path(name) for name in names if name in odd or not kinds[name]]
    if names and len(files) == len(odd):
        name = odd[0] if odd else names[0]
        raise InputError(
            escape_unshowable(name), f"is {kinds[name]}: take it out of {pattern!r}, or replace it"
        )
    if not files:
        folder = Path(pattern).parent
        if folder.is_dir() and not os.access(folder, os.R_OK | os.X_OK):
            raise InputError(folder, "cannot be read: ask for the right to, or copy the photos")
        raise InputError(pattern, f"matches no file (capitals count); {way_out}")
    return files


def _has_case(name: str, pattern: str) -> bool:
    """Return whether a file name has the capitals of its pattern, which glob ignores on Windows.

    A project then has the same photos on each system.
    """
    return fnmatch.fnmatchcase(Path(name).name, Path(pattern).name)


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


def write_out(path: str | Path) -> str:
    r"""Write a path as text; bytes of its names that are none become ``\x..``."""
    return os.fsencode(path).decode(errors="backslashreplace")


def check_name(path: Path) -> None:
    """Check that a file name can be written in other files.

    Raises
    ------
    InputError
        Names the character.
    """
    written = write_out(path)
    if written != str(path):
        raise InputError(
            escape_unshowable(written),
            "the photo's name or that of a folder is no text that can be written: rename it",
        )
    if fault := find_unshowable(path.name):
        raise InputError(escape_unshowable(str(path)), f"the photo's name holds {fault}: rename it")


def digest_inputs(
    paths: Iterable[str | Path], folder: str | Path | None = None
) -> tuple[InputDigest, ...]:
    """Digest input files, each once, in the given order.

    Parameters
    ----------
    paths
        The files.
    folder
        Paths inside this folder (the project's) are named relative to it, with ``/``, so that
        results do not depend on the project's location; others are unchanged.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    return tuple(digest_file(path, folder) for path in dict.fromkeys(map(Path, paths)))


def digest_file(path: str | Path, folder: str | Path | None = None) -> InputDigest:
    """Digest one input file; see `digest_inputs`."""
    path = Path(path)
    try:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
            size = os.fstat(stream.fileno()).st_size
    except OSError as fault:
        raise InputError(path, describe_unread(fault)) from fault
    name = str(path) if folder is None else find_relative_name(path, folder)
    return InputDigest(path=name, sha256=sha256, size_bytes=size)


def find_relative_name(path: str | Path, folder: str | Path) -> str:
    """Return a path relative to a folder, with ``/``; one outside of it unchanged."""
    whole = Path(path).absolute()
    return whole.relative_to(folder).as_posix() if whole.is_relative_to(folder) else str(path)


def photo_files(frames: FrameResults) -> tuple[str, ...]:
    """Return the (F,) paths by which the photos of a result can be opened."""
    return tuple(str(Path(frames.folder) / path) for path in frames.path)
