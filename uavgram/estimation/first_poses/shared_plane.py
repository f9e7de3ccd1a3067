"""Planes under photos from points of known height that two of them share, without a log.

Two calibrated photos of a plane differ by a homography H = R + t n', with the rotation R and the
shift t from one to the other, in units of the height above the plane, and the plane's normal n. A
length that the photo shows whole gives the height. Points above the plane are moved to where the
second photo would show the ground below the first one's rays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import permutations
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.first_values import (
    SeenLines,
    find_seen_lines,
    has_known_height,
)
from uavgram.geometry.ground.plane import make_homography_rows
from uavgram.model.arrays import Floats
from uavgram.model.survey import Survey

MIN_SHARED = 6
"""Points that two photos share: four determine the homography, and two check it."""

MIN_ON_PLANE = 4
"""Points on the plane itself from which the homography begins; with fewer, from all points."""

HEIGHT_ROUNDS = 4
"""Number of times that points above the plane are moved to it, for a better homography."""

MAX_RMS_SIGMAS = 5.0
"""RMS residual of the homography, in sigmas of a pick, above which other photos come first."""

MIN_SHIFT = 0.05
"""Least shift between two photos, in heights above the ground, for a plane to follow."""


def find_shared_planes(survey: Survey, ray: Floats) -> dict[int, Floats]:
    """Find the planes under a photo by the points that it shares with another one.

    Parameters
    ----------
    survey
        The observations.
    ray
        (P, 3) undistorted rays of the picks, z = 1.

    Returns
    -------
    Planes (n, 3) m of one photo (see `geometry.ground.plane`); empty where no two photos share
    enough points and one of them shows a length.
    """
    label, lines = survey.pick_label, find_seen_lines(survey)
    usable = np.flatnonzero(has_known_height(survey)[label] & np.isfinite(ray).all(axis=1))
    picks = {int(k): usable[survey.pick_frame[usable] == k] for k in np.unique(survey.pick_frame)}
    with_length = set(lines.frame.tolist())
    found: list[tuple[bool, int, int, Floats]] = []
    for frame, other in permutations(picks, 2):
        _, own, shared = np.intersect1d(
            label[picks[frame]], label[picks[other]], return_indices=True
        )
        if len(own) < MIN_SHARED or frame not in with_length:
            continue
        own, shared = picks[frame][own], picks[other][shared]
        pair = _Pair(ray[own], ray[shared], survey.height_above_m[label[own]])
        sigma = survey.pick_sigma_px[shared] / survey.calibration.parameters[0]

        def find_height(normal: Floats, frame: int = frame) -> float:
            return _find_height(survey, ray, lines, frame, normal)

        fitted = _fit_planes(pair, sigma, find_height)
        if fitted:
            rms = min(one for one, _ in fitted)
            planes = np.stack([plane for _, plane in fitted])
            found.append((not rms < MAX_RMS_SIGMAS, -len(own), frame, planes))
    if not found:
        return {}
    _, _, frame, best = min(found, key=lambda one: one[:3])
    return {frame: best}


class _Pair(NamedTuple):
    """Points that two photos share.

    Attributes
    ----------
    ray, other
        (n, 3) undistorted rays in both photos, z = 1.
    up_m
        (n,) known heights above the ground.
    """

    ray: Floats
    other: Floats
    up_m: Floats

    def list_views(self, homography: Floats) -> list[_View]:
        """List the planes, and the second photo's poses, that a homography allows."""
        return [
            view
            for view in _decompose(homography)
            if np.linalg.norm(view.shift) > MIN_SHIFT and (self.ray @ view.normal > 0.0).all()
        ]


class _View(NamedTuple):
    """Plane under a photo, and pose of another one.

    Attributes
    ----------
    normal
        (3,) unit vector to the plane, in the first photo.
    turn, shift
        (3, 3), (3,) second photo from first one, the shift in heights above the plane.
    """

    normal: Floats
    turn: Floats
    shift: Floats


