"""Corners of a plate from a fit of its whole picture to the grey values of a photo.

The grey value of a pixel is ``black + contrast share`` with `share` of `picture.render`. The
contrast varies linearly over the plate (oblique sun, vignetting) and is multiplied by shadows
across the plate; shadows are searched for where the fit without them is poor. Parameters that enter
linearly are eliminated in each step (variable projection: Golub and Pereyra 1973, with Kaufman's
derivative), so that only corners, blur and shadow edges are iterated.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavgram.imaging.patch_fit import Fit, estimate_neighbour_correlation, fit_windows
from uavgram.imaging.plates.picture import (
    Picture,
    Window,
    apply_homography,
    fit_homography,
    invert_homography,
    render_plate,
)
from uavgram.imaging.plates.shadow import LOG_SOFT_BOUNDS, Edge, find_likely_edges, render_edges
from uavgram.model.arrays import Bools, Floats, Ints

FIRST_BLUR_PX = 0.8
_BLUR_BOUNDS_PX = (0.3, 3.0)
_CLEAR_BLURS = 2.0  # blurs between the used pixels and the surroundings of the white margin
_LEAST_CLEAR = 0.15  # cells
_OUTLIER = 4.0
_ROUNDS = (8, 12)  # with the start weights, and with those from the residuals
_FIRST_DAMPING = 1e-4  # derivatives are approximate: more damped steps would stop too early
_PLAIN_PARAMETERS = 5  # linear unknowns without shadows

_CORRELATED_RESIDUALS = 0.35
"""Correlation of neighbouring residuals above which a shadow across the plate is likely."""

_BETTER = 0.8
"""Largest ratio of the residuals with a shadow's edge to those without, to accept the edge."""

MAX_SHADOW_EDGES = 2


@dataclass(frozen=True, eq=False)
class PlateFit:
    """Fitted plate.

    Attributes
    ----------
    corner_px
        (4, 2).
    covariance_px2
        (8, 8) of u and v of the corners in their order: for white noise of the residuals' size.
    blur_px
        Standard deviation of the blur.
    contrast
        Grey values from black to white, outside shadows.
    rms
        Root mean square of the residuals [grey values].
    residual_correlation
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
    residual_correlation: float
    agreement: float
    edges: tuple[Edge, ...] = field(default=())
    residual: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    weight: Floats = field(default_factory=lambda: np.zeros((0, 0)))


class PlateModel:
    """Model of a window's grey values by corners, blur and shadow edges."""

    def __init__(
        self, grey: Floats, window: Window, cells: Bools, weight: Floats, middle: Floats
    ) -> None:
        self.grey, self.window, self.cells = grey, window, cells
        self.root = np.sqrt(weight).ravel()
        away = window.pixels - middle
        self.slope = away / max(window.width, window.height)

    def columns(self, picture: Picture, shade: Floats) -> Floats:
        """Build the (h, w, m) base functions of which the grey values are a linear combination."""
        share = picture.share
        u, v = np.moveaxis(self.slope, -1, 0)
        plain = np.ones_like(share), share, share * u, share * v, 4.0 * share * (1.0 - share)
        return np.stack([*plain, *shade, *(shade * share)], axis=-1)

    def residuals(self, state: Floats, _: Ints) -> tuple[Floats, Floats]:
        """Compute residuals (1, k) of a picture (1, p), and their derivatives (1, p, k)."""
        value = state[0]
        picture = render_plate(self.cells, value[:8].reshape(4, 2), float(value[8]), self.window)
        shade, by_edge = render_edges(value[9:], self.window)
        base = self.columns(picture, shade)
        weighted = base.reshape(-1, base.shape[-1]) * self.root[:, None]
        target = self.grey.ravel() * self.root
        # Linear parameters by QR; the derivatives are projected to their complement (Kaufman).
        q, r = np.linalg.qr(weighted)
        linear = np.linalg.lstsq(r, q.T @ target, rcond=None)[0]
        black, contrast = linear[_PLAIN_PARAMETERS:].reshape(
            2, -1, 1, 1
        )  # changes of black and contrast in shadows
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
        Position of the window in the photo.
    cells
        (n, n) of the plate.
    corner_px
        (4, 2) start values of the corners, to a pixel or so.
    edges
        Approximate shadow edges across it.

    Returns
    -------
    PlateFit or None
        None where the fit does not converge near the start values.
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
        # Robust weights (Huber) from the median residual, for the second round.
        scale = 1.4826 * np.median(np.abs(raw[used > 0])) + 0.3
        fresh = plate_weights(window, corner, len(cells), float(value[8]))
        weight = fresh / np.maximum(1.0, np.abs(raw) / (_OUTLIER * scale))
    return _described(model, fit, used)


def fit_with_shadows(
    grey: Floats, window: Window, cells: Bools, corner_px: Floats
) -> PlateFit | None:
    """Fit a plate, with shadow edges across it where the fit without them is poor.

    Parameters
    ----------
    grey, window, cells, corner_px
        As for `fit_plate`.
    """
    fitted = fit_plate(grey, window, cells, corner_px)
    if fitted is None:
        return None
    for _ in range(MAX_SHADOW_EDGES):
        if fitted.residual_correlation < _CORRELATED_RESIDUALS:
            break
        picture = render_plate(cells, fitted.corner_px, fitted.blur_px, window)
        weight = plate_weights(window, fitted.corner_px, len(cells), fitted.blur_px)
        model = PlateModel(grey, window, cells, weight, corner_px.mean(axis=0))
        values = np.array(fitted.edges, np.float64).ravel()
        base = model.columns(picture, render_edges(values, window)[0])
        starts = find_likely_edges(grey, base, picture.share, weight)
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
    model.residuals(
        fit.state, np.zeros(1, np.int64)
    )  # evaluate at the accepted state, not at the last trial
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
        residual_correlation=float(
            estimate_neighbour_correlation(raw[None], inside.astype(np.float64)).mean()
        ),
        agreement=agreement,
        edges=tuple(Edge(*one) for one in value[9:].reshape(-1, 3).tolist()),
        residual=raw,
        weight=weight,
    )


def plate_weights(window: Window, corner_px: Floats, count: int, blur_px: float) -> Floats:
    """Weight pixels (h, w) by 1 on the plate and on the white around it, elsewhere by 0.

    White into which its surroundings blur is excluded.

    Parameters
    ----------
    window, corner_px
        As for `fit_plate`.
    count
        Cells along a side.
    blur_px
        Standard deviation of the blur.
    """
    matrix = invert_homography(fit_homography(corner_px))
    place = count * apply_homography(matrix, window.pixels)
    # change of the plate coordinates per pixel, by central differences
    ahead = count * apply_homography(matrix, window.pixels + np.array([0.5, 0.0])) - place
    down = count * apply_homography(matrix, window.pixels + np.array([0.0, 0.5])) - place
    step = 2.0 * np.hypot(ahead, down)
    clear = np.maximum(1.0 - _CLEAR_BLURS * np.hypot(blur_px, 0.3) * step, _LEAST_CLEAR)
    outside = np.maximum(-place, place - count)
    return np.asarray((outside <= clear).all(axis=-1), np.float64)
