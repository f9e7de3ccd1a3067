"""Poses in files that people write: geo.txt of OpenDroneMap, and a CSV."""

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
import tagged_jpeg
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from uavgram.errors import InputError
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.io.photos.pose_sources import read_photo_poses
from uavgram.io.photos.pose_tables import read_geo_txt, read_mrk, read_pose_csv
from uavgram.model.arrays import Floats
from uavgram.model.frames import Photos


class Write(Protocol):
    def __call__(self, text: str, name: str = ...) -> Path: ...


# the example of OpenDroneMap's documentation
EXAMPLE = """EPSG:4326
DJI_0028.JPG -91.9942096111111 46.84252125 198.609
DJI_0032.JPG -91.9938293055556 46.8424584444444 198.609
"""


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str, name: str = "geo.txt") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_the_documented_example_is_read(write: Write) -> None:
    poses, messages = read_geo_txt(write(EXAMPLE), "msl")

    assert poses.frame_id == ("DJI_0028.JPG", "DJI_0032.JPG")
    np.testing.assert_allclose(poses.longitude_deg, [-91.9942096111111, -91.9938293055556])
    np.testing.assert_allclose(poses.latitude_deg, [46.84252125, 46.8424584444444])
    assert (poses.height_m == 198.609).all()
    assert np.isnan(poses.ypr_rad).all()
    assert poses.datum == "msl"
    assert "world.heights" in poses.datum_guess
    assert [m.code for m in messages] == ["geo-without-angles"]


@pytest.mark.parametrize(
    ("header", "epsg", "datum"),
    [
        ("WGS84 UTM 15N", 32615, "msl"),
        ("EPSG:32615", 32615, "msl"),
        ("+proj=utm +zone=15 +datum=WGS84 +units=m +no_defs", 32615, "msl"),
        ("EPSG:4979", 4326, "ellipsoid"),
        ("EPSG:4326+5773", 4326, "msl"),
    ],
)
def test_projections_are_undone_and_tell_the_datum(
    write: Write, header: str, epsg: int, datum: str
) -> None:
    to = Transformer.from_crs(4326, epsg, always_xy=True)
    x, y = to.transform(-91.9942, 46.8425)
    poses, _ = read_geo_txt(write(f"{header}\na.jpg {x!r} {y!r} 7.5\n"), "msl")

    np.testing.assert_allclose(poses.longitude_deg, -91.9942, atol=1e-9)
    np.testing.assert_allclose(poses.latitude_deg, 46.8425, atol=1e-9)
    assert poses.height_m[0] == 7.5
    assert poses.datum == datum


@pytest.mark.parametrize(
    ("nadir", "optical_axis_ned", "image_up_ned"),
    [  # Pix4D's examples of yaw, pitch, roll
        ((0.001, 0, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 90, 0), (1, 0, 0), (0, 0, -1)),
        ((90, 0, 0), (0, 0, 1), (0, 1, 0)),
        ((270, 45, 0), (0, -np.sqrt(0.5), np.sqrt(0.5)), (0, -np.sqrt(0.5), -np.sqrt(0.5))),
    ],
)
def test_angles_are_those_of_a_body_above_a_nadir_camera(
    write: Write,
    nadir: tuple[float, float, float],
    optical_axis_ned: tuple[float, float, float],
    image_up_ned: tuple[float, float, float],
) -> None:
    angles = " ".join(str(a) for a in nadir)
    poses, _ = read_geo_txt(write(f"EPSG:4326\na.jpg 1 2 3 {angles} 0.5 0.7\n"), "msl")
    ned_from_gimbal = Rotation.from_euler("ZYX", poses.ypr_rad[0]).as_matrix()

    np.testing.assert_allclose(ned_from_gimbal[:, 0], optical_axis_ned, atol=1e-4)
    np.testing.assert_allclose(-ned_from_gimbal[:, 2], image_up_ned, atol=1e-4)
    assert poses.sigma_horizontal_m[0] == 0.5
    assert poses.sigma_vertical_m[0] == 0.7


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "needs a coordinate system"),
        ("EPSG:999999\na 1 2 3\n", r"geo\.txt:1: 'EPSG:999999' is no coordinate system"),
        ("EPSG:4326\na.jpg 1 2\n", r"geo\.txt:2: 'a.jpg' has no height"),
        ("EPSG:4326\na.jpg 1 2 3\n# c\n\nb.jpg 1 x 3\n", r"geo\.txt:5: must be a number"),
        ("EPSG:4326\na.jpg 1 2 3\na.jpg 1 2 3\n", r"geo\.txt:3: .* is already in line 2"),
        ("EPSG:4326\na.jpg 1 92 3\n", r"geo\.txt:2: .* is no place"),
        ("EPSG:4326\na.jpg 1 nan 3\n", r"geo\.txt:2: must be a number"),
    ],
)
def test_mistakes_in_a_geo_txt_are_named_with_their_line(
    write: Write, text: str, expected: str
) -> None:
    with pytest.raises(InputError, match=expected):
        read_geo_txt(write(text), "msl")


