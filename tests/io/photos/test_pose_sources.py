"""Several sources of poses: each quantity from the one that knows it best, and it is said."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tagged_jpeg

from uavgram.errors import InputError
from uavgram.io.photos.pose_sources import read_pose_sources
from uavgram.model.frames import Photos

Tags = dict[str, str]
Project = tuple[Callable[..., Photos], str]
"""What makes photos with the DJI tags of each, and the image log's path."""

NAMES = ("MAX_0002.JPG", "MAX_0003.JPG", "MAX_0004.JPG")
GIMBAL = {"GimbalYawDegree": "30", "GimbalPitchDegree": "-80", "GimbalRollDegree": "0"}
PLACE = {
    "GpsLatitude": "47.6",
    "GpsLongitude": "16.4",
    "AbsoluteAltitude": "460",
    "RelativeAltitude": "50",
}


@pytest.fixture
def project(tmp_path: Path, data_dir: Path) -> Project:
    """Photos of an image log; which tags they carry, by photo."""

    def make(*tags: Tags) -> Photos:
        for name, own in zip(NAMES, tags, strict=True):
            xmp = tagged_jpeg.dji(**own) if own else None
            (tmp_path / name).write_bytes(tagged_jpeg.jpeg(xmp))
        return tagged_jpeg.photos([tmp_path / name for name in NAMES])

    mrk = data_dir / "helenenschacht" / "101FTASK_Timestamp.mrk"
    return make, str(mrk)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_centimetre_places_and_the_gimbals_angles_are_one_pose(
    project: Project, order: tuple[int, int]
) -> None:
    make, mrk = project
    photos = make(GIMBAL | PLACE, GIMBAL, {})
    sources = [(mrk, "exif")[k] for k in order]
    poses, messages = read_pose_sources(sources, photos, "msl")

    assert poses.frame_id == NAMES
    np.testing.assert_allclose(poses.height_m, [512.998, 512.996, 513.025])
    np.testing.assert_allclose(poses.sigma_horizontal_m, 0.05)
    np.testing.assert_allclose(np.degrees(poses.ypr_rad[:2]), [[30, -80, 0]] * 2)
    assert np.isnan(poses.ypr_rad[2]).all()
    np.testing.assert_allclose(poses.height_home_m, [50, np.nan, np.nan])
    assert np.isfinite(poses.time_utc_s).all()
    assert poses.datum == "ellipsoid"
    said = {m.code: m.text for m in messages}
    assert said["pose-sources"] == (
        "Positions of the photos come from 101FTASK_Timestamp.mrk (3 photos); attitudes from the "
        "photos' tags (DJI XMP) (2 photos); 1 of 3 photos have no stated attitude."
    )
    assert "height-datum-assumed" not in said  # heights of the tags are not used


def test_the_smaller_sigma_wins_whatever_comes_first(project: Project, tmp_path: Path) -> None:
    make, mrk = project
    photos = make(GIMBAL, GIMBAL, GIMBAL)
    table = tmp_path / "angles.csv"
    table.write_text(
        "image,yaw_deg,pitch_deg,roll_deg,sigma_attitude_deg\n"
        f"{NAMES[0]},10,-90,0,0.5\n{NAMES[1]},11,-90,0,\n"
    )
    poses, messages = read_pose_sources([mrk, "exif", str(table)], photos, "ellipsoid")

    # stated before assumed; of two that state none, the one named first
    np.testing.assert_allclose(np.degrees(poses.ypr_rad[:, 0]), [10, 30, 30])
    np.testing.assert_allclose(np.degrees(poses.sigma_attitude_rad), [0.5, np.nan, np.nan])
    assert "angles.csv (1 photos)" in messages[-1].text


def test_heights_above_different_datums_are_not_mixed(project: Project, tmp_path: Path) -> None:
    make, mrk = project
    photos = make({}, {}, {})
    short = tmp_path / "two.mrk"
    short.write_text("".join(Path(mrk).read_text().splitlines(keepends=True)[:2]))
    table = tmp_path / "places.csv"
    table.write_text(f"image,latitude_deg,longitude_deg,height_m\n{NAMES[2]},47.6,16.4,460\n")
    poses, messages = read_pose_sources([str(short), str(table)], photos, "msl")

    assert poses.frame_id == NAMES[:2]
    text = next(m.text for m in messages if m.code == "pose-datum-differs")
    assert text.startswith("1 photos (MAX_0004.JPG) were left out: only places.csv has their place")
    both, _ = read_pose_sources([str(short), str(table)], photos, "ellipsoid")
    assert both.frame_id == NAMES


def test_tags_that_state_nothing_are_said_and_do_no_harm(project: Project) -> None:
    make, mrk = project
    poses, messages = read_pose_sources([mrk, "exif"], make({}, {}, {}), "msl")

    assert len(poses.frame_id) == 3
    assert [m.code for m in messages] == ["no-pose-tags", "pose-sources"]


def test_angles_alone_place_nothing(project: Project, tmp_path: Path) -> None:
    make, _ = project
    photos = make(GIMBAL, GIMBAL, GIMBAL)
    table = tmp_path / "angles.csv"
    table.write_text(f"image,yaw_deg,pitch_deg,roll_deg\n{NAMES[0]},10,-90,0\n")

    with pytest.raises(InputError, match="has a photo's place"):
        read_pose_sources([str(table), "exif"], photos, "msl")
    table.write_text(f"image,latitude_deg,yaw_deg,pitch_deg,roll_deg\n{NAMES[0]},1,10,-90,0\n")
    with pytest.raises(InputError, match="latitude_deg, longitude_deg and height_m: give all"):
        read_pose_sources([str(table), "exif"], photos, "msl")
