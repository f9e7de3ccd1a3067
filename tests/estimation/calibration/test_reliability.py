"""Tests of corners and photos: against refits without them, and against planted errors."""

from __future__ import annotations

import board_scenes as scenes
import numpy as np
import pytest

from uavgram.estimation.calibration.adjustment import adjust
from uavgram.estimation.calibration.problem import Corners, Lens, State, make_lens, pad
from uavgram.estimation.calibration.reliability import (
    PhotoEffect,
    adjust_scaled,
    compute_corner_tests,
    compute_photo_tests,
    drop_unweighted,
    estimate_common_error,
    estimate_photo_effect,
    remove_outliers,
)
from uavgram.estimation.calibration.start import estimate_first_values
from uavgram.model.board import BoardObservations, CalibrationOptions, IntrinsicsPrior

REMOVE = CalibrationOptions(outliers="remove")


def prepared(
    observations: BoardObservations, options: CalibrationOptions = REMOVE
) -> tuple[Lens, Corners, State]:
    lens, corners = make_lens(options), pad(observations, options.bow)
    return lens, corners, estimate_first_values(lens, corners, scenes.SIZE)


def spoiled(
    observations: BoardObservations, moves: dict[tuple[int, int], tuple[int, int]]
) -> BoardObservations:
    """Some corners moved: {(photo, row of its corners): (du, dv)}."""
    photos = list(observations.photos)
    for (photo, row), move in moves.items():
        pixel = photos[photo].pixel_px.copy()
        pixel[row] += move
        photos[photo] = scenes.replace_pixels(photos[photo], pixel)
    return BoardObservations(board=observations.board, photos=tuple(photos))


def test_redundancies_add_up_to_the_degrees_of_freedom() -> None:
    fit = adjust(*prepared(scenes.make_scene(0, whole=False, distance=(5, 14)).observations))
    tests = compute_corner_tests(fit, "given")
    assert 2 * tests.redundancy.sum() == pytest.approx(fit.degrees_of_freedom, rel=1e-9)
    assert (tests.w[fit.corners.weight == 0] == 0).all()


def test_a_corners_statistic_is_what_the_sum_of_squares_loses_without_it() -> None:
    fit = adjust(*prepared(scenes.make_scene(1, photos=6).observations))
    tests = compute_corner_tests(fit, "given")
    for photo, row in ((0, 0), (3, 20), (5, 53)):
        weight = fit.corners.weight.copy()
        weight[photo, row] = 0
        rest = adjust(fit.lens, fit.corners.replace_weights(weight), fit.state)
        assert tests.w[photo, row] ** 2 == pytest.approx(fit.cost - rest.cost, rel=2e-3, abs=1e-3)


def test_a_photos_excess_and_shift_are_those_of_a_refit_without_it() -> None:
    fit = adjust(*prepared(scenes.make_scene(2, photos=8).observations))
    tests = compute_photo_tests(fit, "given")
    sigma = np.sqrt(np.diag(fit.border_covariance))
    for photo in (0, 4, 7):
        keep = np.arange(8) != photo
        rest = adjust(fit.lens, fit.corners.take(keep), fit.state.take(keep))
        assert tests.excess[photo] == pytest.approx(fit.cost - rest.cost, rel=1e-3)
        moved = rest.state.parameters - fit.state.parameters
        np.testing.assert_allclose(moved / sigma, tests.shift[photo] / sigma, atol=0.02)


def test_gross_corners_are_found_every_one_and_nothing_else() -> None:
    moves = {(0, 3): (3, 0), (0, 40): (0, -2), (5, 17): (1, 1), (7, 0): (-40, 25)}
    observations = spoiled(scenes.make_scene(3).observations, moves)
    lens, corners, start = prepared(observations)
    found = remove_outliers(lens, corners, start, REMOVE)
    assert set(zip(*map(list, np.nonzero(found.bad_corner)), strict=True)) == set(moves)
    assert not found.bad_photo.any()
    assert found.sigma_scale == pytest.approx(1, abs=0.06)
    miss = found.fit.state.parameters - scenes.BROWN5
    assert miss @ np.linalg.solve(found.fit.border_covariance, miss) < 27.9  # 0.1 % of chi2(9)


def test_reported_outliers_stay_in_the_result() -> None:
    moves = {(0, 3): (3, 0), (5, 17): (1, 1)}
    observations = spoiled(scenes.make_scene(3).observations, moves)
    lens, corners, start = prepared(observations)
    found = remove_outliers(lens, corners, start, CalibrationOptions(outliers="report"))
    assert found.bad_corner.sum() == 2
    assert (found.fit.corners.weight > 0).all()
    with_all = adjust_scaled(lens, corners, start, REMOVE)[0]
    np.testing.assert_allclose(found.fit.state.parameters, with_all.state.parameters, rtol=1e-5)


