"""Metadata of a photo without decoding it: EXIF and XMP tags, size, and the maker's camera."""

from __future__ import annotations

import logging
import math
import mmap
import re
import struct
import threading
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, cast
from xml.parsers import expat

import cv2
import exifread
import numpy as np

from uavgram.errors import InputError, describe_non_file
from uavgram.geometry.geodesy import Origin
from uavgram.imaging.photos.decoding import EOI, SOS, START, Segment, find_jpeg_frame, read_segments
from uavgram.input_files import UnusableFile, read_bytes, refuse_unread
from uavgram.model.camera import CameraTags

APP0, APP1 = 0xE0, 0xE1
EXIF_HEAD = b"Exif\x00\x00"
XMP_HEAD = b"http://ns.adobe.com/xap/1.0/\x00"
LARGEST_SEGMENT = 65533
TAKE_OUT = "take it out of the folder"


@dataclass(frozen=True)
class Jpeg:
    """Segments of a JPEG before the first scan, and all bytes from there on unchanged."""

    segments: tuple[Segment, ...]
    scan: bytes

    def app1(self, head: bytes) -> bytes | None:
        """Return the payload after `head` of the first APP1 segment that begins with it."""
        for segment in self.segments:
            if segment.marker == APP1 and segment.payload.startswith(head):
                return segment.payload[len(head) :]
        return None


def parse_jpeg(data: bytes) -> Jpeg | None:
    """Split a JPEG file; None for other formats, or if its segments are truncated."""
    found = list(read_segments(data))
    if not found or found[-1][0].marker not in (SOS, EOI):
        return None
    return Jpeg(tuple(segment for segment, _ in found[:-1]), data[found[-1][1] :])


def build_jpeg(segments: Iterable[Segment], scan: bytes) -> bytes:
    """Join segments and scan to a file.

    Raises
    ------
    ValueError
        A segment is longer than the format allows.
    """
    parts = [START]
    for segment in segments:
        if len(segment.payload) > LARGEST_SEGMENT:
            raise ValueError(f"segment of {len(segment.payload)} bytes: at most {LARGEST_SEGMENT}")
        head = struct.pack(">BBH", 0xFF, segment.marker, len(segment.payload) + 2)
        parts += [head, segment.payload]
    return b"".join([*parts, scan])


# exifread does not check counts and offsets, and raises these errors where a block is corrupt.
_WHAT_EXIFREAD_RAISES = (
    *(AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError),
    *(struct.error, ZeroDivisionError),
)
MAX_BYTES, MAX_READS = 64_000_000, 1_000_000
"""Limits of reading a photo's tags: a camera writes some 100 kB; more means damage or an attack."""

_here = threading.local()


def read_exif_tags(path: str | Path) -> dict[str, Any]:
    """Read a photo's EXIF tags by exifread's names; empty where the photo has no EXIF.

    Raises
    ------
    InputError
        The file cannot be read, has a format without a reader, or its EXIF is broken.
    """
    if what := describe_non_file(path):
        raise InputError(path, f"is {what}: {TAKE_OUT}")
    refuse_unread(path)
    _here.is_reading = True
    try:
        with Path(path).open("rb") as file:
            metered = cast("BinaryIO", _LimitedFile(file))
            return dict(exifread.process_file(metered, details=False, extract_thumbnail=False))
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    except _WHAT_EXIFREAD_RAISES as fault:
        raise InputError(
            path, f"its EXIF is broken ({fault}): leave this photo out, or copy it again"
        ) from fault
    finally:
        _here.is_reading = False


class _LimitedFile:
    """File with a limit on the bytes and reads: a tag may state any length up to 4 GB."""

    def __init__(self, file: BinaryIO) -> None:
        self.seek, self.tell = file.seek, file.tell
        self._read = file.read
        self._bytes, self._reads = MAX_BYTES, MAX_READS

    def read(self, size: int) -> bytes:
        self._bytes -= size
        self._reads -= 1
        if self._bytes < 0:
            raise ValueError(f"a tag asks for {size:,} bytes")
        if self._reads < 0:
            raise ValueError("its tags have no end")
        return self._read(size)


def _is_not_ours(_: logging.LogRecord) -> bool:
    return not getattr(_here, "is_reading", False)


# exifread logs missing tags once a photo. Other users of the library in the process keep its
# messages.
logging.getLogger("exifread").addFilter(_is_not_ours)


def exif_text(tags: Mapping[str, Any], *names: str) -> str:
    """Return the text of the first of these tags that is present; empty where none is."""
    return str(next((tags[name] for name in names if name in tags), "")).strip("\0 ")


