"""Start of the page: choosing a folder of this computer, inspecting it, and setting it up.

The page names a folder by the number under which it was listed, and files by the names found in
it: never by a path.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Literal, NoReturn, cast

from uavgram.errors import InputError
from uavgram.imaging.photos.preview import read_preview
from uavgram.io.files import check_inside
from uavgram.io.folders import (
    Browsable,
    ListedFolder,
    count_photos,
    find_flights,
    find_home_and_drives,
)
from uavgram.model.limits import (
    LONGEST_NAME,
    find_date_fault,
    find_unshowable,
    find_value_fault,
    range_of,
)
from uavgram.model.naming import SHORT_FORMS
from uavgram.model.options import CAMERA_OF_PHOTOS, CAMERA_UNKNOWN, Auto
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.pipeline.new import PROJECT, Choices
from uavgram.pipeline.setup import CASE, FolderSummary, Setup, SetupChoices, inspect_folder, set_up

MAX_REQUEST_BYTES = 100_000
NO_LOG: Literal["none"] = "none"
MAX_RECENT = 8
MAX_NEWEST = 5
PREVIEW_PX = 512
FULL_TURN_DEG = 360.0


_FOUND = "photos", "unusable", "logs", "cameras", "poses", "gcp_lists"
"""Files of a `FolderSummary` that other programs make."""


class FolderChooser:
    """Folders that may be chosen, by their numbers, and the files found in them.

    Parameters
    ----------
    named
        Folder named by the user in the terminal; None: none.
    roots
        Folders below which others may be listed; None: the home and the drives.
    """

    def __init__(self, named: Path | None = None, roots: Sequence[Path] | None = None) -> None:
        known = find_home_and_drives() if roots is None else roots
        self._collections = Browsable(known).roots
        self._folders = Browsable(known)
        self._named: Path | None = None
        self._opens = False
        self._files: dict[Path, str] = {}
        self._numbers: dict[Path, int] = {}
        self._found: dict[Path, FolderSummary] = {}
        self._recent: list[Path] = []
        if named is not None:
            self.choose(named)

    def beginning(self) -> m.Beginning:
        """Return the start of the page: the folder to set up at once, or the choice of one."""
        named = self._named
        chosen = named if named is not None else self._present()
        return {
            "folder": None if chosen is None else self._number(chosen),
            "is_chosen": named is not None and self._is_chosen(named),
            "opens": self._opens,
            "recent": [
                self._describe_folder(count_photos(path)) for path in self._recent if path.is_dir()
            ],
            "newest": [
                self._describe_folder(one)
                for one in find_flights(self._folders.roots)
                if one.path not in self._recent
            ][:MAX_NEWEST],
        }

    def _is_chosen(self, named: Path) -> bool:
        """Return whether a named folder is one flight, and not a home with any content."""
        return named not in self._collections or count_photos(named).is_flight(self._collections)

    def _present(self) -> Path | None:
        """Return the current folder at the start, or the home; None if neither may be listed."""
        for path in (Path.cwd(), *self._folders.roots[:1]):
            try:
                return self._folders.check_folder(path.resolve())
            except (InputError, OSError):
                continue
        return None

    def remember(self, project: Path) -> None:
        """Add a project's folder to those opened recently; forget the folder named by the user."""
        folder = self._allow(project)
        self._named, self._opens = None, False
        self._recent = [folder, *(one for one in self._recent if one != folder)][:MAX_RECENT]

    def choose(self, wanted: Path, *, opens: bool = False) -> None:
        """Start with this folder, or the folder of this project file.

        Parameters
        ----------
        wanted
            The folder or the file.
        opens
            Whether the page opens its project at once, if there is one.
        """
        folder = self._allow(wanted)
        self._named, self._opens = folder, opens and self._project(folder).is_file()

    def _allow(self, wanted: Path) -> Path:
        """Return the folder of a project, which may be listed from now on."""
        path = wanted.resolve()
        folder = path if path.is_dir() else path.parent
        self._files[folder] = PROJECT if path.is_dir() else path.name
        if self._folders.root_of(folder) is None:
            self._folders = Browsable((*self._folders.roots, folder))
        return folder

    def _project(self, folder: Path) -> Path:
        return folder / self._files.get(folder, PROJECT)

    def list_folders(self, number: str) -> m.ListedFolders:
        """Return the folders in a folder, and the path to it; an empty number lists the roots.

        Raises
        ------
        UavgramError
            The folder may not be shown, or cannot be read.
        """
        if not number:
            return {
                "number": None,
                "way": [],
                "photos": 0,
                "are_inner": False,
                "is_flight": False,
                "has_project": False,
                "folders": [
                    self._describe_folder(count_photos(root)) for root in self._folders.roots
                ],
            }
        folder = self._folder(number)
        root = self._folders.root_of(folder) or folder
        way = [folder, *(one for one in folder.parents if one.is_relative_to(root))][::-1]
        own = count_photos(folder)
        return {
            "number": self._number(folder),
            "way": [{"number": self._number(one), "name": self._name(one)} for one in way],
            "photos": own.photos,
            "are_inner": own.are_inner,
            "is_flight": own.is_flight(self._collections),
            "has_project": own.has_project,
            "folders": [self._describe_folder(one) for one in self._folders.folders_in(folder)],
        }

    def find_project_files(self, number: str) -> m.Found:
        """Return the files of a folder that a project can use.

        Raises
        ------
        UavgramError
            The folder may not be shown, cannot be read, or holds too much.
        """
        folder = self._folder(number)
        found = self._found[folder] = inspect_folder(folder)
        setup = asdict(found.setup)
        units = {units: word for word, units in SHORT_FORMS.items()}.get(found.setup.units, "")
        setup |= {"units": units, "case": {key: getattr(found.setup.case, key) for key in CASE}}
        own = {"number": self._number(folder), "name": self._name(folder), "path": str(folder)}
        return cast("m.Found", asdict(found) | own | {"setup": setup})

    def picture(self, number: str, group: str) -> bytes:
        """Return a JPEG of the first photo of a group.

        Raises
        ------
        UavgramError
            There is none, or it cannot be read.
        """
        folder = self._folder(number)
        found = self._found.get(folder)
        if found is None or not group.isdecimal() or int(group) >= len(found.photos[:1000]):
            raise RefusedError("there are no such photos")
        chosen = found.photos[int(group)]
        path = folder / Path(chosen.pattern).parent / chosen.example
        check_inside(path, folder, str(path))
        return read_preview(str(path), PREVIEW_PX)[0].jpeg

    def meant(self, request: bytes) -> Path:
        """Return the project file named by a request, without links; it may not exist yet.

        Raises
        ------
        UavgramError
            The folder does not exist.
        """
        return self._project(self._folder(str(_object(request).get("folder", "")))).resolve()

    def begin(self, request: bytes) -> Path:
        """Set up a project as a page requests it, and return its file.

        Raises
        ------
        UavgramError
            The request names files that were not found, the folder has changed since it was shown,
            the photos cannot be used as they are, or nothing can be written.
        """
        fields = _object(request)
        folder = self._folder(str(fields.get("folder", "")))
        found = self._found.get(folder)
        if fields.get("setup") is None:  # open the existing project unchanged
            if not self._project(folder).is_file():
                raise RefusedError("the folder has no project yet: look through it first")
            return self._project(folder)
        if found is None:
            raise RefusedError("the folder was not looked through: choose it again")
        if change := _describe_change(found, inspect_folder(folder)):
            raise RefusedError(change)
        return set_up(folder, _parse_setup(fields, found))

    def _folder(self, number: str) -> Path:
        if number.isdecimal():
            for folder, own in self._numbers.items():
                if own == int(number[:12]):
                    return self._folders.check_folder(folder)
        raise RefusedError("there is no such folder")

    def _number(self, folder: Path) -> int:
        return self._numbers.setdefault(folder, len(self._numbers))

    def _name(self, folder: Path) -> str:
        if folder == Path.home().resolve():
            return "Home"
        return folder.name or str(folder)

    def _name_way(self, folder: Path) -> str:
        root = self._folders.root_of(folder) or Path(folder.anchor)  # as named on the command line
        return " \u203a ".join(folder.parent.relative_to(root).parts) if folder != root else ""

    def _describe_folder(self, one: ListedFolder) -> m.Listed:
        return {
            "number": self._number(one.path),
            "name": self._name(one.path),
            "inside": self._name_way(one.path),
            "photos": one.photos,
            "is_flight": one.is_flight(self._collections),
            "has_project": one.has_project,
        }


