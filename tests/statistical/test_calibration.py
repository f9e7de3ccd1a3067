"""Repeated calibrations of known cameras: is what is said of their errors true?

One error source at a time, with bounds from the number of trials.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import board_scenes as scenes
import numpy as np
import pytest
from scipy.stats import binom, chi2

from uavgram.estimation.calibration import adjustment
from uavgram.estimation.calibration.adjustment import Normals, UndeterminedError, adjust
from uavgram.estimation.calibration.problem import Lens, Linearisation, make_lens, pad
from uavgram.estimation.calibration.projection import compare_cameras, compute_projection_covariance
from uavgram.estimation.calibration.reliability import (
    compute_photo_tests,
    drop_unweighted,
    estimate_photo_effect,
    remove_outliers,
)
from uavgram.estimation.calibration.start import estimate_first_values
from uavgram.geometry.camera.projection import back_project, project, project_with_jacobian
from uavgram.model.arrays import Floats
from uavgram.model.board import BoardObservations, CalibrationOptions
from uavgram.model.camera import Calibration

Trials = tuple[Floats, Floats]
"""(T, P) estimates and (T, P, P) covariances."""

pytestmark = pytest.mark.statistical

TRIALS = 200
LEVEL = 0.95
OPTIONS = CalibrationOptions(corner_sigma="given")
SIGMAS = np.array([0.05, 0.2])  # unequal: every other corner


def repeated(
    parameters: Floats = scenes.BROWN5,
    options: CalibrationOptions = OPTIONS,
    trials: int = TRIALS,
    *,
    twice: bool = False,
) -> Trials:
    """(T, P) estimates and (T, P, P) covariances from new noise on the same photos."""
    clean = scenes.make_scene(
        0, parameters, options.model, photos=8, noise=0.0, whole=False, distance=(5, 12)
    )
    lens = make_lens(options)
    state, found, covariances = None, [], []
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        photos = []
        for photo in clean.observations.photos:
            sigma = SIGMAS[np.arange(len(photo.corner)) % 2]
            noise = rng.normal(size=photo.pixel_px.shape) * sigma[:, None]
            photos.append(replace(photo, pixel_px=photo.pixel_px + noise, sigma_px=sigma))
        if twice:
            photos.append(photos[0])
        observations = BoardObservations(board=clean.observations.board, photos=tuple(photos))
        corners = pad(observations, "flat")
        if state is None:
            state = estimate_first_values(lens, corners, scenes.SIZE)
        fit = adjust(lens, corners, state)
        state = fit.state
        found.append(fit.state.parameters)
        covariances.append(fit.parameter_covariance())
    return np.array(found), np.array(covariances)


@pytest.fixture(scope="module")
def trials() -> Trials:
    """Estimates and covariances of one camera, calibrated again and again."""
    return repeated()


def squared_misses(found: Floats, covariances: Floats, truth: Floats) -> tuple[Floats, int]:
    free = np.diag(covariances[0]) > 0
    miss = (found - truth)[:, free]
    inverse = np.linalg.inv(covariances[:, free][:, :, free])
    return np.einsum("ti,tij,tj->t", miss, inverse, miss), int(free.sum())


def judged(squared: Floats, size: int) -> bool:
    """Whether mean and 95 % coverage of squared Mahalanobis lengths are those of chi-square."""
    trials = len(squared)
    low, high = chi2.ppf(np.array([0.0005, 0.9995]), size * trials) / trials
    inside = int(np.sum(squared < chi2.ppf(LEVEL, size)))
    least, most = binom.ppf(np.array([0.0005, 0.9995]), trials, LEVEL)
    return bool(low < squared.mean() < high and least <= inside <= most)


@pytest.mark.parametrize(
    ("parameters", "options"),
    [
        (scenes.BROWN5, None),
        (scenes.BROWN3, replace(OPTIONS, coefficients=3)),
        (scenes.FISHEYE, replace(OPTIONS, model="fisheye", coefficients=4)),
    ],
)
def test_true_parameters_lie_in_their_regions_at_the_stated_rate(
    trials: Trials, parameters: Floats, options: CalibrationOptions | None
) -> None:
    found, covariances = trials if options is None else repeated(parameters, options)
    assert judged(*squared_misses(found, covariances, parameters))
    sigma = np.sqrt(np.einsum("tii->ti", covariances))
    least, most = binom.ppf(np.array([0.0001, 0.9999]), TRIALS, LEVEL)
    for i in np.flatnonzero(sigma[0] > 0):
        inside = np.sum(np.abs(found[:, i] - parameters[i]) < 1.95996 * sigma[:, i])
        assert least <= inside <= most, i


def test_the_covariance_is_the_scatter_of_repeated_calibrations(trials: Trials) -> None:
    found, covariances = trials
    sample, stated = np.cov(found.T), covariances.mean(axis=0)
    root = np.linalg.cholesky(stated)
    whitened = np.linalg.solve(root, np.linalg.solve(root, sample).T)
    # Marchenko and Pastur 1967: the eigenvalues of a sample covariance of white noise
    ratio = np.sqrt(9 / TRIALS)
    values = np.linalg.eigvalsh(whitened)
    assert (1 - ratio) ** 2 * 0.75 < values[0]
    assert values[-1] < (1 + ratio) ** 2 * 1.25
    assert np.trace(whitened) / 9 == pytest.approx(1, abs=4 * np.sqrt(2 / (9 * TRIALS)))


def test_true_projections_lie_in_their_regions_at_the_stated_rate(trials: Trials) -> None:
    found, covariances = trials
    pixel = np.array([[60.0, 60], [512, 384], [900, 100], [300, 700]])
    ray = back_project("brown", scenes.BROWN5, pixel)
    truth = project("brown", scenes.BROWN5, ray)
    inside = np.zeros(len(pixel))
    for parameters, covariance in zip(found, covariances, strict=True):
        have, _, jacobian = project_with_jacobian("brown", parameters, ray)
        spread = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
        miss = have - truth
        squared = np.einsum("ni,nij,nj->n", miss, np.linalg.inv(spread), miss)
        inside += squared < chi2.ppf(LEVEL, 2)
    least, most = binom.ppf(np.array([0.0001, 0.9999]), TRIALS, LEVEL)
    assert (inside >= least).all()
    assert (inside <= most).all()


def test_planted_a_sigma_for_a_variance_shows(trials: Trials) -> None:
    found, covariances = trials
    sigma = np.sqrt(np.einsum("tii->ti", covariances))
    correlation = covariances / (sigma[:, :, None] * sigma[:, None, :])
    wrong = correlation * np.sqrt(sigma[:, :, None] * sigma[:, None, :])
    assert not judged(*squared_misses(found, wrong, scenes.BROWN5))


def test_planted_photos_counted_twice_show(trials: Trials) -> None:
    # all of them twice halve the covariance; one of eight takes a little
    found, covariances = trials
    assert not judged(*squared_misses(found, covariances / 2, scenes.BROWN5))
    _, once = repeated(trials=1)
    _, doubled = repeated(trials=1, twice=True)
    assert (np.diag(doubled[0]) < np.diag(once[0])).all()


def test_planted_no_schur_complement_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    schur = adjustment.eliminate_poses

    def known_poses(lens: Lens, linear: Linearisation) -> Normals:
        photo = np.swapaxes(linear.border, 1, 2) @ linear.border
        border = photo.sum(axis=0) + adjustment.compute_prior_normal(lens)
        return schur(lens, linear)._replace(photo_border=photo, border=border)

    monkeypatch.setattr(adjustment, "eliminate_poses", known_poses)
    found, covariances = repeated(trials=60)
    assert not judged(*squared_misses(found, covariances, scenes.BROWN5))


@pytest.mark.parametrize("side", ["left", "right"])
def test_on_real_photos_the_covariance_is_the_scatter_over_photos(
    data_dir: Path, side: str
) -> None:
    # Bootstrap (Efron 1979) over photos: the residuals of one photo go together, so the corners'
    # own covariance, which is OpenCV's, is too small by a factor of more than two.
    observations = scenes.opencv_chess(data_dir, side)
    options = CalibrationOptions(outliers="remove")
    lens, corners = make_lens(options), pad(observations, "flat")
    found = remove_outliers(
        lens, corners, estimate_first_values(lens, corners, (640, 480)), options
    )
    fit = drop_unweighted(found.fit, found.fit.corners.count == 0)
    effect = estimate_photo_effect(fit, compute_photo_tests(fit, "residuals"), 1.0)
    rng = np.random.default_rng(0)
    samples: list[Floats] = []
    photos = len(fit.corners.count)
    while len(samples) < 100:
        drawn = rng.integers(0, photos, photos)
        try:
            again = adjust(fit.lens, fit.corners.take(drawn), fit.state.take(drawn))
        except UndeterminedError:
            continue
        samples.append(again.state.parameters)
    scatter = np.cov(np.array(samples).T)
    root = np.linalg.cholesky(fit.parameter_covariance(effect.factor))
    whitened = np.linalg.solve(root, np.linalg.solve(root, scatter).T)
    # the mean over nine directions, from a dozen photos: a factor known to some 25 %
    assert 0.5 < np.trace(whitened) / 9 < 2
    assert np.trace(whitened) * effect.factor / 9 > 2


def test_projection_uncertainty_covers_calibrations_after_the_fitted_turn(trials: Trials) -> None:
    found, covariances = trials
    truth = Calibration(
        name="truth",
        model="brown",
        width_px=scenes.SIZE[0],
        height_px=scenes.SIZE[1],
        parameters=scenes.BROWN5,
        covariance=covariances.mean(axis=0),
    )
    pixel, covariance = compute_projection_covariance(truth, columns=8)
    misses = np.array(
        [
            compare_cameras(truth, replace(truth, parameters=p), columns=8).difference_px
            for p in found[:80]
        ]
    )
    assert misses.shape[1] == len(pixel)
    ratio = np.mean(np.sum(misses**2, axis=2), axis=0) / np.trace(covariance, axis1=1, axis2=2)
    assert np.mean(ratio) == pytest.approx(1, abs=4 * np.sqrt(2 / 80) / 2)
