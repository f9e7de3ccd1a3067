"""Projection uncertainty of a calibration: in pixels, and in lengths on the ground.

Errors of the parameters that a rotation (or shift) of the camera compensates do no harm where the
pose is estimated with the same camera; see `uavgram.estimation.calibration.difference`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.difference import compare_cameras, make_image_grid
from uavgram.geometry.camera.projection import back_project_with_jacobian
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats
from uavgram.model.board import LengthUncertainty
from uavgram.model.camera import Calibration

_MAX_REWEIGHTINGS = 5


def compute_projection_covariance(
    calibration: Calibration, *, distance: float | None = None, columns: int = 40
) -> tuple[Floats, Floats]:
    """Compute the covariance of projected directions over the image.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    distance
        Distance of the points from the camera; None: at infinity, where only a rotation has an
        effect.
    columns
        Number of columns of the grid of pixels.

    Returns
    -------
    pixel_px : (N, 2)
        Pixels of the grid that have a ray.
    covariance_px2 : (N, 2, 2)
        Covariance of the pixel of a fixed direction, after the rotation (and shift) that
        compensates the calibration's error best.
    """
    exact = replace(calibration, covariance=np.zeros_like(calibration.covariance))
    difference = compare_cameras(calibration, exact, distance=distance, columns=columns)
    return difference.pixel_px, difference.covariance_px2


def compute_worst_sigma(covariance: Floats) -> Floats:
    """Compute (N,) standard deviations of (N, 2, 2) covariances in their worst direction."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0)))


def compute_length_sigmas(
    calibration: Calibration,
    *,
    tilt_rad: float,
    pixel_px: Floats | None = None,
    columns: int = 16,
) -> LengthUncertainty:
    """Compute relative sigmas of lengths between ground points, by the calibration alone.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    tilt_rad
        Angle of the optical axis from the nadir [rad]; image up is the direction of the tilt.
    pixel_px
        (L, 2, 2) ends of the lengths; None: a set over the image, each a third of its width.
    columns
        Number of columns of the grid of ground points that determine the pose.

    Raises
    ------
    GeometryError
        An end of a length, or the image as a whole, does not see the ground.
    """
    size = np.array([calibration.width_px, calibration.height_px])
    ends = _make_lengths(size) if pixel_px is None else np.asarray(pixel_px, np.float64)
    grid = make_image_grid(calibration.width_px, calibration.height_px, columns)
    grid_fall = _ground(calibration, tilt_rad, grid)
    seen = np.isfinite(grid_fall.point[:, 0])
    fall = _ground(calibration, tilt_rad, ends.reshape(-1, 2))
    if pixel_px is None:
        kept = np.isfinite(fall.point[:, 0]).reshape(-1, 2).all(axis=1)
        ends, fall = ends[kept], fall.take(np.repeat(kept, 2))
    if not np.isfinite(fall.point).all() or not len(ends) or seen.sum() < 8:
        raise GeometryError(
            f"camera {calibration.name!r} tilted {np.degrees(tilt_rad):.0f} degrees does not see "
            "the ground there: tilt it less, or choose pixels below the horizon"
        )
    # The pose that compensates the error best: pixel(point, pose, parameters) does not change.
    near = grid_fall.take(seen)
    follow = _pose_derivative(near, calibration.covariance)
    along = np.diff(fall.point.reshape(-1, 2, 3), axis=1)[:, 0]
    length = np.linalg.norm(along, axis=1)

    def relative(by_parameters: Floats) -> Floats:
        end = by_parameters.reshape(len(ends), 2, 3, -1)
        gradient = np.einsum("li,lip->lp", along, end[:, 1] - end[:, 0]) / length[:, None] ** 2
        variance = np.einsum("lp,pq,lq->l", gradient, calibration.covariance, gradient)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    return LengthUncertainty(
        pixel_px=ends,
        length=length,
        pose_known=relative(fall.by_parameters),
        pose_fitted=relative(fall.by_parameters + fall.by_pose @ follow),
    )


class _Ground(NamedTuple):
    """Ground points of pixels for a camera at height 1 above them, with derivatives."""

    point: Floats  # (N, 3)
    by_parameters: Floats  # (N, 3, P)
    by_pose: Floats  # (N, 3, 6) centre, then rotation in the camera's frame
    to_pixel: Floats  # (N, 2, 3) derivative of the pixel by the point along the ground

    def take(self, index: Floats) -> _Ground:
        return _Ground._make(rows[index] for rows in self)


def _pose_derivative(seen: _Ground, covariance: Floats) -> Floats:
    """Compute the (6, P) derivative of the pose by the parameters that compensates their errors.

    Weighted by the remaining error: no pose would be measured where the lens is hardly known.
    """
    by_pose, by_parameters = (
        (seen.to_pixel @ d).reshape(2 * len(seen.point), -1)
        for d in (seen.by_pose, seen.by_parameters)
    )
    weight = np.ones(len(seen.point))
    for _ in range(_MAX_REWEIGHTINGS):
        root = np.repeat(np.sqrt(weight), 2)[:, None]
        # Weighted least squares: the pose that cancels the change of the pixels by the parameters.
        follow = -np.linalg.lstsq(root * by_pose, root * by_parameters, rcond=None)[0]
        left = (by_parameters + by_pose @ follow).reshape(len(weight), 2, -1)
        variance = np.einsum("nip,pq,niq->n", left, covariance, left)
        mean = float(variance.mean())
        weight = mean / np.maximum(variance, 1e-6 * mean) if mean > 0 else weight
    return np.asarray(follow)


def _ground(calibration: Calibration, tilt_rad: float, pixel: Floats) -> _Ground:
    sine, cosine = np.sin(tilt_rad), np.cos(tilt_rad)
    # x east; image up tilts towards north; z down to the ground
    world_from_camera = np.array([[1, 0, 0], [0, -cosine, sine], [0, -sine, -cosine]])
    ray, d_pixel, d_parameters = back_project_with_jacobian(
        calibration.model, calibration.parameters, pixel
    )
    point, d_center, d_ray, _ = intersect_ground_with_jacobian(
        np.array([0.0, 0.0, 1.0]), ray @ world_from_camera.T, np.zeros(3), np.zeros(2)
    )
    by_ray = d_ray @ world_from_camera
    by_pose = np.concatenate([d_center, -by_ray @ hat(ray)], axis=2)
    d_ground = by_ray @ d_pixel
    with np.errstate(invalid="ignore"):
        along = np.where(np.isfinite(d_ground), d_ground, 0.0)
    return _Ground(point, by_ray @ d_parameters, by_pose, np.linalg.pinv(along))


def _make_lengths(size: Floats) -> Floats:
    """Return (L, 2, 2) lengths a third of the image wide, level and upright, over the image."""
    place = np.array([(x, y) for x in (0.1, 0.35, 0.6) for y in (0.2, 0.5, 0.8)])
    level = np.stack([place, place + np.array([0.3, 0.0])], axis=1)
    place = np.array([(x, y) for x in (0.2, 0.5, 0.8) for y in (0.1, 0.35, 0.6)])
    upright = np.stack([place, place + np.array([0.0, 0.3])], axis=1)
    return np.asarray(np.concatenate([level, upright]) * (size - 1))
