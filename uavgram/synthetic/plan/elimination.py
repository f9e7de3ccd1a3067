"""Elimination of points: information of their own observations on the shared unknowns.

The two ends of a candidate line occur in no other observation. Elimination from the normal
equations leaves rows on the shared unknowns alone: poses, lens, ground, biases, tapes (the core,
below).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class EliminatedPoints:
    """K eliminated points; C unknowns of the core, in the order of the layout.

    Attributes
    ----------
    base
        (C, C) information on the core from observations without a point: priors.
    root
        (K, r, C) root of the information of each point's sightings on the core, as rows.
    by_core
        (K, p, C) derivative of each point, determined by its sightings, by the core.
    covariance
        (K, p, p) of each point for a fixed core.
    """

    base: Floats
    root: Floats
    by_core: Floats
    covariance: Floats

    def information(self, point: Ints) -> Floats:
        """Return the (C, C) information of some points' sightings on the core."""
        rows = self.root[point].reshape(-1, self.root.shape[2])
        return np.asarray(rows.T @ rows)


def eliminate_points(problem: SurveyProblem, blocks: dict[str, Block]) -> EliminatedPoints:
    """Eliminate all points of a survey whose observations each see one point, or none.

    With the whitened rows of a point, the part A of its own unknowns and B of the core, and A = Q
    R, the reduced rows are the component of B orthogonal to A: the last columns of Q, transposed,
    times B (Golub and Pereyra 1973, variable projection).

    Parameters
    ----------
    problem
        The likelihood.
    blocks
        Its observations, without those between points (lengths).
    """
    layout = problem.layout
    size, first = layout.point_size, layout.first_frame
    count, core = layout.points, layout.size - first
    base = np.zeros((core, core))
    found: list[tuple[Ints, Floats, Floats]] = []
    # priors of the core; split rows with a point into the parts of point and core
    for block in blocks.values():
        own = block.columns < layout.first_tie
        if not own.any():
            base += _information(block, layout)
            continue
        label = np.where(own, block.columns // size, -1).max(axis=1)
        found.append((label, *_split(block, layout)))
    # collect the rows of each point, padded with zeros to the same number
    label = np.concatenate([np.repeat(one[0], one[1].shape[1]) for one in found])
    own_rows = np.concatenate([one[1].reshape(-1, size) for one in found])
    core_rows = np.concatenate([one[2].reshape(-1, core) for one in found])
    order = np.argsort(label, kind="stable")
    rows = np.bincount(label, minlength=count)
    slot = np.arange(len(label)) - np.repeat(np.cumsum(rows) - rows, rows)
    most = max(int(rows.max()), size)
    a, b = np.zeros((count, most, size)), np.zeros((count, most, core))
    a[label[order], slot], b[label[order], slot] = own_rows[order], core_rows[order]
    # QR decomposition of each point's own part: A = Q R
    q, r = np.linalg.qr(a, mode="complete")
    # rotated core part: the first rows determine the point, the others are the reduced rows
    turned = np.swapaxes(q, 1, 2) @ b
    inverse = np.linalg.inv(r[:, :size])
    return EliminatedPoints(
        base=base,
        root=turned[:, size:],
        by_core=-inverse @ turned[:, :size],
        covariance=inverse @ np.swapaxes(inverse, 1, 2),
    )


def _split(block: Block, layout: Layout) -> tuple[Floats, Floats]:
    """Return the Jacobian by the row's own point (n, r, p), and by the core (n, r, C)."""
    size, first = layout.point_size, layout.first_frame
    n, rows, _ = block.jacobian.shape
    own = np.zeros((n, rows, size))
    core = np.zeros((n, rows, layout.size - first))
    at = np.arange(n)
    for k in range(block.columns.shape[1]):
        column = block.columns[:, k]
        is_core = column >= first
        c, o = at[is_core], at[~is_core]
        core[c, :, column[is_core] - first] += block.jacobian[c, :, k]
        own[o, :, column[~is_core] % size] += block.jacobian[o, :, k]
    return own, core


def _information(block: Block, layout: Layout) -> Floats:
    _, core = _split(block, layout)
    rows = core.reshape(-1, core.shape[2])
    return np.asarray(rows.T @ rows)


@dataclass(frozen=True, eq=False)
class Functions:
    """N linear functions of points and core, with the points eliminated.

    Attributes
    ----------
    gradient
        (N, C) by the core.
    variance
        (N,) for a fixed core: from the points' own errors.
    """

    gradient: Floats
    variance: Floats


def whiten_readings(
    points: EliminatedPoints, layout: Layout, columns: Ints, jacobian: Floats, ends: Ints
) -> Floats:
    """Compute the (n, q, C) information of groups of q readings on the core, as whitened rows.

    The points of a group occur only in it: their elimination correlates its readings.

    Parameters
    ----------
    points
        The points, eliminated.
    layout
        Of the unknowns.
    columns, jacobian
        (n, q, k) unknowns, and derivatives of the whitened readings; an unknown may occur twice.
    ends
        (n, m) the points of each group.
    """
    size, first = layout.point_size, layout.first_frame
    n, q, _ = columns.shape
    # split the derivatives into those by the core and those by the group's own points
    core = np.zeros((n, q, layout.size - first))
    own = np.zeros((n, q, ends.shape[1], size))
    group, reading = np.indices((n, q))
    for column, by_column in zip(
        np.moveaxis(columns, 2, 0), np.moveaxis(jacobian, 2, 0), strict=True
    ):
        of_core = column >= first
        at = group[of_core], reading[of_core]
        core[*at, column[of_core] - first] += by_column[of_core]
        at = group[~of_core], reading[~of_core]
        label = column[~of_core] // size
        which = (ends[at[0]] == label[:, None]).argmax(axis=1)
        own[*at, which, column[~of_core] % size] += by_column[~of_core]
    # substitute the points: their dependence on the core, and their own variance
    core += np.einsum("nqmp,nmpc->nqc", own, points.by_core[ends], optimize=True)
    moved = np.einsum("nqmp,nmpr->nqmr", own, points.covariance[ends], optimize=True)
    variance = np.eye(q) + np.einsum("nqmr,nsmr->nqs", moved, own, optimize=True)
    if q == 1:
        return np.asarray(core / np.sqrt(variance))
    # whiten with the Cholesky factor of the readings' joint covariance
    return np.asarray(np.linalg.solve(np.linalg.cholesky(variance), core), dtype=np.float64)


def combine_functions(points: EliminatedPoints, layout: Layout, gradient: Floats) -> Functions:
    """Return functions of any number of points by their gradients (size, N), points eliminated.

    Parameters
    ----------
    points, layout
        The points, eliminated; the unknowns.
    gradient
        (size, N) by all unknowns.
    """
    size, first = layout.point_size, layout.first_frame
    own = gradient[:first].reshape(layout.points, size, -1)
    used = np.flatnonzero(own.any(axis=(1, 2)))
    own, by_core = own[used], points.by_core[used]
    core = gradient[first:].T + np.einsum("kpn,kpc->nc", own, by_core, optimize=True)
    variance = np.einsum("kpn,kpq,kqn->n", own, points.covariance[used], own, optimize=True)
    return Functions(np.asarray(core), np.asarray(variance))
