"""Messages on points off the ground that were not stated to be so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.departures import heights_above_ground
from uavgram.model.message import Message, MessagePlural, propose_pick_removal
from uavgram.stages.refine.off_ground.shown import photos_of
from uavgram.stages.remedies import freed

TWO = 2
"""Number of photos that determine the height of a point but leave its picks unchecked."""


def off_ground_remarks(refined: Refined) -> Iterator[Message]:
    """Report each label that was adjusted with a free height without a statement."""
    survey = refined.adjustment.survey
    height, sigma = heights_above_ground(refined.adjustment)
    photos = photos_of(survey)
    for row, label in enumerate(survey.label):
        if label in refined.off_ground:
            up, sigma_m, shown = float(height[row]), float(sigma[row]), int(photos[row])
            message = off_ground_message(label, up, sigma_m, shown)
            if shown != TWO:
                yield message
                continue
            picks = np.flatnonzero(survey.pick_label == row)
            frames = [survey.frame_id[frame] for frame in survey.pick_frame[picks]]
            either = (propose_pick_removal([(frame, label)]) for frame in frames)
            yield replace(message, instead=tuple(one for one in either if one is not None))


def off_ground_message(label: str, height_m: float, sigma_m: float, photos: int) -> Message:
    """Report a label that fits at a height.

    Parameters
    ----------
    label
        The point.
    height_m, sigma_m
        Its height above the ground and the sigma of it, in metres.
    photos
        Number of photos that show it.
    """
    side = "above" if height_m > 0 else "below"
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma_m, 1e-4))), 1, 3))
    size = f"{abs(height_m):.{digits}f} ± {sigma_m:.{digits}f} m {side} the ground"
    size_m, rough = abs(height_m), min(digits, 1 if abs(height_m) >= 1.0 else 2)
    where = "up" if height_m > 0 else "below the ground"
    other = " (or one of its two picks is on another thing)" if photos == TWO else ""
    text = (
        f"{label!r} fits {size}, and not on it{other}. It was adjusted with that height. To "
        "confirm it, write 'free' into the column height_m of its picks, or the height if you "
        "know it."
    )
    several = MessagePlural(
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
        plain=f"{label} stands {size_m:.{rough}f} m {where}{other}.",
        mend=freed([label]),
    )
