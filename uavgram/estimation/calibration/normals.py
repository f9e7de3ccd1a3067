"""Normal equations of a calibration: a block of six per photo, and a border.

The photos are eliminated first, all at once (Schur complement: Triggs, McLauchlan, Hartley and
Fitzgibbon 2000, "Bundle adjustment - a modern synthesis", sec. 6.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.problem import POSE, Lens, Linear, State
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import parameter_names

SINGULAR = 1e-13
"""Eigenvalue of the border's scaled normal matrix below which it is not determined."""


class UndeterminedError(GeometryError):
    """The photos do not determine the camera."""


class Normals(NamedTuple):
    """Normal equations, the photos eliminated.

    Attributes
    ----------
    pose_inverse
        (M, 6, 6) inverses of the photos' own normal matrices.
    gain
        (M, 6, q): a change d of the border moves pose i by -gain[i] @ d.
    photo_border
        (M, q, q) what each photo says of the border once its pose is eliminated.
    border
        (q, q) their sum, and the priors.
    """

    pose_inverse: Floats
    gain: Floats
    photo_border: Floats
    border: Floats


@dataclass(frozen=True, eq=False)
class Products:
    """Blocks of the normal equations: poses, poses with border, each photo's border; gradients."""

    pose: Floats  # (M, 6, 6)
    cross: Floats  # (M, 6, q)
    photo: Floats  # (M, q, q)
    pose_gradient: Floats  # (M, 6)
    border_gradient: Floats  # (q,)
    prior: Floats  # (q, q)

    @classmethod
    def of(cls, lens: Lens, linear: Linear, state: State) -> Products:
        """Multiply the Jacobians of all photos at once.

        Parameters
        ----------
        lens
            What is estimated, and its priors.
        linear
            Whitened residuals and Jacobians of M photos.
        state
            Where they were taken; the priors pull from there.
        """
        q = lens.size
        rows = np.concatenate([linear.pose, linear.border, linear.residual[:, :, None]], axis=2)
        product = np.swapaxes(rows, 1, 2) @ rows
        by_prior = lens.full_basis.T @ lens.prior_information @ departure(lens, state)
        return cls(
            product[:, :POSE, :POSE],
            product[:, :POSE, POSE : POSE + q],
            product[:, POSE : POSE + q, POSE : POSE + q],
            product[:, :POSE, -1],
            product[:, POSE : POSE + q, -1].sum(axis=0) + by_prior,
            prior_normal(lens),
        )

    def normals(self, damping: float = 0.0) -> Normals:
        """Eliminate the photos; damped along the diagonal as Marquardt does."""
        inverse = _invert_poses(self.pose, damping)
        gain = inverse @ self.cross
        photo = self.photo - np.swapaxes(self.cross, 1, 2) @ gain
        border = photo.sum(axis=0) + self.prior
        border += damping * np.diag(np.einsum("mii->i", self.photo) + np.diag(self.prior))
        return Normals(inverse, gain, photo, border)

    def step(self, damping: float) -> tuple[Floats, Floats, float]:
        """Increments of border (q,) and poses (M, 6), and the fall of the cost they promise."""
        normals = self.normals(damping)
        own = np.einsum("mij,mj->mi", normals.pose_inverse, self.pose_gradient)
        reduced = self.border_gradient - np.einsum("mij,mi->j", self.cross, own)
        border = np.zeros(len(reduced))
        if len(reduced):
            scaled, scale = unit_diagonal(normals.border)
            border = -np.linalg.lstsq(scaled, reduced / scale, rcond=None)[0] / scale
        pose = -own - np.einsum("mij,j->mi", normals.gain, border)
        return border, pose, self._predicted(border, pose)

    def _predicted(self, border: Floats, pose: Floats) -> float:
        linear = 2 * (self.border_gradient @ border + np.sum(self.pose_gradient * pose))
        square = (
            border @ (self.photo.sum(axis=0) + self.prior) @ border
            + 2 * np.einsum("mi,mij,j->", pose, self.cross, border)
            + np.einsum("mi,mij,mj->", pose, self.pose, pose)
        )
        return -float(linear + square)


def unit_diagonal(normal: Floats) -> tuple[Floats, Floats]:
    """Normal matrices (..., q, q) with unit diagonals, and the (..., q) units that give them."""
    diagonal = np.einsum("...ii->...i", normal)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return normal / (scale[..., :, None] * scale[..., None, :]), scale


def _invert_poses(normal: Floats, damping: float) -> Floats:
    """(M, 6, 6) inverses; zero for a photo without corners, which says nothing of its pose."""
    empty = ~(np.einsum("mii->mi", normal) > 0).all(axis=1)
    scaled, scale = unit_diagonal(normal)
    scaled += damping * np.eye(POSE)
    scaled[empty] = np.eye(POSE)
    inverse = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
    inverse[empty] = 0.0
    return np.asarray(inverse)


def invert_border(normal: Floats, lens: Lens) -> Floats:
    """Covariance of the border, or an error that names what is not determined."""
    if not len(normal):
        return normal
    scaled, scale = unit_diagonal(normal)
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < SINGULAR:
        unknown = int(np.argmax(np.abs(vectors[:, 0])))
        raise UndeterminedError(
            f"the photos do not determine {_unknown_name(lens, unknown)}: take more photos with "
            "the board tilted in different directions, or estimate fewer parameters"
        )
    root = vectors / np.sqrt(values) / scale[:, None]
    return np.asarray(root @ root.T)


def _unknown_name(lens: Lens, unknown: int) -> str:
    f = lens.basis.shape[1]
    if unknown >= f:
        return "the bow of the board"
    row = int(np.flatnonzero(lens.basis[:, unknown])[-1])
    return parameter_names(lens.model, len(lens.basis))[row]


def normals_at(lens: Lens, linear: Linear, state: State) -> Normals:
    """Eliminate the photos from the normal equations of a state.

    Parameters
    ----------
    lens, linear, state
        As for `Products.of`.
    """
    return Products.of(lens, linear, state).normals()


def departure(lens: Lens, state: State) -> Floats:
    """(P + k,) parameters and bow, less the mean of their prior."""
    return np.concatenate([state.parameters, state.bow_m]) - lens.prior_mean


def prior_normal(lens: Lens) -> Floats:
    """(q, q) what is known of the border beforehand."""
    basis = lens.full_basis
    return np.asarray(basis.T @ lens.prior_information @ basis)
