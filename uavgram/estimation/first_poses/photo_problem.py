"""Poses of many single photos over a plane, adjusted together.

Each photo has E points on the ground (or at known heights above it), each of them picked once, and
R readings: lengths between two points, and coordinates of a point along a direction. Its unknowns
are the pose, the places of the points, and errors that all its observations share, of camera,
ground and tape. Priors: those of the pose, and sigma 1 for each shared error.

As each point is picked once, its place on the ground follows from the pose, the shared errors and
the error e of its pick. The places are eliminated in favour of e ~ N(0, 1), and the errors from

    reading(pose, shared, e) + n,   n ~ N(0, sigma^2)

whose misclosures have the covariance W = sigma^2 I + (d reading / d e)(d reading / d e)^T (the
Gauss-Helmert model: Mikhail 1976; Neitzel 2010, linearised at the adjusted observations). This is
the Schur complement of the whole adjustment, written with Woodbury's identity, so that it converges
to the minimum of `estimation/survey/likelihood.py` for the same observations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.batched import Linearisation, solve_each
from uavgram.estimation.solver.batched import State as Unknowns
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import exp_with_right_jacobian
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration

POSE = slice(0, 6)
"""Columns of the pose among the unknowns: centre [m], and rotation vector from the prior pose
[rad]. Those of the shared errors follow: camera, ground, tape."""


class SharedErrors(NamedTuple):
    """Errors that all observations of a photo share, each in sigmas.

    Attributes
    ----------
    calibration
        Camera; its covariance is not used.
    camera_root
        (P, C) effect of C errors on the camera's parameters: a root of their covariance.
    ground_root
        (3, G) effect of G errors on height and slopes of the ground.
    tape_scale_sigma
        Standard deviation of the tape's scale, relative to the length; 0: it is exact.
    """

    calibration: Calibration
    camera_root: Floats = np.zeros((1, 0))
    ground_root: Floats = np.zeros((3, 0))
    tape_scale_sigma: float = 0.0

    @property
    def camera(self) -> slice:
        """Slice of the camera's errors among all."""
        return slice(0, self.camera_root.shape[1])

    @property
    def ground(self) -> slice:
        """Slice of the ground's errors among all; that of the tape follows."""
        return slice(self.camera.stop, self.camera.stop + self.ground_root.shape[1])

    @property
    def size(self) -> int:
        """Number of errors."""
        return int(self.ground.stop) + bool(self.tape_scale_sigma)


class Photos(NamedTuple):
    """Observations of B photos.

    Attributes
    ----------
    pixel_px, pixel_weight
        (B, E, 2) picks, (B, E) 1 / sigma of each coordinate.
    height_m, ground
        (B, E) heights of the points above the ground, (B, 3) height of the ground at the origin and
        its slopes to east and north.
    center, rotation, information
        (B, 3), (B, 3, 3) prior pose, (B, 6, 6) inverse of its covariance: (δcentre world, rotation
        vector in the camera); 0 if there is no prior. Where the readings leave position or heading
        free, any small number there fixes the pose without changing a length.
    line, toward, placed
        (B, L, 2) points at the ends of the lengths, (B, R - L, 2) directions of the coordinates,
        (B, R - L) points that have them.
    reading_m, reading_weight
        (B, R) lengths and then coordinates, and 1 / sigma of each; 0: the photo has fewer readings.
    """

    pixel_px: Floats
    pixel_weight: Floats
    height_m: Floats
    ground: Floats
    center: Floats
    rotation: Floats
    information: Floats
    line: Ints
    toward: Floats
    placed: Ints
    reading_m: Floats
    reading_weight: Floats

    def take(self, rows: Ints | slice) -> Photos:
        """Return some of the photos."""
        return Photos._make(column[rows] for column in self)

    def repeat(self, count: int) -> Photos:
        """Return a single photo `count` times."""
        return Photos._make(np.broadcast_to(one[0], (count, *one.shape[1:])) for one in self)


class State(NamedTuple):
    """Centres (B, 3), rotation vectors from the prior poses (B, 3), places (B, E, 2), errors."""

    center: Floats
    turn: Floats
    place: Floats
    common: Floats


class PhotoRows(NamedTuple):
    """Observations of b photos, linearised in their U unknowns and in the errors of the picks.

    Attributes
    ----------
    error
        (b, E, 2) errors of the picks, in sigmas.
    shift
        (b, E, 2, U) derivatives of the picks by the unknowns at fixed places, in sigmas.
    to_place
        (b, E, 2, 2) derivatives of the places by the errors of the picks.
    off
        (b, R) readings minus their predictions, in sigmas.
    by_unknown, by_error
        (b, R, U), (b, R, E, 2) derivatives of the predictions by the unknowns at fixed errors, and
        by the errors of the picks, in sigmas of the readings.
    """

    error: Floats
    shift: Floats
    to_place: Floats
    off: Floats
    by_unknown: Floats
    by_error: Floats


