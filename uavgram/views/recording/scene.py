"""Size of the scene: the eye that sees all of it, line widths, frusta and exaggerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.survey.heights import (
    Departures,
    OffGround,
    collect_departures,
    collect_off_ground,
)
from uavgram.views.survey.key_facts import largest_ellipse
from uavgram.views.survey.outlines import frusta, nice_factor, track

# Tangents of half the angles of view that the scene may fill (Rerun's eye opens 55 degrees).
HALF_WIDTH, HALF_HEIGHT = 0.70, 0.47

COMPASS_POINTS = (
    "north",
    "north-east",
    "east",
    "south-east",
    "south",
    "south-west",
    "west",
    "north-west",
)


@dataclass(frozen=True, eq=False)
class Eye:
    """Eye of a view.

    Attributes
    ----------
    towards
        (3,) unit vector from the target to the eye; in a vertical view, north is up.
    target_m
        (3,) the target.
    distance_m
        Distance of the eye from the target.
    """

    towards: Floats
    target_m: Floats
    distance_m: float

    @classmethod
    def fit(cls, points_m: Floats, towards: Floats, up: Floats | None = None) -> Eye:
        """Place target and eye so that all (N, 3) points are as large as fits into a view.

        A point r to the right and n nearer than the target is seen if |r - a| <= W (D - n), where
        the eye is at the distance D and has moved by a: the outermost on both sides give a and D.
        The same holds upward; then the larger D serves for both.

        Parameters
        ----------
        points_m
            (N, 3) points.
        towards
            (3,) unit vector from the target to the eye.
        up
            (3,) direction that is up on the screen; None: z.
        """
        middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
        right, upward, nearer = _split_offsets(points_m - middle, towards, up)
        shifts, distances = [], []
        for aside, share in ((right, HALF_WIDTH), (upward, HALF_HEIGHT)):
            # outermost points on both sides: largest W n + r (right) and W n - r (left)
            most, least = (share * nearer + aside).max(), (share * nearer - aside).max()
            shifts.append((most - least) / 2)
            distances.append(float(most + least) / (2 * share))
        to_the_right, upwards = _axes(towards, up)
        target = middle + shifts[0] * to_the_right + shifts[1] * upwards
        return cls(towards, target, max(distances) or 1.0)  # a single point: from a metre away

    @property
    def position_m(self) -> Floats:
        """(3,) position of the eye."""
        return np.asarray(self.target_m + self.distance_m * self.towards)

    @property
    def heading(self) -> str:
        """Direction of view, one of eight compass points."""
        azimuth = np.arctan2(-self.towards[0], -self.towards[1])
        return COMPASS_POINTS[round(float(azimuth) / (np.pi / 4)) % 8]

    def project_to_screen(self, points_m: Floats) -> Floats:
        """Project (N, 3) points to (N, 2) tangents of angles, right and up."""
        right, upward, nearer = _split_offsets(points_m - self.target_m, self.towards)
        depth = np.maximum(self.distance_m - nearer, 1e-9)
        return np.stack([right / depth, upward / depth], axis=-1)

    def place_in_space(self, points_m: Floats, screen: Floats) -> Floats:
        """Return (N, 3) places at (N, 2) tangents of `on_screen`, as far away as (N, 3) points."""
        right, up = _axes(self.towards)
        _, _, nearer = _split_offsets(points_m - self.target_m, self.towards)
        aside = screen * np.maximum(self.distance_m - nearer, 1e-9)[:, None]
        across = aside[:, :1] * right + aside[:, 1:] * up
        return np.asarray(self.target_m + across + nearer[:, None] * self.towards)


def _split_offsets(
    offset_m: Floats, towards: Floats, up: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Split (N, 3) offsets from a target into (N,) parts: right, upward, and towards the eye."""
    right, upward = _axes(towards, up)
    return offset_m @ right, offset_m @ upward, offset_m @ towards


def _axes(towards: Floats, up: Floats | None = None) -> tuple[Floats, Floats]:
    """Return the directions (3,) right and (3,) upward on the screen."""
    right = np.cross([0.0, 0.0, 1.0] if up is None else up, towards)
    length = float(np.linalg.norm(right))
    right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return right, np.cross(towards, right)


# Share of the scene's size that the median exaggerated ellipse may fill.
ELLIPSE_SHARE = 0.06
# The same with many points: share of the distance from one point to the next.
CROWD_SHARE = 0.4
# Ellipses larger than this share of the scene are not filled.
FILL_SHARE = 0.02
# Share of the scene's size that the larger departures of the ground from its plane may fill.
DEPARTURE_SHARE = 0.05
# Share of the photo's width that the larger exaggerated residuals may fill.
RESIDUAL_SHARE = 0.07
# Depth of a frustum: share of the height, and of the distance between exposures.
FRUSTUM_SHARE = 0.06
SPACING_SHARE = 0.7
# The current camera is drawn larger by this factor.
CURRENT_FRUSTUM = 2.0
# Sampling step of the mosaic's outline, in its pixels.
GROUND_STEP_PX = 16

