"""Corners of a plate by a fit of its whole picture to the grey values of a photo.

The grey value of a pixel is ``black + contrast share`` with `share` of `picture.render`, the
contrast running evenly over the plate (the sun stands aslant, lenses darken), times a shadow where
one lies across it; shadows are sought where a plate does not fit without. What depends linearly is
eliminated in each step (Golub and Pereyra 1973, with Kaufman's derivative), so that only corners,
blur and the places of shadow edges are sought.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavgram.imaging.patch_fit import Fit, fit_windows, neighbour_correlation
from uavgram.imaging.plates.picture import (
    Picture,
    Window,
    homography,
    inverse_of,
    mapped,
    render,
)
from uavgram.imaging.plates.shadow import LOG_SOFT_BOUNDS, Edge, edge_pictures, likeliest_edges
from uavgram.model.arrays import Bools, Floats, Ints

FIRST_BLUR_PX = 0.8
_BLUR_BOUNDS_PX = (0.3, 3.0)
_CLEAR_BLURS = 2.0  # of what lies around the white margin, so much is kept away
_LEAST_CLEAR = 0.15  # cells
_OUTLIER = 4.0
_ROUNDS = (8, 12)  # with the weights of the start, and with those of its residuals
_FIRST_DAMPING = 1e-4  # derivatives are not exact: steps that are damped more end sooner
_PLAIN = 5  # linear unknowns without shadows

_RUNS_ON = 0.35
"""Residuals that go together more than this show something that lies across the plate."""

_BETTER = 0.8
"""A shadow's edge must make the residuals this much smaller."""

MOST_EDGES = 2


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

    def columns(self, picture: Picture, shade: Floats) -> Floats:
        """(h, w, m) what the grey values are a sum of."""
        share = picture.share
        u, v = np.moveaxis(self.slope, -1, 0)
        plain = np.ones_like(share), share, share * u, share * v, 4.0 * share * (1.0 - share)
        return np.stack([*plain, *shade, *(shade * share)], axis=-1)

    def residuals(self, state: Floats, _: Ints) -> tuple[Floats, Floats]:
        """What a picture (1, p) misses of the grey values (1, k), and its derivatives (1, p, k)."""
        value = state[0]
        picture = render(self.cells, value[:8].reshape(4, 2), float(value[8]), self.window)
        shade, by_edge = edge_pictures(value[9:], self.window)
        base = self.columns(picture, shade)
        weighted = base.reshape(-1, base.shape[-1]) * self.root[:, None]
        target = self.grey.ravel() * self.root
        q, r = np.linalg.qr(weighted)
        linear = np.linalg.lstsq(r, q.T @ target, rcond=None)[0]
        black, contrast = linear[_PLAIN:].reshape(2, -1, 1, 1)  # of what the shadows change
        strength = (
            linear[1] + self.slope @ linear[2:4] + 4.0 * linear[4] * (1.0 - 2.0 * picture.share)
        )
        strength += (contrast * shade).sum(axis=0)
        by_edge *= (black + contrast * picture.share)[..., None]
        by = np.concatenate(
            [
                picture.by_corner * strength[..., None],
                (picture.by_blur * strength)[..., None],
                *by_edge,
            ],
            axis=-1,
        ).reshape(-1, len(value))
        by *= self.root[:, None]
        by -= q @ (q.T @ by)
        self.linear = linear
        return (weighted @ linear - target)[None], by.T[None]


