"""Covariances of points within the survey: what all points have in common is taken out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Factor
from uavgram.model.arrays import Floats, Ints

# A motion that moves the points by less than this part of another is none: a turn about the line
# on which all points lie, or about the only one.
_NO_MOTION = 1e-6


class Placed(NamedTuple):
    """K points of D coordinates, how they depend on unknowns, and which unknowns these are.

    `position` (K, D); `gradient` (K, D, k); `columns` (K, k).
    """

    position: Floats
    gradient: Floats
    columns: Ints


def within_survey(factor: Factor, points: Placed, rows: Ints, own: Floats) -> Floats:
    """Covariances (n, D, D) of some of the points, without the shift and the turn of all points.

    Where receivers and headings put the whole scene says nothing about its shape.

    Parameters
    ----------
    factor
        Of the normal matrix.
    points
        All points, in the plane or in space.
    rows
        (n,) which of them are asked for.
    own
        (n, D, D) their covariances.

    Notes
    -----
    S-transformation to the datum of all points (Baarda 1973, "S-transformations and criterion
    matrices"; inner constraints): with U an orthonormal basis of the shifts and turns of all
    points, and Q their covariance, the blocks of (I - U U^T) Q (I - U U^T). A single point has no
    shape: 0.
    """
    count, size = points.position.shape
    basis = _motions(points.position)
    if basis.shape[2] == count * size:
        return np.zeros_like(own)
    right = np.zeros((factor.size, basis.shape[2]))
    np.add.at(right, points.columns, np.einsum("kdi,kdm->kim", points.gradient, basis))
    solved = factor.solve(right)
    cross = np.einsum("ndi,nim->ndm", points.gradient[rows], solved[points.columns[rows]])
    mixed = np.einsum("nim,njm->nij", cross, basis[rows])
    spread = np.einsum("nim,ml,njl->nij", basis[rows], right.T @ solved, basis[rows])
    return np.asarray(own - mixed - np.swapaxes(mixed, 1, 2) + spread)


def _motions(position: Floats) -> Floats:
    """(K, D, m) orthonormal basis of how all points (K, D) can shift and turn together."""
    count, size = position.shape
    shifts = np.tile(np.eye(size), (count, 1, 1))
    off = position - position.mean(axis=0)
    if size == 2:
        turns = np.stack([-off[:, 1], off[:, 0]], axis=1)[:, :, None]
    else:
        turns = -np.cross(off[:, None, :], np.eye(3)).swapaxes(1, 2)  # e x r, of each axis e
    free = np.concatenate([shifts, turns], axis=2).reshape(count * size, -1)
    basis, reach, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(basis[:, reach > _NO_MOTION * reach[0]]).reshape(count, size, -1)
