"""Test whether photos of one board are of two cameras: the best split in two groups.

To first order, the gradient of each photo and its share of the reduced normal equations give the
camera that fits this photo best. Two cameras produce two clusters of these, far apart compared with
the scatter within them; a bent board, a moving camera or a poor lens model scatter them about one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.calibration.adjustment import Fit, compute_prior_normal
from uavgram.estimation.calibration.reliability import eliminate_pose
from uavgram.model.arrays import Bools, Floats, Ints

MIN_PHOTOS = 3
"""Smallest number of photos of a group: fewer are judged as photos that do not fit the others."""

_DIRECTION_COUNT = 4  # directions of largest scatter, for initial groups
_DRAW_COUNT = 12  # number of random initial groups
_MAX_ROUNDS = 50
_MIN_EIGENVALUE = 1e-12


class Split(NamedTuple):
    """M photos in two groups, each with a camera of its own.

    Attributes
    ----------
    group
        (M,) 0 or 1; the first photo is in group 0.
    distance
        Square of half the distance between the two cameras over the scatter of single photos'
        cameras about their group's, mean over the parameters. One camera whose photos scatter by
        chance gives about 0.2; one whose photos scatter for other reasons 0.4 to 1.
    decision
        Smallest preference of a photo for its own group, with its group's camera estimated without
        it: 1 if its best camera is exactly that one, 0 halfway to the other one, less beyond.
    """

    group: Ints
    distance: float
    decision: float


class _NormalEquations(NamedTuple):
    """Quadratic costs 2 gradient d + d normal d of a change d of the camera: by photo, by prior."""

    normal: Floats  # (M, q, q)
    gradient: Floats  # (M, q)
    prior_normal: Floats  # (q, q)
    prior_gradient: Floats  # (q,)

    def camera(self, photos: Bools) -> Floats:
        """Compute the (..., q) best change for some photos (..., M)."""
        normal = np.einsum("...m,mij->...ij", photos, self.normal) + self.prior_normal
        gradient = photos @ self.gradient + self.prior_gradient
        inverse = np.linalg.pinv(normal, rcond=_MIN_EIGENVALUE, hermitian=True)
        return np.asarray(-np.einsum("...ij,...j->...i", inverse, gradient))

    def cost(self, change: Floats) -> Floats:
        """Compute the (M,) cost of each photo, for a change (q,) or one for each (M, q)."""
        turned = np.einsum("mij,mj->mi", self.normal, np.broadcast_to(change, self.gradient.shape))
        return np.asarray(np.sum((2 * self.gradient + turned) * change, axis=1))


def find_best_split(fit: Fit) -> Split | None:
    """Find the two groups of photos with cameras of their own that fit best together.

    Hard expectation maximisation from many initial groups, on the normal equations of the joint
    adjustment (the difference of the two cameras is small compared with the curvature).

    Returns
    -------
    Split or None
        None if there are too few photos.
    """
    equations = _normal_equations(fit)
    best, most = None, 0.0
    for first in _make_first_groups(equations):
        group, gain = _assign_photos(equations, first)
        if gain > most:
            best, most = group, gain
    return None if best is None else _judge(fit, equations, best, most)


def _normal_equations(fit: Fit) -> _NormalEquations:
    """Return the normal equations of the camera alone, scaled to a unit joint diagonal."""
    free = fit.lens.basis.shape[1]
    gradient = np.einsum("mri,mr->mi", eliminate_pose(fit), fit.linear.residual)[:, :free]
    normal = fit.normals.photo_border[:, :free, :free]
    prior = compute_prior_normal(fit.lens)[:free, :free]
    scale = np.sqrt(np.diag(normal.sum(axis=0) + prior))
    gradient = gradient / scale
    return _NormalEquations(
        normal / np.outer(scale, scale),
        gradient,
        prior / np.outer(scale, scale),
        -gradient.sum(axis=0),  # the joint gradient is zero at the minimum
    )


def _make_first_groups(equations: _NormalEquations) -> list[Bools]:
    """Return initial groups (M,): along the directions of most scatter, by order, at random."""
    photos = len(equations.gradient)
    if photos < 2 * MIN_PHOTOS:
        return []
    # Whiten the photos' gradients, and find the directions of largest scatter (SVD).
    values, vectors = np.linalg.eigh(equations.normal.sum(axis=0) + equations.prior_normal)
    white = equations.gradient @ (vectors / np.sqrt(np.maximum(values, _MIN_EIGENVALUE)))
    along = np.linalg.svd(white - white.mean(axis=0), full_matrices=False)[2][:_DIRECTION_COUNT]
    place = white @ along.T
    ascending = np.sort(place, axis=0)
    # Split at the widest gap, and at the mean, along each direction.
    gap = np.diff(ascending, axis=0)[MIN_PHOTOS - 1 : photos - MIN_PHOTOS]
    widest = np.argmax(gap, axis=0) + MIN_PHOTOS - 1
    columns = np.arange(place.shape[1])
    between = (ascending[widest, columns] + ascending[widest + 1, columns]) / 2
    order = np.arange(photos)
    draws = np.random.default_rng(0)
    return [
        *(place > place.mean(axis=0)).T,
        *(place > between).T,
        order >= photos // 2,
        *(draws.permutation(photos) % 2 == 1 for _ in range(_DRAW_COUNT)),
    ]


def _assign_photos(equations: _NormalEquations, second: Bools) -> tuple[Ints, float]:
    """Assign each photo to its preferred camera until it settles; also return the cost reduction.

    The reduction is 0 if the groups do not settle.
    """
    group = second.astype(np.int64)
    for _ in range(_MAX_ROUNDS):
        members = group == np.array([[0], [1]])
        if members.sum(axis=1).min() < MIN_PHOTOS:
            return group, 0.0
        cameras = equations.camera(members)
        cost = np.stack([equations.cost(camera) for camera in cameras])
        new = np.argmin(cost, axis=0)
        if np.array_equal(new, group):
            prior = 2 * cameras @ equations.prior_gradient + np.einsum(
                "ki,ij,kj->k", cameras, equations.prior_normal, cameras
            )
            return group, -float(cost.min(axis=0).sum() + prior.sum())
        group = new
    return group, 0.0


def _judge(fit: Fit, equations: _NormalEquations, group: Ints, gain: float) -> Split:
    """Compute the distance of the groups, and the preference of each photo for its own."""
    photos, q = equations.gradient.shape
    own = group == group[:, None]  # (M, M) photos in the same group
    mine = equations.camera(own)
    others = equations.camera(~own)
    rest = (
        np.einsum("nm,mij->nij", own, equations.normal) - equations.normal + equations.prior_normal
    )
    whole = np.linalg.pinv(rest + equations.normal, rcond=_MIN_EIGENVALUE, hermitian=True)
    rest = np.linalg.pinv(rest, rcond=_MIN_EIGENVALUE, hermitian=True)
    left = equations.gradient + np.einsum("mij,mj->mi", equations.normal, mine)
    moved = np.einsum("mij,mj->mi", rest, left)
    # Scatter of the cameras within the groups, as in `photo_effect` for one group.
    scatter = np.sum(left * moved) / np.einsum("mij,mji->", equations.normal, whole)
    noise = (fit.corner_cost - gain) / max(fit.corner_redundancy - q, 1.0)
    without = mine + moved
    apart = others - without
    length = np.einsum("mi,mij,mj->m", apart, equations.normal, apart)
    lead = (equations.cost(others) - equations.cost(without)) / np.maximum(
        length, np.finfo(float).tiny
    )
    return Split(
        group=group if group[0] == 0 else 1 - group,
        distance=float(gain / q / max(scatter, noise) / photos),
        decision=float(lead.min()),
    )
