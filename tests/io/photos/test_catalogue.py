"""Photos: names, sizes and capture times."""

from __future__ import annotations

import datetime as dt
import os
import shutil
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

import cv2
import exifread
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.photos import catalogue as calibration_photos
from uavgram.io.photos.catalogue import (
    CalibrationFiles,
    find_calibration_photos,
    name_format,
    read_grey,
    read_photos,
)
from uavgram.io.photos.metadata import read_all_camera_tags, read_image_size
from uavgram.model.camera import CameraTags
from uavgram.model.options import TimeOptions


class Photo(Protocol):
    def __call__(self, name: str, width: int = ..., height: int = ..., **exif: str) -> Path: ...


FILENAME = TimeOptions(source="filename", filename_format="%Y%m%d%H%M%S%fZ")


@pytest.fixture
def photo(tmp_path: Path) -> Photo:
    """Write a small photo, with EXIF entries if asked for."""

    def write(name: str, width: int = 8, height: int = 6, **exif: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
        if exif:
            data = path.read_bytes()
            path.write_bytes(data[:2] + app1(exif) + data[2:])
        return path

    return write


TAGS = {"original": 0x9003, "subsec": 0x9291, "zone": 0x9011}


def app1(exif: dict[str, str]) -> bytes:
    """An EXIF segment with text entries of the Exif IFD (TIFF 6.0, little-endian)."""
    entries = sorted((TAGS[k], v.encode() + b"\0") for k, v in exif.items())
    offset = 8 + 18 + 2 + 12 * len(entries) + 4
    ifd, heap = len(entries).to_bytes(2, "little"), b""
    for tag, text in entries:
        value = (
            text.ljust(4, b"\0") if len(text) <= 4 else (offset + len(heap)).to_bytes(4, "little")
        )
        ifd += tag.to_bytes(2, "little") + b"\2\0" + len(text).to_bytes(4, "little") + value
        heap += text if len(text) > 4 else b""
    first = b"\1\0" + b"\x69\x87" + b"\4\0" + b"\1\0\0\0" + (26).to_bytes(4, "little") + bytes(4)
    body = b"Exif\0\0" + b"II*\0" + (8).to_bytes(4, "little") + first + ifd + bytes(4) + heap
    return b"\xff\xe1" + (len(body) + 2).to_bytes(2, "big") + body


def utc(
    year: int, month: int, day: int, hour: int, minute: int, second: int, microsecond: int = 0
) -> float:
    moment = dt.datetime(year, month, day, hour, minute, second, microsecond, tzinfo=dt.UTC)
    return moment.timestamp()


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "bmp"])
def test_sizes_are_those_of_the_stored_image(photo: Photo, suffix: str) -> None:
    assert read_image_size(photo(f"a.{suffix}", 37, 21)) == (37, 21)


def test_sizes_of_real_photos_equal_opencvs(data_dir: Path) -> None:
    for path in sorted(data_dir.glob("*/*.[jJ][pP][gG]")):
        flags = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
        decoded = cv2.imread(str(path), flags)
        assert decoded is not None, path
        height, width = decoded.shape[:2]
        assert read_image_size(path) == (width, height), path


