"""Output folder in which results appear completely, or not at all; claims and locks of files.

Locks end with their process: a file left by a killed process is not a lock. A lock on a project's
tables names its process.

Claims are for the workers of a cluster. If a worker is stopped or cut off, another one repeats its
work. When the first one resumes, it must not overwrite the results of the other. A lock does not
prevent this, as the first one would still hold it.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import shutil
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Set
from contextlib import contextmanager, suppress
from pathlib import Path

from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.io.files import open_own, read_own, write_out

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

log = logging.getLogger(__name__)

LOCK = "pick.lock"
JOURNAL = "pick-journal.jsonl"
LONGEST_NOTE = 200

_LOCKED_BYTE = 1 << 30
"""Locked byte on Windows, behind the end of the file, since other processes cannot read it."""


def lock(handle: int) -> None:
    """Lock an open file for this process.

    Raises
    ------
    BlockingIOError
        Another one has locked it.
    OSError
        Locks are not available, as on some network file systems.
    """
    if sys.platform == "win32":
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError as fault:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from fault
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


class FileLock:
    """A locked file, removed when it is released.

    Parameters
    ----------
    path
        The file; made if absent.

    Attributes
    ----------
    why_not
        Why the system cannot lock files here; empty where it can.

    Raises
    ------
    BlockingIOError
        Another process holds it; its text is the note of that process in the file.
    OutputError
        The path is a link.
    OSError
        The file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.why_not = path, ""
        while True:
            self._handle = open_own(path, os.O_RDWR | os.O_CREAT)
            try:
                lock(self._handle)
            except BlockingIOError as fault:
                os.lseek(self._handle, 0, os.SEEK_SET)
                note = os.read(self._handle, LONGEST_NOTE).decode(errors="replace").strip()
                os.close(self._handle)
                raise BlockingIOError(errno.EAGAIN, note) from fault
            except OSError as fault:
                self.why_not = fault.strerror or str(fault)
            if self._is_ours():
                return
            os.close(self._handle)  # it was released, and so removed, between opening and locking

    def write(self, note: str) -> None:
        """Write a note of at most `LONGEST_NOTE` bytes, for processes that do not get the lock."""
        os.ftruncate(self._handle, 0)
        os.lseek(self._handle, 0, os.SEEK_SET)
        os.write(self._handle, note.encode())

    def release(self) -> None:
        """Release the lock and remove the file."""
        if sys.platform == "win32":  # cannot remove open files, nor the next process's
            os.close(self._handle)
            with suppress(OSError):
                self.path.unlink()
        else:  # while it is locked: no other process has this file
            self.path.unlink(missing_ok=True)
            os.close(self._handle)

    def _is_ours(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._handle), self.path.stat())
        except FileNotFoundError:
            return False


class ProjectLock:
    """Exclusive right to write a project's tables, held until `release` or the end of the process.

    Parameters
    ----------
    folder
        The project's output folder; made if absent.
    project
        Its name in the message.

    Raises
    ------
    UavgramError
        Another process has the project; names it.
    OutputError
        The folder cannot be written to, or the lock's path is a link.
    """

    def __init__(self, folder: Path, project: str) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FileLock(folder / LOCK)
            self._lock.write(f"{os.getpid()}\n")
        except BlockingIOError as fault:
            raise UavgramError(
                f"{project}: is open in another picking page or search for points, process "
                f"{fault.strerror or 'unknown'}: go on there, or close that one first"
            ) from fault
        except OSError as fault:
            raise OutputError(
                f"{folder}: cannot be written to ({fault.strerror}); name another folder as "
                "`output` in the project"
            ) from fault
        if self._lock.why_not:
            log.warning("a second writer of this project is not noticed: %s", self._lock.why_not)

    def release(self) -> None:
        """Release the right to write."""
        self._lock.release()


def is_locked(path: Path) -> bool:
    """Return whether a process holds a lock file, or may hold it where locks are not available."""
    try:
        handle = open_own(path, os.O_RDONLY)
    except (OSError, OutputError):
        return False
    try:
        lock(handle)
    except OSError:  # held, or locks are not available: the file may be another process's
        return True
    finally:
        os.close(handle)
    return False


