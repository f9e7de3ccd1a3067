"""Poses of frames from their tie points alone, joined one by one to a pair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.first_values import intersect_rays
from uavgram.estimation.first_poses.resection import compute_across_axes, make_ray_problem
from uavgram.estimation.first_poses.tied.bundle import Scene, TiedPoses, TiedRays, adjust_scene
from uavgram.estimation.first_poses.tied.two_views import (
    estimate_relative_poses,
    find_best_turn,
    solve_three_points,
)
from uavgram.estimation.solver.batched import ExplicitProblem, State, minimise_trimmed
from uavgram.model.arrays import Bools, Floats, Ints

SAMPLE_COUNT = 60
"""Number of samples of three points; with a fifth of them wrong, 31 are still expected to be
right."""

SCORED_COUNT = 150
"""Number of points by which the solutions of the samples are ranked."""

TRIMMING_FACTOR = 4.0
"""Residual in units of the median up to which a ray takes part in the pose."""


def compute_ray_angles(center: Floats, rotation: Floats, world: Floats, ray: Floats) -> Floats:
    """Compute (M, n) angles between rays and points under M poses [rad]; large behind the camera.

    Parameters
    ----------
    center, rotation
        (M, 3), (M, 3, 3) world from camera.
    world, ray
        (n, 3) points, and unit rays in the camera.
    """
    seen = (world[None] - center[:, None]) @ rotation
    seen /= np.maximum(np.linalg.norm(seen, axis=2, keepdims=True), 1e-300)
    chord = np.linalg.norm(seen - ray[None], axis=2)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def resect_photo(
    world: Floats, ray: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats, float] | None:
    """Estimate centre (3,), rotation (3, 3) and typical residual [rad] of a camera from points.

    Half of the points may be wrong (least median of squares).

    Parameters
    ----------
    world, ray
        (n, 3) points, and unit rays to them in the camera; n >= 4.
    rng
        Random numbers for the samples.
    """
    sample = np.argsort(rng.random((SAMPLE_COUNT, len(world))), axis=1)[:, :3]
    center, rotation = solve_three_points(world[sample], ray[sample])
    if not len(center):
        return None
    some = rng.permutation(len(world))[:SCORED_COUNT]
    angle = np.median(compute_ray_angles(center, rotation, world[some], ray[some]), axis=1)
    best = int(np.argmin(angle))
    across = compute_across_axes(ray)

    def angles(state: State) -> Floats:
        return compute_ray_angles(state[0], state[1], world, ray)

    def weighted(weight: Floats) -> ExplicitProblem:
        return make_ray_problem(ray[None], across * weight[..., None, None], world[None])

    pose, miss = minimise_trimmed(
        angles, weighted, (center[[best]], rotation[[best]]), TRIMMING_FACTOR
    )
    return pose[0][0], pose[1][0], float(miss[0])


MIN_POINTS = 7
"""Smallest number of points with a place that a frame must see to join, and that must fit it."""

MIN_SHARE_OF_BEST = 0.75
"""Share of the largest number of known points in any waiting frame with which others join at the
same time."""

MAX_RELATIVE_RESIDUALS = (4.0, 16.0, 64.0)
"""Typical residuals of a frame's points, in units of the present spread of the rays, up to which it
joins: those that fit best join first. A shutter that reads row by row bends the rays of each frame
in its own way."""

MIN_AGREEING_SHARE = 0.5
"""Share of a frame's rays that must agree for it to stay."""

MAX_RELATIVE_SIGMA = 0.05
"""Sigma of a point as a share of its distance, above which it has no place yet."""

RESIDUAL_LIMITS = (20.0, 5.0)
"""Residuals in units of the spread beyond which rays are left out, round by round."""

MAX_REFUSALS = 2
"""Number of times that a frame may be removed before it is no longer tried."""

MEDIAN_SIGMAS = 1.1774
"""Median of the length of a two-dimensional error, in its sigmas per axis (Rayleigh)."""

MAX_RESIDUAL_SIGMAS = 5.0
"""Sigmas beyond which a ray disagrees with its point: one in 270,000 by chance."""


