"""File locks: held by one process, and released by the operating system when it ends.

A file left by a killed process is not a lock. A lock on a project's tables names its process.
"""

from __future__ import annotations

import errno
import logging
import os
import sys
from contextlib import suppress
from pathlib import Path

from uavgram.errors import OutputError, UavgramError
from uavgram.io.own_files import open_own

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

log = logging.getLogger(__name__)

LOCK = "pick.lock"
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
