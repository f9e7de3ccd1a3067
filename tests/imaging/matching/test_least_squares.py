"""The covariance of matched places, against errors drawn many times: noise, JPEG, bent ground."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from textures import Texture

from uavgram.imaging.matching.least_squares import (
    MatchOptions,
    RefusalReason,
    SoughtPoints,
    estimate_match_covariance,
    fit_patches,
    is_precise,
)
from uavgram.imaging.matching.match import match_points
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

HALF, SIDE, PATCHES = 10, 37, 300
NOISE_ALONE = MatchOptions(noise_share=1.0, bend=0.0, floor=0.0)
BEND_ALONE = MatchOptions(noise_share=0.0, bend=1e-3, floor=0.0)


def smooth(seed: int, contrast: float, finest: float = 0.12) -> Texture:
    return Texture.random(seed, contrast, finest)


def seen(texture: Texture, place: Floats) -> Floats:
    """Grey values of a texture at places (..., 2), neither rounded nor noisy."""
    phase = 2 * np.pi * place @ texture.wave.T + texture.phase
    scale = texture.contrast * np.sqrt(2 / len(texture.wave))
    return np.asarray(scale * np.cos(phase).sum(axis=-1))


def windows(texture: Texture, bend: Floats | None = None) -> Floats:
    """(SIDE, SIDE), or (m, SIDE, SIDE) of bent ground: (m, 6) are halved second derivatives."""
    side = np.arange(SIDE) - SIDE // 2
    grid = np.stack(np.meshgrid(side, side), axis=-1).astype(np.float64)
    if bend is None:
        return seen(texture, grid)
    u, v = grid[..., 0], grid[..., 1]
    second = np.stack([u * u, u * v, v * v], axis=-1)
    moved = np.einsum("vuk,mck->mvuc", second, bend.reshape(-1, 2, 3))
    return np.array([seen(texture, grid - one) for one in moved])


def z_of(near: Floats, far: Floats, options: MatchOptions) -> float:
    """Root mean square of errors over sigmas of patches whose true place is the middle."""
    m = len(near)
    fixed, moving = np.asarray(near, np.float32), np.asarray(far, np.float32)
    square = np.broadcast_to(np.eye(2), (m, 2, 2))
    found = fit_patches(fixed, moving, np.zeros((m, 2)), square, HALF, 12)
    weight = np.linalg.inv(estimate_match_covariance(found, options))
    return float(np.sqrt(np.einsum("ni,nij,nj->n", found.place, weight, found.place).mean() / 2))


def noises(rng: np.random.Generator, sigma: float, blur_px: float) -> Floats:
    """(PATCHES, SIDE, SIDE) of a deviation; with a blur neighbours have it in common."""
    plain = rng.standard_normal((PATCHES, SIDE, SIDE))
    if blur_px:
        plain = np.array([cv2.GaussianBlur(one, (0, 0), blur_px) for one in plain])
    return np.asarray(plain * sigma / plain.std())


@pytest.mark.parametrize(
    ("contrast", "blur_px"), [(20.0, 0.0), (4.0, 0.0), (20.0, 0.7), (5.0, 0.7)]
)
def test_weak_pictures_and_noise_of_neighbours_alike_are_told_as_they_scatter(
    contrast: float, blur_px: float
) -> None:
    rng = np.random.default_rng(3)
    truth = windows(smooth(5, contrast))
    near, far = (truth + noises(rng, 2.0, blur_px) for _ in range(2))
    assert 0.85 < z_of(near, far, NOISE_ALONE) < 1.15


def test_a_place_that_hangs_on_what_is_far_errs_as_the_ground_bends() -> None:
    rng = np.random.default_rng(4)
    middle = np.hypot(*(np.mgrid[:SIDE, :SIDE] - SIDE // 2))
    far_only = np.clip((middle - 6.0) / 2.0, 0.0, 1.0)  # the middle shows nothing
    bend = BEND_ALONE.bend * rng.standard_normal((100, 6))
    texture = smooth(6, 30.0)
    near = np.broadcast_to(windows(texture) * far_only, (100, SIDE, SIDE))
    z = z_of(near, windows(texture, bend) * far_only, BEND_ALONE)
    assert 0.75 < z < 1.25


def jpeg(photo: Image) -> Image:
    _, data = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8)


@pytest.mark.parametrize("contrast", [5.0, 6.0, 15.0])
def test_sigmas_hold_in_compressed_photos_of_much_and_of_little_contrast(contrast: float) -> None:
    shape, middle, shift = (200, 260), np.array([130.0, 100.0]), np.array([3.37, -2.71])
    source = middle + np.random.default_rng(7).uniform(-45, 45, (12, 2))
    turn = np.array([[0.94, -0.34], [0.34, 0.94]])
    back: Floats = np.asarray(np.linalg.inv(turn), np.float64)
    true = (source - middle) @ turn.T + middle + shift
    asked = SoughtPoints(
        source_px=source,
        target_px=true,
        covariance_px2=np.tile(4.0 * np.eye(2), (12, 1, 1)),
        affine=np.tile(turn, (12, 1, 1)),
        rise=np.zeros((12, 2)),
        is_confirmed=np.zeros(12, dtype=np.bool_),
    )
    squared = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        texture = smooth(seed, contrast)
        near = texture.photo(shape, np.eye(2), np.zeros(2), 1.5, rng)
        far = texture.photo(shape, back, middle - back @ (middle + shift), 1.5, rng)
        found = match_points(jpeg(near), jpeg(far), asked)
        some = found.refused == RefusalReason.NONE
        error = (found.pixel_px - true)[some]
        weight = np.linalg.inv(found.covariance_px2[some])
        squared.append(np.einsum("ni,nij,nj->n", error, weight, error))
    values = np.concatenate(squared)
    assert len(values) > 100
    assert 0.8 < np.sqrt(values.mean() / 2) < 1.25


def test_what_is_no_covariance_or_too_large_in_some_direction_is_not_sure() -> None:
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    axes = [(0.04, 0.01), (0.04, -0.01), (-0.02, -0.01), (0.26, 0.01), (0.24, 0.2)]
    covariance = np.array([turn @ np.diag(squares) @ turn.T for squares in axes])
    assert is_precise(covariance, 0.5).tolist() == [True, False, False, False, True]