def grow_scene(
    scene: Scene, sightings: TiedRays, rng: np.random.Generator, most: int | None = None
) -> tuple[Scene, Bools]:
    """Join all possible frames to the scene; mark the sightings (N,) that agree.

    Parameters
    ----------
    scene
        Scene with poses of at least two frames; its points are computed again.
    sightings
        All sightings.
    rng
        Random numbers for the samples.
    most
        Number of frames at which it ends.
    """
    frames = sightings.frames if most is None else most
    scene, agrees = settle_scene(scene, sightings)
    refused = np.zeros(sightings.frames, dtype=np.int64)
    while np.isfinite(scene.center[:, 0]).sum() < frames:
        spread = estimate_spread(scene, sightings, agrees)
        joined = _join_frames(scene, sightings, spread, refused >= MAX_REFUSALS, rng)
        if joined is None:
            break
        before = np.isfinite(scene.center[:, 0])
        scene, agrees = settle_scene(joined, sightings)
        scene = _remove_unfitting(
            scene, sightings, find_agreeing(scene, sightings, agrees, RESIDUAL_LIMITS[0])
        )
        refused += ~before & np.isfinite(joined.center[:, 0]) & np.isnan(scene.center[:, 0])
        refused += before & np.isnan(scene.center[:, 0])
    return scene, agrees & scene.placed_rows(sightings)


def _remove_unfitting(scene: Scene, sightings: TiedRays, agrees: Bools) -> Scene:
    """Remove frames most of whose rays disagree; at least two stay."""
    known = scene.placed_rows(sightings)
    seen = np.bincount(sightings.frame[known], minlength=sightings.frames)
    fit = np.bincount(sightings.frame[agrees], minlength=sightings.frames)
    bad = np.isfinite(scene.center[:, 0]) & (
        fit < np.maximum(MIN_AGREEING_SHARE * seen, MIN_POINTS)
    )
    if not bad.any() or (np.isfinite(scene.center[:, 0]) & ~bad).sum() < 2:
        return scene
    center, rotation = scene.center.copy(), scene.rotation.copy()
    center[bad], rotation[bad] = np.nan, np.nan
    return replace(scene, center=center, rotation=rotation)


def _join_frames(
    scene: Scene, sightings: TiedRays, spread: float, barred: Bools, rng: np.random.Generator
) -> Scene | None:
    """Join the frames that see most points of the scene and fit; None if there are none.

    Parameters
    ----------
    scene, sightings
        Present scene; all sightings.
    spread
        Spread of the rays so far [rad].
    barred
        (F,) mask of frames that are not tried again.
    rng
        Random numbers for the samples.
    """
    known = np.isfinite(scene.point[sightings.point, 0])
    waiting = known & np.isnan(scene.center[sightings.frame, 0]) & ~barred[sightings.frame]
    count = np.bincount(sightings.frame[waiting], minlength=sightings.frames)
    count[count < MIN_POINTS] = 0
    tried: list[tuple[float, int, Floats, Floats]] = []
    for frame in np.argsort(-count, kind="stable"):
        best = min((one[0] for one in tried), default=np.inf)
        if not count[frame] or (
            best <= MAX_RELATIVE_RESIDUALS[0] * spread
            and count[frame] < MIN_SHARE_OF_BEST * count.max()
        ):
            break
        rows = np.flatnonzero(waiting & (sightings.frame == frame))
        pose = resect_photo(scene.point[sightings.point[rows]], sightings.ray[rows], rng)
        if pose is not None:
            tried.append((pose[2], int(frame), pose[0], pose[1]))
    center, rotation = scene.center.copy(), scene.rotation.copy()
    # Join all frames within the smallest limit that any of them meets.
    for factor in MAX_RELATIVE_RESIDUALS:
        fitting = [one for one in tried if one[0] <= factor * spread]
        for _, frame, place, turn in fitting:
            center[frame], rotation[frame] = place, turn
        if fitting:
            return replace(scene, center=center, rotation=rotation)
    return None


def settle_scene(scene: Scene, sightings: TiedRays) -> tuple[Scene, Bools]:
    """Intersect rays, adjust the scene, and leave out rays that disagree; round by round.

    The first limit is wide: rays of a frame that has just joined have larger residuals than later.
    """
    for limit in RESIDUAL_LIMITS:
        scene, agrees = intersect_points(scene, sightings, limit)
        scene = adjust_scene(scene, sightings, agrees)
    return scene, find_agreeing(scene, sightings, agrees)


