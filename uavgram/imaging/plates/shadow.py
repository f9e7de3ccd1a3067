"""Straight edges of shadows across a plate, softened by the sun's size and the blur."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from uavgram.imaging.plates.picture import Window
from uavgram.model.arrays import Floats

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
