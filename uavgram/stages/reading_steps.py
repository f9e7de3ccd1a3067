"""Reading step of a tape: lengths that are all multiples of a decimetre were rounded to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.naming import format_digits
from uavgram.model.observations import KnownLines

FINE_M = 0.01
"""Step of an ordinary reading of a tape [m]."""

COARSE_M = (0.1, 0.05)
"""Steps to which people round [m]."""

PRIOR_ODDS = 0.1
"""Odds that a person rounds to one of these steps, and states a smaller uncertainty."""

SURE_ODDS = 20.0
"""Odds above which lengths count as rounded."""

ROUNDING_M = 1e-6
"""Largest difference of a number from a multiple of a step [m]."""


def find_reading_step(length_m: Floats) -> float:
    """Find the step to which lengths were rounded.

    Parameters
    ----------
    length_m
        (L,) readings.

    Returns
    -------
    step
        In metres; 0 without evidence for rounding.

    Notes
    -----
    Of readings to `FINE_M`, all of L different ones are multiples of a step by a chance of
    (`FINE_M` / step)^L. By Bayes' rule that chance and `PRIOR_ODDS` make the odds.
    """
    different = np.unique(length_m)
    for step in COARSE_M:
        off_m = np.abs(different - step * np.round(different / step))
        by_chance = (FINE_M / step) ** len(different)
        if (off_m < ROUNDING_M).all() and SURE_ODDS * by_chance < PRIOR_ODDS:
            return step
    return 0.0


def apply_reading_step(lines: KnownLines) -> tuple[KnownLines, tuple[Message, ...]]:
    """Enlarge the sigmas of lengths that were rounded more coarsely than their sigmas state.

    Parameters
    ----------
    lines
        All taped lengths, withheld ones too.

    Returns
    -------
    lines, messages
        Lengths with the standard deviation of a rounding, step / sqrt(12), where it exceeds the
        stated one; and a remark if it does.
    """
    rounding_m = find_reading_step(lines.length_m) / np.sqrt(12.0)
    is_finer = lines.sigma_m < rounding_m
    if not is_finer.any():
        return lines, ()
    sigma_m = np.where(is_finer, np.hypot(lines.sigma_m, rounding_m), lines.sigma_m)
    text = (
        f"The taped lengths are multiples of {format_digits(100 * np.sqrt(12.0) * rounding_m)} cm: "
        f"they "
        "were rounded to that, which makes each uncertain by "
        f"{format_digits(100 * rounding_m)} cm, and not {format_digits(100 * lines.sigma_m.min())} "
        f"cm as "
        "stated. The program counts with both. Read the tape to the centimetre for smaller "
        "uncertainties."
    )
    return replace(lines, sigma_m=sigma_m), (Message("info", "lengths-rounded", text),)
