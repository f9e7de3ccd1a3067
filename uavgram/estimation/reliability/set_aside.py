"""Adjust without some readings: what they explain of the misfit of all others is gone then."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from uavgram.estimation.reliability.majority import most_gross
from uavgram.estimation.solver.levenberg_marquardt import AT_REST, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.suspicion import Member
from uavgram.estimation.survey.unknowns import State, advance
from uavgram.model.arrays import Bools


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
