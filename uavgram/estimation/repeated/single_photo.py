"""Adjustment of one photo with known lengths, for many draws of its observations at once.

Unknowns are the photo's pose and the places of the lengths' ends on the ground; observations are
the ends' pixels, the lengths, and the prior pose. Each end is seen once, so its place is determined
by its sighting's error e; errors of camera, ground and tape, if these are not exact, are part of e.
A Gauss-Newton step in the pose alone remains, 6 x 6, once the errors are eliminated from

    length(pose, e) - reading ~ N(0, sigma_t^2),   e ~ N(0, 1)

whose covariance, to first order, is S = sigma_t^2 I + Je Je^T. That is exactly the step of the
whole adjustment (the Schur complement, written with Woodbury's identity), so it converges to the
minimum of `estimation/survey/likelihood.py` for the same observations.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.repeated.photo_step import (
    Draws,
    PhotoLinearisation,
    State,
    apply_step,
    compute_places,
    count_common_errors,
    linearise,
    put_draws_last,
    rotate,
)
from uavgram.estimation.solver.batched import (
    Linearisation,
    Minima,
    cholesky,
    minimise_each,
    solve_lower,
    solve_lower_transposed,
)
from uavgram.estimation.solver.batched import State as Unknowns
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation import PhotoDesign, PhotoDraws, PhotoPosesFound

BLOCK_SIZE = 2000
"""Draws at a time: enough that the overhead of Python is negligible, few enough for the cache."""

MIN_REDUCTION = 1e-14
"""Expected reduction of the sum of squares by the last step: the remaining one is smaller by
another factor of ten to a thousand."""

UNDAMPED_STEPS, SMALL_DAMPING = 12, 1e-9
"""Largest number of first steps: regardless of the sum of squares and with hardly any damping; the
few draws that do not converge start again with damped steps."""


def adjust_photos(
    design: PhotoDesign,
    draws: PhotoDraws,
    start: tuple[Floats, Floats] | None = None,
    undamped: int = UNDAMPED_STEPS,
    settled: float = MIN_REDUCTION,
) -> PhotoPosesFound:
    """Adjust every draw.

    Parameters
    ----------
    design
        Design common to the draws.
    draws
        B draws.
    start
        (3,), (3, 3) initial pose, or (B, 3), (B, 3, 3); None: each starts at its prior pose.
    undamped
        Largest number of steps before the damped ones; 0 for poor starts.
    settled
        Expected reduction of the sum of squares by the last step.

    Returns
    -------
    PhotoPosesFound
        Draws that did not converge are marked.
    """
    count = len(draws.length_m)
    center, rotation = start or (draws.center_world_m, draws.world_from_camera)
    center, rotation = (
        np.broadcast_to(center, (count, 3)),
        np.broadcast_to(rotation, (count, 3, 3)),
    )
    found = []
    for first in range(0, count, BLOCK_SIZE):
        rows = slice(first, first + BLOCK_SIZE)
        begun = center[rows], rotation[rows]
        found.append(_adjust_block(design, _some(draws, rows), begun, (undamped, settled)))
    names = vars(found[0])
    return PhotoPosesFound(
        **{name: np.concatenate([getattr(one, name) for one in found]) for name in names}
    )


def intersect_ground(
    design: PhotoDesign, draws: PhotoDraws, poses: tuple[Floats, Floats]
) -> Floats:
    """Intersect the ends' pixels with the prior ground: (B, E, 3), or NaN.

    Parameters
    ----------
    design, draws
        Camera, and its sightings.
    poses
        (B, 3), (B, 3, 3).
    """
    center, rotation = poses
    camera = design.calibration
    ray = back_project(camera.model, camera.parameters, draws.pixel_px)
    ray = ray @ np.swapaxes(rotation, 1, 2)
    # Ray parameter: height of the camera over the ground by the fall of the ray against it.
    level, slope = draws.ground[:, :1], draws.ground[:, 1:, None]
    ground = level + design.height_m + (center[:, None, :2] @ slope)[..., 0]
    above = ground - center[:, None, 2]
    falling = ray[..., 2] - (ray[..., :2] @ slope)[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = above / falling
    along = np.where(along > 0, along, np.nan)
    return np.asarray(center[:, None] + along[..., None] * ray)


def _some(draws: PhotoDraws, rows: slice) -> PhotoDraws:
    every = vars(draws).items()
    return PhotoDraws(**{name: value[rows] for name, value in every if value is not None})


def _adjust_block(
    design: PhotoDesign,
    drawn: PhotoDraws,
    start: tuple[Floats, Floats],
    iteration: tuple[int, float],
) -> PhotoPosesFound:
    """Adjust draws that fit the processor's cache together."""
    undamped, settled = iteration
    problem = _Problem(design, put_draws_last(drawn))
    first = _make_initial_state(design, drawn, start)
    ends = minimise_each(
        problem, first, undamped, settled=settled, damping=SMALL_DAMPING, descending=False
    )
    left = np.flatnonzero(~ends.converged & np.isfinite(first.place).all(axis=(0, 1)))
    if len(left):
        again = _Problem(design, problem.part(left))
        begun = tuple(value[..., left] for value in first)
        ends.put(left, minimise_each(again, begun, settled=settled), again.axis)
    return _make_result(design, problem.draws, ends)


