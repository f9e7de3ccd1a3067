"""How much of a pick's corner several photos share, at each place of its line of sight.

At the height of the corner the edges that meet in it have one direction in all photos that show it,
whatever lies beyond them; at another height one edge may still fall on itself, but hardly two. So
of each pixel about the pick it is asked how well the direction of the edge there agrees with that
in the other photos, and what most photos agree on must be a corner, and in the pick itself.
Weak edges count nearly as much as strong ones: the second edge of a corner is often a weak one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.imaging.patches import Grey, grid, sample, slopes
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

STRETCH = 0.25, 4.0
"""Of a photo against the source, beyond which it is not compared."""

ABOUT_PX = 2.5
"""Standard deviation of the bell about the pick in which edges are compared [px of the source]."""

EDGE_STEP = 2.0
"""Slope [grey values a pixel] from which an edge counts at least 0.7: that of noise is below."""

CHANCE = 0.2
"""Likeness of edges that places which have nothing in common reach."""

LOOKED_AT = 0.4
"""Likeness of edges in all photos together, in that of the best place, from which a place is
looked at for the corner itself."""

MOST = 0.7
"""Share of the photos in view that must agree on a pixel's edge: others may hide the corner, and
one always may, where there are enough."""

PHOTOS = 2
"""That must agree at least, besides the source: any one agrees with it somewhere on the line."""

OFF_PX = 1.2
"""Standard deviation of a corner about the pick that is made of it [px]."""

STRONG = 0.05, 0.125
"""Least strength of a corner, and what is added over the square of the number of photos that must
agree but for one: the fewer they are, the more often they agree by chance. Measured on rendered
streets."""

_REACH = 6
_SAMPLED = _REACH + 1  # slopes take one more on either side

_INNER: Grey = grid(_REACH).astype(np.float32)
_BELL: Grey = np.exp(-0.5 * (_INNER**2).sum(axis=1) / ABOUT_PX**2).astype(np.float32)
_BELL = np.asarray(_BELL / _BELL.sum())


class Line(NamedTuple):
    """A pixel's line of sight as t photos show it, from what lies lowest up.

    Attributes
    ----------
    source_px
        (2,) the pixel.
    pixel_px
        (k, t, 2) places of the line; NaN where a photo does not show one.
    affine
        (k, t, 2, 2) d pixel there / d pixel in the source, of what lies level.
    lowest
        Number of the first place that may be the corner's; those before it are the ground.
    """

    source_px: Floats
    pixel_px: Floats
    affine: Floats
    lowest: int


def corner_along(source: Image, targets: Sequence[Image], line: Line) -> Floats:
    """(k,) how strong the corner is that most photos share with the source: from 1 on it is one.

    The smaller eigenvalue of the structure tensor of the shared edges (Foerstner and Guelch 1987),
    less where the point in which they meet is not the pick, against what it must be.

    Parameters
    ----------
    source
        (height, width) grey photo, uint8.
    targets
        t others.
    line
        Where the corner may be.
    """
    slope, own = _edges(_sampled(source, line.source_px[None], np.eye(2)[None], _SAMPLED))
    like = _alike(targets, line, own[0])
    beside = np.pad(like, ((1, 1), (0, 0)), constant_values=-1.0)
    steps = np.stack([beside[1:-1], beside[:-2], beside[2:]])  # poses err
    together = np.clip(steps.max(axis=0) - CHANCE, 0.0, None).sum(axis=1)
    in_view = np.count_nonzero(like > -1.0, axis=1)
    together[in_view < PHOTOS] = 0.0
    strength = np.zeros(len(like))
    rows = np.flatnonzero(together > LOOKED_AT * together.max(initial=0.0))
    if rows.size:
        best = np.array([0, -1, 1])[steps.argmax(axis=0)] + np.arange(len(like))[:, None]
        agree = _agreement(targets, line, own[0], (best[rows], like[rows] > -1.0))
        need = np.minimum(np.ceil(MOST * in_view[rows]).astype(int), in_view[rows] - 1)
        need = np.maximum(need, PHOTOS)
        agree.sort(axis=1)
        most = agree[np.arange(len(agree)), agree.shape[1] - need].clip(0.0)
        always, alone = STRONG
        strength[rows] = _cornered(most, slope[0]) / (always + alone / (need - 1) ** 2)
    return strength


def windows(photo: Image, pixel: Floats, affine: Floats, reach: int) -> tuple[Ints, Grey]:
    """Windows that a photo shows whole and about as large: their numbers (n,), and values (n, s).

    Parameters
    ----------
    photo
        Grey.
    pixel, affine
        (k, 2) their middles, and (k, 2, 2) d pixel there / d pixel in the source.
    reach
        Half their side [px of the source].
    """
    far = np.abs(affine).sum(axis=2) * reach + 2.0
    with np.errstate(invalid="ignore"):
        inside = (pixel >= far) & (pixel <= np.array(photo.shape[1::-1]) - 1 - far)
    size = np.linalg.svd(np.nan_to_num(affine), compute_uv=False)
    as_large = (size[:, 1] > STRETCH[0]) & (size[:, 0] < STRETCH[1])
    shown = np.flatnonzero(inside.all(axis=1) & as_large)
    return shown, _sampled(photo, pixel[shown], affine[shown], reach)


def _sampled(photo: Image, pixel: Floats, affine: Floats, reach: int) -> Grey:
    """(n, s) grey values about pixels, as of `windows`."""
    u, v = np.moveaxis(pixel[:, None] + grid(reach) @ np.swapaxes(affine, 1, 2), -1, 0)
    return sample(photo, u, v)


def _edges(grey: Grey) -> tuple[Grey, Grey]:
    """Slopes (n, 2, s) of grey values, and the direction of the edges there.

    A direction is that of twice the angle, so that an edge from dark to light and one from light to
    dark are one; its length is 0 of even ground to 1 of a clear edge.
    """
    side = 2 * _REACH + 3
    field = grey.reshape(-1, side, side)
    u, v = (one.reshape(len(grey), len(_BELL)) for one in slopes(field))
    square = u**2 + v**2
    weight = 1.0 / np.sqrt(np.maximum(square * (square + EDGE_STEP**2), 1e-12))
    return np.stack([u, v], axis=1), np.stack([(u**2 - v**2) * weight, 2 * u * v * weight], axis=1)


def _alike(targets: Sequence[Image], line: Line, own: Grey) -> Grey:
    """(k, t) likeness of edges about each place and the pick, (2, s); -1 where not shown."""
    like = np.full(line.pixel_px.shape[:2], -1.0, np.float32)
    weighted = (own * _BELL).ravel()
    size = float(weighted @ own.ravel())
    for i, photo in enumerate(targets):
        rows, grey = windows(photo, line.pixel_px[:, i], line.affine[:, i], _SAMPLED)
        _, there = _edges(grey)
        both = there.reshape(len(rows), weighted.size) @ weighted
        sizes = (there**2).sum(axis=1) @ _BELL * size
        like[rows, i] = both / np.sqrt(np.maximum(sizes, 1e-9))
    return like


def _agreement(targets: Sequence[Image], line: Line, own: Grey, places: tuple[Ints, Bools]) -> Grey:
    """(n, t, s) how well the edges of each photo agree with those about the pick, at most 1.

    Parameters
    ----------
    targets, line
        As of `corner_along`.
    own
        (2, s) directions about the pick.
    places
        (n, t) numbers of places, and whether photos show them; -1 where they do not.
    """
    place, seen = places
    agree = np.full((*place.shape, len(_BELL)), -1.0, np.float32)
    for i, photo in enumerate(targets):
        rows = np.flatnonzero(seen[:, i])
        at = place[rows, i]
        grey = _sampled(photo, line.pixel_px[at, i], line.affine[at, i], _SAMPLED)
        agree[rows, i] = (_edges(grey)[1] * own).sum(axis=1)
    return agree


def _cornered(agreed: Grey, slope: Grey) -> Floats:
    """(n,) strength of the corner that shared edges (n, s) make at slopes (2, s) of the source."""
    ahead = slope / np.maximum(np.hypot(*slope), 1e-6)
    weight = agreed * _BELL
    along = (ahead.T * _INNER).sum(axis=1)
    uu, uv, vv = weight @ ahead[0] ** 2, weight @ (ahead[0] * ahead[1]), weight @ ahead[1] ** 2
    u, v = weight @ (ahead[0] * along), weight @ (ahead[1] * along)
    weaker = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
    size = uu * vv - uv**2 + 1e-7
    off = np.stack([vv * u - uv * v, uu * v - uv * u]) / size  # where the edges meet
    return np.asarray(weaker * np.exp(-0.5 * (off**2).sum(axis=0) / OFF_PX**2), np.float64)
