"""EXIF of damaged photos: read, or one clear message."""

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.exif_tags import read_exif_tags
from uavgram.io.photos import read_photos
from uavgram.model.options import TimeOptions


def test_tags_are_read_by_their_names(data_dir):
    tags = read_exif_tags(data_dir / "wind_oblique" / "photos" / "IMG_0025.jpg")

    assert str(tags["EXIF DateTimeOriginal"]) == "2026:11:21 09:29:17"
    assert str(tags["EXIF SubSecTimeOriginal"]) == "864"


def test_damaged_exif_is_read_or_refused_by_name(data_dir, tmp_path):
    whole = (data_dir / "brighton_beach" / "DJI_0025.JPG").read_bytes()[:40_000]
    rng = np.random.default_rng(0)
    refused = []
    for _ in range(300):
        damaged = bytearray(whole)
        for place in rng.integers(12, 4_000, 30):
            damaged[place] = rng.integers(256)
        path = tmp_path / "photo.jpg"
        path.write_bytes(damaged)
        try:
            read_exif_tags(path)
        except InputError as error:
            refused.append(str(error))

    assert refused
    assert all("photo.jpg: its EXIF is broken" in text for text in refused)


def test_a_photo_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.jpg: cannot be read"):
        read_exif_tags(tmp_path / "gone.jpg")
    with pytest.raises(InputError, match="gone"):
        read_photos((str(tmp_path / "gone.jpg"),), TimeOptions())
