"""Destination of a recording: a pipe into a file that this program writes itself.

Rerun's own file writer is a thread that ends at the first error (such as a full disk), and a flush
or a disconnect that waits for it then never returns (rerun-sdk 0.41). A pipe that is always read
to its end has no such error; errors of the file are raised as an exception.
"""

from __future__ import annotations

import os
import shutil
import sys
import threading
from pathlib import Path
from typing import BinaryIO

PIECE_BYTES = 1 << 20
# Opening one of these duplicates the file descriptor (Linux, macOS; not Windows).
DESCRIPTORS = Path("/dev/fd")
_HAS_DESCRIPTORS = sys.platform != "win32" and DESCRIPTORS.is_dir()


class FileSink:
    """Copy of the bytes written to `path` into a file.

    Open `path` for writing, then `start`; when it is closed, `finish`.

    Attributes
    ----------
    path
        Path to which Rerun writes; without such pipes (on Windows) the file itself.
    """

    def __init__(self, target: Path) -> None:
        self._target = target
        self._failure: OSError | None = None
        self._thread: threading.Thread | None = None
        self._ends: tuple[int, int] | None = os.pipe() if _HAS_DESCRIPTORS else None
        self.path = target if self._ends is None else DESCRIPTORS / str(self._ends[1])

    def start(self) -> None:
        """Begin to copy; `path` must be open, so that the copy ends with its writer."""
        if self._ends is None:
            return
        read_end, write_end = self._ends
        os.close(write_end)
        self._ends = None
        self._thread = threading.Thread(
            target=self._copy, args=(os.fdopen(read_end, "rb", buffering=0),)
        )
        self._thread.start()

    def finish(self) -> None:
        """Wait for the end.

        Raises
        ------
        OSError
            If the file could not be written.
        """
        if self._ends is not None:  # never started
            for end in self._ends:
                os.close(end)
            self._ends = None
        if self._thread is not None:
            self._thread.join()
        if self._failure is not None:
            raise self._failure

    def _copy(self, source: BinaryIO) -> None:
        with source:
            try:
                with self._target.open("wb") as file:
                    shutil.copyfileobj(source, file, PIECE_BYTES)
            except OSError as failure:
                self._failure = failure
                while source.read(PIECE_BYTES):  # the writer must never wait for a reader
                    pass
