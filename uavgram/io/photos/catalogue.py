"""Photo files of a project or a calibration board: search, names, sizes and capture times."""

from __future__ import annotations

import glob
import math
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from unicodedata import normalize

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError, suggest_spelling
from uavgram.imaging.photos.decoding import decode_photo
from uavgram.input_files import UnusableFile, describe_files, read_bytes, unread_format
from uavgram.io.files import check_name, digest_inputs, find_matching_files
from uavgram.io.photos.metadata import (
    exif_text,
    read_all_camera_tags,
    read_exif_tags,
    read_image_sizes,
)
from uavgram.io.tables.csv_tables import is_formula
from uavgram.model.board import LensSetting
from uavgram.model.camera import CameraTags
from uavgram.model.frames import Photos, TimeSource
from uavgram.model.message import Message, MessagePlural
from uavgram.model.options import TimeOptions
from uavgram.model.provenance import InputDigest

PASSED_OVER = "files-passed-over"
"""Code of the message on files that are not used."""

NONE_NAMED: Mapping[str, str] = MappingProxyType({})

MAX_NAMED = 10
"""Number of unusable photos that an error names."""


GONE = "if the photos were moved or renamed, put them back; else correct `images` in the project"
"""Remedy where the project finds none of its photos."""


class UnusablePhotosError(InputError):
    """Photos of a project that are missing, damaged, empty, or no photos.

    Parameters
    ----------
    photos
        At least one of them.
    way_out
        Remedy for all of them together, as a clause; may be empty.

    Attributes
    ----------
    photos
        All of them; the message names the first ones.
    """

    def __init__(self, photos: Sequence[UnusableFile], way_out: str = "") -> None:
        self.photos = tuple(photos)
        (first, reason), *others = self.photos[:MAX_NAMED]
        if len(self.photos) == 1:
            text = f"{reason}, or {way_out}" if way_out else reason
        else:
            lines = [reason, *(f"{path}: {why}" for path, why in others)]
            if (more := len(self.photos) - MAX_NAMED) > 0:
                lines.append(f"... and {more} more photos that cannot be used")
            text = "\n".join([*lines, f"Or {way_out}" if way_out else ""]).rstrip()
        super().__init__(first, text)


_MOMENT = re.compile(
    r"(?P<year>(?:19|20)\d\d)(?P<a>[-_.]?)(?P<month>[01]\d)(?P<b>[-_.]?)(?P<day>[0-3]\d)"
    r"(?P<c>[-_T. ]?)(?P<hour>[0-2]\d)(?P<d>[-_.h]?)(?P<minute>[0-5]\d)(?P<e>[-_.m]?)"
    r"(?P<second>[0-5]\d)(?P<f>\.?)(?P<fraction>\d{0,6})"
)


def name_format(stems: Sequence[str]) -> str | None:
    """Find the format of the times in file names.

    Parameters
    ----------
    stems
        Names without suffix.

    Returns
    -------
    str or None
        For strptime; None where not every name holds a time of one form, or two hold the same.
    """
    if not stems:
        return None
    match = _MOMENT.search(stems[0])
    if match is None:
        return None
    form = "%Y{a}%m{b}%d{c}%H{d}%M{e}%S".format(**match.groupdict())
    if match["fraction"]:
        form += f"{match['f']}%f"
        end = match.end()
    else:
        end = match.start("f")
    before, after = (
        part.replace("%", "%%") for part in (stems[0][: match.start()], stems[0][end:])
    )
    form = f"{before}{form}{after}"
    try:
        moments = {datetime.strptime(stem, form) for stem in stems}  # noqa: DTZ007  (compared only)
    except ValueError:
        return None
    return form if len(moments) == len(stems) else None


@dataclass(frozen=True)
class _Reading:
    """Camera clock reading: seconds since the Unix epoch, its step, and whether it has a zone."""

    time_s: float = float("nan")
    resolution_s: float = float("nan")
    zoned: bool = False


