"""Updates of the user's CSV tables: everything that a change does not touch stays, to the byte.

The text is cut into raw cells. An unchanged row keeps its quotes, blanks and digits; a changed row
keeps those of its other cells; other columns, the order of columns and rows, blank lines, line
endings and a byte order mark stay.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from itertools import count
from pathlib import Path

from uavgram.errors import InputError
from uavgram.input_files import read_bytes
from uavgram.io.json_codec import Table
from uavgram.io.tables.csv_tables import find_separator, guard_formula, read_blocks, read_header
from uavgram.io.tables.known import GEODETIC, THREE_SIGMAS
from uavgram.model.observations import (
    ImportedPicks,
    KnownLines,
    KnownPoints,
    MeasurementRequest,
    Picks,
)

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
# A quoted cell may hold any text; one without quotes ends at a separator or at the end of its line.
_CELL = {
    mark: re.compile(rf'("(?:[^"]|"")*"[^{mark}\r\n]*|[^{mark}\r\n]*)({mark}|\r\n|\r|\n|\Z)')
    for mark in ",;"
}
_COMMA_NUMBER = re.compile(r"[-+]?[0-9]*,[0-9]+")
_POINT_NUMBER = re.compile(r"[-+]?[0-9]+\.[0-9]+")

Cells = Mapping[str, str]


@dataclass(frozen=True)
class _Record:
    """Line of the file: its raw cells and its ending (the last one may have none)."""

    cells: tuple[str, ...]
    end: str

    def text(self, separator: str) -> str:
        return separator.join(self.cells) + self.end

    @property
    def is_blank(self) -> bool:
        return not any(cell.strip() for cell in self.cells)


@dataclass(frozen=True)
class _Kept:
    """Changes of the rows of a file.

    Attributes
    ----------
    changes
        For rows that stay: row index -> changed cells.
    added
        New rows after a row that stays, -1: after the header.
    """

    changes: dict[int, dict[str, str]] = field(default_factory=dict)
    added: dict[int, list[Cells]] = field(default_factory=dict)


def rewrite_table(
    content: bytes,
    before: Sequence[Cells],
    after: Sequence[Cells],
    key: Sequence[str],
    others: Collection[int] = (),
) -> bytes:
    """Change a CSV file from its present to its new content.

    Parameters
    ----------
    content
        The file, as the reader of its kind accepts it.
    before
        Its present rows, in one way of writing numbers; no entry for blank lines, and none for the
        rows `others`.
    after
        Its new rows, in the same way of writing. An empty cell of a column that the file does not
        have is ignored.
    key
        Columns that identify a row.
    others
        Numbers of rows that stay as they are.

    Returns
    -------
    bytes
        `content` itself where `after` equals `before`.
    """
    mark = BYTE_ORDER_MARK if content.startswith(BYTE_ORDER_MARK) else b""
    text = content[len(mark) :].decode()
    separator = find_separator(text)
    records = list(_records(text, separator))
    at = next(i for i, record in enumerate(records) if not record.is_blank)
    header = [_plain(cell, separator) for cell in records[at].cells]
    kept = _compare_rows(before, after, key)
    wanted = [*kept.changes.values(), *(row for rows in kept.added.values() for row in rows)]
    new = [
        name
        for name in dict.fromkeys(name for row in wanted for name in row)
        if name not in header and any(row.get(name) for row in wanted)
    ]
    ends = records[at].end or "\n"
    writer = _Writer([*header, *new], separator, _comma_columns(records[at + 1 :], header))
    written = _write_records(records, at, writer, kept, len(new), others)
    ended = _add_line_endings(written, ends, records[-1].end)
    return mark + "".join(record.text(separator) for record in ended).encode()


def create_table(header: Sequence[str], rows: Sequence[Cells]) -> bytes:
    """Create a CSV file with these columns; cells that a row does not have are empty."""
    lines = [",".join(header), *(_Writer(header).line(row) for row in rows)]
    return "".join(line + "\n" for line in lines).encode()


def _records(text: str, separator: str) -> Iterator[_Record]:
    cells: list[str] = []
    position = 0
    while position < len(text) or cells:
        match = _CELL[separator].match(text, position)
        if match is None:
            raise ValueError("a quote is not closed")  # the reader refuses such a file
        cells.append(match[1])
        position = match.end()
        if match[2] != separator:
            yield _Record(tuple(cells), match[2])
            cells = []


def _plain(cell: str, separator: str) -> str:
    """Parse a raw cell."""
    return next(iter(csv.reader([cell], delimiter=separator)), [""])[0].strip() if cell else ""


def _comma_columns(records: Sequence[_Record], header: Sequence[str]) -> frozenset[str]:
    """Find the columns in which the file has numbers with a decimal comma."""
    return frozenset(
        name
        for k, name in enumerate(header)
        if any(_COMMA_NUMBER.fullmatch(r.cells[k].strip(' "')) for r in records if k < len(r.cells))
    )


@dataclass(frozen=True)
class _Writer:
    """Format of the file's cells: header, separator, and columns with decimal commas."""

    header: Sequence[str]
    separator: str = ","
    commas: frozenset[str] = frozenset()

    def line(self, row: Cells) -> str:
        """Format a new row."""
        return self.separator.join(self.cell(name, row.get(name, "")) for name in self.header)

    def cell(self, name: str, text: str) -> str:
        """Format a cell like the file: in quotes where it needs them."""
        if name in self.commas and _POINT_NUMBER.fullmatch(text):
            text = text.replace(".", ",")
        cell = io.StringIO()
        # with \r\n, as otherwise a lone \r would not be quoted
        csv.writer(cell, delimiter=self.separator).writerow([guard_formula(text), ""])
        return cell.getvalue().removesuffix(f"{self.separator}\r\n")


