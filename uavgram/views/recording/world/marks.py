"""Lines and texts in space."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.views.style import OBSERVED, Rgb


def polylines(lines: Floats | list[Floats], colour: Rgb | Pixels, width: float) -> rr.LineStrips3D:
    """Make polylines.

    Parameters
    ----------
    lines
        (N, n, 3) or N polylines (n, 3).
    colour
        Colour of all, or (N, 3) of each.
    width
        Width in points of the screen.
    """
    single = np.asarray(lines, dtype=np.float32) if isinstance(lines, np.ndarray) else list(lines)
    return rr.LineStrips3D(single, colors=colour, radii=rr.Radius.ui_points(width / 2))


def texts(position: Floats, words: tuple[str, ...]) -> rr.Points3D:
    """Make white texts without a dot: coloured text is hard to read over photos."""
    return rr.Points3D(
        position, radii=rr.Radius.ui_points(0.0), colors=OBSERVED, labels=words, show_labels=True
    )
