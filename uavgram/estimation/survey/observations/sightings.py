"""Points seen in photos: whitened residuals and the chain of their derivatives.

The chain rule is applied from the pixels' side (reverse mode). It starts either with both
coordinates of each pixel, which gives the Jacobian J, or with one weighted sum of the two, which
gives J^T v without J.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.geometry.motion.rotation import cross, exp_so3, hat
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey


@dataclass(frozen=True, eq=False)
class Projections:
    """Projections of n points, and the factors of their derivatives.

    Attributes
    ----------
    by_camera, by_lens
        (..., n, 2, 3), (..., n, 2, P) derivatives of pixels by points in camera axes and by the
        interior orientation.
    camera_from_world
        (..., n, 3, 3) rotations.
    by_point, by_ground
        (..., n, 3, point_size), (..., n, 3, w) derivatives of the points in the world by their own
        unknowns and by those of the ground.
    by_turn
        (..., n, 3, 3) derivatives of the points in camera axes by turns of the camera.
    lens
        (P, I) derivatives of the interior orientation by its unknowns.
    by_rest
        (..., n, 3, q) derivatives of the points in camera axes by further unknowns (readout time,
        turning).
    """

    by_camera: Floats
    by_lens: Floats
    camera_from_world: Floats
    by_point: Floats
    by_ground: Floats
    by_turn: Floats
    lens: Floats
    by_rest: tuple[Floats, ...]

    def jacobian(self) -> Floats:
        """Compute the (..., n, 2, k) derivatives of the pixels."""
        return self._derive_by_unknowns(self.by_camera, self.by_lens)

    def multiply_transposed(self, along: Floats) -> Floats:
        """Compute (..., n, k) derivatives of sums of both coordinates with weights (..., n, 2)."""
        rows = along[..., None, :]
        return self._derive_by_unknowns(rows @ self.by_camera, rows @ self.by_lens)[..., 0, :]

    def _derive_by_unknowns(self, by_camera: Floats, by_lens: Floats) -> Floats:
        """Compute (..., n, r, k) from (..., n, r, 3) and (..., n, r, P)."""
        by_world = by_camera @ self.camera_from_world
        # One matrix product for all rows: a stacked product would compute one for each.
        many, (parameters, unknowns) = by_lens.shape[:-1], self.lens.shape
        by_intrinsic = by_lens.reshape(math.prod(many), parameters) @ self.lens
        parts = [
            by_world @ self.by_point,
            -by_world,
            by_camera @ self.by_turn,
            by_intrinsic.reshape(*many, unknowns),
            by_world @ self.by_ground,
            *(by_camera @ each for each in self.by_rest),
        ]
        return np.concatenate(parts, axis=-1)


class SightedBlock(Block):
    """Rows whose Jacobian is formed only on request: J^T v is computed without it.

    Parameters
    ----------
    residual, columns
        As in `Block`.
    sights, weight
        Projections of the points, and (n,) inverse sigmas of each coordinate.
    """

    _sights: Projections
    _weight: Floats

    def __init__(
        self, residual: Floats, columns: Ints, sights: Projections, weight: Floats
    ) -> None:
        vars(self).update(residual=residual, columns=columns, _sights=sights, _weight=weight)

    @cached_property
    def jacobian(self) -> Floats:
        """(..., n, 2, k) derivatives of the whitened residuals."""
        return self._sights.jacobian() * self._weight[:, None, None]

    def multiply_transposed(self, along: Floats) -> Floats:
        """Multiply (..., n, 2) by the Jacobian, to (..., n, k)."""
        return self._sights.multiply_transposed(along * self._weight[:, None])


@dataclass(frozen=True, eq=False)
class ProjectedBlock(Block):
    """Rows of projected points, and (n,) whether the lens model folds back at each of them.

    Beyond the fold a second direction has the same pixel: no lens shows a point there.
    """

    is_folded: Bools


def have_folded(blocks: Mapping[str, Block], without: Sequence[int] | Ints = ()) -> bool:
    """Return whether a picked point is where the lens model folds back.

    Parameters
    ----------
    blocks
        Evaluated observations, by group.
    without
        Rows of picks that do not count.
    """
    block = blocks.get("pixels")
    return isinstance(block, ProjectedBlock) and bool(np.delete(block.is_folded, without).any())


if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem


class Sightings(NamedTuple):
    """Sightings of n points in photos.

    Attributes
    ----------
    frame
        (n,) the photo.
    pixel_px, sigma_px
        (n, 2), (n,) image points, and the sigma of each coordinate.
    columns
        (n, k) unknowns of each row, in the order of the Jacobian.
    """

    frame: Ints
    pixel_px: Floats
    sigma_px: Floats
    columns: Ints


def collect_sightings(
    problem: SurveyProblem,
    points: tuple[Ints, Ints],
    frame: Ints,
    pixel_px: Floats,
    sigma_px: Floats,
) -> Sightings:
    """Collect sightings of points with the columns of their unknowns.

    Parameters
    ----------
    problem
        Likelihood.
    points
        (n, point_size), (n, w) the unknowns of each point, and those of the ground that place it.
    frame, pixel_px, sigma_px
        As in `Sightings`.
    """
    layout = problem.layout
    parts = [
        points[0],
        layout.frame_columns(frame),
        layout.shared_columns(layout.first_intrinsic, layout.intrinsics, len(frame)),
        points[1],
        layout.shared_columns(layout.first_readout, layout.readout, len(frame)),
        layout.turning_columns(frame),
    ]
    return Sightings(frame, pixel_px, sigma_px, np.concatenate(parts, axis=1))


def compute_sighting_rows(
    problem: SurveyProblem, state: State, rows: Sightings, placed: tuple[Floats, Floats, Floats]
) -> Block | None:
    """Compute predicted minus observed pixels over their sigmas; None if a point is not in front.

    Parameters
    ----------
    problem, state
        Likelihood, and values of its unknowns.
    rows
        Sightings.
    placed
        (..., n, 3), (..., n, 3, point_size), (..., n, 3, w) the points, and their derivatives by
        their own unknowns and by those of the ground.
    """
    survey, frame = problem.survey, rows.frame
    world, d_point, d_plane = placed
    camera_from_world = np.swapaxes(state.rotation, -1, -2)[..., frame, :, :]
    from_center = world - state.center[..., frame, :]
    unturned = None
    if survey.rolling is not None:
        # The row's own pose: centre + a v, R exp(a w), with a the time since the middle row.
        motion = survey.rolling.motion[frame]
        share = compute_row_share(rows.pixel_px[:, 1], survey.calibration.height_px)[:, None]
        moved = share * compute_readout_motion(survey, state)[..., frame, :]
        from_center = from_center - moved[..., :3]
        unturned = exp_so3(-moved[..., 3:])
        in_middle = np.einsum("...ij,...j->...i", camera_from_world, from_center)
        turns = in_middle
        velocity = motion[:, :3]
        if survey.gauge == "plane":  # velocities turn with the camera
            turns = in_middle + share * state.readout[..., None] * velocity
            velocity = np.einsum("...ji,...j->...i", camera_from_world, velocity)
        camera_from_world = unturned @ camera_from_world
    camera = np.einsum("...ij,...j->...i", camera_from_world, from_center)
    pixel, by_camera, by_lens = project_with_jacobian(
        survey.calibration.model, problem.intrinsics(state), camera, beyond_fold="extend"
    )
    by_lens[..., :2] *= problem.focal_growth(state)[..., None, None, :]
    if not np.isfinite(pixel).all():
        return None
    by_rest = []
    if unturned is not None:
        # d/da of exp(-s) R^T (X - centre - a v), s = a w + t: camera x J w - R_row^T v, with J the
        # left Jacobian of the rotation exp(-s); by the turning t itself: camera x J
        left = _left_jacobian(-moved[..., 3:])
        by_time = cross(camera, np.einsum("...ij,...j->...i", left, motion[:, 3:]))
        by_time -= np.einsum("...ij,...j->...i", camera_from_world, velocity)
        by_rest.append((share * by_time)[..., None])
        if problem.layout.turning:
            by_rest.append(hat(camera) @ left * share[..., None])
    # camera = R^T (X - C): by a turn R exp(d) it changes by camera x d, that is hat(camera) d.
    sights = Projections(
        by_camera=by_camera,
        by_lens=by_lens,
        camera_from_world=camera_from_world,
        by_point=d_point,
        by_ground=d_plane,
        by_turn=hat(camera) if unturned is None else unturned @ hat(turns),
        lens=problem.intrinsic_basis,
        by_rest=tuple(by_rest),
    )
    weight = 1.0 / rows.sigma_px
    residual = (pixel - rows.pixel_px) * weight[:, None]
    block = SightedBlock(residual, rows.columns, sights, weight)
    # For many states only products with the Jacobians are needed.
    if residual.ndim > 2:
        return block
    # A model that folds back mirrors the surroundings of the point.
    (xx, xy), (yx, yy) = np.moveaxis(by_camera[..., :2], 0, -1)
    return ProjectedBlock(residual, rows.columns, block.jacobian, xx * yy <= xy * yx)


def _left_jacobian(turn: Floats) -> Floats:
    """Compute the left Jacobians (n, 3, 3) of small rotations exp(turn).

    To the second order in `turn`, which is some hundredths of a radian (Sola et al. 2018, "A micro
    Lie theory for state estimation in robotics", eq. 145).
    """
    across = hat(turn)
    return np.asarray(np.eye(3) + 0.5 * across + across @ across / 6.0)


def compute_readout_motion(survey: Survey, state: State) -> Floats:
    """Compute (..., F, 6) motions of each camera during the readout of its photo.

    Motion by the log, plus the turning beyond the log: see geometry/motion/camera_motion.py.
    """
    if survey.rolling is None:
        return np.zeros((len(survey.frame_id), 6))
    sweep = state.readout[..., None] * compute_motion(survey, state)
    if state.turning.size:
        sweep[..., 3:] += state.turning
    return sweep


def compute_motion(survey: Survey, state: State) -> Floats:
    """Return (..., F, 6) world velocity and angular rate in camera axes; 0 for a global shutter."""
    if survey.rolling is None:
        return np.zeros((len(survey.frame_id), 6))
    motion = survey.rolling.motion
    if survey.gauge != "plane":
        return motion
    ahead = np.einsum("...ij,...j->...i", state.rotation, motion[:, :3])
    return np.concatenate([ahead, np.broadcast_to(motion[:, 3:], ahead.shape)], axis=-1)
