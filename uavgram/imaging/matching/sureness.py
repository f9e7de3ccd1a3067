"""How sure a place is that least-squares matching found: the covariance of its error.

The normal equations of the matching alone take too much for granted where a picture says little:

- Noise has slopes, too. A step of the patch is told by the slopes that both photos show; those of
  the fixed patch alone hold the slopes of its noise besides, and so promise more than there is.
- Noise of neighbouring pixels is alike: JPEG and resampling made it so. There are fewer pixels
  than are counted.
- Ground is not flat: where the place hangs on an edge far from it, it errs as the ground bends.

So the covariance is that of an M-estimator (Huber 1967, "The behavior of maximum likelihood
estimates under nonstandard conditions"), with all three.
"""

from __future__ import annotations

import numpy as np

from uavgram.imaging.matching.least_squares import CHANGE_SIGMA, OF_MAP, Fitted, remaining
from uavgram.imaging.matching.options import MatchOptions
from uavgram.imaging.patch_fit import neighbour_correlation
from uavgram.model.arrays import Bools, Floats


def covariance_of(found: Fitted, options: MatchOptions, step: float = 1.0) -> Floats:
    """(m, 2, 2) of places [steps].

    Parameters
    ----------
    found
        m places.
    options
        What is known of noise, ground and photos.
    step
        Of the patches [px].
    """
    noise, bent = _of_noise_and_bend(found)
    return (
        options.noise_share**2 * noise
        + (options.bend * step) ** 2 * bent
        + options.floor**2 * np.eye(2)
    )


def is_sure(covariance: Floats, sigma: float) -> Bools:
    """(m,) whether covariances (m, 2, 2) are positive, and below a sigma in every direction.

    That of an estimator whose noise is correlated is not positive by its form alone.
    """
    least, largest = np.linalg.eigvalsh(covariance).T
    return np.asarray((least > 0.0) & (largest < sigma**2))


def _of_noise_and_bend(found: Fitted) -> tuple[Floats, Floats]:
    """Covariances (m, 2, 2) by what remains between the patches, and by a bend of one per step."""
    fixed = found.fixed
    side = round(len(fixed.grid) ** 0.5)
    noise = remaining(fixed, found.value, 8)
    own = fixed.by * fixed.weight
    other = _slopes(found.value.reshape(-1, side, side), fixed.grid)
    pull = noise / CHANGE_SIGMA**2
    answer = own @ np.swapaxes(other, 1, 2) + pull[:, None, None] * OF_MAP
    solved = found.linear @ np.linalg.inv(answer + 1e-12 * np.eye(6))[:, :2]
    gain = solved @ own
    # Noise of the fixed patch does not pull along its own slopes: sums of n (n+ - n-) vanish.
    both = 0.5 * (gain + solved @ (other * fixed.weight))
    of_noise = noise[:, None, None] * (gain @ np.swapaxes(_spread(both, found), 1, 2))
    known = solved[:, :, 2:] * (pull * CHANGE_SIGMA)[:, None, None]
    u, v = fixed.grid.T
    second = np.stack([u * u, u * v, v * v])
    bent = np.concatenate([gain @ np.swapaxes(fixed.by[:, [i]] * second, 1, 2) for i in (0, 1)], 2)
    return (
        0.5 * (of_noise + np.swapaxes(of_noise, 1, 2)) + known @ np.swapaxes(known, 1, 2),
        bent @ np.swapaxes(bent, 1, 2),
    )


def _slopes(value: Floats, grid: Floats) -> Floats:
    """(m, 6, k) change of the moving patches' values (m, s, s) by the map's parameters."""
    down, across = np.gradient(value, axis=(1, 2))
    slope = np.stack([across, down], axis=1).reshape(len(value), 2, len(grid))
    return np.concatenate([slope, *(slope[:, [i]] * grid.T for i in range(2))], axis=1)


def _spread(gain: Floats, found: Fitted) -> Floats:
    """Gains (m, 2, k) times the correlations of what remains in the pixels.

    These fall with each step along rows and columns by what neighbours have in common: a process
    of first order is all that one patch can tell.
    """
    side = round(gain.shape[2] ** 0.5)
    root = np.sqrt(found.fixed.weight).reshape(side, side)
    rest = (found.value - found.fixed.value).reshape(-1, side, side) * root
    apart = np.abs(np.arange(side)[:, None] - np.arange(side))
    alike: Floats = neighbour_correlation(rest, root)[..., None, None, None] ** apart
    square: Floats = gain.reshape(len(gain), 2, side, side)
    return np.asarray((alike[1] @ square @ alike[0]).reshape(gain.shape))
