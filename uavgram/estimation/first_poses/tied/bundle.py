"""Rays of tie points, adjustment of poses and tie points, and transfer to the world's axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.sparse import csr_array

from uavgram.estimation.first_poses.resection import compute_across_axes, compute_ray_residuals
from uavgram.estimation.solver.levenberg_marquardt import minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.rotation import exp_so3, nearest_rotation
from uavgram.model.arrays import Bools, Floats, FrozenArrays, Ints
from uavgram.model.camera import Calibration
from uavgram.model.survey import Survey


@dataclass(frozen=True, kw_only=True, eq=False)
class TiedRays(FrozenArrays):
    """N sightings of T tie points in F frames; a frame sees a point at most once.

    Attributes
    ----------
    frame, point
        (N,) frame and point of each sighting.
    ray
        (N, 3) unit vectors towards it, in the camera.
    sigma_rad
        (N,) standard deviation of a ray, per axis.
    frames, points
        F and T.
    """

    frame: Annotated[Ints, "n"]
    point: Annotated[Ints, "n"]
    ray: Annotated[Floats, "n", 3]
    sigma_rad: Annotated[Floats, "n"]
    frames: int
    points: int

    def take(self, rows: Ints | Bools) -> TiedRays:
        """Return some of the sightings, of the same frames and points."""
        return TiedRays(
            frame=self.frame[rows],
            point=self.point[rows],
            ray=self.ray[rows],
            sigma_rad=self.sigma_rad[rows],
            frames=self.frames,
            points=self.points,
        )

    def count_shared_points(self) -> Ints:
        """Count (F, F) points that two frames have in common."""
        ones = np.ones(len(self.frame), dtype=np.int64)
        seen = csr_array((ones, (self.frame, self.point)), shape=(self.frames, self.points))
        return np.asarray((seen @ seen.T).todense())

    def find_shared_rows(self, first: int, second: int) -> tuple[Ints, Ints]:
        """Return (m,), (m,) rows of the points that two frames share, in the same order."""
        one, other = np.flatnonzero(self.frame == first), np.flatnonzero(self.frame == second)
        _, at_one, at_other = np.intersect1d(
            self.point[one], self.point[other], assume_unique=True, return_indices=True
        )
        return one[at_one], other[at_other]


@dataclass(frozen=True, kw_only=True, eq=False)
class TiedPoses:
    """Poses of connected frames, in axes and a scale of their own.

    Attributes
    ----------
    center, rotation
        (F, 3), (F, 3, 3) world from camera; NaN for frames that are not connected with them.
    point
        (T, 3); NaN if no two rays of such frames determine it.
    agrees
        (N,) mask of the sightings that fit approximately; the others are of frames without a pose,
        or wrong.
    spread_rad
        Residual of the rays, per axis (root mean square of those that agree).
    """

    center: Floats
    rotation: Floats
    point: Floats
    agrees: Bools
    spread_rad: float

    @property
    def placed(self) -> Bools:
        """(F,) mask of the frames that have a pose."""
        return np.isfinite(self.center[:, 0])


def compute_tied_rays(survey: Survey) -> tuple[TiedRays, Ints]:
    """Return rays to tie points and along chains of matches, each once by frame and point.

    Returns
    -------
    rays
        The points of the chains follow the tie points.
    row : (N,)
        Index of the sighting of each: first those of the ties, then those of the matches.
    """
    ties, matches, camera = survey.ties, survey.matches, survey.calibration
    clicked = matches.pick
    frame = np.concatenate([ties.frame, matches.frame])
    point = np.concatenate([ties.point, ties.points + matches.point])
    pixel = np.concatenate([ties.pixel_px, matches.pixel_px])
    sigma = np.concatenate([ties.sigma_px, matches.sigma_px])
    sizes = len(survey.frame_id), ties.points + len(clicked)
    return compute_rays(camera, (frame, point), pixel, sigma, sizes)


def compute_rays(
    camera: Calibration,
    seen: tuple[Ints, Ints],
    pixel_px: Floats,
    sigma_px: Floats,
    sizes: tuple[int, int],
) -> tuple[TiedRays, Ints]:
    """Compute rays through pixels, each once by frame and point, and the (N,) pixel of each.

    Parameters
    ----------
    camera
        Calibration of all frames.
    seen
        (n,), (n,) frame and point of each sighting.
    pixel_px, sigma_px
        (n, 2), (n,) pixels, and the sigma of each coordinate.
    sizes
        Number of frames and of points.
    """
    frame, point = seen
    ray = back_project(camera.model, camera.parameters, pixel_px)
    size = np.linalg.norm(ray, axis=1)
    _, first = np.unique(np.column_stack([frame, point]), axis=0, return_index=True)
    rows = np.sort(first)
    rows = rows[np.isfinite(size[rows])]
    found = TiedRays(
        frame=frame[rows],
        point=point[rows],
        ray=ray[rows] / size[rows, None],
        sigma_rad=sigma_px[rows] / camera.parameters[0],
        frames=sizes[0],
        points=sizes[1],
    )
    return found, rows


WEAK_SIGMA = 1.0
"""Sigma of weak priors that keep each centre (in units of the largest distance of a camera from
their mean) and attitude (rad), compared with rays of a ten-thousandth: they fix axes and scale
without distortion."""

MAX_ITERATIONS = 12
MIN_REDUCTION = 1e-3
"""Predicted reduction of the sum of squares, per ray, below which the iteration ends."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Poses and points: (F, 3), (F, 3, 3), (T, 3); NaN if unknown."""

    center: Floats
    rotation: Floats
    point: Floats

    def placed_rows(self, sightings: TiedRays) -> Bools:
        """Mark the sightings (N,) of a point with a place from a frame with a pose."""
        return np.asarray(
            np.isfinite(self.center[sightings.frame, 0])
            & np.isfinite(self.point[sightings.point, 0])
        )

    def angles(self, sightings: TiedRays) -> Floats:
        """Compute (N,) angles between rays and their points [rad]; NaN if one is missing."""
        seen = np.einsum(
            "nj,nji->ni",
            self.point[sightings.point] - self.center[sightings.frame],
            self.rotation[sightings.frame],
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = seen / np.linalg.norm(seen, axis=1)[:, None]
        chord = np.linalg.norm(seen - sightings.ray, axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def adjust_scene(
    scene: Scene, sightings: TiedRays, rows: Bools, iterations: int = MAX_ITERATIONS
) -> Scene:
    """Adjust the poses and points to some of the sightings.

    Parameters
    ----------
    scene
        Initial values.
    sightings
        All sightings.
    rows
        (N,) mask of those that take part: of frames and points that have a place.
    iterations
        Largest number of iterations.
    """
    if not rows.any():
        return scene
    used = sightings.take(rows)
    points, point = np.unique(used.point, return_inverse=True)
    frames, frame = np.unique(used.frame, return_inverse=True)
    problem = _Rays(used, frame, point, scene.center[frames])
    start = (scene.center[frames], scene.rotation[frames], scene.point[points])
    size = 3 * len(points) + 6 * len(frames)
    structure = Structure(
        size=size, points=len(points), point_size=3, block_size=6, first_shared=size
    )
    try:
        end = minimise(
            start,
            problem.blocks,
            problem.moved,
            size,
            structure,
            most=iterations,
            at_rest=MIN_REDUCTION * len(used.frame),
        )
    except SingularError:
        return scene
    center, rotation, place = (
        np.array(scene.center),
        np.array(scene.rotation),
        np.array(scene.point),
    )
    center[frames], rotation[frames], place[points] = end.state
    return Scene(center, rotation, place)


_State = tuple[Floats, Floats, Floats]


class _Rays:
    """Residuals of rays against points, and weak priors of the poses."""

    def __init__(self, sightings: TiedRays, frame: Ints, point: Ints, center: Floats) -> None:
        self._ray, self._frame, self._point = sightings.ray, frame, point
        self._across = compute_across_axes(sightings.ray) / sightings.sigma_rad[:, None, None]
        self._first_frame = 3 * (int(point.max()) + 1)
        self._columns = np.concatenate(
            [
                3 * point[:, None] + np.arange(3),
                self._first_frame + 6 * frame[:, None] + np.arange(6),
            ],
            axis=1,
        )
        self._center = center
        frames = np.arange(len(center))
        self._stay_columns = self._first_frame + 6 * frames[:, None] + np.arange(6)
        self._size = float(
            np.maximum(np.linalg.norm(center - center.mean(axis=0), axis=1).max(), 1e-6)
        )

    def blocks(self, state: _State) -> dict[str, Block] | None:
        center, rotation, place = state
        residual, by_point, by_turn = (
            part[:, 0]
            for part in compute_ray_residuals(
                self._ray[:, None],
                self._across[:, None],
                place[self._point][:, None],
                (center[self._frame], rotation[self._frame]),
            )
        )
        if np.isnan(residual).any():  # a point is behind its camera
            return None
        jacobian = np.concatenate([by_point, -by_point, by_turn], axis=2)
        # Weak priors fix the seven free parameters (axes, origin and scale).
        stay = np.zeros((len(center), 6))
        stay[:, :3] = (center - self._center) / (WEAK_SIGMA * self._size)
        held = np.zeros((len(center), 6, 6))
        held[:, range(3), range(3)] = 1.0 / (WEAK_SIGMA * self._size)
        held[:, range(3, 6), range(3, 6)] = 1.0 / WEAK_SIGMA
        return {
            "rays": Block(residual, self._columns, jacobian),
            "stay": Block(stay, self._stay_columns, held),
        }

    def moved(self, state: _State, step: Floats) -> _State:
        center, rotation, place = state
        by_point = step[: self._first_frame].reshape(-1, 3)
        by_frame = step[self._first_frame :].reshape(-1, 6)
        return (
            center + by_frame[:, :3],
            rotation @ exp_so3(by_frame[:, 3:]),
            place + by_point,
        )


SAMPLE_COUNT = 200
"""Number of samples of three points, one of which should be entirely on the ground."""

MAX_EXTENT_RATIO = 0.05
"""Second extent of known positions, as a share of the first, below which they are in line: the roll
about the line is then determined by the ground."""

MIN_POINTS = 10
"""Smallest number of tie points that determine the ground."""


def transform(poses: TiedPoses, turn: Floats, scale: float, shift: Floats) -> TiedPoses:
    """Transform poses to axes where x is scale * turn x + shift.

    Parameters
    ----------
    poses
        Poses in any axes.
    turn
        (3, 3) rotation.
    scale
        Positive.
    shift
        (3,).
    """
    return replace(
        poses,
        center=scale * poses.center @ turn.T + shift,
        rotation=turn @ poses.rotation,
        point=scale * poses.point @ turn.T + shift,
    )


def level_scene(poses: TiedPoses, seed: int = 0) -> TiedPoses | None:
    """Transform poses so that most tie points are on the plane z = 0; None if undetermined.

    The plane with the smallest median distance of the points, among planes through three of them
    that all cameras are above; then the best fit to its near points.

    Parameters
    ----------
    poses
        Poses in any axes.
    seed
        Seed of the random samples.
    """
    point = poses.point[np.isfinite(poses.point[:, 0])]
    center = poses.center[poses.placed]
    if len(point) < MIN_POINTS:
        return None
    rng = np.random.default_rng(seed)
    three = point[np.argsort(rng.random((SAMPLE_COUNT, len(point))), axis=1)[:, :3]]
    normal = np.cross(three[:, 1] - three[:, 0], three[:, 2] - three[:, 0])
    size = np.linalg.norm(normal, axis=1)
    normal, base = normal[size > 0] / size[size > 0, None], three[size > 0, 0]
    side = (center[None] - base[:, None]) @ normal[:, :, None]
    # Turn the normals towards the cameras, and keep planes with all cameras on one side.
    normal *= np.sign(np.median(side[..., 0], axis=1))[:, None]
    above = (np.abs(side[..., 0]) > 0).all(axis=1) & (
        np.abs(np.sign(side[..., 0]).sum(axis=1)) == len(center)
    )
    if not above.any():
        return None
    off = np.abs(((point[None] - base[:, None]) @ normal[:, :, None])[..., 0])
    spread = np.where(above, np.median(off, axis=1), np.inf)
    best = int(np.argmin(spread))
    # Points within three robust sigmas, and the plane of best fit through them (SVD).
    near = point[off[best] <= 3.0 * 1.4826 * spread[best] + 1e-12]
    middle = near.mean(axis=0)
    fitted = np.linalg.svd(near - middle, full_matrices=False)[2][2]
    up = fitted * np.sign(fitted @ normal[best])
    turn = rotate_vector(up, np.array([0.0, 0.0, 1.0]))
    return transform(poses, turn, 1.0, -turn @ middle)


def rotate_vector(source: Floats, target: Floats) -> Floats:
    """Compute the smallest rotation (3, 3) that brings one unit vector (3,) onto another."""
    axis, cosine = np.cross(source, target), float(source @ target)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        aside = np.linalg.svd(source[None])[2][1]
        return np.eye(3) if cosine > 0 else np.asarray(exp_so3(np.pi * aside))
    return np.asarray(exp_so3(axis / sine * np.arctan2(sine, cosine)))


def fit_to_positions(poses: TiedPoses, position_m: Floats, usable: Bools) -> TiedPoses | None:
    """Transform poses to known positions of cameras (F, 3); None if these do not suffice.

    Positions in line do not determine the roll about the line: then the ground is assumed level.

    Parameters
    ----------
    poses
        Poses in any axes.
    position_m
        (F, 3) east, north, up.
    usable
        (F,) mask of the frames whose position is known.
    """
    rows = np.flatnonzero(usable & poses.placed)
    if len(rows) < 2:
        return None
    given = position_m[rows] - position_m[rows].mean(axis=0)
    extent = np.linalg.svd(given, compute_uv=False)
    if extent[0] <= 0:
        return None
    if len(rows) >= 3 and extent[1] > MAX_EXTENT_RATIO * extent[0]:
        return _fit_similarity(poses, position_m, rows)
    level = level_scene(poses)
    return None if level is None else _fit_similarity(level, position_m, rows, upright=True)


def _fit_similarity(
    poses: TiedPoses, position_m: Floats, rows: Ints, *, upright: bool = False
) -> TiedPoses:
    """Fit a similarity in closed form (Umeyama 1991); `upright`: rotation about up only.

    Parameters
    ----------
    poses
        Poses in any axes, or level.
    position_m
        (F, 3).
    rows
        Frames that are used.
    upright
        Whether the poses are level.
    """
    source, target = poses.center[rows], position_m[rows]
    from_source, from_target = source - source.mean(axis=0), target - target.mean(axis=0)
    product = from_target.T @ from_source
    if upright:
        product[2], product[:, 2] = 0.0, 0.0
        product[2, 2] = np.linalg.norm(product)
    turn = nearest_rotation(product)
    turned = from_source @ turn.T
    scale = float(np.sum(from_target * turned) / np.sum(turned**2))
    shift = target.mean(axis=0) - scale * turn @ source.mean(axis=0)
    return transform(poses, turn, scale, shift)
