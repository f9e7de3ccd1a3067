"""Correct stated heights above a camera that looks down on their points: of another unit."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined, compute_heights
from uavgram.model.message import Message, MessagePlural, propose_free_heights
from uavgram.model.naming import format_digits
from uavgram.model.survey import Survey
from uavgram.stages.refine.first_values import (
    ABOVE_CAMERA,
    find_first_values,
    find_unusable_picks,
)
from uavgram.stages.refine.off_ground import MIN_HEIGHT_SIGMAS, count_photos
from uavgram.stages.refine.robust_adjustment import HIGHEST_M

UNITS = ((100.0, "centimetres"), (1000.0, "millimetres"))
"""Number of each unit in a metre, the likeliest first."""

LOWEST_CAMERA_M = 2.0
"""Height above the ground below which no drone takes photos [m]."""


def correct_impossible_heights(survey: Survey) -> tuple[Survey, tuple[str, ...]]:
    """Convert stated heights from centimetres that are above a camera which looks down on them.

    Those that would still be higher than a lorry are converted from millimetres.

    Returns
    -------
    survey, names
        The survey, and the names of the points whose heights were changed.
    """
    is_high = ~survey.is_free & (survey.height_above_m > LOWEST_CAMERA_M)
    if not is_high.any():
        return survey, ()
    try:
        starts = find_first_values(survey)
    except GeometryError:
        return survey, ()
    unusable = min((find_unusable_picks(survey, values) for values in starts), key=len)
    rows = [k for k, why in unusable.items() if why is ABOVE_CAMERA]
    label = np.unique(survey.pick_label[rows])
    label = label[is_high[label]]
    height_m = survey.height_above_m.copy()
    height_m[label] = [_convert(height)[0] for height in height_m[label].tolist()]
    return replace(survey, height_above_m=height_m), tuple(survey.label[k] for k in label)


def _convert(stated: float) -> tuple[float, str]:
    """Convert a number to metres, and return the unit in which it seems to be typed."""
    for size, unit in UNITS:
        if stated / size <= HIGHEST_M:
            return stated / size, unit
    size, unit = UNITS[0]
    return stated / size, unit


def report_impossible_heights(
    stated: Survey, refined: Refined, names: Collection[str]
) -> Iterator[Message]:
    """Report each height that was converted, and what the photos show.

    Parameters
    ----------
    stated
        The survey before.
    refined
        Its adjustment with the changed heights.
    names
        Names of the points.
    """
    adjustment = refined.adjustment
    found, sigma = compute_heights(adjustment)
    photos = dict(zip(stated.label, count_photos(stated).tolist(), strict=True))
    for name in names:
        stated_m = float(stated.height_above_m[stated.label.index(name)])
        (used_m, unit), row = _convert(stated_m), adjustment.label_rows([name])[0]
        what = f"{name!r} is stated at {format_digits(stated_m)} m"
        shown = f"the results use {used_m:.2f} m"
        if row >= 0 and photos[name] > 1:
            shown += ", which fits the photos"
            if abs(found[row] - used_m) > MIN_HEIGHT_SIGMAS * sigma[row]:
                shown = f"the photos show it at {found[row]:.2f} ± {sigma[row]:.2f} m"
        yield Message(
            "warning",
            "height-above-camera",
            f"The stated height of {name!r} is above the camera, which looks down on it: {what} "
            f"above the ground. Was it typed in {unit}? {shown[0].upper()}{shown[1:]}. "
            "Correct its height in metres.",
            labels=(name,),
            several=MessagePlural(
                "The stated heights of {count} points are above the camera, which looks down on "
                f"them (typed in {unit}?)",
                f"{what}, {shown}",
                ending="Correct these heights in metres.",
            ),
            mend=propose_free_heights([name]) if photos[name] > 1 else None,
        )