# Just below the plane, so that flat ellipses and lines are not hidden by the ground.
GROUND_DROP_SHARE = 5e-4

# From the south, a little from the west, and from above.
TO_THE_EYE = np.array([-0.185, -0.80, 0.572]) / np.linalg.norm([-0.185, -0.80, 0.572])
# Distance of the eye above the points, relative to their extent.
TOP_DISTANCE = 1.25
# Elevation of the eye of the side view, as a tangent: the ground is not seen as a line.
LEVEL = 0.07
# Share of the typical height off the ground that the median exaggerated ellipsoid may fill.
ELLIPSOID_SHARE = 0.5
# Smaller exaggerations do not need a second drawing.
MIN_EXAGGERATION = 5


@dataclass(frozen=True, eq=False)
class Scene:
    """Extent of the scene, from which drawings are scaled.

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
        Departures of uneven ground, None for a plane; their exaggeration.
    fill_ellipses
        Whether ellipses filled at true size leave enough of the ground visible.
    worst_point
        Row of the point with the largest ellipse within the survey; None if no ellipse has a
        shape (fewer than two points).
    ground_drop_m
        By how much the ground is drawn below its plane.
    ground_is_lowered
        Whether that must be mentioned, because some points are below the plane.
    eye, top_eye
        Eye of the first view, which shows ground, points and cameras; of the view from above.
    off_ground, ellipsoid_factor
        Points off the ground, None if there are none; exaggeration of their ellipsoids.
    side_eye
        Eye of the view from the side, None without points off the ground.
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
    eye: Eye
    top_eye: Eye
    off_ground: OffGround | None
    ellipsoid_factor: int
    side_eye: Eye | None


def measure_scene(result: Result, texture: GroundTexture | None = None) -> Scene:
    """Measure the extent of a result, and of the ground shown by photos."""
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
    uneven = collect_departures(result)
    standing = collect_off_ground(result)
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
        eye=Eye.fit(np.concatenate(shown), TO_THE_EYE),
        top_eye=Eye(np.array([0.0, 0.0, 1.0]), middle, TOP_DISTANCE * size),
        off_ground=standing,
        ellipsoid_factor=_ellipsoid_factor(result, standing),
        side_eye=_from_the_side(result, standing),
    )


def _pyramids(result: Result, depth_m: float) -> list[Floats]:
    """Return (n, 3) corners of all frusta, including the current camera's larger one."""
    return [
        frusta(result, poses, CURRENT_FRUSTUM * depth_m).reshape(-1, 3)
        for poses in (result.frames.refined, result.frames.seed)
    ]


def _around_ellipses(result: Result, factor: int) -> Floats:
    """Return (4K, 3) places east, west, north and south of points, where their ellipses end."""
    reach = factor * result.points.relative.ellipse_95_m[:, :1]
    ways = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    return np.concatenate([result.points.position_world_m + reach * way for way in ways])


def _ground(result: Result, texture: GroundTexture | None) -> Floats:
    """Return (n, 3) spots all over the ground that the mosaic covers."""
    if texture is None:
        return np.zeros((0, 3))
    row, column = GROUND_STEP_PX * np.array(
        np.nonzero(texture.covered[::GROUND_STEP_PX, ::GROUND_STEP_PX])
    )
    east = texture.west_m + column * texture.pixel_size_m
    spots = np.stack([east, texture.north_m - row * texture.pixel_size_m], axis=-1)
    return np.column_stack([spots, result.plane.height_at(spots)])


def _frustum_depth(result: Result, height_m: float) -> float:
    """Return the depth of frusta, small enough to distinguish consecutive ones."""
    poses = result.frames.refined if result.has_refined.any() else result.frames.seed
    steps = np.linalg.norm(np.diff(track(result, poses), axis=0), axis=1)
    spacing = float(np.median(steps)) if len(steps) else np.inf
    return max(min(FRUSTUM_SHARE * height_m, SPACING_SHARE * spacing), 0.02 * height_m)


def _ellipsoid_factor(result: Result, standing: OffGround | None) -> int:
    if standing is None:
        return 1
    height = np.abs(result.points.height_above_ground_m[standing.rows])
    typical = float(np.median(standing.half_axes_m[:, 0]))
    factor = nice_factor(typical, ELLIPSOID_SHARE * float(np.median(height)))
    return factor if factor >= MIN_EXAGGERATION else 1


def _from_the_side(result: Result, standing: OffGround | None) -> Eye | None:
    """Place the eye level, across the longer side of the points off the ground, rather south."""
    if standing is None:
        return None
    heads = result.points.position_world_m[standing.rows]
    # principal axes of the plan positions: the eye looks along the shorter one
    spread = np.cov(heads[:, :2].T, ddof=0)
    _, axes = np.linalg.eigh(spread + 1e-9 * np.diag([2.0, 1.0]))
    across = -axes[:, 0] if axes[1, 0] > 0 else axes[:, 0]
    towards = np.array([*across, LEVEL])
    return Eye.fit(np.concatenate([heads, standing.foot_m]), towards / np.linalg.norm(towards))