def intersect_points(
    scene: Scene, sightings: TiedRays, limit: float = MAX_RESIDUAL_SIGMAS
) -> tuple[Scene, Bools]:
    """Compute points where most rays meet, and mark the rays (N,) that do.

    Parameters
    ----------
    scene
        Poses.
    sightings
        All sightings.
    limit
        Residual in units of the spread beyond which a ray does not meet the others.
    """
    placed = np.isfinite(scene.center[sightings.frame, 0])
    direction = np.einsum("nij,nj->ni", scene.rotation[sightings.frame], sightings.ray)
    used = placed.copy()
    for _ in range(3):
        rows = np.flatnonzero(used)
        met, spread = intersect_rays(
            scene.center[sightings.frame[rows]],
            direction[rows],
            sightings.sigma_rad[rows],
            sightings.point[rows],
            sightings.points,
        )
        met[~(spread <= MAX_RELATIVE_SIGMA)] = np.nan
        scene = replace(scene, point=met)
        # Remove the worst ray of each point whose residual is too large.
        angle = scene.angles(sightings)
        far = used & (angle > estimate_spread(scene, sightings, used) * limit)
        worst = np.zeros(sightings.points)
        np.maximum.at(worst, sightings.point[far], angle[far])
        bad = far & (angle >= worst[sightings.point])
        if not bad.any():
            break
        used &= ~bad
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    used &= angle <= limit * estimate_spread(scene, sightings, used)
    used &= np.isfinite(scene.point[sightings.point, 0])
    return _keep_pairs(scene, sightings, used)


def _keep_pairs(scene: Scene, sightings: TiedRays, agrees: Bools) -> tuple[Scene, Bools]:
    """Keep only points with two agreeing rays, ahead of the cameras."""
    agrees = agrees & (np.nan_to_num(scene.angles(sightings), nan=np.pi) < 0.5)
    number = np.bincount(sightings.point[agrees], minlength=sightings.points)
    point = scene.point.copy()
    point[number < 2] = np.nan
    return replace(scene, point=point), agrees & (number[sightings.point] >= 2)


def estimate_spread(scene: Scene, sightings: TiedRays, rows: Bools) -> float:
    """Estimate the sigma of the rays per axis from their residuals; robust, at least the stated.

    Parameters
    ----------
    scene
        Poses and points.
    sightings
        All sightings.
    rows
        (N,) mask of the sightings that are used.
    """
    angle = scene.angles(sightings)[rows]
    angle = angle[np.isfinite(angle)]
    if not len(angle):
        return np.inf
    points = len(np.unique(sightings.point[rows]))
    # Residuals are shorter than errors by sqrt(redundancy / observations).
    free = 2 * len(angle) - 3 * points - 6 * int(np.isfinite(scene.center[:, 0]).sum())
    shrunk = float(np.sqrt(max(free, 0.2 * len(angle)) / (2 * len(angle))))
    seen = float(np.median(angle)) / MEDIAN_SIGMAS / shrunk
    return max(seen, float(np.median(sightings.sigma_rad)))


def find_agreeing(
    scene: Scene, sightings: TiedRays, rows: Bools, limit: float = MAX_RESIDUAL_SIGMAS
) -> Bools:
    """Mark all sightings (N,) with residuals as small as expected from those in `rows`.

    Parameters
    ----------
    scene
        Poses and points.
    sightings
        All sightings.
    rows
        (N,) mask of the sightings that determine the spread.
    limit
        Largest residual in units of the spread.
    """
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    return np.asarray(angle <= limit * estimate_spread(scene, sightings, rows))


MIN_SHARED_POINTS = 20
"""Smallest number of points that an initial pair must have in common."""

MIN_PARALLAX_SIGMAS = 10.0
"""Smallest parallax of an initial pair, in sigmas of a ray: below, the position of the second
camera would be determined by noise. A camera that hovers had 2.5; the smallest of twenty flights
over flat ground has 60."""

RESIDUAL_CAP_SIGMAS = 10.0
"""Residual in sigmas beyond which a ray contributes nothing to the support."""

ENOUGH_POINTS = 200
"""Number of points of a frame that suffice to place it."""

MAX_PAIRS = 3
"""Number of initial pairs that are tried."""

TRIAL_FRAMES = 5
"""Number of frames after which initial pairs are compared."""

ENOUGH_PARALLAX_RAD = 0.3
"""Angle between two rays to a point [rad] above which a larger one makes no pair better."""