CSV = "image,latitude_deg,longitude_deg,height_m,yaw_deg,pitch_deg,roll_deg,sigma_attitude_deg\n"


def test_a_csv_has_angles_of_the_optical_axis(write: Write) -> None:
    poses = read_pose_csv(
        write(f"{CSV}a.jpg,1,2,3,90,-90,0,0.5\nb.jpg,1,2,3,,,,\n", "p.csv"), "msl"
    )
    axis = matrix_from_ypr(*poses.ypr_rad[0])

    np.testing.assert_allclose(axis[:, 0], [0, 0, 1], atol=1e-12)  # down
    np.testing.assert_allclose(-axis[:, 2], [0, 1, 0], atol=1e-12)  # image up is east
    assert np.isnan(poses.ypr_rad[1]).all()
    assert poses.sigma_attitude_rad[0] == pytest.approx(np.radians(0.5))


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("a.jpg,1,2,3,90,,0,1", "give all three, or none"),
        ("a.jpg,91,2,3,,,,", "latitude_deg must lie between"),
        ("a.jpg,1,2,,,,,", "height_m is empty"),
        ("a.jpg,1,2,3,0,0,0,0", "sigma_attitude_deg must be greater than 0"),
        ("", "holds no photo"),
    ],
)
def test_mistakes_in_a_csv_are_named(write: Write, row: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        read_pose_csv(write(f"{CSV}{row}\n", "p.csv"), "msl")


def test_rows_follow_the_photos_and_foreign_rows_are_told(write: Write) -> None:
    path = write(EXAMPLE + "other.JPG 1 2 3\n")
    photos = tagged_jpeg.photos([Path("DJI_0032.JPG"), Path("DJI_0040.JPG"), Path("DJI_0028.JPG")])
    poses, messages = read_photo_poses(str(path), photos, "msl")

    assert poses.frame_id == ("DJI_0032.JPG", "DJI_0028.JPG")
    np.testing.assert_allclose(poses.longitude_deg, [-91.9938293055556, -91.9942096111111])
    codes = [m.code for m in messages]
    assert codes == ["geo-without-angles", "height-datum-assumed", "pose-without-photo"]


def test_a_file_about_other_photos_is_refused_with_a_hint(write: Write) -> None:
    photos = tagged_jpeg.photos([Path("DJI_0028.jpeg")])

    with pytest.raises(InputError, match=r"did you mean 'DJI_0028\.jpeg'"):
        read_photo_poses(str(write(EXAMPLE)), photos, "msl")


@pytest.mark.parametrize(
    ("name", "head", "rows"),
    [
        ("geo.txt", "EPSG:4326\n", ("a.jpg {0} {1} 500", "b.jpg {1} {0} 500")),
        ("geo.txt", "EPSG:32632\n", ("a.jpg {2} {3} 500", "b.jpg {3} {2} 500")),
        ("poses.csv", CSV, ("a.jpg,{1},{0},500,,,,", "b.jpg,{0},{1},500,,,,")),
    ],
)
def test_exchanged_places_are_named_where_the_photos_own_tags_show_it(
    write: Write, tmp_path: Path, name: str, head: str, rows: tuple[str, str]
) -> None:
    paths = [tmp_path / f"{one}.jpg" for one in "ab"]
    for path in paths:
        path.write_bytes(tagged_jpeg.placed_jpeg(8.54, 47.31))
    to_map = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    numbers = 8.55, 47.3, *to_map.transform(8.55, 47.3)
    right, wrong = (row.format(*numbers) for row in rows)
    photos = tagged_jpeg.photos(paths)

    poses, _ = read_photo_poses(str(write(f"{head}{right}\n", name)), photos, "msl")
    np.testing.assert_allclose([poses.longitude_deg, poses.latitude_deg], [[8.55], [47.3]])
    with pytest.raises(InputError, match=r":3: .*near it with latitude and longitude .* exchanged"):
        read_photo_poses(str(write(f"{head}{right}\n{wrong}\n", name)), photos, "msl")


# DJI's image log: a real one, joined by the number in the photos' names.


LEAP_S, GPS_EPOCH_S = 18, 315964800


@pytest.fixture
def real(data_dir: Path) -> Path:
    return data_dir / "logs" / "101FTASK_Timestamp.mrk"


def named(
    numbers: Iterable[int], times: Floats | None = None, form: str = "100_0101_{:04d}.JPG"
) -> Photos:
    return tagged_jpeg.photos([Path(form.format(n)) for n in numbers], times)


def utc(tow: float) -> float:
    return GPS_EPOCH_S + 2211 * 604800 + tow - LEAP_S


def test_a_real_log_is_read_to_its_last_digit(real: Path) -> None:
    poses, messages = read_mrk(real, named([2, 3, 177]))

    np.testing.assert_array_equal(poses.latitude_deg, [47.6436873208, 47.6436479170, 47.6433253243])
    np.testing.assert_array_equal(
        poses.longitude_deg, [16.4759271684, 16.4758945272, 16.4760228317]
    )
    np.testing.assert_array_equal(poses.height_m, [512.998, 512.996, 513.090])
    np.testing.assert_allclose(
        poses.time_utc_s, [utc(296288.242869), utc(296289.777625), utc(296784.038838)], atol=1e-6
    )
    assert poses.datum == "ellipsoid"
    assert poses.datum_guess == ""
    assert (poses.sigma_horizontal_m == 0.05).all()  # 14 mm stated, less than is to be believed
    assert (poses.sigma_vertical_m == 0.10).all()
    assert np.isnan(poses.ypr_rad).all()
    assert messages == ()


def test_names_of_later_drones_fit_too(real: Path) -> None:
    photos = named([5], form="DJI_20220525101810_{:04d}_V.JPG")

    assert read_mrk(real, photos)[0].latitude_deg[0] == 47.6435557461


def test_a_missing_photo_shifts_nothing(real: Path) -> None:
    every = read_mrk(real, named(range(2, 100)))[0]
    some = read_mrk(real, named([n for n in range(2, 100) if n % 7]))[0]

    of_all = dict(zip(every.frame_id, every.latitude_deg, strict=True))
    assert [of_all[name] for name in some.frame_id] == some.latitude_deg.tolist()


def test_capture_times_guard_the_join_against_renamed_photos(real: Path) -> None:
    numbers = np.arange(10, 40)
    good = named(numbers)
    when = np.floor(read_mrk(real, good)[0].time_utc_s) + 7200  # a clock two hours ahead, to 1 s

    assert len(read_mrk(real, named(numbers, when))[0].frame_id) == 30
    renamed = when.copy()
    renamed[20:] += 6.0  # one lost, the rest renumbered: four exposures further
    with pytest.raises(InputError, match="off the time that its number has in the log"):
        read_mrk(real, named(numbers, renamed))


@pytest.mark.parametrize(
    ("numbers", "form", "text"),
    [
        ([9000], "100_0101_{:04d}.JPG", "has a position for none"),
        ([3], "photo{}.JPG", "has none at its end"),
        ([3], "{:04d}.JPG", "has none at its end"),
    ],
)
def test_photos_that_do_not_fit_are_refused(
    real: Path, numbers: Iterable[int], form: str, text: str
) -> None:
    with pytest.raises(InputError, match=text):
        read_mrk(real, named(numbers, form=form))


def test_two_folders_in_one_project_are_refused(real: Path) -> None:
    photos = tagged_jpeg.photos([Path("100_0101_0003.JPG"), Path("100_0102_0003.JPG")])

    with pytest.raises(InputError, match="have the same one"):
        read_mrk(real, photos)


def test_malformed_and_doubled_lines_are_named(real: Path, tmp_path: Path) -> None:
    lines = real.read_text().splitlines()
    path = tmp_path / "a.mrk"
    path.write_text("\n".join([lines[0], "x" + lines[1], lines[2]]))
    with pytest.raises(InputError, match=r"a\.mrk:2: is no line"):
        read_mrk(path, named([2]))
    path.write_text("\n".join([lines[0], lines[1], lines[0]]))
    with pytest.raises(InputError, match=r"a\.mrk:3: photo 2 occurs twice"):
        read_mrk(path, named([2]))


def test_loose_solutions_keep_their_sigmas_and_lost_ones_are_left_out(
    real: Path, tmp_path: Path
) -> None:
    lines = real.read_text().splitlines()[:3]
    path = tmp_path / "a.mrk"
    lines[1] = lines[1].replace("50,Q", "16,Q").replace("0.014268, 0.013609, 0.029783", "3, 4, 5")
    lines[2] = lines[2].replace("50,Q", "0,Q")
    path.write_text("\n".join(lines))
    poses, messages = read_mrk(path, named([2, 3, 4]))

    assert len(poses.frame_id) == 2
    assert poses.sigma_horizontal_m[1] == pytest.approx(np.sqrt(12.5))
    assert [m.code for m in messages] == ["mrk-no-position", "mrk-not-fixed"]
