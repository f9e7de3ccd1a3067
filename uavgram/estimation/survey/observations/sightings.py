"""Points seen in photos, whether picked, matched or tied: whitened residuals with Jacobians."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.sights import SightedBlock, Sights
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.geometry.motion.row_poses import row_share
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem


class Seen(NamedTuple):
    """n points as photos show them.

    Attributes
    ----------
    frame
        (n,) the photo.
    pixel_px, sigma_px
        (n, 2), (n,) where, and the sigma of each coordinate.
    columns
        (n, k) unknowns of each row, in the order of the Jacobian.
    """

    frame: Ints
    pixel_px: Floats
    sigma_px: Floats
    columns: Ints


def seen(
    problem: SurveyProblem,
    points: tuple[Ints, Ints],
    frame: Ints,
    pixel_px: Floats,
    sigma_px: Floats,
) -> Seen:
    """Points as photos show them.

    Parameters
    ----------
    problem
        The likelihood.
    points
        (n, point_size), (n, w) the unknowns of each point, and those of the ground that place it.
    frame, pixel_px, sigma_px
        As of `Seen`.
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
    return Seen(frame, pixel_px, sigma_px, np.concatenate(parts, axis=1))


def rows_of_sightings(
    problem: SurveyProblem, state: State, rows: Seen, placed: tuple[Floats, Floats, Floats]
) -> Block | None:
    """Predicted pixels less those seen, over their sigmas; None where a point is not in front.

    Parameters
    ----------
    problem, state
        The likelihood, and values of its unknowns.
    rows
        What was seen.
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
        share = row_share(rows.pixel_px[:, 1], survey.calibration.height_px)[:, None]
        moved = share * sweep_of(survey, state)[..., frame, :]
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
    if not np.isfinite(pixel).all():
        return None
    by_rest = []
    if unturned is not None:
        # d/da of exp(-s) R^T (X - centre - a v), s = a w + t: camera x J w - R_row^T v, with J the
        # left Jacobian of the rotation exp(-s); by the turning t itself: camera x J
        left = _left_jacobian(-moved[..., 3:])
        by_time = np.cross(camera, np.einsum("...ij,...j->...i", left, motion[:, 3:]))
        by_time -= np.einsum("...ij,...j->...i", camera_from_world, velocity)
        by_rest.append((share * by_time)[..., None])
        if problem.layout.turning:
            by_rest.append(hat(camera) @ left * share[..., None])
    sights = Sights(
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
    # Of many states nothing but products with the Jacobians is asked for.
    return block if residual.ndim > 2 else Block(residual, rows.columns, block.jacobian)


def _left_jacobian(turn: Floats) -> Floats:
    """(n, 3, 3) of small rotations exp(turn): how they change on the left as `turn` does.

    To the second order in `turn`, which is some hundredths of a radian (Sola et al. 2018, "A micro
    Lie theory for state estimation in robotics", eq. 145).
    """
    across = hat(turn)
    return np.asarray(np.eye(3) + 0.5 * across + across @ across / 6.0)


def sweep_of(survey: Survey, state: State) -> Floats:
    """(..., F, 6) by which each camera moves while its rows are read.

    What the log says, and what it does not say: see geometry/motion/row_poses.py.
    """
    if survey.rolling is None:
        return np.zeros((len(survey.frame_id), 6))
    sweep = state.readout[..., None] * motion_of(survey, state)
    if state.turning.size:
        sweep[..., 3:] += state.turning
    return sweep


def motion_of(survey: Survey, state: State) -> Floats:
    """(..., F, 6) velocity in the world, and angular rate in camera axes; 0 without a shutter."""
    if survey.rolling is None:
        return np.zeros((len(survey.frame_id), 6))
    motion = survey.rolling.motion
    if survey.gauge != "plane":
        return motion
    ahead = np.einsum("...ij,...j->...i", state.rotation, motion[:, :3])
    return np.concatenate([ahead, np.broadcast_to(motion[:, 3:], ahead.shape)], axis=-1)
