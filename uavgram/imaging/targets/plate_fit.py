"""Corners of a plate from a fit of its whole picture, with blur and shadows, to grey values.

A cell's straight edge, blurred a little, is an error function of the distance from it. The pattern
is drawn that way on a grid twice as fine as the pixels, blurred there by the rest of the photo's
blur, and averaged over each pixel. The picture is then smooth in the plate's corners, and its
derivative by a corner is its gradient times the shift of the pattern with this corner.

The grey value of a pixel is ``black + contrast share`` with the `share` of `render_plate`. The
contrast varies linearly over the plate (oblique sun, vignetting) and is multiplied by shadows
across the plate; shadows are searched for where the fit without them is poor. Parameters that enter
linearly are eliminated in each step (variable projection: Golub and Pereyra 1973, with Kaufman's
derivative), so that only corners, blur and shadow edges are iterated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
from scipy.special import ndtr

from uavgram.imaging.patches import Fit, estimate_neighbour_correlation, fit_windows
from uavgram.model.arrays import Bools, Floats, Ints

FINER = 2
"""Steps of the fine grid per pixel."""

DRAWN_BLUR_PX = 0.3
"""Blur that is drawn, and least blur; the rest is a filter.

A grid of half pixels does not resolve less.
"""

_BLUR_STEP_PX = 0.02
_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0  # exact for polynomials of degree 4
_CORNER_STEP = 1e-4  # of the plate's side
UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Window:
    """Part of a photo: pixel of its first corner, and its size."""

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns in the photo."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)

    @property
    def pixels(self) -> Floats:
        """(height, width, 2) places of its pixels."""
        v, u = np.mgrid[: self.height, : self.width]
        return np.stack([u + self.left, v + self.top], axis=-1).astype(np.float64)

    @property
    def fine_pixels(self) -> Floats:
        """(2 height, 2 width, 2) places of the fine grid."""
        v, u = np.mgrid[: self.height * FINER, : self.width * FINER]
        fine = (np.stack([u, v], axis=-1) + 0.5) / FINER - 0.5
        return np.asarray(fine + np.array([self.left, self.top]), np.float64)


@dataclass(frozen=True, eq=False)
class Picture:
    """Rendered plate.

    Attributes
    ----------
    share
        (height, width) whiteness of each pixel, 0 to 1.
    by_corner
        (height, width, 8) its derivatives by u and v of the four corners [1 / px].
    by_blur
        (height, width) its derivative by the blur [1 / px].
    """

    share: Floats
    by_corner: Floats
    by_blur: Floats


def fit_homography(corner_px: Floats) -> Floats:
    """Compute the (3, 3) homography from the plate to pixels.

    On the plate the first corner is (0, 0), the second (1, 0), the fourth (0, 1).
    """
    x, y = UNIT_SQUARE.T
    u, v = np.asarray(corner_px, np.float64).T
    zero, one = np.zeros(4), np.ones(4)
    # Two linear equations for each corner, with the last element fixed at 1.
    rows_u = np.stack([x, y, one, zero, zero, zero, -x * u, -y * u], axis=1)
    rows_v = np.stack([zero, zero, zero, x, y, one, -x * v, -y * v], axis=1)
    solved = np.linalg.solve(np.vstack([rows_u, rows_v]), np.concatenate([u, v]))
    return np.append(solved, 1.0).reshape(3, 3)


def invert_homography(matrix: Floats) -> Floats:
    """Invert a (3, 3) homography."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def apply_homography(matrix: Floats, place: Floats) -> Floats:
    """Map places (..., 2) by a homography."""
    raw = place @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(raw[..., :2] / raw[..., 2:])


def render_plate(cells: Bools, corner_px: Floats, blur_px: float, window: Window) -> Picture:
    """Draw a plate with white around it.

    Parameters
    ----------
    cells
        (n, n) of the plate, True is white.
    corner_px
        (4, 2) corners of its black square, from the first one on.
    blur_px
        Standard deviation of the blur, without a pixel's own size.
    window
        Pixels to draw.
    """
    matrix = fit_homography(corner_px)
    fine = _draw_plate(cells, invert_homography(matrix), window.fine_pixels)
    blurred = _blur(fine, blur_px)
    slopes = [cv2.filter2D(blurred, -1, kernel) for kernel in (_SLOPE[None], _SLOPE[:, None])]
    gradient = FINER * np.stack(
        [_average_steps(np.asarray(s, np.float64)) for s in slopes], axis=-1
    )
    more = _average_steps(_blur(fine, blur_px + _BLUR_STEP_PX))
    share = _average_steps(blurred)
    moved = _compute_pattern_shifts(matrix, corner_px, window.pixels)
    return Picture(
        share=share,
        by_corner=-np.einsum("vui,vuik->vuk", gradient, moved),
        by_blur=(more - share) / _BLUR_STEP_PX,
    )


def _draw_plate(cells: Bools, inverse: Floats, pixel: Floats) -> Floats:
    """Draw the share of white under a blur of `DRAWN_BLUR_PX`, at any places (h, w, 2) [px]."""
    n = len(cells)
    place = n * apply_homography(inverse, pixel)
    framed = np.pad(cells, 1, constant_values=True).astype(np.float64)
    third = pixel @ inverse[2, :2] + inverse[2, 2]
    across = []
    for axis in (0, 1):
        # gradient of a projective coordinate: (h_axis - place h_third) / third
        slope = (n * inverse[axis, :2] - place[..., axis, None] * inverse[2, :2]) / third[..., None]
        width = DRAWN_BLUR_PX * np.linalg.norm(slope, axis=-1)
        edges = ndtr((place[..., axis, None] - np.arange(n + 1)) / width[..., None])
        ones, zeros = np.ones((*edges.shape[:-1], 1)), np.zeros((*edges.shape[:-1], 1))
        # Each cell's coverage along this axis: difference of the error functions of its edges.
        step = np.concatenate([ones, edges, zeros], axis=-1)
        across.append(step[..., :-1] - step[..., 1:])
    x, y = across
    return np.asarray(((y @ framed) * x).sum(axis=-1))


