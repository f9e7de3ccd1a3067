"""Corners of a board in M photos as whitened residuals with Jacobians, padded to one shape.

Unknowns: a border shared by all photos (intrinsics, distortion, bow of the board), and a pose of
six for each photo: (shift of the board's middle in the camera's frame [m], rotation of the board
about its middle, in the camera's frame [rad]). With a rotation about the middle the two are hardly
correlated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.board import (
    Board,
    BoardObservations,
    Bow,
    CalibrationOptions,
    IntrinsicsPrior,
    parameter_count,
)
from uavgram.model.camera import PARAMETER_NAMES, Calibration, LensModel, parameter_names

POSE_SIZE = 6
"""Number of unknowns of a photo."""

MIN_PRIOR_EIGENVALUE = 1e-14
"""Share of the largest eigenvalue of a prior's information above which a direction is known."""

_ESTIMATED: dict[tuple[LensModel, int], tuple[str, ...]] = {
    ("brown", 3): ("k1", "k2", "k3"),
    ("brown", 5): ("k1", "k2", "p1", "p2", "k3"),
    ("brown", 8): ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    ("fisheye", 4): ("k1", "k2", "k3", "k4"),
}


@dataclass(frozen=True, eq=False)
class Corners:
    """Observed corners; rows of photos with fewer than n corners repeat one at weight 0.

    Attributes
    ----------
    board_m
        (M, n, 3) nominal place on the board, from the board's middle.
    bow
        (M, n, k) shape functions of the bow: d z / d bow.
    pixel_px
        (M, n, 2).
    weight
        (M, n) inverse sigma; 0 if there is no observation.
    """

    board_m: Floats
    bow: Floats
    pixel_px: Floats
    weight: Floats

    @property
    def count(self) -> Ints:
        """(M,) number of corners of each photo."""
        return np.asarray(np.count_nonzero(self.weight, axis=1), np.int64)

    def take(self, photos: Ints | Bools) -> Corners:
        """Return some of the photos."""
        return Corners(
            self.board_m[photos], self.bow[photos], self.pixel_px[photos], self.weight[photos]
        )

    def replace_weights(self, weight: Floats) -> Corners:
        """Return the same corners with other weights (M, n)."""
        return replace(self, weight=weight)


@dataclass(frozen=True, eq=False)
class State:
    """Values of all unknowns.

    Attributes
    ----------
    parameters
        (P,) of the camera.
    bow_m
        (k,) of the board.
    camera_from_board
        (M, 3, 3).
    middle_camera_m
        (M, 3) the board's middle.
    """

    parameters: Floats
    bow_m: Floats
    camera_from_board: Floats
    middle_camera_m: Floats

    def apply_step(self, lens: Lens, border: Floats, pose: Floats) -> State:
        """Return the state after increments of the border (q,) and of the poses (M, 6).

        Parameters
        ----------
        lens
            Lens, which defines the border.
        border
            (q,) of the camera's free parameters, then of the bow [m].
        pose
            (M, 6) of the board's middle [m] and its rotation [rad], in the camera's frame.
        """
        free = lens.basis.shape[1]
        bow = border[free:]
        return State(
            self.parameters + lens.basis @ border[:free],
            self.bow_m + bow if len(bow) else self.bow_m,
            exp_so3(pose[:, 3:]) @ self.camera_from_board,
            self.middle_camera_m + pose[:, :3],
        )

    def choose_poses(self, chosen: Bools, other: State) -> State:
        """Combine poses of this state where chosen (M,) with those of the other one elsewhere."""
        return replace(
            self,
            camera_from_board=np.where(
                chosen[:, None, None], self.camera_from_board, other.camera_from_board
            ),
            middle_camera_m=np.where(chosen[:, None], self.middle_camera_m, other.middle_camera_m),
        )

    def take(self, photos: Ints | Bools) -> State:
        """Return some of the photos."""
        return replace(
            self,
            camera_from_board=self.camera_from_board[photos],
            middle_camera_m=self.middle_camera_m[photos],
        )


