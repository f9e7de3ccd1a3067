"""Projections of a calibration: comparison of two cameras, and uncertainty in pixels and lengths.

The parameters themselves compare badly: a shifted principal point and a slightly rotated camera
have nearly the same effect, and so do focal length and distortion. The difference that remains in
the image after the best-fitting rotation is the effect on a measurement.

References
----------
D. Kogan, mrcal documentation, "Differencing" (mrcal.secretsauce.net/differencing.html): the implied
transformation is fitted before two models are compared, weighted by their uncertainty.

Errors of the parameters that a rotation of the camera compensates do no harm where the pose is
estimated with the same camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.camera.projection import back_project_with_jacobian, project_with_jacobian
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat, log_so3
from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.board import LengthUncertainty
from uavgram.model.camera import Calibration

GRID_COLUMNS = 40
_STEPS = 30
_MIN_CHANGE_PX = 1e-7
_ROUNDING_PX = 1e-6  # differences below it count as zero
_MIN_PIXELS = 8  # for six unknowns and some redundancy


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraDifference(FrozenArrays):
    """Differences of the projections by a second calibration, over the image of the first.

    Attributes
    ----------
    pixel_px
        (N, 2) pixels of the first camera that both can see.
    difference_px
        (N, 2) pixel of the same direction in the second camera, minus `pixel_px`.
    covariance_px2
        (N, 2, 2) of the difference, with the calibrations assumed independent, and the fitted
        rotation accounted for; zero if neither calibration has errors.
    rotation_rad
        (3,) fitted rotation: direction in the second camera = exp(rotation) @ direction in the
        first.
    share_seen
        Share of the pixels of the grid that both cameras see.
    """

    pixel_px: Annotated[Floats, "n", 2]
    difference_px: Annotated[Floats, "n", 2]
    covariance_px2: Annotated[Floats, "n", 2, 2]
    rotation_rad: Annotated[Floats, 3]
    share_seen: float

    @property
    def size_px(self) -> Floats:
        """(N,) length of the difference."""
        return np.asarray(np.hypot(self.difference_px[:, 0], self.difference_px[:, 1]))

    @property
    def rms_px(self) -> float:
        """Root of the mean squared length of the difference over the image."""
        return float(np.sqrt(np.mean(self.size_px**2)))

    @property
    def max_px(self) -> float:
        """Largest length of the difference."""
        return float(self.size_px.max())

    @property
    def sigma_px(self) -> Floats:
        """(N,) expected length of the difference: the root of its covariance's trace."""
        return np.asarray(np.sqrt(np.trace(self.covariance_px2, axis1=1, axis2=2)))

    @property
    def expected_rms_px(self) -> float:
        """Expected rms by the errors of the two calibrations alone."""
        return float(np.sqrt(np.mean(self.sigma_px**2)))

    @property
    def z(self) -> Floats:
        """(N,) Mahalanobis length of the difference: 2.45 is exceeded by 5 % of the pixels.

        Infinite if the calibrations state no error at all but differ.
        """
        sigma2, axes = np.linalg.eigh(self.covariance_px2)
        along = np.einsum("nij,ni->nj", axes, self.difference_px)
        # The variance of the smaller axis is not known below the rounding of the larger one.
        floor = 1e-12 * sigma2[:, 1:]
        with np.errstate(divide="ignore", invalid="ignore"):
            squared = np.where(
                np.abs(along) < _ROUNDING_PX, 0.0, along**2 / np.maximum(sigma2, floor)
            )
        return np.asarray(np.sqrt(squared.sum(axis=1)))


@dataclass(frozen=True, eq=False)
class _Alignment:
    """Rotation of the second camera, with differences and derivatives there."""

    rotation: Floats  # (3, 3)
    difference: Floats  # (N, 2)
    by_rotation: Floats  # (N, 2, 3)
    by_ray: Floats  # (N, 2, 3): by the ray in the first camera's frame
    by_second: Floats  # (N, 2, P) by the second camera's parameters