class PhotoProblem:
    """Poses of photos as a batched least-squares problem."""

    axis = 0

    def __init__(self, shared: SharedErrors, photos: Photos) -> None:
        self.shared, self.photos = shared, photos
        self._some: tuple[Ints, Photos] = np.arange(len(photos.center)), photos

    def _part(self, which: Ints) -> Photos:
        """Return some of the photos; copied only if others are requested than before."""
        if not np.array_equal(which, self._some[0]):
            self._some = which, self.photos.take(which)
        return self._some[1]

    @np.errstate(invalid="ignore", divide="ignore", over="ignore")  # some photos may get lost
    def linearise(self, which: Ints, state: Unknowns) -> Linearisation:
        """Linearise photos `which` (b,) at a state; errors and places are eliminated."""
        photos, now = self._part(which), State(*state)
        rows = self.compute_rows(photos, now)
        noise = _pair(rows.by_error)
        # Misclosures at e = 0, their covariance W, and W^-1 times Jacobian and misclosures.
        missed = rows.off + _apply(noise, rows.error.reshape(len(which), -1))
        covariance = noise @ noise.swapaxes(1, 2)
        covariance += np.eye(noise.shape[1])
        right = np.concatenate([rows.by_unknown, missed[..., None]], axis=2)
        solved = solve_each(covariance, right)
        whole = rows.by_unknown.swapaxes(1, 2) @ solved
        # Priors of the pose and of the shared errors.
        apart = np.concatenate([now.center - photos.center, now.turn], axis=1)
        pull = _apply(photos.information, apart)
        normal, gradient = whole[..., :-1], -whole[..., -1]
        normal[:, POSE, POSE] += photos.information
        np.einsum("bii->bi", normal)[:, POSE.stop :] += 1.0  # a view of the diagonal
        gradient[:, POSE] += pull
        gradient[:, POSE.stop :] += now.common
        cost = np.sum(rows.error**2, axis=(1, 2)) + np.sum(rows.off**2, axis=1)
        cost += np.sum(apart * pull, axis=1) + np.sum(now.common**2, axis=1)
        return Linearisation(
            cost, normal, gradient, (rows.error, rows.shift, rows.to_place, noise, solved)
        )

    @np.errstate(invalid="ignore", over="ignore")
    def move(self, state: Unknowns, linear: Linearisation, step: Floats) -> Unknowns:
        """Apply steps (b, U); errors and places follow by back substitution.

        Parameters
        ----------
        state, linear
            State, and its linearisation.
        step
            (b, U) steps of the unknowns.
        """
        error, shift, to_place, noise, solved = linear.rest
        # e = (d reading / d e)^T W^-1 (misclosure - J step)
        force = solved[..., -1] - _apply(solved[..., :-1], step)
        change = _apply(noise.swapaxes(1, 2), force).reshape(error.shape) - error
        change -= _apply(_flat(shift), step).reshape(error.shape)
        center, turn, place, common = state
        return (
            center + step[:, :3],
            turn + step[:, 3:6],
            place + _apply(to_place, change),
            common + step[:, POSE.stop :],
        )

    @np.errstate(invalid="ignore", divide="ignore")  # a point may be behind its camera
    def compute_rows(self, photos: Photos, state: State) -> PhotoRows:
        """Linearise the observations of b photos at a state."""
        shared = self.shared
        rotation, by_vector = rotate(photos, state)
        world, slope = compute_places(shared, photos, state)
        seen = (world - state.center[:, None]) @ rotation
        lens = shared.calibration
        parameters = lens.parameters
        if shared.camera_root.size:
            parameters = parameters + state.common[:, shared.camera] @ shared.camera_root.T
        pixel, by_seen, by_camera = project_with_jacobian(
            lens.model, parameters, seen, beyond_fold="extend"
        )
        weight = photos.pixel_weight[..., None]
        by_world = (_flat(by_seen) @ rotation.swapaxes(1, 2)).reshape(by_seen.shape)
        # A rotation w behind the camera's moves a point by seen x w, in the camera's axes.
        by_turn = np.stack(
            [
                by_seen[..., j] * seen[..., None, k] - by_seen[..., k] * seen[..., None, j]
                for j, k in ((1, 2), (2, 0), (0, 1))
            ],
            axis=-1,
        )
        # Rise of the ground under the points by its errors, at fixed places.
        rise = shared.ground_root[0] + state.place @ shared.ground_root[1:]
        shift = np.zeros((*seen.shape[:2], 2, POSE.stop + shared.size))
        shift[..., :3] = -by_world
        shift[..., 3:6] = (_flat(by_turn) @ by_vector).reshape(by_turn.shape)
        by_common = shift[..., POSE.stop :]  # a view
        if shared.camera_root.size:
            by_common[..., shared.camera] = by_camera @ shared.camera_root
        by_common[..., shared.ground] = by_world[..., 2:] * rise[:, :, None]
        shift *= weight[..., None]
        by_place = by_world[..., :2] + by_world[..., 2:] * slope[:, None, None]
        to_place = _invert(by_place * weight[..., None])
        off, by_unknown, by_error = self._readings(
            photos, state, (world, slope), (to_place, shift, rise)
        )
        return PhotoRows(
            (pixel - photos.pixel_px) * weight, shift, to_place, off, by_unknown, by_error
        )

    def _readings(
        self,
        photos: Photos,
        state: State,
        ground: tuple[Floats, Floats],
        places: tuple[Floats, Floats, Floats],
    ) -> tuple[Floats, Floats, Floats]:
        """Compute `off`, `by_unknown` and `by_error` of `PhotoRows`.

        Parameters
        ----------
        photos, state
            Photos and unknowns.
        ground
            World points (b, E, 3), and slopes (b, 2) of the ground.
        places
            `to_place` and `shift` of `PhotoRows`, and rise (b, E, G) of the ground by its errors.
        """
        shared, (world, slope), (to_place, shift, rise) = self.shared, ground, places
        count, lengths = photos.line.shape[:2]
        row, reading = np.arange(count)[:, None], np.arange(photos.reading_m.shape[1])
        sigma_t = shared.tape_scale_sigma
        scale = 1.0 / (1.0 + sigma_t * state.common[:, -1:]) if sigma_t else np.ones((count, 1))
        leg = world[row, photos.line[..., 1]] - world[row, photos.line[..., 0]]
        length = np.sqrt(np.einsum("blk,blk->bl", leg, leg))
        unit = leg * (scale / np.where(length > 0, length, 1.0))[..., None]
        along = np.einsum("bpk,bpk->bp", photos.toward, world[row, photos.placed, :2])
        predicted = np.concatenate([scale * length, along], axis=1)
        # Gradients by the points: of lengths by both ends, of coordinates by their point.
        level = np.concatenate([photos.toward, 0.0 * photos.toward[..., :1]], axis=2)
        pulls = (
            (-unit, photos.line[..., 0]),
            (
                np.concatenate([unit, level], axis=1),
                np.concatenate([photos.line[..., 1], photos.placed], axis=1),
            ),
        )
        by_error = np.zeros((count, len(reading), world.shape[1], 2))
        risen = np.zeros((count, len(reading), rise.shape[2]))
        for pull, at in pulls:
            here = slice(0, at.shape[1])
            within = pull[..., :2] + pull[..., 2:] * slope[:, None]
            by_error[row, reading[here], at] = (within[:, :, None] @ to_place[row, at])[:, :, 0]
            risen[:, here] += pull[..., 2:] * rise[row, at]
        # An unknown that shifts a pick acts like the opposite error of the pick.
        by_unknown = -_pair(by_error) @ _flat(shift)
        by_common = by_unknown[..., POSE.stop :]  # a view
        by_common[..., shared.ground] += risen
        if sigma_t:  # reading = length / (1 + sigma k)
            by_common[:, :lengths, -1] -= sigma_t * scale * predicted[:, :lengths]
        weight = photos.reading_weight
        by_unknown *= weight[..., None]
        by_error *= weight[..., None, None]
        return (photos.reading_m - predicted) * weight, by_unknown, by_error


