"""Journal of changes: each is on disk before it is confirmed, and is recovered after a crash.

Each line is a JSON object:

* ``open``: content and digests of the tables at the start of a session;
* a command as the page sent it, after it was checked and applied;
* ``saving`` and ``saved``: before and after the tables are written.

To recover, a new session applies the commands to the content in ``open``. It does not apply them to
the tables, which may be half written, so each command is applied exactly once.

A journal whose changes cannot be recovered is put aside, and the page offers them. Once accepted,
each change is handled like one that the page sends: all are checked, kept, and undone in one step.
Nothing is deleted: a journal that was dealt with is renamed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

from uavgram.errors import OutputError, UavgramError
from uavgram.io.files import open_own, read_own
from uavgram.io.json_codec import parse_json
from uavgram.io.outputs import list_put_aside
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import Line, Pick, State

Digests = Mapping[str, str | None]
"""SHA-256 of each table by its role; None where there is no file."""

Json = dict[str, Any]
Changes = tuple[Json, ...]

ON_GROUND: Json = {"height_m": None, "height_sigma_m": None, "is_free": False}
"""Height fields of a pick without a stated height."""

_NO_JOURNAL = "is no journal of this program: move it away to go on without what it holds"
_ON_DAMAGE = (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError)

Named = Sequence[Line] | Sequence[MeasurementRequest]


class Journal:
    """Append-only file of changes, on disk before anything is confirmed.

    It is made, or begun anew, by the first change: looking at a project writes nothing.

    Parameters
    ----------
    path
        The file; made with its folder if it does not exist.
    fresh
        Whether to start an empty journal; else a line that a kill left unfinished is cut off, and
        the rest is continued.
    """

    def __init__(self, path: Path, *, fresh: bool) -> None:
        self.path = path
        self._fresh = fresh
        self._beginning = b""
        self._handle: int | None = None
        self._size = 0

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
        self._beginning = _line({"do": "open", "pid": os.getpid(), **entry})

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

    def record_save(self) -> None:
        """Record that the tables hold all changes up to here."""
        self._append({"do": "saved"})

    def close(self) -> None:
        """Close the file."""
        if self._handle is not None:
            os.close(self._handle)

    def _append(self, entry: dict[str, Any]) -> None:
        lines = self._beginning + _line(entry)
        try:
            handle = self._opened()
            try:
                written = os.lseek(handle, self._size, os.SEEK_SET) - self._size
                while written < len(lines):
                    written += os.write(handle, lines[written:])
                os.fsync(handle)
            except OSError:
                with suppress(OSError):  # drop the half-written line
                    os.ftruncate(handle, self._size)
                raise
        except OSError as fault:
            raise self._cannot(fault) from fault
        self._size += len(lines)
        self._beginning = b""

    def _opened(self) -> int:
        """Return the file, opened behind its last whole line."""
        if self._handle is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = b"" if self._fresh or not self.path.is_file() else read_own(self.path)
            handle = open_own(self.path, os.O_WRONLY | os.O_CREAT)
            self._size = content.rfind(b"\n") + 1
            os.ftruncate(handle, self._size)
            self._handle = handle
        return self._handle

    def _cannot(self, fault: OSError) -> OutputError:
        return OutputError(
            f"{self.path}: cannot be written ({fault.strerror}), so no further change is accepted. "
            "Free some space, or allow this folder to be written to, then repeat the change"
        )


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


def _line(entry: dict[str, Any]) -> bytes:
    return (json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n").encode()


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


@dataclass(frozen=True)
class SetAside:
    """Journal that was put aside: its file, and the states before and after its commands."""

    path: Path
    before: State
    after: State

    def rename(self, end: str) -> None:
        """Rename the file, so that its name shows what became of it."""
        self.path.replace(self.path.with_name(f"{self.path.name}.{end}"))


def find_oldest(folder: Path) -> SetAside | None:
    """Return the oldest journal of a folder that was put aside and holds changes; None if none."""
    for path in list_put_aside(folder):
        try:
            left = load_journal(path)
        except (UavgramError, OSError):
            continue
        if left.session is None or left.saved is None or left.saved == left.session.state:
            continue
        return SetAside(path, left.saved, left.session.state)
    return None


def list_changes(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    """Return the changes of the journal as messages that a page would send.

    Parameters
    ----------
    aside
        Changes that an earlier session could not save.
    now
        State to which the messages are to be applied.
    index
        Numbers of the photos by name.
    """
    return (
        *_removals(aside, now, index),
        *_picks(aside, now, index),
        *_list_additions("line", aside.before.lines, aside.after.lines, now.lines),
        *(
            one | {"parameters": dict(one["parameters"])}
            for one in _list_additions(
                "measure", aside.before.requests, aside.after.requests, now.requests
            )
        ),
    )


def _removals(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    kept = {pick.key for pick in aside.after.picks}
    return (
        *(
            {"t": "unpick", "image": index.get(pick.image, -1), "label": pick.label}
            for pick in aside.before.picks
            if pick.key not in kept and now.pick(*pick.key) is not None
        ),
        *_list_removals("remove-line", aside.before.lines, aside.after.lines, now.lines),
        *_list_removals(
            "remove-measurement", aside.before.requests, aside.after.requests, now.requests
        ),
    )


def _list_removals(kind: str, before: Named, after: Named, now: Named) -> Changes:
    """Return removals of the items that were removed then and still exist now."""
    kept, there = ({one.name for one in some} for some in (after, now))
    names = (one.name for one in before)
    return tuple({"t": kind, "name": name} for name in names if name in there - kept)


def _picks(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    earlier = {pick.key: pick for pick in aside.before.picks if not pick.again}
    heights = {pick.label: pick.height for pick in aside.before.picks}
    changes: list[Json] = []
    for pick in aside.after.picks:
        if pick.again:
            if pick not in now.picks:
                where = {"image": index.get(pick.image, -1), "label": pick.label}
                changes.append({"t": "repeat", **where, "u_px": pick.u_px, "v_px": pick.v_px})
            continue
        if earlier.get(pick.key) == pick:
            continue
        which = {"image": index.get(pick.image, -1), "label": pick.label}
        place = {"u_px": pick.u_px, "v_px": pick.v_px, "sigma_px": pick.sigma_px}
        changes.append({"t": "place", **which, **place, **_origin(pick, index)})
        there = now.pick(*pick.key)
        if pick.sigma_px is None and there is not None and there.sigma_px is not None:
            changes.append({"t": "sigma", **which, "sigma_px": None})
        if heights.setdefault(pick.label, ON_GROUND) != pick.height:
            heights[pick.label] = pick.height
            changes.append({"t": "height", "label": pick.label, **pick.height})
    return tuple(changes)


def _origin(pick: Pick, index: Mapping[str, int]) -> Json:
    """Return the origin of a pick found by the program; empty for a person's pick."""
    if pick.source == "hand":
        return {}
    names = ("source", "score", "from_u_px", "from_v_px")
    fields = {name: getattr(pick, name) for name in names}
    return fields | {"from_image": index.get(pick.from_image)}


def _list_additions(kind: str, before: Named, after: Named, now: Named) -> Changes:
    """Return additions and changes; an existing item of that name is changed."""
    there = {one.name for one in now}
    return tuple(
        {"t": kind, "was": one.name if one.name in there else "", **vars(one)}
        for one in after
        if one not in before
    )
