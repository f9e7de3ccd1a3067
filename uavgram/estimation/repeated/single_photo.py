"""One photo with known lengths, adjusted for many draws of its observations at once.

Unknown are the photo's pose and the places of the lengths' ends on the ground; observed are the
ends' pixels, the lengths, and the pose beforehand. Each end is seen once, so its place is its
sighting's error e; errors of camera, ground and tape, where these are not exact, are part of e.
A Gauss-Newton step in the pose alone remains, 6 x 6, once the errors are eliminated from

    length(pose, e) - reading ~ N(0, sigma_t^2),   e ~ N(0, 1)

whose covariance, to first order, is S = sigma_t^2 I + Je Je^T. That is the step of the whole
adjustment exactly (the Schur complement, written with Woodbury's identity), so it comes to rest at
the minimum that `estimation/survey/likelihood.py` has of the same observations.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.repeated.common_errors import common_count
from uavgram.estimation.repeated.photo_step import (
    Draws,
    State,
    draws_last,
    linearise,
    moved,
    places_of,
)
from uavgram.estimation.repeated.small_systems import backward, cholesky, forward
from uavgram.estimation.repeated.turns import turned
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.simulation.photo import PhotoDesign, PhotoDraws, PhotoPosesFound

BLOCK = 2000
"""Draws at a time: so many that Python does not count, so few that the cache holds them."""

AT_REST = 1e-14
"""Squared length of a step in sigmas of what it moves, from which on it is the last: what comes
after it is smaller by another factor of ten to a thousand."""

BEYOND_ROUNDING = 1e-10
"""Squared length of steps whose gain no longer shows in the digits of the cost."""

MOST_STEPS, MOST_DAMPED = 12, 200
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-7


def adjust_photos(
    design: PhotoDesign, draws: PhotoDraws, start: tuple[Floats, Floats] | None = None
) -> PhotoPosesFound:
    """Adjust every draw.

    Parameters
    ----------
    design
        What they have in common.
    draws
        B of them.
    start
        (3,), (3, 3) a pose to begin at; else each begins at its pose beforehand.

    Returns
    -------
    PhotoPosesFound
        Draws that did not come to rest are marked.
    """
    count = len(draws.length_m)
    found = [
        _adjust_block(design, _some(draws, slice(first, first + BLOCK)), start)
        for first in range(0, count, BLOCK)
    ]
    names = vars(found[0])
    return PhotoPosesFound(
        **{name: np.concatenate([getattr(one, name) for one in found]) for name in names}
    )


def ground_places(design: PhotoDesign, draws: PhotoDraws, poses: tuple[Floats, Floats]) -> Floats:
    """Where the ends' pixels meet the ground as it is known beforehand: (B, E, 3), or NaN.

    Parameters
    ----------
    design, draws
        Camera, and what was seen.
    poses
        (B, 3), (B, 3, 3).
    """
    center, rotation = poses
    camera = design.calibration
    ray = back_project(camera.model, camera.parameters, draws.pixel_px)
    ray = ray @ np.swapaxes(rotation, 1, 2)
    level, slope = draws.ground[:, :1], draws.ground[:, 1:, None]
    ground = level + design.height_m + (center[:, None, :2] @ slope)[..., 0]
    above = ground - center[:, None, 2]
    falling = ray[..., 2] - (ray[..., :2] @ slope)[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = above / falling
    along = np.where(along > 0, along, np.nan)
    return np.asarray(center[:, None] + along[..., None] * ray)


def _some(draws: PhotoDraws, rows: slice) -> PhotoDraws:
    return PhotoDraws(**{name: value[rows] for name, value in vars(draws).items()})


def _adjust_block(
    design: PhotoDesign, drawn: PhotoDraws, start: tuple[Floats, Floats] | None
) -> PhotoPosesFound:
    """Gauss-Newton; what that does not bring to rest begins anew, with damping."""
    draws = draws_last(drawn)
    first = _first(design, drawn, start)
    state = State(*(value.copy() for value in first))
    size = draws.length.shape[-1]
    steps = np.zeros(size, dtype=np.int64)
    at_rest = np.zeros(size, dtype=np.bool_)
    active = np.flatnonzero(np.isfinite(first.place).all(axis=(0, 1)))
    left = _newton(design, draws, state, active, steps, at_rest)
    for own, begun in zip(state, first, strict=True):
        own[..., left] = begun[..., left]
    _damped(design, draws, state, left, steps, at_rest)
    return _found(design, draws, state, steps, at_rest)


def _first(design: PhotoDesign, draws: PhotoDraws, start: tuple[Floats, Floats] | None) -> State:
    """Where the draws begin, their ends being where their sightings meet the ground."""
    center, rotation = draws.center_world_m, draws.world_from_camera
    turn = np.zeros_like(center)
    if start is not None:
        turn = log_so3(np.swapaxes(rotation, 1, 2) @ start[1])
        center, rotation = (np.repeat(one[None], len(center), axis=0) for one in start)
    place = ground_places(design, draws, (center, rotation))
    common = np.zeros((common_count(design), len(center)))
    return State(center.T.copy(), turn.T.copy(), place[..., :2].transpose(2, 1, 0).copy(), common)


def _newton(
    design: PhotoDesign, draws: Draws, state: State, active: Ints, steps: Ints, at_rest: Bools
) -> Ints:
    """Steps without damping; state, steps and rest are written. Returns what is left."""
    here, part, lost = _take(state, active), Draws(*_rows(draws, active)), []
    for _ in range(MOST_STEPS):
        if not active.size:
            break
        there, length = moved(design, linearise(design, part, here), here)
        steps[active] += 1
        rest, finite = length < AT_REST, np.isfinite(length)
        if rest.any() or not finite.all():
            done = active[rest]
            for own, new in zip(state, there, strict=True):
                own[..., done] = new[..., rest]
            at_rest[done] = True
            lost.append(active[~finite])
            kept = np.flatnonzero(finite & ~rest)
            active, there = active[kept], _take(there, kept)
            part = Draws(*_rows(part, kept))
        here = there
    return np.concatenate([*lost, active])


def _damped(
    design: PhotoDesign, draws: Draws, state: State, active: Ints, steps: Ints, at_rest: Bools
) -> None:
    """Steps that never lead upwards, for the few that need them; state and rest are written."""
    damping = np.full(len(active), FIRST_DAMPING)
    for _ in range(MOST_DAMPED):
        if not active.size:
            return
        part, here = Draws(*_rows(draws, active)), _take(state, active)
        line = linearise(design, part, here)
        there, length = moved(design, line, here, damping)
        cost = linearise(design, part, there).cost
        good = (cost <= line.cost) | (np.isfinite(cost) & (length < BEYOND_ROUNDING))
        steps[active] += 1
        for own, new in zip(state, there, strict=True):
            own[..., active[good]] = new[..., good]
        rest = good & (length < AT_REST) & (damping == 0.0)
        at_rest[active[rest]] = True
        less = np.where(damping / 10.0 < LEAST_DAMPING, 0.0, damping / 10.0)
        damping = np.where(good, less, np.maximum(10.0 * damping, FIRST_DAMPING))[~rest]
        active = active[~rest]


def _found(
    design: PhotoDesign, draws: Draws, state: State, steps: Ints, at_rest: Bools
) -> PhotoPosesFound:
    """The poses with their covariances, of δcentre and of a turn in the camera's axes."""
    line = linearise(design, draws, state)
    rotation, by_turn = turned(draws.rotation, state.turn)
    size = len(steps)
    root = cholesky(line.normal)
    unit = np.repeat(np.eye(6)[:, :, None], size, axis=2)
    covariance = backward(root, forward(root, unit))
    by_step = np.zeros((6, 6, size))
    by_step[:3, :3] = np.eye(3)[:, :, None]
    by_step[3:, 3:] = np.einsum("jib,jkb->ikb", rotation, by_turn)
    covariance = np.einsum("ijb,jkb,lkb->bil", by_step, covariance, by_step, optimize=True)
    return PhotoPosesFound(
        center_world_m=state.center.T,
        world_from_camera=rotation.transpose(2, 0, 1),
        covariance=np.where(at_rest[:, None, None], covariance, np.nan),
        place_m=places_of(design, draws, state).transpose(2, 1, 0),
        common=state.common.T,
        cost=np.where(at_rest, line.cost, np.nan),
        converged=at_rest,
        steps=steps,
    )


def _rows(arrays: tuple[Floats, ...], rows: Ints) -> tuple[Floats, ...]:
    return tuple(value[..., rows] for value in arrays)


def _take(state: State, rows: Ints) -> State:
    return State(*_rows(state, rows))
