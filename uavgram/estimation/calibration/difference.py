"""Comparison of two calibrations of one camera by their projections of the same directions.

The parameters themselves compare badly: a shifted principal point and a slightly rotated camera
have nearly the same effect, and so do focal length and distortion. The difference that remains in
the image after the best-fitting rotation is the effect on a measurement.

References
----------
D. Kogan, mrcal documentation, "Differencing" (mrcal.secretsauce.net/differencing.html): the implied
transformation is fitted before two models are compared, weighted by their uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.camera.projection import back_project_with_jacobian, project_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat, log_so3
from uavgram.model.arrays import Floats, FrozenArrays
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
        (N, 2) pixel of the same direction (or point) in the second camera, minus `pixel_px`.
    covariance_px2
        (N, 2, 2) of the difference, with the calibrations assumed independent, and the fitted
        rotation accounted for; zero if neither calibration has errors.
    rotation_rad
        (3,) fitted rotation: direction in the second camera = exp(rotation) @ direction in the
        first.
    center_shift
        (3,) fitted position of the second camera in the first one's frame, in the unit of the
        distance; zero at infinity.
    share_seen
        Share of the pixels of the grid that both cameras see.
    """

    pixel_px: Annotated[Floats, "n", 2]
    difference_px: Annotated[Floats, "n", 2]
    covariance_px2: Annotated[Floats, "n", 2, 2]
    rotation_rad: Annotated[Floats, 3]
    center_shift: Annotated[Floats, 3]
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
    """Pose of the second camera, with differences and derivatives there."""

    rotation: Floats  # (3, 3)
    center: Floats  # (3,)
    difference: Floats  # (N, 2)
    by_alignment: Floats  # (N, 2, 3 or 6): rotation, then shift of the centre
    by_point: Floats  # (N, 2, 3): by the point in the first camera's frame
    by_second: Floats  # (N, 2, P) by the second camera's parameters


def compare_cameras(
    first: Calibration,
    second: Calibration,
    *,
    distance: float | None = None,
    columns: int = GRID_COLUMNS,
) -> CameraDifference:
    """Compare the projections by two calibrations, after the best-fitting rotation between them.

    Parameters
    ----------
    first, second
        Calibrations of images of the same size; their lens models may differ.
    distance
        Distance of the points from the first camera; the second may then also be shifted. None: at
        infinity, where only a rotation has an effect.
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
    point, by_ray = _place_at_distance(ray, distance)
    seen = ~np.isnan(point[:, 2])
    seen[seen] = ~np.isnan(_project(second, point[seen])[:, 0])
    if seen.sum() < _MIN_PIXELS:
        raise GeometryError(
            f"cameras {first.name!r} and {second.name!r} see only {seen.sum()} of {len(seen)} "
            "pixels of a grid in common: one of the two files is wrong"
        )
    pixel, point = pixel[seen], point[seen]
    by_first = by_ray[seen] @ by_first[seen]
    shifted = distance is not None
    even = np.ones(len(pixel))
    start = (np.eye(3), np.zeros(3))
    # First fit with equal weights, then with weights by the covariance of the differences.
    rough = _align(second, pixel, point, even, start, shifted=shifted)
    weight = _weights(_covariance(rough, by_first, (first, second), even))
    start = (rough.rotation, rough.center)
    best = _align(second, pixel, point, weight, start, shifted=shifted)
    return CameraDifference(
        pixel_px=pixel,
        difference_px=best.difference,
        covariance_px2=_covariance(best, by_first, (first, second), weight),
        rotation_rad=log_so3(best.rotation),
        center_shift=best.center,
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


def _place_at_distance(ray: Floats, distance: float | None) -> tuple[Floats, Floats]:
    """Return (N, 3) points on rays with z = 1 at a distance from the camera, and (N, 3, 3) by ray.

    At infinity the rays themselves: their length does not matter there.
    """
    if distance is None:
        return ray, np.broadcast_to(np.eye(3), (len(ray), 3, 3))
    length = np.linalg.norm(ray, axis=1)[:, None]
    unit = ray / length
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    return distance * unit, distance * across / length[:, :, None]


def _project(camera: Calibration, point: Floats) -> Floats:
    return project_with_jacobian(camera.model, camera.parameters, point, beyond_fold="nan")[0]


def _align(
    second: Calibration,
    pixel: Floats,
    point: Floats,
    weight: Floats,
    start: tuple[Floats, Floats],
    *,
    shifted: bool,
) -> _Alignment:
    """Estimate the rotation (and shift) with the smallest weighted difference by Gauss-Newton.

    The lens models are used beyond their folds during the iteration, so that no pixel drops out;
    the compared pixels were seen by both at the start.
    """
    rotation, center = start
    root = np.sqrt(weight)[:, None]
    for _ in range(_STEPS):
        at = _evaluate(second, pixel, point, rotation, center, shifted=shifted)
        design = (root[:, :, None] * at.by_alignment).reshape(-1, at.by_alignment.shape[-1])
        misfit = (root * at.difference).ravel()
        step = np.negative(np.linalg.lstsq(design, misfit, rcond=None)[0], dtype=np.float64)
        rotation = exp_so3(step[:3]) @ rotation
        center = center + step[3:] if shifted else center
        moved = at.by_alignment @ step
        if np.abs(moved).max() < _MIN_CHANGE_PX:
            return _evaluate(second, pixel, point, rotation, center, shifted=shifted)
    raise GeometryError(
        f"no turn fits camera {second.name!r} to the other one: their lenses have too little in "
        "common to be compared"
    )


def _evaluate(
    second: Calibration,
    pixel: Floats,
    point: Floats,
    rotation: Floats,
    center: Floats,
    *,
    shifted: bool,
) -> _Alignment:
    turned = (point - center) @ rotation.T
    have, by_turned, by_second = project_with_jacobian(
        second.model, second.parameters, turned, beyond_fold="extend"
    )
    by_point = by_turned @ rotation
    # exp(step) @ x = x + step x x = x - hat(x) @ step
    by_turn = -by_turned @ hat(turned)
    by_alignment = np.concatenate([by_turn, -by_point], axis=-1) if shifted else by_turn
    return _Alignment(rotation, center, have - pixel, by_alignment, by_point, by_second)


def _covariance(
    at: _Alignment, by_first: Floats, cameras: tuple[Calibration, Calibration], weight: Floats
) -> Floats:
    """Compute (N, 2, 2) covariances of the differences after the fitted rotation.

    First order: the rotation follows the errors of both calibrations by least squares, so that d
    difference = (I - A A+) (B d second + C d first), with A+ the weighted pseudo-inverse.
    """
    first, second = cameras
    a = at.by_alignment.reshape(-1, at.by_alignment.shape[-1])
    root = np.repeat(np.sqrt(weight), 2)[:, None]
    result = np.zeros((len(at.difference), 2, 2))
    for camera, by_parameters in ((first, at.by_point @ by_first), (second, at.by_second)):
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
