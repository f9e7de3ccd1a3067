"""Saving: every change to a journal before its reply, the tables soon after the last change.

The journal holds one JSON line for each change, as the page sent it after it was checked and
applied: who starts again after a crash reads the tables and the lines after the last ``saved``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from uavgram.picking import commands as c
from uavgram.picking.state import State

JOURNAL = "pick-journal.jsonl"


class Journal:
    """An append-only file of changes, on disk before anything is confirmed.

    Parameters
    ----------
    path
        The file; made with its folder where it is not there.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)

    def record(self, command: c.Command, step: int) -> None:
        """Append one command and wait until it is on disk."""
        self._append({"do": type(command).__name__, "step": step, **asdict(command)})

    def saved(self) -> None:
        """Say that the tables hold everything up to here."""
        self._append({"do": "saved"})

    def close(self) -> None:
        """Close the file."""
        os.close(self._handle)

    def _append(self, entry: dict[str, Any]) -> None:
        line = json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n"
        os.write(self._handle, line.encode())
        os.fdatasync(self._handle)


def unsaved(path: Path) -> Iterator[tuple[c.Command, int]]:
    """Commands and steps of a journal after its last ``saved``; a torn last line is left out."""
    if not path.is_file():
        return
    entries: list[dict[str, Any]] = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
        except ValueError:  # the kill came while this line was written: it was never confirmed
            continue
        entries = [] if entry.get("do") == "saved" else [*entries, entry]
    for entry in entries:
        fields = dict(entry)
        kind, step = _KINDS[fields.pop("do")], int(fields.pop("step"))
        for name in ("points", "parameters"):
            if name in fields:
                fields[name] = tuple(tuple(x) if isinstance(x, list) else x for x in fields[name])
        yield kind(**fields), step


_KINDS: dict[str, type[Any]] = {
    kind.__name__: kind
    for kind in (
        c.Place,
        c.Unpick,
        c.Forget,
        c.Rename,
        c.SetSigma,
        c.SetHeight,
        c.SetLine,
        c.RemoveLine,
        c.SetMeasurement,
        c.RemoveMeasurement,
        c.Undo,
        c.Redo,
    )
}


class Saver(Protocol):
    """What the server asks of whoever keeps the project's tables."""

    def recovered(self) -> State | None:
        """The state that an earlier session confirmed and did not save; None: nothing is lost."""
        ...

    def record(self, command: c.Command, step: int) -> None:
        """Keep a command that was applied, before it is confirmed."""
        ...

    def save(self, state: State) -> str:
        """Write the tables; returns what kept it from doing so, in words, or nothing.

        A table that somebody else changed meanwhile is never written over.
        """
        ...

    def close(self) -> None:
        """Let go of lock and journal."""
        ...
