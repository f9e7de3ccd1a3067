"""Tags written into copies of photos."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TypedDict

import cv2
import exifread
import numpy as np
import pytest
import tagged_jpeg

from uavgram.errors import InputError
from uavgram.geometry.motion.camera_motion import nadir_from_gimbal
from uavgram.io.exports.photogrammetry import write_geo_txt, write_pix4d_csv
from uavgram.io.photos.metadata import DJI, parse_jpeg, read_exif_place, read_xmp
from uavgram.io.photos.pose_tables import read_geo_txt
from uavgram.io.photos.pose_tags import read_photo_tags
from uavgram.io.photos.tagging import ExifGps, TiffError, insert_exif, set_gps, write_tagged_photo
from uavgram.model.frames import GeoTags


def make_tags(
    path: Path,
    latitude_deg: float = -33.123456789,
    longitude_deg: float = -179.987654321,
    height_m: float = 98.765,
) -> GeoTags:
    gimbal = np.radians([[200.0, -35.0, 2.0]])
    return GeoTags(
        frame_id=(path.name,),
        path=(str(path),),
        pose=("refined",),
        latitude_deg=np.array([latitude_deg]),
        longitude_deg=np.array([longitude_deg]),
        height_m=np.array([height_m]),
        datum="ellipsoid",
        gimbal_ypr_rad=gimbal,
        nadir_ypr_rad=nadir_from_gimbal(gimbal),
        sigma_horizontal_m=np.array([1.25]),
        sigma_vertical_m=np.array([2.5]),
    )


def real_photo(data_dir: Path) -> Path:
    return data_dir / "narrabeen_mavic" / "snapshotNarrabeen.JPG"


def write_copy(tags: GeoTags, folder: Path) -> Path:
    target = folder / "copy.jpg"
    write_tagged_photo(tags, 0, target)
    return target


def all_exif(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        tags = exifread.process_file(file, details=True)
    return {k: str(v) for k, v in tags.items() if not k.startswith(("GPS", "Image GPSInfo"))}


def test_a_tagged_copy_is_read_back_as_written(data_dir: Path, tmp_path: Path) -> None:
    copy = write_copy(make_tags(real_photo(data_dir)), tmp_path)
    poses, _ = read_photo_tags(tagged_jpeg.photos([copy]))

    assert poses.latitude_deg[0] == pytest.approx(-33.123456789, abs=1e-10)
    assert poses.longitude_deg[0] == pytest.approx(-179.987654321, abs=1e-10)
    assert poses.height_m[0] == pytest.approx(98.765, abs=1e-9)
    np.testing.assert_allclose(np.degrees(poses.ypr_rad) % 360, [[200, 325, 2]], atol=2e-4)
    assert poses.datum == "ellipsoid"
    assert poses.datum_guess == ""
    assert poses.sigma_horizontal_m[0] == 1.25
    assert poses.sigma_vertical_m[0] == 2.5


def test_pixels_and_all_other_tags_stay(data_dir: Path, tmp_path: Path) -> None:
    original = real_photo(data_dir)
    before = original.read_bytes()
    copy = write_copy(make_tags(original), tmp_path)

    assert original.read_bytes() == before
    tagged, untagged = parse_jpeg(copy.read_bytes()), parse_jpeg(before)
    assert tagged is not None
    assert untagged is not None
    assert tagged.scan == untagged.scan
    assert all_exif(copy) == all_exif(original)
    assert len(all_exif(copy)) > 30
    old, new = read_xmp(original), read_xmp(copy)
    changed = {name for (_, name), text in old.items() if new[_, name] != text}
    assert changed == {
        *("AbsoluteAltitude", "GimbalYawDegree", "GimbalPitchDegree", "GimbalRollDegree")
    }
    assert new[DJI, "GimbalYawDegree"] == "-160.00"  # DJI's range
    assert new[DJI, "GimbalPitchDegree"] == "-35.00"


def test_a_photo_without_any_tags_gets_them(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg())
    copy = write_copy(make_tags(path, height_m=-3.5), tmp_path)

    assert read_exif_place(copy).altitude_m == -3.5
    assert not any(namespace == DJI for namespace, _ in read_xmp(copy))
    np.testing.assert_array_equal(cv2.imread(str(copy)), cv2.imread(str(path)))


def test_only_jpegs_can_be_tagged(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes())

    with pytest.raises(InputError, match=r"a\.png: is no JPEG"):
        write_copy(make_tags(path), tmp_path)


@pytest.mark.parametrize("degrees", [0.0, 59.99999999999, -0.999999999999, 179.123456789, -45.5])
def test_degrees_minutes_and_seconds_never_overflow(tmp_path: Path, degrees: float) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg())
    copy = write_copy(make_tags(path, latitude_deg=12.0, longitude_deg=degrees), tmp_path)
    with copy.open("rb") as file:
        parts = exifread.process_file(file)["GPS GPSLongitude"].values

    assert float(parts[1]) < 60
    assert float(parts[2]) < 60
    assert read_exif_place(copy).longitude_deg == pytest.approx(degrees, abs=2e-11)


@pytest.mark.parametrize(
    "block", [b"II", b"XX\x2a\x00\x08\x00\x00\x00", b"II\x2a\x00\xff\xff\x00\x00"]
)
def test_a_broken_exif_block_is_refused(block: bytes) -> None:
    gps = ExifGps(latitude_deg=1, longitude_deg=1, height_m=1, sigma_horizontal_m=1)
    with pytest.raises(TiffError):
        set_gps(block, gps)


def test_writing_again_moves_nothing_that_was_there() -> None:
    gps = ExifGps(latitude_deg=1, longitude_deg=1, height_m=1, sigma_horizontal_m=1)
    south = ExifGps(latitude_deg=-2, longitude_deg=1, height_m=1, sigma_horizontal_m=1)
    first = set_gps(None, gps)
    again = set_gps(first, south)

    assert again[: len(first)][8:] == first[8:]  # all but the pointer to the first directory


def test_damaged_photos_are_read_or_refused_and_never_crash(data_dir: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    whole = real_photo(data_dir).read_bytes()[:60_000]
    refused = 0
    for k in range(120):
        path = tmp_path / "a.jpg"
        damaged = bytearray(whole)
        first, last = ((0, 1500), (47_800, 49_000))[k % 2]  # EXIF, XMP
        for at in rng.integers(first, last, 4):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            poses, _ = read_photo_tags(tagged_jpeg.photos([path]))
            assert abs(poses.latitude_deg[0]) <= 90
            copy = write_copy(make_tags(path), tmp_path)
            again, _ = read_photo_tags(tagged_jpeg.photos([copy]))
            assert again.latitude_deg[0] == pytest.approx(-33.123456789, abs=1e-10)
        except InputError:
            refused += 1
    assert 10 < refused < 110


def test_geo_txt_has_the_documented_order_and_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "geo.txt"
    tags = make_tags(tmp_path / "a.jpg")
    write_geo_txt(tags, path)
    lines = path.read_text().splitlines()
    poses, _ = read_geo_txt(path, "ellipsoid")

    assert lines[0] == "EPSG:4326"
    assert "above the WGS 84 ellipsoid" in lines[1]
    cells = lines[-1].split()
    assert cells[:4] == ["a.jpg", "-179.987654321", "-33.123456789", "98.765"]
    assert cells[-2:] == ["1.250", "2.500"]
    assert float(cells[4]) == pytest.approx(np.degrees(tags.nadir_ypr_rad[0, 0]), abs=1e-3)
    np.testing.assert_allclose(np.degrees(poses.ypr_rad) % 360, [[200, 325, 2]], atol=2e-4)


def test_the_pix4d_table_puts_latitude_first_and_has_nine_columns(tmp_path: Path) -> None:
    path = tmp_path / "pix4d.csv"
    write_pix4d_csv(make_tags(tmp_path / "a.jpg"), path)
    lines = path.read_text().splitlines()

    assert all(line.startswith("#") for line in lines[:-1])  # no header but comments
    cells = lines[-1].split(",")
    assert len(cells) == 9
    assert cells[1:4] == ["-33.123456789", "-179.987654321", "98.765"]


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
    found = read(insert_exif(jpeg, **TAGS))
    # 1778331905 = 2026-05-09 13:05:05 UTC
    assert found["EXIF DateTimeOriginal"] == "2026:05:09 07:05:05"
    assert found["EXIF SubSecTimeOriginal"] == "037"
    assert found["EXIF OffsetTimeOriginal"] == "-06:00"
    assert found["Image Make"] == "uavgram"
    assert found["Image Model"] == "demo camera"


@pytest.mark.parametrize(("zone_h", "text"), [(0.0, "+00:00"), (5.5, "+05:30"), (-3.5, "-03:30")])
def test_zones_of_half_hours_keep_their_sign(jpeg: bytes, zone_h: float, text: str) -> None:
    tags: Tags = {"time_utc_s": 1.7783e9, "zone_h": zone_h, "make": "m", "model": "odd"}
    assert read(insert_exif(jpeg, **tags))["EXIF OffsetTimeOriginal"] == text


def test_milliseconds_round_into_the_next_second(jpeg: bytes) -> None:
    tags: Tags = {"time_utc_s": 1778331905.9996, "zone_h": 0.0, "make": "m", "model": "n"}
    found = read(insert_exif(jpeg, **tags))
    assert found["EXIF DateTimeOriginal"] == "2026:05:09 13:05:06"
    assert found["EXIF SubSecTimeOriginal"] == "000"


def test_the_picture_is_untouched(jpeg: bytes) -> None:
    before, after = (
        cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        for data in (jpeg, insert_exif(jpeg, **TAGS))
    )
    assert before is not None
    assert after is not None
    assert np.array_equal(before, after)


def test_what_is_no_jpeg_is_refused() -> None:
    with pytest.raises(ValueError, match="not a JPEG"):
        insert_exif(b"\x89PNG", **TAGS)