def _compare_rows(before: Sequence[Cells], after: Sequence[Cells], key: Sequence[str]) -> _Kept:
    """Assign the new rows to rows of the file, and find the changes.

    Rows are matched by their keys, in order. Where keys differ at one place, a row with the same
    other cells counts as renamed. As new rows come last, equal numbers of old and new rows at any
    other place count as renamed, too.
    """
    was, now = ([tuple(row[name] for name in key) for row in rows] for rows in (before, after))
    kept = _Kept()
    last = -1
    matcher = SequenceMatcher(a=was, b=now, autojunk=False)
    for what, a0, a1, b0, b1 in matcher.get_opcodes():
        if what == "equal":
            same = dict(zip(range(b0, b1), range(a0, a1), strict=True))
        else:
            olds, news = range(a0, a1), range(b0, b1)
            same = _pair_renamed_rows(before, after, olds, news, key, at_end=a1 == len(before))
        for j in range(b0, b1):
            if j not in same:
                kept.added.setdefault(last, []).append(after[j])
                continue
            last = same[j]
            old = before[last]
            kept.changes[last] = {
                name: text for name, text in after[j].items() if text != old.get(name, "")
            }
    return kept


def _pair_renamed_rows(
    before: Sequence[Cells],
    after: Sequence[Cells],
    olds: range,
    news: range,
    key: Sequence[str],
    *,
    at_end: bool,
) -> dict[int, int]:
    """Pair new rows with old ones that were renamed, in order."""

    def rest(row: Cells) -> Cells:
        return {name: text for name, text in row.items() if name not in key and text}

    pairs: dict[int, int] = {}
    first = olds.start
    for j in news:
        found = next((i for i in range(first, olds.stop) if rest(before[i]) == rest(after[j])), -1)
        if found >= 0:
            pairs[j] = found
            first = found + 1
    if not at_end and len(olds) == len(news):
        return dict(zip(news, olds, strict=True))
    return pairs


def _write_records(
    records: Sequence[_Record],
    at: int,
    writer: _Writer,
    kept: _Kept,
    more: int,
    others: Collection[int],
) -> Iterator[_Record]:
    """Yield the records of the new file.

    `at` is the header's index, `more` the number of new columns, `others` are rows that stay.
    """
    header = writer.header
    place = {name: i for i, name in enumerate(header)}
    yield from records[:at]
    yield replace(records[at], cells=(*records[at].cells, *header[len(header) - more :]))
    yield from (_Record((writer.line(row),), "") for row in kept.added.get(-1, ()))
    row_number = -1
    rows = count()
    for record in records[at + 1 :]:
        if record.is_blank:
            yield record
            continue
        if next(rows) in others:
            yield replace(record, cells=(*record.cells, *[""] * more))
            continue
        row_number += 1
        if row_number in kept.changes:
            cells = [*record.cells, *[""] * more]
            for name, text in kept.changes[row_number].items():
                if name in place:
                    cells[place[name]] = writer.cell(name, text)
            yield replace(record, cells=tuple(cells))
        yield from (_Record((writer.line(row),), "") for row in kept.added.get(row_number, ()))


def _add_line_endings(records: Iterator[_Record], end: str, last_end: str) -> Iterator[_Record]:
    """Give each record a line ending; the last one has none where the file's last one had none."""
    earlier: _Record | None = None
    for record in records:
        if earlier is not None:
            yield replace(earlier, end=earlier.end or end)
        earlier = record
    if earlier is not None:
        yield replace(earlier, end=(earlier.end or end) if last_end else "")


PICKS_HEADER = ("image", "label", "u_px", "v_px", "sigma_px", "height_m")
LINES_HEADER = ("name", "from", "to", "length_m", "sigma_m", "use")
MEASURE_HEADER = ("name", "kind", "points", "parameters")


_PICKS = Table(Picks, elsewhere=("line",))


def update_picks(
    content: bytes | None, before: Picks, after: Picks, others: Collection[int] = ()
) -> bytes | None:
    """Update picks.csv with other picks.

    Parameters
    ----------
    content
        The file; None where it does not exist.
    before
        Picks in the file.
    after
        New picks.
    others
        Numbers of rows of the file that are not among `before`, and stay as they are.

    Returns
    -------
    bytes or None
        The file, `content` itself where nothing changed; None where none is needed.
    """
    key = ("image", "label")
    return _update(content, _pick_cells(before), _pick_cells(after), PICKS_HEADER, key, others)


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
    others: Collection[int] = (),
) -> bytes | None:
    if content is not None:
        return rewrite_table(content, before, after, key, others)
    if not after:
        return None
    more = [name for name in after[0] if name not in header and any(row[name] for row in after)]
    return create_table([*header, *more], after)


def _pick_cells(picks: Picks) -> list[Cells]:
    """Return the cells of each pick; the source of one made by hand is empty."""
    return [
        {
            name: "free" if name == "height_m" and row["is_free"] else _cell(value)
            for name, value in (row | {"source": row["source"].replace("hand", "")}).items()
            if name != "is_free"
        }
        for row in _PICKS.dump(picks)
    ]


def _cell(value: str | float | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else repr(value)


def _line_cells(lines: KnownLines) -> list[Cells]:
    return [
        {
            "name": lines.name[i],
            "from": lines.start[i],
            "to": lines.end[i],
            "length_m": repr(float(lines.length_m[i])),
            "sigma_m": repr(float(lines.sigma_m[i])),
            "use": "" if lines.adjust[i] else "check",  # an empty cell is the default
            "tape": lines.tape[i],
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
