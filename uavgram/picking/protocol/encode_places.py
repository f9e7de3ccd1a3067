"""Numbers, places in photos and places on earth as plain JSON; NaN becomes null."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import PredictedPixels
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.picking.protocol import messages as m
from uavgram.pipeline.pick.live_survey import LiveAdjustment
from uavgram.pipeline.pick.places import KnownPlaces

_DIGITS = 7


def number(value: float, digits: int = _DIGITS) -> float | None:
    """Return a number rounded for JSON; None if it is not finite."""
    return round(float(value), digits) if math.isfinite(value) else None


def numbers(values: Iterable[float], digits: int = _DIGITS) -> list[float | None]:
    """Return numbers rounded for JSON."""
    return [number(value, digits) for value in values]


def expected_json(places: KnownPlaces, index: Mapping[str, int]) -> list[m.Predicted]:
    """Return the expected places of points with known coordinates."""
    return places_json(places.frame_id, places.label, places, index)


def places_json(
    frames: Sequence[str],
    labels: Sequence[str],
    places: KnownPlaces | PredictedPixels,
    index: Mapping[str, int],
) -> list[m.Predicted]:
    """Return labels in photos in which they are not picked, with error ellipses.

    Parameters
    ----------
    frames, labels
        (n,) names of the photos, and labels of the points.
    places
        Pixels with covariances.
    index
        Numbers of the photos by name.
    """
    pixels = places.pixel_px.round(3).tolist()
    rows = zip(frames, labels, pixels, places.covariance_px2, strict=True)
    return [
        {
            "image": index[frame],
            "label": label,
            "pixel_px": (u, v),
            "spread": ellipse_json(covariance),
        }
        for frame, label, (u, v), covariance in rows
    ]


def ellipse_json(covariance_px2: Floats) -> m.Spread:
    """Return one-sigma half-axes [px] and the direction of the major one from u towards v [deg]."""
    # eigenvalues in ascending order: variances along the minor and the major axis
    value, vector = np.linalg.eigh(covariance_px2)
    minor, major = np.sqrt(np.maximum(value, 0.0))
    turn_deg = math.degrees(math.atan2(vector[1, 1], vector[0, 1]))
    return {
        "major_px": number(major, 3),
        "minor_px": number(minor, 3),
        "turn_deg": number(turn_deg, 3),
    }


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
