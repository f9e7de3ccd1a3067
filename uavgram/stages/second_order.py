"""Second order: which measurements need more than first-order propagation, and by how much."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.measuring.second_order import curvature
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.flight.frames import Frames
from uavgram.model.message import Message, Several
from uavgram.model.naming import figures
from uavgram.model.result.reliability import SecondOrder
from uavgram.model.result.tables import MeasurementResults

SIGMA_OFF = 0.05
"""Difference of second- and first-order sigma, as a share, from which first order is off."""

BIAS_OFF = 0.2
"""Second-order bias, in sigmas, from which first order is off: a 95 % interval about the value
then holds the truth in 94.5 % of cases, but misses it twice as often on one side."""


def second_order(
    adjustment: Adjustment,
    measured: MeasuredValues,
    results: MeasurementResults,
    frames: Frames,
) -> tuple[SecondOrder | None, tuple[Message, ...]]:
    """Compare second-order with first-order bias and sigma; None where nothing was measured.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    measured, results
        What was measured, and its first-order results.
    frames
        As they were measured.
    """
    if not measured.rows:
        return None, ()
    terms = curvature(adjustment, measured, frames)
    computed = np.isfinite(results.value) & (results.sigma > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = terms.sigma / results.sigma
        shift = terms.bias / results.sigma
    within = (np.abs(ratio - 1.0) <= SIGMA_OFF) & (np.abs(shift) <= BIAS_OFF)
    off = computed & ~within
    found = SecondOrder(bias=terms.bias, sigma=terms.sigma, curvature=terms.curvature, off=off)
    where = np.flatnonzero(off).tolist()
    return found, tuple(_message(results, terms.bias[i], terms.sigma[i], i) for i in where)


def _message(results: MeasurementResults, bias: float, sigma: float, i: int) -> Message:
    unit = results.unit[i]
    if np.isfinite(sigma):
        why = (
            f"with second-order terms its sigma is {figures(sigma, 3)} instead of "
            f"{figures(results.sigma[i], 3)} "
            f"{unit}, and its mean is off by {figures(bias, 3, sign='+')} {unit}"
        )
    else:
        why = "observations that differ by little more than their sigmas have no solution"
    text = (
        f"The uncertainty of {results.name[i]!r} is approximate: {why}. Run again with "
        "--monte-carlo for its exact interval."
    )
    several = Several(
        "The uncertainties of {count} measurements are approximate",
        repr(results.name[i]),
        why,
        "Run again with --monte-carlo for their exact intervals.",
    )
    return Message(
        "warning",
        "first-order-doubtful",
        text,
        measurements=(results.name[i],),
        several=several,
    )
