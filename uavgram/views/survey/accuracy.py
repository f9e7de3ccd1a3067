"""Accuracy of positions, with that of distances kept apart from the receiver's metres."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.units import spread_text, units_of


def accuracy_words(result: Result) -> str:
    """State both accuracies: ``Distances between neighbouring points are known to about 1 cm``."""
    points, units = result.points, units_of(result)
    near = points.neighbour_sigma_m
    told = []
    if np.isfinite(near).any():
        one = spread_text(float(np.nanmedian(near)), "m", units)
        told.append(f"Distances between neighbouring points are known to about ± {one}.")
    if not points.label:
        return ""
    if result.world.gauge == "plane":
        told.append("This survey has no tie to the earth: north is arbitrary, lengths are valid.")
    else:
        sigma = np.sqrt(np.trace(points.covariance_m2, axis1=1, axis2=2) / 2)
        place = spread_text(float(np.median(sigma)), "m", units)
        where = "on the earth"
        if result.world.origin is None:
            where = "relative to the control points and lines, which define east and north,"
        told.append(
            f"The position of the survey as a whole {where} is known to about ± {place} (east, "
            "north): an error in it shifts everything together, and changes no length, area or "
            "angle."
        )
    return " ".join(told)
