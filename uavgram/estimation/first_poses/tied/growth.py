"""Frames joined one by one to a pair, and adjusted together with their tie points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.free_points import rays_meet
from uavgram.estimation.first_poses.tied.bundle import Scene, adjusted
from uavgram.estimation.first_poses.tied.three_points import resected
from uavgram.estimation.first_poses.tied.tied_rays import TiedRays
from uavgram.model.arrays import Bools, Floats

FEWEST = 7
"""Points with a place that a frame must see to join, and that must fit it."""

NEARLY = 0.75
"""Share of the most known points in any waiting frame with which others join at the same time."""

FITTING = (4.0, 16.0, 64.0)
"""Spreads of the rays so far up to which a frame's points typically miss: those that fit best join
first. A shutter that reads row by row bends the rays of each frame in its own way."""

MOST_FIT = 0.5
"""Share of a frame's rays that must agree for it to stay."""

WIDE = 0.05
"""Sigma of a point as a share of its distance, above which it has no place yet."""

LIMITS = (20.0, 5.0)
"""Spreads beyond which rays are left out, round by round."""

REFUSALS = 2
"""Times that a frame may leave again before it is no longer tried."""

MEDIAN = 1.1774
"""Median of the length of a two-dimensional error, in its sigmas per axis (Rayleigh)."""

OUT = 5.0
"""Sigmas beyond which a ray disagrees with its point: one in 270,000 by chance."""


def grown(
    scene: Scene, sightings: TiedRays, rng: np.random.Generator, most: int | None = None
) -> tuple[Scene, Bools]:
    """The scene with all frames that can join it, and which sightings (N,) agree.

    Parameters
    ----------
    scene
        With poses of two frames at least; its points are found anew.
    sightings
        All.
    rng
        For what is drawn by lot.
    most
        Frames after which it is enough.
    """
    frames = sightings.frames if most is None else most
    scene, agrees = settled(scene, sightings)
    refused = np.zeros(sightings.frames, dtype=np.int64)
    while np.isfinite(scene.center[:, 0]).sum() < frames:
        spread = spread_of(scene, sightings, agrees)
        joined = _joined(scene, sightings, spread, refused >= REFUSALS, rng)
        if joined is None:
            break
        before = np.isfinite(scene.center[:, 0])
        scene, agrees = settled(joined, sightings)
        scene = _fitting(scene, sightings, agreeing(scene, sightings, agrees, LIMITS[0]))
        refused += ~before & np.isfinite(joined.center[:, 0]) & np.isnan(scene.center[:, 0])
        refused += before & np.isnan(scene.center[:, 0])
    return scene, agrees & scene.placed_rows(sightings)


def _fitting(scene: Scene, sightings: TiedRays, agrees: Bools) -> Scene:
    """The scene without frames most of whose rays disagree; at least two stay."""
    known = scene.placed_rows(sightings)
    seen = np.bincount(sightings.frame[known], minlength=sightings.frames)
    fit = np.bincount(sightings.frame[agrees], minlength=sightings.frames)
    bad = np.isfinite(scene.center[:, 0]) & (fit < np.maximum(MOST_FIT * seen, FEWEST))
    if not bad.any() or (np.isfinite(scene.center[:, 0]) & ~bad).sum() < 2:
        return scene
    center, rotation = scene.center.copy(), scene.rotation.copy()
    center[bad], rotation[bad] = np.nan, np.nan
    return replace(scene, center=center, rotation=rotation)


def _joined(
    scene: Scene, sightings: TiedRays, spread: float, barred: Bools, rng: np.random.Generator
) -> Scene | None:
    """The scene with the frames that see most of its points and fit.

    Parameters
    ----------
    scene, sightings
        So far; all.
    spread
        Of the rays so far [rad].
    barred
        (F,) frames that need not be tried again.
    rng
        For the samples.
    """
    known = np.isfinite(scene.point[sightings.point, 0])
    waiting = known & np.isnan(scene.center[sightings.frame, 0]) & ~barred[sightings.frame]
    count = np.bincount(sightings.frame[waiting], minlength=sightings.frames)
    count[count < FEWEST] = 0
    tried: list[tuple[float, int, Floats, Floats]] = []
    for frame in np.argsort(-count, kind="stable"):
        best = min((one[0] for one in tried), default=np.inf)
        if not count[frame] or (
            best <= FITTING[0] * spread and count[frame] < NEARLY * count.max()
        ):
            break
        rows = np.flatnonzero(waiting & (sightings.frame == frame))
        pose = resected(scene.point[sightings.point[rows]], sightings.ray[rows], rng)
        if pose is not None:
            tried.append((pose[2], int(frame), pose[0], pose[1]))
    center, rotation = scene.center.copy(), scene.rotation.copy()
    for factor in FITTING:
        fitting = [one for one in tried if one[0] <= factor * spread]
        for _, frame, place, turn in fitting:
            center[frame], rotation[frame] = place, turn
        if fitting:
            return replace(scene, center=center, rotation=rotation)
    return None


