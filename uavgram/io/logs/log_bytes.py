"""The bytes of a log file."""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError


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
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    if not data:
        raise InputError(path, f"is empty: copy the log from the {origin} once more")
    return data
