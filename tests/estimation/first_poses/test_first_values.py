"""Intersections of rays against OpenCV's triangulation, and first values of tie points."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from off_ground import with_third_coordinates
from place_only_scenes import LENS, place_only
from scenes import Scene, cv_pixels, make_scene

from uavgram.estimation.first_poses.first_values import (
    MAX_RISE,
    FirstValues,
    add_first_ties,
    add_free_points,
    estimate_length_poses,
)
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.survey import Sightings

HEIGHTS = {0: 1.5, 7: 2.5}


def begun(scene: Scene) -> tuple[FirstValues, Floats]:
    """First values from the true poses, and the rays of the picks."""
    survey, labels = scene.survey, len(scene.survey.label)
    calibration = survey.calibration
    ray = back_project(calibration.model, calibration.parameters, survey.pixel_px)
    values = FirstValues(
        point_m=np.full((labels, 2), np.nan),
        center=np.array(scene.truth.center),
        rotation=np.array(scene.truth.rotation),
        height_m=0.0,
        departure_m=np.zeros(labels),
    )
    return add_free_points(survey, values), ray


def test_a_pick_beyond_the_lens_has_no_ray_and_hurts_no_point() -> None:
    """As where another camera file is tried, whose distortion turns back within the photo."""
    scene = make_scene(1)
    calibration = scene.survey.calibration
    parameters = np.array(calibration.parameters)
    parameters[4] = -1.0  # k1
    survey = replace(
        scene.survey,
        calibration=replace(calibration, parameters=parameters),
        is_free=np.ones(len(scene.survey.label), dtype=np.bool_),
    )
    values, ray = begun(replace(scene, survey=survey))

    assert np.isnan(ray).any()
    assert np.isfinite(values.point_m).all(axis=1).any()


def test_two_rays_meet_where_opencv_has_them() -> None:
    scene = make_scene(4, frames=2, heights=HEIGHTS, noise=0.0)
    values, ray = begun(with_third_coordinates(scene, free=HEIGHTS))
    survey, truth = scene.survey, scene.truth

    for label in HEIGHTS:
        rows = [
            np.flatnonzero((survey.pick_frame == f) & (survey.pick_label == label)) for f in (0, 1)
        ]
        views = [
            np.column_stack([r.T, -r.T @ c])
            for r, c in zip(truth.rotation, truth.center, strict=True)
        ]
        pixels = [(ray[row[0], :2] / ray[row[0], 2])[:, None] for row in rows]
        found = cv2.triangulatePoints(views[0], views[1], pixels[0], pixels[1])[:, 0]
        expected = found[:3] / found[3]
        here = np.array([*values.point_m[label], values.departure_m[label]])
        assert np.abs(here - expected).max() < 1e-6
    on_ground = np.setdiff1d(np.arange(len(survey.label)), list(HEIGHTS))
    assert np.isnan(values.point_m[on_ground]).all()


def test_rays_from_nearly_one_place_say_nothing() -> None:
    scene = with_third_coordinates(make_scene(4, frames=2, lines=0, heights=HEIGHTS), HEIGHTS)
    survey, truth = scene.survey, scene.truth
    center, rotation = np.array(truth.center), np.array(truth.rotation)
    center[1], rotation[1] = center[0] + [0.002, 0.0, 0.0], rotation[0]
    first = {int(k): i for i, k in enumerate(survey.pick_label) if survey.pick_frame[i] == 0}
    pixel = np.array([survey.pixel_px[first[int(k)]] for k in survey.pick_label])
    near = replace(truth, center=center, rotation=rotation)
    values, _ = begun(replace(scene, survey=replace(survey, pixel_px=pixel), truth=near))

    assert np.isnan(values.point_m[list(HEIGHTS)]).all()


def test_what_a_length_holds_begins_on_the_ground() -> None:
    scene = with_third_coordinates(
        make_scene(4, frames=1, heights=HEIGHTS, ends=((0, 1),)), free=HEIGHTS
    )
    values, _ = begun(scene)

    assert np.isfinite(values.point_m[0]).all()
    assert values.departure_m[0] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(values.point_m[7]).all()


# First values of tie points: only of those well in front of all their cameras.


UP_M = 30.0


@pytest.mark.parametrize(("away_m", "ties"), [(0.1, 0), (3.0, 1)])
def test_a_point_beside_a_camera_has_no_first_value(away_m: float, ties: int) -> None:
    """The camera moves by more than a decimetre while it reads its rows."""
    scene = place_only(3, frames=6, labels=11)
    place = np.array([1.0, 2.0, UP_M])
    forward = scene.rotation[0][:, 2]
    center = np.stack([place - away_m * forward, place - [8.0, 0.0, -40.0]])
    pixel = np.concatenate(
        [cv_pixels(LENS, center[k], scene.rotation[k], place[None])[0] for k in range(2)]
    )
    survey = replace(
        scene.survey,
        ties=Sightings(
            frame=np.array([0, 1]),
            point=np.zeros(2, np.int64),
            pixel_px=pixel,
            sigma_px=np.full(2, 0.15),
            row=np.arange(2),
            pick=np.array([-1]),
        ),
    )
    count = len(survey.label)
    poses = np.concatenate([center, scene.center[2:]]), scene.rotation
    values = FirstValues(np.zeros((count, 2)), *poses, 0.0, np.zeros(count))

    usable, first = add_first_ties(survey, values)

    assert usable.ties.points == len(first) == ties
    np.testing.assert_allclose(first, place[None][:ties], atol=1e-3)


@pytest.mark.parametrize("rise_m", [0.12, 2.0])
def test_lengths_from_the_road_to_a_kerb_place_a_single_photo(rise_m: float) -> None:
    """Each of the four lengths ends on a kerb of stated height; a wall would be too high."""
    ends = ((0, 4), (1, 5), (2, 6), (3, 7))
    heights = dict.fromkeys(range(4), rise_m)
    scene = make_scene(
        3, frames=1, gauge="plane", telemetry=False, heights=heights, ends=ends, noise=0.0
    )
    found = estimate_length_poses(scene.survey)

    assert len(found) == int((rise_m <= MAX_RISE * scene.survey.length_m).sum() >= 3)
    assert len(found) == int(rise_m < 1.0)
    for poses in found.values():
        height_m = 1.0 / np.linalg.norm(poses.plane, axis=1)
        assert np.abs(height_m / scene.truth.center[0, 2] - 1.0).min() < 0.1
