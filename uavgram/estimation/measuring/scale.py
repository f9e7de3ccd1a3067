"""What the scale of a survey rests on: the known lengths, and all else."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats

ROUNDING = 1e-10
"""Share of the lengths' own information below which what remains of it is rounding."""


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
        bears on it.
    """

    all: float
    lengths: float
    others: float


def scale_sigmas(adjustment: Adjustment) -> ScaleSigmas:
    """How well the scale is known, and by what."""
    everything = _of_extent(adjustment)
    if "lengths" not in adjustment.minimum.blocks:
        return ScaleSigmas(everything, np.inf, everything)
    total, left = _information(adjustment)
    prior = adjustment.survey.tape_scale_sigma
    tapes = max(len(adjustment.problem.tapes), 1)
    own = float(np.sqrt(1.0 / total + prior**2 / tapes))
    others = float(1.0 / np.sqrt(left)) if left > ROUNDING * total else np.inf
    return ScaleSigmas(everything, own, others)


def _information(adjustment: Adjustment) -> tuple[float, float]:
    """Information on a factor common to all readings: of them, and of what they do not rest on.

    Notes
    -----
    With b the whitened readings' derivatives by the factor and A the Jacobian of the readings, the
    other unknowns eliminated leave b^T b - b^T A S A^T b; S with the tapes held, which would take
    the factor for their own: S less S_t S_tt^-1 S_t^T.
    """
    block, survey = adjustment.minimum.blocks["lengths"], adjustment.survey
    layout, line = adjustment.problem.layout, adjustment.problem.line_index
    factor = survey.length_m[line] / survey.length_sigma_m[line]
    tape = layout.first_tape + np.arange(layout.tape)
    right = np.zeros((layout.size, 1 + layout.tape))
    np.add.at(right[:, 0], block.columns, factor[:, None] * block.jacobian[:, 0])
    right[tape, 0] = 0.0
    right[tape, 1 + np.arange(layout.tape)] = 1.0
    solved = adjustment.minimum.factor.solve(right)
    explained = float(right[:, 0] @ solved[:, 0])
    if layout.tape:
        across: Floats = solved[tape, 0]
        explained -= float(across @ np.linalg.solve(solved[tape, 1:], across))
    total = float(factor @ factor)
    return total, total - explained


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
