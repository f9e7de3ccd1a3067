"""Plan of a flight for the terminal."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.planned import FlightPlanned, Gain, NextLines
from uavgram.views.flight_plan import (
    centimetres,
    describe_accuracy,
    describe_criterion,
    lay_table,
    metres,
    specify_lengths,
    summarise_work,
    value_table,
)
from uavgram.views.tables import format_table
from uavgram.views.terminal import message_lines


def plan_lines(planned: FlightPlanned) -> list[str]:
    """List the planned work, the expected result and other choices.

    Parameters
    ----------
    planned
        The plan.
    """
    flight = planned.flight
    shown = [summarise_work(planned), *describe_accuracy(planned), ""]
    shown += [
        f"Flight: {flight.pattern}, {metres(flight.height_m)} above the ground, gimbal at "
        f"{flight.gimbal_pitch_deg:g} degrees, {flight.duration_s / 60:.1f} of "
        f"{flight.battery_s / 60:g} minutes; a pixel is {centimetres(flight.ground_sample_m)}.",
        "",
    ]
    if planned.lines.name or planned.plates.name:
        shown += [format_table(lay_table(planned, are_ways_shown=False)), ""]
    if planned.measurements.name:
        shown += [format_table(value_table(planned)), ""]
    mean = _sigma(planned, planned.mean_sigma)
    shown.append(f"On average{specify_lengths(planned)} expect ± {mean}. Other choices:")
    shown += [f"  {_gain(planned, gain)}" for gain in planned.gains]
    messages = message_lines(planned.messages)
    shown += ["", text] if (text := describe_criterion(planned)) else []
    return [*shown, *(["", *messages] if messages else [])]


def _gain(planned: FlightPlanned, gain: Gain) -> str:
    change = _change(gain.mean_sigma, planned.mean_sigma)
    told = f"{gain.what}: ± {_sigma(planned, gain.mean_sigma)}, {change}"
    if gain.worst_without is None:
        return told
    here = float(np.max(planned.laid.mean_sigma_without))
    beside = "there would be no scale" if math.isnan(here) else f"± {_sigma(planned, here)}"
    what = "plate" if planned.plates.name else "line"
    return (
        f"{told}; with its most important {what} lost ± {_sigma(planned, gain.worst_without)}, "
        f"where in this plan {beside}"
    )


def _sigma(planned: FlightPlanned, sigma: float) -> str:
    """Format a mean sigma: of lengths if any are wanted, else in the unit of the first value."""
    unit = planned.measurements.unit
    return _of_unit(sigma, "m" if not unit or "m" in unit else unit[0])


def next_line_lines(found: NextLines) -> list[str]:
    """List the gain of one more line and the loss without each taken line, for the terminal.

    Parameters
    ----------
    found
        Gains and losses.
    """
    mean = _of_unit(found.mean_sigma, found.unit)
    shown = [f"The measurements are known to ± {mean} on average. One more line would have given:"]
    for i, (start, end) in enumerate(found.near):
        length = float(np.linalg.norm(found.end_world_m[i] - found.start_world_m[i]))
        first, second = (metres(float(away)) for away in found.near_m[i])
        shown.append(
            f"  ± {_of_unit(float(found.with_it[i]), found.unit)}, "
            f"{_change(float(found.with_it[i]), found.mean_sigma)}: {metres(length)} from near "
            f"{start} ({first} away) to near {end} ({second} away)"
        )
    if found.name:
        shown += ["", "One line less would have meant:"]
    for name, sigma in zip(found.name, found.without_it.tolist(), strict=True):
        what = "the survey has no scale" if math.isnan(sigma) else ""
        what = what or f"± {_of_unit(sigma, found.unit)}, {_change(sigma, found.mean_sigma)}"
        shown.append(f"  without {name}: {what}")
    return shown


def _change(sigma: float, before: float) -> str:
    percent = 100.0 * (sigma / before - 1.0)
    if abs(percent) < 1.0:
        return "no better and no worse"
    return f"{abs(percent):.0f} % {'worse' if percent > 0 else 'better'}"


def _of_unit(sigma: float, unit: str) -> str:
    return centimetres(sigma) if unit == "m" else f"{sigma:.2g} {unit}"
