"""The bytes of a log file."""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.inputs import read_bytes


def read_log_bytes(path: str | Path, origin: str) -> bytes:
    """Read a whole log.

    Parameters
    ----------
    path
        The file.
    origin
        Where to copy it from once more, if it is empty.

    Raises
    ------
    InputError
        It cannot be read, or is empty.
    """
    data = read_bytes(path, "name a flight log")
    if not data:
        raise InputError(path, f"is empty: copy the log from the {origin} once more")
    return data
