"""Shapes to draw with, against OpenCV and against the covariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.stages.products import map_layers as features
from uavgram.views.recording.scene import HALF_HEIGHT, HALF_WIDTH, measure_scene
from uavgram.views.survey import outlines
from uavgram.views.survey.outlines import VisiblePolylines, project_from, sample_polyline


def test_an_outline_is_the_95_percent_contour_of_its_covariance() -> None:
    points = survey.build().points
    outline = features.ellipse_outlines(
        points.position_world_m[:, :2], points.ellipse_95_m, points.ellipse_azimuth_rad, 1.0
    )
    offset = outline - points.position_world_m[:, None, :2]
    squared = np.einsum("kni,kij,knj->kn", offset, np.linalg.inv(points.covariance_m2), offset)

    np.testing.assert_allclose(squared, 2.4477**2, rtol=1e-9)


def test_an_exaggerated_outline_is_as_many_times_as_large() -> None:
    points = survey.build().points
    args = (points.position_world_m[:, :2], points.ellipse_95_m, points.ellipse_azimuth_rad)
    center = points.position_world_m[:, None, :2]

    np.testing.assert_allclose(
        features.ellipse_outlines(*args, 20.0) - center,
        20 * (features.ellipse_outlines(*args, 1.0) - center),
        atol=1e-12,
    )


def test_lines_are_bent_as_opencv_bends_them() -> None:
    result = survey.build()
    frame = 7
    poses = result.frames.refined
    center, rotation = poses.center_world_m[frame], poses.world_from_camera[frame]
    strip = outlines.sample_polyline(result.points.position_world_m[[8, 9]])
    ours = outlines.project_from(result, row_poses(result, frame), strip)
    theirs = survey.project(center, rotation, strip)
    seen = result.camera.is_in_photo(theirs)

    assert seen.any()
    np.testing.assert_allclose(ours[seen], theirs[seen], atol=1e-9)
    assert np.isnan(ours[~seen]).all()


def test_a_frustum_points_where_the_camera_looks() -> None:
    result = survey.build(frame_count=3)
    strips = outlines.frusta(result, result.frames.refined, 5.0)
    apex = strips[:, 5]
    middle = strips[:, :4].mean(axis=1)
    axis = result.frames.refined.world_from_camera[:, :, 2]

    np.testing.assert_allclose(apex, result.frames.refined.center_world_m)
    direction = (middle - apex) / np.linalg.norm(middle - apex, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", direction, axis) > 0.999).all()


def test_frames_without_a_pose_have_no_frustum_and_break_no_track() -> None:
    result = survey.build()

    assert len(outlines.frusta(result, result.frames.refined, 5.0)) == 17
    assert np.isfinite(outlines.track(result, result.frames.refined)).all()
    assert len(outlines.track(result, result.frames.seed)) == 19


def test_the_track_follows_time_not_names() -> None:
    result = survey.build(clean=True)
    backwards = result.frames.time_utc_s[::-1]
    frames = type(result.frames)(**{**vars(result.frames), "time_utc_s": backwards})
    turned = type(result)(**{**vars(result), "frames": frames})

    np.testing.assert_array_equal(
        outlines.track(turned, turned.frames.refined), result.frames.refined.center_world_m[::-1]
    )


def test_a_polyline_that_leaves_the_photo_and_returns_is_two_pieces() -> None:
    pixel = np.array([[0, 0], [1, 0], [np.nan, np.nan], [3, 0], [4, 0], [5, 0], [np.nan, 1]], float)
    runs = outlines.visible_runs(pixel)

    assert [run[:, 0].tolist() for run in runs] == [[0, 1], [3, 4, 5]]


def test_the_distance_from_a_line_is_drawn_at_right_angles_to_it() -> None:
    result = survey.build()
    row = result.measurements.name.index("road width")
    strip = features.measured_strips(result)[row]
    at = features.point_index(result)
    p08, p12, p15 = (result.points.position_world_m[at[name]] for name in ("P08", "P12", "P15"))

    np.testing.assert_array_equal(strip[0], p08)
    assert (strip[1] - strip[0]) @ (p15 - p12) == pytest.approx(0, abs=1e-9)


def test_an_area_is_closed_and_what_was_not_computed_is_not_drawn() -> None:
    result = survey.build()
    strips = features.measured_strips(result)
    patch = strips[result.measurements.name.index("patch")]

    np.testing.assert_array_equal(patch[0], patch[-1])
    assert result.measurements.name.index("to the tree") not in strips


@pytest.mark.parametrize(
    ("size", "factor"), [(0.1, 20), (0.11, 10), (5.0, 1), (0.0, 1), (np.nan, 1)]
)
def test_exaggerations_are_round_numbers_that_stay_within_the_limit(
    size: float, factor: int
) -> None:
    assert outlines.nice_factor(size, 2.0) == factor


def test_the_first_view_has_points_frusta_and_ground_in_it_and_nothing_to_spare() -> None:
    result = survey.build()
    covered = np.ones((64, 96), dtype=bool)
    texture = GroundTexture(np.zeros((64, 96, 3), np.uint8), covered, -60.0, 40.0, 1.25)
    scene = measure_scene(result, texture)
    pyramids = outlines.frusta(result, result.frames.refined, 2 * scene.frustum_m)
    ground = np.array([[-60, 40, 0], [40, 40, 0], [-60, -20, 0], [40, -20, 0]], dtype=float)
    everything = np.concatenate([result.points.position_world_m, pyramids.reshape(-1, 3), ground])
    right, up = scene.eye.project_to_screen(everything).T

    assert np.abs(right).max() <= HALF_WIDTH + 1e-9
    assert np.abs(up).max() <= HALF_HEIGHT + 1e-9
    # it touches both sides of the tighter direction
    tight = [right / HALF_WIDTH, up / HALF_HEIGHT]
    assert max(min(t.max(), -t.min()) for t in tight) > 0.95


def test_frusta_are_small_beside_the_flying_height() -> None:
    scene = measure_scene(survey.build())

    assert scene.frustum_m <= 0.06 * scene.height_m


def test_a_thinned_line_is_as_exact_as_was_asked_and_keeps_its_ends() -> None:
    along = np.linspace(0.0, 1.0, 49)
    bent = np.column_stack([400 * along, 30 * along**2])
    kept = outlines.thin_polyline(bent, 0.5)
    straight = outlines.thin_polyline(np.column_stack([400 * along, 20 * along]), 0.5)
    off = np.interp(bent[:, 0], kept[:, 0], kept[:, 1]) - bent[:, 1]

    assert len(kept) < 16
    assert np.abs(off).max() <= 0.5
    assert len(straight) == 2
    np.testing.assert_array_equal(kept[[0, -1]], bent[[0, -1]])


# Which things a photo may show, against what it does show.


@pytest.mark.parametrize("sweep", [0.0, 0.4])
def test_nothing_that_a_photo_shows_is_out_of_its_sight_and_most_of_the_rest_is(
    sweep: float,
) -> None:
    made = survey.build(clean=True)
    moved = np.broadcast_to(sweep * np.array([3.0, -2.0, 0.5, 0.1, -0.15, 0.05]), (20, 6))
    result = replace(made, frames=replace(made.frames, sweep=moved.copy()))
    rng = np.random.default_rng(3)
    start = rng.uniform([-90.0, -90.0, -5.0], [90.0, 90.0, 15.0], (400, 3))
    end = start + rng.normal(0.0, 8.0, (400, 3))
    strips = [sample_polyline(strip) for strip in np.stack([start, end], axis=1)]
    in_sight = VisiblePolylines(result, strips)
    shown, told = (np.zeros((20, 400), np.bool_) for _ in range(2))
    for frame in range(20):
        pixel = project_from(result, row_poses(result, frame), np.stack(strips))
        shown[frame] = np.isfinite(pixel[..., 0]).any(axis=1)
        told[frame, in_sight.of(frame)] = True

    assert shown.sum() > 300
    assert not (shown & ~told).any()
    assert told.mean() < 0.5