def check_saved(folder: Path) -> None:
    """Refuse a project if a picking session ended before its changes were in the tables.

    Parameters
    ----------
    folder
        The project's output folder, with the journal of the session.

    Raises
    ------
    InputError
        With the way to save the changes.
    """
    path = folder / JOURNAL
    if not path.is_file():
        return
    *lines, _ = read_own(path).split(b"\n")
    try:
        last = json.loads(lines[-1]) if lines else {"do": "saved"}
        is_saved = last["do"] == "saved" or not last.get("resumed", True)
    except (ValueError, KeyError, TypeError, AttributeError):
        is_saved = False  # the picking page moves a damaged journal aside
    if not is_saved:
        raise InputError(
            path,
            "holds picks and lengths of a picking session that ended before they were in the "
            "tables, so a result would lack them. Open the project once with `uavgram pick`, which "
            "saves them; or move this file away to go on without them",
        )


def list_put_aside(folder: Path) -> list[Path]:
    """Return the journals whose changes did not fit the tables, oldest first."""
    return sorted(folder.glob(f"{Path(JOURNAL).stem}-*{Path(JOURNAL).suffix}"))


PREFIX = ".uavgram-unfinished-"
IN_USE_PREFIX = ".uavgram-in-use-"
"""Prefix of a lock, followed by the rest of the hidden folder's name, held by the writing run."""
LAST_MOVED = "results.json"  # moved last: a reader of a new one finds all other files new too
NEW, EARLIER, MOVING = "files", "earlier", "moving.txt"
"""Names in the hidden folder: new files, replaced files, and their list during the move."""
_END = Path()  # end of the list
_DEVICES = {"CON", "PRN", "AUX", "NUL"} | {f"{s}{k}" for s in ("COM", "LPT") for k in range(10)}
_MOST_LETTERS = 259  # of a path on Windows, unless long paths are enabled
_PATIENCE_S = (0.05, 0.1, 0.2, 0.4)
"""Waits before retries to replace a file that another program holds, perhaps only for a moment."""
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextmanager
def stage_output(
    folder: str | Path,
    inputs: Iterable[str | Path] = (),
    photos: Iterable[str | Path] = (),
    hold: Callable[[], None] | None = None,
) -> Iterator[Path]:
    """Yield a hidden folder to write into; move its files into `folder` once all are complete.

    The hidden folder is inside `folder`, so on the same file system. Its files replace those of the
    same name one by one (``os.replace``), `results.json` last; other files stay. On any failure,
    Ctrl-C included, the files of `folder` are as before, and the hidden folder is removed; the
    remains of a killed run are removed when the next run starts, and files that it had already
    moved are put back. A file that another program keeps from being replaced, as Excel does, is
    written next to it under another name (`name_newer`), with a warning.

    Parameters
    ----------
    folder
        The output folder; made where there is none.
    inputs
        Files that no output may replace.
    photos
        The originals: no file is written into their folders.
    hold
        Raises where another process may write now (`claim_folder`). Files that stopped processes
        were moving are put back, and they cannot continue.

    Raises
    ------
    OutputError
        The folder cannot be written to, holds the photos, or one in it is a link that leads
        elsewhere; the disk is full; an output has the name of an input.
    """
    folder = Path(folder).absolute()
    photo_folders = {Path(path).resolve().parent for path in photos}
    _keep_apart(photo_folders, folder)
    with convert_output_errors(folder):
        existed = folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        _remove_stale(folder)
        held, staging = _hidden_folder(folder)
        try:
            (staging / NEW).mkdir(parents=True)
            yield staging / NEW
            _check_targets(staging / NEW, folder, inputs, photo_folders)
            if hold is not None:
                hold()
                _stop_moving(folder, staging)
            _commit(staging, folder)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
            held.release()
            if not existed:
                with suppress(OSError):  # it contains results now, or files of others
                    folder.rmdir()


