"""Sizes of the scene: from them follow the eye, line widths, frusta and exaggerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.survey.departures import Departures, departures
from uavgram.views.survey.drawing import frusta, nice_factor, track
from uavgram.views.survey.key_facts import largest_ellipse

# Share of the scene's size that the median exaggerated ellipse may fill.
ELLIPSE_SHARE = 0.06
# The same among many: share of the way from one point to the next.
CROWD_SHARE = 0.4
# Ellipses larger than this share of the scene are not filled.
FILL_SHARE = 0.02
# Share of the scene's size that the larger departures of the ground from its plane may fill.
DEPARTURE_SHARE = 0.05
# Share of the photo's width that the larger exaggerated residuals may fill.
RESIDUAL_SHARE = 0.07
# Depth of a frustum: share of the height, and of the way from one exposure to the next.
FRUSTUM_SHARE = 0.06
SPACING_SHARE = 0.7
# The current camera stands out by its size.
CURRENT_FRUSTUM = 2.0
# The mosaic's outline is sampled this often, in its pixels.
GROUND_STEP_PX = 16

# Just below the plane, so that flat ellipses and lines are not lost in the ground.
GROUND_DROP_SHARE = 5e-4

# From the south, a little from the west, and from above.
TO_THE_EYE = np.array([-0.185, -0.80, 0.572]) / np.linalg.norm([-0.185, -0.80, 0.572])
# Tangents of half the angles of view that the scene may fill (Rerun's eye opens 55 degrees).
HALF_WIDTH, HALF_HEIGHT = 0.70, 0.47


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
    uneven, departure_factor
        Where the ground is no plane, None where it is one; exaggeration of its departures.
    fill_ellipses
        Whether ellipses filled at true size leave enough of the ground to be seen.
    worst_point
        Row of the point with the largest ellipse within the survey; None where there is no shape
        (fewer than two points).
    ground_drop_m
        By how much the ground is drawn below its plane.
    ground_is_lowered
        Whether that is so much that it must be said: some points lie below the plane.
    target_m, distance_m
        (3,) what the first view looks at, and from how far, to show ground, points and cameras.
    """

    middle_m: Floats
    size_m: float
    height_m: float
    frustum_m: float
    ellipse_factor: int
    residual_factor: int
    uneven: Departures | None
    departure_factor: int
    fill_ellipses: bool
    worst_point: int | None
    ground_drop_m: float
    ground_is_lowered: bool
    target_m: Floats
    distance_m: float


def measure_scene(result: Result, texture: GroundTexture | None = None) -> Scene:
    """Take the sizes of a result, and of the ground where photos show it."""
    cameras = np.concatenate(
        [result.frames.refined.center_world_m, result.frames.seed.center_world_m]
    )
    cameras = cameras[np.isfinite(cameras[:, 0])]
    points = result.points.position_world_m
    scene = points if len(points) else cameras if len(cameras) else np.zeros((1, 3))
    low, high = scene.min(axis=0), scene.max(axis=0)
    size = max(float((high - low)[:2].max()), 1.0)
    middle = (low + high) / 2
    middle[2] = result.plane.height_at(middle[:2])
    height = float(np.median(cameras[:, 2] - middle[2])) if len(cameras) else size
    frustum = _frustum_depth(result, max(height, 0.1))
    major = result.points.relative.ellipse_95_m[:, 0]
    typical = float(np.median(major)) if len(major) else 0.0
    residual = np.linalg.norm(result.picks.residual_px, axis=1)
    residual = residual[np.isfinite(residual)]
    factor = nice_factor(
        typical, size * min(ELLIPSE_SHARE, CROWD_SHARE / np.sqrt(max(len(major), 1)))
    )
    shown = [
        *(scene, *_pyramids(result, frustum)),
        *(_around_ellipses(result, factor), _ground(result, texture)),
    ]
    least = GROUND_DROP_SHARE * size
    below = float(np.max(result.plane.height_at(points[:, :2]) - points[:, 2], initial=0.0))
    uneven = departures(result)
    target, distance = _fit(np.concatenate(shown))
    return Scene(
        middle_m=middle,
        size_m=size,
        height_m=max(height, 0.1),
        frustum_m=frustum,
        ellipse_factor=factor,
        residual_factor=nice_factor(
            float(np.quantile(residual, 0.9)) if len(residual) else 0.0,
            RESIDUAL_SHARE * result.camera.width_px,
        ),
        uneven=uneven,
        departure_factor=nice_factor(uneven.full_m if uneven else 0.0, DEPARTURE_SHARE * size),
        fill_ellipses=typical <= FILL_SHARE * size,
        worst_point=largest_ellipse(result),
        ground_drop_m=least + below,
        ground_is_lowered=below > least,
        target_m=target,
        distance_m=distance,
    )


