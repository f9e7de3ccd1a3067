"""Test whether something that the model leaves out explains the misfits.

Each hypothesis adds unknowns that move the predicted observations along known directions. In the
linear model the fall of the weighted sum of squares, the values of these unknowns and what of them
can be told follow from the residuals (Teunissen 2006, "Testing theory", ch. 3 to 5; Baarda's w-test
is the case of one observation and one unknown).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc, gammaln

from uavgram.estimation.reliability.redundancy import most_gross
from uavgram.estimation.solver.levenberg_marquardt import AT_REST, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.observation import Member
from uavgram.estimation.survey.unknowns import State, advance
from uavgram.model.arrays import Bools, Floats, Ints

CHECKED = 0.01
"""Share of a direction that has to show in the residuals for its unknown to be tested."""

SMALLEST = 1e-290
"""Probability below which its logarithm is that of the leading term of the tail."""


@dataclass(frozen=True, eq=False)
class Moved:
    """How unknowns that the model leaves out move the predictions of a group of observations.

    Attributes
    ----------
    kind
        The group.
    rows
        (m,) its observations that are moved.
    along
        (m, r, q) derivatives of their whitened predictions by the q unknowns.
    """

    kind: str
    rows: Ints
    along: Floats


class Explained(NamedTuple):
    """What a hypothesis explains.

    Attributes
    ----------
    gain
        Fall of the weighted sum of squares.
    unknowns
        How many of its unknowns anything checks.
    value
        (q,) the unknowns; 0 along combinations that nothing checks.
    covariance
        (q, q) of them; infinite where nothing checks one of them.
    """

    gain: float
    unknowns: int
    value: Floats
    covariance: Floats


def explained(
    adjustment: Adjustment, hypotheses: Sequence[Sequence[Moved]], checked: float = CHECKED
) -> tuple[Explained, ...]:
    """What each hypothesis explains of the misfits of an adjustment.

    Parameters
    ----------
    adjustment
        At rest.
    hypotheses
        Each by the groups that it moves, all with the same number of unknowns.
    checked
        Share of a direction that has to show in the residuals for its unknown to be tested.

    Notes
    -----
    With residuals v (predicted less observed), directions C and normal matrix N = A^T A, the
    unknowns are x = -R^-1 C^T v with R = C^T (I - A N^-1 A^T) C, as A^T v = 0 at rest; the sum of
    squares falls by x^T R x.
    """
    if not hypotheses:
        return ()
    blocks, size = adjustment.minimum.blocks, adjustment.problem.layout.size
    counts = [moved[0].along.shape[2] for moved in hypotheses]
    first = np.concatenate([[0], np.cumsum(counts)])
    right = np.zeros((size, int(first[-1])))
    scores, plain = [], []
    for moved, start, count in zip(hypotheses, first, counts, strict=False):
        score, own = np.zeros(count), np.zeros((count, count))
        for part in moved:
            block = blocks[part.kind]
            by_unknown = np.einsum("mrq,mrk->mkq", part.along, block.jacobian[part.rows])
            np.add.at(
                right[:, start : start + count],
                block.columns[part.rows].ravel(),
                by_unknown.reshape(-1, count),
            )
            score += np.einsum("mrq,mr->q", part.along, block.residual[part.rows])
            own += np.einsum("mrq,mrp->qp", part.along, part.along)
        scores.append(score)
        plain.append(own)
    solved = adjustment.minimum.factor.solve(right)
    found = []
    for start, count, score, own in zip(first, counts, scores, plain, strict=False):
        span = slice(int(start), int(start) + count)
        found.append(_explained(score, own, own - right[:, span].T @ solved[:, span], checked))
    return tuple(found)


def _explained(score: Floats, plain: Floats, information: Floats, least: float) -> Explained:
    """Of one hypothesis, from C^T v, C^T C and R."""
    length = np.sqrt(np.maximum(plain.diagonal(), 0.0))
    scale = np.where(length > 0, 1.0 / np.where(length > 0, length, 1.0), 0.0)
    share, axes = np.linalg.eigh(information * np.outer(scale, scale))
    checked = share > least
    along = axes[:, checked]
    inverse = scale[:, None] * along
    value = -inverse @ ((inverse.T @ score) / share[checked])
    covariance = (inverse / share[checked]) @ inverse.T
    loose = np.abs(axes[:, ~checked]).max(axis=1, initial=0.0) > 1e-6
    covariance[loose, loose] = np.inf
    gain = float(np.sum((inverse.T @ score) ** 2 / share[checked]))
    return Explained(gain, int(checked.sum()), value, covariance)


def log_probability(gain: float, unknowns: int, count: int = 1) -> float:
    """Logarithm of the probability that one of so many hypotheses explains as much by chance.

    Parameters
    ----------
    gain
        Fall of the weighted sum of squares.
    unknowns
        That the hypothesis adds.
    count
        Hypotheses of its kind that were possible.

    Notes
    -----
    The tail of chi-square, times the count (Bonferroni), at most one.
    """
    if gain <= 0.0 or unknowns == 0:
        return 0.0
    half = unknowns / 2.0
    probability = float(gammaincc(half, gain / 2.0))
    if probability > SMALLEST:
        tail = float(np.log(probability))
    else:  # Abramowitz and Stegun 6.5.32
        tail = -gain / 2.0 + (half - 1.0) * float(np.log(gain / 2.0)) - float(gammaln(half))
    return min(0.0, tail + float(np.log(count)))


def set_aside(adjustment: Adjustment, members: Iterable[Member]) -> Adjustment:
    """Adjust without some readings.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    members
        The readings. Priors among them stay, and so do all where the rest determines nothing, or
        where there are too many of a kind to be the exception: that kind is less exact than stated.

    Returns
    -------
    Of the same likelihood; the blocks lack the rows that were set aside.
    """
    problem = adjustment.problem
    keep = _kept(adjustment, members)
    if not keep:
        return adjustment

    def evaluate(now: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(now)
        if blocks is None:
            return None
        return blocks | {name: _rows(blocks[name], rows) for name, rows in keep.items()}

    layout = problem.layout
    try:
        minimum = minimise(
            adjustment.state,
            evaluate,
            lambda now, step: advance(layout, now, step),
            layout.size,
            layout.structure,
            at_rest=AT_REST,
        )
        rest = Adjustment(problem, minimum, minimum.factor.covariance())
    except SingularError:  # a reading that nothing else can replace
        return adjustment
    return rest if minimum.converged else adjustment


def _kept(adjustment: Adjustment, members: Iterable[Member]) -> dict[str, Bools]:
    """Rows that take part, of each kind of readings that has others."""
    keep = {
        kind: np.ones(len(block.residual), dtype=np.bool_)
        for kind, block in adjustment.minimum.blocks.items()
        if kind in READINGS
    }
    for member in members:
        if member.kind in keep:
            thing = adjustment.problem.observations[member.kind].things()
            own = member.row if thing is None else thing == thing[member.row]
            keep[member.kind][own] = False
    return {
        kind: rows
        for kind, rows in keep.items()
        if rows.any() and 0 < (~rows).sum() <= most_gross(len(rows))
    }


def _rows(block: Block, rows: Bools) -> Block:
    return Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