@pytest.mark.parametrize("content", [b"", b"hello", b"\xff\xd8\xff\xe0\x00", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_photo_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(content)
    with pytest.raises(InputError, match="no photo") as caught:
        read_image_size(path)
    assert caught.value.path == str(path)


@pytest.mark.parametrize("folder", ["Faelle", "Fälle"])
def test_an_empty_photo_is_none_in_any_folder(folder: str, tmp_path: Path) -> None:
    path = tmp_path / folder / "DJI_0001.JPG"
    path.parent.mkdir()
    path.touch()
    with pytest.raises(InputError, match="no photo that can be read: take it out of the folder"):
        read_image_size(path)


def test_file_name_times_have_hundredths_in_cuav(data_dir: Path) -> None:
    photos, messages = read_photos((str(data_dir / "cuav" / "photos" / "*.jpg"),), FILENAME)
    assert photos.frame_id[0] == "2018080501005009Z.jpg"
    assert photos.file_time_s[0] == pytest.approx(utc(2018, 8, 5, 1, 0, 50, 90000), abs=1e-6)
    assert photos.file_time_resolution_s == pytest.approx(0.01)
    assert photos.time_source == "filename"
    assert (photos.width_px == 1640).all()
    assert messages == ()


def test_exif_times_have_milliseconds_in_the_twins(data_dir: Path) -> None:
    pattern = str(data_dir / "wind_oblique" / "photos" / "*.jpg")
    photos, messages = read_photos((pattern,), TimeOptions())
    assert photos.time_source == "exif"
    assert photos.file_time_s[0] == pytest.approx(utc(2026, 11, 21, 9, 29, 17, 864000), abs=1e-6)
    assert photos.file_time_resolution_s == pytest.approx(0.001)
    assert messages == ()


def test_a_stated_zone_is_taken_off_and_a_missing_one_is_said(photo: Photo, tmp_path: Path) -> None:
    photo("a.jpg", original="2024:05:06 12:00:00", subsec="25", zone="+02:00")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), TimeOptions(source="exif"))
    assert photos.file_time_s[0] == pytest.approx(utc(2024, 5, 6, 10, 0, 0, 250000), abs=1e-6)
    assert photos.file_time_resolution_s[0] == pytest.approx(0.01)
    assert messages == ()
    photo("a.jpg", original="2024:05:06 12:00:00")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), TimeOptions(source="exif"))
    assert photos.file_time_s[0] == utc(2024, 5, 6, 12, 0, 0)
    assert photos.file_time_resolution_s[0] == 1.0
    assert [m.code for m in messages] == ["photo-zone-unknown"]


def test_the_exif_segment_of_these_tests_is_one(photo: Photo) -> None:
    path = photo("a.jpg", original="2024:05:06 12:00:00", subsec="25")
    with path.open("rb") as file:
        tags = exifread.process_file(file, details=False)
    assert str(tags["EXIF SubSecTimeOriginal"]) == "25"


def test_auto_takes_exif_where_most_photos_have_it_and_names_one_that_has_not(
    photo: Photo, tmp_path: Path
) -> None:
    photo("a.jpg", original="2024:05:06 12:00:00")
    photo("b.jpg")
    photo("c.jpg", original="2024:05:06 12:00:02")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), TimeOptions())
    assert photos.time_source == "exif"
    assert np.isnan(photos.file_time_s).tolist() == [False, True, False]
    assert messages[0].code == "photo-without-time"
    assert "1 of 3" in messages[0].text
    assert "b.jpg" in messages[0].text


@pytest.mark.parametrize(
    "name", [b"IMG_\xff3.jpg", b"IMG\n3.jpg", b"IMG\x1b[3.jpg", "IMG\u202e3.jpg".encode()]
)
def test_a_name_that_cannot_be_written_is_refused_in_words_that_can(
    photo: Photo, tmp_path: Path, name: bytes
) -> None:
    photo("a.jpg").rename(os.fsdecode(os.fsencode(tmp_path) + b"/" + name))
    with pytest.raises(InputError, match=r"IMG.*3\.jpg: the photo's name .*rename it") as caught:
        read_photos((str(tmp_path / "*.jpg"),), TimeOptions())
    assert str(caught.value).isprintable()
    assert str(caught.value).encode()


def test_auto_leaves_exif_alone_where_few_photos_have_it(photo: Photo, tmp_path: Path) -> None:
    photo("a.jpg", original="2024:05:06 12:00:00")
    photo("b.jpg")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), TimeOptions())
    assert photos.time_source == "none"
    assert np.isnan(photos.file_time_s).all()
    assert [m.code for m in messages] == ["photo-times-ignored"]


def test_exif_asked_for_but_nowhere_stated_is_an_error(photo: Photo, tmp_path: Path) -> None:
    path = photo("a.jpg")
    with pytest.raises(InputError, match=r"no capture time.*time\.source") as caught:
        read_photos((str(tmp_path / "*.jpg"),), TimeOptions(source="exif"))
    assert caught.value.path == str(path)


