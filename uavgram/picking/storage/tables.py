"""The project's tables on disk (picks, lines, measure), and changes of files by other programs.

Each writing starts from the files as the session found them and changes only what differs now. So
undoing everything restores the files byte by byte.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.input_files import describe_files, unread_format
from uavgram.io.files import check_inside, check_own, digest_file
from uavgram.io.outputs import JOURNAL, ProjectLock, replace_bytes
from uavgram.io.photos.catalogue import MAX_NAMED, find_photos
from uavgram.io.photos.metadata import read_image_sizes
from uavgram.io.tables.known import read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks
from uavgram.io.tables.updates import update_lines, update_measure, update_picks
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.picking.document import commands as c
from uavgram.picking.document.state import State, make_observations, make_state
from uavgram.picking.storage.journal import Journal, JournalContent, load_journal
from uavgram.pipeline.measure.inputs import Inputs

log = logging.getLogger(__name__)

ROLES = ("picks", "lines", "measure")
_READERS: dict[str, Callable[..., object]] = {
    "picks": partial(read_picks, may_be_empty=True),
    "lines": read_lines,
    "measure": read_measure,
}

Contents = dict[str, bytes | None]
"""Bytes of each table by its role; None: no such file."""

Stamp = tuple[int, int] | None
"""Time and size of a file; None: no such file."""


class Tables:
    """Storage of confirmed changes: a journal at once, the tables on request.

    Parameters
    ----------
    inputs
        Project as read.

    Attributes
    ----------
    messages
        Messages about changes that earlier sessions left.
    recovered
        State that an earlier session confirmed and did not save; None: nothing to recover.

    Raises
    ------
    UavgramError
        Another process picks in the project, a table was changed since it was read, the output
        folder cannot be written to, or it or a table is outside the project's folder.
    """

    def __init__(self, inputs: Inputs) -> None:
        project = inputs.project
        output = Path(project.output)
        self._paths = _paths(inputs)
        _check_places(inputs)
        self._lock = ProjectLock(output, inputs.project_path)
        try:
            self._named = {role: getattr(project, role) is not None for role in ROLES}
            self._files = make_state(inputs.picks, inputs.lines, inputs.requests)
            self._unused_picks = inputs.unused_picks
            self._original = self._as_read(inputs)
            self._on_disk = dict(self._original)
            self._digest = _digests(self._on_disk)
            self._backed_up: set[str] = set()
            self.messages: tuple[Message, ...] = ()
            check_own(output / JOURNAL)
            self.recovered = self._lost(output / JOURNAL, frozenset(inputs.photos.frame_id))
            resumed = self.recovered is not None
            if not resumed:
                self.messages += self._report_missing()
            self._journal = Journal(output / JOURNAL, fresh=not resumed)
            self._journal.open(self._files, _digests(self._original), resumed=resumed)
            self._pending = resumed
        except BaseException:
            self._lock.release()
            raise

    def _report_missing(self) -> tuple[Message, ...]:
        """Report tables that the project names, and that are not there: `run` refuses these."""
        named = [role for role in ROLES if self._named[role]]
        missing = [role for role in named if self._on_disk[role] is None]
        if not missing or missing == named:  # a project without any of its tables is new
            return ()
        names = join_names(self._paths[role].name for role in missing)
        one = len(missing) == 1
        text = (
            f"{names}, which the project names, {'is' if one else 'are'} not there, and "
            f"{'begins' if one else 'begin'} empty here. If {'it' if one else 'they'} held "
            "something, close this page and put the file back under its name."
        )
        return (Message("warning", "table-missing", text),)

    def record(self, command: c.Command, step: int) -> None:
        """Store a command that was applied, before it is confirmed.

        Raises
        ------
        OutputError
            It cannot be stored.
        """
        if fault := self._find_gone():
            raise OutputError(fault)
        self._journal.record(command, step)
        self._pending = True

    def save(self, state: State) -> str:
        """Write the tables that changed; return the reason if that failed, else an empty text.

        A table that another program changed since it was read or written here is not overwritten;
        the tables of the page are then saved beside it. The text may also be advice, see
        `_unnamed`.
        """
        if not self._pending:
            return ""
        if fault := self._find_gone():
            return fault
        wanted = self._contents(state)
        todo = [role for role in ROLES if wanted[role] != self._on_disk[role]]
        try:
            foreign = [role for role in todo if _read(self._paths[role]) != self._on_disk[role]]
            if foreign:
                return self._beside(foreign, wanted)
            if todo:
                self._journal.saving(_digests(wanted))
            for role in todo:
                self._write(role, wanted[role])
            self._journal.record_save()
        except OutputError as fault:
            return str(fault)
        self._pending = False
        return self._advise_on_unnamed(wanted)

    def _find_gone(self) -> str:
        gone = (_describe_gone(path.parent) for path in self._paths.values())
        return next(filter(None, gone), "")

    def find_changed_tables(self) -> tuple[str, ...]:
        """Return the names of tables that another program changed since their last use here."""
        try:
            return tuple(
                path.name
                for role, path in self._paths.items()
                if (self._named[role] or self._on_disk[role] is not None)
                and _read(path) != self._on_disk[role]
            )
        except OutputError:  # an unreadable table is reported when it is to be written
            return ()

    def inputs_now(self, read: Iterable[str]) -> frozenset[str] | None:
        """Return the present digests of the project's files; None while changes are unsaved."""
        if self._pending:
            return None
        tables = {self._digest[role] for role in ROLES if self._named[role]}
        others = set(read) - set(_digests(self._original).values())
        return frozenset(digest for digest in others | tables if digest is not None)

    def close(self) -> None:
        """Close the journal and release the project."""
        self._journal.close()
        self._lock.release()

    def _as_read(self, inputs: Inputs) -> Contents:
        """Return the bytes of the tables, after checking that they are those that were read."""
        known = {digest.sha256 for digest in inputs.digests}
        contents: Contents = {}
        for role, path in self._paths.items():
            contents[role] = content = _read(path) if self._named[role] else None
            if content is not None and hashlib.sha256(content).hexdigest() not in known:
                raise InputError(path, "was changed while the project was read: start again")
        return contents

    def _contents(self, state: State) -> Contents:
        (picks, lines), (now_picks, now_lines) = (
            make_observations(self._files),
            make_observations(state),
        )
        requests = self._files.requests, state.requests
        return {
            "picks": update_picks(self._original["picks"], picks, now_picks, self._unused_picks),
            "lines": update_lines(self._original["lines"], lines, now_lines),
            "measure": update_measure(self._original["measure"], *requests),
        }

    def _write(self, role: str, content: bytes | None) -> None:
        path, before = self._paths[role], self._on_disk[role]
        try:
            if before is not None and not os.access(path, os.W_OK):  # replacing skips this
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
            if role not in self._backed_up and before is not None:
                replace_bytes(path.with_name(f"{path.name}.bak"), before)
            self._backed_up.add(role)
            if content is None:
                path.unlink()
            else:
                mode = path.stat().st_mode if before is not None else None
                replace_bytes(path, content)
                if mode is not None:
                    with suppress(OSError):
                        path.chmod(mode)
        except (OSError, OutputError) as fault:
            cause = fault.__cause__ if isinstance(fault, OutputError) else fault
            why = cause.strerror if isinstance(cause, OSError) else str(fault)
            raise OutputError(
                f"{path} cannot be written ({why}). Nothing is lost: the journal has it, and the "
                "next change tries again"
            ) from fault
        self._on_disk[role] = content
        self._digest |= _digests({role: content})

    def _beside(self, foreign: list[str], wanted: Contents) -> str:
        """Save all tables under other names, and return the reason."""
        for role in ROLES:
            content = wanted[role]
            if content is not None:
                replace_bytes(_beside(self._paths[role]), content)
        names = " and ".join(self._paths[role].name for role in foreign)
        others = _beside(self._paths[foreign[0]]).name
        return (
            f"Another program changed {names} meanwhile, so nothing is written over. What you have "
            f"here is saved beside it ({others})"
        )

    def _advise_on_unnamed(self, wanted: Contents) -> str:
        """Return advice if the project file does not name a table that was made; else empty."""
        made = [r for r in ROLES if not self._named[r] and wanted[r] is not None]
        if not made:
            return ""
        keys = " and ".join(f"`{role}: {self._paths[role].name}`" for role in made)
        return f"The project file does not name what is saved here: add {keys} to it"

    def _lost(self, journal: Path, photos: frozenset[str]) -> State | None:
        """Return the state that an earlier session confirmed and did not save.

        A journal that cannot be applied to these tables is put aside, with a message.
        """
        try:
            left = load_journal(journal)
        except UavgramError as why:
            self._put_aside(journal, str(why))
            return None
        gone = [role for role, digest in _digests(self._original).items() if digest is None]
        gone = [role for role in gone if left.settled.get(role)]  # of what was saved
        if left.session is None or not (left.unsaved or gone):
            return None
        state = left.session.state
        if state == self._files:  # only the note that they are saved is missing
            return state
        if reason := self._explain_refusal(left, photos, gone):
            self._put_aside(journal, reason)
            return None
        text = (
            "An earlier session ended without saving. What it had confirmed was taken from its "
            "journal and saved. Undo goes back to what the tables held before."
        )
        if gone:
            names = join_names(self._paths[role].name for role in gone)
            text = (
                f"{names} {'was' if len(gone) == 1 else 'were'} not there any more. The page had "
                "kept a copy of the content, and wrote it again. If you removed it on purpose, "
                "take it back by Undo."
            )
        self.messages = (Message("warning", "pick-recovered", text),)
        return state

    def _explain_refusal(
        self, left: JournalContent, photos: frozenset[str], gone: Sequence[str]
    ) -> str:
        """Return why the changes of a journal cannot be recovered; empty if they can.

        Parameters
        ----------
        left, photos
            The changes, and the names of the project's photos.
        gone
            Tables that were saved and are missing.
        """
        state = self._files if left.session is None else left.session.state
        saved = {role: left.settled[role] for role in gone}
        if not left.fits({**_digests(self._original), **saved}):
            return "the tables were changed since by another program"
        known = {pick.image for one in (left.saved, state) if one for pick in one.picks}
        if not (known <= photos and {pick.image for pick in self._files.picks} <= known):
            return "the project has other photos now"
        fault = self._unreadable(state)
        return f"no table may hold them ({fault})" if fault else ""

    def _unreadable(self, state: State) -> str:
        """Return why the tables of a state could not be read again; empty if they can."""
        with TemporaryDirectory() as folder:
            try:
                for role, content in self._contents(state).items():
                    if content is not None:
                        path = Path(folder) / self._paths[role].name
                        path.write_bytes(content)
                        _READERS[role](path)
            except InputError as fault:
                return str(fault).splitlines()[0].replace(f"{folder}{os.sep}", "")
            except (TypeError, ValueError) as fault:
                return f"{fault!r:.200}"
        return ""

    def _put_aside(self, journal: Path, why: str) -> None:
        moment = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
        aside = journal.with_name(f"{journal.stem}-{moment}{journal.suffix}")
        journal.replace(aside)
        text = (
            "An earlier session ended without saving, and its changes cannot be taken over: "
            f"{why}. They are kept in {aside}."
        )
        log.warning("%s", text)
        self.messages = (Message("warning", "pick-not-recovered", text),)