def estimate_tied_poses(sightings: TiedRays, seed: int = 0) -> TiedPoses | None:
    """Estimate poses of as many frames as are connected; None if no two are.

    Start with pairs that share many points, seen under wide angles. Their possible poses (points in
    a plane allow two) are extended until a few frames are placed; the one that fits best is
    continued.

    Parameters
    ----------
    sightings
        Sightings of at least two frames.
    seed
        Seed of the random samples: the same for the same input.
    """
    rng = np.random.default_rng(seed)
    best: tuple[float, Scene] | None = None
    everything, sightings = sightings, sightings.take(_choose_rows(sightings))
    few = min(TRIAL_FRAMES, sightings.frames)
    for first, second in _pairs(sightings):
        for begun in _start_scenes(sightings, first, second, rng):
            scene, agrees = grow_scene(begun, sightings, rng, few)
            support = _count_support(scene, sightings)
            if best is None or support > best[0]:
                best = support, scene
    if best is None:
        return None
    scene, agrees = grow_scene(best[1], sightings, rng)
    spread = estimate_spread(scene, sightings, agrees)
    scene, agrees = intersect_points(scene, everything)
    agrees = find_agreeing(scene, everything, agrees, RESIDUAL_LIMITS[0])
    return TiedPoses(
        center=scene.center,
        rotation=scene.rotation,
        point=scene.point,
        agrees=agrees,
        spread_rad=spread,
    )


def _choose_rows(sightings: TiedRays) -> Ints:
    """Choose rows of enough points for every frame: first those seen in most frames."""
    number = np.bincount(sightings.point, minlength=sightings.points)
    by_point = np.argsort(sightings.point, kind="stable")
    ends = np.cumsum(number)
    full = np.zeros(sightings.frames, dtype=np.int64)
    kept = []
    for point in np.argsort(-number, kind="stable"):
        rows = by_point[ends[point] - number[point] : ends[point]]
        frames = sightings.frame[rows]
        if (full[frames] < ENOUGH_POINTS).sum() >= 2:
            full[frames] += 1
            kept.append(rows)
    return np.sort(np.concatenate(kept)) if kept else np.zeros(0, dtype=np.int64)


def _pairs(sightings: TiedRays) -> list[tuple[int, int]]:
    """Return initial pairs with parallax, best first, without common frames if possible."""
    shared = np.triu(sightings.count_shared_points(), 1)
    first, second = np.nonzero(shared >= MIN_SHARED_POINTS)
    if not len(first):
        return []
    pairs = zip(first.tolist(), second.tolist(), strict=True)
    parallax = np.array([_parallax(sightings, a, b) for a, b in pairs])
    moved = parallax > MIN_PARALLAX_SIGMAS * np.median(sightings.sigma_rad)
    first, second, parallax = first[moved], second[moved], parallax[moved]
    worth = np.sqrt(shared[first, second]) * np.minimum(parallax, ENOUGH_PARALLAX_RAD)
    chosen: list[tuple[int, int]] = []
    for k in np.argsort(-worth, kind="stable"):
        pair = int(first[k]), int(second[k])
        if not any(set(pair) & set(other) for other in chosen):
            chosen.append(pair)
        if len(chosen) == MAX_PAIRS:
            break
    return chosen


def _parallax(sightings: TiedRays, first: int, second: int) -> float:
    """Compute the typical angle between the rays of two frames after the best rotation [rad]."""
    one, other = sightings.find_shared_rows(first, second)
    return find_best_turn(sightings.ray[one], sightings.ray[other]).miss_rad


def _start_scenes(
    sightings: TiedRays, first: int, second: int, rng: np.random.Generator
) -> list[Scene]:
    """Return scenes of two frames, the first at the origin, at distance one."""
    one, other = sightings.find_shared_rows(first, second)
    scenes = []
    for pose in estimate_relative_poses(sightings.ray[one], sightings.ray[other], rng):
        center, rotation = _empty_scene(sightings.frames)
        center[first], rotation[first] = 0.0, np.eye(3)
        center[second], rotation[second] = -pose.rotation.T @ pose.shift, pose.rotation.T
        scenes.append(Scene(center, rotation, np.full((sightings.points, 3), np.nan)))
    return scenes


def _empty_scene(frames: int) -> tuple[Floats, Floats]:
    return np.full((frames, 3), np.nan), np.full((frames, 3, 3), np.nan)


def _count_support(scene: Scene, sightings: TiedRays) -> float:
    """Count the rays of the placed frames that pass their points, with full weight if exact."""
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    return float(
        np.sum(1.0 - np.minimum(angle / (RESIDUAL_CAP_SIGMAS * sightings.sigma_rad), 1.0) ** 2)
    )
