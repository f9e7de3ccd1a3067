"""Shapes to draw a result with: outlines, frusta, lines, and those that a photo may show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, row_poses
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable

NICE_FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)

# A straight line bends in a distorted photo: these samples keep the chord error below a pixel.
LINE_SAMPLES = 49


def find_largest_finite(values: Floats) -> float:
    """Return the largest finite value; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else float("nan")


def nice_factor(size: float, wanted: float) -> int:
    """Return the largest factor of the 1-2-5 series with which `size` stays within `wanted`."""
    if not (size > 0 and np.isfinite(size)):
        return 1
    return max((f for f in NICE_FACTORS if f * size <= wanted), default=1)


def frustum_corners(result: Result) -> Floats:
    """Return (4, 3) corners of the photo as rays z = 1 of the undistorted camera, clockwise."""
    camera = result.camera
    return corner_rays(result.shared.intrinsics.value, camera.width_px, camera.height_px)


def corner_rays(parameters: Floats, width_px: int, height_px: int) -> Floats:
    """Return (4, 3) corners of a photo as rays z = 1 of a camera without distortion, clockwise.

    Parameters
    ----------
    parameters
        (n,) fx fy cx cy and more [px].
    width_px, height_px
        Size of its photos.
    """
    fx, fy, cx, cy = parameters[:4]
    u = np.array([0, 1, 1, 0]) * width_px - 0.5
    v = np.array([0, 0, 1, 1]) * height_px - 0.5
    return np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(4)], axis=-1)


def frusta(result: Result, poses: PoseTable, depth_m: float) -> Floats:
    """Draw (N, 10, 3) one open polyline per frame with a pose: image frame and four edges.

    Parameters
    ----------
    result
        Result of the run.
    poses
        (F,) poses of its frames.
    depth_m
        Depth at which a frustum is cut off.
    """
    posed = np.isfinite(poses.center_world_m[:, 0])
    rays = depth_m * frustum_corners(result)
    return pyramids(poses.center_world_m[posed], poses.world_from_camera[posed], rays)


def pyramids(center_m: Floats, world_from_camera: Floats, corners_m: Floats) -> Floats:
    """Draw (N, 10, 3) open polylines: the base with its four corners, and the edges to the apex.

    Parameters
    ----------
    center_m, world_from_camera
        (N, 3), (N, 3, 3) poses of the apexes.
    corners_m
        (4, 3) corners of the base, in the camera's frame, in their order around it.
    """
    apex = center_m[:, None, :]
    corners = apex + np.einsum("nij,kj->nki", world_from_camera, corners_m)
    top_left, top_right, bottom_right, bottom_left = (corners[:, k : k + 1] for k in range(4))
    return np.concatenate(
        [
            *(top_left, top_right, bottom_right, bottom_left, top_left),
            *(apex, top_right, bottom_right, apex, bottom_left),
        ],
        axis=1,
    )


def flight_order(result: Result) -> Ints:
    """Order the (F,) frames by time; by name if no time is known."""
    time = result.frames.time_utc_s
    key = time if np.isfinite(time).any() else np.arange(len(time), dtype=np.float64)
    return np.argsort(key, kind="stable").astype(np.int64)


def track(result: Result, poses: PoseTable) -> Floats:
    """Return (N, 3) centres of the frames that have a pose, in the order of flight."""
    centers = poses.center_world_m[flight_order(result)]
    return np.asarray(centers[np.isfinite(centers[:, 0])], dtype=np.float64)


def largest_sigmas(poses: PoseTable) -> tuple[Floats, Floats]:
    """Compute (F,) standard deviations in the least certain direction; NaN without a pose.

    Returns
    -------
    position_m
        Along the least certain of east, north and up.
    attitude_deg
        About the least certain of the camera's axes.
    """
    sigma = np.sqrt(np.diagonal(poses.covariance, axis1=1, axis2=2))
    return sigma[:, :3].max(axis=1), np.degrees(sigma[:, 3:].max(axis=1))


def longest_middle(strip: Floats) -> Floats:
    """Return the (D,) middle of the longest segment of a (n, D) polyline."""
    starts, ends = strip[:-1], strip[1:]
    longest = int(np.argmax(np.linalg.norm(ends - starts, axis=1)))
    return np.asarray((starts[longest] + ends[longest]) / 2, dtype=np.float64)


def project_from(
    result: Result,
    poses: RowPoses,
    points_m: Floats,
    *,
    adjusted_lens: bool = True,
) -> Floats:
    """Project (..., 3) world points to (..., 2) original pixels; NaN outside the photo.

    Parameters
    ----------
    result
        Result with the camera.
    poses
        Poses of the camera.
    points_m
        (..., 3) in the world.
    adjusted_lens
        Whether to use the lens as adjusted, not as calibrated.
    """
    lens = result.shared.intrinsics.value if adjusted_lens else result.camera.parameters
    pixel = project_rows(result.camera, lens, poses, points_m)
    return np.where(result.camera.is_in_photo(pixel)[..., None], pixel, np.nan)