def replace_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) in one step: see `replace_bytes`."""
    replace_bytes(path, text.encode())


def replace_bytes(path: Path, content: bytes, option: str = "--output") -> None:
    """Write a file atomically: a reader finds the old one or the new one.

    Parameters
    ----------
    path, content
        The file.
    option
        Option that names another folder, in messages.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is unchanged.
    """
    path = path.absolute()
    unfinished = path.with_name(f".{path.name}.unfinished")
    with convert_output_errors(path.parent, option):
        try:
            unfinished.unlink(missing_ok=True)
            with unfinished.open("xb") as stream:  # never through a link
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            replace(unfinished, path)
        finally:
            unfinished.unlink(missing_ok=True)


def replace(source: Path, target: Path) -> None:
    """Replace a file by another one.

    On Windows, a file that another program has open cannot be replaced: the function waits for a
    virus scanner that reads a new file.

    Raises
    ------
    OSError
        It cannot be moved there.
    """
    for wait_s in _PATIENCE_S if sys.platform == "win32" else ():
        try:
            source.replace(target)
        except PermissionError:
            time.sleep(wait_s)
        else:
            return
    source.replace(target)


def name_newer(path: Path) -> Path:
    """Return the name of a file whose target another program has open."""
    return path.with_name(f"{path.stem}.newer{path.suffix}")


@contextmanager
def convert_output_errors(folder: Path, option: str = "--output") -> Iterator[None]:
    """Convert failures to write below `folder` to errors that name the option for another one."""
    _refuse_names(folder)
    try:
        yield
    except OSError as fault:
        name = os.fspath(fault.filename) if fault.filename is not None else ""
        is_ours = isinstance(name, str) and Path(name).is_relative_to(folder)
        elsewhere = f"choose another folder with {option}"
        if fault.errno in _FULL:
            why = "the disk is full"
            elsewhere = f"free some space, or {elsewhere}"
        elif is_ours and sys.platform == "win32" and len(name) > _MOST_LETTERS:
            why = (
                f"a path of {len(name)} letters is too long for Windows as it is set here ({name})"
            )
            elsewhere = f"choose a folder with a shorter path with {option}"
        elif is_ours and isinstance(fault, PermissionError) and fault.filename2 is not None:
            why = f"{fault.filename2} may not be replaced"
            elsewhere = "if another program has it open, close it"
        elif is_ours or name in {str(parent) for parent in folder.parents}:
            why = f"{fault.strerror} ({name})"
        else:
            raise
        raise OutputError(
            f"{folder}: cannot write results, earlier ones are untouched; {why}; {elsewhere}"
        ) from fault


def _hidden_folder(folder: Path) -> tuple[FileLock, Path]:
    """Create a lock for a hidden folder; return it and the folder's path, which is not made yet."""
    while True:
        handle, name = tempfile.mkstemp(prefix=IN_USE_PREFIX, dir=folder)
        os.close(handle)
        with suppress(BlockingIOError):  # another run tests whether its owner was killed
            return FileLock(Path(name)), folder / f"{PREFIX}{name.rpartition(IN_USE_PREFIX)[2]}"


def _remove_stale(folder: Path) -> None:
    """Remove hidden folders whose process has ended."""
    for stale in folder.glob(f"{PREFIX}*"):
        in_use = folder / stale.name.replace(PREFIX, IN_USE_PREFIX, 1)
        with suppress(OSError, OutputError):  # locked by a living run, or already gone
            held = FileLock(in_use) if stale.is_dir() and not stale.is_symlink() else None
            if held is None:
                continue
            if held.why_not:  # without locks, the remains of killed runs stay
                held.release()
                continue
            try:
                log.info("removing %s, which a killed run left behind", stale)
                _put_back(stale, folder)
                shutil.rmtree(stale)
            finally:
                held.release()
    for in_use in folder.glob(f"{IN_USE_PREFIX}*"):  # killed before it made its folder
        with suppress(OSError, OutputError):
            FileLock(in_use).release()