def _pyramids(result: Result, depth_m: float) -> list[Floats]:
    """(n, 3) corners of all frusta, the current camera's larger one included."""
    return [
        frusta(result, poses, CURRENT_FRUSTUM * depth_m).reshape(-1, 3)
        for poses in (result.frames.refined, result.frames.seed)
    ]


def _around_ellipses(result: Result, factor: int) -> Floats:
    """(4K, 3) to the east, west, north and south of each point, as far as its ellipse reaches."""
    reach = factor * result.points.relative.ellipse_95_m[:, :1]
    ways = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    return np.concatenate([result.points.position_world_m + reach * way for way in ways])


def _ground(result: Result, texture: GroundTexture | None) -> Floats:
    """(n, 3) spots all over the ground that the mosaic covers."""
    if texture is None:
        return np.zeros((0, 3))
    row, column = GROUND_STEP_PX * np.array(
        np.nonzero(texture.covered[::GROUND_STEP_PX, ::GROUND_STEP_PX])
    )
    east = texture.west_m + column * texture.pixel_size_m
    spots = np.stack([east, texture.north_m - row * texture.pixel_size_m], axis=-1)
    return np.column_stack([spots, result.plane.height_at(spots)])


def _frustum_depth(result: Result, height_m: float) -> float:
    """Short enough that frusta in a row can be told apart."""
    poses = result.frames.refined if result.has_refined.any() else result.frames.seed
    steps = np.linalg.norm(np.diff(track(result, poses), axis=0), axis=1)
    spacing = float(np.median(steps)) if len(steps) else np.inf
    return max(min(FRUSTUM_SHARE * height_m, SPACING_SHARE * spacing), 0.02 * height_m)


def _seen_from(points_m: Floats, target_m: Floats) -> tuple[Floats, Floats, Floats]:
    """(N,) of (N, 3) points about a target: to the right, upward, and towards the eye."""
    right, up = _axes()
    offset = points_m - target_m
    return offset @ right, offset @ up, offset @ TO_THE_EYE


def _axes() -> tuple[Floats, Floats]:
    """(3,) to the right and (3,) upward on the screen."""
    right = np.cross([0.0, 0.0, 1.0], TO_THE_EYE)
    right /= np.linalg.norm(right)
    return right, np.cross(TO_THE_EYE, right)


def _fit(points_m: Floats) -> tuple[Floats, float]:
    """What to look at, and from how far, to have all (N, 3) points as large as fit into a view.

    A point r to the right and n nearer than the target is seen if |r - a| <= W (D - n), where the
    eye is at the distance D and has moved by a: the outermost on both sides give a and D. The same
    upward; then the larger D serves for both.
    """
    middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    right, upward, nearer = _seen_from(points_m, middle)
    shifts, distances = [], [1.0]
    for aside, share in ((right, HALF_WIDTH), (upward, HALF_HEIGHT)):
        most, least = (share * nearer + aside).max(), (share * nearer - aside).max()
        shifts.append((most - least) / 2)
        distances.append(float(most + least) / (2 * share))
    to_the_right, up = _axes()
    return middle + shifts[0] * to_the_right + shifts[1] * up, max(distances)


def on_screen(scene: Scene, points_m: Floats) -> Floats:
    """(N, 2) of (N, 3) points in the first view, right and up, as tangents of angles."""
    right, upward, nearer = _seen_from(points_m, scene.target_m)
    depth = np.maximum(scene.distance_m - nearer, 1e-9)
    return np.stack([right / depth, upward / depth], axis=-1)
