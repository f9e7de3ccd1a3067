"""Held-out photos, model choice, hidden systematics, geometry of the photos."""

from __future__ import annotations

from collections.abc import Callable

import board_scenes as scenes
import numpy as np
import pytest

from uavgram.estimation.calibration.adjustment import (
    Fit,
    HeldOut,
    adjust,
    choose_simplest,
    compute_information_criteria,
    cross_validate,
    fit_poses,
)
from uavgram.estimation.calibration.network import (
    compute_coverage,
    compute_tilts,
    detect_focus_drift,
    detect_rolling_shutter,
    map_residuals,
)
from uavgram.estimation.calibration.problem import make_lens, pad
from uavgram.estimation.calibration.start import estimate_first_values
from uavgram.model.arrays import Floats
from uavgram.model.board import BoardObservations, CalibrationOptions

USUAL = CalibrationOptions()


def fit_of(observations: BoardObservations, options: CalibrationOptions = USUAL) -> Fit:
    lens, corners = make_lens(options), pad(observations, options.bow)
    return adjust(lens, corners, estimate_first_values(lens, corners, scenes.SIZE))


def distorted(
    observations: BoardObservations, change: Callable[[int, Floats], Floats]
) -> BoardObservations:
    """Pixels changed photo by photo: change(index, pixel) is added."""
    photos = tuple(
        scenes.replace_pixels(photo, photo.pixel_px + change(i, photo.pixel_px))
        for i, photo in enumerate(observations.photos)
    )
    return BoardObservations(board=observations.board, photos=photos)


def test_a_photo_left_out_is_predicted_as_by_hand() -> None:
    fit = fit_of(scenes.make_scene(0, photos=6).observations)
    found = cross_validate(fit)
    keep = np.arange(6) != 2
    rest = adjust(fit.lens, fit.corners.take(keep), fit.state.take(keep))
    only = fit.state.take(~keep)
    only = type(only)(
        rest.state.parameters, only.bow_m, only.camera_from_board, only.middle_camera_m
    )
    cost = fit_poses(fit.lens, fit.corners.take(~keep), only)[1][0]
    assert found.squares[2] == pytest.approx(cost, rel=1e-6)
    assert found.degrees[2] == 2 * 54 - 6
    assert 0.8 < found.factor < 1.4  # noise of 1 sigma, and a little of the camera


@pytest.mark.parametrize(("parameters", "expected"), [(scenes.BROWN3, 3), (scenes.BROWN5, 5)])
def test_the_fewest_coefficients_that_predict_are_chosen(parameters: Floats, expected: int) -> None:
    scene = scenes.make_scene(1, parameters, photos=10)
    fits = [fit_of(scene.observations, CalibrationOptions(coefficients=c)) for c in (3, 5)]
    assert (3, 5)[choose_simplest([cross_validate(fit) for fit in fits])] == expected
    bic = [compute_information_criteria(fit)[1] for fit in fits]
    assert (3, 5)[int(np.argmin(bic))] == expected


def test_a_model_that_cannot_do_without_a_photo_is_not_chosen() -> None:
    good = HeldOut(np.array([90.0, 100, 110]), np.full(3, 100.0))
    fragile = HeldOut(np.array([50.0, np.nan, 60]), np.full(3, 100.0))
    assert fragile.factor == np.inf
    assert choose_simplest([fragile, good]) == 1
    assert choose_simplest([good, fragile]) == 0
    better = HeldOut(np.array([50.0, 60, 70]), np.full(3, 100.0))
    assert choose_simplest([good, better]) == 1
    within = HeldOut(np.array([95.0, 94, 110]), np.full(3, 100.0))
    assert choose_simplest([good, within]) == 0