def read_photos(
    patterns: tuple[str, ...],
    options: TimeOptions,
    left_out: Collection[str] = (),
    named: Mapping[str, str] = NONE_NAMED,
) -> tuple[Photos, tuple[Message, ...]]:
    """Find the photos of a project and read their sizes and capture times.

    Parameters
    ----------
    patterns
        Absolute file names or patterns.
    options
        Source of the times; `auto` takes EXIF where most photos have it, else none.
    left_out
        Names of photos that are not read.
    named
        Names of photos that must be there, with what names them.

    Raises
    ------
    UnusablePhotosError
        Files are missing, damaged, or no photos.
    InputError
        A pattern matches nothing, two photos have one name, or one has no time at the source that
        the project names.
    """
    matching, unread = separate_unread(find_photos(patterns, left_out), patterns)
    size_of, unusable = read_image_sizes(matching)
    lost = [name for name in named if name not in left_out]
    unusable += tuple(_list_lost({name: named[name] for name in lost}, matching))
    if unusable:
        raise UnusablePhotosError(unusable)
    paths = list(size_of)
    sizes = np.array(list(size_of.values()), dtype=np.float64)
    readings, source, messages = _times(paths, options)
    photos = Photos(
        frame_id=tuple(path.name for path in paths),
        path=tuple(str(path) for path in paths),
        width_px=sizes[:, 0],
        height_px=sizes[:, 1],
        file_time_s=np.array([reading.time_s for reading in readings]),
        file_time_resolution_s=np.array([reading.resolution_s for reading in readings]),
        time_source=source,
    )
    passed = (Message("info", PASSED_OVER, describe_files(unread)),) if unread else ()
    return photos, (*passed, *messages, *_like_formulas(photos.frame_id))


def _list_lost(named: Mapping[str, str], photos: Sequence[Path]) -> Iterator[UnusableFile]:
    """List the named photos that are not among those found, each with what may have happened."""
    names = {path.name for path in photos}
    free = names - named.keys()  # only these may be meant by another name
    for name, where in named.items():
        if name not in names:
            yield UnusableFile(
                Path(name),
                f"is not among the project's photos, though {where} names it"
                f"{_explain_loss(name, photos, free)}",
            )


def _explain_loss(name: str, photos: Sequence[Path], free: Set[str]) -> str:
    """Suggest the photo that may be meant, of those without a name of their own, or a copy."""
    names = [path.name for path in photos]
    if normalize("NFC", name) in (normalize("NFC", other) for other in names):
        return (
            ": another name looks the same, but its accents are stored in another way (as macOS "
            "does); rename the photo without accents, and in the table too"
        )
    for folder in {path.parent for path in photos}:
        if known := unread_format(folder / name):
            return f": it is a {known.name}; {known.way_out}"
    alike = {other for other in names if other.casefold() == name.casefold()}
    near = suggest_spelling(name, sorted(alike or free))
    return f"{f' ({near})' if near else ''}: copy it back to the others"


def report_unusable_photos(unusable: Iterable[UnusableFile]) -> tuple[Message, ...]:
    """Report missing and damaged photos by name, each with the reason."""
    return tuple(
        Message(
            "warning",
            "photo-damaged",
            f"The photo {path.name} cannot be used, as it {reason}.",
            frames=(path.name,),
            several=MessagePlural(
                "{count} photos cannot be used",
                path.name,
                reason.partition(":")[0],
                ending="Copy them from the camera once more, or leave them out.",
            ),
        )
        for path, reason in unusable
    )


def separate_unread(
    matching: list[Path], patterns: tuple[str, ...]
) -> tuple[list[Path], list[Path]]:
    """Separate the photos from files of formats without a reader, which only wildcards matched.

    A file that the project names, or that is the only one, is kept: reading it gives the reason.
    """
    unread = [path for path in matching if str(path) not in patterns and unread_format(path)]
    if len(unread) == len(matching):
        return matching, []
    return [path for path in matching if path not in set(unread)], unread


def _like_formulas(names: tuple[str, ...]) -> tuple[Message, ...]:
    """Warn of names like formulas, which tables for other programs must keep unchanged."""
    found = [name for name in names if is_formula(name) or any(map(is_formula, name.split(",")))]
    if not found:
        return ()
    text = (
        f"{len(found)} of the photos' names begin as a formula does (the first is {found[0]!r}). "
        "Tables for other programs (pix4d.csv, pose_priors.csv) must name photos as they are: do "
        "not open those in a spreadsheet, or rename the photos."
    )
    return (Message("warning", "photo-name-formula", text),)


def find_photos(patterns: tuple[str, ...], left_out: Collection[str] = ()) -> list[Path]:
    """Find the files of the patterns but those left out, in the order of their names.

    Raises
    ------
    InputError
        A pattern matches nothing, two files have one name, or all are left out. Some files that are
        named without a pattern may be missing, and those that are left out.
    """
    found: dict[str, Path] = {}
    twice: dict[Path, Path] = {}
    own_names = {*left_out, *map(glob.escape, left_out)}
    wanted = [pattern for pattern in patterns if Path(pattern).name not in own_names]
    there = [pattern for pattern in wanted if glob.has_magic(pattern) or os.path.lexists(pattern)]
    if not there and len(wanted) > 1:
        raise InputError(
            wanted[0],
            f"is not there, nor is any other of the {len(wanted)} photos that `images` names: copy "
            "them back, or correct `images`",
        )
    for pattern in there or wanted:
        files = find_matching_files(pattern, GONE)
        for path in files:
            if path.name in left_out:
                continue
            check_name(path)
            other = found.setdefault(path.name, path)
            if other.resolve() != path.resolve():
                twice[path] = other
    if twice:
        (path, other), *more = twice.items()
        others = f", and {len(more)} more photos have names that occur twice" if more else ""
        raise InputError(
            path,
            f"has the name of {other}{others}; a project tells photos apart by their file names. "
            "Let `images` name one of the folders, and make a project of its own for the other "
            "one, or rename the photos",
        )
    if not found:
        raise InputError(patterns[0], "all of its photos are left out: correct `leave_out`")
    return [found[name] for name in sorted(found)]


