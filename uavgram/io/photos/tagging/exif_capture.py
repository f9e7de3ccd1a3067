"""Put capture time and camera into a JPEG: the EXIF segment of CIPA DC-008 (Exif 2.32)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone

from PIL import ExifTags, Image

from uavgram.io.photos.jpeg_segments import APP1, START, Segment, build_jpeg


@dataclass(frozen=True, kw_only=True)
class CaptureTags:
    """What a camera says of an exposure.

    Attributes
    ----------
    time_utc_s
        The camera clock's reading with its zone taken off, seconds since the Unix epoch; written
        to the millisecond.
    zone_h
        The zone it is set to, hours east of Greenwich.
    make, model
        ASCII names of the camera.
    """

    time_utc_s: float
    zone_h: float
    make: str
    model: str


def with_exif(jpeg: bytes, tags: CaptureTags) -> bytes:
    """Insert an EXIF segment behind the JPEG's start marker.

    Parameters
    ----------
    jpeg
        A JPEG file without EXIF.
    tags
        What to say in it.

    Raises
    ------
    ValueError
        `jpeg` is none.
    """
    if not jpeg.startswith(START):
        raise ValueError("not a JPEG: it does not start with FF D8")
    time = datetime.fromtimestamp(0, UTC) + timedelta(milliseconds=round(tags.time_utc_s * 1e3))
    time = time.astimezone(timezone(timedelta(hours=tags.zone_h)))
    stamp = f"{time:%Y:%m:%d %H:%M:%S}"
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = tags.make
    exif[ExifTags.Base.Model] = tags.model
    exif[ExifTags.Base.DateTime] = stamp
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            ExifTags.Base.ExifVersion: b"0232",
            ExifTags.Base.DateTimeOriginal: stamp,
            ExifTags.Base.OffsetTimeOriginal: time.isoformat()[-6:],
            ExifTags.Base.SubsecTimeOriginal: f"{time.microsecond // 1000:03d}",
        }
    )
    return build_jpeg([Segment(APP1, exif.tobytes())], jpeg[len(START) :])