class _Problem:
    """Poses of draws, with errors and places eliminated. The draw is the last axis."""

    axis = -1

    def __init__(self, design: PhotoDesign, draws: Draws) -> None:
        self.design, self.draws = design, draws
        self._some = np.arange(draws.length.shape[-1]), draws

    def part(self, which: Ints) -> Draws:
        """Return some of the draws; copied only if others are requested than before."""
        if which is not self._some[0]:
            self._some = which, Draws(*(value[..., which] for value in self.draws))
        return self._some[1]

    def linearise(self, which: Ints, state: Unknowns) -> Linearisation:
        """Linearise some draws (b,) at a state."""
        line = linearise(self.design, self.part(which), State(*state))
        return Linearisation(line.cost, np.moveaxis(line.normal, -1, 0), -line.right.T, line)

    def move(self, state: Unknowns, linear: Linearisation, step: Floats) -> Unknowns:
        """Apply steps (b, 6) to a state."""
        return apply_step(self.design, PhotoLinearisation(*linear.rest), State(*state), step.T)


def _make_initial_state(
    design: PhotoDesign, draws: PhotoDraws, start: tuple[Floats, Floats]
) -> State:
    """Return the initial state, with the draws' ends where their sightings meet the ground."""
    center, rotation = start
    turn = log_so3(np.swapaxes(draws.world_from_camera, 1, 2) @ rotation)
    place = intersect_ground(design, draws, start)
    common = np.zeros((count_common_errors(design), len(center)))
    return State(center.T.copy(), turn.T.copy(), place[..., :2].transpose(2, 1, 0).copy(), common)


def _make_result(design: PhotoDesign, draws: Draws, ends: Minima) -> PhotoPosesFound:
    """Return the poses with covariances of δcentre and of a rotation in the camera's axes."""
    state, at_rest = State(*ends.state), ends.converged
    rotation, by_turn = rotate(draws.rotation, state.turn)
    root = cholesky(np.ascontiguousarray(np.moveaxis(ends.normal, 0, -1)))
    unit = np.repeat(np.eye(6)[:, :, None], len(at_rest), axis=2)
    covariance = solve_lower_transposed(root, solve_lower(root, unit))
    # From a change of the rotation vector to a rotation in the camera's axes.
    by_step = np.zeros((6, 6, len(at_rest)))
    by_step[:3, :3] = np.eye(3)[:, :, None]
    by_step[3:, 3:] = np.einsum("jib,jkb->ikb", rotation, by_turn)
    covariance = np.einsum("ijb,jkb,lkb->bil", by_step, covariance, by_step, optimize=True)
    return PhotoPosesFound(
        center_world_m=state.center.T,
        world_from_camera=rotation.transpose(2, 0, 1),
        covariance=np.where(at_rest[:, None, None], covariance, np.nan),
        place_m=compute_places(design, draws, state).transpose(2, 1, 0),
        common=state.common.T,
        cost=np.where(np.isfinite(ends.cost), ends.cost, np.nan),
        converged=at_rest,
        steps=ends.steps,
    )
