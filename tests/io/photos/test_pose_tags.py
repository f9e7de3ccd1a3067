"""Poses from the tags of photos: real DJI photos, and every form that DJI's tags take."""

import tracemalloc
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
import tagged_jpeg
from scipy.spatial.transform import Rotation

from uavgram.errors import InputError
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.imaging.photos.decoding import Segment
from uavgram.io.photos.metadata import APP1, EXIF_HEAD, build_jpeg, parse_jpeg
from uavgram.io.photos.pose_tags import TagPose, _remove_zero_angles, first_maker, read_photo_tags
from uavgram.io.photos.tagging import ExifGps, set_gps
from uavgram.model.frames import PhotoPoses
from uavgram.model.message import Message

Poses = tuple[PhotoPoses, tuple[Message, ...]]


class Read(Protocol):
    def __call__(self, *rows: dict[str, str] | None) -> Poses: ...


PLACE = {"GpsLatitude": "46.5", "GpsLongitude": "-91.9", "AbsoluteAltitude": "+200.5"}


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Read photos with the given DJI tags."""

    def read(*rows: dict[str, str] | None) -> Poses:
        paths = []
        for k, tags in enumerate(rows):
            paths.append(tmp_path / f"DJI_{k:04d}.JPG")
            paths[-1].write_bytes(
                tagged_jpeg.jpeg(None if tags is None else tagged_jpeg.dji(**tags))
            )
        return read_photo_tags(tagged_jpeg.photos(paths))

    return read


def test_a_real_mavic_photo(data_dir: Path) -> None:
    path = data_dir / "narrabeen_mavic" / "snapshotNarrabeen.JPG"
    poses, messages = read_photo_tags(tagged_jpeg.photos([path]))

    # the tags as any hex viewer shows them; EXIF place 33 43 47.6473 S, 151 18 2.069 E
    assert poses.latitude_deg[0] == pytest.approx(-(33 + 43 / 60 + 47.6473 / 3600), abs=1e-10)
    assert poses.longitude_deg[0] == pytest.approx(151 + 18 / 60 + 2.069 / 3600, abs=1e-10)
    assert poses.height_m[0] == 98.03
    assert poses.height_home_m[0] == 100.40
    np.testing.assert_allclose(np.degrees(poses.ypr_rad), [[9.5, -16.6, 0.0]])
    np.testing.assert_allclose(np.degrees(poses.vehicle_ypr_rad), [[9.4, -4.2, 2.8]])
    assert poses.datum == "msl"
    assert "tens of metres" in poses.datum_guess
    assert np.isnan(poses.sigma_horizontal_m).all()
    assert messages == ()


def test_a_photo_without_a_fix_has_no_place(data_dir: Path) -> None:
    path = data_dir / "phantom3_lenscalib" / "DJI_0002.jpg"

    with pytest.raises(InputError, match="has no place in EXIF or XMP"):
        read_photo_tags(tagged_jpeg.photos([path]))


def test_the_misspelt_longitude_of_old_firmware_is_read(read: Read) -> None:
    tags = {("GpsLongtitude" if k == "GpsLongitude" else k): v for k, v in PLACE.items()}
    poses, _ = read(tags)

    assert poses.longitude_deg[0] == -91.9


def test_rtk_gives_sigmas_with_a_floor_and_ellipsoidal_heights(read: Read) -> None:
    rtk = {"RtkFlag": "50", "RtkStdLat": "0.3", "RtkStdLon": "0.4", "RtkStdHgt": "0.02"}
    poses, _ = read(PLACE | rtk)

    assert poses.datum == "ellipsoid"
    assert poses.sigma_horizontal_m[0] == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 2))
    assert poses.sigma_vertical_m[0] == 0.10


def test_photos_with_two_height_datums_are_refused(read: Read) -> None:
    with pytest.raises(InputError, match=r"DJI_0001.JPG.*above ellipsoid.*was RTK lost"):
        read(PLACE, PLACE | {"RtkFlag": "50"})


@pytest.mark.parametrize("roll", ["+180.00", "-180.00"])
def test_the_roll_180_form_of_nadir_is_yaw_turned_by_180(read: Read, roll: str) -> None:
    gimbal = {"GimbalYawDegree": "+30.00", "GimbalPitchDegree": "-90.00"}
    poses, messages = read(PLACE | gimbal | {"GimbalRollDegree": roll})

    # orthority issue 36: "treating the +180 as an optical-axis rotation (roll 0, yaw + 180) fixes
    # it"; the camera looks down, its image up is turned by half a turn
    stated = matrix_from_ypr(*poses.ypr_rad[0])
    expected = Rotation.from_euler("ZYX", [210.0, -90.0, 0.0], degrees=True).as_matrix()
    np.testing.assert_allclose(stated, expected, atol=1e-12)
    assert stated[2, 0] == pytest.approx(1.0)  # the optical axis points down
    assert [m.code for m in messages] == ["gimbal-roll-180"]


def test_a_camera_upside_down_elsewhere_is_told(read: Read) -> None:
    gimbal = {"GimbalYawDegree": "0", "GimbalPitchDegree": "-10", "GimbalRollDegree": "180"}

    assert [m.code for m in read(PLACE | gimbal)[1]] == ["gimbal-upside-down"]


def test_photos_without_place_are_left_out_and_others_stay(read: Read) -> None:
    poses, _ = read(PLACE, None, {"GimbalYawDegree": "1"}, PLACE)

    assert poses.frame_id == ("DJI_0000.JPG", "DJI_0003.JPG")


ZEROS = {f"Gimbal{angle}Degree": "+0.00" for angle in ("Yaw", "Pitch", "Roll")}


def test_gimbal_angles_of_zero_in_all_photos_are_not_filled_in(read: Read) -> None:
    """As in photos of a Mini 2 (dji-sdk/Mobile-SDK-Android, issue 1233)."""
    flight = {"FlightYawDegree": "+179.90", "FlightPitchDegree": "-1.60", "FlightRollDegree": "0.6"}
    poses, messages = read(PLACE | ZEROS | flight, PLACE | ZEROS | flight)

    assert np.isnan(poses.ypr_rad).all()
    np.testing.assert_allclose(np.degrees(poses.vehicle_ypr_rad[:, 0]), 179.9)
    assert [m.code for m in messages] == ["gimbal-not-filled"]


NORTH = {"GpsLatitude": "46.5005"}  # 56 m farther
DOWN = ZEROS | {"GimbalPitchDegree": "-90.00"}
AHEAD = ZEROS | {"GimbalPitchDegree": "-1.10"}


def test_gimbal_angles_of_zero_in_one_photo_are_not_filled_in_where_the_others_look_down(
    read: Read,
) -> None:
    poses, messages = read(PLACE | DOWN, PLACE | NORTH | ZEROS, PLACE | DOWN)

    np.testing.assert_allclose(np.degrees(poses.ypr_rad[:, 1]), [-90.0, np.nan, -90.0])
    assert [m.code for m in messages] == ["gimbal-not-filled"]
    assert messages[0].frames == ("DJI_0001.JPG",)


def test_memory_grows_with_the_number_of_photos_only() -> None:
    """20,000 photos, half of them with zeros: all distances at once took gigabytes."""
    angles = (0.0, 0.0, 0.0), (0.0, -90.0, 0.0)
    poses = [
        TagPose(
            latitude_deg=46.5 + k * 1e-4, longitude_deg=8.0, height_m=9.0, ypr_deg=angles[k % 2]
        )
        for k in range(20_000)
    ]
    tracemalloc.start()
    kept, messages = _remove_zero_angles(tuple(f"{k}.jpg" for k in range(20_000)), poses)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert [m.code for m in messages] == ["gimbal-not-filled"]
    assert np.isnan(kept[0].ypr_deg).all()
    assert kept[1].ypr_deg == angles[1]
    assert peak_bytes < 100e6


@pytest.mark.parametrize(("others", "whose"), [(0, "DJI_0000.JPG"), (2, "3 photos (the first is")])
def test_one_photo_and_several_are_both_reported_in_proper_words(
    read: Read, others: int, whose: str
) -> None:
    tags = PLACE | ZEROS | {"GimbalPitchDegree": "-10", "GimbalRollDegree": "180"}
    (message,) = read(tags, *[tags] * others)[1]

    assert message.text.startswith(f"The tags of {whose}")


@pytest.mark.parametrize("others", [NORTH | AHEAD, DOWN])
def test_a_camera_that_may_be_level_and_to_the_north_is_believed_with_a_note(
    read: Read, others: dict[str, str]
) -> None:
    """Where the others look to the horizon, or were taken from the same place."""
    poses, messages = read(PLACE | ZEROS, PLACE | others, {**PLACE, **others, "GpsLatitude": "46"})

    np.testing.assert_array_equal(poses.ypr_rad[0], [0.0, 0.0, 0.0])
    assert [m.code for m in messages] == ["gimbal-zero"]
    assert messages[0].frames == ("DJI_0000.JPG",)


@pytest.mark.parametrize(
    ("altitudes", "odd"),
    [
        ((198.5, 0.0, 198.6), (1,)),
        ((0.0, 0.0), (0, 1)),
        ((198.5, -198.4, 205.0), (1,)),
        ((-198.5, -198.4), (0, 1)),
        ((-12.0, -14.0), ()),  # a barometer at the sea
        ((45.0, -35.0, 60.0), ()),  # lower, and by so much
    ],
)
def test_altitudes_of_zero_or_of_the_wrong_sign_are_named_and_not_used(
    read: Read, altitudes: tuple[float, ...], odd: tuple[int, ...]
) -> None:
    poses, messages = read(*(PLACE | {"AbsoluteAltitude": f"{h:+}"} for h in altitudes))
    names = tuple(f"DJI_{k:04d}.JPG" for k in odd)

    assert len(poses.frame_id) == len(altitudes)
    expected = [np.nan if k in odd else h for k, h in enumerate(altitudes)]
    np.testing.assert_array_equal(poses.height_m, expected)
    assert [m.code for m in messages] == ["odd-altitude"] * bool(odd)
    for message in messages:
        assert message.frames == names
        assert names[0].removesuffix(".JPG") in message.text
        assert f"{altitudes[odd[0]]:.1f} m" in message.text


@pytest.mark.parametrize(
    ("heights", "odd"),
    [
        ((40.0, 0.0, 41.0), (1,)),
        ((0.0, 0.0), (0, 1)),
        ((40.0, -40.2, 41.0), (1,)),
        ((-40.0, -41.0), (0, 1)),
        ((-3.0, 45.0, 12.0), ()),  # into a valley
    ],
)
def test_heights_above_take_off_of_zero_or_of_the_wrong_sign_are_not_used(
    read: Read, heights: tuple[float, ...], odd: tuple[int, ...]
) -> None:
    poses, messages = read(*(PLACE | {"RelativeAltitude": f"{h:+}"} for h in heights))

    expected = [np.nan if k in odd else h for k, h in enumerate(heights)]
    np.testing.assert_array_equal(poses.height_home_m, expected)
    assert np.isfinite(poses.height_m).all()
    assert [m.code for m in messages] == ["odd-altitude"] * bool(odd)
    for message in messages:
        assert "the height above take-off that the tags state" in message.text
        assert f"{heights[odd[0]]:.1f} m" in message.text


@pytest.mark.parametrize(
    ("own", "exif", "used", "wrong"),
    [
        ("+0.00", 198.5, 198.5, "XMP"),
        ("-198.50", 198.5, 198.5, "XMP"),
        ("+198.50", 0.0, 198.5, "EXIF"),
        ("+198.50", -198.5, 198.5, "EXIF"),
        ("+198.50", 201.0, 198.5, ""),
    ],
)
def test_of_two_altitudes_the_one_that_can_be_right_is_used_and_the_other_is_named(
    tmp_path: Path, own: str, exif: float, used: float, wrong: str
) -> None:
    gps = ExifGps(latitude_deg=46.8, longitude_deg=-91.9, height_m=exif, sigma_horizontal_m=2.0)
    plain = parse_jpeg(tagged_jpeg.jpeg(tagged_jpeg.dji(**PLACE | {"AbsoluteAltitude": own})))
    assert plain is not None
    path = tmp_path / "DJI_0000.JPG"
    tags = Segment(APP1, EXIF_HEAD + set_gps(None, gps))
    path.write_bytes(build_jpeg([tags, *plain.segments], plain.scan))
    poses, messages = read_photo_tags(tagged_jpeg.photos([path]))

    assert poses.height_m.tolist() == [used]
    assert [(m.code, m.level) for m in messages] == [("odd-altitude", "info")] * bool(wrong)
    for message in messages:
        assert message.frames == ("DJI_0000.JPG",)
        assert f"the altitude in {'EXIF' if wrong == 'EXIF' else 'the maker'}" in message.text


def test_vehicle_angles_of_zero_in_all_photos_are_not_filled_in(read: Read) -> None:
    none = {f"Flight{angle}Degree": "+0.00" for angle in ("Yaw", "Pitch", "Roll")}

    assert np.isnan(read(PLACE | none, PLACE | none)[0].vehicle_ypr_rad).all()


def test_a_place_without_altitude_is_named_and_takes_part(read: Read) -> None:
    low = {key: value for key, value in PLACE.items() if key != "AbsoluteAltitude"}
    poses, messages = read(PLACE, low)

    np.testing.assert_array_equal(poses.height_m, [200.5, np.nan])
    assert [m.code for m in messages] == ["odd-altitude"]
    assert "DJI_0001 cannot" in messages[0].text
    assert "(none)" in messages[0].text


def test_ellipsoidal_heights_may_be_below_zero(read: Read) -> None:
    """The geoid is 106 m below the ellipsoid south of India."""
    rtk = {"RtkFlag": "50", "AbsoluteAltitude": "-71.0"}

    assert read(PLACE | rtk)[0].height_m.tolist() == [-71.0]


def test_numbers_that_are_none_count_as_absent(read: Read) -> None:
    poses, _ = read(PLACE | {"RelativeAltitude": "nan", "GimbalYawDegree": "1e999"})

    assert np.isnan(poses.height_home_m[0])
    assert np.isnan(poses.ypr_rad).all()


def test_the_hint_names_the_maker_only_where_there_is_an_attitude(
    data_dir: Path, tmp_path: Path
) -> None:
    plain = tmp_path / "a.jpg"
    plain.write_bytes(tagged_jpeg.jpeg())

    assert first_maker(tagged_jpeg.photos([plain])) == ""
    real = data_dir / "brighton_beach" / "DJI_0025.JPG"
    assert first_maker(tagged_jpeg.photos([real])) == "DJI XMP"