@dataclass(frozen=True, eq=False)
class Lens:
    """Parameters of camera and board to estimate, and their priors.

    Attributes
    ----------
    model
        Lens model.
    basis
        (P, f) derivative of the camera's parameters by the free ones.
    prior_mean, prior_information
        (P + k,), (P + k, P + k) priors of parameters and bow; zero information if there is none.
    """

    model: LensModel
    basis: Floats
    prior_mean: Floats
    prior_information: Floats

    @property
    def size(self) -> int:
        """Number of unknowns q of the border."""
        return int(self.basis.shape[1]) + len(self.prior_mean) - len(self.basis)

    @property
    def full_basis(self) -> Floats:
        """(P + k, q) derivative of parameters and bow by the border."""
        p, f = self.basis.shape
        k = len(self.prior_mean) - p
        full = np.zeros((p + k, f + k))
        full[:p, :f] = self.basis
        full[p:, f:] = np.eye(k)
        return full

    @cached_property
    def prior_root(self) -> Floats:
        """(r, P + k) whitening of the prior: its transpose times itself is the information."""
        scale = np.sqrt(np.maximum(np.diag(self.prior_information), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(self.prior_information / np.outer(scale, scale))
        known = values > MIN_PRIOR_EIGENVALUE * max(values.max(initial=0.0), np.finfo(float).tiny)
        return np.asarray((vectors[:, known] * np.sqrt(values[known])).T * scale)

    def hold_fixed(self) -> Lens:
        """Return the same lens held fixed, with only poses to estimate."""
        p = len(self.basis)
        return Lens(self.model, np.zeros((p, 0)), np.zeros(p), np.zeros((p, p)))


def make_lens(options: CalibrationOptions) -> Lens:
    """Return the free parameters and priors requested by the options."""
    count = parameter_count(options.model, options.coefficients)
    names = parameter_names(options.model, count)
    free = ["fx", "fy", *_ESTIMATED[options.model, options.coefficients]]
    if not options.fixed_principal_point:
        free[2:2] = ["cx", "cy"]
    basis = np.eye(count)[:, [names.index(name) for name in free]]
    if options.aspect is not None:  # fy is estimated, fx follows
        basis[0, 1] = options.aspect
        basis = basis[:, 1:]
    bow = count_bows(options.bow)
    mean, information = np.zeros(count + bow), np.zeros((count + bow, count + bow))
    information[count:, count:] = np.eye(bow) * options.bow_sigma_m**-2
    if options.prior is not None:
        shared = min(count, len(options.prior.parameters))
        mean[:shared] = options.prior.parameters[:shared]
        information[:shared, :shared] = options.prior.information[:shared, :shared]
    return Lens(options.model, basis, mean, information)


def make_focal_and_center_prior(
    camera: Calibration, model: LensModel, source: str
) -> IntrinsicsPrior:
    """Return the prior of focal length and principal point by a brown camera, for any lens model.

    Both have the same meaning in all models: the scale at the optical axis, and its intersection
    with the image. Distortion has no prior: coefficients of one model do not apply to another.

    Parameters
    ----------
    camera
        Camera with a covariance that is regular for fx, fy, cx, cy.
    model
        Model of the lens to estimate.
    source
        Source of the prior, in words.
    """
    count = len(PARAMETER_NAMES[model])
    parameters, information = np.zeros(count), np.zeros((count, count))
    parameters[:4] = camera.parameters[:4]
    information[:4, :4] = np.linalg.inv(camera.covariance[:4, :4])
    return IntrinsicsPrior(source=source, parameters=parameters, information=information)


def count_bows(bow: Bow) -> int:
    """Return the number of unknowns of the board's shape."""
    return {"flat": 0, "bowl": 1, "paraboloid": 2}[bow]


def compute_bow(board: Board, bow: Bow) -> Floats:
    """Compute (B, k) heights of each corner (along the board's z) per height of the middle.

    The height of the middle is that over the rim. After mrcal (Kogan), "Board deformation": z = bx
    (1 - x^2) + by (1 - y^2) with x and y from -1 to 1; ``bowl`` has one curvature for both.
    """
    if bow == "flat":
        return np.zeros((len(board.corner_board_m), 0))
    half = np.ptp(board.corner_board_m[:, :2], axis=0) / 2
    place = (board.corner_board_m[:, :2] - compute_board_middle(board)[:2]) ** 2
    if bow == "bowl":
        return np.asarray(1 - place.sum(axis=1, keepdims=True) / np.sum(half**2))
    return np.asarray(1 - place / half**2)


def compute_board_middle(board: Board) -> Floats:
    """Return the (3,) middle of the board's corners, in its frame [m]."""
    corner = board.corner_board_m
    return np.asarray((corner.min(axis=0) + corner.max(axis=0)) / 2)


def pad(observations: BoardObservations, bow: Bow) -> Corners:
    """Arrange the corners of all photos in arrays of one shape."""
    board, photos = observations.board, observations.photos
    count = np.array([len(photo.corner) for photo in photos])
    slot = np.arange(count.max(initial=0))
    there = slot < count[:, None]
    # Each row holds the corners of a photo, then its first one again.
    first = np.cumsum(count) - count
    at = first[:, None] + np.where(there, slot, 0)
    corner = np.concatenate([photo.corner for photo in photos])[at]
    sigma = np.concatenate([photo.sigma_px for photo in photos])[at]
    return Corners(
        board_m=board.corner_board_m[corner] - compute_board_middle(board),
        bow=compute_bow(board, bow)[corner],
        pixel_px=np.concatenate([photo.pixel_px for photo in photos])[at],
        weight=np.where(there, 1 / sigma, 0.0),
    )


class Linearisation(NamedTuple):
    """Whitened residuals (predicted minus observed) and Jacobians of all photos.

    Attributes
    ----------
    residual
        (M, 2 n).
    jacobian
        (M, 2 n, 6 + q) by the photo's pose, then by the border.
    """

    residual: Floats
    jacobian: Floats

    @property
    def pose(self) -> Floats:
        """(M, 2 n, 6) Jacobian by each photo's pose."""
        return self.jacobian[:, :, :POSE_SIZE]

    @property
    def border(self) -> Floats:
        """(M, 2 n, q) Jacobian by the border."""
        return self.jacobian[:, :, POSE_SIZE:]


def linearise(
    lens: Lens, corners: Corners, state: State, *, partial: bool = False
) -> Linearisation | None:
    """Compute residuals and Jacobians; None if an observed corner is behind the camera.

    Parameters
    ----------
    lens, corners
        Lens to estimate, and the observations of M photos.
    state
        State at which to linearise.
    partial
        Whether photos with a corner behind the camera are NaN, instead of None for all.
    """
    photos, n = corners.weight.shape
    # d corner / d bow is the board's normal in the camera's frame times the shape function.
    bent = corners.board_m.copy()
    bent[:, :, 2] += corners.bow @ state.bow_m
    arm = bent @ np.swapaxes(state.camera_from_board, 1, 2)
    camera = arm + state.middle_camera_m[:, None]
    pixel, d_camera, d_parameters = project_with_jacobian(
        lens.model, state.parameters, camera, beyond_fold="extend"
    )
    if not partial and not np.isfinite(pixel).all():
        return None
    weight = corners.weight[:, :, None]
    d_camera *= weight[..., None]
    f = lens.basis.shape[1]
    jacobian = np.empty((photos, n, 2, POSE_SIZE + lens.size))
    jacobian[..., :3] = d_camera
    # exp(d) arm = arm + d x arm = arm - hat(arm) d.
    np.matmul(d_camera, -hat(arm), out=jacobian[..., 3:POSE_SIZE])
    border = jacobian[..., POSE_SIZE:]
    np.matmul(d_parameters, lens.basis, out=border[..., :f])
    border[..., :f] *= weight[..., None]
    if lens.size > f:
        normal = state.camera_from_board[:, None, :, 2]
        along = np.einsum("mnij,mnj->mni", d_camera, np.broadcast_to(normal, camera.shape))
        border[..., f:] = along[..., None] * corners.bow[:, :, None, :]
    return Linearisation(
        ((pixel - corners.pixel_px) * weight).reshape(photos, 2 * n),
        jacobian.reshape(photos, 2 * n, POSE_SIZE + lens.size),
    )