def compute_places(shared: SharedErrors, photos: Photos, state: State) -> tuple[Floats, Floats]:
    """Compute world points (b, E, 3) of a state, and slopes (b, 2) of the ground.

    Parameters
    ----------
    shared, photos
        Errors that all photos share, and the photos (b).
    state
        Places of the points, and the common unknowns.
    """
    ground = photos.ground + state.common[:, shared.ground] @ shared.ground_root.T
    up = ground[:, :1] + _apply(state.place, ground[:, 1:]) + photos.height_m
    return np.concatenate([state.place, up[..., None]], axis=2), ground[:, 1:]


def rotate(photos: Photos, state: State) -> tuple[Floats, Floats]:
    """Compute rotations (b, 3, 3) of a state, and right Jacobians (b, 3, 3) of their vectors."""
    turn, by_vector = exp_with_right_jacobian(state.turn)
    return photos.rotation @ turn, by_vector


def _pair(columns: Floats) -> Floats:
    """Return derivatives (b, R, E, 2) by the picks as (b, R, 2 E)."""
    return columns.reshape(*columns.shape[:2], 2 * columns.shape[2])


def _flat(rows: Floats) -> Floats:
    """Return rows (b, E, 2, n) of the picks as (b, 2 E, n): one product for each photo."""
    return rows.reshape(len(rows), -1, rows.shape[-1])


def _apply(matrix: Floats, vector: Floats) -> Floats:
    """Multiply matrices (..., n, m) by vectors (..., m)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _invert(matrix: Floats) -> Floats:
    """Invert matrices (..., 2, 2); not finite where they are singular."""
    a, b, c, d = (matrix[..., i, j] for i in (0, 1) for j in (0, 1))
    inverse = np.stack([d, -b, -c, a], axis=-1) / (a * d - b * c)[..., None]
    return np.asarray(inverse.reshape(matrix.shape))