def list_absent(patterns: tuple[str, ...], names: Collection[str]) -> list[str]:
    """List the names that no file of the patterns has."""
    every = (name for pattern in patterns for name in glob.iglob(pattern, recursive=True))  # noqa: PTH207
    there = {Path(name).name for name in every}
    return sorted(name for name in names if name not in there)


def _times(
    paths: list[Path], options: TimeOptions
) -> tuple[list[_Reading], TimeSource, tuple[Message, ...]]:
    if options.source == "events":
        return [_Reading()] * len(paths), "none", ()
    source: TimeSource = "filename" if options.source == "filename" else "exif"
    if source == "filename":
        readings = [_filename_reading(path, options.filename_format) for path in paths]
    else:
        readings = [_exif_reading(path) for path in paths]
    timed = [np.isfinite(reading.time_s) for reading in readings]
    if options.source == "auto" and 2 * sum(timed) <= len(paths):
        return [_Reading()] * len(paths), "none", _report_ignored_times(paths, timed)
    if not any(timed):
        raise InputError(paths[0], _describe_no_times(paths, options))
    messages = []
    if not all(timed):
        without = paths[timed.index(False)].name
        where = "EXIF" if source == "exif" else "the names, which do not fit time.filename_format,"
        text = (
            f"{timed.count(False)} of {len(paths)} photos state no capture time in {where} and "
            f"cannot be found in the log by it, the first is {without}: did another program save "
            "it?"
        )
        messages.append(Message("warning", "photo-without-time", text))
    if source == "exif" and not any(reading.zoned for reading in readings):
        text = (
            "The photos state no time zone, so their times were read as UTC. If the camera showed "
            "local time, time.offset_s has to contain the zone: 7200 for a clock 2 h ahead of UTC."
        )
        messages.append(Message("info", "photo-zone-unknown", text))
    return readings, source, tuple(messages)


def _describe_no_times(paths: list[Path], options: TimeOptions) -> str:
    """Describe that no photo states a time where it should be, and the way out."""
    if options.source == "filename":
        return (
            f"its name without suffix, {paths[0].stem!r}, does not fit time.filename_format "
            f"{options.filename_format!r}, nor does that of any other of the {len(paths)} photos; "
            "correct it, or set time.source to auto"
        )
    return (
        f"states no capture time in EXIF, nor does any of the {len(paths)} photos; "
        "set time.source to filename or events"
    )


def _report_ignored_times(paths: list[Path], timed: list[bool]) -> tuple[Message, ...]:
    if not any(timed):
        return ()
    text = (
        f"{timed.count(False)} of {len(paths)} photos state no capture time in EXIF (the first is "
        f"{paths[timed.index(False)].name}): no file time was used; set time.source to override"
    )
    return (Message("warning", "photo-times-ignored", text),)


def _filename_reading(path: Path, pattern: str) -> _Reading:
    """Read the time in the file's name without its suffix; %f may have 1 to 6 digits."""
    try:
        # a zone in the pattern is subtracted in _since_epoch
        moment = datetime.strptime(path.stem, pattern)  # noqa: DTZ007
    except ValueError:
        return _Reading()  # of another form, as that of a copy
    resolution = 1.0
    if "%f" in pattern:
        rest = moment.strftime(pattern.replace("%f", ""))
        resolution = 10.0 ** -min(max(len(path.stem) - len(rest), 1), 6)
    elif "%S" not in pattern and "%T" not in pattern:
        resolution = 60.0
    return _Reading(_since_epoch(moment), resolution, moment.tzinfo is not None)


def _exif_reading(path: Path) -> _Reading:
    """Read DateTimeOriginal with SubSecTimeOriginal and OffsetTimeOriginal (CIPA DC-008, 4.6.6)."""
    tags = read_exif_tags(path)
    text, fraction = (
        exif_text(tags, f"EXIF {name}Original") for name in ("DateTime", "SubSecTime")
    )
    zone = exif_text(tags, "EXIF OffsetTimeOriginal", "EXIF OffsetTime")
    try:
        moment = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007 - zone follows
    except ValueError:
        return _Reading()  # absent, or "0000:00:00 00:00:00": the clock was never set
    try:
        offset = datetime.strptime(zone, "%z").utcoffset()
    except ValueError:
        offset = None
    seconds = _since_epoch(moment) - (offset.total_seconds() if offset is not None else 0.0)
    digits = len(fraction) if fraction.isdigit() else 0
    if digits:
        seconds += int(fraction) / 10.0**digits
    return _Reading(seconds, 10.0**-digits, offset is not None)