def _stop_moving(folder: Path, own: Path) -> None:
    """Take over the hidden folders of all others that are moving files, and put these back."""
    for other in folder.glob(f"{PREFIX}*"):
        if other != own and (other / MOVING).is_file():
            taken = own / other.name
            with suppress(FileNotFoundError):  # it has ended
                other.rename(taken)
                _put_back(taken, folder)


def _keep_apart(photo_folders: Set[Path], folder: Path) -> None:
    """Refuse to write among the photos: the next run might take a result for one of them."""
    if folder.resolve() in photo_folders:
        raise OutputError(
            f"{folder}: holds the photos themselves, and nothing is written among them; choose "
            "another folder with --output (or `output` in the project)"
        )


def _check_targets(
    source: Path, folder: Path, inputs: Iterable[str | Path], photo_folders: Set[Path]
) -> None:
    """Refuse to overwrite inputs, or to write through links that lead elsewhere."""
    kept = {Path(path).resolve() for path in inputs}
    for path in sorted(source.rglob("*")):
        target = folder / path.relative_to(source)
        real = target.resolve()
        if path.is_file() and real in kept:
            raise OutputError(
                f"{real}: is an input, and a result has the same name; nothing was written; choose "
                "another folder with --output (or `output` in the project), or rename the input"
            )
        if path.is_dir():
            _keep_apart(photo_folders, target)
            if not real.is_relative_to(folder.resolve()):
                raise OutputError(
                    f"{target}: is a link that leads out of the output folder, to {real}; "
                    "nothing was written: remove the link"
                )


def _commit(staging: Path, folder: Path) -> None:
    """Move all files into place; undo everything if one of them fails."""
    source, backup = staging / NEW, staging / EARLIER
    names = sorted(
        (path.relative_to(source) for path in source.rglob("*") if path.is_file()),
        key=lambda name: (name.as_posix() == LAST_MOVED, name.as_posix()),
    )
    kept = []
    inner = {folder / one for name in names for one in name.parents if not (folder / one).is_dir()}
    try:
        for name in names:
            _flush(source / name)
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with suppress(PermissionError):  # an unreadable file is not replaced either
                for one in _names_for(name):
                    if (folder / one).is_file():
                        (backup / one).parent.mkdir(parents=True, exist_ok=True)
                        _keep(folder / one, backup / one)
                kept.append(name)
        list_text = "\n".join(name.as_posix() for name in [*kept, _END])
        (staging / MOVING).write_text(list_text, encoding="utf-8")
        _flush(staging / MOVING)
        for name in names:
            _move(source / name, folder / name)
    except BaseException:
        # if the hidden folder was taken over, the other process restores it
        for name in kept if (staging / MOVING).is_file() else ():
            _restore(staging, folder, name)
        for made in sorted(inner, reverse=True):  # those inside another one first
            with suppress(OSError):
                made.rmdir()
        raise
    # the output is complete: remove the list, so that it is never put back by another run
    (staging / MOVING).unlink(missing_ok=True)


def _names_for(path: Path) -> list[Path]:
    """Return names for a result; the first one that no other program holds is used."""
    again = (path.with_name(f"{path.stem}.newer-{k}{path.suffix}") for k in (2, 3))
    return [path, name_newer(path), *again]


def find_latest(path: Path) -> Path:
    """Return the file that the last run wrote for a result: itself, or one beside it."""
    written = [name for name in _names_for(path) if name.is_file()]
    return max(written, key=lambda name: name.stat().st_mtime_ns, default=path)


def _move(source: Path, target: Path) -> None:
    """Move a file into its place, or next to it where another program holds that."""
    names = _names_for(target)
    for name in names:
        try:
            replace(source, name)
        except PermissionError:
            if name is names[-1] or not name.is_file():
                raise
            continue
        if name is not target:
            log.warning(
                "%s is open in another program and could not be replaced: the new one is %s "
                "beside it. Close the program, and use that one, or run this again",
                target,
                name.name,
            )
        break
    if name is target:
        for other in names[1:]:  # from an earlier run
            with suppress(OSError):
                other.unlink(missing_ok=True)


