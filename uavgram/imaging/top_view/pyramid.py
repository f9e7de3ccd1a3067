"""Pictures at half their size, for overviews."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.shrink import evened, half

OPAQUE = 255


def halved(rgba: Pixels) -> Pixels:
    """Average two by two pixels into one, weighted by their opacity.

    Parameters
    ----------
    rgba
        (H, W, 4) colour, not multiplied by opacity, and opacity.

    Returns
    -------
    (ceil(H / 2), ceil(W / 2), 4), opacity the plain mean. The last row and column are not averaged
    with others where H or W is odd.
    """
    rgba = evened(rgba)
    means = half(rgba)
    height, width = means.shape[:2]
    opacity = means[..., 3]
    rim = np.nonzero(
        (opacity > 0) & (opacity < OPAQUE)
    )  # few pixels: only the edge is partly opaque
    if rim[0].size:
        four = rgba.reshape(height, 2, width, 2, 4)[rim[0], :, rim[1]].reshape(-1, 4, 4)
        weight = four[..., 3:].astype(np.float64)
        means[..., :3][rim] = np.rint((four[..., :3] * weight).sum(1) / weight.sum(1))
    return means
