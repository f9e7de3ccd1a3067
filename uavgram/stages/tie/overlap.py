"""Overlap of photos on the ground, and predicted pixels, by prior poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses

GRID = 8, 6
"""Columns and rows of the pixels by which the overlap of two photos is measured."""

LEAST_SHARE = 0.15
"""Least share of a photo's ground that another must show to be compared with it."""

MOST_NEIGHBOURS = 8
"""Largest number of photos that each is compared with: those of largest overlap."""

SIGMAS = 3.5
"""Radius of a search in standard deviations of the prediction."""

WIDEST_SEARCH = 0.35
"""Radius of a search, as a share of the photo's width, above which a prediction is useless."""

VAGUE_RAD = 0.2
"""Standard deviation of an attitude [rad] above which a pose does not determine the view of a
photo."""

FARTHEST = 6.0
"""Largest distance of ground that counts as shown, in heights of the camera above it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Cameras over a level ground, before any adjustment.

    Attributes
    ----------
    calibration
        Calibration of the camera.
    poses
        (N,) poses of the photos.
    ground_m, ground_sigma_m
        Height of the ground in the world, and its standard deviation.
    """

    calibration: Calibration
    poses: Poses
    ground_m: float
    ground_sigma_m: float

    @property
    def height_m(self) -> Floats:
        """Heights (N,) of the cameras above the ground."""
        return np.asarray(np.maximum(self.poses.center_world_m[:, 2] - self.ground_m, 1.0))

    @property
    def is_vague(self) -> Bools:
        """Mask (N,) of poses that do not determine the view of their photos."""
        variance = np.diagonal(self.poses.covariance, axis1=1, axis2=2)
        far = SIGMAS * np.sqrt(variance[:, :3].max(axis=1)) > 2.0 * self.height_m
        return np.asarray((variance[:, 3:].max(axis=1) > VAGUE_RAD**2) | far)

    def ground_of(self, photo: int, pixel_px: Floats) -> Floats:
        """Intersect pixels of a photo with the ground (M, 3); NaN where far away or without one."""
        center = self.poses.center_world_m[photo]
        ray = back_project(self.calibration.model, self.calibration.parameters, pixel_px)
        plane = np.array([self.ground_m, 0.0, 0.0])
        world = intersect_ground(
            center, ray @ self.poses.world_from_camera[photo].T, plane, np.zeros(2)
        )
        with np.errstate(invalid="ignore"):
            far = np.linalg.norm(world - center, axis=1) > FARTHEST * self.height_m[photo]
        world[far] = np.nan
        return np.asarray(world)

    def pixels_of(self, photo: int, world_m: Floats) -> Floats:
        """Project points of the world to a photo (M, 2); NaN where it does not show them."""
        camera = self.calibration
        point = (world_m - self.poses.center_world_m[photo]) @ self.poses.world_from_camera[photo]
        return project(camera.model, camera.parameters, point)


class Prediction(NamedTuple):
    """Pixels (M, 2) of one photo in another, NaN where not shown; and the search radius."""

    pixel_px: Floats
    radius_px: float


def overlap(seen: Seen) -> Floats:
    """Compute the share (N, N) of ground shown by two photos: the lesser of the two shares."""
    count = len(seen.poses.frame_id)
    grid = _grid(seen.calibration)
    ground = np.stack([seen.ground_of(k, grid) for k in range(count)])
    shown = np.asarray(np.isfinite(ground).all(axis=2))
    share = np.zeros((count, count))
    # Circle around the ground of each photo, to skip distant pairs.
    photos = np.flatnonzero(shown.any(axis=1))
    middle = np.full((count, 3), np.inf)
    middle[photos] = np.nanmean(ground[photos], axis=1)
    reach = np.zeros(count)
    from_middle = np.linalg.norm(ground[photos] - middle[photos, None], axis=2)
    reach[photos] = np.nanmax(from_middle, axis=1, initial=0.0)
    for k in photos.tolist():
        apart = np.linalg.norm(middle - middle[k], axis=1)
        near = np.flatnonzero(apart <= reach + reach[k])
        pixel = seen.pixels_of(k, ground[near].reshape(-1, 3))
        share[near, k] = _inside(seen.calibration, pixel).reshape(len(near), -1).mean(axis=1)
    # The lesser of the two shares.
    share = np.minimum(share, share.T)
    np.fill_diagonal(share, 0.0)
    return share


def pairs_of(score: Floats, least: float, most: int = MOST_NEIGHBOURS) -> Ints:
    """Choose pairs (P, 2) of photos to compare, each among the best of one of the two.

    Parameters
    ----------
    score
        (N, N) overlap of two photos; symmetric.
    least
        Score below which they have nothing in common.
    most
        Partners that each photo chooses.
    """
    order = np.argsort(-score, axis=1, kind="stable")[:, :most]
    chosen = np.zeros(score.shape, np.bool_)
    np.put_along_axis(chosen, order, np.take_along_axis(score, order, axis=1) >= least, axis=1)
    return np.argwhere(np.triu(chosen | chosen.T, 1))


def predict(seen: Seen, one: int, other: int, pixel_px: Floats) -> Prediction | None:
    """Predict pixels of one photo in another; None where the prediction is too uncertain.

    Parameters
    ----------
    seen
        The photos.
    one, other
        Rows of the two.
    pixel_px
        (M, 2) in the first.
    """
    radius = _radius(seen, one, other)
    if radius > WIDEST_SEARCH * seen.calibration.width_px:
        return None
    pixel = seen.pixels_of(other, seen.ground_of(one, pixel_px))
    pixel[~_inside(seen.calibration, pixel, radius)] = np.nan
    return Prediction(pixel, radius)


def _radius(seen: Seen, one: int, other: int) -> float:
    """Compute the search radius [px] from sigmas of attitudes, positions and ground height."""
    both = seen.poses.covariance[[one, other]]
    variance = np.diagonal(both, axis1=1, axis2=2)
    height = float(seen.height_m[[one, other]].min())
    base = np.diff(seen.poses.center_world_m[[one, other]], axis=0)[0]
    turn = variance[:, 3:].max(axis=1).sum()
    place = variance[:, :3].max(axis=1).sum() / height**2
    ground = (np.linalg.norm(base) * max(seen.ground_sigma_m, 0.05 * height) / height**2) ** 2
    return float(SIGMAS * seen.calibration.parameters[0] * np.sqrt(turn + place + ground))


def _grid(camera: Calibration) -> Floats:
    """Return pixels (M, 2) spread over a photo."""
    u = (np.arange(GRID[0]) + 0.5) * camera.width_px / GRID[0]
    v = (np.arange(GRID[1]) + 0.5) * camera.height_px / GRID[1]
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def _inside(camera: Calibration, pixel_px: Floats, margin: float = 0.0) -> Bools:
    """Mark pixels (M,) inside a photo, or outside by less than a margin."""
    size = np.array([camera.width_px, camera.height_px])
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixel_px > -margin) & (pixel_px < size + margin)).all(axis=1))