def compare_cameras(
    first: Calibration, second: Calibration, *, columns: int = GRID_COLUMNS
) -> CameraDifference:
    """Compare the projections by two calibrations, after the best-fitting rotation between them.

    Parameters
    ----------
    first, second
        Calibrations of images of the same size; their lens models may differ.
    columns
        Number of columns of the grid of pixels, which covers the image to its edges.

    Raises
    ------
    GeometryError
        The images have different sizes, or the cameras hardly see anything in common.
    """
    if (first.width_px, first.height_px) != (second.width_px, second.height_px):
        raise GeometryError(
            f"cameras {first.name!r} ({first.width_px} x {first.height_px} px) and {second.name!r} "
            f"({second.width_px} x {second.height_px} px) have different image sizes: scale one of "
            "them to the other's size first"
        )
    pixel = make_image_grid(first.width_px, first.height_px, columns)
    ray, _, by_first = back_project_with_jacobian(first.model, first.parameters, pixel)
    seen = ~np.isnan(ray[:, 2])
    seen[seen] = ~np.isnan(
        project_with_jacobian(second.model, second.parameters, ray[seen], beyond_fold="nan")[0][
            :, 0
        ]
    )
    if seen.sum() < _MIN_PIXELS:
        raise GeometryError(
            f"cameras {first.name!r} and {second.name!r} see only {seen.sum()} of {len(seen)} "
            "pixels of a grid in common: one of the two files is wrong"
        )
    pixel, ray, by_first = pixel[seen], ray[seen], by_first[seen]
    even = np.ones(len(pixel))
    # First fit with equal weights, then with weights by the covariance of the differences.
    rough = _align(second, pixel, ray, even, np.eye(3))
    weight = _weights(_covariance(rough, by_first, (first, second), even))
    best = _align(second, pixel, ray, weight, rough.rotation)
    return CameraDifference(
        pixel_px=pixel,
        difference_px=best.difference,
        covariance_px2=_covariance(best, by_first, (first, second), weight),
        rotation_rad=log_so3(best.rotation),
        share_seen=float(seen.mean()),
    )


def make_image_grid(width_px: int, height_px: int, columns: int = GRID_COLUMNS) -> Floats:
    """Return (N, 2) pixels of a grid of nearly square cells over the image, its edges included.

    Parameters
    ----------
    width_px, height_px
        Size of the image.
    columns
        Number of columns; the rows follow from the image's shape.
    """
    rows = max(2, round(columns * height_px / width_px))
    u = np.linspace(-0.5, width_px - 0.5, columns)
    v = np.linspace(-0.5, height_px - 0.5, rows)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def _align(
    second: Calibration, pixel: Floats, ray: Floats, weight: Floats, rotation: Floats
) -> _Alignment:
    """Estimate the rotation with the smallest weighted difference by Gauss-Newton.

    The lens models are used beyond their folds during the iteration, so that no pixel drops out;
    the compared pixels were seen by both at the start.
    """
    root = np.sqrt(weight)[:, None]
    for _ in range(_STEPS):
        at = _evaluate(second, pixel, ray, rotation)
        design = (root[:, :, None] * at.by_rotation).reshape(-1, 3)
        misfit = (root * at.difference).ravel()
        step = np.negative(np.linalg.lstsq(design, misfit, rcond=None)[0], dtype=np.float64)
        rotation = exp_so3(step) @ rotation
        if np.abs(at.by_rotation @ step).max() < _MIN_CHANGE_PX:
            return _evaluate(second, pixel, ray, rotation)
    raise GeometryError(
        f"no turn fits camera {second.name!r} to the other one: their lenses have too little in "
        "common to be compared"
    )