def test_a_clock_that_was_never_set_states_no_time(photo: Photo, tmp_path: Path) -> None:
    photo("a.jpg", original="2024:05:06 12:00:00")
    photo("b.jpg", original="0000:00:00 00:00:00")
    options = TimeOptions(source="exif")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), options)
    assert np.isnan(photos.file_time_s).tolist() == [False, True]
    assert messages[0].code == "photo-without-time"
    assert "b.jpg" in messages[0].text


def test_a_pattern_that_fits_no_name_is_an_error(photo: Photo, tmp_path: Path) -> None:
    path = photo("IMG_1.jpg")
    with pytest.raises(InputError, match=r"'IMG_1'.*filename_format.*auto") as caught:
        read_photos((str(tmp_path / "*.jpg"),), FILENAME)
    assert caught.value.path == str(path)


def test_a_name_that_does_not_fit_the_pattern_states_no_time(photo: Photo, tmp_path: Path) -> None:
    photo("2018080501005009Z.jpg")
    photo("Kopie von 2018080501005009Z.jpg")
    photos, messages = read_photos((str(tmp_path / "*.jpg"),), FILENAME)
    assert photos.time_source == "filename"
    assert np.isnan(photos.file_time_s).tolist() == [False, True]
    assert [m.code for m in messages] == ["photo-without-time"]
    assert "1 of 2" in messages[0].text
    assert "Kopie von" in messages[0].text


def test_two_photos_of_one_name_are_refused(photo: Photo, tmp_path: Path) -> None:
    photo("one/a.jpg")
    photo("two/a.jpg")
    photo("one/b.jpg")
    photo("two/b.jpg")
    with pytest.raises(InputError, match=r"has the name of .*one.a.jpg, and 1 more photos"):
        read_photos((str(tmp_path / "*" / "*.jpg"),), TimeOptions())


def test_one_photo_in_two_patterns_counts_once(photo: Photo, tmp_path: Path) -> None:
    photo("b.jpg")
    photo("a.jpg")
    patterns = (str(tmp_path / "*.jpg"), str(tmp_path / "a.jpg"))
    photos, _ = read_photos(patterns, TimeOptions())
    assert photos.frame_id == ("a.jpg", "b.jpg")


def test_a_pattern_without_files_is_named(tmp_path: Path) -> None:
    pattern = str(tmp_path / "*.jpg")
    with pytest.raises(InputError, match="matches no file") as caught:
        read_photos((pattern,), TimeOptions())
    assert caught.value.path == pattern
    assert "if the photos were moved or renamed, put them back" in str(caught.value)


@pytest.mark.parametrize(
    ("stems", "form"),
    [
        (["20180805_010050", "20180805_010051"], "%Y%m%d_%H%M%S"),
        (["2018080501005009Z", "2018080501005094Z"], "%Y%m%d%H%M%S%fZ"),
        (["IMG_2024-03-01T12-30-05", "IMG_2024-03-01T12-30-06"], "IMG_%Y-%m-%dT%H-%M-%S"),
        (["100% 20240301_123005.25", "100% 20240301_123005.75"], "100%% %Y%m%d_%H%M%S.%f"),
    ],
)
def test_the_form_of_a_time_is_found(stems: list[str], form: str) -> None:
    assert name_format(stems) == form
    datetime.strptime(stems[0], form)  # noqa: DTZ007


@pytest.mark.parametrize(
    "stems",
    [
        [],
        ["IMG_0041", "IMG_0042"],
        ["DJI_20240301123005_0001", "DJI_20240301123007_0002"],  # a counter, too: no one form
        ["20240301_123005", "other"],
        ["20240301_123005_a", "20240301_123005_a"],  # the same moment
        ["20241301_123005", "20241301_123006"],  # no thirteenth month
        ["2024030112", "2024030113"],
    ],
)
def test_what_is_no_time_of_one_form_is_none(stems: list[str]) -> None:
    assert name_format(stems) is None


