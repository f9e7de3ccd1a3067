"""Writing of EXIF (CIPA DC-008, Exif 2.32) and XMP tags; pixels are copied byte by byte.

All other tags are kept. TIFF 6.0 directories may be anywhere in the block: the new first directory
and the new GPS directory are appended to the existing block, so no offset of another tag changes.
"""

from __future__ import annotations

import io
import math
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

import numpy as np
from PIL import ExifTags, Image

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import START, Segment
from uavgram.io.photos import metadata
from uavgram.model.frames import GeoTags

BYTE, ASCII, LONG, RATIONAL = 1, 2, 4, 5
GPS_IFD = 0x8825
# CIPA DC-008, table of GPS attributes
VERSION, LATITUDE_REF, LATITUDE, LONGITUDE_REF, LONGITUDE = 0, 1, 2, 3, 4
ALTITUDE_REF, ALTITUDE, MAP_DATUM, POSITIONING_ERROR = 5, 6, 0x12, 0x1F
_EMPTY_TIFF = b"II\x2a\x00\x08\x00\x00\x00\x00\x00\x00\x00\x00\x00"  # a directory without entries
_SECOND_STEPS = 10_000_000  # 1e-7 arc seconds: 3 micrometres

Entries = dict[int, bytes]  # tag -> its 12 bytes


class TiffError(ValueError):
    """EXIF block that does not conform to TIFF 6.0."""


