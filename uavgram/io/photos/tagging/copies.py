"""Copies of photos with their poses in EXIF and XMP; the pixels are copied byte by byte."""

from __future__ import annotations

import math
from pathlib import Path
from xml.parsers import expat

import numpy as np

from uavgram.errors import InputError
from uavgram.io.photos.metadata import (
    APP0,
    APP1,
    DJI,
    EXIF_HEAD,
    PIX4D,
    XMP_HEAD,
    Jpeg,
    Segment,
    XmpTags,
    build_jpeg,
    parse_jpeg,
    parse_xmp,
    xmp_packet,
)
from uavgram.io.photos.tagging.exif_gps import ExifGps, TiffError, with_gps
from uavgram.io.photos.tagging.xmp import with_tags
from uavgram.model.flight.pose import GeoTags

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
    jpeg = parse_jpeg(path.read_bytes())
    if jpeg is None:
        raise InputError(path, "is no JPEG, and only those can be tagged: leave --exif out")
    gps = ExifGps(
        latitude_deg=float(tags.latitude_deg[k]),
        longitude_deg=_half_turn(float(tags.longitude_deg[k])),
        height_m=float(tags.height_m[k]),
        sigma_horizontal_m=float(tags.sigma_horizontal_m[k]),
    )
    try:
        exif = EXIF_HEAD + with_gps(jpeg.app1(EXIF_HEAD), gps)
        packet = xmp_packet(path)
        old = {} if packet is None else parse_xmp(packet)
        xmp = XMP_HEAD + with_tags(packet, _pose_tags(tags, k, old))
        target.write_bytes(build_jpeg(_replaced(jpeg, exif, xmp), jpeg.scan))
    except (TiffError, expat.ExpatError, ValueError) as fault:
        raise InputError(path, f"cannot be tagged: {fault}; leave --exif out") from fault


def _replaced(jpeg: Jpeg, exif: bytes, xmp: bytes) -> list[Segment]:
    """Put new EXIF and XMP before the other segments, after a JFIF header."""
    rest = [
        segment
        for segment in jpeg.segments
        if segment.marker != APP1 or not segment.payload.startswith((EXIF_HEAD, XMP_HEAD))
    ]
    front = 1 if rest and rest[0].marker == APP0 else 0
    return [*rest[:front], Segment(APP1, exif), Segment(APP1, xmp), *rest[front:]]


def _pose_tags(tags: GeoTags, k: int, old: XmpTags) -> Tags:
    """Collect the tags to set: Pix4D's always; DJI's where old ones exist and would contradict."""
    yaw, pitch, roll = np.degrees(tags.nadir_ypr_rad[k])
    new: Tags = {
        (PIX4D, "Yaw"): f"{yaw:.4f}",
        (PIX4D, "Pitch"): f"{pitch:.4f}",
        (PIX4D, "Roll"): f"{roll:.4f}",
        (PIX4D, "GPSXYAccuracy"): f"{tags.sigma_horizontal_m[k]:.3f}",
        (PIX4D, "GPSZAccuracy"): f"{tags.sigma_vertical_m[k]:.3f}",
        (PIX4D, "HorizCS"): "EPSG:4326",
        # EGM96, the geoid of autopilots and receivers, represents "above sea level"
        (PIX4D, "VertCS"): "ellipsoidal" if tags.datum == "ellipsoid" else "EPSG:5773",
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
    new |= {(DJI, name): text for name, text in dji.items() if (DJI, name) in old}
    return new


def _half_turn(degrees: float) -> float:
    """Reduce an angle to [-180, 180)."""
    return math.remainder(degrees, 360.0)
