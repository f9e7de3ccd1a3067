"""Journal of changes: each is on disk before it is confirmed, and is recovered after a crash.

One JSON object a line. ``open`` holds the content of the tables at the start of a session, with
their digests; a command is written as the page sent it, after it was checked and applied;
``saving`` and ``saved`` enclose each writing of the tables. A new session applies the commands to
the content in ``open``, not to the tables, which a kill may have left half written: so each command
counts exactly once.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

from uavgram.errors import OutputError, UavgramError
from uavgram.io.files import open_own, read_own
from uavgram.io.json_codec import parse_json
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import Line, Pick, State

JOURNAL = "pick-journal.jsonl"

Digests = Mapping[str, str | None]
"""SHA-256 of each table by its role; None where there is no file."""


class Journal:
    """Append-only file of changes, on disk before anything is confirmed.

    Parameters
    ----------
    path
        The file; made with its folder if it does not exist.
    fresh
        Whether to start an empty journal; else a line that a kill left unfinished is cut off, and
        the rest is continued.

    Raises
    ------
    OutputError
        The file cannot be written.
    """

    def __init__(self, path: Path, *, fresh: bool) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            content = b"" if fresh or not path.is_file() else read_own(path)
            self._handle = open_own(path, os.O_WRONLY | os.O_CREAT)
            self._size = content.rfind(b"\n") + 1
            os.ftruncate(self._handle, self._size)
        except OSError as fault:
            raise self._cannot(fault) from fault

    def open(self, state: State, digests: Digests, *, resumed: bool) -> None:
        """Begin a session.

        Parameters
        ----------
        state, digests
            Content of the tables, and their digests.
        resumed
            Whether the session continues from changes that a crash left.
        """
        entry = {"state": asdict(state), "files": dict(digests), "resumed": resumed}
        self._append({"do": "open", "pid": os.getpid(), **entry})

    def record(self, command: c.Command, step: int) -> None:
        """Append one command and wait until it is on disk.

        Raises
        ------
        OutputError
            The command cannot be stored, so it must not be confirmed.
        """
        self._append({"step": step, **_entry(command)})

    def saving(self, digests: Digests) -> None:
        """Record the digests of the tables that are about to be written."""
        self._append({"do": "saving", "files": dict(digests)})

    def saved(self) -> None:
        """Record that the tables hold all changes up to here."""
        self._append({"do": "saved"})

    def close(self) -> None:
        """Close the file."""
        os.close(self._handle)

    def _append(self, entry: dict[str, Any]) -> None:
        line = (json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n").encode()
        try:
            written = os.lseek(self._handle, self._size, os.SEEK_SET) - self._size
            while written < len(line):
                written += os.write(self._handle, line[written:])
            os.fsync(self._handle)
        except OSError as fault:
            with suppress(OSError):  # drop the half-written line
                os.ftruncate(self._handle, self._size)
            raise self._cannot(fault) from fault
        self._size += len(line)

    def _cannot(self, fault: OSError) -> OutputError:
        return OutputError(
            f"{self.path}: cannot be written ({fault.strerror}), so nothing more is taken: make "
            "room or give the right to write, then go on"
        )


_NO_JOURNAL = "is no journal of this program: move it away to go on without what it holds"
_ON_DAMAGE = (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError)


@dataclass
class JournalContent:
    """Changes of earlier sessions, as read from a journal.

    Attributes
    ----------
    session
        Session after the last command; None before any ``open``.
    saved
        Content of the tables when they were last known to be complete.
    settled, begun
        Digests of the tables when last known to be complete, and those that an unfinished writing
        was to produce.
    unsaved
        Whether commands follow the last ``saved``, or a writing was not finished.
    """

    session: Session | None = None
    saved: State | None = None
    settled: dict[str, str | None] = field(default_factory=dict)
    begun: dict[str, str | None] = field(default_factory=dict)
    unsaved: bool = False

    def fits(self, digests: Digests) -> bool:
        """Return whether the tables are as this program left them, whenever it was killed."""
        return all(
            digest in {self.settled.get(role), self.begun.get(role, self.settled.get(role))}
            for role, digest in digests.items()
        )


def load_journal(path: Path) -> JournalContent:
    """Read a journal; an absent file gives an empty `JournalContent`.

    Raises
    ------
    UavgramError
        A command does not fit the ones before it: the file was changed.
    """
    left = JournalContent()
    for entry in _entries(path):
        try:
            _play(left, entry)
        except _ON_DAMAGE as fault:
            raise UavgramError(f"{path}: {_NO_JOURNAL} ({fault!r:.200})") from fault
    return left


def _play(left: JournalContent, entry: dict[str, Any]) -> None:
    what = entry.pop("do")
    if what == "open":
        files = _state(entry["state"])
        if entry["resumed"] and left.session is not None:
            left.session = Session(state=left.session.state, past=(files,))
        else:
            left.session = Session(state=files)
            left.unsaved = False
        left.saved = files
        left.settled, left.begun = entry["files"], {}
    elif what == "saving":
        left.begun, left.unsaved = entry["files"], True
    elif what == "saved":
        left.saved = None if left.session is None else left.session.state
        left.settled, left.begun, left.unsaved = {**left.settled, **left.begun}, {}, False
    elif left.session is not None:
        step = int(entry.pop("step"))
        left.session = apply(left.session, _command(what, entry), step)
        left.unsaved = True


def _entries(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a journal, except an unfinished last line, which was never confirmed."""
    if not path.is_file():
        return
    *lines, _ = read_own(path).split(b"\n")
    for line in lines:
        try:
            entry = parse_json(path, line)
        except ValueError as fault:
            raise UavgramError(f"{path}: {_NO_JOURNAL} ({fault})") from fault
        if not isinstance(entry, dict):
            raise UavgramError(f"{path}: {_NO_JOURNAL}")
        yield entry


def _entry(command: c.Command) -> dict[str, Any]:
    if isinstance(command, c.All):  # the name of each change is needed to read it back
        return {"do": c.All.__name__, "changes": [_entry(change) for change in command.changes]}
    return {"do": type(command).__name__, **asdict(command)}


def _command(kind: str, fields: dict[str, Any]) -> c.Command:
    if kind == c.All.__name__:
        changes: list[Any] = [_command(one.pop("do"), one) for one in fields["changes"]]
        return c.All(changes=tuple(changes))
    if kind == c.PlaceAll.__name__:
        return c.PlaceAll(places=tuple(c.Place(**place) for place in fields["places"]))
    command: c.Command = _COMMANDS[kind](**_tuples(fields))
    return command


def _state(fields: dict[str, Any]) -> State:
    return State(
        picks=tuple(Pick(**pick) for pick in fields["picks"]),
        lines=tuple(Line(**line) for line in fields["lines"]),
        requests=tuple(MeasurementRequest(**_tuples(one)) for one in fields["requests"]),
    )


def _tuples(fields: dict[str, Any]) -> dict[str, Any]:
    """Convert lists of JSON into the tuples of commands and measurements, two levels deep."""
    return {
        name: tuple(tuple(one) if isinstance(one, list) else one for one in value)
        if isinstance(value, list)
        else value
        for name, value in fields.items()
    }


_COMMANDS: dict[str, type[Any]] = {kind.__name__: kind for kind in get_args(c.Command)}