@dataclass(frozen=True, kw_only=True)
class ExifGps:
    """Place to write: WGS 84 degrees, height and horizontal standard deviation in metres."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    sigma_horizontal_m: float


def set_gps(tiff: bytes | None, gps: ExifGps) -> bytes:
    """Set the GPS tags of an EXIF block (without its ``Exif`` head); None starts a new one.

    Time and other GPS tags that exist already stay.

    Raises
    ------
    TiffError
        The block cannot be read.
    """
    block = bytearray(_EMPTY_TIFF if tiff is None else tiff)
    order = {b"II": "<", b"MM": ">"}.get(bytes(block[:2]))
    if order is None or len(block) < 8:
        raise TiffError("its EXIF has no TIFF header")
    try:
        (first,) = struct.unpack_from(f"{order}I", block, 4)
        main, following = _read_directory(block, order, first)
        old = main.get(GPS_IFD)
        gps_entries: Entries = {}
        if old is not None:
            gps_entries, _ = _read_directory(block, order, struct.unpack(f"{order}I", old[8:])[0])
    except struct.error as fault:
        raise TiffError("its EXIF is cut short") from fault
    for tag, kind, count, value in _gps_values(order, gps):
        gps_entries[tag] = _entry(block, order, tag, kind, (count, value))
    gps_at = _append(block, _directory(order, gps_entries, 0))
    main[GPS_IFD] = struct.pack(f"{order}HHII", GPS_IFD, LONG, 1, gps_at)
    struct.pack_into(f"{order}I", block, 4, _append(block, _directory(order, main, following)))
    return bytes(block)


def _read_directory(block: bytearray, order: str, at: int) -> tuple[Entries, int]:
    (count,) = struct.unpack_from(f"{order}H", block, at)
    (following,) = struct.unpack_from(f"{order}I", block, at + 2 + 12 * count)
    raw = (bytes(block[at + 2 + 12 * k : at + 14 + 12 * k]) for k in range(count))
    return {struct.unpack_from(f"{order}H", entry)[0]: entry for entry in raw}, following


def _directory(order: str, entries: Entries, following: int) -> bytes:
    table = b"".join(entries[tag] for tag in sorted(entries))  # ascending, as TIFF 6.0 demands
    return struct.pack(f"{order}H", len(entries)) + table + struct.pack(f"{order}I", following)


def _entry(block: bytearray, order: str, tag: int, kind: int, content: tuple[int, bytes]) -> bytes:
    count, value = content
    if len(value) > 4:
        value = struct.pack(f"{order}I", _append(block, value))
    return struct.pack(f"{order}HHI", tag, kind, count) + value.ljust(4, b"\x00")


def _append(block: bytearray, data: bytes) -> int:
    """Append data to the block at an even offset; return the offset."""
    block.extend(b"\x00" * (len(block) % 2))
    at = len(block)
    block.extend(data)
    return at


def _gps_values(order: str, gps: ExifGps) -> list[tuple[int, int, int, bytes]]:
    """List tag, type, count and value of each GPS tag."""
    millimetres = round(abs(gps.height_m) * 1000)
    error = max(round(gps.sigma_horizontal_m * 1000), 1)
    south, west = gps.latitude_deg < 0, gps.longitude_deg < 0
    return [
        (VERSION, BYTE, 4, b"\x02\x03\x00\x00"),
        (LATITUDE_REF, ASCII, 2, b"S\x00" if south else b"N\x00"),
        (LATITUDE, RATIONAL, 3, _sexagesimal(order, gps.latitude_deg)),
        (LONGITUDE_REF, ASCII, 2, b"W\x00" if west else b"E\x00"),
        (LONGITUDE, RATIONAL, 3, _sexagesimal(order, gps.longitude_deg)),
        (ALTITUDE_REF, BYTE, 1, b"\x01" if gps.height_m < 0 else b"\x00"),
        (ALTITUDE, RATIONAL, 1, struct.pack(f"{order}2I", millimetres, 1000)),
        (MAP_DATUM, ASCII, 7, b"WGS-84\x00"),
        (POSITIONING_ERROR, RATIONAL, 1, struct.pack(f"{order}2I", error, 1000)),
    ]


def _sexagesimal(order: str, degrees: float) -> bytes:
    """Encode whole degrees, whole minutes and seconds, rounded once, so that none overflows."""
    steps = round(abs(degrees) * 3600 * _SECOND_STEPS)
    minutes, seconds = divmod(steps, 60 * _SECOND_STEPS)
    return struct.pack(f"{order}6I", minutes // 60, 1, minutes % 60, 1, seconds, _SECOND_STEPS)


RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
META = "adobe:ns:meta/"
_PREFIXES = {"x": META, "rdf": RDF, "Camera": f"{metadata.PIX4D}/", "drone-dji": f"{metadata.DJI}/"}
_RESERVED = re.compile(r"ns\d+|xml|")  # reserved by ElementTree
_EMPTY_XMP = (
    f'<x:xmpmeta xmlns:x="{META}"><rdf:RDF xmlns:rdf="{RDF}"><rdf:Description rdf:about=""/>'
    "</rdf:RDF></x:xmpmeta>"
).encode()
_BEGIN = '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
_END = '\n<?xpacket end="w"?>'


def set_tags(packet: bytes | None, tags: Mapping[tuple[str, str], str]) -> bytes:
    """Set tags in a packet (its ``x:xmpmeta``), and wrap it for a file.

    Parameters
    ----------
    packet
        The photo's packet; None starts a new one.
    tags
        Text by (namespace without its last slash, name); they replace those of the same name.

    Raises
    ------
    xml.parsers.expat.ExpatError, ValueError
        The packet is not XML, declares entities, or has no description.
    """
    source = _EMPTY_XMP if packet is None else packet
    metadata.parse_xmp(source)  # refuses declarations of entities
    for prefix, uri in {**_PREFIXES, **_prefixes(source)}.items():
        if not _RESERVED.fullmatch(prefix):
            ET.register_namespace(prefix, uri)
    root = ET.fromstring(source)  # noqa: S314 - declarations were refused above
    places = list(root.iter(f"{{{RDF}}}Description"))
    if not places:
        raise ValueError("it has no rdf:Description")
    for place in places:
        _remove(place, tags)
    for (namespace, name), text in tags.items():
        places[0].set(f"{{{namespace}/}}{name}", text)
    body = ET.tostring(root, encoding="unicode")
    return (_BEGIN + body + _END).encode("utf-8")


def _prefixes(packet: bytes) -> dict[str, str]:
    events = ET.iterparse(io.BytesIO(packet), events=("start-ns",))  # noqa: S314 - as above
    return {str(prefix): str(uri) for _, (prefix, uri) in events}


def _remove(place: ET.Element, tags: Mapping[tuple[str, str], str]) -> None:
    """Remove the tags, both as attributes and as elements."""
    for key in [key for key in place.attrib if _key(key) in tags]:
        del place.attrib[key]
    for child in [child for child in place if _key(child.tag) in tags]:
        place.remove(child)


def _key(qualified: str) -> tuple[str, str]:
    namespace, _, name = qualified.removeprefix("{").rpartition("}")
    return namespace.rstrip("/"), name


Tags = dict[tuple[str, str], str]


def write_tagged_photo(tags: GeoTags, k: int, target: Path) -> None:
    """Write a copy of photo `k` with its pose: EXIF GPS, Pix4D's tags, DJI's if it has any.

    Parameters
    ----------
    tags
        Places, attitudes and accuracies of N photos.
    k
        Row of the photo in them.
    target
        The copy; a file of that name is overwritten.

    Raises
    ------
    InputError
        The photo is not a JPEG, or its EXIF or XMP cannot be read, or has no room.
    """
    path = Path(tags.path[k])
    jpeg = metadata.parse_jpeg(path.read_bytes())
    if jpeg is None:
        raise InputError(path, "is no JPEG, and only those can be tagged: leave --exif out")
    gps = ExifGps(
        latitude_deg=float(tags.latitude_deg[k]),
        longitude_deg=_half_turn(float(tags.longitude_deg[k])),
        height_m=float(tags.height_m[k]),
        sigma_horizontal_m=float(tags.sigma_horizontal_m[k]),
    )
    try:
        exif = metadata.EXIF_HEAD + set_gps(jpeg.app1(metadata.EXIF_HEAD), gps)
        packet = metadata.xmp_packet(path)
        old = {} if packet is None else metadata.parse_xmp(packet)
        xmp = metadata.XMP_HEAD + set_tags(packet, _pose_tags(tags, k, old))
        target.write_bytes(metadata.build_jpeg(_replace_segments(jpeg, exif, xmp), jpeg.scan))
    except (TiffError, expat.ExpatError, ValueError) as fault:
        raise InputError(path, f"cannot be tagged: {fault}; leave --exif out") from fault


def _replace_segments(jpeg: metadata.Jpeg, exif: bytes, xmp: bytes) -> list[Segment]:
    """Put new EXIF and XMP before the other segments, after a JFIF header."""
    rest = [
        segment
        for segment in jpeg.segments
        if segment.marker != metadata.APP1
        or not segment.payload.startswith((metadata.EXIF_HEAD, metadata.XMP_HEAD))
    ]
    front = 1 if rest and rest[0].marker == metadata.APP0 else 0
    return [*rest[:front], Segment(metadata.APP1, exif), Segment(metadata.APP1, xmp), *rest[front:]]


def _pose_tags(tags: GeoTags, k: int, old: metadata.XmpTags) -> Tags:
    """Collect the tags to set: Pix4D's always; DJI's where old ones exist and would contradict."""
    yaw, pitch, roll = np.degrees(tags.nadir_ypr_rad[k])
    new: Tags = {
        (metadata.PIX4D, "Yaw"): f"{yaw:.4f}",
        (metadata.PIX4D, "Pitch"): f"{pitch:.4f}",
        (metadata.PIX4D, "Roll"): f"{roll:.4f}",
        (metadata.PIX4D, "GPSXYAccuracy"): f"{tags.sigma_horizontal_m[k]:.3f}",
        (metadata.PIX4D, "GPSZAccuracy"): f"{tags.sigma_vertical_m[k]:.3f}",
        (metadata.PIX4D, "HorizCS"): "EPSG:4326",
        # EGM96, the geoid of autopilots and receivers, represents "above sea level"
        (metadata.PIX4D, "VertCS"): "ellipsoidal" if tags.datum == "ellipsoid" else "EPSG:5773",
    }
    yaw, pitch, roll = np.degrees(tags.gimbal_ypr_rad[k])
    longitude = f"{_half_turn(float(tags.longitude_deg[k])):.9f}"
    per_axis = f"{tags.sigma_horizontal_m[k]:.5f}"
    dji = {
        "GimbalYawDegree": f"{_half_turn(float(yaw)):+.2f}",
        "GimbalPitchDegree": f"{pitch:+.2f}",
        "GimbalRollDegree": f"{roll:+.2f}",
        "AbsoluteAltitude": f"{tags.height_m[k]:+.3f}",
        "GpsLatitude": f"{tags.latitude_deg[k]:.9f}",
        "GpsLongitude": longitude,
        "GpsLongtitude": longitude,
        "RtkStdLat": per_axis,
        "RtkStdLon": per_axis,
        "RtkStdHgt": f"{tags.sigma_vertical_m[k]:.5f}",
    }
    new |= {(metadata.DJI, name): text for name, text in dji.items() if (metadata.DJI, name) in old}
    return new


def _half_turn(degrees: float) -> float:
    """Reduce an angle to [-180, 180)."""
    return math.remainder(degrees, 360.0)


def insert_exif(jpeg: bytes, *, time_utc_s: float, zone_h: float, make: str, model: str) -> bytes:
    """Insert an EXIF segment after the JPEG's start marker.

    Parameters
    ----------
    jpeg
        A JPEG file without EXIF.
    time_utc_s
        The camera clock's reading less its zone, seconds since the Unix epoch; written to the
        millisecond.
    zone_h
        Zone of the camera clock, hours east of Greenwich.
    make, model
        ASCII names of the camera.

    Raises
    ------
    ValueError
        `jpeg` is not a JPEG.
    """
    if not jpeg.startswith(START):
        raise ValueError("not a JPEG: it does not start with FF D8")
    time = datetime.fromtimestamp(0, UTC) + timedelta(milliseconds=round(time_utc_s * 1e3))
    time = time.astimezone(timezone(timedelta(hours=zone_h)))
    stamp = f"{time:%Y:%m:%d %H:%M:%S}"
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = make
    exif[ExifTags.Base.Model] = model
    exif[ExifTags.Base.DateTime] = stamp
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            ExifTags.Base.ExifVersion: b"0232",
            ExifTags.Base.DateTimeOriginal: stamp,
            ExifTags.Base.OffsetTimeOriginal: time.isoformat()[-6:],
            ExifTags.Base.SubsecTimeOriginal: f"{time.microsecond // 1000:03d}",
        }
    )
    return metadata.build_jpeg([Segment(metadata.APP1, exif.tobytes())], jpeg[len(START) :])