def exif_numbers(tag: Any) -> list[float]:  # noqa: ANN401 - exifread has no types
    """Convert a tag of any of EXIF's types to numbers; empty if one of them is not finite.

    exifread returns whole numbers, ratios (also 0/0, which means "unknown"), each float and double
    as a tuple of one, and text unchanged.
    """
    values = getattr(tag, "values", [])
    if isinstance(values, str):
        values = values.strip("\0 ").split()
    try:
        numbers = [float(value[0] if isinstance(value, tuple) else value) for value in values]
    except (IndexError, OverflowError, TypeError, ValueError, ZeroDivisionError):
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


_MOST_LOOKED_AT = 20  # photos that are read for the common place
_ALTITUDE_SIGN = {0: 1.0, 1: -1.0, 2: 1.0, 3: -1.0}


@dataclass(frozen=True)
class ExifPlace:
    """Latitude, longitude [deg] and altitude [m]; NaN where EXIF has none.

    `above_sea` is True where EXIF states this datum (Exif 3.0, references 2 and 3); the older
    references 0 and 1 mean sea level or the ellipsoid, depending on the maker.
    """

    latitude_deg: float = float("nan")
    longitude_deg: float = float("nan")
    altitude_m: float = float("nan")
    above_sea: bool = False


def read_exif_place(path: str | Path) -> ExifPlace:
    """Read a photo's GPS tags; (0, 0), which means "no fix", counts as no place.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    tags = read_exif_tags(path)
    latitude = _degrees(tags, "Latitude", "S")
    longitude = _degrees(tags, "Longitude", "W")
    if latitude == 0.0 and longitude == 0.0:
        latitude = longitude = float("nan")
    reference = exif_numbers(tags.get("GPS GPSAltitudeRef"))
    code = int(reference[0]) if reference else 0
    altitude = exif_numbers(tags.get("GPS GPSAltitude"))
    return ExifPlace(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=altitude[0] * _ALTITUDE_SIGN.get(code, 1.0) if altitude else float("nan"),
        above_sea=code in (2, 3),
    )


def _degrees(tags: dict[str, Any], name: str, negative: str) -> float:
    """Convert degrees, minutes, seconds to signed degrees; NaN if incomplete."""
    parts = exif_numbers(tags.get(f"GPS GPS{name}"))
    reference = exif_text(tags, f"GPS GPS{name}Ref").upper()
    if len(parts) != 3 or not reference:
        return float("nan")
    size = float(np.dot(parts, [1.0, 1 / 60, 1 / 3600]))
    return -size if reference.startswith(negative) else size


def read_first_site(paths: Iterable[str | Path]) -> Origin | None:
    """Return the place of the first photo whose EXIF has one; None where there is none."""
    for path in islice((path for path in paths if Path(path).is_file()), _MOST_LOOKED_AT):
        place = read_exif_place(path)
        if math.isfinite(place.latitude_deg + place.longitude_deg):
            return place.latitude_deg, place.longitude_deg, 0.0
    return None


# Plain expat instead of a tree: declarations of types and entities are refused before they expand.


XmpTags = Mapping[tuple[str, str], str]
"""Text by (namespace without its last slash, name)."""

DJI = "http://www.dji.com/drone-dji/1.0"
PIX4D = "http://pix4d.com/camera/1.0"
XMP = "http://ns.adobe.com/xap/1.0"
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_START, _END = b"<x:xmpmeta", b"</x:xmpmeta>"
LARGEST_PACKET = 4_000_000
_SEPARATOR = "\n"  # between namespace and name; it occurs in neither


class _DeclarationError(ValueError):
    """Document type or entity declaration, which XMP does not have, but attacks do."""


def read_xmp(path: str | Path) -> XmpTags:
    """Read the XMP tags of a photo; empty where it has none.

    Raises
    ------
    InputError
        The file cannot be read, or its packet is not XML, or declares entities.
    """
    packet = xmp_packet(Path(path))
    if packet is None:
        return {}
    try:
        return parse_xmp(packet)
    except (expat.ExpatError, _DeclarationError) as fault:
        raise InputError(
            path,
            f"its XMP packet cannot be read ({fault}): leave this photo out, or give the poses in "
            "a CSV file",
        ) from fault


def xmp_packet(path: Path) -> bytes | None:
    """Extract the XML of a photo's XMP packet.

    In a file other than JPEG it is the first packet anywhere in the file.
    """
    data = read_bytes(path)
    jpeg = parse_jpeg(data)
    place = data if jpeg is None else jpeg.app1(XMP_HEAD)
    if place is None:
        return None
    start = place.find(_START)
    end = place.find(_END, start)
    if start < 0 or end < 0 or end - start > LARGEST_PACKET:
        return None
    return place[start : end + len(_END)]


def parse_xmp(packet: bytes) -> XmpTags:
    """Collect the tags of a packet: attributes, and elements that hold only text.

    Raises
    ------
    xml.parsers.expat.ExpatError
        The packet is not XML.
    ValueError
        It declares a document type or an entity.
    """
    tags: dict[tuple[str, str], str] = {}
    text: list[str] = []

    def start(_name: str, attributes: dict[str, str]) -> None:
        text.clear()
        for key, value in attributes.items():
            tags.setdefault(_key(key), value.strip())

    def end(name: str) -> None:
        value = "".join(text).strip()
        text.clear()
        if value and _key(name)[0] != _RDF.rstrip("/"):
            tags.setdefault(_key(name), value)

    def refuse(*_: object) -> None:
        raise _DeclarationError("it declares a document type or an entity")

    parser = expat.ParserCreate(namespace_separator=_SEPARATOR)
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text.append
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.Parse(packet, True)  # noqa: FBT003 - expat takes it by position: the last piece
    return tags


def _key(qualified: str) -> tuple[str, str]:
    namespace, _, name = qualified.rpartition(_SEPARATOR)
    return namespace.rstrip("/"), name


_TIFF = (b"II*\0", b"MM\0*")
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF_SIDES = ("ImageWidth", "ImageLength")


def read_image_size(path: str | Path) -> tuple[int, int]:
    """Read width and height [px] of the stored, unrotated image.

    JPEG, PNG and TIFF are read from their headers; every other format is decoded by OpenCV. A JPEG
    is also checked for its end marker: a truncated file cannot be decoded.

    Raises
    ------
    InputError
        The file is missing, truncated, of an unsupported format, or not a photo.
    """
    if what := describe_non_file(path):
        raise InputError(path, f"is {what}: {TAKE_OUT}")
    refuse_unread(path)
    size, is_whole = None, True
    try:
        with Path(path).open("rb") as file:
            head = file.read(26)
            if head.startswith(START):
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                    frame = find_jpeg_frame(content)
                    if frame is not None:
                        size, is_whole = frame.size_px, frame.is_whole
            elif head[:8] == _PNG and len(head) >= 24:
                size = struct.unpack(">II", head[16:24])
            elif head[:4] in _TIFF:
                size = _tiff_size(path)
            else:
                size = _decode_size(path)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    if size is None or min(size) <= 0:
        what = "is no photo" if head else "is empty, and no photo"
        raise InputError(path, f"{what} that can be read: {TAKE_OUT}")
    if not is_whole:
        raise InputError(
            path,
            "is cut off, the end of the picture is missing: copy it from the camera once more, or "
            f"{TAKE_OUT}",
        )
    return int(size[0]), int(size[1])


def read_image_sizes(
    paths: Iterable[Path],
) -> tuple[dict[Path, tuple[int, int]], tuple[UnusableFile, ...]]:
    """Read the sizes of photos by `read_image_size`; list those that cannot be used."""
    sizes: dict[Path, tuple[int, int]] = {}
    unusable = []
    for path in paths:
        try:
            sizes[path] = read_image_size(path)
        except InputError as why:
            unusable.append(UnusableFile(path, why.message))
    return sizes, tuple(unusable)


def _tiff_size(path: str | Path) -> tuple[int, int] | None:
    """Read the size of the first picture from the tags.

    A decoder could be made to allocate gigabytes by a false header.
    """
    tags = read_exif_tags(path)
    sides = [getattr(tags.get(f"Image {name}"), "values", []) for name in _TIFF_SIDES]
    numbers = [side[0] for side in sides if side and isinstance(side[0], int)]
    return (numbers[0], numbers[1]) if len(numbers) == 2 else None


def _decode_size(path: str | Path) -> tuple[int, int] | None:
    if str(path).isascii() and not cv2.haveImageReader(str(path)):
        return None
    # Decode the content, as OpenCV finds no file with an umlaut in its name on Windows.
    content = np.fromfile(path, np.uint8)
    if not len(content):
        return None
    image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        return None
    return image.shape[1], image.shape[0]


_BROWN, _RATIONAL = 9, 12
# Largest denominator of a rational number that still shows how a focal length was rounded.
_TELLING_DENOMINATOR = 1000
_INFINITE = 2**32 - 1  # as a numerator
_UNITS_MM = {2.0: 25.4, 3.0: 10.0, 4.0: 1.0, 5.0: 0.001}  # CIPA DC-008 has the first two


def read_camera_tags(path: str | Path) -> CameraTags:
    """Read the camera tags of a photo.

    Raises
    ------
    InputError
        The photo cannot be read, or the maker's calibration in it is invalid.
    """
    exif, xmp = read_exif_tags(path), read_xmp(path)
    width, height = read_image_size(path)
    focal, step = _focal(exif)
    return CameraTags(
        path=str(path),
        width_px=width,
        height_px=height,
        make=exif_text(exif, "Image Make"),
        model=exif_text(exif, "Image Model"),
        serial=exif_text(exif, "EXIF BodySerialNumber") or xmp.get((DJI, "CameraSerialNumber"), ""),
        focal_mm=focal,
        focal_step_mm=step,
        focal_35mm_mm=_positive(exif, "EXIF FocalLengthIn35mmFilm"),
        focal_plane_per_mm=_focal_plane(exif),
        original_px=(
            _positive(exif, "EXIF ExifImageWidth"),
            _positive(exif, "EXIF ExifImageLength"),
        ),
        focus_m=_positive(exif, "EXIF SubjectDistance"),
        digital_zoom=max(1.0, _positive(exif, "EXIF DigitalZoomRatio", otherwise=1.0)),
        dewarp=_dewarp(path, xmp),
        dewarped=xmp.get((DJI, "DewarpFlag"), "0").strip() == "1",
    )


def read_all_camera_tags(paths: Iterable[str]) -> tuple[CameraTags, ...]:
    """Read the tags of many photos in parallel, as most of the time is spent on disk access."""
    with ThreadPoolExecutor() as pool:
        return tuple(pool.map(read_camera_tags, paths))


def _positive(exif: Mapping[str, Any], key: str, otherwise: float = math.nan) -> float:
    """Read a number in EXIF; 0, 0/0 and infinity mean "unknown" (CIPA DC-008)."""
    tag = exif.get(key)
    numbers = exif_numbers(tag)
    if tag is None or len(numbers) != 1 or numbers[0] <= 0:
        return otherwise
    return numbers[0] if getattr(tag.values[0], "num", numbers[0]) < _INFINITE else otherwise


def _focal(exif: Mapping[str, Any]) -> tuple[float, float]:
    """Read the focal length and its rounding step [mm]."""
    focal = _positive(exif, "EXIF FocalLength")
    if math.isnan(focal):
        return focal, 0.0
    value = exif["EXIF FocalLength"].values[0]
    denominator = getattr(value, "den", None)
    if denominator is None:  # a float: use its number of digits
        denominator = 10 ** len(f"{focal:.6f}".rstrip("0").partition(".")[2])
    return focal, 0.0 if denominator > _TELLING_DENOMINATOR else 1.0 / denominator


def _focal_plane(exif: Mapping[str, Any]) -> tuple[float, float]:
    """Read pixels per mm on the sensor, across and down; inches where no unit is stated."""
    unit = exif_numbers(exif.get("EXIF FocalPlaneResolutionUnit")) or [2.0]
    unit_mm = _UNITS_MM.get(unit[0], math.nan)
    across, down = (_positive(exif, f"EXIF FocalPlane{axis}Resolution") for axis in "XY")
    return across / unit_mm, (across if math.isnan(down) else down) / unit_mm


def _dewarp(path: str | Path, xmp: XmpTags) -> tuple[float, ...]:
    """Read DJI's own calibration of the lens, without its date.

    The tag is ``date;fx,fy,cx,cy,k1,k2,p1,p2,k3``, after the user manuals of Mavic 3M and Matrice 4
    (pages 90, 91), which name the order.
    """
    for name, count in (("DewarpDataK6", _RATIONAL), ("DewarpData", _BROWN)):
        text = xmp.get((DJI, name), "").strip()
        if not text:
            continue
        fields = re.split(r"[,\s]+", text.rpartition(";")[2].strip())
        try:
            numbers = tuple(float(field) for field in fields if field)
        except ValueError:
            numbers = ()
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            raise InputError(
                path, f"its tag {name} is no calibration (expected {count} numbers): {text!r}"
            )
        if not any(numbers):
            continue  # written by cameras that were never calibrated
        if min(numbers[:2]) <= 0:
            raise InputError(path, f"its tag {name} has no positive focal lengths: {text!r}")
        return numbers
    return ()
