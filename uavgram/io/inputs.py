"""Input files as bytes and as text, with one message for each way in which they cannot be read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from uavgram.errors import InputError, no_file
from uavgram.io.unread_formats import refuse_unread


def read_bytes(path: str | Path, way_out: str = "name a file") -> bytes:
    """Content of a file.

    Parameters
    ----------
    path
        The file.
    way_out
        What to do where a folder, a pipe or a device stands there.

    Raises
    ------
    InputError
        It is no file, of a format that is not read, or cannot be read.
    """
    with opened(path, way_out) as file:
        return file.read()


@contextmanager
def opened(path: str | Path, way_out: str = "name a file") -> Iterator[BinaryIO]:
    """A file to read piece by piece; parameters and errors as of `read_bytes`."""
    if what := no_file(path):
        raise InputError(path, f"is {what}: {way_out}")
    refuse_unread(path)
    try:
        with Path(path).open("rb") as file:
            yield file
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault


def read_text(path: str | Path, what_to_do: str) -> str:
    """Text of a UTF-8 file, without byte order mark.

    Parameters
    ----------
    path
        The file.
    what_to_do
        Ends the message where it is no such text.

    Raises
    ------
    InputError
        It is no file, cannot be read, or is no UTF-8 text: names the line.
    """
    data = read_bytes(path)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise InputError(path, f"is not UTF-8 text: {what_to_do}", line) from fault
