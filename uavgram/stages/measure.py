"""Measure: distances, areas, angles, speeds between ground points, with their joint covariance."""

from __future__ import annotations

from difflib import get_close_matches
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from uavgram.estimation.adjustment import Adjustment
from uavgram.geometry import shapes
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result import MeasurementResults

STANDARD_GRAVITY = 9.80665
"""m/s^2 (CGPM 1901); the local value differs by less than 0.3 %, a speed by less than 0.15 %."""

UNITS = {"area": "m2", "angle": "deg", "skid_speed": "m/s", "speed": "m/s"}
AXES = ("east", "north")


class _Row(NamedTuple):
    """One measured number and how it depends on its points and on what else has a sigma."""

    name: str
    request: MeasurementRequest
    value: float
    gradient: Floats | None
    """(k, 3) by the request's points; None where there is no value."""
    other_variance: float


class _UnmeasurableError(ValueError):
    """Why a measurement has no value."""


def measure(
    adjustment: Adjustment, requests: tuple[MeasurementRequest, ...], frames: Frames
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    """Measure what was asked for.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    requests
        What to measure. A ``coordinate`` gives two rows, its east and north.
    frames
        Times of the exposures, for ``speed``.

    Returns
    -------
    MeasurementResults
        In the order of the requests; NaN where a value cannot be computed.
    messages
        Why not.
    """
    messages: list[Message] = []
    labels = sorted({p for r in requests for p in r.points if adjustment.label_index(p) >= 0})
    index = np.array([adjustment.label_index(p) for p in labels], dtype=np.int64)
    world, covariance = adjustment.joint_points(index) if labels else (np.empty((0, 3)),) * 2
    place = {label: k for k, label in enumerate(labels)}
    rows: list[_Row] = []
    for request in requests:
        try:
            _require_picked(request, adjustment.survey.label)
            points = world[[place[p] for p in request.points]]
            rows.extend(_rows(request, points, adjustment, frames))
        except _UnmeasurableError as why:
            rows.extend(_empty(request))
            text = f"{request.name!r} cannot be measured: {why}."
            messages.append(Message("warning", "measurement-null", text))
    return _results(rows, place, covariance), tuple(messages)


def _require_picked(request: MeasurementRequest, known: tuple[str, ...]) -> None:
    words = []
    for label in request.points:
        if label not in known:
            near = get_close_matches(label, known, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            words.append(f"point {label!r} has no usable pick{hint}")
    if words:
        raise _UnmeasurableError(", ".join(words))


def _rows(
    request: MeasurementRequest, points: Floats, adjustment: Adjustment, frames: Frames
) -> list[_Row]:
    kind = request.kind
    if kind == "coordinate":
        return [
            _Row(f"{request.name} {axis}", request, float(points[0, i]), np.eye(3)[[i]], 0.0)
            for i, axis in enumerate(AXES)
        ]
    if kind == "skid_speed":
        return [_skid_speed(request, points)]
    if kind == "speed":
        return [_speed(request, points, adjustment, frames)]
    value, gradient = getattr(shapes, kind)(points)
    if not np.isfinite(value) or not np.isfinite(gradient).all():
        raise _UnmeasurableError("its points coincide or lie in line")
    if kind == "area" and shapes.polygon_self_intersects(points[:, :2]):
        raise _UnmeasurableError("its outline crosses itself: give the points in order around it")
    if kind == "angle":
        value, gradient = np.rad2deg(value), np.rad2deg(gradient)
    return [_Row(request.name, request, float(value), gradient, 0.0)]


def _skid_speed(request: MeasurementRequest, points: Floats) -> _Row:
    """Speed at the start of a skid to rest: v = sqrt(2 mu g d) (work of friction = energy)."""
    parameters = dict(request.parameters)
    mu, mu_sigma = parameters["mu"], parameters["mu_sigma"]
    length, gradient = shapes.polyline(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise _UnmeasurableError("its points coincide")
    speed = float(np.sqrt(2.0 * mu * STANDARD_GRAVITY * length))
    by_mu = speed / (2.0 * mu)
    return _Row(
        request.name, request, speed, gradient * (speed / (2.0 * length)), (by_mu * mu_sigma) ** 2
    )


def _speed(
    request: MeasurementRequest, points: Floats, adjustment: Adjustment, frames: Frames
) -> _Row:
    """Mean speed between two exposures: distance over the difference of their times.

    The camera's clock offset drops out; each frame's own timing error stays.
    """
    survey = adjustment.survey
    times, variances = [], []
    for label in request.points:
        seen = survey.pick_frame[survey.pick_label == adjustment.label_index(label)]
        if len(seen) != 1:
            raise _UnmeasurableError(
                f"{label!r} is picked in {len(seen)} frames, a speed needs one"
            )
        row = frames.frame_id.index(survey.frame_id[seen[0]])
        times.append(frames.time_utc_s[row])
        variances.append(frames.sigma_time_s[row] ** 2)
    elapsed = abs(times[1] - times[0])
    if not np.isfinite(elapsed) or elapsed == 0:
        raise _UnmeasurableError("its two frames have no time, or the same")
    length, gradient = shapes.distance(points)
    if length <= 0 or not np.isfinite(gradient).all():
        raise _UnmeasurableError("its points coincide")
    speed = float(length / elapsed)
    return _Row(
        request.name, request, speed, gradient / elapsed, (speed / elapsed) ** 2 * sum(variances)
    )


def _empty(request: MeasurementRequest) -> list[_Row]:
    names = [request.name]
    if request.kind == "coordinate":
        names = [f"{request.name} {axis}" for axis in AXES]
    return [_Row(name, request, np.nan, None, np.nan) for name in names]


def _results(rows: list[_Row], place: dict[str, int], covariance: Floats) -> MeasurementResults:
    jacobian = np.zeros((len(rows), len(place), 3))
    for i, row in enumerate(rows):
        if row.gradient is not None:  # a point may occur twice in one outline
            np.add.at(jacobian[i], [place[p] for p in row.request.points], row.gradient)
    flat = jacobian.reshape(len(rows), 3 * len(place))  # either may be 0
    joint = flat @ covariance @ flat.T if len(place) else np.zeros((len(rows), len(rows)))
    joint[np.diag_indices(len(rows))] += [row.other_variance for row in rows]
    sigma = np.sqrt(np.diag(joint))
    value = np.array([row.value for row in rows])
    reach = float(norm.ppf(0.975)) * sigma
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = joint / np.outer(sigma, sigma)
    correlation[~np.isfinite(correlation)] = np.nan
    return MeasurementResults(
        name=tuple(row.name for row in rows),
        kind=tuple(row.request.kind for row in rows),
        points=tuple(row.request.points for row in rows),
        value=value,
        sigma=sigma,
        unit=tuple(UNITS.get(row.request.kind, "m") for row in rows),
        interval_95=np.column_stack([value - reach, value + reach]),
        correlation=correlation,
    )
