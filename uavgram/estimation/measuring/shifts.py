"""What a cause that no observation shows would do to each measured value, to first order.

A point that lies off the surface that was taken for it, and a tape that is wrong beyond its prior,
move a value through the whole adjustment: with S the covariance of the unknowns, g the gradient of
the value and a change e of the whitened residuals, the unknowns move by -S J^T e (as in
stages/linear_update.py), the value by -(S g)^T J^T e. S g is at hand for every value.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

RELIEF_M = 0.10
TAPE_SHARE = 0.01


class Shifts(NamedTuple):
    """Changes of M values, in the unit of each; NaN where they mean nothing.

    Attributes
    ----------
    relief
        (M,) by points that lie `RELIEF_M` above or below the surface, each to the side where it
        does most: the sum of the sizes.
    tape
        (M,) by readings that are all `TAPE_SHARE` longer.
    """

    relief: Floats
    tape: Floats


def shifts(adjustment: Adjustment, measured: MeasuredValues) -> Shifts:
    """What relief and a wrong tape would do to each measured value."""
    none = np.array([row.gradient is None for row in measured.rows], dtype=bool)
    place = adjustment.survey.row_of_label
    points = [sorted({place[p] for p in row.request.points if p in place}) for row in measured.rows]
    touched = np.array(sorted({k for own in points for k in own}), dtype=np.int64)
    moved = np.abs(by_heights(adjustment, measured, touched))
    own = [np.searchsorted(touched, np.array(some, dtype=np.int64)) for some in points]
    relief = RELIEF_M * np.array([moved[rows, m].sum() for m, rows in enumerate(own)])
    tape = np.full(len(none), np.nan)
    if (line := adjustment.problem.line_index).size:
        survey, block = adjustment.survey, adjustment.minimum.blocks["lengths"]
        longer = TAPE_SHARE * survey.length_m[line] / survey.length_sigma_m[line]
        tape = np.einsum(
            "n,nk,nkm->m", longer, block.jacobian[:, 0], measured.solved[block.columns]
        )
    return Shifts(np.where(none, np.nan, relief), np.where(none, np.nan, tape))


def by_heights(adjustment: Adjustment, measured: MeasuredValues, label: Ints) -> Floats:
    """(n, M) derivative of each value by how high each of some points lies above its surface.

    Picks and readings stay as they are; only what is taken for the point's height changes.

    Parameters
    ----------
    adjustment, measured
        The adjusted survey, and M values measured in it.
    label
        (n,) the points.
    """
    names, size = adjustment.survey.label, adjustment.problem.layout.size
    row_of = np.full(len(names), -1)
    row_of[label] = np.arange(len(label))
    place = {names[k]: row for row, k in enumerate(label.tolist())}
    total = np.zeros((len(label), len(measured.rows)))
    for m, row in enumerate(measured.rows):
        if row.gradient is not None:  # the ground below a point rises with the surface
            up = row.gradient[:, 2] + (0.0 if row.by_feet is None else row.by_feet[:, 2])
            for name, by_up in zip(row.request.points, up.tolist(), strict=True):
                if name in place:
                    total[place[name], m] += by_up
    for name, observation in adjustment.problem.observations.items():
        block = adjustment.minimum.blocks[name]
        for point, by_height in observation.heights(adjustment.minimum):
            own = np.flatnonzero(row_of[point] >= 0)
            force = np.einsum("nr,nrk->nk", by_height[own], block.jacobian[own])
            at = (np.repeat(row_of[point[own]], force.shape[1]), block.columns[own].ravel())
            total -= csr_array((force.ravel(), at), shape=(len(label), size)) @ measured.solved
    return total
