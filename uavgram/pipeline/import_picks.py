"""Import picks that were made in another program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.input_files import refuse_unread
from uavgram.io.imports import GcpSigmas, read_gcp_list, read_labelme
from uavgram.io.outputs import replace_bytes
from uavgram.io.tables.updates import create_control, create_picks
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.observations import ImportedPicks, KnownPoints
from uavgram.stages.messages import order_messages


@dataclass(frozen=True, kw_only=True)
class ControlFiles:
    """Files for the coordinates of a gcp_list.txt.

    Attributes
    ----------
    path
        The control.csv.
    sigmas
        Their sigmas.
    check
        Labels of the points that go to `check_path` instead: only to judge the result.
    check_path
        The check.csv.
    """

    path: Path
    sigmas: GcpSigmas
    check: tuple[str, ...] = ()
    check_path: Path = Path("check.csv")


@dataclass(frozen=True)
class ImportCounts:
    """Numbers of imported items, and messages."""

    picks: int
    labels: int
    images: int
    control: int
    check: int
    messages: tuple[Message, ...]


def import_picks(
    files: Sequence[Path],
    output: Path,
    control: ControlFiles | None = None,
) -> ImportCounts:
    """Write a new picks.csv from LabelMe's JSON files and gcp_list.txt of OpenDroneMap.

    Parameters
    ----------
    files
        Any number of either kind.
    output
        The picks.csv to write.
    control
        Also write the coordinates in a gcp_list.txt.

    Raises
    ------
    UavgramError
        A file is of neither kind or wrong, two files pick one label in one photo, or a file to
        write holds more than a header. Nothing is written then.
    """
    read = [_read(path, None if control is None else control.sigmas) for path in files]
    _check_doubles(files, read)
    together = ImportedPicks(
        image=tuple(name for one in read for name in one.image),
        label=tuple(name for one in read for name in one.label),
        pixel_px=np.concatenate([one.pixel_px for one in read]),
        known=next((one.known for one in read if one.known is not None), None),
        messages=order_messages(*(message for one in read for message in one.messages)),
    )
    tables = {} if control is None else _tables(files[0], together.known, control)
    contents = {output: create_picks(together, output)}
    contents |= {path: create_control(known, path) for path, known in tables.items()}
    for path, content in contents.items():
        replace_bytes(path, content)
    checks = 0 if control is None else len(control.check)
    return ImportCounts(
        picks=len(together.image),
        labels=len(set(together.label)),
        images=len(set(together.image)),
        control=sum(len(known.label) for known in tables.values()) - checks,
        check=checks,
        messages=together.messages,
    )


def _tables(
    file: Path, known: KnownPoints | None, control: ControlFiles
) -> dict[Path, KnownPoints]:
    """Return the points of each file to write: check points separate from control points."""
    if known is None:
        raise InputError(file, "holds no coordinates: leave --control out")
    for label in control.check:
        if label not in known.label:
            hint = suggest_spelling(label, known.label) or f"it has {', '.join(known.label)}"
            raise InputError(file, f"has no point {label!r}, which --check names: {hint}")
    is_check = np.array([label in control.check for label in known.label])
    if is_check.all():
        raise InputError(file, "--check names every point, so none is left to control: name fewer")
    if not is_check.any():
        return {control.path: known}
    return {
        control.path: _select_points(known, ~is_check),
        control.check_path: _select_points(known, is_check),
    }


def _select_points(known: KnownPoints, rows: Bools) -> KnownPoints:
    return replace(
        known,
        label=tuple(known.label[k] for k in np.flatnonzero(rows)),
        coordinates=known.coordinates[rows],
        sigma_m=known.sigma_m[rows],
    )


def _read(path: Path, sigmas: GcpSigmas | None) -> ImportedPicks:
    if path.suffix.lower() == ".json":
        return read_labelme(path)
    if path.suffix.lower() == ".txt":
        return read_gcp_list(path, sigmas)
    refuse_unread(path)
    raise InputError(path, "is neither LabelMe's .json nor a gcp_list.txt")


def _check_doubles(files: Sequence[Path], read: Sequence[ImportedPicks]) -> None:
    first: dict[tuple[str, str], Path] = {}
    lists = [path for path, one in zip(files, read, strict=True) if one.known is not None]
    if len(lists) > 1:
        raise InputError(lists[1], f"holds coordinates too, as {lists[0]} does: import one")
    for path, one in zip(files, read, strict=True):
        for image, label in zip(one.image, one.label, strict=True):
            earlier = first.setdefault((image, label), path)
            if earlier != path:
                raise InputError(
                    path, f"picks {label!r} in {image!r}, and so does {earlier}: keep one"
                )
