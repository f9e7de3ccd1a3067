"""Kinds of measurements: the value of each, and its derivatives by its points.

A kind is one function of the world coordinates of its points, and, if it is measured from the
ground, of the places on the ground straight below them; stages turn the gradients into sigmas, or
sample the values.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np

from uavgram.errors import suggest_spelling
from uavgram.estimation.survey.ground_planes import find_ground_below
from uavgram.geometry.ground import measurements
from uavgram.geometry.ground.measurements import UnmeasurableError
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.observations import MeasurementRequest
from uavgram.model.survey import Survey

STANDARD_GRAVITY = 9.80665
"""Standard gravity [m/s^2] (CGPM 1901); the local value differs by less than 0.3 %, a speed by less
than 0.15 %."""

AXES = ("east", "north")

BELOW_PREFIX = "roughness of the ground below "
"""Prefix of the label in the name of such a source of error."""


class Measurand(NamedTuple):
    """One measured number and its derivatives by its points and by other sources with a sigma."""

    name: str
    request: MeasurementRequest
    value: float
    gradient: Floats | None
    """(k, 3) by the request's points; None if there is no value."""
    others: Mapping[str, float]
    """Other sources of error by name (``time of IMG_1.jpg``): signed derivative times sigma. Two
    values that share a source are correlated through it."""
    by_feet: Floats | None = None
    """(k, 3) by the places on the smooth ground straight below the points; None: no dependence."""


def no_error(source: str) -> float:  # noqa: ARG001  (the error of every source)
    """Return no error for any source."""
    return 0.0


def require_picked(
    request: MeasurementRequest, known: Collection[str], picked: Collection[str] = ()
) -> None:
    """Check that every point of a request is among the known labels.

    Parameters
    ----------
    request
        Requested measurement.
    known
        Labels that were adjusted.
    picked
        Labels with picks, which may have been left out.

    Raises
    ------
    UnmeasurableError
        Names the labels that are missing, with the nearest spelling.
    """
    words = []
    for label in request.points:
        if label not in known:
            near = "" if label in picked else suggest_spelling(label, known)
            words.append(f"point {label!r} has no usable pick" + (f" ({near})" if near else ""))
    if words:
        raise UnmeasurableError(", ".join(words))


def compute_measurands(
    request: MeasurementRequest,
    points: Floats,
    survey: Survey,
    frames: Frames,
    error: Callable[[str], float] = no_error,
    feet: Floats | None = None,
) -> list[Measurand]:
    """Compute the values of one request, with gradients.

    Parameters
    ----------
    request
        Requested measurement.
    points
        (k, 3) world coordinates of its points.
    survey, frames
        For ``speed``: the frames that see the points, and their times. For measurements from the
        ground: the points off it, and its roughness.
    error
        Function that returns the error of another source (friction, a time) by its name, in its
        sigmas; used to sample them.
    feet
        (k, 3) places on the smooth ground straight below the points; needed if `refers_to_ground`.

    Raises
    ------
    UnmeasurableError
        There is no value, or no derivative, for these points.
    """
    kind = request.kind
    if kind == "coordinate":
        return [
            Measurand(f"{request.name} {axis}", request, float(points[0, i]), np.eye(3)[[i]], {})
            for i, axis in enumerate(AXES)
        ]
    if kind == "skid_speed":
        return [_compute_skid_speed(request, points, error)]
    if kind == "speed":
        return [_compute_speed(request, points, survey, frames, error)]
    if refers_to_ground(request):
        if feet is None:
            raise ValueError(f"{kind} of {request.points} needs the feet of its points")
        return [_measure_over_ground(request, points, feet, survey, error)]
    value, gradient = measurements.measure_shape(kind, points, dict(request.parameters))
    return [Measurand(request.name, request, value, gradient, {})]


def refers_to_ground(request: MeasurementRequest) -> bool:
    """Return whether a request is measured from the ground straight below its points."""
    parameters = dict(request.parameters)
    return measurements.refers_to_ground(request.kind, len(request.points), parameters)