# Photos of a calibration board as files: one clear message for each that does not belong.


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four small photos, all different."""
    for k in range(4):
        photo = np.full((48, 64), 40 * k, np.uint8)
        photo[5, 7] = 255
        assert cv2.imwrite(str(tmp_path / f"{k}.png"), photo)
    return tmp_path


def find(folder: Path) -> CalibrationFiles:
    return find_calibration_photos([str(folder / "*.png")])


def test_photos_are_found_once_in_the_order_of_their_names(folder: Path) -> None:
    files = find_calibration_photos([str(folder / "2.png"), str(folder / "*.png")])
    assert [path[-5:] for path in files.path] == ["0.png", "1.png", "2.png", "3.png"]
    assert (files.width_px, files.height_px) == (64, 48)
    assert [digest.path for digest in files.digest] == list(files.path)
    assert files.setting[0].camera == ""
    assert files.setting[0].focal_length_mm is None


def test_grey_values_are_those_of_the_file(folder: Path) -> None:
    grey = read_grey(folder / "1.png")
    assert grey.shape == (48, 64)
    assert grey[5, 7] == 255
    assert grey[0, 0] == 40


@pytest.mark.parametrize("content", [b"", b"no photo", b"\xff\xd8\xff\xe0 cut"])
def test_what_is_no_photo_is_named(folder: Path, content: bytes) -> None:
    (folder / "1.png").write_bytes(content)
    with pytest.raises(InputError, match="no photo") as caught:
        read_grey(folder / "1.png")
    assert caught.value.path.endswith("1.png")
    with pytest.raises(InputError, match="no photo"):
        find(folder)


def test_a_missing_photo_is_named(folder: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_grey(folder / "9.png")
    with pytest.raises(InputError, match="matches no file"):
        find_calibration_photos([str(folder / "*.jpg")])


def test_one_photo_is_too_few(folder: Path) -> None:
    with pytest.raises(InputError, match="1 of the 3 photos"):
        find_calibration_photos([str(folder / "1.png")])


def test_a_copy_is_named_with_its_original(folder: Path) -> None:
    shutil.copy(folder / "1.png", folder / "5.png")
    with pytest.raises(InputError, match=r"copy of .*1\.png") as caught:
        find(folder)
    assert caught.value.path.endswith("5.png")


def test_mixed_sizes_are_refused(folder: Path) -> None:
    cv2.imwrite(str(folder / "4.png"), np.zeros((64, 48), np.uint8))
    with pytest.raises(InputError, match="48 x 64 pixels") as caught:
        find(folder)
    assert caught.value.path.endswith("4.png")


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("model", "FC220", "another camera"),
        ("serial", "B2", "serial number"),
        ("focal_mm", 4.7, "focal length of 4.7 mm"),
    ],
)
def test_two_cameras_or_zooms_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, field: str, value: str | float, words: str
) -> None:
    from dataclasses import replace

    other: dict[str, Any] = {field: value}

    def tagged(paths: Iterable[str]) -> tuple[CameraTags, ...]:
        tags = [
            replace(tag, make="DJI", model="FC300X", serial="A1", focal_mm=3.61)
            for tag in read_all_camera_tags(paths)
        ]
        return (*tags[:2], replace(tags[2], **other), tags[3])

    monkeypatch.setattr(calibration_photos, "read_all_camera_tags", tagged)
    with pytest.raises(InputError, match=words) as caught:
        find(folder)
    assert caught.value.path.endswith("2.png")


def test_a_drones_photos_tell_camera_and_lens(data_dir: Path) -> None:
    files = find_calibration_photos([str(data_dir / "phantom3_lenscalib" / "*.jpg")])
    assert len(files.path) == 6
    assert (files.width_px, files.height_px) == (4000, 2250)
    assert files.setting[0].camera == "DJI FC300X"
    assert files.setting[0].focal_length_mm == pytest.approx(3.61)
    assert files.setting[0].focal_length_35mm == 20
