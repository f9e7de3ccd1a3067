"""Correct a ground above all cameras: its height, or theirs, counts from elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.first_values import estimate_ground_height
from uavgram.model.message import Message
from uavgram.model.survey import Survey

DATUM_SIGMA_M = 3.0
"""Standard deviation of a height above the sea against the height of a flight's origin [m]."""

ORDINARY_HEIGHT_M = 40.0
"""Ordinary height of a camera above the ground, and its standard deviation [m]."""


def lower_ground(survey: Survey, origin_m: float | None) -> tuple[Survey, tuple[Message, ...]]:
    """Refer heights of the ground to the world's origin where they are above all cameras.

    Parameters
    ----------
    survey
        All observations.
    origin_m
        Height of the world's origin above the sea or the ellipsoid [m]; None where it is unknown.

    Returns
    -------
    survey, messages
        The survey with the ground at the height of its control points, or at the stated height
        less that of the origin, or at the origin, or else at an ordinary height below the cameras;
        and a warning if it was moved.
    """
    seeds, stated_m = survey.seeds, survey.ground.height_m
    if seeds is None or stated_m < seeds.center_world_m[:, 2].max():
        return survey, ()
    lowest_m = float(seeds.center_world_m[:, 2].min())
    guesses_m = [0.0 if origin_m is None else stated_m - origin_m, 0.0]
    if len(survey.control_label):
        guesses_m.insert(0, estimate_ground_height(survey))
    known_m = [one for one in guesses_m if one < lowest_m]
    height_m, sigma_m = (
        (known_m[0], DATUM_SIGMA_M)
        if known_m
        else (lowest_m - ORDINARY_HEIGHT_M, ORDINARY_HEIGHT_M)
    )
    grounds = tuple(
        replace(
            one,
            height_m=one.height_m - stated_m + height_m,
            height_sigma_m=float(np.hypot(one.height_sigma_m, sigma_m)),
        )
        for one in survey.grounds
    )
    above = "" if origin_m is None else f", at {origin_m:.1f} m"
    text = (
        "By the recorded heights all cameras are below the ground, which is "
        f"{stated_m:.1f} m above the world's origin{above}: either the heights of the photos or "
        "`ground.height_m` count from elsewhere, such as the sea. The adjustment begins with "
        f"{height_m:.1f} m for the ground, uncertain by {sigma_m:.0f} m. Correct the one that is "
        "wrong."
    )
    return replace(survey, grounds=grounds), (Message("warning", "ground-above-cameras", text),)
