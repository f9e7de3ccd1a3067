"""Small windows of photos: resampling, slopes, and least-squares fits of grey-value models.

Parts of two photos that are compared pixel by pixel are resampled to one geometry. Its axes are
those in which one photo is a stretched picture of the other (the singular vectors of the affine
map), and along each axis the steps are the pixels of the coarser photo. So nothing is interpolated
between coarse pixels, and the finer photo is smoothed before pixels are left out.

Many windows are fitted at once, each with its own damping (Levenberg 1944, Marquardt 1963); windows
that have converged drop out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

Grey = NDArray[np.float32]
Real = TypeVar("Real", np.float32, np.float64)

_BLUR_PX = 0.7  # blur of a photo: lens, pixel and demosaicing together
_FINE_ENOUGH = 1.15  # steps up to this are sampled without smoothing
_MOST_ROWS = 30000  # of a map for OpenCV's resampling


def make_grid(reach: int) -> Floats:
    """Return the ((2 reach + 1)^2, 2) steps about a pixel."""
    side = np.arange(-reach, reach + 1.0)
    return np.asarray(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2))


def sample_grey(
    photo: Image | Grey, u_px: Floats | Grey, v_px: Floats | Grey, kernel: int = cv2.INTER_CUBIC
) -> Grey:
    """Resample grey values (n, k) at places, to 1/32 px; edge values continue outside the photo.

    Parameters
    ----------
    photo
        (height, width).
    u_px, v_px
        (n, k).
    kernel
        OpenCV's interpolation.
    """
    u, v = (np.ascontiguousarray(one, np.float32) for one in (u_px, v_px))
    out = np.empty(u.shape, photo.dtype)
    for first in range(0, len(u), _MOST_ROWS):
        some = slice(first, first + _MOST_ROWS)
        cv2.remap(photo, u[some], v[some], kernel, out[some], cv2.BORDER_REPLICATE)
    return out.astype(np.float32, copy=False)


def compute_slopes(grey: NDArray[Real]) -> tuple[NDArray[Real], NDArray[Real]]:
    """Compute central differences (n, h - 2, w - 2) of grey values (n, h, w) along u and v."""
    across = 0.5 * (grey[:, 1:-1, 2:] - grey[:, 1:-1, :-2])
    down = 0.5 * (grey[:, 2:, 1:-1] - grey[:, :-2, 1:-1])
    return across, down


class Frames(NamedTuple):
    """Derivatives (n, 2, 2) of both photos' pixels by steps of the common window."""

    source: Floats
    target: Floats


def compute_common_frames(affine: Floats) -> Frames:
    """Compute the windows' axes for maps (n, 2, 2), d target pixel / d source pixel."""
    u, stretch, vt = np.linalg.svd(affine)
    source = np.swapaxes(vt, 1, 2) * np.maximum(1.0, 1.0 / stretch)[:, None]
    target = u * np.maximum(1.0, stretch)[:, None]
    # Turn the axes so that the source stays upright: then squares of all pairs cover the same
    # surroundings.
    turn = _nearest_turn(vt)
    return Frames(source @ turn, target @ turn)


def _nearest_turn(vt: Floats) -> Floats:
    """Find the quarter turns and flips that bring axes (n, 2, 2) nearest to upright."""
    swap = np.abs(vt[:, 0, 0]) < np.abs(vt[:, 0, 1])
    turn = np.where(swap[:, None, None], np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(2))
    upright = np.swapaxes(vt, 1, 2) @ turn
    sign = np.sign(np.diagonal(upright, axis1=1, axis2=2))
    return np.asarray(turn * np.where(sign == 0, 1.0, sign)[:, None])


def is_within_photo(photo: Image, center_px: Floats, frame: Floats, half: int) -> Bools:
    """Mark the windows (n,) that are completely within a photo.

    Parameters
    ----------
    photo
        (height, width).
    center_px
        (n, 2) centres of the windows.
    frame
        (n, 2, 2) pixels by steps.
    half
        Half a window's side, in steps.
    """
    far = np.abs(frame).sum(axis=2) * half + 1.0
    edge = np.array(photo.shape[1::-1]) - 1.0
    return np.asarray(((center_px - far >= 0) & (center_px + far <= edge)).all(axis=1))


