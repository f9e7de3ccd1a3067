"""Detection of occlusions about a point: shifted windows, and quarters of its surroundings.

About a corner that is off the ground, some windows show the object, the others the background
behind its edge: they do not move alike from photo to photo (shiftable windows: Kang, Szeliski and
Chai 2001, "Handling occlusions in dense multi-view stereo"). The corner of a car hides other ground
in each photo: the ground behind it may match on its own, as if the corner were there. Then one
quarter of the patch matches, and another does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.imaging.matching.least_squares import PatchFits
from uavgram.imaging.patches import (
    Grey,
    compute_common_frames,
    make_grid,
    sample_grey,
    sample_window,
)
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

HALF_WINDOW = 5
"""Half the side of a window [steps]."""

MIN_TEXTURE_SIGMA = 4.0
"""Standard deviation [grey values] up to which a window has too little texture to be used."""


class ShiftedWindows(NamedTuple):
    """Set of w windows about a point.

    Attributes
    ----------
    grid
        (s, 2) places that they cover together, about the point.
    middle
        (w, 2) centre of each window.
    weight
        (w, s) weights of the places; each window's sum is 1.
    """

    grid: Floats
    middle: Floats
    weight: Floats

    def likeness(self, own: Grey, there: Grey) -> tuple[Floats, Floats]:
        """Correlate values (..., s) with the source's values (s,) in each window.

        Returns
        -------
        The correlations (..., w), and the variances (w,) of the source's values.
        """
        mean, middle = self.weight @ own, there @ self.weight.T
        variance = self.weight @ own**2 - mean**2
        spread = np.maximum(there**2 @ self.weight.T - middle**2, 1.0)
        both = (there * own) @ self.weight.T - middle * mean
        return both / np.sqrt(spread * np.maximum(variance, 1.0)), variance


def make_shifted_windows(aside: int) -> ShiftedWindows:
    """Create windows centred on the point, and `aside` steps from it in either direction."""
    places, middle = make_grid(HALF_WINDOW + aside), aside * make_grid(1)
    away = places - middle[:, None]
    within = (np.abs(away) <= HALF_WINDOW).all(axis=2)
    weight = np.where(within, np.exp(-2.0 * (away**2).sum(axis=2) / HALF_WINDOW**2), 0.0)
    return ShiftedWindows(places, middle, weight / weight.sum(axis=1, keepdims=True))


_SHIFT = 3  # steps: the edges at the point are in every window
_SHIFTED = make_shifted_windows(_SHIFT)
_OTHER_STEPS: Floats = np.array([0.0, -4.0, -3.0, 3.0, 4.0])  # steps along the line of sight
_MAX_RATIO = 0.75  # largest ratio of dissimilarity at the match to that at the other places
_CHANCE_SHARE = 0.1  # of the noise: chance variation in a window
_DIFFERENCE_VARIANCE = (
    0.25  # variance of the difference of two windows of the same area [grey values squared]
)


def find_unoccluded(near: Grey, far: Grey, there: PatchFits, along: Floats) -> Bools:
    """Mark the points (m,) whose surroundings all match at one place along the line of sight.

    Parameters
    ----------
    near, far
        (m, s, s) windows about the point, and about the searched place.
    there
        Match of the first in the second.
    along
        (m, 2) direction of the line of sight there; 0 where the place along it is known.
    """
    edge = near.shape[1] // 2 - HALF_WINDOW - _SHIFT
    fixed = np.ones(len(near), np.bool_)
    for i in np.flatnonzero(along.any(axis=1)).tolist():
        start = _SHIFTED.grid @ there.linear[i].T + there.place[i] + far.shape[1] // 2
        aside = _OTHER_STEPS[:, None, None] * along[i] / np.hypot(*along[i])
        u, v = np.moveaxis(start + aside, -1, 0)
        seen = sample_grey(far[i], u, v)
        like, variance = _SHIFTED.likeness(near[i, edge:-edge, edge:-edge].ravel(), seen)
        unlike = variance * (1.0 - like)
        noise = np.median(unlike[0])  # of both photos
        here, *others = (unlike - noise)[:, variance > MIN_TEXTURE_SIGMA**2]
        # Every textured window must match clearly better here than at any other place along the
        # line.
        most = _MAX_RATIO * np.min(others, axis=0)
        fixed[i] = (here + _CHANCE_SHARE * noise + _DIFFERENCE_VARIANCE <= most).all()
    return fixed


HALF_SQUARE = 15
"""Half side of the compared square [steps]: the largest that is matched at first."""

MIN_QUARTER_SIGMA = 4.0
"""Deviation of grey values below which a quarter has too little texture to be compared."""


def compute_worst_quarter_correlation(
    source: Image, target: Image, source_px: Floats, target_px: Floats, affine: Floats
) -> float:
    """Compute the correlation of the least similar quarter, -1 to 1; -1 where all lack texture.

    Parameters
    ----------
    source, target
        (height, width) grey photos.
    source_px, target_px
        (2,) the same point in both.
    affine
        (2, 2) d target pixel / d source pixel.
    """
    frames = compute_common_frames(affine[None])
    one = sample_window(source, source_px, frames.source[0], HALF_SQUARE)
    other = sample_window(target, target_px, frames.target[0], HALF_SQUARE)
    found = []
    for rows in (slice(HALF_SQUARE + 1), slice(HALF_SQUARE, None)):
        for columns in (slice(HALF_SQUARE + 1), slice(HALF_SQUARE, None)):
            a, b = (part[rows, columns].ravel() for part in (one, other))
            if a.std() >= MIN_QUARTER_SIGMA and b.std() > 0.0:
                found.append(float(np.corrcoef(a, b)[0, 1]))
    return min(found, default=-1.0)