def settled(scene: Scene, sightings: TiedRays) -> tuple[Scene, Bools]:
    """Points where rays meet, all adjusted, and what then disagrees left out; round by round.

    Mild at first: rays of a frame that has just joined pass its points further off than they will.
    """
    for limit in LIMITS:
        scene, agrees = with_points(scene, sightings, limit)
        scene = adjusted(scene, sightings, agrees)
    return scene, agreeing(scene, sightings, agrees)


def with_points(scene: Scene, sightings: TiedRays, limit: float = OUT) -> tuple[Scene, Bools]:
    """The scene with points where most rays meet, and the rays (N,) that do.

    Parameters
    ----------
    scene
        Poses.
    sightings
        All.
    limit
        Spreads beyond which a ray does not meet the others.
    """
    placed = np.isfinite(scene.center[sightings.frame, 0])
    direction = np.einsum("nij,nj->ni", scene.rotation[sightings.frame], sightings.ray)
    used = placed.copy()
    for _ in range(3):
        rows = np.flatnonzero(used)
        met, spread = rays_meet(
            scene.center[sightings.frame[rows]],
            direction[rows],
            sightings.sigma_rad[rows],
            sightings.point[rows],
            sightings.points,
        )
        met[~(spread <= WIDE)] = np.nan
        scene = replace(scene, point=met)
        # Of the rays that pass their point too far away, the worst one of a point goes.
        angle = scene.angles(sightings)
        far = used & (angle > spread_of(scene, sightings, used) * limit)
        worst = np.zeros(sightings.points)
        np.maximum.at(worst, sightings.point[far], angle[far])
        bad = far & (angle >= worst[sightings.point])
        if not bad.any():
            break
        used &= ~bad
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    used &= angle <= limit * spread_of(scene, sightings, used)
    used &= np.isfinite(scene.point[sightings.point, 0])
    return _with_pairs(scene, sightings, used)


def _with_pairs(scene: Scene, sightings: TiedRays, agrees: Bools) -> tuple[Scene, Bools]:
    """Only points that two rays agree on, ahead of the cameras, keep their place."""
    agrees = agrees & (np.nan_to_num(scene.angles(sightings), nan=np.pi) < 0.5)
    number = np.bincount(sightings.point[agrees], minlength=sightings.points)
    point = scene.point.copy()
    point[number < 2] = np.nan
    return replace(scene, point=point), agrees & (number[sightings.point] >= 2)


def spread_of(scene: Scene, sightings: TiedRays, rows: Bools) -> float:
    """Sigma of the rays, per axis, that they themselves show; robust, never below the stated.

    Parameters
    ----------
    scene
        Poses and points.
    sightings
        All.
    rows
        (N,) those that tell it.
    """
    angle = scene.angles(sightings)[rows]
    angle = angle[np.isfinite(angle)]
    if not len(angle):
        return np.inf
    points = len(np.unique(sightings.point[rows]))
    free = 2 * len(angle) - 3 * points - 6 * int(np.isfinite(scene.center[:, 0]).sum())
    shrunk = float(np.sqrt(max(free, 0.2 * len(angle)) / (2 * len(angle))))
    seen = float(np.median(angle)) / MEDIAN / shrunk
    return max(seen, float(np.median(sightings.sigma_rad)))


def agreeing(scene: Scene, sightings: TiedRays, rows: Bools, limit: float = OUT) -> Bools:
    """(N,) all sightings that pass their point no further off than `rows` lead to expect.

    Parameters
    ----------
    scene
        Poses and points.
    sightings
        All.
    rows
        (N,) those that tell the spread.
    limit
        So many spreads.
    """
    angle = np.nan_to_num(scene.angles(sightings), nan=np.inf)
    return np.asarray(angle <= limit * spread_of(scene, sightings, rows))
