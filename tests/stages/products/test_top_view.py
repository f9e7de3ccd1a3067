"""Which photos make a top view, and the raster that it fills."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from top_views import BROWN, SIZE_PX, UTM, cv_project, looking, make_view

from uavgram.errors import GeometryError
from uavgram.geometry.ground.top_view import MAX_OFF_NADIR, View
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable
from uavgram.stages.products.top_view import (
    boxes,
    choose_view,
    lay_raster,
    photo_pixels_m,
    reductions,
)


@pytest.fixture(scope="module")
def three() -> View:
    centers = [[-10.0, 0, 40.0], [0, 0, 40.0], [12.0, 3.0, 40.0]]
    return make_view(centers, [looking(), looking(5, 30), looking(4, 200)])


def without(view: View, row: int) -> Result:
    """The result with one frame that has no adjusted pose."""
    poses = view.result.frames.refined
    center, rotation, covariance = (
        np.array(a) for a in (poses.center_world_m, poses.world_from_camera, poses.covariance)
    )
    center[row], rotation[row], covariance[row] = np.nan, np.nan, np.nan
    table = PoseTable(center_world_m=center, world_from_camera=rotation, covariance=covariance)
    status = tuple("seeded" if k == row else s for k, s in enumerate(view.result.frames.status))
    return replace(view.result, frames=replace(view.result.frames, refined=table, status=status))


def test_all_adjusted_frames_are_taken_or_the_one_that_is_named(three: View) -> None:
    assert choose_view(three.result).frame_id == ("0.png", "1.png", "2.png")
    assert choose_view(three.result, "1.png").frame_id == ("1.png",)
    assert choose_view(without(three, 1)).frame_id == ("0.png", "2.png")


def test_an_unknown_frame_is_named_with_the_one_that_was_meant(three: View) -> None:
    with pytest.raises(GeometryError, match=r"'1\.pgn'.*did you mean '1\.png'"):
        choose_view(three.result, "1.pgn")


def test_a_frame_without_a_pose_says_what_to_do(three: View) -> None:
    with pytest.raises(GeometryError, match=r"'1\.png' has no adjusted pose: pick points in it"):
        choose_view(without(three, 1), "1.png")


def test_without_any_pose_there_is_nothing_to_rectify() -> None:
    view = make_view([[0, 0, 30.0]], [looking()])
    with pytest.raises(GeometryError, match="nothing to rectify"):
        choose_view(without(view, 0))


def ground_of_border(view: View, index: int) -> Floats:
    """(n, 2) where a photo's border meets z = 0, by OpenCV's undistortion."""
    share = np.linspace(0, 1, 200)
    u, v = (
        np.concatenate([share, share, 0 * share, 0 * share + 1]),
        np.concatenate([0 * share, 0 * share + 1, share, share]),
    )
    pixel = np.stack([u * SIZE_PX[0], v * SIZE_PX[1]], 1) - 0.5
    fx, fy, cx, cy = BROWN[:4]
    stop = (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    ray = cv2.undistortPoints(pixel[:, None], matrix, BROWN[4:], None, None, None, stop)[:, 0]
    poses = view.result.frames.refined
    ray = np.concatenate([ray, np.ones((len(ray), 1))], 1) @ poses.world_from_camera[index].T
    center = poses.center_world_m[index]
    ground: Floats = (center - ray * (center[2] / ray[:, 2:]))[:, :2]
    return ground


def test_the_raster_covers_what_the_photos_show_and_no_more(three: View) -> None:
    raster = lay_raster(three, 0.1)
    border = np.concatenate([ground_of_border(three, k) for k in range(3)])
    low, high = border.min(axis=0), border.max(axis=0)

    west, north = raster.west_m, raster.north_m
    east, south = west + raster.width * 0.1, north - raster.height * 0.1
    assert west <= low[0] < west + 0.1
    assert south <= low[1] < south + 0.1
    assert east - 0.1 < high[0] <= east
    assert north - 0.1 < high[1] <= north
    assert west / 0.1 == pytest.approx(round(west / 0.1), abs=1e-6)  # pixels on round coordinates


def test_the_size_of_a_pixel_is_that_of_the_photos_to_two_digits(three: View) -> None:
    exact = 40.0 / np.sqrt(BROWN[0] * BROWN[1])
    assert photo_pixels_m(three) == pytest.approx(exact, rel=0.02)
    size = lay_raster(three).pixel_m
    assert size == pytest.approx(exact, rel=0.03)
    assert float(f"{size:.2g}") == size


def test_an_oblique_photo_reaches_as_far_as_rays_are_steep() -> None:
    view = make_view([[0, 0, 20.0]], [looking(70)])  # the horizon is in it
    raster = lay_raster(view, 0.1)

    # straight ahead, ten degrees below the horizon; the edge is found between the samples
    far = 20.0 * MAX_OFF_NADIR
    width = raster.width * 0.1
    assert raster.north_m == pytest.approx(far, rel=2e-3)
    assert width < 2 * far


def test_a_coarse_raster_reduces_the_photos_and_a_fine_one_does_not(three: View) -> None:
    ground = 40.0 / 620.0

    def of(size: float) -> list[int]:
        found: list[int] = reductions(three, lay_raster(three, size)).tolist()
        return found

    assert of(ground) == [1, 1, 1]
    assert of(0.4 * ground) == [1, 1, 1]
    assert of(2.1 * ground) == [2, 2, 2]
    assert of(9 * ground) == [8, 8, 8]


@pytest.mark.parametrize("size", [1e-9, 1e-300, 4e-4])
def test_too_many_pixels_are_refused_with_a_size_that_works(three: View, size: float) -> None:
    with pytest.raises(GeometryError, match=r"too many.*--pixel-size (\S+) or more") as told:
        lay_raster(three, size)
    wanted = float(str(told.value).split("--pixel-size ")[1].split()[0])
    assert lay_raster(three, 1.1 * wanted).width > 10_000


@pytest.mark.parametrize("size", [30.0, 1e6, 1e300])
def test_pixels_larger_than_what_is_shown_are_refused_with_a_size_that_works(
    three: View, size: float
) -> None:
    with pytest.raises(GeometryError, match=r"too large.*--pixel-size (\S+) or less") as told:
        lay_raster(three, size)
    wanted = float(str(told.value).split("--pixel-size ")[1].split()[0])
    assert lay_raster(three, 0.9 * wanted).width >= 16


def test_photos_of_the_sky_are_refused() -> None:
    with pytest.raises(GeometryError, match="looks down at the ground"):
        lay_raster(make_view([[0, 0, 30.0]], [looking(150)]))


def test_where_no_middle_lies_on_the_ground_the_size_must_be_stated() -> None:
    view = make_view([[0, 0, 30.0]], [looking(95)])
    with pytest.raises(GeometryError, match="--pixel-size"):
        lay_raster(view)
    assert lay_raster(view, 0.5).width > 16


@pytest.mark.parametrize("crs", [None, UTM])
def test_boxes_hold_every_place_that_a_photo_shows(crs: str | None) -> None:
    view = make_view([[-10.0, 0, 40.0], [12, 3, 30.0]], [looking(20, 50), looking()], crs=crs)
    raster = lay_raster(view, 0.25)
    reach = boxes(view, raster)
    world = view.ground(raster, np.arange(float(raster.width)), np.arange(float(raster.height)))
    poses = view.result.frames.refined
    for k in range(2):
        pixel = cv_project(
            "brown", poses.center_world_m[k], poses.world_from_camera[k], world.reshape(-1, 3)
        ).reshape(*world.shape[:2], 2)
        size = np.array(SIZE_PX)
        rows, columns = np.nonzero(((pixel > 0) & (pixel < size - 1)).all(axis=-1))
        assert columns.min() >= reach[k, 0] - 1
        assert columns.max() <= reach[k, 2] + 1
        assert rows.min() >= reach[k, 1] - 1
        assert rows.max() <= reach[k, 3] + 1
        assert columns.max() - columns.min() > 0.9 * (reach[k, 2] - reach[k, 0]) - 3


def test_a_photo_that_shows_no_ground_has_no_box() -> None:
    view = make_view([[0, 0, 30.0], [0, 0, 30.0]], [looking(), looking(150)])
    raster = GroundRaster(west_m=-5, north_m=5, pixel_m=0.1, width=100, height=100, crs=None)

    assert np.isnan(boxes(view, raster)[1]).all()
    assert np.isfinite(boxes(view, raster)[0]).all()
