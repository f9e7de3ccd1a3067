"""The EXIF segment, read back by exifread and by OpenCV's decoder."""

from __future__ import annotations

import io
from typing import TypedDict

import cv2
import exifread
import numpy as np
import pytest

from uavgram.io.photos.tagging.exif_capture import with_exif


class Tags(TypedDict):
    """What a photo of the demo says of itself."""

    time_utc_s: float
    zone_h: float
    make: str
    model: str


TAGS: Tags = {
    "time_utc_s": 1778331905.0374,
    "zone_h": -6.0,
    "make": "uavgram",
    "model": "demo camera",
}


@pytest.fixture(scope="module")
def jpeg() -> bytes:
    image = np.random.default_rng(0).integers(0, 255, (30, 40, 3), dtype=np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


def read(data: bytes) -> dict[str, str]:
    return {k: str(v) for k, v in exifread.process_file(io.BytesIO(data), details=False).items()}


def test_time_zone_and_camera_are_read_back(jpeg: bytes) -> None:
    found = read(with_exif(jpeg, **TAGS))
    # 1778331905 = 2026-05-09 13:05:05 UTC
    assert found["EXIF DateTimeOriginal"] == "2026:05:09 07:05:05"
    assert found["EXIF SubSecTimeOriginal"] == "037"
    assert found["EXIF OffsetTimeOriginal"] == "-06:00"
    assert found["Image Make"] == "uavgram"
    assert found["Image Model"] == "demo camera"


@pytest.mark.parametrize(("zone_h", "text"), [(0.0, "+00:00"), (5.5, "+05:30"), (-3.5, "-03:30")])
def test_zones_of_half_hours_keep_their_sign(jpeg: bytes, zone_h: float, text: str) -> None:
    tags: Tags = {"time_utc_s": 1.7783e9, "zone_h": zone_h, "make": "m", "model": "odd"}
    assert read(with_exif(jpeg, **tags))["EXIF OffsetTimeOriginal"] == text


def test_milliseconds_round_into_the_next_second(jpeg: bytes) -> None:
    tags: Tags = {"time_utc_s": 1778331905.9996, "zone_h": 0.0, "make": "m", "model": "n"}
    found = read(with_exif(jpeg, **tags))
    assert found["EXIF DateTimeOriginal"] == "2026:05:09 13:05:06"
    assert found["EXIF SubSecTimeOriginal"] == "000"


def test_the_picture_is_untouched(jpeg: bytes) -> None:
    before, after = (
        cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        for data in (jpeg, with_exif(jpeg, **TAGS))
    )
    assert before is not None
    assert after is not None
    assert np.array_equal(before, after)


def test_what_is_no_jpeg_is_refused() -> None:
    with pytest.raises(ValueError, match="not a JPEG"):
        with_exif(b"\x89PNG", **TAGS)
