"""Find the projects of a batch: by folders, patterns, files, and lists of them."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Iterator
from pathlib import Path

from uavgram.config.project import PROJECT_FILE
from uavgram.errors import InputError, UavgramError
from uavgram.input_files import read_text

_PROJECTS = (".yaml", ".yml")


def find_projects(wanted: Iterable[str | Path]) -> tuple[Path, ...]:
    """Find project files in the given order, each once.

    Parameters
    ----------
    wanted
        Project files; folders, which stand for every project.yaml in them at any depth; patterns
        with ``*`` and ``**``; and list files, with one of these on each line, relative to the list,
        and ``#`` before remarks.

    Raises
    ------
    InputError
        A named file or folder does not exist, or a pattern matches nothing.
    UavgramError
        There is no project at all.
    """
    named = list(wanted)
    found: dict[Path, Path] = {}
    for one in named:
        for path in _meant(Path(one)):
            found.setdefault(path.resolve(), path)
    if not found:
        raise UavgramError(
            "there is no survey to measure: name project files, folders that hold them, or a "
            "pattern (uavgram batch 'surveys/*/project.yaml')"
        )
    return tuple(found.values())


def _meant(path: Path) -> Iterator[Path]:
    if path.is_dir():
        inside = sorted(path.rglob(PROJECT_FILE))
        if not inside:
            raise InputError(
                path, f"holds no {PROJECT_FILE}, nor does a folder in it: name another"
            )
        yield from inside
    elif not path.exists() and glob.has_magic(str(path)):
        matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207 (absolute ones too)
        if not matches:
            raise InputError(path, "matches no file: correct the pattern (quote it in a shell)")
        for match in matches:
            yield from _meant(Path(match))
    elif path.exists() and path.suffix.lower() not in _PROJECTS:
        yield from _listed(path)
    elif path.exists():
        yield path
    else:
        raise InputError(path, "there is no such file: correct the name")


def _listed(path: Path) -> Iterator[Path]:
    """Yield the projects of a list file; report a wrong line with its number."""
    lines = read_text(path, "so it is no list of projects").splitlines()
    for number, line in enumerate(lines, start=1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        one = path.parent / name
        if one.is_file() and one.suffix.lower() not in _PROJECTS:
            raise InputError(path, f"{name!r} is no project file (.yaml): correct it", number)
        try:
            yield from _meant(one)
        except InputError as fault:
            raise InputError(path, f"{name!r}: {fault.message}", number) from fault
