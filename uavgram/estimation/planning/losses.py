"""What is left when a line is lost: tapes are misread, marks driven over, cars parked on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.estimation.planning.layouts import (
    LEAST_GAIN,
    PASSES,
    Aim,
    Candidates,
    Chosen,
    covariance_of,
    criterion_of,
    with_one_more,
)
from uavgram.model.arrays import Floats, Ints

WORST = 0.1
"""Weight of the criterion after the worst loss beside that without any."""


def without_each(aim: Aim, candidates: Candidates, lines: Sequence[int]) -> Floats:
    """(L,) the criterion where one of the lines is lost.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    lines
        The layout: candidates by index.
    """
    left = (tuple(one for one in lines if one != lost) for lost in lines)
    return np.array([criterion_of(aim, candidates, some) for some in left])


def surviving(aim: Aim, candidates: Candidates, start: Chosen) -> Chosen:
    """A layout of as many lines that bears the loss of any one of them.

    By exchanges, as `exchanged`; what is made small is the criterion plus `WORST` times that after
    the worst loss.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    start
        Where the exchanges begin: at least two lines.
    """
    lines = list(start.lines)
    value = _score(aim, candidates, lines)
    for _ in range(PASSES):
        before = value
        for place in range(len(lines)):
            others = lines[:place] + lines[place + 1 :]
            among = np.flatnonzero(candidates.apart_from(others))
            found = _scores(aim, candidates, others, among)
            best = int(among[np.argmin(found)])
            changed = [*lines[:place], best, *lines[place + 1 :]]
            if (reached := _score(aim, candidates, changed)) < value * (1.0 - LEAST_GAIN):
                lines, value = changed, reached
        if value > before * (1.0 - LEAST_GAIN):
            break
    return Chosen(tuple(lines), criterion_of(aim, candidates, lines))


def _score(aim: Aim, candidates: Candidates, lines: Sequence[int]) -> float:
    whole = criterion_of(aim, candidates, lines)
    return whole + WORST * float(without_each(aim, candidates, lines).max())


def _scores(aim: Aim, candidates: Candidates, others: list[int], among: Ints) -> Floats:
    """(n,) of layouts of some lines and each of the candidates; upper bounds of the poor ones."""
    worst = np.full(len(among), criterion_of(aim, candidates, others))
    for place in range(len(others)):
        left = others[:place] + others[place + 1 :]
        covariance = covariance_of(aim.information + candidates.information(left))
        worst = np.maximum(worst, with_one_more(aim, candidates, covariance, among))
    covariance = covariance_of(aim.information + candidates.information(others))
    return with_one_more(aim, candidates, covariance, among) + WORST * worst