def sample_window(
    photo: Image, center_px: Floats, frame: Floats, half: int, *, exact: bool = True
) -> Grey:
    """Resample grey values (2 half + 1, 2 half + 1) about a place; edge values continue outside.

    Parameters
    ----------
    photo
        (height, width).
    center_px
        (2,) centre of the window.
    frame
        (2, 2) pixels by steps; its columns are perpendicular.
    half
        Half the window's side, in steps.
    exact
        Whether to use Lanczos' kernel, instead of bilinear interpolation for a search.
    """
    length = np.hypot(frame[0], frame[1])
    # Coarse steps: sample at a fraction of a step, smooth by a Gaussian, then take every p-th
    # value.
    parts = np.maximum(np.ceil(length - _FINE_ENOUGH + 1.0), 1.0).astype(int)
    spread = _BLUR_PX * np.sqrt(np.maximum(length**2 - 1.0, 0.0)) * parts / length
    wide = np.where(parts > 1, np.ceil(3.0 * spread), 0.0).astype(int)
    x, y = (
        (np.arange(2 * (half * p + w) + 1) - float(half * p + w)).astype(np.float32) / np.float32(p)
        for p, w in zip(parts, wide, strict=True)
    )
    corner = np.floor(center_px - np.abs(frame) @ [x[-1], y[-1]]).astype(int) - 5
    beyond = np.ceil(center_px + np.abs(frame) @ [x[-1], y[-1]]).astype(int) + 6
    corner, beyond = np.maximum(corner, 0), np.minimum(beyond, photo.shape[1::-1])
    if (beyond <= corner).any():
        return np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    part = photo[corner[1] : beyond[1], corner[0] : beyond[0]].astype(np.float32)
    f, at = frame.astype(np.float32), (center_px - corner).astype(np.float32)
    u = (at[0] + f[0, 0] * x) + f[0, 1] * y[:, None]
    v = (at[1] + f[1, 0] * x) + f[1, 1] * y[:, None]
    kernel = cv2.INTER_LANCZOS4 if exact else cv2.INTER_LINEAR
    dense = sample_grey(part, u, v, kernel)
    if (parts > 1).any():
        bells = [_bell(s, int(w)) for s, w in zip(spread, wide, strict=True)]
        dense = np.asarray(cv2.sepFilter2D(dense, -1, bells[0], bells[1]), np.float32)
        dense = dense[wide[1] : dense.shape[0] - wide[1], wide[0] : dense.shape[1] - wide[0]]
    return np.ascontiguousarray(dense[:: parts[1], :: parts[0]], np.float32)


def _bell(sigma: float, wide: int) -> Grey:
    if not wide:
        return np.ones(1, np.float32)
    bell = np.exp(-0.5 * (np.arange(-wide, wide + 1) / sigma) ** 2)
    return np.asarray(bell / bell.sum(), np.float32)


Model = Callable[[Floats, Ints], tuple[Floats, Floats]]
"""Weighted residuals (n, k) of windows and their derivatives (n, p, k).

Arguments are the states (n, p) and the indices (n,) of the windows.
"""

_ROUNDS = 15
_CONVERGED_PX = 1e-3  # steps shrink fast: the next one would be far smaller
_MOST_DAMPING = 1e8
_MOST_CORRELATION = 0.9


class Fit(NamedTuple):
    """Fitted windows.

    Attributes
    ----------
    state
        (n, p) parameters.
    residual
        (n, k) weighted residuals.
    normal
        (n, p, p) normal matrix; singular where a window does not determine all parameters.
    """

    state: Floats
    residual: Floats
    normal: Floats

    @property
    def cost(self) -> Floats:
        """(n,) sum of the squared residuals."""
        return np.asarray((self.residual**2).sum(axis=1))

    @property
    def inverse(self) -> Floats:
        """(n, p, p) inverse normal matrix."""
        return np.asarray(np.linalg.inv(_regular(self.normal, np.zeros(len(self.normal)))))