def _fit_planes(
    pair: _Pair, sigma: Floats, find_height: Callable[[Floats], float]
) -> list[tuple[float, Floats]]:
    """Fit planes (3,) m to points of a pair, each with its RMS residual in sigmas (n,)."""
    on_plane = pair.up_m == 0.0
    start = on_plane if on_plane.sum() >= MIN_ON_PLANE else np.ones(len(on_plane), dtype=np.bool_)
    found = []
    for view in pair.list_views(_fit_homography(pair.ray[start], pair.other[start])):
        height_m, now, used, other = find_height(view.normal), view, start, pair.other
        for _ in range(HEIGHT_ROUNDS):
            low, lowered = pair.up_m < height_m, _lower_to_plane(pair, now, height_m)
            possible = pair.list_views(_fit_homography(pair.ray[low], lowered[low]))
            if low.sum() < MIN_SHARED or not possible:
                break
            nearness = [float(one.normal @ now.normal) for one in possible]
            now, used, other = possible[int(np.argmax(nearness))], low, lowered
            height_m = find_height(now.normal)
        off = _project(now.turn + np.outer(now.shift, now.normal), pair.ray) - other[:, :2]
        squares = np.sum((off / sigma[:, None]) ** 2, axis=1)
        found.append((float(np.sqrt(np.mean(squares[used]))), now.normal / height_m))
    return found


def _lower_to_plane(pair: _Pair, view: _View, height_m: float) -> Floats:
    """Return the rays (n, 3) of the second photo to the ground below those of the first one."""
    down = pair.ray / (pair.ray @ view.normal)[:, None]  # of height 1
    on_ground = down @ view.turn.T + view.shift
    above = (down * (1.0 - pair.up_m / height_m)[:, None]) @ view.turn.T + view.shift
    moved = on_ground / on_ground[:, 2:] - above / above[:, 2:]
    return np.asarray(pair.other + moved)


def _fit_homography(one: Floats, other: Floats) -> Floats:
    """Fit the homography (3, 3) from rays (n, 3) of a photo to those of another, z = 1.

    Its middle singular value is 1, and it takes rays to rays in front of the camera.
    """
    middle, size = one[:, :2].mean(axis=0), float(np.ptp(one[:, :2], axis=0).max()) or 1.0
    rows = make_homography_rows((one[:, :2] - middle) / size, other[:, :2])
    scaled = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    to_scaled = np.array([[1.0, 0.0, -middle[0]], [0.0, 1.0, -middle[1]], [0.0, 0.0, size]]) / size
    homography = scaled @ to_scaled
    homography = homography / np.linalg.svd(homography, compute_uv=False)[1]
    ahead = np.sum((one @ homography.T)[:, 2])
    return np.asarray(homography if ahead > 0.0 else -homography)


def _project(homography: Floats, ray: Floats) -> Floats:
    """Return where a homography takes rays (n, 3), as (n, 2) at z = 1."""
    there = ray @ homography.T
    return np.asarray(there[:, :2] / there[:, 2:])


def _decompose(homography: Floats) -> Iterator[_View]:
    """Yield the planes and poses of a homography of middle singular value 1.

    Ma, Soatto, Kosecka and Sastry 2004, "An Invitation to 3-D Vision", algorithm 5.2. With the
    singular values s1 >= 1 >= s3 and right singular vectors v, H keeps the lengths of vectors in
    the two planes that v2 spans with u = (sqrt(1 - s3^2) v1 +- sqrt(s1^2 - 1) v3) / sqrt(s1^2 -
    s3^2): one of them is the plane of the points.
    """
    _, (s1, _, s3), v = np.linalg.svd(homography)
    if s1 - s3 < 1e-9:
        return  # a rotation alone
    along, across = np.sqrt(max(1.0 - s3**2, 0.0)), np.sqrt(max(s1**2 - 1.0, 0.0))
    for sign in (1.0, -1.0):
        u = (along * v[0] + sign * across * v[2]) / np.sqrt(s1**2 - s3**2)
        normal = np.cross(v[1], u)
        before = np.column_stack([v[1], u, normal])
        v2, after = homography @ v[1], homography @ u
        turn = np.column_stack([v2, after, np.cross(v2, after)]) @ before.T
        shift = (homography - turn) @ normal
        for one in (1.0, -1.0):
            yield _View(one * normal, turn, one * shift)


def _find_height(
    survey: Survey, ray: Floats, lines: SeenLines, frame: int, normal: Floats
) -> float:
    """Find a photo's height above a plane of a normal (3,): the median by its lengths [m]."""
    seen = lines.frame == frame
    start, end = (ray[k] / (ray[k] @ normal)[:, None] for k in (lines.start[seen], lines.end[seen]))
    length = survey.length_m[lines.line[seen]]
    return float(np.median(length / np.linalg.norm(end - start, axis=1)))
