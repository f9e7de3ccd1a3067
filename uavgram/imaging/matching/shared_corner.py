"""Strength of a pick's corner shared by several photos, at each place of its line of sight.

At the height of the corner, the edges that meet in it have the same directions in all photos that
show it, for any background; at another height one edge may still coincide with itself, but hardly
two. For each pixel about the pick the direction of the edge is therefore compared with that in the
other photos; edges shared by most photos must form a corner, and it must be at the pick itself.
Weak edges count nearly as much as strong ones: the second edge of a corner is often a weak one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.imaging.patches import Grey, compute_slopes, make_grid, sample_grey
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

SCALE_BOUNDS = 0.25, 4.0
"""Least and largest scale of a photo against the source for a comparison."""

BLUR_SIGMA_PX = 2.5
"""Sigma of the Gaussian weights about the pick for edges [px of the source]."""

EDGE_STEP = 2.0
"""Slope [grey values a pixel] from which an edge counts at least 0.7; noise is below."""

CHANCE_CORRELATION = 0.2
"""Similarity of edges that unrelated places reach."""

MIN_STRENGTH_SHARE = 0.4
"""Similarity in all photos together, relative to the best place, from which corners are tested."""

MIN_AGREEING_SHARE = 0.7
"""Share of the photos in view that must agree on a pixel's edge.

Others may hide the corner; one always may, where there are enough photos.
"""

MIN_PHOTOS = 2
"""Least number of agreeing photos besides the source: a single one agrees somewhere on the line."""

CORNER_SIGMA_PX = 1.2
"""Standard deviation of a corner's place about its pick [px]."""

MIN_STRENGTH = 0.05, 0.125
"""Least strength of a corner, and an addition to it for few photos.

The addition is divided by (n - 1)^2 with the number n of photos that must agree: fewer photos agree
more often by chance. Measured on rendered streets.
"""

_REACH = 6
_SAMPLED = _REACH + 1  # slopes need one more on either side

_INNER: Grey = make_grid(_REACH).astype(np.float32)
_BELL: Grey = np.exp(-0.5 * (_INNER**2).sum(axis=1) / BLUR_SIGMA_PX**2).astype(np.float32)
_BELL = np.asarray(_BELL / _BELL.sum())


class SightLine(NamedTuple):
    """Line of sight of a pixel in t photos, from the lowest place upwards.

    Attributes
    ----------
    source_px
        (2,) the pixel.
    pixel_px
        (k, t, 2) places of the line; NaN where a photo does not show one.
    affine
        (k, t, 2, 2) d pixel there / d pixel in the source, for a level surface.
    lowest
        Index of the first place that may be the corner's; those before it are the ground.
    """

    source_px: Floats
    pixel_px: Floats
    affine: Floats
    lowest: int


def compute_corner_strength(source: Image, targets: Sequence[Image], line: SightLine) -> Floats:
    """Compute the strength (k,) of the corner that most photos share with the source.

    It is the smaller eigenvalue of the structure tensor of the shared edges (Foerstner and Guelch
    1987), reduced where the edges do not meet at the pick, relative to the required strength: 1 or
    more is a corner.

    Parameters
    ----------
    source
        (height, width) grey photo, uint8.
    targets
        t others.
    line
        Line of sight of the corner.
    """
    slope, own = _edges(_sampled(source, line.source_px[None], np.eye(2)[None], _SAMPLED))
    like = _alike(targets, line, own[0])
    beside = np.pad(like, ((1, 1), (0, 0)), constant_values=-1.0)
    steps = np.stack([beside[1:-1], beside[:-2], beside[2:]])  # neighbours, too: poses have errors
    together = np.clip(steps.max(axis=0) - CHANCE_CORRELATION, 0.0, None).sum(axis=1)
    in_view = np.count_nonzero(like > -1.0, axis=1)
    together[in_view < MIN_PHOTOS] = 0.0
    strength = np.zeros(len(like))
    rows = np.flatnonzero(together > MIN_STRENGTH_SHARE * together.max(initial=0.0))
    if rows.size:
        best = np.array([0, -1, 1])[steps.argmax(axis=0)] + np.arange(len(like))[:, None]
        agree = _agreement(targets, line, own[0], (best[rows], like[rows] > -1.0))
        # For each pixel, the agreement that the required number of photos reach.
        need = np.minimum(
            np.ceil(MIN_AGREEING_SHARE * in_view[rows]).astype(int), in_view[rows] - 1
        )
        need = np.maximum(need, MIN_PHOTOS)
        agree.sort(axis=1)
        most = agree[np.arange(len(agree)), agree.shape[1] - need].clip(0.0)
        always, alone = MIN_STRENGTH
        strength[rows] = _cornered(most, slope[0]) / (always + alone / (need - 1) ** 2)
    return strength


