"""Folders of this computer that a page may show, below the user's home and mounted drives."""

from __future__ import annotations

import os
import string
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.photos.files import PHOTO_SUFFIXES

MAX_FOLDERS = 500
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
        Number of photos in it; if there are none, in its subfolders.
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

    def checked(self, folder: Path) -> Path:
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
            inner = _folders(self.checked(folder))
        except OSError as fault:
            raise InputError(
                folder,
                f"cannot be read ({fault.strerror}): choose another folder, or ask who looks after "
                "this computer for the right to read it",
            ) from fault
        return tuple(count_photos(path) for path in inner)


def count_photos(folder: Path) -> ListedFolder:
    """Count the photos of a folder, or of its subfolders; unreadable ones count as empty."""
    names = _names(folder)
    photos = own = _photos(names)
    if not own:
        try:
            inner = [_names(one) for one in _folders(folder)[:MAX_SUBFOLDERS]]
        except OSError:
            inner = []
        photos = sum(_photos(one) for one in inner if RESULTS not in one)
    return ListedFolder(path=folder, photos=photos, are_inner=not own, has_project=PROJECT in names)


def _names(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in islice(entries, MAX_ENTRIES)]
    except OSError:
        return []


def _photos(names: list[str]) -> int:
    return sum(not name.startswith(".") and name.lower().endswith(PHOTO_SUFFIXES) for name in names)


def _folders(folder: Path) -> list[Path]:
    with os.scandir(folder) as entries:
        inner = (
            Path(entry.path)
            for entry in entries
            if not entry.name.startswith((".", "$")) and entry.is_dir(follow_symlinks=False)
        )
        found = list(islice(inner, MAX_FOLDERS))
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
