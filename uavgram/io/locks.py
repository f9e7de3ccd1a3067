"""Locks that end with the process that holds them; and that of a project's tables, which say whose.

The operating system holds them, so what a killed process left behind is no lock.
"""

from __future__ import annotations

import errno
import logging
import os
import sys
from pathlib import Path

from uavgram.errors import OutputError, UavgramError
from uavgram.io.own_files import open_own

if sys.platform != "win32":
    import fcntl

log = logging.getLogger(__name__)

LOCK = "pick.lock"


def lock(handle: int) -> None:
    """Lock an open file or folder for this process.

    Raises
    ------
    BlockingIOError
        Another one has locked it.
    OSError
        There are no locks here, as on some network file systems.
    """
    if sys.platform == "win32":
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


class ProjectLock:
    """The right to write a project's tables, held until `release` or the end of the process.

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
        The folder cannot be written to, or a link stands where the lock should be.
    """

    def __init__(self, folder: Path, project: str) -> None:
        self._path = folder / LOCK
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._handle = self._locked(project)
            os.ftruncate(self._handle, 0)
            os.pwrite(self._handle, f"{os.getpid()}\n".encode(), 0)
        except OSError as fault:
            raise OutputError(
                f"{folder}: cannot be written to ({fault.strerror}); name another folder as "
                "`output` in the project"
            ) from fault

    def release(self) -> None:
        """Let others write."""
        self._path.unlink(missing_ok=True)  # while it is locked: nobody else holds this file
        os.close(self._handle)

    def _locked(self, project: str) -> int:
        while True:
            handle = open_own(self._path, os.O_RDWR | os.O_CREAT)
            try:
                lock(handle)
            except BlockingIOError as fault:
                holder = os.pread(handle, 32, 0).decode(errors="replace").strip() or "unknown"
                os.close(handle)
                raise UavgramError(
                    f"{project}: is open in another picking page or search for points, process "
                    f"{holder}: use that one, or end it with Ctrl+C first"
                ) from fault
            except OSError as fault:
                log.warning("a second writer of this project is not noticed: %s", fault.strerror)
            if self._path.exists() and os.path.samestat(os.fstat(handle), self._path.stat()):
                return handle
            os.close(handle)  # it was released, and so removed, between opening and locking


def is_locked(folder: Path) -> bool:
    """Whether a process holds the lock of a project with this output folder."""
    try:
        handle = open_own(folder / LOCK, os.O_RDONLY)
    except (OSError, OutputError):
        return False
    try:
        lock(handle)
    except BlockingIOError:
        return True
    except OSError:  # no locks here
        return False
    finally:
        os.close(handle)
    return False
