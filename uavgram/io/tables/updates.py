"""Updates of picks.csv, lines.csv and measure.csv that keep all other content, and new tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from uavgram.errors import InputError
from uavgram.input_files import read_bytes
from uavgram.io.tables.csv_tables import read_blocks, read_header
from uavgram.io.tables.known import GEODETIC, THREE_SIGMAS
from uavgram.io.tables.rewrite import Cells, create_table, rewrite_table
from uavgram.model.survey.observations import (
    ImportedPicks,
    KnownLines,
    KnownPoints,
    MeasurementRequest,
    Picks,
)

PICKS_HEADER = ("image", "label", "u_px", "v_px", "sigma_px", "height_m")
LINES_HEADER = ("name", "from", "to", "length_m", "sigma_m", "use")
MEASURE_HEADER = ("name", "kind", "points", "parameters")


def update_picks(content: bytes | None, before: Picks, after: Picks) -> bytes | None:
    """Update picks.csv with other picks.

    Parameters
    ----------
    content
        The file; None where it does not exist.
    before
        Picks in the file.
    after
        New picks.

    Returns
    -------
    bytes or None
        The file, `content` itself where nothing changed; None where none is needed.
    """
    key = ("image", "label")
    return _update(content, _pick_cells(before), _pick_cells(after), PICKS_HEADER, key)


def update_lines(content: bytes | None, before: KnownLines, after: KnownLines) -> bytes | None:
    """Update lines.csv with other lengths.

    Parameters
    ----------
    content, before, after
        As for `update_picks`.
    """
    return _update(content, _line_cells(before), _line_cells(after), LINES_HEADER, ("name",))


def update_measure(
    content: bytes | None,
    before: Sequence[MeasurementRequest],
    after: Sequence[MeasurementRequest],
) -> bytes | None:
    """Update measure.csv with other measurements.

    Parameters
    ----------
    content, before, after
        As for `update_picks`.
    """
    cells = _request_cells(before), _request_cells(after)
    return _update(content, *cells, MEASURE_HEADER, ("name",))


def _update(
    content: bytes | None,
    before: Sequence[Cells],
    after: Sequence[Cells],
    header: Sequence[str],
    key: Sequence[str],
) -> bytes | None:
    if content is not None:
        return rewrite_table(content, before, after, key)
    if not after:
        return None
    more = [name for name in after[0] if name not in header and any(row[name] for row in after)]
    return create_table([*header, *more], after)


def _pick_cells(picks: Picks) -> list[Cells]:
    areas = picks.area or ("",) * len(picks.image)
    return [
        {
            "image": picks.image[i],
            "label": picks.label[i],
            "u_px": repr(float(picks.pixel_px[i, 0])),
            "v_px": repr(float(picks.pixel_px[i, 1])),
            "sigma_px": _optional(float(picks.sigma_px[i])),
            "height_m": "free" if picks.is_free[i] else _optional(float(picks.height_m[i])),
            "height_sigma_m": _optional(float(picks.height_sigma_m[i])),
            "area": areas[i],
            **_made_by(picks, i),
        }
        for i in range(len(picks.image))
    ]


def _made_by(picks: Picks, i: int) -> Cells:
    """Format the origin of a pick; empty for one made by hand."""
    source = picks.source_of(i)
    u, v = picks.from_px[i].tolist()
    return {
        "source": "" if source == "hand" else source,
        "score": _optional(float(picks.score[i])),
        "from_image": picks.from_image[i] if picks.from_image else "",
        "from_u_px": _optional(u),
        "from_v_px": _optional(v),
    }


def _line_cells(lines: KnownLines) -> list[Cells]:
    return [
        {
            "name": lines.name[i],
            "from": lines.start[i],
            "to": lines.end[i],
            "length_m": repr(float(lines.length_m[i])),
            "sigma_m": repr(float(lines.sigma_m[i])),
            "use": "" if lines.adjust[i] else "check",  # an empty cell is the default
            "tape": lines.tape_of(i),
            "along": "" if lines.along_of(i) == "slope" else lines.along_of(i),
        }
        for i in range(len(lines.name))
    ]


def _request_cells(requests: Sequence[MeasurementRequest]) -> list[Cells]:
    return [
        {
            "name": request.name,
            "kind": request.kind,
            "points": ";".join(request.points),
            "parameters": request.parameters_text,
        }
        for request in requests
    ]


def _optional(number: float) -> str:
    return repr(number) if math.isfinite(number) else ""


CONTROL_HEADER = ("label", *GEODETIC, *THREE_SIGMAS)


def create_picks(picks: ImportedPicks, path: Path) -> bytes:
    """Create a picks.csv, if the file does not exist or has only a header.

    Raises
    ------
    InputError
        The file has content already.
    """
    return _create_unless_filled(
        path, PICKS_HEADER[:4], picks.image, picks.label, *picks.pixel_px.T.tolist()
    )


def create_control(known: KnownPoints, path: Path) -> bytes:
    """Create a control.csv with geodetic coordinates; errors as for `create_picks`."""
    numbers = (*known.coordinates.T.tolist(), *known.sigma_m.T.tolist())
    return _create_unless_filled(path, CONTROL_HEADER, known.label, *numbers)


def _create_unless_filled(
    path: Path, header: Sequence[str], *columns: Sequence[str | float]
) -> bytes:
    texts = [[c if isinstance(c, str) else repr(c) for c in cells] for cells in columns]
    rows = [dict(zip(header, cells, strict=True)) for cells in zip(*texts, strict=True)]
    found = read_header(path) if path.exists() else None
    if found is None:  # no file, or an empty one
        return create_table(header, rows)
    is_filled = any(block.line or block.torn for block in read_blocks(path))
    if is_filled or not set(header) <= set(found[1]):
        raise InputError(path, "is there already: name another file, or move this one away")
    return rewrite_table(read_bytes(path), (), rows, header[:1])