def fit_windows(
    model: Model,
    start: Floats,
    *,
    bounds: tuple[Floats, Floats] | None = None,
    damping: float = 1e-2,
    places: int = 2,
    rounds: int = _ROUNDS,
) -> Fit:
    """Fit a model to windows.

    Parameters
    ----------
    model
        Residuals and derivatives; a window is given up where they are not finite, and its cost is
        not finite.
    start
        (n, p) start values of the states.
    bounds
        Least and largest value (p,) of the parameters.
    damping
        Damping of the first step; with 0 all steps are Gauss-Newton steps, taken whether the cost
        falls or not.
    places
        Number of leading parameters that are pixel coordinates: the others follow them, so a window
        has converged when these no longer move.
    rounds
        Largest number of steps.
    """
    state = start.copy()
    residual, jacobian = model(state, np.arange(len(state)))
    normal, gradient = _equations(residual, jacobian)
    cost = (residual**2).sum(axis=1)
    damped = np.full(len(state), damping)
    active = np.flatnonzero(np.isfinite(cost))
    for _ in range(rounds):
        if not len(active):
            break
        # Damped normal equations: (N + damping diag N) step = gradient.
        regular = _regular(normal[active], damped[active])
        step = np.linalg.solve(regular, gradient[active, :, None])[..., 0]
        trial = state[active] - step
        if bounds is not None:
            trial = trial.clip(*bounds)
        remains, jacobian = model(trial, active)
        after = (remains**2).sum(axis=1)
        # Accept steps that reduce the cost; otherwise increase the damping.
        better = ~((after >= cost[active]) & (damped[active] > 0))
        damped[active] *= np.where(better, 0.1, 10.0)
        taken = active[better]
        state[taken], cost[taken], residual[taken] = trial[better], after[better], remains[better]
        equations = _equations(remains, jacobian)
        normal[taken], gradient[taken] = (part[better] for part in equations)
        small = np.abs(step[:, :places]).max(axis=1) < _CONVERGED_PX
        active = active[~small & np.isfinite(after) & (damped[active] < _MOST_DAMPING)]
    return Fit(state, residual, normal)


def estimate_neighbour_correlation(residual: Floats, root: Floats) -> Floats:
    """Compute correlations (2, n) of residuals with neighbours along rows and columns, 0 to 0.9.

    Parameters
    ----------
    residual
        (n, h, w), each times the root of its weight.
    root
        (h, w) or (n, h, w) these roots; 0 where not used.
    """
    axes = (-2, -1)
    variance = np.maximum((residual**2).sum(axis=axes), 1e-12) / np.maximum(
        (root**2).sum(axis=axes), 1.0
    )
    here = np.s_[..., :-1], np.s_[..., :-1, :]
    following = np.s_[..., 1:], np.s_[..., 1:, :]
    alike = [
        (residual[a] * residual[b]).sum(axis=axes)
        / np.maximum((root[a] * root[b]).sum(axis=axes), 1.0)
        for a, b in zip(here, following, strict=True)
    ]
    return np.asarray((np.stack(alike) / variance).clip(0.0, _MOST_CORRELATION))


def compute_variance_growth(correlation: Floats) -> Floats:
    """Compute the growth (n,) of a mean's variance by correlations (2, n) of neighbours.

    It is the sum of all correlations of a first-order process along rows and along columns.
    """
    return np.asarray(((1.0 + correlation) / (1.0 - correlation)).prod(axis=0))


def _equations(residual: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
    """Form normal matrices (n, p, p) and gradients (n, p)."""
    normal = jacobian @ np.swapaxes(jacobian, 1, 2)
    return normal, (jacobian @ residual[..., None])[..., 0]


def _regular(normal: Floats, damping: Floats) -> Floats:
    """Damp the diagonal of normal matrices; regular also where a window has no texture."""
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    floor = 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-12
    more = damping[:, None] * diagonal + floor
    return np.asarray(normal + more[..., None] * np.eye(normal.shape[1]))