def _since_epoch(moment: datetime) -> float:
    """Convert to seconds since the Unix epoch; a time without zone is taken as UTC."""
    return (moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)).timestamp()


LEAST_PHOTOS = 3  # of a plane: two hardly separate principal point and focal length
_SAME_FOCAL = 0.005  # relative difference: EXIF rounds


@dataclass(frozen=True, kw_only=True)
class CalibrationFiles:
    """Photos of one camera, all of one size, in the order of their names.

    Attributes
    ----------
    path
        (M,) files.
    width_px, height_px
        Size of the stored, unrotated photos.
    setting
        (M,) lens settings from EXIF.
    digest
        (M,) chain of custody.
    """

    path: tuple[str, ...]
    width_px: int
    height_px: int
    setting: tuple[LensSetting, ...]
    digest: tuple[InputDigest, ...]


def find_calibration_photos(patterns: Sequence[str]) -> CalibrationFiles:
    """Find photos, and check that they can be of one camera.

    Parameters
    ----------
    patterns
        File names or patterns.

    Raises
    ------
    InputError
        A pattern matches nothing, there are too few photos, one is not a photo or is a copy of
        another, or they differ in size, camera, lens or focal length.
    """
    paths = sorted({name for pattern in patterns for name in _files(pattern)})
    if len(paths) < LEAST_PHOTOS:
        raise InputError(
            paths[0] if paths else "IMAGES",
            f"{len(paths)} of the {LEAST_PHOTOS} photos that a calibration needs; better are 15 to "
            "30, with the board tilted in different directions and the camera also turned by 90 "
            "degrees",
        )
    tags = read_all_camera_tags(paths)
    digests = digest_inputs(paths)
    _refuse_copies(digests)
    for other in tags[1:]:
        _refuse_difference(tags[0], other)
    return CalibrationFiles(
        path=tuple(paths),
        width_px=tags[0].width_px,
        height_px=tags[0].height_px,
        setting=tuple(map(_setting, tags)),
        digest=digests,
    )


_GREY = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}


def read_grey(path: str | Path, reduction: int = 1) -> NDArray[np.uint8]:
    """Read grey values (height, width) of a photo as stored: EXIF rotation is not applied.

    Parameters
    ----------
    path
        File of the photo.
    reduction
        Original pixels per pixel each way: 1, 2, 4 or 8.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    return decode_photo(path, read_bytes(path), _GREY[reduction])


def _files(pattern: str) -> list[str]:
    return [str(path) for path in find_matching_files(pattern, "name the photos of the board")]


def _refuse_copies(digests: Sequence[InputDigest]) -> None:
    first: dict[str, str] = {}
    for digest in digests:
        other = first.setdefault(digest.sha256, digest.path)
        if other != digest.path:
            raise InputError(
                digest.path,
                f"is a copy of {other}: a photo counts once, leave one of the two out",
            )


def _refuse_difference(first: CameraTags, other: CameraTags) -> None:
    one, two = (f"{tags.width_px} x {tags.height_px}" for tags in (first, other))
    name = Path(first.path).name
    if one != two:
        raise InputError(
            other.path,
            f"has {two} pixels, but {name} has {one}: a calibration is of one size; leave the "
            "others out, or calibrate each size by itself",
        )
    facts = (
        ("camera", first.camera_name, other.camera_name),
        ("serial number", first.serial, other.serial),
    )
    for what, wanted, found in facts:
        if wanted and found and wanted != found:
            raise InputError(
                other.path,
                f"was taken by another camera than {name} ({what} {found!r}, not {wanted!r}): "
                "calibrate each camera by itself",
            )
    if abs(other.focal_mm - first.focal_mm) > _SAME_FOCAL * first.focal_mm:  # False for NaN
        raise InputError(
            other.path,
            f"was taken at a focal length of {other.focal_mm:g} mm, but {name} at "
            f"{first.focal_mm:g} mm: calibrate each zoom by itself",
        )


def _setting(tags: CameraTags) -> LensSetting:
    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return LensSetting(
        camera=tags.camera_name,
        focal_length_mm=known(tags.focal_mm),
        focal_length_35mm=known(tags.focal_35mm_mm),
        focus_distance_m=known(tags.focus_m),
    )
