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
    """Of the points off the ground that were picked: heights over the ground.

    One that the run takes for a point of the ground has no value.
    """
    picked = np.unique(survey.pick_label[survey.off_ground[survey.pick_label]])
    at = {label: row for row, label in enumerate(points.label)}
    height, sigma = np.full((2, len(picked)), np.nan)
    for i, label in enumerate(picked):
        row = at.get(f"P{label}")
        if row is not None and points.is_off_ground[row]:
            height[i], sigma[i] = points.height_above_ground_m[row], points.height_sigma_m[row]
    return errors(tuple(f"P{label}" for label in picked), height - survey.height_m[picked], sigma)


def distance_errors(survey: HostileSurvey, measured: MeasurementResults) -> Errors:
    """Of all distances."""
    rows = [i for i, kind in enumerate(measured.kind) if kind == "distance"]
    name = tuple(measured.name[i] for i in rows)
    truth = np.array([survey.truth[one] for one in name])
    return errors(name, measured.value[rows] - truth, measured.sigma[rows])


@dataclass(frozen=True, kw_only=True)
class Named:
    """Which points a run says are off the ground, of a survey that does not state it.

    Attributes
    ----------
    due, found, right
        Points that two photos see well and that are higher than HIGH_M; those of them that are
        named; those that are named with their height within three sigmas.
    ground, accused
        Points of the ground that are picked; those of them that are named.
    """

    due: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    right: tuple[str, ...] = ()
    ground: tuple[str, ...] = ()
    accused: tuple[str, ...] = ()


HIGH_M, LEAST_BASE = 0.3, 0.2


def named(survey: HostileSurvey, points: PointResults) -> Named:
    """What a run says of a survey."""
    base = widest_base(survey)
    truth = {f"P{label}": label for label in np.unique(survey.pick_label).tolist()}
    off = {label for label, here in zip(points.label, points.is_off_ground, strict=True) if here}
    row = {label: i for i, label in enumerate(points.label)}
    due = [n for n, k in truth.items() if survey.height_m[k] > HIGH_M and base[k] >= LEAST_BASE]
    found = [name for name in due if name in off]
    error = {n: points.height_above_ground_m[row[n]] - survey.height_m[truth[n]] for n in found}
    ground = [name for name, k in truth.items() if not survey.off_ground[k]]
    return Named(
        due=tuple(due),
        found=tuple(found),
        right=tuple(n for n in found if abs(error[n]) < 3 * points.height_sigma_m[row[n]]),
        ground=tuple(ground),
        accused=tuple(name for name in ground if name in off),
    )


def widest_base(survey: HostileSurvey) -> Floats:
    """(k,) base to height of the two photos that show a point from the most different sides.

    Between rays at an angle a it is 2 tan(a / 2): base over height where both look down.
    """
    widest = np.zeros(len(survey.world_m))
    for label in range(len(widest)):
        photos = np.unique(survey.pick_photo[survey.pick_label == label])
        ray = survey.center_m[photos] - survey.world_m[label]
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        if len(ray) > 1:
            angle = np.arccos(np.clip(ray @ ray.T, -1.0, 1.0))
            widest[label] = 2 * np.tan(angle.max() / 2)
    return widest
