"""Files written by this program, protected against links in an unpacked folder."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from uavgram.errors import OutputError

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
