"""Few observations that stand out of the noise of all others: blunders, and no noise.

What is said of the size of errors must not be learnt from them; and where everything else fits, a
survey in which blunders are only reported gives them as little weight as their own misfit deserves.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.reliability.data_snooping import RIVAL
from uavgram.estimation.reliability.redundancy import level_of_each, upper_tail
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

MISFIT = 0.05
"""Probability below which picks, lengths and ground fit so badly that noise is in question."""

FEW = 0.01
"""Share of the observations, and at least one, that may be blunders and no noise."""

CLEAR = 0.001
"""Significance of the test, at the noise of the rest, of what may be a blunder and no noise."""

LEAST_REDUNDANCY = 0.05
"""Redundancy number from which on the size of an error can be told."""

CORE = ("pixels", "lengths", "known", "control", "calibration", "roughness", "heights", "relief")
"""Groups that say whether the model of picks and ground holds: priors of the telemetry are meant to
be generous."""


_Fall = tuple[float, str, int]
"""By which the sum of squares falls without an observation; its group and row."""


class Outstanding(NamedTuple):
    """Observations of a group that stand out.

    Attributes
    ----------
    rows
        (n,) which.
    errors
        (n,) size of their errors, in their sigmas.
    located
        (n,) whether it must be these, and not another pick of the same point, or another length.
    """

    rows: Ints
    errors: Floats
    located: Bools


class CoreFit(NamedTuple):
    """How picks, lengths, ground and camera fit together, telemetry left aside.

    Attributes
    ----------
    squares, degrees
        Weighted sum of squares, and redundancy, of these groups.
    probability
        Of so large a sum by chance.
    """

    squares: float
    degrees: float
    probability: float


def core_fit(adjustment: Adjustment) -> CoreFit:
    """Sum of squares of the groups that say whether the model holds (see `CORE`)."""
    blocks = adjustment.minimum.blocks
    core = [name for name in blocks if name in CORE or name.startswith("plane")]
    squares = sum(float(np.sum(blocks[name].residual ** 2)) for name in core)
    degrees = sum(redundancy_of(adjustment, name) for name in core)
    return CoreFit(squares, degrees, upper_tail(squares, degrees))


def outstanding(adjustment: Adjustment) -> tuple[dict[str, Outstanding], bool]:
    """Rows of few observations that stand out of all noise; and whether everything else fits."""
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    squares, degrees, _ = core_fit(adjustment)
    falls: list[_Fall] = []
    for name in ("pixels", "lengths", "known"):
        if name in blocks:
            fall = falls_without(blocks[name], covariance)
            falls += [(each, name, row) for row, each in enumerate(fall.tolist())]
    worst = sorted(falls, reverse=True)[: max(1, int(FEW * len(falls)))]
    rest = squares - sum(fall for fall, *_ in worst)
    noise = max(rest / max(degrees - 2.0 * len(worst), 1.0), 1.0)
    limit = {name: noise * _limit(blocks[name]) for name in blocks}
    worst = [one for one in worst if one[0] > limit[one[1]]]
    gone = sum(blocks[name].residual.shape[1] for _, name, _ in worst)
    fits = upper_tail(squares - sum(fall for fall, *_ in worst), degrees - gone) >= MISFIT
    groups = dict.fromkeys(name for _, name, _ in worst)
    return {name: _of_group(adjustment, name, worst, falls) for name in groups}, fits


def _limit(block: Block) -> float:
    """Fall of the sum of squares without one of n observations that is hardly chance."""
    n, axes = block.residual.shape
    return float(chdtri(axes, level_of_each(CLEAR, n)))


def _of_group(
    adjustment: Adjustment, name: str, worst: list[_Fall], falls: list[_Fall]
) -> Outstanding:
    own = [(fall, row) for fall, group, row in worst if group == name]
    fall, rows = np.array([one[0] for one in own]), np.array([one[1] for one in own])
    leverage = adjustment.covariance.leverage(adjustment.minimum.blocks[name])
    redundancy = np.clip(1.0 - leverage[rows].mean(axis=1), LEAST_REDUNDANCY, 1.0)
    point = adjustment.survey.pick_label if name == "pixels" else np.zeros(len(leverage), dtype=int)
    rival = np.array([each for each, group, _ in falls if group == name])
    near = (rival > fall[:, None] - RIVAL) & (point == point[rows][:, None])
    errors = np.sqrt(np.maximum(fall / redundancy, 1.0))
    return Outstanding(rows, errors, near.sum(axis=1) == 1)


def redundancy_of(adjustment: Adjustment, name: str) -> float:
    """Share of the degrees of freedom that a group of observations has."""
    block = adjustment.minimum.blocks[name]
    return block.residual.size - float(adjustment.covariance.leverage(block).sum())


def with_little_weight(problem: SurveyProblem, few: dict[str, Outstanding]) -> Survey:
    """The survey with sigmas of what stands out as large as its errors.

    The variance-inflation model of an outlier (Cook, Holschuh and Weisberg 1982, "A note on an
    alternative outlier model"), with the size of the error for the sigma.

    Parameters
    ----------
    problem
        The likelihood of an adjustment.
    few
        What stands out of it.
    """
    survey = problem.survey
    pick, length = np.array(survey.pick_sigma_px), np.array(survey.length_sigma_m)
    located = {name: (one.rows[one.located], one.errors[one.located]) for name, one in few.items()}
    if "pixels" in located:
        rows, errors = located["pixels"]
        pick[rows] *= errors
    if "lengths" in located:
        rows, errors = located["lengths"]
        length[problem.line_index[rows]] *= errors
    factor: dict[int, float] = {}
    if "known" in located:
        for row, error in zip(*located["known"], strict=True):
            index = problem.known[int(problem.known_thing[row])].index
            factor[index] = max(float(error), factor.get(index, 1.0))
    known = tuple(
        replace(one, sigma=one.sigma * factor.get(one.index, 1.0)) for one in survey.known
    )
    return replace(survey, pick_sigma_px=pick, length_sigma_m=length, known=known)
