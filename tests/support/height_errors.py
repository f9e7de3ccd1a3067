"""Errors of heights and distances of a made-up survey, against its truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hostile_surveys import HostileSurvey

from uavgram.model.arrays import Floats
from uavgram.model.result.tables import MeasurementResults, PointResults


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors and sigmas of what has a value [m], names of all that has, and of what has none."""

    error: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()
    name: tuple[str, ...] = ()
    without_value: tuple[str, ...] = ()

    @property
    def z(self) -> Floats:
        """(n,) errors over sigmas."""
        return np.asarray(np.array(self.error) / np.array(self.sigma))


def errors(name: tuple[str, ...], error: Floats, sigma: Floats) -> Errors:
    """Of (n,) values; NaN is no value."""
    found = np.isfinite(error)
    return Errors(
        error=tuple(error[found].tolist()),
        sigma=tuple(sigma[found].tolist()),
        name=tuple(np.array(name, dtype=object)[found]),
        without_value=tuple(np.array(name, dtype=object)[~found]),
    )


def height_errors(survey: HostileSurvey, points: PointResults) -> Errors:
    """Of the points off the ground that were picked: heights over the ground."""
    picked = np.unique(survey.pick_label[survey.off_ground[survey.pick_label]])
    at = {label: row for row, label in enumerate(points.label)}
    height, sigma = np.full((2, len(picked)), np.nan)
    for i, label in enumerate(picked):
        row = at.get(f"P{label}")
        if row is not None:
            height[i], sigma[i] = points.height_above_ground_m[row], points.height_sigma_m[row]
    return errors(tuple(f"P{label}" for label in picked), height - survey.height_m[picked], sigma)


def distance_errors(survey: HostileSurvey, measured: MeasurementResults) -> Errors:
    """Of all distances."""
    rows = [i for i, kind in enumerate(measured.kind) if kind == "distance"]
    name = tuple(measured.name[i] for i in rows)
    truth = np.array([survey.truth[one] for one in name])
    return errors(name, measured.value[rows] - truth, measured.sigma[rows])
