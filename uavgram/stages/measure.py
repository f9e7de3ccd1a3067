"""Measure: distances, areas, angles, speeds between ground points, with their joint covariance."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.measuring.shifts import Shifts
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.flight.frames import Frames
from uavgram.model.message import Message, Several
from uavgram.model.result.tables import MeasurementResults
from uavgram.model.survey.observations import MeasurementRequest


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
    return measurement_results(propagate(adjustment, requests, frames))


def measurement_results(
    measured: MeasuredValues, shifted: Shifts | None = None
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    """What was measured as a table of the result, and why the rest was not.

    Parameters
    ----------
    measured
        The values.
    shifted
        What relief and a wrong tape would do to them; None where nobody asks for it.
    """
    sigma, value = measured.sigma, measured.value
    reach = float(ndtri(0.975)) * sigma
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = measured.covariance / np.outer(sigma, sigma)
    correlation[~np.isfinite(correlation)] = np.nan
    results = MeasurementResults(
        name=measured.name,
        kind=tuple(row.request.kind for row in measured.rows),
        points=tuple(row.request.points for row in measured.rows),
        value=value,
        sigma=sigma,
        unit=measured.unit,
        interval_95=np.column_stack([value - reach, value + reach]),
        correlation=correlation,
        shift_relief_10cm=np.zeros(0) if shifted is None else shifted.relief,
        shift_tape_1pct=np.zeros(0) if shifted is None else shifted.tape,
        parameters=tuple(row.request.parameters_text for row in measured.rows),
    )
    messages = tuple(
        Message(
            "warning",
            "measurement-null",
            f"{name!r} cannot be measured: {why}.",
            measurements=(name,),
            several=Several("{count} measurements have no value", repr(name), why),
        )
        for name, why in measured.why_not
    )
    return results, messages