def _evaluate(second: Calibration, pixel: Floats, ray: Floats, rotation: Floats) -> _Alignment:
    turned = ray @ rotation.T
    have, by_turned, by_second = project_with_jacobian(
        second.model, second.parameters, turned, beyond_fold="extend"
    )
    # exp(step) @ x = x + step x x = x - hat(x) @ step
    by_rotation = -by_turned @ hat(turned)
    return _Alignment(rotation, have - pixel, by_rotation, by_turned @ rotation, by_second)


def _covariance(
    at: _Alignment, by_first: Floats, cameras: tuple[Calibration, Calibration], weight: Floats
) -> Floats:
    """Compute (N, 2, 2) covariances of the differences after the fitted rotation.

    First order: the rotation follows the errors of both calibrations by least squares, so that d
    difference = (I - A A+) (B d second + C d first), with A+ the weighted pseudo-inverse.
    """
    first, second = cameras
    a = at.by_rotation.reshape(-1, 3)
    root = np.repeat(np.sqrt(weight), 2)[:, None]
    result = np.zeros((len(at.difference), 2, 2))
    for camera, by_parameters in ((first, at.by_ray @ by_first), (second, at.by_second)):
        g = by_parameters.reshape(len(a), -1)
        g = g - a @ np.linalg.lstsq(root * a, root * g, rcond=None)[0]
        rows = g.reshape(len(result), 2, -1)
        result += rows @ camera.covariance @ rows.transpose(0, 2, 1)
    return result


def _weights(covariance: Floats) -> Floats:
    """Compute (N,) weights by variances that a rotation cannot explain; equal if all are zero."""
    variance = np.trace(covariance, axis1=1, axis2=2)
    mean = float(variance.mean())
    if mean == 0:
        return np.ones(len(variance))
    return np.asarray(mean / np.maximum(variance, 1e-6 * mean))


_MAX_REWEIGHTINGS = 5


def compute_projection_covariance(
    calibration: Calibration, *, columns: int = GRID_COLUMNS
) -> tuple[Floats, Floats]:
    """Compute the covariance of projected directions over the image.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    columns
        Number of columns of the grid of pixels.

    Returns
    -------
    pixel_px : (N, 2)
        Pixels of the grid that have a ray.
    covariance_px2 : (N, 2, 2)
        Covariance of the pixel of a fixed direction, after the rotation that compensates the
        calibration's error best.
    """
    exact = replace(calibration, covariance=np.zeros_like(calibration.covariance))
    difference = compare_cameras(calibration, exact, columns=columns)
    return difference.pixel_px, difference.covariance_px2


def compute_worst_sigma(covariance: Floats) -> Floats:
    """Compute (N,) standard deviations of (N, 2, 2) covariances in their worst direction."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0)))


def compute_length_sigmas(
    calibration: Calibration, *, tilt_rad: float, columns: int = 16
) -> LengthUncertainty:
    """Compute relative sigmas of lengths between ground points, by the calibration alone.

    The lengths lie over the whole image, each a third of its width.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    tilt_rad
        Angle of the optical axis from the nadir [rad]; image up is the direction of the tilt.
    columns
        Number of columns of the grid of ground points that determine the pose.

    Raises
    ------
    GeometryError
        The image does not see the ground.
    """
    size = np.array([calibration.width_px, calibration.height_px])
    ends = _make_lengths(size)
    grid = make_image_grid(calibration.width_px, calibration.height_px, columns)
    grid_fall = _ground(calibration, tilt_rad, grid)
    seen = np.isfinite(grid_fall.point[:, 0])
    fall = _ground(calibration, tilt_rad, ends.reshape(-1, 2))
    kept = np.isfinite(fall.point[:, 0]).reshape(-1, 2).all(axis=1)
    ends, fall = ends[kept], fall.take(np.repeat(kept, 2))
    if not len(ends) or seen.sum() < 8:
        raise GeometryError(
            f"camera {calibration.name!r} tilted {np.degrees(tilt_rad):.0f} degrees does not see "
            "the ground: tilt it less"
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