def _blur(fine: Floats, blur_px: float) -> Floats:
    # the mean of the steps in a pixel is narrower than the pixel by a variance of 1 / (12 FINER^2)
    variance = blur_px**2 - DRAWN_BLUR_PX**2 + 1.0 / (12.0 * FINER**2)
    more = FINER * max(variance, 1e-6) ** 0.5
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), more, borderType=cv2.BORDER_REPLICATE))


def _average_steps(fine: Floats) -> Floats:
    """Average the steps of each pixel."""
    height, width = fine.shape
    steps = fine.reshape(height // FINER, FINER, width // FINER, FINER)
    return np.asarray(steps.mean(axis=(1, 3)), np.float64)


def _compute_pattern_shifts(matrix: Floats, corner_px: Floats, pixel: Floats) -> Floats:
    """Compute shifts (h, w, 2, 8) of the pattern at each pixel by the corners' coordinates."""
    place = apply_homography(invert_homography(matrix), pixel)
    step = _CORNER_STEP * float(np.linalg.norm(corner_px[2] - corner_px[0]))
    moved = np.empty((*pixel.shape, 8))
    for k in range(8):
        other = np.array(corner_px, np.float64).ravel()
        other[k] += step
        moved[..., k] = (
            apply_homography(fit_homography(other.reshape(4, 2)), place) - pixel
        ) / step
    return moved


LOG_SOFT_BOUNDS = (-1.5, 2.0)


class Edge(NamedTuple):
    """Straight edge of a shadow, which is on the side that its normal points to.

    Attributes
    ----------
    angle_rad
        Direction of its normal, from u towards v.
    away_px
        Distance of the edge from the first pixel of the window, along the normal.
    log_soft
        Logarithm of its standard deviation [px].
    """

    angle_rad: float
    away_px: float
    log_soft: float


def render_edges(values: Floats, window: Window) -> tuple[Floats, Floats]:
    """Compute the share of each pixel behind each edge.

    Parameters
    ----------
    values
        (3 E,) of the edges, one after the other.
    window
        Pixels to compute.

    Returns
    -------
    shade : (E, h, w)
        0 to 1.
    by_edge : (E, h, w, 3)
        Its derivatives by the values of its edge.
    """
    v, u = np.mgrid[: window.height, : window.width].astype(np.float64)
    edge = np.reshape(values, (-1, 3, 1, 1))
    c, s, soft = np.cos(edge[:, 0]), np.sin(edge[:, 0]), np.exp(edge[:, 2])
    ahead = (c * u + s * v - edge[:, 1]) / soft
    bell = np.exp(-0.5 * ahead**2) / np.sqrt(2 * np.pi)
    turned = bell * (-s * u + c * v) / soft
    return ndtr(ahead), np.stack([turned, -bell / soft, -bell * ahead], axis=-1)


_ANGLES = np.deg2rad(np.arange(0.0, 180.0, 15.0))
_STEP_PX = 1.0
_FIRST_SOFT_PX = 0.8


def find_likely_edges(
    grey: Floats, base: Floats, share: Floats, weight: Floats, count: int = 3
) -> list[Edge]:
    """Find likely places of one more shadow edge: the best on a grid, one for each direction.

    Parameters
    ----------
    grey
        (h, w) of the window.
    base
        (h, w, m) base functions of the present model.
    share
        (h, w) whiteness of each pixel.
    weight
        (h, w) of the pixels.
    count
        Number of edges to return.
    """
    inside = weight > 0
    root = np.sqrt(weight[inside])
    # Residuals of the present model, by projection.
    q = np.linalg.qr(base[inside] * root[:, None])[0]
    target = grey[inside] * root
    target = target - q @ (q.T @ target)
    v, u = np.nonzero(inside)
    found: list[tuple[float, Edge]] = []
    for angle in _ANGLES:
        along = np.cos(angle) * u + np.sin(angle) * v
        away = np.arange(along.min() + 2.0, along.max() - 1.0, _STEP_PX)
        shade = ndtr((along[:, None] - away) / _FIRST_SOFT_PX)
        # Gain of the sum of squares for each place of the edge, with two new linear unknowns.
        pair = np.stack([shade, shade * share[inside][:, None]], axis=-1) * root[:, None, None]
        pair = pair - np.einsum("pm,mak->pak", q, np.einsum("pm,pak->mak", q, pair))
        normal = np.einsum("pak,pal->akl", pair, pair) + 1e-6 * np.eye(2)
        right = np.einsum("pak,p->ak", pair, target)
        gain = np.einsum("ak,ak->a", right, np.linalg.solve(normal, right[..., None])[..., 0])
        best = int(np.argmax(gain))
        edge = Edge(float(angle), float(away[best]), float(np.log(_FIRST_SOFT_PX)))
        found.append((float(gain[best]), edge))
    return [edge for _, edge in sorted(found, reverse=True)[:count]]


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
    return _summarise_fit(model, fit, used)


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


def _summarise_fit(model: PlateModel, fit: Fit, weight: Floats) -> PlateFit:
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
