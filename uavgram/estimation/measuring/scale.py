"""What the scale of a survey rests on: the known lengths, and all else."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Block, NormalEquations, SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.tapes import taped_lines
from uavgram.estimation.survey.size import by_size
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey

NOTHING = 0.3
"""Relative sigma from which on something does not bear on the scale."""


class ScaleSigmas(NamedTuple):
    """Relative standard deviations of the size of all.

    Attributes
    ----------
    all
        Of the points' extent, by everything.
    lengths
        Of a factor common to the known lengths, by their readings and tapes; inf without any.
    others
        Of the same factor, by all the rest: log, control, stated heights; inf where nothing else
        bears on it. What the survey learns of itself does not: see estimation/survey/size.
    """

    all: float
    lengths: float
    others: float


def scale_sigmas(adjustment: Adjustment) -> ScaleSigmas:
    """How well the scale is known, and by what."""
    everything = _of_extent(adjustment)
    if "lengths" not in adjustment.minimum.blocks:
        return ScaleSigmas(everything, np.inf, everything)
    survey, line = adjustment.survey, adjustment.problem.line_index
    own = _of_readings(survey, line)
    return ScaleSigmas(everything, own, _of_others(adjustment))


def _of_readings(survey: Survey, line: Ints) -> float:
    """Sigma of a factor common to all lengths: by the readings of each tape, and its own scale."""
    readings = (survey.length_m[line] / survey.length_sigma_m[line]) ** 2
    tapes = np.array(taped_lines(survey, line).tape)
    told = [
        1.0 / (1.0 / float(readings[tapes == tape].sum()) + survey.scale_sigma_of(tape) ** 2)
        for tape in dict.fromkeys(tapes.tolist())
    ]
    return float(np.sqrt(1.0 / sum(told)))


def _of_others(adjustment: Adjustment) -> float:
    """Sigma of a factor common to all readings, of which nothing is known but by all else.

    It is one more unknown in place of the tapes' scales, and eliminated last: what is left of its
    information then is exact to rounding, however little it is.
    """
    blocks, layout = dict(adjustment.minimum.blocks), adjustment.problem.layout
    survey, line = adjustment.survey, adjustment.problem.line_index
    readings = blocks["lengths"]
    width = readings.columns.shape[1] - (1 if layout.tape else 0)
    # Of what should be read: what is read would take its residual for something that is known.
    by_factor = survey.length_m[line] / survey.length_sigma_m[line] + readings.residual[:, 0]
    blocks.pop("tape", None)
    bare = replace(layout, tape=0)
    last = bare.size
    bare_readings = Block(
        readings.residual, readings.columns[:, :width], readings.jacobian[:, :, :width]
    )
    blocks["lengths"] = _with_column(bare_readings, last + layout.tape, by_factor[:, None])
    for kind, change in by_size(adjustment).items():
        blocks[kind] = _with_column(blocks[kind], last + layout.tape, change)
    # What stands behind the tapes' scales moves up.
    moved = [replace(b, columns=_without_tapes(b.columns, layout)) for b in blocks.values()]
    structure = replace(bare.structure, size=last + 1)
    try:
        factor = NormalEquations(moved, last + 1, structure).factor()
    except SingularError:
        return float("inf")
    return float(np.sqrt(factor.joint(np.array([last]))[0, 0]))


def _with_column(block: Block, column: int, derivative: Floats) -> Block:
    """Rows by one more unknown, of which each row has its derivative (m, r)."""
    return Block(
        block.residual,
        np.column_stack([block.columns, np.full(len(block.columns), column)]),
        np.concatenate([block.jacobian, derivative[:, :, None]], axis=2),
    )


def _without_tapes(columns: Ints, layout: Layout) -> Ints:
    """Columns of a layout in which no tape has a scale."""
    return np.where(columns >= layout.first_readout, columns - layout.tape, columns)


def _of_extent(adjustment: Adjustment) -> float:
    """Relative sigma of the extent of all points about their middle; inf for a single one."""
    layout = adjustment.problem.layout
    world, jacobian, columns = adjustment.points_with_jacobian(np.arange(layout.points))
    arm = world - world.mean(axis=0)
    size = float(np.vdot(arm, arm))
    if size == 0.0:
        return float("inf")
    gradient = np.zeros(layout.size)
    np.add.at(gradient, columns, np.einsum("ni,nik->nk", arm / size, jacobian))
    solved = adjustment.minimum.factor.solve(gradient[:, None])[:, 0]
    return float(np.sqrt(gradient @ solved))
