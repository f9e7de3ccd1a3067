"""Comparison of the surroundings of a match and its pick, quarter by quarter.

The corner of a car hides other ground in each photo: the ground behind it may match on its own, as
if the corner were there. Then one quarter of the patch matches, and another does not.
"""

from __future__ import annotations

import numpy as np

from uavgram.imaging.patches import common_frames, window
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

HALF = 15
"""Half side of the compared square [steps]: the largest that is matched at first."""

EVEN = 4.0
"""Deviation of grey values below which a quarter has too little texture to be compared."""


def least_likeness(
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
    frames = common_frames(affine[None])
    one = window(source, source_px, frames.source[0], HALF)
    other = window(target, target_px, frames.target[0], HALF)
    found = []
    for rows in (slice(HALF + 1), slice(HALF, None)):
        for columns in (slice(HALF + 1), slice(HALF, None)):
            a, b = (part[rows, columns].ravel() for part in (one, other))
            if a.std() >= EVEN and b.std() > 0.0:
                found.append(float(np.corrcoef(a, b)[0, 1]))
    return min(found, default=-1.0)
