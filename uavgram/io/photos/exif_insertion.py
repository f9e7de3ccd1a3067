"""Writing of capture time and camera into a JPEG: EXIF segment of CIPA DC-008 (Exif 2.32)."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

from PIL import ExifTags, Image

from uavgram.io.photos.metadata import APP1, START, Segment, build_jpeg


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
    return build_jpeg([Segment(APP1, exif.tobytes())], jpeg[len(START) :])
