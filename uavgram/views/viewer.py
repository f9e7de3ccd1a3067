"""The Rerun viewer as a program of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from uavgram.errors import InputError, UavgramError

MAGIC = (b"RRF2", b"RRIO", b"RRF0", b"RRF1")


def open_viewer(recording: Path) -> None:
    """Open a recording in the viewer that came with rerun-sdk; return when it is closed.

    The viewer listens on this machine only.

    Raises
    ------
    InputError
        There is no such file, or it is no recording.
    UavgramError
        The viewer could not run, for example without a screen.
    """
    try:
        with recording.open("rb") as stream:
            head = stream.read(4)
    except OSError as fault:
        raise InputError(recording, f"cannot be read: {fault.strerror}") from fault
    if head not in MAGIC:
        raise InputError(recording, "is not a Rerun recording (.rrd)")
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", str(recording)]
    status = subprocess.run(command, check=False).returncode  # noqa: S603  (our own interpreter)
    if status:
        raise UavgramError(
            f"the Rerun viewer ended with status {status}; it needs a screen and a graphics driver "
            f"(try: rerun --serve-web --bind 127.0.0.1 {recording})"
        )
