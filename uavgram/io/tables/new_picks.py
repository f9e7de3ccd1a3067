"""New picks.csv and control.csv; a file that is there is never written over."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_rows import csv_text
from uavgram.io.tables.known_points import GEODETIC, THREE_SIGMAS
from uavgram.io.tables.picked import PICKS_HEADER
from uavgram.io.tables.spreadsheet_cells import guarded
from uavgram.model.survey.imported import ImportedPicks
from uavgram.model.survey.observations import KnownPoints

CONTROL_HEADER = ("label", *GEODETIC, *THREE_SIGMAS)


def write_new_picks(picks: ImportedPicks, path: Path) -> None:
    """Write picks.csv.

    Raises
    ------
    InputError
        The file is there already.
    OutputError
        It cannot be written.
    """
    _write_new(path, PICKS_HEADER[:4], picks.image, picks.label, *picks.pixel_px.T.tolist())


def write_new_control(known: KnownPoints, path: Path) -> None:
    """Write control.csv with geodetic coordinates; errors as for `write_new_picks`."""
    numbers = (*known.coordinates.T.tolist(), *known.sigma_m.T.tolist())
    _write_new(path, CONTROL_HEADER, known.label, *numbers)


def _write_new(path: Path, header: Sequence[str], *columns: Sequence[str | float]) -> None:
    if path.exists():
        raise InputError(path, "is there already: name another file, or move this one away")
    texts = [[guarded(c) if isinstance(c, str) else repr(c) for c in cells] for cells in columns]
    replace_text(path, csv_text(header, zip(*texts, strict=True)))
