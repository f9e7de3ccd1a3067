"""Points off the ground that nobody stated, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.departures import heights_above_ground
from uavgram.model.message import Message, Several
from uavgram.stages.refine.off_ground.shown import photos_of

TWO = 2
"""Photos that show a point from which on its height can be found, but no pick of it is checked."""


def off_ground_remarks(refined: Refined) -> Iterator[Message]:
    """One message for each label that was adjusted with a free height though nobody said so."""
    survey = refined.adjustment.survey
    height, sigma = heights_above_ground(refined.adjustment)
    photos = photos_of(survey)
    for row, label in enumerate(survey.label):
        if label in refined.off_ground:
            yield off_ground_message(label, float(height[row]), float(sigma[row]), int(photos[row]))


def off_ground_message(label: str, height_m: float, sigma_m: float, photos: int) -> Message:
    """The message on a label that fits at a height.

    Parameters
    ----------
    label
        The point.
    height_m, sigma_m
        Its height above the ground and the sigma of it, in metres.
    photos
        How many photos show it.
    """
    side = "above" if height_m > 0 else "below"
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma_m, 1e-4))), 1, 3))
    size = f"{abs(height_m):.{digits}f} ± {sigma_m:.{digits}f} m {side} the ground"
    other = " (or one of its two picks is on another thing)" if photos == TWO else ""
    text = (
        f"{label!r} fits {size}, and not on it{other}. It was adjusted with that height. To "
        "confirm it, write 'free' into the column height_m of its picks, or the height if you "
        "know it."
    )
    several = Several(
        "{count} points fit at a height off the ground, and not on it; they were adjusted so",
        f"{label!r} {abs(height_m):.{digits}f} ± {sigma_m:.{digits}f} m {side}{other}",
        ending="To confirm it, write 'free' into the column height_m of their picks, or the "
        "heights if you know them.",
    )
    return Message(
        "warning",
        "point-off-ground",
        text,
        labels=(label,),
        heights_m=(height_m,),
        heights_sigma_m=(sigma_m,),
        several=several,
    )