def sample_windows(photo: Image, pixel: Floats, affine: Floats, reach: int) -> tuple[Ints, Grey]:
    """Resample the windows that a photo shows whole and at a similar scale.

    Parameters
    ----------
    photo
        Grey photo.
    pixel, affine
        (k, 2) their middles, and (k, 2, 2) d pixel there / d pixel in the source.
    reach
        Half their side [px of the source].

    Returns
    -------
    Their indices (n,), and grey values (n, s).
    """
    far = np.abs(affine).sum(axis=2) * reach + 2.0
    with np.errstate(invalid="ignore"):
        inside = (pixel >= far) & (pixel <= np.array(photo.shape[1::-1]) - 1 - far)
    size = np.linalg.svd(np.nan_to_num(affine), compute_uv=False)
    as_large = (size[:, 1] > SCALE_BOUNDS[0]) & (size[:, 0] < SCALE_BOUNDS[1])
    shown = np.flatnonzero(inside.all(axis=1) & as_large)
    return shown, _sampled(photo, pixel[shown], affine[shown], reach)


def _sampled(photo: Image, pixel: Floats, affine: Floats, reach: int) -> Grey:
    """Resample grey values (n, s) about pixels, as in `sample_windows`."""
    u, v = np.moveaxis(pixel[:, None] + make_grid(reach) @ np.swapaxes(affine, 1, 2), -1, 0)
    return sample_grey(photo, u, v)


def _edges(grey: Grey) -> tuple[Grey, Grey]:
    """Compute slopes (n, 2, s) of grey values, and the direction of the edges there.

    A direction is that of twice the angle, so that an edge from dark to light and one from light to
    dark agree; its length is 0 on even ground to 1 at a clear edge.
    """
    side = 2 * _REACH + 3
    field = grey.reshape(-1, side, side)
    u, v = (one.reshape(len(grey), len(_BELL)) for one in compute_slopes(field))
    square = u**2 + v**2
    weight = 1.0 / np.sqrt(np.maximum(square * (square + EDGE_STEP**2), 1e-12))
    return np.stack([u, v], axis=1), np.stack([(u**2 - v**2) * weight, 2 * u * v * weight], axis=1)


def _alike(targets: Sequence[Image], line: SightLine, own: Grey) -> Grey:
    """Correlate edges about each place with those at the pick (2, s); -1 where not shown.

    The result is (k, t).
    """
    like = np.full(line.pixel_px.shape[:2], -1.0, np.float32)
    weighted = (own * _BELL).ravel()
    size = float(weighted @ own.ravel())
    for i, photo in enumerate(targets):
        rows, grey = sample_windows(photo, line.pixel_px[:, i], line.affine[:, i], _SAMPLED)
        _, there = _edges(grey)
        both = there.reshape(len(rows), weighted.size) @ weighted
        sizes = (there**2).sum(axis=1) @ _BELL * size
        like[rows, i] = both / np.sqrt(np.maximum(sizes, 1e-9))
    return like


def _agreement(
    targets: Sequence[Image], line: SightLine, own: Grey, places: tuple[Ints, Bools]
) -> Grey:
    """Compute the agreement (n, t, s) of each photo's edges with those about the pick, at most 1.

    Parameters
    ----------
    targets, line
        As for `compute_corner_strength`.
    own
        (2, s) directions about the pick.
    places
        (n, t) indices of places, and flags whether photos show them; the agreement is -1 where not.
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
    """Compute the strength (n,) of the corner that shared edges (n, s) form.

    `slope` is (2, s) of the source.
    """
    ahead = slope / np.maximum(np.hypot(*slope), 1e-6)
    weight = agreed * _BELL
    along = (ahead.T * _INNER).sum(axis=1)
    uu, uv, vv = weight @ ahead[0] ** 2, weight @ (ahead[0] * ahead[1]), weight @ ahead[1] ** 2
    u, v = weight @ (ahead[0] * along), weight @ (ahead[1] * along)
    # Smaller eigenvalue of the weighted structure tensor.
    weaker = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
    size = uu * vv - uv**2 + 1e-7
    off = np.stack([vv * u - uv * v, uu * v - uv * u]) / size  # intersection of the edges
    return np.asarray(weaker * np.exp(-0.5 * (off**2).sum(axis=0) / CORNER_SIGMA_PX**2), np.float64)