def _paths(inputs: Inputs) -> dict[str, Path]:
    """Return the present or future path of each table; links are resolved and so preserved."""
    beside = Path(inputs.project_path).absolute().parent
    project = inputs.project
    return {
        role: Path(getattr(project, role) or beside / f"{role}.csv").resolve() for role in ROLES
    }


def _check_places(inputs: Inputs) -> None:
    """Check that nothing is written outside a folder received from someone else."""
    home, project = Path(inputs.project_path).absolute().parent, inputs.project
    check_inside(Path(project.output), home, f"The output folder {project.output}")
    for role in ROLES:
        if name := getattr(project, role):
            check_inside(Path(name), home, f"The table {name} (`{role}` in the project file)")


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.stem}-from-page{path.suffix}")


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as fault:
        raise OutputError(f"{path} cannot be read again ({fault.strerror})") from fault


def _digests(contents: Contents) -> dict[str, str | None]:
    return {
        role: None if content is None else hashlib.sha256(content).hexdigest()
        for role, content in contents.items()
    }


class FileWatch:
    """Watch on the project file, the camera file, the tables of known points, and the photos.

    Photos are only missed, or new: the content of known ones is read when they are shown.

    The tables that the page writes itself are watched by `Tables`.

    Parameters
    ----------
    inputs
        Project as read.

    Attributes
    ----------
    last_changed
        Names of the changed files at the last look.
    added
        Sentences on the files that are new beside the photos; empty: none that concerns them.
    """

    def __init__(self, inputs: Inputs) -> None:
        project = inputs.project
        known = (project.control, project.control_lines, project.check)
        names = (inputs.project_path, project.camera_file, *known)
        self._home = Path(inputs.project_path).absolute().parent
        self._files = [Path(name) for name in names if name]
        self._photos: dict[Path, set[str]] = {}  # names by folder
        for photo in map(Path, inputs.photos.path):
            self._photos.setdefault(photo.parent, set()).add(photo.name)
        self._before = {folder: _list_names(folder) for folder in self._photos}
        self._find_used = partial(find_photos, project.images, project.leave_out)
        self._new: dict[Path, Stamp] = {}
        self.added = ""
        self._known = {digest.sha256 for digest in inputs.digests}
        self._seen: dict[Path, tuple[Stamp, bool]] = {}
        self.last_changed: list[str] = []

    def find_changed_files(self, others: Sequence[str] = ()) -> list[str]:
        """Return the names of the files that differ from those read, `others` among them."""
        if gone := _describe_gone(self._home):
            self._new, self.added, self.last_changed = {self._home: None}, gone, []
            return []
        now = {folder: _list_names(folder) for folder in self._photos}
        missing = (names - now[folder] for folder, names in self._photos.items())
        new = {folder / name for folder in now for name in now[folder] - self._before[folder]}
        stamps = {path: stamp_of(path) for path in sorted(new)}
        if stamps != self._new:
            self._new, self.added = stamps, _describe_added(list(stamps), self._find_used)
        changed = (path.name for path in self._files if self._differs(path))
        self.last_changed = sorted({*changed, *others, *chain.from_iterable(missing)})
        return self.last_changed

    def _differs(self, path: Path) -> bool:
        """Return whether the content differs; the file is read only if its size or time changed."""
        stamp = stamp_of(path)
        before = self._seen.get(path)
        if before is not None and before[0] == stamp:
            return before[1]
        try:
            differs = digest_file(path).sha256 not in self._known
        except InputError:  # the file was deleted
            differs = True
        self._seen[path] = (stamp, differs)
        return differs


