"""Reader of project.yaml, with checks of its input files."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from uavgram.config.strict_yaml import Document, KeyPath, Plain, format_key_path, read_yaml
from uavgram.config.validation import Fault, format_value, validate
from uavgram.errors import GeometryError, InputError, describe_non_file, suggest_spelling
from uavgram.geometry.geodesy import normalise_crs
from uavgram.input_files import binary_kind, unread_format
from uavgram.model.limits import find_date_fault
from uavgram.model.naming import BOARD_PLATE, SHORT_FORMS
from uavgram.model.options import CAMERA_OF_PHOTOS, CAMERA_UNKNOWN, TIES_FOUND, Project

_INPUT_FILES = (
    "log",
    "poses",
    "camera",
    "picks",
    "lines",
    "known",
    "measure",
    "control",
    "control_lines",
    "check",
    "ties",
    "plan",
)
PROJECT_FILE = "project.yaml"
PICKED_FILES = ("picks", "lines", "measure", "ties")
"""Inputs made by the program, which may be missing in an unfinished project."""

_REMEDIES = {"ties": "; write `ties: auto` to have them found"}
"""Remedies for missing files that the program can make."""

FROM_PHOTOS = "exif"
"""Value of `poses` that is not a path."""

_NO_PATHS = {
    ("poses", FROM_PHOTOS),
    ("camera", CAMERA_OF_PHOTOS),
    ("camera", CAMERA_UNKNOWN),
    ("ties", TIES_FOUND),
}


NAME_PROJECT = "name the project file (project.yaml), or the folder of the photos"


def load_project(path: str | Path, *, unfinished: bool = False) -> Project:
    """Read a project file.

    Parameters
    ----------
    path
        The file, or its folder (see `project_file`). Its paths are relative to its folder.
    unfinished
        Whether picks, ties, lengths and measurements may name files that do not exist yet.

    Returns
    -------
    Project
        With absolute paths and patterns (the folder's own glob characters escaped), and the
        folder's name where the file gives none. `units`: ``metric`` (metres and km/h, the default),
        ``imperial`` (feet and inches, and mph), or ``{length: m | ft | ft-in, speed: km/h | mph |
        m/s}``: only for display, all files keep metres and m/s.

    Raises
    ------
    InputError
        Names file, line, key and value of every mistake at once: syntax, unknown or missing keys,
        wrong types, values out of range, input files that do not exist.
    """
    path = project_file(path).absolute()
    is_yaml = path.suffix.lower() in {".yaml", ".yml"}
    try:
        document = read_yaml(path)
    except InputError as fault:
        if is_yaml:
            raise
        raise InputError(path, f"is no project file: {NAME_PROJECT}") from fault
    data = document.data
    if not is_yaml and not isinstance(data, dict):
        raise InputError(path, f"is no project file: {NAME_PROJECT}")
    missing: tuple[Fault, ...] = ()
    if isinstance(data, dict):
        data = {"name": path.parent.name, **data}
        for key in ("images", "leave_out"):
            if isinstance(data.get(key), str):
                data[key] = [data[key]]
        if isinstance(left_out := data.get("leave_out"), list):  # names of photos, or their paths
            data["leave_out"] = [Path(n).name if isinstance(n, str) else n for n in left_out]
        data, wrong_units = _expand_units(data)
        keys = [k for k in _INPUT_FILES if not (unfinished and k in PICKED_FILES)]
        missing = (
            _find_missing_files(data, path.parent, keys)
            + _find_unsuitable_crs(data)
            + _find_invalid_board(data)
            + _find_unread_poses(data, path.parent)
            + _find_impossible_date(data)
        )
        missing += wrong_units
    project = validate(Project, Document(path, data, document.lines, document.faults), missing)
    return _make_paths_absolute(project, path.parent)


def make_key_error(path: str | Path, at: KeyPath, text: str) -> InputError:
    """Make the error of a value that the project's data contradict, with the line of its key.

    Parameters
    ----------
    path
        The project file.
    at
        The key with those that enclose it: ``("world", "origin")``.
    text
        Finding and remedy.
    """
    line = read_yaml(Path(path)).line_of(at) if Path(path).is_file() else None
    return InputError(path, f"{format_key_path(at)}: {text}", line)


def project_file(path: str | Path) -> Path:
    """Return the project file for a path: project.yaml for a folder.

    Raises
    ------
    InputError
        The folder has none, or the file is a photo, a flight log or the like.
    """
    path = Path(path)
    if not path.is_dir():
        if kind := binary_kind(path):
            raise InputError(path, f"is {kind}: {NAME_PROJECT}")
        return path
    file = path / PROJECT_FILE
    if not file.exists():
        where = "" if path == Path() else f" {path}"
        raise InputError(
            file,
            f"there is no such file: name the project file, or write one with `uavgram new{where}`",
        )
    return file


def make_paths_relative(project: Project, folder: Path) -> Project:
    """Return the project with paths relative to its folder, as written in its file.

    Parameters
    ----------
    project
        As `load_project` returns it.
    folder
        The folder of its file.
    """
    folder = folder.absolute()
    root = glob.escape(str(folder))
    return _replace_paths(
        project,
        of_pattern=lambda pattern: _from_folder(pattern, root),
        of_file=lambda name: _from_folder(name, str(folder)),
    )


def _from_folder(path: str, folder: str) -> str:
    return Path(os.path.relpath(path, folder)).as_posix() if Path(path).is_absolute() else path


def _find_missing_files(
    data: dict[str, Plain], folder: Path, keys: Sequence[str]
) -> tuple[Fault, ...]:
    """Find the input files named by `keys` that do not exist."""
    faults = []
    for key in keys:
        for name in _names(data.get(key)):
            if _is_no_path(key, name) or (folder / name).is_file():
                continue
            faults.append(
                Fault((key,), _explain_missing_file(folder / name, name) + _REMEDIES.get(key, ""))
            )
    return tuple(faults)


def _names(value: Plain) -> list[str]:
    """Return the non-empty texts of a value or a list of values."""
    values = value if isinstance(value, list) else [value]
    return [name for name in values if isinstance(name, str) and name]


def _find_unsuitable_crs(data: dict[str, Plain]) -> tuple[Fault, ...]:
    """Find a coordinate system that is unsuitable for maps in metres."""
    crs = data.get("crs", "auto")
    if not isinstance(crs, str) or crs in ("", "auto"):
        return ()
    try:
        normalise_crs(crs)
    except GeometryError as fault:
        return (Fault(("crs",), str(fault)),)
    return ()


def _find_unread_poses(data: dict[str, Plain], folder: Path) -> tuple[Fault, ...]:
    """Find files of poses in formats without a reader."""
    poses = data.get("poses")
    names = [name for name in (poses if isinstance(poses, list) else [poses]) if name]
    kinds = {name: unread_format(folder / name) for name in names if isinstance(name, str)}
    return tuple(
        Fault(("poses",), f"{name} is a {kind.name}, which is not read: {kind.way_out}")
        for name, kind in kinds.items()
        if kind
    )


def _find_impossible_date(data: dict[str, Plain]) -> tuple[Fault, ...]:
    """Find a date of the case that does not exist."""
    case = data.get("case")
    date = case.get("date") if isinstance(case, dict) else None
    fault = find_date_fault(date) if isinstance(date, str) else ""
    return (Fault(("case", "date"), fault),) if fault else ()


def _expand_units(data: dict[str, Plain]) -> tuple[dict[str, Plain], tuple[Fault, ...]]:
    """Expand short forms of `units`; remove invalid units and return their faults."""
    units = data.get("units")
    length = units.get("length") if isinstance(units, dict) else units
    fault = ""
    if isinstance(length, str) and "survey" in length.lower():
        fault = (
            "the US survey foot is not offered, which was given up in 2022 and differs by two "
            "millionths: write ft, the international foot of 0.3048 m"
        )
    elif isinstance(units, str) and units not in SHORT_FORMS:
        fault = (
            "must be metric, imperial, or such as {length: ft, speed: mph} "
            f"(got {format_value(units)})"
        )
    if fault:
        return {key: value for key, value in data.items() if key != "units"}, (
            Fault(("units",), fault),
        )
    if isinstance(units, str):
        return {**data, "units": dict(asdict(SHORT_FORMS[units]))}, ()
    return data, ()


def _find_invalid_board(data: dict[str, Plain]) -> tuple[Fault, ...]:
    """Find an invalid ChArUco board among the targets."""
    targets = data.get("targets")
    family = targets.get("family") if isinstance(targets, dict) else None
    if not isinstance(family, str) or not family.startswith(f"{BOARD_PLATE}:"):
        return ()
    from uavgram.config.board_text import parse_board  # noqa: PLC0415 - loads OpenCV

    try:
        parse_board(family)
    except InputError as fault:
        return (Fault(("targets", "family"), fault.message),)
    return ()


def _is_no_path(key: str, name: str | None) -> bool:
    return (key, name) in _NO_PATHS


def _explain_missing_file(path: Path, name: str) -> str:
    if what := describe_non_file(path):
        return f"{name!r} is {what}: name a file"
    if not path.parent.is_dir():
        return f"no such file {name!r}: there is no folder {path.parent}"
    guess = suggest_spelling(path.name, [p.name for p in path.parent.iterdir()])
    return f"no such file {name!r} in {path.parent}" + (f": {guess}" if guess else "")


def _make_paths_absolute(project: Project, folder: Path) -> Project:
    root = glob.escape(str(folder))
    return _replace_paths(
        project,
        of_pattern=lambda pattern: pattern if Path(pattern).is_absolute() else f"{root}/{pattern}",
        of_file=lambda name: str(folder / name),
    )


def _replace_paths(
    project: Project, of_pattern: Callable[[str], str], of_file: Callable[[str], str]
) -> Project:
    """Return the project with other patterns of photos, and other names of files."""
    changed: dict[str, str | tuple[str, ...]] = {"images": tuple(map(of_pattern, project.images))}
    for key in (*_INPUT_FILES, "output"):
        named = getattr(project, key)
        names = [
            name if _is_no_path(key, name) else of_file(name)
            for name in (named if isinstance(named, tuple) else (named,))
            if name is not None
        ]
        if names:
            changed[key] = tuple(names) if isinstance(named, tuple) else names[0]
    return replace(project, **changed)  # type: ignore[arg-type]
