"""Corners of a plate by a fit of its whole picture to the grey values of a photo.

The grey value of a pixel is ``black + contrast share`` with `share` of `picture.render`, the
contrast running evenly over the plate (the sun stands aslant, lenses darken), times a shadow where
one lies across it. What depends linearly is eliminated in each step (Golub and Pereyra 1973, with
Kaufman's derivative), so that only corners, blur and the places of shadow edges are sought.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from uavgram.imaging.plates.picture import (
    Picture,
    Window,
    homography,
    inverse_of,
    mapped,
    render,
)
from uavgram.imaging.plates.shadow import LOG_SOFT_BOUNDS, Edge, edge_pictures
from uavgram.model.arrays import Bools, Floats

FIRST_BLUR_PX = 0.8
_BLUR_BOUNDS_PX = (0.3, 3.0)
_CLEAR_BLURS = 2.0  # of what lies around the white margin, so much is kept away
_OUTLIER = 4.0
_EVALUATIONS = (8, 12)  # with the weights of the start, and with those of its residuals
_PLAIN = 5  # linear unknowns without shadows


@dataclass(frozen=True, eq=False)
class PlateFit:
    """A plate as it was fitted.

    Attributes
    ----------
    corner_px
        (4, 2).
    covariance_px2
        (8, 8) of u and v of the corners in their order: of white noise as large as the residuals.
    blur_px
        Standard deviation of the blur.
    contrast
        Grey values from black to white, where no shadow lies.
    rms
        Of the residuals [grey values].
    runs_on
        Correlation of a residual with its neighbours: 0 for white noise.
    agreement
        Correlation of the picture with the grey values.
    edges
        Shadow edges across the plate.
    """

    corner_px: Floats
    covariance_px2: Floats
    blur_px: float
    contrast: float
    rms: float
    runs_on: float
    agreement: float
    edges: tuple[Edge, ...] = field(default=())
    residual: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    weight: Floats = field(default_factory=lambda: np.zeros((0, 0)))


class PlateModel:
    """Grey values of a window by corners, blur and shadow edges."""

    def __init__(
        self, grey: Floats, window: Window, cells: Bools, weight: Floats, middle: Floats
    ) -> None:
        self.grey, self.window, self.cells = grey, window, cells
        self.root = np.sqrt(weight).ravel()
        away = window.pixels - middle
        self.slope = away / max(window.width, window.height)
        self._last: tuple[bytes, Floats, Floats] | None = None

    def columns(self, picture: Picture, shade: Floats) -> list[Floats]:
        """What the grey values are a sum of."""
        share = picture.share
        base = [np.ones_like(share), share, share * self.slope[..., 0], share * self.slope[..., 1]]
        base.append(4.0 * share * (1.0 - share))
        for one in shade:
            base += [one, one * share]
        return base

    def _both(self, value: Floats) -> tuple[Floats, Floats]:
        key = value.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1:]
        result = self._evaluated(value)
        self._last = (key, *result)
        return result

    def residual(self, value: Floats) -> Floats:
        """What the grey values miss, weighted."""
        return self._both(value)[0]

    def jacobian(self, value: Floats) -> Floats:
        """Its derivatives."""
        return self._both(value)[1]

    def _evaluated(self, value: Floats) -> tuple[Floats, Floats]:
        picture = render(self.cells, value[:8].reshape(4, 2), float(value[8]), self.window)
        shade, by_edge = edge_pictures(value[9:], self.window)
        base = np.stack([c.ravel() for c in self.columns(picture, shade)], axis=1)
        weighted = base * self.root[:, None]
        target = self.grey.ravel() * self.root
        q, r = np.linalg.qr(weighted)
        linear = np.linalg.lstsq(r, q.T @ target, rcond=None)[0]
        residual = weighted @ linear - target
        strength = (
            linear[1] + self.slope @ linear[2:4] + 4.0 * linear[4] * (1.0 - 2.0 * picture.share)
        )
        for k, one in enumerate(shade):
            strength = strength + linear[_PLAIN + 1 + 2 * k] * one
        jacobian = np.empty((residual.size, len(value)))
        jacobian[:, :8] = (picture.by_corner * strength[..., None]).reshape(-1, 8)
        jacobian[:, 8] = (picture.by_blur * strength).ravel()
        for k in range(len(shade)):
            change = linear[_PLAIN + 2 * k] + linear[_PLAIN + 1 + 2 * k] * picture.share
            place = 9 + by_edge.shape[-1] * k
            block = by_edge[k] * change[..., None]
            jacobian[:, place : place + block.shape[-1]] = block.reshape(residual.size, -1)
        jacobian *= self.root[:, None]
        jacobian -= q @ (q.T @ jacobian)
        self.linear = linear
        self.picture = picture
        return residual, jacobian


def fit_plate(
    grey: Floats,
    window: Window,
    cells: Bools,
    corner_px: Floats,
    *,
    edges: tuple[Edge, ...] = (),
    blur_px: float = FIRST_BLUR_PX,
    margin: float = 1.0,
) -> PlateFit | None:
    """Fit a plate to a window of a photo.

    Parameters
    ----------
    grey
        (height, width) of the window.
    window
        Where it lies in the photo.
    cells
        (n, n) of the plate.
    corner_px
        (4, 2) first corners, to a pixel or so.
    edges
        Shadow edges that lie across it, roughly.
    blur_px
        First blur.
    margin
        Width of the white around the black square, in cells.

    Returns
    -------
    PlateFit or None
        None where no fit comes to an end near the first corners.
    """
    value = np.concatenate([corner_px.ravel(), [blur_px], *(edge.values for edge in edges)])
    weight = plate_weights(window, corner_px, len(cells), margin, blur_px)
    fitted = None
    for evaluations in _EVALUATIONS:
        model = PlateModel(grey, window, cells, weight, corner_px.mean(axis=0))
        lower, upper = np.full(len(value), -np.inf), np.full(len(value), np.inf)
        lower[8], upper[8] = _BLUR_BOUNDS_PX
        lower[11::3], upper[11::3] = LOG_SOFT_BOUNDS
        value = np.clip(value, lower + 0.01, upper - 0.01)
        found = least_squares(
            model.residual,
            value,
            model.jacobian,
            (lower, upper),
            xtol=1e-6,
            ftol=1e-8,
            max_nfev=evaluations,
        )
        value = found.x
        corner = value[:8].reshape(4, 2)
        side = np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).min()
        if np.abs(corner - corner_px).max() > max(2.0, 0.15 * side):
            return None
        residual, jacobian = model.residual(value), model.jacobian(value)
        fitted = _described(model, value, weight, residual, jacobian, edges)
        raw = _raw(residual, weight)
        scale = 1.4826 * np.median(np.abs(raw[weight > 0])) + 0.3
        fresh = plate_weights(window, corner, len(cells), margin, float(value[8]))
        weight = fresh / np.maximum(1.0, np.abs(raw) / (_OUTLIER * scale))
    return fitted


def _raw(residual: Floats, weight: Floats) -> Floats:
    root = np.sqrt(weight)
    return np.divide(residual.reshape(weight.shape), root, out=np.zeros_like(root), where=root > 0)


def _described(
    model: PlateModel,
    value: Floats,
    weight: Floats,
    residual: Floats,
    jacobian: Floats,
    edges: tuple[Edge, ...],
) -> PlateFit:
    count = max(float((weight > 0).sum()) - jacobian.shape[1] - len(model.linear), 1.0)
    variance = float(residual @ residual) / count
    normal = jacobian.T @ jacobian
    covariance = np.linalg.pinv(normal, hermitian=True)[:8, :8] * variance
    raw = _raw(residual, weight)
    inside = weight > 0
    grey = model.grey[inside]
    picture = grey + raw[inside]
    agreement = float(np.corrcoef(picture, grey)[0, 1]) if np.ptp(grey) > 0 else 0.0
    k = len(value[9:]) // max(len(edges), 1)
    return PlateFit(
        corner_px=value[:8].reshape(4, 2),
        covariance_px2=covariance,
        blur_px=float(value[8]),
        contrast=float(model.linear[1]),
        rms=variance**0.5,
        runs_on=_runs_on(raw, inside),
        agreement=agreement,
        edges=tuple(Edge(*value[9 + k * i : 9 + k * i + k]) for i in range(len(edges))),
        residual=raw,
        weight=weight,
    )


def _runs_on(raw: Floats, inside: Bools) -> float:
    """Mean correlation of residuals with the next ones along rows and columns."""
    pairs = [
        (raw[:, :-1], raw[:, 1:], inside[:, :-1] & inside[:, 1:]),
        (raw[:-1], raw[1:], inside[:-1] & inside[1:]),
    ]
    products = sum(float((a * b)[both].sum()) for a, b, both in pairs)
    squares = sum(float((a * a + b * b)[both].sum()) / 2 for a, b, both in pairs)
    return products / squares if squares > 0 else 0.0


def plate_weights(
    window: Window, corner_px: Floats, count: int, margin: float, blur_px: float
) -> Floats:
    """(h, w) 1 on the plate and its margin, as far as nothing blurs into it from around.

    Parameters
    ----------
    window, corner_px
        As of `fit_plate`.
    count
        Cells along a side.
    margin, blur_px
        Width of the white, in cells; the blur.
    """
    matrix = inverse_of(homography(corner_px))
    place = count * mapped(matrix, window.pixels)
    # a projective coordinate's step per pixel, at the middle of the plate: the margin is narrow
    ahead = count * mapped(matrix, window.pixels + np.array([0.5, 0.0])) - place
    down = count * mapped(matrix, window.pixels + np.array([0.0, 0.5])) - place
    step = 2.0 * np.hypot(ahead, down)
    clear = margin - _CLEAR_BLURS * np.hypot(blur_px, 0.3) * step
    clear = np.maximum(clear, 0.15 * margin)
    outside = np.maximum(-place, place - count)
    return np.asarray((outside <= clear).all(axis=-1), np.float64)
