"""Each sought point found in the target photo to hundredths of a pixel, or refused."""

from __future__ import annotations

from uavgram.imaging.matching.matched import Matched, Sought
from uavgram.imaging.raster import Image
from dataclasses import dataclass


@dataclass(frozen=True)
class MatchOptions:
    """What is asked of a match; fields have defaults."""


def matched(
    source: Image, target: Image, sought: Sought, options: MatchOptions | None = None
) -> Matched:
    """Where sought points lie in the target.

    Parameters
    ----------
    source, target
        (height, width) grey photos, uint8.
    sought
        Of n points.
    options
        None: the defaults.
    """
    raise NotImplementedError
