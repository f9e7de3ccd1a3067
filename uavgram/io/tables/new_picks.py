"""New picks.csv and control.csv; a table with content is never overwritten."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from uavgram.errors import InputError
from uavgram.input_files import read_bytes
from uavgram.io.tables.csv_tables import read_blocks, read_header
from uavgram.io.tables.known import GEODETIC, THREE_SIGMAS
from uavgram.io.tables.picked import PICKS_HEADER
from uavgram.io.tables.rewrite import new_table, rewritten_table
from uavgram.model.survey.observations import ImportedPicks, KnownPoints

CONTROL_HEADER = ("label", *GEODETIC, *THREE_SIGMAS)


def new_picks(picks: ImportedPicks, path: Path) -> bytes:
    """Create a picks.csv, if the file does not exist or has only a header.

    Raises
    ------
    InputError
        The file has content already.
    """
    return _filled(path, PICKS_HEADER[:4], picks.image, picks.label, *picks.pixel_px.T.tolist())


def new_control(known: KnownPoints, path: Path) -> bytes:
    """Create a control.csv with geodetic coordinates; errors as for `new_picks`."""
    numbers = (*known.coordinates.T.tolist(), *known.sigma_m.T.tolist())
    return _filled(path, CONTROL_HEADER, known.label, *numbers)


def _filled(path: Path, header: Sequence[str], *columns: Sequence[str | float]) -> bytes:
    texts = [[c if isinstance(c, str) else repr(c) for c in cells] for cells in columns]
    rows = [dict(zip(header, cells, strict=True)) for cells in zip(*texts, strict=True)]
    found = read_header(path) if path.exists() else None
    if found is None:  # no file, or an empty one
        return new_table(header, rows)
    is_filled = any(block.line or block.torn for block in read_blocks(path))
    if is_filled or not set(header) <= set(found[1]):
        raise InputError(path, "is there already: name another file, or move this one away")
    return rewritten_table(read_bytes(path), (), rows, header[:1])