def test_a_photo_whose_board_is_another_one_is_found() -> None:
    observations = scenes.make_scene(4).observations
    photos = list(observations.photos)
    rng = np.random.default_rng(0)
    pixel = photos[6].pixel_px
    middle = pixel.mean(axis=0)
    twist = (pixel - middle)[:, 0] * (pixel - middle)[:, 1] / 2e4  # no plane does this
    photos[6] = scenes.replace_pixels(photos[6], pixel + twist[:, None] + rng.normal(size=2))
    lens, corners, start = prepared(
        BoardObservations(board=observations.board, photos=tuple(photos))
    )
    found = remove_outliers(lens, corners, start, REMOVE)
    assert np.flatnonzero(found.bad_photo).tolist() == [6]
    assert found.bad_photo_size[6] > 3
    assert not found.bad_corner[np.arange(12) != 6].any()
    left = drop_unweighted(found.fit, found.bad_photo)
    assert len(left.corners.count) == 11
    assert left.degrees_of_freedom == found.fit.degrees_of_freedom


def test_sigmas_are_scaled_to_the_residuals_with_a_prior_too() -> None:
    observations = scenes.make_scene(5, noise=0.3, sigma=0.1).observations
    sigma = np.array([5.0, 5, 3, 3, 0.01, 0.02, 1e-3, 1e-3, 0.02])
    prior = IntrinsicsPrior(source="test", parameters=scenes.BROWN5, information=np.diag(sigma**-2))
    options = CalibrationOptions(prior=prior)
    lens, corners, start = prepared(observations, options)
    fit, scale = adjust_scaled(lens, corners, start, options)
    assert scale == pytest.approx(3, rel=0.05)
    assert fit.corner_cost == pytest.approx(fit.corner_redundancy, rel=1e-4)
    given = adjust_scaled(
        lens, corners, start, CalibrationOptions(prior=prior, corner_sigma="given")
    )
    assert given[1] == 1


def test_a_bent_board_makes_photos_disagree_and_noise_does_not() -> None:
    def effect(scene: scenes.Scene) -> PhotoEffect:
        options = CalibrationOptions()
        fit, _ = adjust_scaled(*prepared(scene.observations, options), options)
        return estimate_photo_effect(fit, compute_photo_tests(fit, "residuals"), 1.0)

    noise = effect(scenes.make_scene(6))
    assert noise.probability > 0.01
    assert noise.factor < 1.5
    bent = effect(scenes.make_scene(6, bow=(0.1, -0.1)))
    assert bent.probability < 1e-6
    assert bent.factor > 2


@pytest.mark.statistical
def test_the_photo_factor_is_one_on_average_where_corners_are_independent() -> None:
    clean = scenes.make_scene(7, photos=8, noise=0.0)
    start, factors, spread = None, [], 0.0
    for seed in range(150):
        lens, corners, first = prepared(scenes.with_noise(clean, seed, 0.1))
        fit = adjust(lens, corners, start or first)
        start = fit.state
        found = estimate_photo_effect(fit, compute_photo_tests(fit, "given"), 1.0)
        factors.append(found.factor)
        spread = np.sqrt(2 / found.degrees)
    assert np.mean(factors) == pytest.approx(1, abs=4 * spread / np.sqrt(150))
    assert np.std(factors) == pytest.approx(spread, rel=0.35)


# The variance that all corners have in common.


@pytest.mark.parametrize("common", [0.1, 0.5, 2.0])
def test_the_common_part_is_recovered_beside_unequal_own_sigmas(common: float) -> None:
    rng = np.random.default_rng(0)
    own = rng.uniform(0.02, 0.4, 4000)
    residual = np.hypot(own, common)[:, None] * rng.standard_normal((4000, 2))
    found = estimate_common_error(residual, own, 8000)
    # a variance of 8000 draws is known to sqrt(2 / 8000); four of its sigmas, in the worst case
    total = np.mean(np.hypot(own, common) ** 2)
    assert found**2 == pytest.approx(common**2, abs=4 * np.sqrt(2 / 8000) * total)


def test_sigmas_that_are_large_enough_stay() -> None:
    rng = np.random.default_rng(1)
    own = np.full(500, 0.3)
    assert estimate_common_error(0.25 * rng.standard_normal((500, 2)), own, 1000) == 0.0
    assert estimate_common_error(np.zeros((0, 2)), np.zeros(0), 0) == 0.0


def test_unknowns_that_were_fitted_make_it_larger() -> None:
    residual = np.full((100, 2), 0.2)
    full, fitted = (estimate_common_error(residual, np.full(100, 0.01), n) for n in (200, 150))
    assert full == pytest.approx(np.sqrt(0.04 - 1e-4), rel=1e-6)
    assert fitted > full