def _compute_skid_speed(
    request: MeasurementRequest, points: Floats, error: Callable[[str], float]
) -> Measurand:
    """Compute the speed at the start of a skid to rest: v = sqrt(2 mu g d) (friction = energy)."""
    parameters = dict(request.parameters)
    source, mu_sigma = f"friction of {request.name}", parameters["mu_sigma"]
    mu = parameters["mu"] + mu_sigma * error(source)
    if mu <= 0:
        raise UnmeasurableError("its friction is not positive")
    length, gradient = measurements.polyline(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise UnmeasurableError("its points coincide")
    speed = float(np.sqrt(2.0 * mu * STANDARD_GRAVITY * length))
    by_mu = speed / (2.0 * mu)
    friction = {source: by_mu * mu_sigma}
    return Measurand(request.name, request, speed, gradient * (speed / (2.0 * length)), friction)


def _compute_speed(
    request: MeasurementRequest,
    points: Floats,
    survey: Survey,
    frames: Frames,
    error: Callable[[str], float],
) -> Measurand:
    """Compute the mean speed between two exposures: distance over the difference of their times.

    The camera's clock offset cancels; each frame's own timing error remains.
    """
    times, sources = [], []
    for label in request.points:
        seen = survey.pick_frame[survey.pick_label == survey.label.index(label)]
        if len(seen) != 1:
            raise UnmeasurableError(f"{label!r} is picked in {len(seen)} frames, a speed needs one")
        row = frames.frame_id.index(survey.frame_id[seen[0]])
        sources.append((f"time of {frames.frame_id[row]}", float(frames.sigma_time_s[row])))
        times.append(frames.time_utc_s[row] + sources[-1][1] * error(sources[-1][0]))
    elapsed = times[1] - times[0]
    if not np.isfinite(elapsed) or elapsed == 0:
        raise UnmeasurableError("its two frames have no time, or the same")
    length, gradient = measurements.distance(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise UnmeasurableError("its points coincide")
    speed = float(length / abs(elapsed))
    by_time = (speed / elapsed, -speed / elapsed)  # by the first and by the second time
    timing = {
        source: derivative * sigma
        for (source, sigma), derivative in zip(sources, by_time, strict=True)
    }
    return Measurand(request.name, request, speed, gradient / abs(elapsed), timing)


def _measure_over_ground(
    request: MeasurementRequest,
    points: Floats,
    feet: Floats,
    survey: Survey,
    error: Callable[[str], float],
) -> Measurand:
    """Measure from the ground below, with the contribution of its roughness to the sigma."""
    label = np.array([survey.label.index(one) for one in request.points])
    below = find_ground_below(survey, label, points, feet)
    if request.kind == "height" and below.is_determined.all():
        raise UnmeasurableError(
            _explain_height(request.points[0], float(survey.height_above_m[label][0]))
        )
    sources = [f"{BELOW_PREFIX}{one}" for one in request.points]
    lifted = below.feet.copy()
    lifted[:, 2] += below.sigma_m * [error(one) for one in sources]
    value, by_points, by_feet = measurements.measure_over_ground(
        request.kind, points, lifted, dict(request.parameters)
    )
    effects = dict(zip(sources, (by_feet[:, 2] * below.sigma_m).tolist(), strict=True))
    told = below.is_determined[:, None]
    return Measurand(
        request.name,
        request,
        value,
        by_points + np.where(told, by_feet, 0.0),
        {source: effect for source, effect in effects.items() if effect},
        np.where(told, 0.0, by_feet),
    )


def _explain_height(label: str, height_m: float) -> str:
    """Explain why the height of a point cannot be measured."""
    where = f"is {height_m:g} m over it, as stated" if height_m else "is a point on it"
    return (
        f"the height is that over the ground, and {label!r} {where}: write `free` as the "
        "height_m of its picks, to have it found"
    )


def make_unmeasured(request: MeasurementRequest) -> list[Measurand]:
    """Return NaN rows for a request that cannot be measured."""
    names = [request.name]
    if request.kind == "coordinate":
        names = [f"{request.name} {axis}" for axis in AXES]
    return [Measurand(name, request, np.nan, None, {}) for name in names]
