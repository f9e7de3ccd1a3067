"""Latitude and longitude of the points whose coordinates are measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.geometry.earth.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.pipeline.pick.live_survey import LiveAdjustment

DEGREE_DIGITS = 9
"""Decimals of a degree: a tenth of a millimetre."""


def places_on_earth(
    adjusted: LiveAdjustment, label: Sequence[str], position_world_m: Floats
) -> dict[str, list[float]]:
    """Return latitude and longitude [deg] by label.

    Parameters
    ----------
    adjusted
        Adjustment with the requested points and the origin of the local world.
    label, position_world_m
        (K,), (K, 3) points, as adjusted or moved since.

    Returns
    -------
    places
        Empty if the survey is not tied to the earth.
    """
    world, requests = adjusted.result.world, adjusted.observed.requests
    asked = {request.points[0] for request in requests if request.kind == "coordinate"}
    rows = [k for k, name in enumerate(label) if name in asked]
    if world.origin is None:
        return {}
    latitude, longitude, _ = geodetic_from_enu(position_world_m[rows], world.origin)
    return {
        label[k]: [round(degrees, DEGREE_DIGITS) for degrees in place]
        for k, *place in zip(rows, latitude.tolist(), longitude.tolist(), strict=True)
        if np.isfinite(place).all()
    }