def fit_plate(
    grey: Floats,
    window: Window,
    cells: Bools,
    corner_px: Floats,
    edges: tuple[Edge, ...] = (),
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

    Returns
    -------
    PlateFit or None
        None where no fit comes to an end near the first corners.
    """
    value = np.concatenate([corner_px.ravel(), [FIRST_BLUR_PX], *edges])
    weight = plate_weights(window, corner_px, len(cells), FIRST_BLUR_PX)
    lower, upper = np.full(len(value), -np.inf), np.full(len(value), np.inf)
    lower[8], upper[8] = _BLUR_BOUNDS_PX
    lower[11::3], upper[11::3] = LOG_SOFT_BOUNDS
    for rounds in _ROUNDS:
        used = weight
        model = PlateModel(grey, window, cells, used, corner_px.mean(axis=0))
        fit = fit_windows(
            model.residuals,
            value[None],
            bounds=(lower, upper),
            places=8,
            damping=_FIRST_DAMPING,
            rounds=rounds,
        )
        value = fit.state[0]
        corner = value[:8].reshape(4, 2)
        side = np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).min()
        if np.abs(corner - corner_px).max() > max(2.0, 0.15 * side):
            return None
        raw = _raw(fit.residual, used)
        scale = 1.4826 * np.median(np.abs(raw[used > 0])) + 0.3
        fresh = plate_weights(window, corner, len(cells), float(value[8]))
        weight = fresh / np.maximum(1.0, np.abs(raw) / (_OUTLIER * scale))
    return _described(model, fit, used)


def fit_with_shadows(
    grey: Floats, window: Window, cells: Bools, corner_px: Floats
) -> PlateFit | None:
    """Fit a plate, and the edges of shadows across it where it does not fit without.

    Parameters
    ----------
    grey, window, cells, corner_px
        As of `fit_plate`.
    """
    fitted = fit_plate(grey, window, cells, corner_px)
    if fitted is None:
        return None
    for _ in range(MOST_EDGES):
        if fitted.runs_on < _RUNS_ON:
            break
        picture = render(cells, fitted.corner_px, fitted.blur_px, window)
        weight = plate_weights(window, fitted.corner_px, len(cells), fitted.blur_px)
        model = PlateModel(grey, window, cells, weight, corner_px.mean(axis=0))
        values = np.array(fitted.edges, np.float64).ravel()
        base = model.columns(picture, edge_pictures(values, window)[0])
        starts = likeliest_edges(grey, base, picture.share, weight)
        fits = [fit_plate(grey, window, cells, corner_px, (*fitted.edges, one)) for one in starts]
        shadowed = min((one for one in fits if one), key=lambda one: one.rms, default=None)
        if shadowed is None or shadowed.rms > _BETTER * fitted.rms:
            break
        fitted = shadowed
    return fitted


def _raw(residual: Floats, weight: Floats) -> Floats:
    root = np.sqrt(weight)
    return np.divide(residual.reshape(weight.shape), root, out=np.zeros_like(root), where=root > 0)


def _described(model: PlateModel, fit: Fit, weight: Floats) -> PlateFit:
    value = fit.state[0]
    model.residuals(fit.state, np.zeros(1, np.int64))  # its sum, not that of the last trial
    count = max(float((weight > 0).sum()) - len(value) - len(model.linear), 1.0)
    variance = float(fit.cost[0]) / count
    raw = _raw(fit.residual, weight)
    inside = weight > 0
    grey = model.grey[inside]
    picture = grey + raw[inside]
    agreement = float(np.corrcoef(picture, grey)[0, 1]) if np.ptp(grey) > 0 else 0.0
    return PlateFit(
        corner_px=value[:8].reshape(4, 2),
        covariance_px2=fit.inverse[0, :8, :8] * variance,
        blur_px=float(value[8]),
        contrast=float(model.linear[1]),
        rms=variance**0.5,
        runs_on=float(neighbour_correlation(raw[None], inside.astype(np.float64)).mean()),
        agreement=agreement,
        edges=tuple(Edge(*one) for one in value[9:].reshape(-1, 3).tolist()),
        residual=raw,
        weight=weight,
    )


def plate_weights(window: Window, corner_px: Floats, count: int, blur_px: float) -> Floats:
    """(h, w) 1 on the plate and the white around it, as far as nothing blurs into it from beyond.

    Parameters
    ----------
    window, corner_px
        As of `fit_plate`.
    count
        Cells along a side.
    blur_px
        The blur.
    """
    matrix = inverse_of(homography(corner_px))
    place = count * mapped(matrix, window.pixels)
    # a projective coordinate's step per pixel, at the middle of the plate: the margin is narrow
    ahead = count * mapped(matrix, window.pixels + np.array([0.5, 0.0])) - place
    down = count * mapped(matrix, window.pixels + np.array([0.0, 0.5])) - place
    step = 2.0 * np.hypot(ahead, down)
    clear = np.maximum(1.0 - _CLEAR_BLURS * np.hypot(blur_px, 0.3) * step, _LEAST_CLEAR)
    outside = np.maximum(-place, place - count)
    return np.asarray((outside <= clear).all(axis=-1), np.float64)
