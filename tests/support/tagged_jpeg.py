"""Small JPEGs with the tags that a test wants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from uavgram.imaging.photos.decoding import Segment
from uavgram.io.photos.metadata import APP1, EXIF_HEAD, XMP_HEAD, build_jpeg, parse_jpeg
from uavgram.io.photos.tagging import ExifGps, set_gps
from uavgram.model.frames import Photos

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
DJI = "http://www.dji.com/drone-dji/1.0/"


def packet(inner: str) -> bytes:
    return (
        f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="{RDF}">{inner}</rdf:RDF>'
        "</x:xmpmeta>"
    ).encode()


def dji(**tags: str) -> bytes:
    text = " ".join(f'drone-dji:{name}="{value}"' for name, value in tags.items())
    return packet(f'<rdf:Description xmlns:drone-dji="{DJI}" {text}/>')


def jpeg(xmp: bytes | None = None, size: int = 16) -> bytes:
    rng = np.random.default_rng(3)
    image = rng.integers(0, 255, (size, size, 3), dtype=np.uint8)
    plain = cv2.imencode(".jpg", image)[1].tobytes()
    if xmp is None:
        return plain
    parsed = parse_jpeg(plain)
    assert parsed is not None
    return build_jpeg([*parsed.segments, Segment(APP1, XMP_HEAD + xmp)], parsed.scan)


def placed_jpeg(longitude_deg: float, latitude_deg: float) -> bytes:
    """A JPEG whose EXIF states a place."""
    plain = parse_jpeg(jpeg())
    assert plain is not None
    place = ExifGps(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        height_m=500.0,
        sigma_horizontal_m=1.0,
    )
    return build_jpeg(
        [Segment(APP1, EXIF_HEAD + set_gps(None, place)), *plain.segments], plain.scan
    )


def photos(paths: Sequence[Path], file_time_s: ArrayLike | None = None) -> Photos:
    count = len(paths)
    return Photos(
        frame_id=tuple(path.name for path in paths),
        path=tuple(str(path) for path in paths),
        width_px=np.full(count, 16.0),
        height_px=np.full(count, 16.0),
        file_time_s=np.full(count, np.nan)
        if file_time_s is None
        else np.asarray(file_time_s, float),
        file_time_resolution_s=np.full(count, 1.0),
        time_source="none" if file_time_s is None else "exif",
    )
