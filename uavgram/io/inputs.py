"""Input files as bytes and as text, with their SHA-256, and formats that nothing reads."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, NamedTuple

from uavgram.errors import InputError, no_file
from uavgram.model.provenance import InputDigest


def digest_inputs(
    paths: Iterable[str | Path], folder: str | Path | None = None
) -> tuple[InputDigest, ...]:
    """Digest input files, each once, in the order given.

    Parameters
    ----------
    paths
        The files.
    folder
        Paths inside this folder (the project's) are named relative to it, with ``/``, so that
        results do not depend on where a project lies; others stay as they are.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    return tuple(digest_file(path, folder) for path in dict.fromkeys(map(Path, paths)))


def digest_file(path: str | Path, folder: str | Path | None = None) -> InputDigest:
    """Digest one input file; see `digest_inputs`."""
    path = Path(path)
    try:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
            size = os.fstat(stream.fileno()).st_size
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    inside = folder is not None and path.is_relative_to(folder)
    name = path.relative_to(folder).as_posix() if inside and folder is not None else str(path)
    return InputDigest(path=name, sha256=sha256, size_bytes=size)


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


_HEAD_BYTES = 4096
_READ = (b"\xff\xd8\xff", b"\x89PNG")


class UnreadFormat(NamedTuple):
    """A format: its name, how its files begin, their suffixes, the way out."""

    name: str
    begins: bytes
    suffixes: str
    way_out: str


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
        "companion file of macOS (AppleDouble, ._)",
        rb"\x00\x05\x16[\x00\x07]",
        "",
        "name the file without ._ at its beginning, or delete this one",
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
    """Recognise a format that is not read, by how the file begins, else by its suffix.

    None where it is another one, or the file cannot be read.
    """
    if no_file(path):
        return None
    try:
        with Path(path).open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError:
        return None
    suffix = "" if head.startswith(_READ) else Path(path).suffix.lower()
    by_content = (known for known in _FORMATS if re.match(known.begins, head, re.DOTALL))
    by_suffix = (known for known in _FORMATS if suffix in known.suffixes.split())
    return next(by_content, None) or next(by_suffix, None)


def refuse_unread(path: str | Path) -> None:
    """Refuse a file of a format that is not read.

    Raises
    ------
    InputError
        Names the format, and the way out.
    """
    if known := unread_format(path):
        raise InputError(path, f"is a {known.name}, which is not read: {known.way_out}")
