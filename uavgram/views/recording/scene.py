"""Sizes of the scene: from them follow the eye, line widths, frusta and exaggerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.mosaic import plane_height
from uavgram.model.arrays import Floats
from uavgram.model.result import Result
from uavgram.views.drawing import nice_factor, track

# Share of the scene's size that the median exaggerated ellipse may fill.
ELLIPSE_SHARE = 0.03
# The same among many: share of the way from one point to the next.
CROWD_SHARE = 0.4
# Ellipses larger than this share of the scene are not filled.
FILL_SHARE = 0.02
# Share of the photo's width that the larger exaggerated residuals may fill.
RESIDUAL_SHARE = 0.07
# Depth of a frustum: share of the height, and of the way from one exposure to the next.
FRUSTUM_SHARE = 0.12
SPACING_SHARE = 0.7

# From the south, a little from the west, and from above.
TO_THE_EYE = np.array([-0.185, -0.80, 0.572]) / np.linalg.norm([-0.185, -0.80, 0.572])
# Tangents of half the angles of view that the scene may fill (Rerun's eye opens 55 degrees).
HALF_WIDTH, HALF_HEIGHT = 0.70, 0.46


@dataclass(frozen=True, eq=False)
class Scene:
    """What the pictures are scaled by.

    Attributes
    ----------
    middle_m
        (3,) centre of the points on the ground.
    size_m
        Longer side of the points' (or the cameras') bounding box.
    height_m
        Typical height of the cameras above the ground.
    frustum_m
        Depth at which a frustum is cut off.
    ellipse_factor, residual_factor
        Exaggerations, from the 1-2-5 series.
    fill_ellipses
        Whether ellipses filled at true size leave enough of the ground to be seen.
    worst_point
        Row of the point with the largest ellipse; None without points.
    target_m, distance_m
        (3,) what the first view looks at, and from how far, to show all points and cameras.
    """

    middle_m: Floats
    size_m: float
    height_m: float
    frustum_m: float
    ellipse_factor: int
    residual_factor: int
    fill_ellipses: bool
    worst_point: int | None
    target_m: Floats
    distance_m: float


def measure_scene(result: Result) -> Scene:
    """Take the sizes of a result."""
    cameras = np.concatenate(
        [result.frames.refined.center_world_m, result.frames.seed.center_world_m]
    )
    cameras = cameras[np.isfinite(cameras[:, 0])]
    points = result.points.position_world_m
    scene = points if len(points) else cameras if len(cameras) else np.zeros((1, 3))
    low, high = scene.min(axis=0), scene.max(axis=0)
    size = max(float((high - low)[:2].max()), 1.0)
    middle = (low + high) / 2
    middle[2] = plane_height(result, middle[:2])
    height = float(np.median(cameras[:, 2] - middle[2])) if len(cameras) else size
    major = result.points.ellipse_95_m[:, 0]
    residual = np.linalg.norm(result.picks.residual_px, axis=1)
    residual = residual[np.isfinite(residual)]
    target, distance = _fit(np.concatenate([scene, cameras]))
    return Scene(
        middle_m=middle,
        size_m=size,
        height_m=max(height, 0.1),
        frustum_m=_frustum_depth(result, max(height, 0.1)),
        ellipse_factor=nice_factor(
            float(np.median(major)) if len(major) else 0.0,
            size * min(ELLIPSE_SHARE, CROWD_SHARE / np.sqrt(max(len(major), 1))),
        ),
        residual_factor=nice_factor(
            float(np.quantile(residual, 0.9)) if len(residual) else 0.0,
            RESIDUAL_SHARE * result.camera.width_px,
        ),
        fill_ellipses=not len(major) or float(np.median(major)) <= FILL_SHARE * size,
        worst_point=int(np.argmax(major)) if len(major) else None,
        target_m=target,
        distance_m=distance,
    )


def _frustum_depth(result: Result, height_m: float) -> float:
    """Short enough that frusta in a row can be told apart."""
    poses = result.frames.refined if result.has_refined.any() else result.frames.seed
    steps = np.linalg.norm(np.diff(track(result, poses), axis=0), axis=1)
    spacing = float(np.median(steps)) if len(steps) else np.inf
    return max(min(FRUSTUM_SHARE * height_m, SPACING_SHARE * spacing), 0.02 * height_m)


def _seen_from(points_m: Floats, target_m: Floats) -> tuple[Floats, Floats, Floats]:
    """(N,) of (N, 3) points about a target: to the right, upward, and towards the eye."""
    right = np.cross([0.0, 0.0, 1.0], TO_THE_EYE)
    right /= np.linalg.norm(right)
    offset = points_m - target_m
    return offset @ right, offset @ np.cross(TO_THE_EYE, right), offset @ TO_THE_EYE


def _fit(points_m: Floats) -> tuple[Floats, float]:
    """What to look at, and from how far, to have all (N, 3) points in the first view."""
    target = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    right, upward, nearer = _seen_from(points_m, target)
    aside = np.maximum(np.abs(right) / HALF_WIDTH, np.abs(upward) / HALF_HEIGHT)
    return target, max(float((nearer + aside).max()), 1.0)


def on_screen(scene: Scene, points_m: Floats) -> Floats:
    """(N, 2) of (N, 3) points in the first view, right and up, as tangents of angles."""
    right, upward, nearer = _seen_from(points_m, scene.target_m)
    depth = np.maximum(scene.distance_m - nearer, 1e-9)
    return np.stack([right / depth, upward / depth], axis=-1)
