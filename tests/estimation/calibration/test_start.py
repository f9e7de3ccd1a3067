"""First values: exact where there is no noise, near enough where there is."""

from __future__ import annotations

import board_scenes as scenes
import numpy as np
import pytest

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import adjust
from uavgram.estimation.calibration.problem import Corners, compute_board_middle, make_lens, pad
from uavgram.estimation.calibration.start import (
    choose_better_pose,
    estimate_first_values,
    estimate_homographies,
    mirror_poses,
    poses_from_rays,
    solve_centred,
    solve_zhang,
)
from uavgram.model.arrays import Floats
from uavgram.model.board import CalibrationOptions
from uavgram.model.camera import LensModel

PINHOLE = np.array([820.0, 815, 530, 370, 0, 0, 0, 0, 0])


def image_of(corners: Corners, center: tuple[float, float] = (511.5, 383.5)) -> Floats:
    result: Floats = (corners.pixel_px - np.array(center)) / 1024
    return result


def test_zhangs_closed_form_is_exact_without_noise_and_distortion() -> None:
    corners = pad(
        scenes.make_scene(0, PINHOLE, photos=5, noise=0, whole=False).observations, "flat"
    )
    pinhole = solve_zhang(estimate_homographies(corners, image_of(corners), corners.weight > 0))
    assert pinhole is not None
    found = pinhole * 1024
    np.testing.assert_allclose(found + np.array([0, 0, 511.5, 383.5]), PINHOLE[:4], rtol=1e-7)


def test_with_a_centred_principal_point_focal_lengths_are_exact() -> None:
    camera = np.array([820.0, 815, 511.5, 383.5, 0, 0, 0, 0, 0])
    corners = pad(scenes.make_scene(0, camera, photos=3, noise=0).observations, "flat")
    pinhole = solve_centred(estimate_homographies(corners, image_of(corners), corners.weight > 0))
    assert pinhole is not None
    found = pinhole * 1024
    np.testing.assert_allclose(found, [820, 815, 0, 0], rtol=1e-7)


@pytest.mark.parametrize(
    ("parameters", "model"),
    [(PINHOLE, "brown"), (scenes.BROWN5, "brown"), (scenes.BROWN8, "brown"),
     (scenes.FISHEYE, "fisheye")],
)  # fmt: skip
def test_poses_are_exact_for_the_true_camera(parameters: Floats, model: LensModel) -> None:
    scene = scenes.make_scene(1, parameters, model, photos=4, noise=0, whole=False)
    corners = pad(scene.observations, "flat")
    poses = poses_from_rays(model, parameters, corners)
    assert poses is not None
    rotation, middle = poses
    np.testing.assert_allclose(rotation, scene.rotation, atol=1e-6)
    expected = scene.translation + scene.rotation @ compute_board_middle(scene.observations.board)
    np.testing.assert_allclose(middle, expected, atol=1e-5)


@pytest.mark.parametrize(
    ("focal", "model"),
    [(250.0, "fisheye"), (420, "fisheye"), (450.0, "brown"), (4000, "brown")],
)
def test_the_adjustment_arrives_from_first_values_whatever_the_focal_length(
    focal: float, model: LensModel
) -> None:
    parameters = (scenes.FISHEYE if model == "fisheye" else scenes.BROWN5).copy()
    parameters[:2] = focal, 0.99 * focal
    away = max(focal / 420, 1)
    near = (3.5 * away, 7.0 * away)
    scene = scenes.make_scene(2, parameters, model, noise=0.1, distance=near, whole=False)
    options = CalibrationOptions(model=model, coefficients=4 if model == "fisheye" else 5)
    lens, corners = make_lens(options), pad(scene.observations, "flat")
    fit = adjust(lens, corners, estimate_first_values(lens, corners, scenes.SIZE))
    assert fit.converged
    assert fit.cost / fit.degrees_of_freedom == pytest.approx(1, abs=0.15)


def test_what_is_held_is_held_from_the_start() -> None:
    scene = scenes.make_scene(2, PINHOLE, noise=0.1)
    options = CalibrationOptions(aspect=1.01, fixed_principal_point=True)
    lens, corners = make_lens(options), pad(scene.observations, "flat")
    state = adjust(lens, corners, estimate_first_values(lens, corners, scenes.SIZE)).state
    fx, fy, cx, cy = state.parameters[:4]
    assert fx == pytest.approx(1.01 * fy, rel=1e-12)
    assert (cx, cy) == (511.5, 383.5)


def test_a_board_in_the_wrong_one_of_its_two_poses_is_turned() -> None:
    scene = scenes.make_scene(4, PINHOLE, photos=8, noise=0.05)
    lens, corners = make_lens(CalibrationOptions()), pad(scene.observations, "flat")
    good = adjust(lens, corners, estimate_first_values(lens, corners, scenes.SIZE)).state
    wrong = mirror_poses(good).choose_poses(np.arange(8) == 3, good)
    assert np.abs(wrong.camera_from_board - good.camera_from_board).max() > 0.1
    found = choose_better_pose(lens, corners, wrong)
    np.testing.assert_allclose(found.camera_from_board, good.camera_from_board, atol=1e-5)


def test_noise_in_place_of_corners_is_told_or_fits_badly() -> None:
    scene = scenes.make_scene(5, photos=4)
    rng = np.random.default_rng(0)
    photos = tuple(
        scenes.replace_pixels(photo, rng.uniform(0, 700, photo.pixel_px.shape))
        for photo in scene.observations.photos
    )
    observations = type(scene.observations)(board=scene.observations.board, photos=photos)
    lens, corners = make_lens(CalibrationOptions()), pad(observations, "flat")
    try:
        fit = adjust(lens, corners, estimate_first_values(lens, corners, scenes.SIZE))
    except GeometryError:
        return
    assert fit.cost / fit.degrees_of_freedom > 1e4