def _put_back(stale: Path, folder: Path) -> None:
    """Undo the moves of a killed run, unless it had moved everything."""
    if not (stale / MOVING).is_file():
        return
    *names, end = map(Path, (stale / MOVING).read_text(encoding="utf-8").split("\n"))
    if not all(_is_own(stale, folder, name) for name in names):
        log.warning("%s is not of this program's making: nothing of it is put back", stale)
        return
    # killed while the list was written: no file had been moved
    if end == _END and any((stale / NEW / name).exists() for name in names):
        for name in names:
            _restore(stale, folder, name)


def _is_own(stale: Path, folder: Path, name: Path) -> bool:
    """Return whether a name leads nowhere else, as one in an unpacked archive may."""
    homes = {stale / NEW: stale, stale / EARLIER: stale, folder: folder}
    return ".." not in name.parts and all(
        (home / name).parent.resolve().is_relative_to(own.resolve()) for home, own in homes.items()
    )


def _flush(path: Path) -> None:
    with path.open("r+b") as stream:
        os.fsync(stream.fileno())


def _keep(path: Path, backup: Path) -> None:
    """Keep a second name of a file by a hard link; a copy where that is not possible.

    Windows cannot remove a name of a file that another program has open.
    """
    try:
        if sys.platform == "win32":
            shutil.copy2(path, backup)
        else:
            backup.hardlink_to(path)
    except OSError:
        shutil.copy2(path, backup)


def _restore(staging: Path, folder: Path, name: Path) -> None:
    """Put back a file that was already moved, and those next to it."""
    if (staging / NEW / name).exists():
        return  # not moved yet
    for one in _names_for(name):
        backup, target = staging / EARLIER / one, folder / one
        with suppress(PermissionError):  # open in another program: it could not be replaced either
            if backup.exists():
                backup.replace(target)
            else:
                target.unlink(missing_ok=True)


def _refuse_names(folder: Path) -> None:
    """Reject names that are no text, and those that Windows reserves for devices.

    Raises
    ------
    OutputError
        A part of the path is one.
    """
    written = write_out(folder)
    if written != str(folder):
        raise OutputError(
            f"{written}: a name in this path is no text, so results cannot be written there; "
            "rename the folder, or choose another folder with --output"
        )
    for part in folder.parts if sys.platform == "win32" else ():
        if part.partition(".")[0].rstrip().upper() in _DEVICES:
            raise OutputError(
                f"{folder}: Windows keeps the name {part} for a device, so nothing can be written "
                "there; choose another folder with --output"
            )


CLAIM = ".uavgram-claim"


class SupersededError(OutputError):
    """Another process measures the same survey, or did meanwhile: this one writes no results."""

    def __init__(self, folder: Path | str) -> None:
        super().__init__(str(folder))
        self.folder = folder

    def __str__(self) -> str:
        return (
            f"{self.folder}: another process began to measure into it meanwhile, so this one wrote "
            "nothing: let one batch at a time measure a survey"
        )


@contextmanager
def claim_folder(folder: str | Path) -> Iterator[Callable[[], None]]:
    """Claim an output folder; the last claim wins. The yielded function raises if it is another's.

    Parameters
    ----------
    folder
        Made where there is none, and removed at the end if it is still empty.

    Raises
    ------
    OutputError
        The folder cannot be written to; `SupersededError` by the yielded function.
    """
    folder, token = Path(folder).absolute(), uuid.uuid4().hex
    existed = folder.is_dir()

    def is_ours() -> bool:
        try:
            return (folder / CLAIM).read_text(encoding="ascii") == token
        except (OSError, UnicodeError):
            return False

    def hold() -> None:
        if not is_ours():
            raise SupersededError(folder)

    try:
        with convert_output_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / CLAIM).unlink(missing_ok=True)  # never through a link
            (folder / CLAIM).write_text(token, encoding="ascii")
        yield hold
    finally:
        with suppress(OSError):
            if is_ours():
                (folder / CLAIM).unlink()
            if not existed:
                folder.rmdir()
