"""Poses of frames from their tie points alone."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.tied.bundle import Scene
from uavgram.estimation.first_poses.tied.growth import (
    LIMITS,
    agreeing,
    grown,
    spread_of,
    with_points,
)
from uavgram.estimation.first_poses.tied.tied_rays import TiedPoses, TiedRays
from uavgram.estimation.first_poses.tied.turned import best_turn
from uavgram.estimation.first_poses.tied.two_views import relative_poses
from uavgram.model.arrays import Floats, Ints

FEWEST_SHARED = 20
"""Points that a pair must have in common to begin with."""

LEAST_PARALLAX = 10.0
"""Sigmas of a ray that the parallax of a pair must have to begin: below, noise would tell where the
second camera stands. A camera that hovers had 2.5; the smallest of twenty flights over flat ground
has 60."""

LIMIT = 10.0
"""Sigmas beyond which a ray supports nothing."""

ENOUGH = 200
"""Points of a frame that are enough to place it."""

PAIRS = 3
"""Pairs that begin in turn."""

TRIED = 5
"""Frames after which beginnings are compared."""

ENOUGH_RAD = 0.3
"""Angle under which two cameras see a point, above which more of it makes no pair better."""


def tied_poses(sightings: TiedRays, seed: int = 0) -> TiedPoses | None:
    """Poses of as many frames as hang together; None where no two do.

    Pairs that share many points, seen under wide angles, begin. What they allow (points in a plane
    allow two poses) is followed until a few frames are placed; the one that fits best goes on.

    Parameters
    ----------
    sightings
        At least two frames.
    seed
        Of what is drawn by lot: alike for alike input.
    """
    rng = np.random.default_rng(seed)
    best: tuple[float, Scene] | None = None
    everything, sightings = sightings, sightings.take(_chosen(sightings))
    few = min(TRIED, sightings.frames)
    for first, second in _pairs(sightings):
        for begun in _begun(sightings, first, second, rng):
            scene, agrees = grown(begun, sightings, rng, few)
            support = _support(scene, sightings)
            if best is None or support > best[0]:
                best = support, scene
    if best is None:
        return None
    scene, agrees = grown(best[1], sightings, rng)
    spread = spread_of(scene, sightings, agrees)
    scene, agrees = with_points(scene, everything)
    agrees = agreeing(scene, everything, agrees, LIMITS[0])
    return TiedPoses(
        center=scene.center,
        rotation=scene.rotation,
        point=scene.point,
        agrees=agrees,
        spread_rad=spread,
    )


def _chosen(sightings: TiedRays) -> Ints:
    """Rows of enough points for every frame: those seen most often, and in many frames few."""
    number = np.bincount(sightings.point, minlength=sightings.points)
    by_point = np.argsort(sightings.point, kind="stable")
    ends = np.cumsum(number)
    full = np.zeros(sightings.frames, dtype=np.int64)
    kept = []
    for point in np.argsort(-number, kind="stable"):
        rows = by_point[ends[point] - number[point] : ends[point]]
        frames = sightings.frame[rows]
        if (full[frames] < ENOUGH).sum() >= 2:
            full[frames] += 1
            kept.append(rows)
    return np.sort(np.concatenate(kept)) if kept else np.zeros(0, dtype=np.int64)


def _pairs(sightings: TiedRays) -> list[tuple[int, int]]:
    """Pairs to begin with that did not only turn, best first, of different frames if possible."""
    shared = np.triu(sightings.shared(), 1)
    first, second = np.nonzero(shared >= FEWEST_SHARED)
    if not len(first):
        return []
    pairs = zip(first.tolist(), second.tolist(), strict=True)
    parallax = np.array([_parallax(sightings, a, b) for a, b in pairs])
    moved = parallax > LEAST_PARALLAX * np.median(sightings.sigma_rad)
    first, second, parallax = first[moved], second[moved], parallax[moved]
    worth = np.sqrt(shared[first, second]) * np.minimum(parallax, ENOUGH_RAD)
    chosen: list[tuple[int, int]] = []
    for k in np.argsort(-worth, kind="stable"):
        pair = int(first[k]), int(second[k])
        if not any(set(pair) & set(other) for other in chosen):
            chosen.append(pair)
        if len(chosen) == PAIRS:
            break
    return chosen


def _parallax(sightings: TiedRays, first: int, second: int) -> float:
    """Typical angle that is left between the rays of two frames after the best turn [rad]."""
    one, other = sightings.of_pair(first, second)
    return best_turn(sightings.ray[one], sightings.ray[other]).miss_rad


def _begun(sightings: TiedRays, first: int, second: int, rng: np.random.Generator) -> list[Scene]:
    """Scenes of two frames, the first at the origin, one apart."""
    one, other = sightings.of_pair(first, second)
    scenes = []
    for pose in relative_poses(sightings.ray[one], sightings.ray[other], rng):
        center, rotation = _nowhere(sightings.frames)
        center[first], rotation[first] = 0.0, np.eye(3)
        center[second], rotation[second] = -pose.rotation.T @ pose.shift, pose.rotation.T
        scenes.append(Scene(center, rotation, np.full((sightings.points, 3), np.nan)))
    return scenes


def _nowhere(frames: int) -> tuple[Floats, Floats]:
    return np.full((frames, 3), np.nan), np.full((frames, 3, 3), np.nan)


def _support(scene: Scene, sightings: TiedRays) -> float:
    """How many rays of the frames placed pass their points, those that do so exactly in full."""
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    return float(np.sum(1.0 - np.minimum(angle / (LIMIT * sightings.sigma_rad), 1.0) ** 2))
