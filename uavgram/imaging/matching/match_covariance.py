"""Covariance of the error of a place found by least-squares matching.

The normal equations of the matching alone are too optimistic where a picture has little texture:

- Noise has slopes, too. A shift of the patch is determined by the slopes that both photos show;
  those of the fixed patch alone include the slopes of its noise, and so promise too much.
- Noise of neighbouring pixels is correlated by JPEG and resampling. The effective number of pixels
  is smaller than their count.
- Ground is not flat: where the place depends on a distant edge, it errs as the ground bends.

So the covariance is that of an M-estimator (Huber 1967, "The behavior of maximum likelihood
estimates under nonstandard conditions"), with all three effects.
"""

from __future__ import annotations

import numpy as np

from uavgram.imaging.matching.least_squares import (
    CHANGE_SIGMA,
    MAP_PRIOR,
    PatchFits,
    compute_residual_variance,
)
from uavgram.imaging.matching.matches import MatchOptions
from uavgram.imaging.patch_fit import estimate_neighbour_correlation
from uavgram.model.arrays import Bools, Floats


def estimate_match_covariance(found: PatchFits, options: MatchOptions, step: float = 1.0) -> Floats:
    """Compute covariances (m, 2, 2) of places [steps].

    Parameters
    ----------
    found
        m places.
    options
        Noise share, bend of the ground, and floor.
    step
        Step of the patches [px].
    """
    noise, bent = _of_noise_and_bend(found)
    return (
        options.noise_share**2 * noise
        + (options.bend * step) ** 2 * bent
        + options.floor**2 * np.eye(2)
    )


def is_precise(covariance: Floats, sigma: float) -> Bools:
    """Mark covariances (m, 2, 2) that are positive, and below a sigma in every direction.

    The covariance of an estimator with correlated noise is not positive by construction.
    """
    least, largest = np.linalg.eigvalsh(covariance).T
    return np.asarray((least > 0.0) & (largest < sigma**2))


def _of_noise_and_bend(found: PatchFits) -> tuple[Floats, Floats]:
    """Compute covariances (m, 2, 2) of the residual noise, and of a bend of one per step."""
    fixed = found.fixed
    side = round(len(fixed.grid) ** 0.5)
    noise = compute_residual_variance(fixed, found.value, 8)
    own = fixed.by * fixed.weight
    other = _slopes(found.value.reshape(-1, side, side), fixed.grid)
    pull = noise / CHANGE_SIGMA**2
    # Sensitivity of the M-estimator: products of the slopes of both photos, and the prior of the
    # map.
    answer = own @ np.swapaxes(other, 1, 2) + pull[:, None, None] * MAP_PRIOR
    solved = found.linear @ np.linalg.inv(answer + 1e-12 * np.eye(6))[:, :2]
    gain = solved @ own
    # Noise of the fixed patch has no effect along its own slopes: sums of n (n+ - n-) vanish.
    both = 0.5 * (gain + solved @ (other * fixed.weight))
    of_noise = noise[:, None, None] * (gain @ np.swapaxes(_spread(both, found), 1, 2))
    # Effect of the prior, and of a bend with unit second derivatives.
    known = solved[:, :, 2:] * (pull * CHANGE_SIGMA)[:, None, None]
    u, v = fixed.grid.T
    second = np.stack([u * u, u * v, v * v])
    bent = np.concatenate([gain @ np.swapaxes(fixed.by[:, [i]] * second, 1, 2) for i in (0, 1)], 2)
    return (
        0.5 * (of_noise + np.swapaxes(of_noise, 1, 2)) + known @ np.swapaxes(known, 1, 2),
        bent @ np.swapaxes(bent, 1, 2),
    )


def _slopes(value: Floats, grid: Floats) -> Floats:
    """Compute derivatives (m, 6, k) of the moving patches' values (m, s, s) by the map."""
    down, across = np.gradient(value, axis=(1, 2))
    slope = np.stack([across, down], axis=1).reshape(len(value), 2, len(grid))
    return np.concatenate([slope, *(slope[:, [i]] * grid.T for i in range(2))], axis=1)


def _spread(gain: Floats, found: PatchFits) -> Floats:
    """Multiply gains (m, 2, k) by the correlations of the residuals in the pixels.

    These decay with each step along rows and columns by the neighbours' correlation: a first-order
    process is all that one patch can determine.
    """
    side = round(gain.shape[2] ** 0.5)
    root = np.sqrt(found.fixed.weight).reshape(side, side)
    rest = (found.value - found.fixed.value).reshape(-1, side, side) * root
    apart = np.abs(np.arange(side)[:, None] - np.arange(side))
    alike: Floats = estimate_neighbour_correlation(rest, root)[..., None, None, None] ** apart
    square: Floats = gain.reshape(len(gain), 2, side, side)
    return np.asarray((alike[1] @ square @ alike[0]).reshape(gain.shape))
