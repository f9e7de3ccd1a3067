"""Least-squares matching: the affine map between two patches.

Gruen 1985, "Adaptive least squares correlation", with brightness and contrast free; solved by the
inverse compositional algorithm (Baker and Matthews 2004, "Lucas-Kanade 20 years on"): gradients are
those of the fixed patch, so the normal equations are formed once. The covariance of the place is in
`sureness.py`. The poses predict rotation and stretch of the patches to some per cent; this prior
matters where the picture has little texture.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.patches import Grey, compute_slopes, make_grid, sample_grey
from uavgram.model.arrays import Bools, Floats, Ints

CHANGE_SIGMA = 0.05
"""Prior sigma of each element of the affine map, from errors of poses and ground slopes."""

MAP_PRIOR = np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
"""Selects the parameters with a prior: four of the six, the elements of the affine map."""

_ROUNDING = 0.4  # standard deviation of the difference of two rounded grey values
_CONVERGED = 2e-3  # steps
_MAX_SHIFT = 6.0  # steps from the start: farther is no refinement
_MOST_ROWS = 30000  # of an image that OpenCV can resample


class System(NamedTuple):
    """Fixed patches: grid, weights, normalised values and their derivatives by the map."""

    grid: Floats  # (k, 2)
    weight: Floats  # (k,)
    value: Floats  # (m, k) mean 0, weighted variance 1
    contrast: Floats  # (m,)
    by: Floats  # (m, 6, k) change of the values by the map's parameters


class PatchFits(NamedTuple):
    """Matches of m patches.

    Attributes
    ----------
    place
        (m, 2) the fixed window's middle in the moving window, steps from its middle.
    linear
        (m, 2, 2) d moving / d fixed.
    likeness
        (m,) weighted correlation after matching.
    gain
        (m,) contrast of the moving patch over that of the fixed one.
    fixed
        Fixed patches.
    value
        (m, k) values of the moving patches at the match, normalised like the fixed ones.
    """

    place: Floats
    linear: Floats
    likeness: Floats
    gain: Floats
    fixed: System
    value: Floats

    @property
    def contrast(self) -> Floats:
        """(m,) weighted standard deviation of the fixed patches [grey values]."""
        return self.fixed.contrast

    def some(self, chosen: Bools) -> PatchFits:
        """Select patches by a mask (m,)."""
        fixed = self.fixed._replace(
            value=self.fixed.value[chosen],
            contrast=self.fixed.contrast[chosen],
            by=self.fixed.by[chosen],
        )
        return PatchFits(
            place=self.place[chosen],
            linear=self.linear[chosen],
            likeness=self.likeness[chosen],
            gain=self.gain[chosen],
            fixed=fixed,
            value=self.value[chosen],
        )


def fit_patches(
    fixed: Grey,
    moving: Grey,
    start: Floats,
    linear: Floats,
    half: int,
    steps: int,
    bell: tuple[Floats, float] | None = None,
) -> PatchFits:
    """Match the middle of fixed windows in moving ones.

    Parameters
    ----------
    fixed, moving
        (m, s, s) windows.
    start
        (m, 2) start values of the places.
    linear
        (m, 2, 2) start values of the maps.
    half
        Half the patch's side.
    steps
        Largest number of iterations.
    bell
        Middle (2,) of the weights in the patch, and the distance from it at which they have fallen
        to 0.14; by default the patch's own middle and half side.
    """
    system = _system(fixed, half, *(bell or (np.zeros(2), float(half))))
    everyone = np.arange(len(start))
    place, linear = start.copy(), linear.copy()
    value, _ = _sampled(moving, everyone, place, linear, system)
    # Normal equations of the fixed patch, formed once; pull is the weight of the prior on the map.
    inverse, pull = _inverse(system, compute_residual_variance(system, value, 2))
    gain = inverse @ (system.by * system.weight)
    active = everyone
    for step in range(steps):
        if step:
            value, _ = _sampled(moving, active, place, linear, system)
        changed = (linear[active] - np.eye(2)).reshape(-1, 4)
        delta = (gain[active] @ (value - system.value[active])[..., None])[..., 0]
        delta += pull[active, None] * (inverse[active][..., 2:] @ changed[..., None])[..., 0]
        # Inverse composition: the update of the fixed patch is inverted and applied to the moving
        # one.
        back = np.linalg.inv(np.eye(2) + delta[:, 2:].reshape(-1, 2, 2))
        linear[active] = linear[active] @ back
        move = (linear[active] @ delta[:, :2, None])[..., 0]
        place[active] -= move
        size = np.hypot(*move.T)
        near = np.hypot(*(place[active] - start[active]).T) < _MAX_SHIFT
        active = active[(size > _CONVERGED) & near & np.isfinite(size)]
        if not len(active):
            break
    value, contrast = _sampled(moving, everyone, place, linear, system)
    return PatchFits(
        place=place,
        linear=linear,
        likeness=(value * system.value) @ system.weight / system.weight.sum(),
        gain=contrast / system.contrast,
        fixed=system,
        value=value,
    )


def compute_residual_variance(system: System, value: Floats, unknowns: int) -> Floats:
    """Compute the variance (m,) of the residuals between the fixed patches and others (m, k).

    It is at least that of rounding to whole grey values.

    Parameters
    ----------
    system
        Fixed patches.
    value
        Values of the other patches, normalised alike.
    unknowns
        Number of parameters fitted to both.
    """
    weight = system.weight
    # Effective number of pixels of the weighted sum.
    number = weight.sum() ** 2 / (weight**2).sum()
    rest = (value - system.value) ** 2 @ weight / weight.sum() * number / (number - unknowns)
    return np.asarray(np.maximum(rest, (_ROUNDING / system.contrast) ** 2))


def _inverse(system: System, noise: Floats) -> tuple[Floats, Floats]:
    """Compute inverse normal equations (m, 6, 6) with the prior of the map, and its weight (m,)."""
    normal = (system.by * system.weight) @ np.swapaxes(system.by, 1, 2)
    normal += (1e-9 * np.trace(normal, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(6)
    pull = noise / CHANGE_SIGMA**2
    normal += pull[:, None, None] * MAP_PRIOR
    return np.asarray(np.linalg.inv(normal), np.float64), pull


def _system(fixed: Grey, half: int, middle: Floats, wide: float) -> System:
    steps = make_grid(half)
    weight: Floats = np.exp(-2.0 * ((steps - middle) ** 2).sum(axis=1) / wide**2)
    middle = fixed.shape[1] // 2
    cut = slice(middle - half - 1, middle + half + 2)
    patch = fixed[:, cut, cut].astype(np.float64)
    slope = np.stack(compute_slopes(patch), axis=1).reshape(len(fixed), 2, len(steps))
    value, contrast = _normalised(patch[:, 1:-1, 1:-1].reshape(len(fixed), -1), weight)
    slope /= contrast[:, None, None]
    by = np.concatenate([slope, *(slope[:, [i]] * steps.T for i in range(2))], axis=1)
    # Eliminate brightness and contrast: project their effects out of the derivatives.
    by -= (by @ weight / weight.sum())[..., None]
    by -= (by @ (weight * value)[..., None] / weight.sum()) * value[:, None]
    return System(steps, weight, value, contrast, by)


def _sampled(
    moving: Grey, index: Ints, place: Floats, linear: Floats, system: System
) -> tuple[Floats, Floats]:
    """Resample moving windows at mapped grids; return normalised values and contrasts."""
    side = moving.shape[1]
    at = system.grid @ np.swapaxes(linear[index], 1, 2) + place[index][:, None] + side // 2
    at = np.clip(at, 0.0, side - 1.0)
    out = np.empty(at.shape[:2])
    block = _MOST_ROWS // side
    for first in range(0, len(index), block):
        u, v = np.moveaxis(at[first : first + block].astype(np.float32), -1, 0)
        tall = moving[index[first : first + block]].reshape(-1, side)
        v = v + np.arange(len(v), dtype=np.float32)[:, None] * side
        out[first : first + block] = sample_grey(tall, u, v, cv2.INTER_LANCZOS4)
    return _normalised(out, system.weight)


def _normalised(value: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Normalise values (m, k) to weighted mean 0 and variance 1; return also (m,) deviations."""
    total = weight.sum()
    centred: Floats = value - (value @ weight / total)[:, None]
    deviation: Floats = np.sqrt(centred**2 @ weight / total) + 1e-6
    return centred / deviation[:, None], deviation
