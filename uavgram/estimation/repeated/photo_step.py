"""One photo with known lengths and its common errors, linearised for many draws at once.

Errors of the camera, of the ground plane and of the tape are common to all observations of a photo.
Each is expressed as independent numbers of sigma 1 (columns of `PhotoDesign.camera_root` and
`ground_root`, and the relative error of the tape's scale). An error of the camera moves every
pixel, so for a given sighting it moves the place on the ground in the opposite sense. An error of
the ground plane moves places along their rays.

An end of a length is seen once, so its place on the ground is the intersection of its sighting,
error e included, with the ground. Moving the camera by δC and rotating it by ω moves that place by
P (δC + ω x r), with r the ray from camera to place and P the projection along r onto the ground:
this needs no derivative of the lens, only the effect of e does. Readings are functions of places:
lengths between two of them, and coordinates of one along a direction. Errors that all sightings or
all readings share, of camera, ground and tape, are treated like e: normal, with sigma 1, and
eliminated with it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.batched import cholesky, solve_lower, solve_lower_transposed
from uavgram.geometry.camera.lens import distort, split_components, write_parameter_derivative
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation import PhotoDesign, PhotoDraws


def count_common_errors(design: PhotoDesign) -> int:
    """Return the number of common errors."""
    return (
        _columns(design.camera_root) + _columns(design.ground_root) + bool(design.tape_scale_sigma)
    )


def ground_slice(design: PhotoDesign) -> slice:
    """Return the slice of the errors of the ground; those of the camera come before it."""
    first = _columns(design.camera_root)
    return slice(first, first + _columns(design.ground_root))


def compute_ground(design: PhotoDesign, stated: Floats, common: Floats) -> Floats:
    """Compute the height of the ground at the origin and its slopes, (3, B).

    Parameters
    ----------
    design, common
        As for `compute_parameters`.
    stated
        (3, B) prior values of them.
    """
    if design.ground_root is None:
        return stated
    return np.asarray(stated + design.ground_root @ common[ground_slice(design)])


def compute_rise(design: PhotoDesign, change: Floats, place: Floats) -> Floats:
    """Compute the rise (E, B) of the ground under places by changed errors [m].

    Parameters
    ----------
    design
        Design common to B draws.
    change
        (K, B) of the errors, or (K, 1).
    place
        (2, E, B).
    """
    if design.ground_root is None:
        return np.zeros(place.shape[1:])
    height, east, north = design.ground_root @ change[ground_slice(design)]
    return np.asarray(height + east * place[0] + north * place[1])


def compute_parameters(design: PhotoDesign, common: Floats) -> Floats:
    """Return the camera's parameters: (P,) if it is exact, else (P, B).

    Parameters
    ----------
    design
        Design common to B draws.
    common
        (K, B) their errors.
    """
    stated = design.calibration.parameters
    if design.camera_root is None:
        return stated
    return np.asarray(stated[:, None] + design.camera_root @ common[: _columns(design.camera_root)])


def compute_tape_scale(design: PhotoDesign, common: Floats) -> Floats:
    """Return the (B,) reading of one metre, as in `estimation/survey/observations/lengths.py`.

    Parameters
    ----------
    design, common
        As for `compute_parameters`.
    """
    if not design.tape_scale_sigma:
        return np.ones(common.shape[1])
    return np.asarray(1.0 / (1.0 + design.tape_scale_sigma * common[-1]))


def compute_pixel_shifts(
    design: PhotoDesign, parameters: Floats, rotation: Floats, ray: Floats
) -> Floats:
    """Compute shifts (2, E, K, B) of the pixels of places by the camera's errors, in sigmas.

    Parameters
    ----------
    design, parameters
        As for `compute_parameters`.
    rotation, ray
        (3, 3, B), (3, E, B) from the camera to the places.
    """
    ends, size = ray.shape[1:]
    out = np.zeros((2, ends, count_common_errors(design), size))
    if design.camera_root is None:
        return out
    right, down, ahead = (np.einsum("ib,ieb->eb", rotation[:, k], ray) for k in range(3))
    u, v = right / ahead, down / ahead
    lens = distort(design.calibration.model, parameters[4:], u, v)
    by_parameter = np.zeros((ends, size, 2, len(parameters)))
    write_parameter_derivative(by_parameter, design.calibration.model, parameters, lens, (u, v))
    moved = np.einsum("ebjp,pk->jekb", by_parameter, design.camera_root, optimize=True)
    out[:, :, : _columns(design.camera_root)] = moved / design.pixel_sigma_px[:, None, None]
    return out


def compute_common_effects(
    design: PhotoDesign,
    ends: Ints,
    sightings: tuple[Floats, Floats],
    readings: tuple[Floats, Floats],
    sights: tuple[Floats, Floats, Floats, Floats],
) -> Floats:
    """Compute (R, K, B) effects of the common errors on the expected readings.

    Parameters
    ----------
    design
        Design common to B draws.
    ends
        (2, R) the two ends of each reading; the lengths come first.
    sightings
        (2, 2, R, B) effects of the errors of the two ends, u and v, on these readings, and result
        of `compute_pixel_shifts`.
    readings
        (R, B) expected readings, and result of `compute_tape_scale`.
    sights
        (2, 3, R, B) gradients of the readings by their ends, and of the ends (3, E, B) rays, (E, B)
        their fall against the ground, (3, E, B) places.
    """
    (by_error, shifts), (expected, scale), (pull, ray, falling, world) = sightings, readings, sights
    out = np.zeros((len(expected), shifts.shape[2], expected.shape[1]))
    # A sighting keeps its own error: the camera's shift acts with the opposite sign.
    if design.camera_root is not None:
        for own, at in zip(by_error, ends, strict=True):
            out -= np.einsum("jlb,jlkb->lkb", own, shifts[:, at])
    if design.ground_root is not None:
        columns = ground_slice(design)
        unit = np.eye(out.shape[1])[columns, :, None]
        rise = np.stack([compute_rise(design, one, world) for one in unit])
        for own, at in zip(pull, ends, strict=True):
            # Raising the ground moves a place along its ray, by ray / falling for each metre.
            by_rise = np.einsum("krb,krb->rb", own, ray[:, at]) / falling[at]
            out[:, columns] += by_rise[:, None] * rise[:, at].swapaxes(0, 1)
    # reading = length / (1 + sigma k): its derivative by k is -sigma reading scale.
    if design.tape_scale_sigma:
        taped = len(design.line)
        out[:taped, -1] = -design.tape_scale_sigma * expected[:taped] * scale
    return out


def _columns(root: Floats | None) -> int:
    return 0 if root is None else root.shape[1]


SMALL_ANGLE_RAD = 1e-2
"""Angle below which series replace the closed forms, which suffer from cancellation [rad]."""


def rotate(base: Floats, vector: Floats) -> tuple[Floats, Floats]:
    """Compute ``base exp(v)``, and that times the right Jacobian of exp at v.

    Rodrigues' formula, and Sola, Deray, Atchuthan (2018), "A micro Lie theory", eq. 143.

    Parameters
    ----------
    base
        (3, 3, B) rotations.
    vector
        (3, B) rotation vectors [rad].

    Returns
    -------
    rotation, by_vector : (3, 3, B)
        The second converts a change of v into the rotation vector of its effect, in the world.
    """
    t2 = np.einsum("kb,kb->b", vector, vector)
    t = np.sqrt(t2)
    near = t < SMALL_ANGLE_RAD
    with np.errstate(invalid="ignore", divide="ignore"):
        sine, versine = np.sin(t), 1 - np.cos(t)
        a = np.where(near, 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42)), sine / t)
        b = np.where(near, 0.5 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56))), versine / t2)
        c = np.where(near, (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72))) / 6, (t - sine) / t2 / t)
    # exp = cos I + a [v] + b v v^T; its right Jacobian = a I - b [v] + c v v^T.
    rotation = np.einsum("ijb,jkb->ikb", base, _make_matrix(1.0 - b * t2, a, b, vector))
    jacobian = np.einsum("ijb,jkb->ikb", rotation, _make_matrix(a, -b, c, vector))
    return rotation, jacobian


def _make_matrix(diagonal: Floats, cross: Floats, outer: Floats, v: Floats) -> Floats:
    """Compute ``diagonal I + cross [v] + outer v v^T``, (3, 3, B)."""
    out = outer * v[:, None] * v[None]
    for k in range(3):
        out[k, k] += diagonal
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = cross * v[k]
        out[j, i] += turn
        out[i, j] -= turn
    return np.asarray(out)


class Draws(NamedTuple):
    """Draws as of `PhotoDraws`, the draw last.

    (2, E, B) pixels, (L, B) lengths, prior poses (3, B), (3, 3, B), ground (3, B), directions (2,
    P, B) and coordinates (P, B) along them.
    """

    pixel: Floats
    length: Floats
    center: Floats
    rotation: Floats
    ground: Floats
    toward: Floats
    placed: Floats


def put_draws_last(draws: PhotoDraws) -> Draws:
    """Return the draws with the draw as the last axis."""
    count = len(draws.length_m)
    toward = np.zeros((count, 0, 2)) if draws.toward is None else draws.toward
    placed = np.zeros((count, 0)) if draws.placed_m is None else draws.placed_m
    return Draws(
        *(
            np.ascontiguousarray(value)
            for value in (
                draws.pixel_px.transpose(2, 1, 0),
                draws.length_m.T,
                draws.center_world_m.T,
                draws.world_from_camera.transpose(1, 2, 0),
                draws.ground.T,
                toward.transpose(2, 1, 0),
                placed.T,
            )
        )
    )


class State(NamedTuple):
    """Centres (3, B), rotations from the prior poses (3, B), places (2, E, B), errors (K, B)."""

    center: Floats
    turn: Floats
    place: Floats
    common: Floats


class PhotoLinearisation(NamedTuple):
    """PhotoLinearisation, and the cost (B,) at its state.

    Attributes
    ----------
    cost
        NaN if an end is behind the camera.
    normal, right
        (6, 6, B), (6, B) of the pose.
    lower, by_pose, misfit
        (R, R, B) factor of the covariance of the readings' misclosures, and, divided by it, (R, 6,
        B) derivatives of the readings by the pose, (R, B) misclosures.
    by_error
        (2, 2, R, B) effects of the errors of the two ends, u and v, on the readings.
    error, to_place
        (2, E, B) of the sightings in sigmas, (2, 2, E, B) their effects on the places.
    common, by_common, shifts
        (K, B) errors of camera, ground and tape, (R, K, B) their effects on the readings, (2, E,
        K, B) shifts of a sighting by those of the camera, in sigmas.
    slope, ray, falling, by_turn
        (2, B) of the ground, (3, E, B) from camera to place, (E, B) its fall against the ground,
        (3, 3, B) from a change of the rotation to a rotation vector in the world.
    """

    cost: Floats
    normal: Floats
    right: Floats
    lower: Floats
    by_pose: Floats
    misfit: Floats
    by_error: Floats
    error: Floats
    to_place: Floats
    common: Floats
    by_common: Floats
    shifts: Floats
    slope: Floats
    ray: Floats
    falling: Floats
    by_turn: Floats


def compute_places(design: PhotoDesign, draws: Draws, state: State) -> Floats:
    """Return the ends (3, E, B) on the ground of the state.

    Parameters
    ----------
    design, draws, state
        Of B draws.
    """
    height, *slope = compute_ground(design, draws.ground, state.common)
    x, y = state.place
    up = height + slope[0] * x + slope[1] * y + design.height_m[:, None]
    return np.stack([x, y, up])


def linearise(design: PhotoDesign, draws: Draws, state: State) -> PhotoLinearisation:
    """Linearise the photo of each draw at a state.

    Parameters
    ----------
    design, draws, state
        Of B draws.
    """
    rotation, by_turn = rotate(draws.rotation, state.turn)
    slope = compute_ground(design, draws.ground, state.common)[1:]
    world = compute_places(design, draws, state)
    ray = world - state.center[:, None]
    falling = ray[2] - slope[0] * ray[0] - slope[1] * ray[1]
    parameters = compute_parameters(design, state.common)
    error, to_place = _compute_sightings(design, draws, rotation, (ray, slope), parameters)
    scale = compute_tape_scale(design, state.common)
    ends = list_ends(design)
    sigma, pull, predicted = _compute_readings(design, draws, world, scale)
    # Gradient by the places along the ground: by the place itself, and by its height.
    along = pull[:, :2] + pull[:, 2:] * slope[:, None]
    jacobian = _compute_pose_effects(slope, along, (ray, falling), ends, by_turn)
    by_error = np.stack(
        [
            np.einsum("krb,kjrb->jrb", own, to_place[:, :, at])
            for own, at in zip(along, ends, strict=True)
        ]
    )
    shifts = compute_pixel_shifts(design, parameters, rotation, ray)
    shared = compute_common_effects(
        design, ends, (by_error, shifts), (predicted, scale), (pull, ray, falling, world)
    )
    # Misclosure at e = 0: reading minus prediction, plus the effects of the present errors.
    misfit = np.concatenate([draws.length, draws.placed]) - predicted
    off = misfit / sigma[:, None]
    for k, at in enumerate(ends):
        misfit += np.einsum("jlb,jlb->lb", by_error[k], error[:, at])
    misfit += np.einsum("lkb,kb->lb", shared, state.common)
    # S = sigma_t^2 I + Je Je^T; whiten Jacobian and misclosure by its Cholesky factor.
    spread = _spread(ends, sigma, by_error)
    if shared.shape[1]:
        spread += np.einsum("lkb,mkb->lmb", shared, shared)
    lower = cholesky(spread)
    whitened = solve_lower(lower, np.concatenate([jacobian, misfit[:, None]], axis=1))
    by_pose, missed = whitened[:, :6], whitened[:, 6]
    # Prior of the pose.
    apart = np.concatenate([state.center - draws.center, state.turn])
    known = design.information
    pulled = np.tensordot(known, apart, axes=1)
    normal = np.einsum("lib,ljb->ijb", by_pose, by_pose) + known[:, :, None]
    cost = (error**2).sum(axis=(0, 1)) + (off**2).sum(axis=0) + (apart * pulled).sum(axis=0)
    cost += (state.common**2).sum(axis=0)
    return PhotoLinearisation(
        cost=cost,
        normal=normal,
        right=np.einsum("lib,lb->ib", by_pose, missed) - pulled,
        lower=lower,
        by_pose=by_pose,
        misfit=missed,
        by_error=by_error,
        error=error,
        to_place=to_place,
        common=state.common,
        by_common=shared,
        shifts=shifts,
        slope=slope,
        ray=ray,
        falling=falling,
        by_turn=by_turn,
    )


def list_ends(design: PhotoDesign) -> Ints:
    """Return the (2, R) ends of lengths, then none and the end of each coordinate.

    None is -1: no gradient is by it.
    """
    if design.placed is None:
        return design.line.T
    none = np.full_like(design.placed, -1)
    return np.concatenate([design.line.T, [none, design.placed]], axis=1)


def _compute_readings(
    design: PhotoDesign, draws: Draws, world: Floats, scale: Floats
) -> tuple[Floats, Floats, Floats]:
    """Predict the readings at places (3, E, B) of the ends: lengths, then coordinates.

    Returns
    -------
    sigma : (R,)
    pull : (2, 3, R, B)
        Gradients by the two ends of `list_ends`.
    predicted : (R, B)
    """
    start, end = design.line.T
    leg = world[:, end] - world[:, start]
    length = np.sqrt(np.einsum("klb,klb->lb", leg, leg))
    unit = leg / length * scale
    pull, predicted = np.stack([-unit, unit]), scale * length
    if design.placed is None or design.place_sigma_m is None:
        return design.length_sigma_m, pull, predicted
    toward = np.zeros((2, 3, *draws.placed.shape))
    toward[1, :2] = draws.toward
    coordinate = np.einsum("kpb,kpb->pb", draws.toward, world[:2, design.placed])
    return (
        np.concatenate([design.length_sigma_m, design.place_sigma_m]),
        np.concatenate([pull, toward], axis=2),
        np.concatenate([predicted, coordinate]),
    )


def apply_step(design: PhotoDesign, line: PhotoLinearisation, state: State, step: Floats) -> State:
    """Apply steps of the poses; errors and places follow by back substitution.

    Parameters
    ----------
    design, line, state
        Design, linearisation, and its state.
    step
        (6, B) of centre [m] and of the rotation [rad].
    """
    # Errors by the remaining misclosure: e = Je^T S^-1 (misclosure - J step).
    missed = line.misfit - np.einsum("lib,ib->lb", line.by_pose, step)
    force = solve_lower_transposed(line.lower, missed)
    change = -line.error
    for k, ends in enumerate(list_ends(design).tolist()):
        pulls = line.by_error[k] * force
        for reading, at in enumerate(ends):
            change[:, at] += pulls[:, reading]
    common = np.einsum("lkb,lb->kb", line.by_common, force) - line.common
    # The pixel is fixed: the shift by the camera's error counts against the sighting's own.
    seen = change - np.einsum("jekb,kb->jeb", line.shifts, common)
    turn = np.einsum("ijb,jb->ib", line.by_turn, step[3:])
    ray, slope = line.ray, line.slope
    # Place: P (shift + turn x ray - rise), plus the effect of the sighting's error.
    shift = _rotate_and_shift(step[:3], turn, ray)
    rise = compute_rise(design, common, state.place)
    fall = (shift[2] - slope[0] * shift[0] - slope[1] * shift[1] - rise) / line.falling
    place = np.einsum("kjeb,jeb->keb", line.to_place, seen) + shift[:2] - ray[:2] * fall
    return State(
        state.center + step[:3],
        state.turn + step[3:],
        state.place + place,
        state.common + common,
    )


def _rotate_and_shift(shift: Floats, turn: Floats, ray: Floats) -> Floats:
    """Compute ``shift + turn x ray``, (3, E, B)."""
    out = np.empty_like(ray)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = shift[i] + turn[j] * ray[k] - turn[k] * ray[j]
    return out


def _compute_sightings(
    design: PhotoDesign,
    draws: Draws,
    rotation: Floats,
    rays: tuple[Floats, Floats],
    parameters: Floats,
) -> tuple[Floats, Floats]:
    """Compute errors (2, E, B) of sightings in sigmas, and inverse derivatives by the places."""
    camera = design.calibration
    ray, slope = rays
    fx, fy, cx, cy = split_components(parameters[:4])
    right, down, ahead = (
        rotation[0, k] * ray[0] + rotation[1, k] * ray[1] + rotation[2, k] * ray[2]
        for k in range(3)
    )
    near = 1.0 / np.where(ahead > 0, ahead, np.nan)
    u, v = right * near, down * near
    lens = distort(camera.model, parameters[4:], u, v)
    weight = 1.0 / design.pixel_sigma_px[:, None]
    error = np.stack(
        [
            (fx * lens.x + cx - draws.pixel[0]) * weight,
            (fy * lens.y + cy - draws.pixel[1]) * weight,
        ]
    )
    # Components of the camera's axes along the two directions of the ground.
    axis = [[rotation[k, i] + slope[k] * rotation[2, i] for i in range(3)] for k in (0, 1)]
    rows = []
    for focal, by_u, by_v in ((fx, lens.a, lens.b), (fy, lens.b, lens.c)):
        scale = focal * near * weight
        first, second = scale * by_u, scale * by_v
        third = first * u + second * v
        rows.append([first * a[0] + second * a[1] - third * a[2] for a in axis])
    (a, b), (c, d) = rows
    with np.errstate(invalid="ignore", divide="ignore"):
        by = 1.0 / (a * d - b * c)
    return error, np.stack([np.stack([d * by, -b * by]), np.stack([-c * by, a * by])])


def _compute_pose_effects(
    slope: Floats, along: Floats, rays: tuple[Floats, Floats], ends: Ints, by_turn: Floats
) -> Floats:
    """Compute (R, 6, B) effects of a shift and a rotation of the camera on readings of ends."""
    ray, falling = rays
    shift: Floats | float = 0.0
    swing: Floats | float = 0.0
    for own, at in zip(along, ends, strict=True):
        r = ray[:, at]
        # g = P^T (gradient along the ground); the rotation has r x g.
        tilt = (own[0] * r[0] + own[1] * r[1]) / falling[at]
        g = np.stack([own[0] + tilt * slope[0], own[1] + tilt * slope[1], -tilt])
        shift = shift + g
        swing = swing + np.stack(
            [r[1] * g[2] - r[2] * g[1], r[2] * g[0] - r[0] * g[2], r[0] * g[1] - r[1] * g[0]]
        )
    by_vector = np.einsum("jlb,jkb->klb", swing, by_turn)
    return np.concatenate([np.asarray(shift), by_vector]).transpose(1, 0, 2)


def _spread(ends: Ints, sigma: Floats, by_error: Floats) -> Floats:
    """Compute the (R, R, B) covariance of the misclosures: by the readings and the ends' errors."""
    count, size = len(sigma), by_error.shape[-1]
    out = np.zeros((count, count, size))
    out[range(count), range(count)] = sigma[:, None] ** 2
    # Readings of one end have its sighting's error in common.
    for at in range(int(ends.max(initial=-1)) + 1):
        of_end = np.argwhere(ends == at).tolist()
        for end, i in of_end:
            for other, j in of_end:
                one, two = by_error[end, :, i], by_error[other, :, j]
                out[i, j] += one[0] * two[0] + one[1] * two[1]
    return out
