"""The centre of what looks the same after half a turn: exact, and as exact as is said."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.symmetry import find_centre_of_symmetry
from uavgram.model.arrays import Floats

SIDE_PX = 61
BLUR_PX = (0.7, 1.2, 2.0)  # a pixel's own aperture in it
NOISE = 2.0


def chequer(center_px: Floats, angles: Floats, blur_px: float) -> Floats:
    """Four fields whose edges are blurred by a bell: a formula, with no sampling of its own."""
    v, u = np.mgrid[:SIDE_PX, :SIDE_PX]
    du, dv = u - center_px[0], v - center_px[1]
    one, other = (
        erf((np.cos(angle) * dv - np.sin(angle) * du) / (np.sqrt(2.0) * blur_px))
        for angle in angles
    )
    return np.asarray(125.0 + 95.0 * one * other)


def errors(noise: float) -> tuple[Floats, Floats]:
    """(n, 2) errors of centres anywhere in a pixel, and their sigmas (n,) by noise alone."""
    rng = np.random.default_rng(3)
    off, sigma = [], []
    for k in range(90):
        center = 30.0 + rng.uniform(-0.5, 0.5, 2)
        first = rng.uniform(0.0, np.pi)
        angles = np.array([first, first + rng.uniform(1.1, 2.0)])
        grey = chequer(center, angles, BLUR_PX[k % 3]) + noise * rng.normal(size=(SIDE_PX, SIDE_PX))
        photo: Image = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
        found = find_centre_of_symmetry(photo, center + rng.uniform(-0.7, 0.7, 2), 9.0 * np.eye(2))
        assert found is not None
        off.append(found.pixel_px - center)
        sigma.append(np.sqrt(np.trace(found.covariance_px2) / 2.0))
    return np.array(off), np.array(sigma)


def test_centres_are_exact_wherever_in_a_pixel_they_lie() -> None:
    off, _ = errors(0.0)
    assert np.sqrt(np.mean(off**2)) < 0.003
    assert np.abs(off).max() < 0.012


def test_noise_makes_centres_as_wrong_as_is_said() -> None:
    off, sigma = errors(NOISE)
    z = off / sigma[:, None]
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.25  # of 180 values: three sigmas are 0.16
