"""Updating of picks.csv, lines.csv and measure.csv, keeping all other content."""

from __future__ import annotations

import math
from collections.abc import Sequence

from uavgram.io.tables.rewrite import Cells, new_table, rewritten_table
from uavgram.model.survey.observations import KnownLines, MeasurementRequest, Picks

PICKS_HEADER = ("image", "label", "u_px", "v_px", "sigma_px", "height_m")
LINES_HEADER = ("name", "from", "to", "length_m", "sigma_m", "use")
MEASURE_HEADER = ("name", "kind", "points", "parameters")


def picks_content(content: bytes | None, before: Picks, after: Picks) -> bytes | None:
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
    return _content(content, _pick_cells(before), _pick_cells(after), PICKS_HEADER, key)


def lines_content(content: bytes | None, before: KnownLines, after: KnownLines) -> bytes | None:
    """Update lines.csv with other lengths.

    Parameters
    ----------
    content, before, after
        As for `picks_content`.
    """
    return _content(content, _line_cells(before), _line_cells(after), LINES_HEADER, ("name",))


def measure_content(
    content: bytes | None,
    before: Sequence[MeasurementRequest],
    after: Sequence[MeasurementRequest],
) -> bytes | None:
    """Update measure.csv with other measurements.

    Parameters
    ----------
    content, before, after
        As for `picks_content`.
    """
    cells = _request_cells(before), _request_cells(after)
    return _content(content, *cells, MEASURE_HEADER, ("name",))


def _content(
    content: bytes | None,
    before: Sequence[Cells],
    after: Sequence[Cells],
    header: Sequence[str],
    key: Sequence[str],
) -> bytes | None:
    if content is not None:
        return rewritten_table(content, before, after, key)
    if not after:
        return None
    more = [name for name in after[0] if name not in header and any(row[name] for row in after)]
    return new_table([*header, *more], after)


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
