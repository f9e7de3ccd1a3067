"""Formats that people hand in and no reader here knows, each with the way out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from uavgram.errors import InputError, no_file

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
