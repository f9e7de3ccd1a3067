"""Take over picks that were made in another program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.imports.gcp_list import read_gcp_list
from uavgram.io.imports.labelme import read_labelme
from uavgram.io.picks_writer import write_new_control, write_new_picks
from uavgram.model.imported import ImportedPicks
from uavgram.model.message import Message
from uavgram.stages.tell import told


@dataclass(frozen=True)
class Imported:
    """How much was taken over, and what is to be said about it."""

    picks: int
    labels: int
    images: int
    control: int
    messages: tuple[Message, ...]


def import_picks(
    files: Sequence[Path],
    output: Path,
    control: Path | None = None,
    control_sigma_m: float | None = None,
) -> Imported:
    """Write a new picks.csv from LabelMe's JSON files and gcp_list.txt of OpenDroneMap.

    Parameters
    ----------
    files
        Any number of either kind.
    output
        The picks.csv to write.
    control, control_sigma_m
        Also write the coordinates in a gcp_list.txt as control points, with this sigma.

    Raises
    ------
    UavgramError
        A file is of neither kind or wrong, two files pick one label in one photo, or a file to
        write is there already. Nothing is written then.
    """
    read = [_read(path, control_sigma_m) for path in files]
    _check_doubles(files, read)
    together = ImportedPicks(
        image=tuple(name for one in read for name in one.image),
        label=tuple(name for one in read for name in one.label),
        pixel_px=np.concatenate([one.pixel_px for one in read]),
        known=next((one.known for one in read if one.known is not None), None),
        messages=told(*(message for one in read for message in one.messages)),
    )
    if control is not None:
        if together.known is None:
            raise InputError(files[0], "holds no coordinates: leave --control out")
        if control.exists():
            raise InputError(control, "is there already: name another file, or move this one away")
    write_new_picks(together, output)
    if control is not None and together.known is not None:
        write_new_control(together.known, control)
    return Imported(
        picks=len(together.image),
        labels=len(set(together.label)),
        images=len(set(together.image)),
        control=0 if control is None or together.known is None else len(together.known.label),
        messages=together.messages,
    )


def _read(path: Path, control_sigma_m: float | None) -> ImportedPicks:
    if path.suffix.lower() == ".json":
        return read_labelme(path)
    if path.suffix.lower() == ".txt":
        return read_gcp_list(path, control_sigma_m)
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