def _describe_change(shown: FolderSummary, now: FolderSummary) -> str:
    """Describe how the usable files of a folder differ from those shown; empty where they do not.

    Photos may be copied, or become damaged, while a person looks at the page.
    """
    if all(getattr(shown, name) == getattr(now, name) for name in _FOUND):
        return ""
    were, are = (sum(group.count for group in one.photos) for one in (shown, now))
    count = f"It has {are} photos that can be used, not {were}." if are != were else ""
    damaged = (text for text in now.unusable if text not in shown.unusable)
    found = "The files of this folder have changed since they were listed."
    return " ".join(filter(None, (found, count, *damaged, "Look at the list, and begin again.")))


def _object(request: bytes) -> dict[str, Any]:
    try:
        fields = json.loads(request, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise RefusedError("the request is not JSON") from None
    if not isinstance(fields, dict):
        raise RefusedError("the request is not an object")
    return fields


def _no_number(text: str) -> NoReturn:
    raise RefusedError(f"{text} is no number")


def _parse_setup(fields: dict[str, Any], found: FolderSummary) -> SetupChoices:
    """Return the set-up requested by a page, after checking that all named files were found."""
    patterns = {one for photos in found.photos for one in (photos.pattern, *photos.names)}
    images = fields.get("images", [])
    if not isinstance(images, list) or not all(one in patterns for one in images):
        raise RefusedError("these photos were not found: choose the folder again")
    files = {
        "log": (*found.logs, NO_LOG, *((found.log,) if found.log else ())),
        "poses": found.poses,
        "camera": (
            *(camera.name for camera in found.cameras),
            *(CAMERA_OF_PHOTOS, CAMERA_UNKNOWN, found.camera or ""),
        ),
        "gcp_list": found.gcp_lists,
    }
    named: dict[str, str | None] = {}
    for key, names in files.items():
        named[key] = fields.get(key) or None
        if named[key] is not None and named[key] not in names:
            raise RefusedError(f"{key}: {str(named[key])[:80]!r} was not found in the folder")
    paths = {key: None if (name := named[key]) is None else Path(name) for key in named}
    return SetupChoices(
        choices=Choices(
            images=tuple(images),
            log=NO_LOG if named["log"] == NO_LOG else paths["log"],
            camera=paths["camera"],
            poses=paths["poses"],
        ),
        setup=_setup(fields["setup"], found.setup),
        gcp_list=named["gcp_list"],
        gcp_sigma_m=_sigma(fields.get("gcp_sigma_m", 0.02), "sigma_m", "gcp_sigma", "2 cm"),
    )


def _setup(said: object, before: Setup) -> Setup:
    if not isinstance(said, dict):
        raise RefusedError("the set-up is not an object")
    units, case = said.get("units"), said.get("case", {})
    if not isinstance(case, dict):
        raise RefusedError("the case is not an object")
    if units and units not in SHORT_FORMS:
        raise RefusedError("units are metric or imperial")
    texts: dict[str, Any] = {key: _text(case.get(key, ""), key) for key in CASE}
    if fault := find_date_fault(texts["date"]):
        raise _of_field("case-date", f"Date: {fault}.")
    return Setup(
        pitch_deg=_pitch(said.get("pitch_deg", "auto")),
        yaw_deg=_turn(said.get("yaw_deg", "auto"), "yaw"),
        roll_deg=_turn(said.get("roll_deg", "auto"), "roll"),
        reading_sigma_m=_sigma(
            said.get("reading_sigma_m", 0.01), "reading_sigma_m", "sigma", "1 cm"
        ),
        units=SHORT_FORMS[units] if units else before.units,
        case=replace(before.case, **texts),
    )


def _pitch(said: object) -> float | Auto:
    if said == "auto":
        return "auto"
    value = _number(said, "the camera's angle")
    if not -90.0 <= value <= 30.0:
        raise _of_field(
            "pitch_below",
            f"{-value:g} degrees below the horizon is not possible: straight down is 90, forward "
            "is 0.",
        )
    return value


def _turn(said: object, field: str) -> float | Auto:
    if said == "auto":
        return "auto"
    value = _number(said, f"the camera's {field}")
    if abs(value) > FULL_TURN_DEG:
        raise _of_field(field, f"{value:g} degrees: enter a number from -360 to 360.")
    return value


def _of_field(field: str, text: str) -> RefusedError:
    fault = RefusedError(text)
    fault.field = field
    return fault


def _sigma(said: object, key: str, field: str, example: str) -> float:
    """Check how far a value may be wrong, as for a key of a project file."""
    value = _number(said, field)
    if find_value_fault(key, value):
        most = range_of(key)[1]
        raise _of_field(
            field,
            f"{value:g} m is not possible: enter how far a value may be wrong, such as {example}, "
            f"and at most {most:g} m.",
        )
    return value


def _number(said: object, what: str) -> float:
    if isinstance(said, bool) or not isinstance(said, int | float) or not math.isfinite(said):
        raise RefusedError(f"{what} is no number")
    return float(said)


def _text(said: object, what: str) -> str:
    if not isinstance(said, str) or len(said) > LONGEST_NAME:
        raise RefusedError(f"{what}: at most {LONGEST_NAME} letters")
    if fault := find_unshowable(said):
        raise RefusedError(f"{what} holds {fault}")
    return said.strip()