def _describe_gone(folder: Path) -> str:
    """Say that the project's folder is not there, and what to do; empty where it is there."""
    if folder.is_dir():
        return ""
    return (
        f"The folder {folder} is gone: it was moved or renamed, or its drive was taken out. Leave "
        "this page open, which keeps what you did, and put the folder back under its name: the "
        "next change saves it all"
    )


def _describe_added(new: Sequence[Path], find_used: Callable[[], list[Path]]) -> str:
    """Name the new files beside the photos: usable photos, and unusable ones with the way out."""
    unread = [path for path in new if unread_format(path)]
    try:
        used = set(find_used()) - set(unread)
    except InputError:  # none is left
        used = set()
    sizes, unusable = read_image_sizes([path for path in new if path in used])
    texts = [f"{path.name} is new, and cannot be used, as it {why}." for path, why in unusable]
    if unread:
        names = join_names((path.name for path in unread), MAX_NAMED)
        texts.append(f"New beside the photos: {names}. {describe_files(unread)}")
    if sizes:
        names = join_names((path.name for path in sizes), MAX_NAMED)
        texts.append(f"New beside the photos: {names}. Reload takes new photos into the project.")
    return " ".join(texts)


def _list_names(folder: Path) -> set[str]:
    """Return the names in a folder; empty where it was removed."""
    try:
        return {path.name for path in folder.iterdir()}
    except OSError:
        return set()


def stamp_of(path: Path) -> Stamp:
    """Return time and size of a file, which change with its content; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
