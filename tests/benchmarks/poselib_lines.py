"""PoseLib's poses from lines of known position: another's solvers beside ours.

PoseLib (Larsson and others, github.com/PoseLib/PoseLib, BSD 3-clause): `p3ll`, a minimal solver for
three lines, over triples and ranked by all lines; `estimate_absolute_pose_pnpl`, its RANSAC with
refinement. Neither tests on which side of the camera a line lies, and lines alone do not say.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import poselib

from uavgram.estimation.first_poses.resection import LineRows
from uavgram.model.arrays import Bools, Floats
from uavgram.synthetic.pose_methods import Starts, make_line_rows
from uavgram.synthetic.single_photos import MethodScenes

MOST_TRIPLES, KEPT = 20, 4


def p3ll_starts(scenes: MethodScenes) -> Starts:
    """The poses above ground, of all triples of lines, that fit all lines best."""
    seen = make_line_rows(scenes)
    count = len(seen.ray)
    center, rotation = np.full((count, KEPT, 3), np.nan), np.full((count, KEPT, 3, 3), np.nan)
    rng = np.random.default_rng(0)
    for k in range(count):
        normal, point, along = _lines(scenes, seen, k)
        triples = list(combinations(range(len(normal)), 3))
        chosen = rng.permutation(len(triples))[:MOST_TRIPLES]
        found = [
            pose
            for t in chosen
            for three in [list(triples[t])]
            for pose in poselib.p3ll(normal[three], point[three], along[three])
        ]
        ranked: list[tuple[float, int, Floats, Floats]] = []
        for pose in found:
            turn = np.asarray(pose.R).T
            at = -turn @ np.asarray(pose.t)
            if not (np.isfinite(turn).all() and np.isfinite(at).all()):
                continue
            down = seen.ray[k] @ turn.T
            if at[2] > 0 and (down[:, 2] < 0).all():  # the test of depth
                ranked.append((_misfit(seen, k, at, turn), len(ranked), at, turn))
        for j, (_, _, at, turn) in enumerate(sorted(ranked, key=lambda one: one[:2])[:KEPT]):
            center[k, j], rotation[k, j] = at, turn
    return center, rotation


def pnpl_starts(scenes: MethodScenes) -> tuple[Starts, Bools]:
    """The pose of PoseLib's own estimator; and which of these lie below the ground."""
    lens = scenes.calibration
    focal, _, cx, cy = lens.parameters[:4].tolist()
    camera = {
        "model": "SIMPLE_PINHOLE",
        "width": lens.width_px,
        "height": lens.height_px,
        "params": [focal, cx, cy],
    }
    count = len(scenes.pixel_px)
    center, rotation = np.full((count, 1, 3), np.nan), np.full((count, 1, 3, 3), np.nan)
    below = np.zeros(count, dtype=np.bool_)
    place = scenes.place_m
    world = np.concatenate([place, np.zeros((*place.shape[:3], 1))], axis=-1)
    nothing = np.zeros((0, 2)), np.zeros((0, 3))
    for k in range(count):
        pixel = scenes.pixel_px[k]
        pose, _ = poselib.estimate_absolute_pose_pnpl(
            *nothing, pixel[:, 0], pixel[:, 1], world[k, :, 0], world[k, :, 1], camera
        )
        turn = np.asarray(pose.R).T
        center[k, 0], rotation[k, 0] = -turn @ np.asarray(pose.t), turn
        below[k] = center[k, 0, 2] < 0
    return (center, rotation), below


def _lines(scenes: MethodScenes, seen: LineRows, k: int) -> tuple[Floats, Floats, Floats]:
    """Of each line the normal of its plane through the camera, a point on it, its direction."""
    ray = seen.ray[k].reshape(-1, 2, 3)
    normal = np.cross(ray[:, 0], ray[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    flat = np.zeros((len(normal), 1))
    point = np.concatenate([scenes.place_m[k, :, 0], flat], axis=1)
    along = np.concatenate([seen.along[k, ::2], flat], axis=1)
    return normal, point, along


def _misfit(seen: LineRows, k: int, center: Floats, rotation: Floats) -> float:
    off, _ = seen.rows(np.array([k]), (center[None], rotation[None]))
    return float(np.sum(off**2))