def test_a_rolling_shutter_shows_and_other_misfits_do_not_look_like_one() -> None:
    clean = scenes.make_scene(2).observations
    rng = np.random.default_rng(0)
    drift = rng.normal(size=(12, 2)) * 2

    def shutter(i: int, pixel: Floats) -> Floats:
        result: Floats = drift[i] * (pixel[:, 1:] / scenes.SIZE[1] - 0.5)
        return result

    found = detect_rolling_shutter(fit_of(distorted(clean, shutter)), scenes.SIZE)
    assert found.probability < 0.01
    assert 0.5 * np.sqrt(8) < found.drift_px < 2 * np.sqrt(8)
    bent = fit_of(scenes.make_scene(2, bow=(0.1, -0.1)).observations)
    misfit = fit_of(clean, CalibrationOptions(coefficients=3))
    for other in (fit_of(clean), bent, misfit):
        assert detect_rolling_shutter(other, scenes.SIZE).probability > 0.1


def test_a_focus_that_changes_shows() -> None:
    clean = scenes.make_scene(3).observations
    change = np.random.default_rng(0).normal(size=12) * 0.02

    def refocused(i: int, pixel: Floats) -> Floats:
        result: Floats = change[i] * (pixel - scenes.BROWN5[2:4])
        return result

    found = detect_focus_drift(fit_of(distorted(clean, refocused)), 1.0)
    assert found.probability < 1e-6
    assert np.corrcoef(found.relative, change)[0, 1] > 0.9
    assert detect_focus_drift(fit_of(clean), 1.0).probability > 1e-3


def test_mean_residuals_show_what_the_lens_model_lacks() -> None:
    clean = scenes.make_scene(4, photos=20, whole=False, distance=(5, 12)).observations
    found = map_residuals(fit_of(clean), scenes.SIZE, (8, 6))
    assert found.corners.sum() == sum(len(photo.corner) for photo in clean.photos)
    assert found.mean_px.shape == (6, 8, 2)
    assert np.nanmin(found.probability) > 1e-3 / 48

    def bump(_: int, pixel: Floats) -> Floats:  # a dent in the image that no coefficient describes
        squared = np.sum((pixel - [300, 500]) ** 2, axis=1)
        result: Floats = np.exp(-squared / (2 * 60**2))[:, None] * [0.5, 0]
        return result

    dented = map_residuals(fit_of(distorted(clean, bump)), scenes.SIZE, (8, 6))
    row, column = np.unravel_index(np.argmin(dented.probability), (6, 8))
    assert dented.probability.min() < 1e-10
    assert (int(row), int(column)) in {(3, 2), (4, 2), (3, 1), (4, 1)}
    assert dented.mean_px[row, column, 0] < -0.1  # predicted minus found


def test_tilts_say_along_which_direction_the_board_was_never_tilted() -> None:
    scene = scenes.make_scene(5, photos=30)
    found = compute_tilts(scenes.true_state(scene, scenes.BROWN5))
    normal = scene.rotation[:, 2, 2]
    np.testing.assert_allclose(np.cos(found.tilt_rad), normal, atol=1e-12)
    assert found.spread_rad.min() > np.radians(8)
    angle = np.radians(np.linspace(20, 50, 6))
    about_u = np.zeros((6, 3, 3))
    about_u[:, 0, 0] = 1
    about_u[:, 1, 1] = about_u[:, 2, 2] = np.cos(angle)
    about_u[:, 2, 1], about_u[:, 1, 2] = np.sin(angle), -np.sin(angle)
    state = scenes.true_state(scene, scenes.BROWN5).take(np.arange(6))
    state = type(state)(state.parameters, state.bow_m, about_u, state.middle_camera_m)
    one = compute_tilts(state)
    np.testing.assert_allclose(one.tilt_rad, angle, atol=1e-12)
    assert one.spread_rad[0] == pytest.approx(angle.std(), rel=1e-9)
    assert one.spread_rad[1] == pytest.approx(0, abs=1e-9)
    assert abs(one.weak_rad) == pytest.approx(0, abs=1e-9)  # along u


def test_coverage_counts_cells_and_reach() -> None:
    pixel = np.array([[0.0, 0], [99, 59], [50, 30]])
    found = compute_coverage(pixel, (100, 60), (2, 2))
    np.testing.assert_array_equal(found.corners, [[1, 0], [0, 2]])
    assert found.share == 0.5
    assert found.largest_share == pytest.approx(1, abs=0.02)
    assert compute_coverage(pixel[2:], (100, 60)).largest_share < 0.02
