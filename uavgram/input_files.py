"""Input files as bytes and as text, with one message for each reason why they cannot be read.

Known formats without a reader in this program have a message with a remedy.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, NamedTuple

from uavgram.errors import InputError, describe_non_file, describe_unread

_HEAD_BYTES = 4096
_READ = (b"\xff\xd8\xff", b"\x89PNG")
_TIFF = (b"II*\x00", b"MM\x00*")
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


class UnreadFormat(NamedTuple):
    """Format: its name, pattern of its first bytes, suffixes, remedy."""

    name: str
    begins: bytes
    suffixes: str
    way_out: str


class UnusableFile(NamedTuple):
    """File whose name is that of a usable one, and the reason why it cannot be used."""

    path: Path
    reason: str


_POSES = "a CSV table (image, latitude_deg, longitude_deg, height_m), and name that in `poses`"
_RAW_TAG = rb"\x12\xc6\x01\x00\x04\x00\x00\x00|\xc6\x12\x00\x01\x00\x00\x00\x04"  # DNGVersion
_FORMATS = (
    UnreadFormat(
        "pointer of Git LFS",
        rb"version https://git-lfs\.github\.com/spec/",
        "",
        "the file itself was not downloaded; fetch it with `git lfs pull`",
    ),
    UnreadFormat(
        "companion file of macOS (AppleDouble)",
        rb"\x00\x05\x16[\x00\x07]",
        "",
        "it holds no picture or data; delete it, and name the file that it belongs to",
    ),
    UnreadFormat(
        "HEIC photo",
        rb".{4}ftyp(?:hei|hev|mif1|msf1|avif)",
        ".heic .heif .hif .avif",
        "save it as JPEG, with its tags and in its full size",
    ),
    UnreadFormat(
        "video",
        rb".{4}ftyp|RIFF.{4}AVI |\x1aE\xdf\xa3",
        ".mp4 .mov .avi .mkv .m4v .lrf .mts .insv",
        "save still pictures of it, such as by `ffmpeg -i VIDEO -vf fps=1 frame_%04d.png`",
    ),
    UnreadFormat(
        "raw photo (DNG and the like)",
        rb"(?:II\*\x00|MM\x00\*).*(?:%b)" % _RAW_TAG,
        ".dng .arw .cr2 .cr3 .nef .raf .orf .rw2",
        "develop it as JPEG or TIFF without crop and lens correction",
    ),
    UnreadFormat(
        "subtitle file of a video (SubRip, .SRT)",
        rb"(?:\xef\xbb\xbf)?\s*\d+\s*\n\d+:\d\d:\d\d[,.]\d+ --> ",
        ".srt",
        f"write the places of the frames into {_POSES}",
    ),
    UnreadFormat(
        "track of RTKLIB (.pos)",
        rb"% *(?:program *: *\S*RTK|GPST|UTC|\(?lat)",
        ".pos",
        f"write the places at the instants of the photos into {_POSES}",
    ),
)


def unread_format(path: str | Path) -> UnreadFormat | None:
    """Recognise a format without a reader, by its first bytes, else by its suffix.

    None for any other format, or if the file cannot be read.
    """
    head = _head(path)
    if not head:
        return None
    suffix = "" if head.startswith(_READ) else Path(path).suffix.lower()
    by_content = (known for known in _FORMATS if re.match(known.begins, head, re.DOTALL))
    by_suffix = (known for known in _FORMATS if suffix in known.suffixes.split())
    return next(by_content, None) or next(by_suffix, None)


def is_unread_photo(path: Path) -> bool:
    """Return whether a file is a photo in a format without a reader, such as HEIC."""
    known = unread_format(path)
    return known is not None and "photo" in known.name


MAX_NAMED = 5
"""Number of files of another format than their ending states that are named."""


def describe_files(paths: Iterable[Path]) -> str:
    """Describe files without a use, by kind and number, with remedies; empty without any."""
    kinds = [(path, unread_format(path)) for path in paths]
    names = Counter(known.name if known else f"*{path.suffix}" for path, known in kinds)
    hidden = [
        f"{path.name} is a {known.name}"
        for path, known in kinds
        if known and path.suffix.lower() not in known.suffixes.split()
    ]
    ways = {f"A {known.name}: {known.way_out}": None for _, known in kinds if known}
    counted = ", ".join(f"{count} x {name}" for name, count in names.items())
    return (
        ". ".join([f"Passed over: {counted}", *hidden[:MAX_NAMED], *ways]) + "." if counted else ""
    )


def _head(path: str | Path) -> bytes:
    """Read how a file begins: nothing where it is none, or cannot be read."""
    if describe_non_file(path):
        return b""
    try:
        with Path(path).open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError:
        return b""


def binary_kind(path: str | Path) -> str:
    """Return the kind of a binary file named in place of a text file; empty if it may be text."""
    head = _head(path)
    if head.startswith((*_READ, *_TIFF)):
        return "a photo"
    return "no text file" if b"\x00" in head and not head.startswith(_UTF_16) else ""


def refuse_unread(path: str | Path) -> None:
    """Raise an error for a file of a format without a reader.

    Raises
    ------
    InputError
        Names the format and the remedy.
    """
    if known := unread_format(path):
        raise InputError(path, f"is a {known.name}, which is not read: {known.way_out}")


def read_bytes(path: str | Path, way_out: str = "name a file") -> bytes:
    """Read the content of a file.

    Parameters
    ----------
    path
        The file.
    way_out
        Remedy in the message for a folder, a pipe or a device.

    Raises
    ------
    InputError
        It is not a file, has a format without a reader, or cannot be read.
    """
    with opened(path, way_out) as file:
        return file.read()


@contextmanager
def opened(path: str | Path, way_out: str = "name a file") -> Iterator[BinaryIO]:
    """Open a file to read it piece by piece; parameters and errors as of `read_bytes`."""
    if what := describe_non_file(path):
        raise InputError(path, f"is {what}: {way_out}")
    refuse_unread(path)
    try:
        with Path(path).open("rb") as file:
            yield file
    except OSError as fault:
        raise InputError(path, describe_unread(fault)) from fault


def read_text(path: str | Path, what_to_do: str) -> str:
    """Read the text of a UTF-8 file, without byte order mark.

    Parameters
    ----------
    path
        The file.
    what_to_do
        End of the message for a file with other content.

    Raises
    ------
    InputError
        It is not a file, cannot be read, or is not UTF-8 text: names the line.
    """
    data = read_bytes(path)
    refuse_utf_16(path, data)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise InputError(path, f"is not UTF-8 text: {what_to_do}", line) from fault


def refuse_utf_16(path: str | Path, data: bytes) -> None:
    """Raise an InputError where the content of a file is UTF-16 text."""
    if _is_utf_16(data[:64]):
        raise InputError(path, "is UTF-16 text ('Unicode' in some programs): save it as UTF-8", 1)


def _is_utf_16(start: bytes) -> bool:
    """Return whether text is UTF-16: by its mark, or because every other byte is 0."""
    is_half_empty = b"\0" in start and not (any(start[::2]) and any(start[1::2]))
    return start.startswith(_UTF_16) or is_half_empty
