"""A DataFlash log's messages by type, whatever its form: columns are gathered when asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from uavgram.io.logs.dataflash.formats import TEXT_CHARACTERS, Columns, Format


@dataclass(frozen=True, eq=False)
class Piece:
    """Messages of one type under one format, which a file may change midway.

    Attributes
    ----------
    format
        Of all of them.
    starts
        Where they begin, increasing; all are complete.
    """

    format: Format
    starts: list[int]


@dataclass(frozen=True, eq=False)
class Tables(ABC):
    """The messages of a log by type.

    Attributes
    ----------
    pieces
        By message name, in the order of the file: one for each format that the file states of it.
    notes
        What was odd about the file.
    """

    pieces: dict[str, tuple[Piece, ...]]
    notes: tuple[str, ...]

    @abstractmethod
    def decoded(self, fmt: Format, starts: list[int]) -> Columns:
        """Every field of the messages that begin there, as columns."""

    @property
    def names(self) -> tuple[str, ...]:
        """Message types that the file holds, sorted."""
        return tuple(sorted(self.pieces))

    def count(self, name: str) -> int:
        """How many messages of this type the file holds."""
        return sum(len(piece.starts) for piece in self.pieces.get(name, ()))

    def places(self, name: str) -> NDArray[np.int64]:
        """(N,) where the messages of one type begin, in the order of `columns`."""
        starts = (piece.starts for piece in self.pieces.get(name, ()))
        return np.array([at for piece in starts for at in piece], dtype=np.int64)

    def columns(self, name: str) -> Columns:
        """Every field of one message type as a column, scaled as its format character says.

        Returns
        -------
        dict
            Field name: array over the messages in the order of the file; empty where the file
            has no such message. A field that a part of the file does not define is NaN (empty,
            for a text) there.
        """
        return self._joined([(p.format, p.starts) for p in self.pieces.get(name, ())])

    def ends(self, name: str) -> Columns:
        """The columns of the first and the last message of one type only."""
        pieces = self.pieces.get(name, ())
        if not pieces:
            return {}
        first, last = pieces[0], pieces[-1]
        if first is last:
            return self._joined([(first.format, [first.starts[0], first.starts[-1]])])
        return self._joined([(first.format, first.starts[:1]), (last.format, last.starts[-1:])])

    def between(self, start: int, end: int) -> Self:
        """The messages that begin in this range of bytes."""
        found: dict[str, tuple[Piece, ...]] = {}
        for name, whole in self.pieces.items():
            cut = [replace(p, starts=inside(p.starts, start, end)) for p in whole]
            if kept := tuple(piece for piece in cut if piece.starts):
                found[name] = kept
        return replace(self, pieces=found)

    def _joined(self, parts: list[tuple[Format, list[int]]]) -> Columns:
        decoded = [(fmt, self.decoded(fmt, starts)) for fmt, starts in parts]
        if len(decoded) < 2:
            return decoded[0][1] if decoded else {}
        fields = dict.fromkeys(field for fmt, _ in decoded for field in fmt.fields)
        return {field: np.concatenate(_alike(decoded, field)) for field in fields}


def inside(starts: list[int], start: int, end: int) -> list[int]:
    """Those of the places that lie in this range of the file.

    Parameters
    ----------
    starts
        Offsets in bytes, increasing.
    start, end
        First byte of the range, and the one after it.
    """
    return starts[bisect_left(starts, start) : bisect_left(starts, end)]


def _alike(decoded: list[tuple[Format, Columns]], field: str) -> list[NDArray[np.generic]]:
    """The same field of every part, with a filling where one lacks it or has another kind."""
    is_text = {
        fmt.characters[fmt.fields.index(field)] in TEXT_CHARACTERS
        for fmt, _ in decoded
        if field in fmt.fields
    }
    of_text = is_text == {True}
    parts: list[NDArray[np.generic]] = []
    for fmt, columns in decoded:
        rows = len(next(iter(columns.values()), ()))
        character = fmt.characters[fmt.fields.index(field)] if field in fmt.fields else ""
        if character and character != "a" and (character in TEXT_CHARACTERS) == of_text:
            parts.append(columns[field])
        else:
            parts.append(np.full(rows, b"" if of_text else np.nan))
    return parts
