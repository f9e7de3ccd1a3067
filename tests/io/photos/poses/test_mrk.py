"""DJI's image log: a real one, joined by the number in the photos' names."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import tagged_jpeg

from uavgram.errors import InputError
from uavgram.io.photos.poses.pose_tables import read_mrk
from uavgram.model.arrays import Floats
from uavgram.model.flight.frames import Photos

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
