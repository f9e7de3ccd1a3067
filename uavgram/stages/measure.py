"""Measure: distances, areas, angles, speeds between ground points, with their joint covariance."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from uavgram.estimation.adjustment import Adjustment
from uavgram.estimation.measurands import (
    Measurand,
    UnmeasurableError,
    measurands,
    require_picked,
    unmeasured,
)
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result import MeasurementResults

UNITS = {"area": "m2", "angle": "deg", "skid_speed": "m/s", "speed": "m/s"}


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
    rows: list[Measurand] = []
    for request in requests:
        try:
            require_picked(request, adjustment.survey.label)
            points = world[[place[p] for p in request.points]]
            rows.extend(measurands(request, points, adjustment.survey, frames))
        except UnmeasurableError as why:
            rows.extend(unmeasured(request))
            text = f"{request.name!r} cannot be measured: {why}."
            messages.append(Message("warning", "measurement-null", text))
    return _results(rows, place, covariance), tuple(messages)


def _results(
    rows: list[Measurand], place: dict[str, int], covariance: Floats
) -> MeasurementResults:
    jacobian = np.zeros((len(rows), len(place), 3))
    for i, row in enumerate(rows):
        if row.gradient is not None:  # a point may occur twice in one outline
            np.add.at(jacobian[i], [place[p] for p in row.request.points], row.gradient)
    flat = jacobian.reshape(len(rows), 3 * len(place))  # either may be 0
    joint = flat @ covariance @ flat.T if len(place) else np.zeros((len(rows), len(rows)))
    sources = sorted({source for row in rows for source in row.others})
    others = np.array([[row.others.get(s, 0.0) for s in sources] for row in rows])
    joint = joint + (others @ others.T if sources else 0.0)
    without = [row.gradient is None for row in rows]
    joint[without] = joint[:, without] = np.nan
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
