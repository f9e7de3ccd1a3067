"""Numbers and places in photos as plain JSON; NaN becomes null."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import PredictedPixels
from uavgram.model.arrays import Floats
from uavgram.pipeline.pick.other_photos import KnownPlaces

Json = dict[str, Any]

_DIGITS = 7


def number(value: float, digits: int = _DIGITS) -> float | None:
    """A number as JSON can hold it; None where it is none."""
    return round(float(value), digits) if math.isfinite(value) else None


def numbers(values: Iterable[float], digits: int = _DIGITS) -> list[float | None]:
    """Numbers as JSON can hold them."""
    return [number(value, digits) for value in values]


def expected_json(places: KnownPlaces, index: Mapping[str, int]) -> list[Json]:
    """Where points with known coordinates should appear."""
    return places_json(places.frame_id, places.label, places, index)


def places_json(
    frames: Sequence[str],
    labels: Sequence[str],
    places: KnownPlaces | PredictedPixels,
    index: Mapping[str, int],
) -> list[Json]:
    """Labels in photos where nobody has picked them, with their spread.

    Parameters
    ----------
    frames, labels
        (n,) names of the photos, and of what is there.
    places
        Where, with covariances.
    index
        Numbers of the photos by name.
    """
    rows = zip(frames, labels, places.pixel_px, places.covariance_px2, strict=True)
    return [
        {
            "image": index[frame],
            "label": label,
            "pixel_px": numbers(pixel, 3),
            "spread": ellipse_json(covariance),
        }
        for frame, label, pixel, covariance in rows
    ]


def ellipse_json(covariance_px2: Floats) -> Json:
    """One-sigma half-axes [px], and the direction of the major one from u towards v [deg]."""
    value, vector = np.linalg.eigh(covariance_px2)
    minor, major = np.sqrt(np.maximum(value, 0.0))
    turn_deg = math.degrees(math.atan2(vector[1, 1], vector[0, 1]))
    return {
        "major_px": number(major, 3),
        "minor_px": number(minor, 3),
        "turn_deg": number(turn_deg, 3),
    }