def project_polylines(result: Result, frame: int, strips: Sequence[Floats]) -> list[Floats]:
    """Project (n, 3) samples of polylines to (n, 2) pixels of a photo, all at once; NaN outside.

    Parameters
    ----------
    result
        Result with the camera.
    frame
        Row of an adjusted photo.
    strips
        The polylines; there may be hundreds.
    """
    together = np.concatenate([np.zeros((0, 3)), *strips])
    pixel = project_from(result, row_poses(result, frame), together)
    return np.split(pixel, np.cumsum([len(strip) for strip in strips])[:-1])[: len(strips)]


def sample_polyline(strip: Floats, samples: int = LINE_SAMPLES) -> Floats:
    """Sample a polyline to (m, 3) with so many points on each segment."""
    share = np.linspace(0.0, 1.0, samples)[:, None]
    start, step = strip[:-1, None], np.diff(strip, axis=0)[:, None]
    return np.asarray((start + share * step).reshape(-1, strip.shape[1]), dtype=np.float64)


def visible_runs(pixel: Floats) -> list[Floats]:
    """Split a (m, 2) polyline into pieces without NaN, each of two points or more."""
    good = np.isfinite(pixel[:, 0])
    # starts and ends of the runs: changes of a mask padded with False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    runs = [pixel[a:b] for a, b in edges.reshape(-1, 2)]
    return [run for run in runs if len(run) >= 2]


def thin_polyline(run: Floats, off_px: float) -> Floats:
    """Thin a (m, 2) polyline to the fewest (k, 2) evenly chosen points within a tolerance.

    Parameters
    ----------
    run
        Two points or more.
    off_px
        Largest distance of an omitted point from its place on the drawn line.
    """
    # double the number of points until linear interpolation keeps the tolerance
    rows = np.arange(len(run))
    for count in 2 ** np.arange(1, 32):
        if count >= len(run):
            break
        kept = np.linspace(0, len(run) - 1, count).round().astype(np.int64)
        drawn = np.stack([np.interp(rows, kept, run[kept, k]) for k in range(2)], axis=-1)
        if np.linalg.norm(drawn - run, axis=1).max() <= off_px:
            return np.asarray(run[kept])
    return run


SIDE_SAMPLES = 9
"""Samples on each side of a photo, whose directions give its angle of view."""


class VisiblePolylines:
    """Bounding spheres of polylines, and the cone of view of a photo.

    Objects outside the cone are in no pixel of the photo; those that touch it may be.

    Parameters
    ----------
    result
        Result with the adjusted photos.
    strips
        (n, 3) polylines in the world.
    """

    def __init__(self, result: Result, strips: list[Floats]) -> None:
        lows = np.reshape([strip.min(axis=0) for strip in strips], (-1, 3))
        highs = np.reshape([strip.max(axis=0) for strip in strips], (-1, 3))
        self._middle = (lows + highs) / 2
        self._radius = np.linalg.norm(highs - lows, axis=1) / 2
        self._poses, self._sweep = result.frames.refined, result.frames.sweep
        self._half_angle = _half_angle(result)

    def of(self, frame: int) -> Ints:
        """Return the rows of the polylines that a frame may show, in any of its rows of pixels."""
        # direction of each sphere against the optical axis
        away = self._middle - self._poses.center_world_m[frame]
        distance = np.linalg.norm(away, axis=1)
        moved, turned = np.linalg.norm(self._sweep[frame].reshape(2, 3), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = away @ self._poses.world_from_camera[frame][:, 2] / distance
            wide = np.arcsin(np.minimum((self._radius + moved) / distance, 1.0))
        # seen if angle off axis <= half angle of view + turn during readout + angular radius
        off_axis = np.arccos(np.clip(ahead, -1.0, 1.0))
        is_around = distance <= self._radius + moved
        return np.flatnonzero(is_around | (off_axis <= self._half_angle + turned + wide))


def _half_angle(result: Result) -> float:
    """Return the largest angle to the optical axis in a photo [rad]; pi if the lens gives none."""
    share = np.linspace(0.0, 1.0, SIDE_SAMPLES)
    zero, one = np.zeros_like(share), np.ones_like(share)
    side = np.concatenate([share, one, share, zero]), np.concatenate([zero, share, one, share])
    # rays of points along the border of the photo
    border = np.column_stack(side) * [result.camera.width_px, result.camera.height_px] - 0.5
    ray = back_project(result.camera.model, result.shared.intrinsics.value, border)
    widest = float(np.arctan(np.linalg.norm(ray[:, :2], axis=1)).max())
    return widest if np.isfinite(widest) else np.pi
