"""Rotations: vectors, quaternions (x, y, z, w), yaw-pitch-roll and matrices, all batched.

A rotation matrix ``a_from_b`` converts coordinates in b to coordinates in a. A rotation vector is
axis times angle [rad].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats


def lengths_of(vectors: Floats) -> Floats:
    """Compute the lengths (...) of vectors (..., n).

    For a few vectors numpy's `norm` takes three times as long.
    """
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1)))


_NEXT, _AFTER_NEXT = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Floats, b: Floats) -> Floats:
    """Compute cross products (..., 3) of vectors, whose other axes broadcast.

    For a few vectors numpy's `cross` takes four times as long.
    """
    return np.asarray(
        a.take(_NEXT, axis=-1) * b.take(_AFTER_NEXT, axis=-1)
        - a.take(_AFTER_NEXT, axis=-1) * b.take(_NEXT, axis=-1)
    )


def _constant(rows: list[list[float]]) -> Floats:
    matrix = np.array(rows)
    matrix.flags.writeable = False
    return matrix


#: North-east-down to east-north-up (its own inverse).
ENU_FROM_NED: Floats = _constant([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])

#: OpenCV camera (x right, y down, z forward) to gimbal (x optical axis, y right, z image down).
GIMBAL_FROM_CAMERA: Floats = _constant([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])

_IDENTITY = _constant([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]])

# Indices of x, y and z in a flattened matrix less its transpose.
_SKEW = np.array([5, 6, 1])

# Squared angle below which the series are more accurate than the closed forms, which cancel.
_SMALL_ANGLE_SQUARED = 0.09
# Sola's Jacobian (t - sin t) / t^3 = sum (-1)^k t^2k / (2k + 3)!
_RIGHT_SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800)
# Its inverse (1 - t/2 cot t/2) / t^2 = sum |B_2k| t^(2k - 2) / (2k)!, B the Bernoulli numbers
_INVERSE_SERIES = (
    1 / 12,
    1 / 720,
    1 / 30240,
    1 / 1209600,
    1 / 47900160,
    691 / 1307674368000,
)
# Cosine of pitch below which yaw and roll turn about one axis and only their sum is defined.
_LOCKED_COSINE = 1e-9


def hat(v: Floats) -> Floats:
    """Compute cross-product matrices: ``hat(v) @ w == cross(v, w)``; (..., 3) to (..., 3, 3)."""
    v = np.asarray(v, np.float64)
    matrix = np.zeros((*v.shape, 3))
    matrix[..., 2, 1] = v[..., 0]
    matrix[..., 1, 2] = -v[..., 0]
    matrix[..., 0, 2] = v[..., 1]
    matrix[..., 2, 0] = -v[..., 1]
    matrix[..., 1, 0] = v[..., 2]
    matrix[..., 0, 1] = -v[..., 2]
    return matrix


def exp_so3(v: Floats) -> Floats:
    """Compute rotation matrices of rotation vectors [rad] (Rodrigues); (..., 3) to (..., 3, 3)."""
    v = np.asarray(v, np.float64)
    half = 0.5 * lengths_of(v)
    # With sin(t / 2) / (t / 2) neither sin t / t nor (1 - cos t) / t^2 loses digits near zero.
    ratio = _sinc(half)
    return _combine(v, ratio * np.cos(half), 0.5 * ratio * ratio)


def log_so3(rotation: Floats) -> Floats:
    """Compute rotation vectors [rad] of matrices, angle at most pi; (..., 3, 3) to (..., 3).

    The computation goes through the quaternion, which is accurate near zero and near pi alike.
    """
    q = xyzw_from_matrix(rotation)
    vector, w = q[..., :3], q[..., 3]
    size = lengths_of(vector)
    tiny = size < 1e-12
    # angle / sin(angle / 2); its limit at zero is 2, where w is 1 to the last digit
    factor = np.where(tiny, 2.0, 2 * np.arctan2(size, w) / np.where(tiny, 1.0, size))
    return np.asarray(factor[..., None] * vector)


def right_jacobian(v: Floats) -> Floats:
    """Compute right Jacobians of SO(3): ``exp(v + d) = exp(v) exp(J d)`` to first order.

    Parameters
    ----------
    v
        (..., 3) rotation vectors [rad].

    Returns
    -------
    (..., 3, 3)
        After Sola, Deray, Atchuthan (2018), "A micro Lie theory", eq. 143.
    """
    v = np.asarray(v, np.float64)
    squared = np.add.reduce(v * v, axis=-1)
    first = -0.5 * _sinc(0.5 * np.sqrt(squared)) ** 2
    return _combine(v, first, _near_or_far(squared, _RIGHT_SERIES, _right_closed))


def exp_with_right_jacobian(v: Floats) -> tuple[Floats, Floats]:
    """Compute `exp_so3` and `right_jacobian` of the same vectors with shared steps.

    (..., 3) to (..., 3, 3) each, equal to the separate results to the last digit.
    """
    v = np.asarray(v, np.float64)
    squared = np.add.reduce(v * v, axis=-1)
    half = 0.5 * np.sqrt(squared)
    ratio, cross = _sinc(half), hat(v)
    square = cross @ cross
    closed = _near_or_far(squared, _RIGHT_SERIES, _right_closed)
    return (
        _sum(cross, square, ratio * np.cos(half), 0.5 * ratio * ratio),
        _sum(cross, square, -0.5 * ratio**2, closed),
    )


def right_jacobian_inverse(v: Floats) -> Floats:
    """Compute inverse right Jacobians: ``log(exp(v) exp(d)) = v + J^-1 d`` to first order.

    Parameters
    ----------
    v
        (..., 3) rotation vectors [rad], shorter than 2 pi.

    Returns
    -------
    (..., 3, 3)
        After Sola, Deray, Atchuthan (2018), eq. 144.
    """
    v = np.asarray(v, np.float64)
    squared = np.add.reduce(v * v, axis=-1)
    second = _near_or_far(squared, _INVERSE_SERIES, _inverse_closed)
    return _combine(v, np.full_like(squared, 0.5), second)


def matrix_from_xyzw(xyzw: Floats) -> Floats:
    """Convert quaternions (x, y, z, w) of any length to matrices; NaN for the zero quaternion.

    (..., 4) to (..., 3, 3).
    """
    q = np.asarray(xyzw, np.float64)
    squared = np.sum(q * q, axis=-1)
    # R = I + 2 w/|q|^2 hat(v) + 2/|q|^2 hat(v)^2
    second = 2 / np.where(squared > 0, squared, np.nan)
    return _combine(q[..., :3], second * q[..., 3], second)


def xyzw_from_matrix(rotation: Floats) -> Floats:
    """Convert rotation matrices (..., 3, 3) to unit quaternions (x, y, z, w), w >= 0; (..., 4)."""
    r = np.asarray(rotation, np.float64)
    # 4 q q^T is linear in R (Shepperd 1978); its row with the largest diagonal has no cancellation.
    outer = np.empty((*r.shape[:-2], 4, 4))
    trace = r[..., 0, 0] + r[..., 1, 1] + r[..., 2, 2]
    outer[..., :3, :3] = r + np.swapaxes(r, -1, -2)
    diagonal = np.empty(outer.shape[:-1])
    diagonal[..., :3] = (1 - trace)[..., None] + 2 * r.diagonal(axis1=-2, axis2=-1)
    diagonal[..., 3] = 1 + trace
    outer.reshape(*trace.shape, 16)[..., ::5] = diagonal
    skew = np.swapaxes(r, -1, -2) - r
    axis = skew.reshape(*trace.shape, 9)[..., _SKEW]
    outer[..., 3, :3] = outer[..., :3, 3] = axis
    best = diagonal.argmax(axis=-1)
    each = outer.reshape(-1, 4, 4)
    q = each[np.arange(len(each)), best.ravel()].reshape(outer.shape[:-1])
    q /= lengths_of(q)[..., None]
    return np.asarray(np.where(q[..., 3:] < 0, -q, q))


def matrix_from_ypr(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Floats:
    """Compute rotation matrices Rz(yaw) Ry(pitch) Rx(roll) of angles [rad].

    This is the attitude of ArduPilot and PX4: intrinsic Z-Y-X, ``ned_from_body``.

    Parameters
    ----------
    yaw, pitch, roll
        (...) each; they broadcast.

    Returns
    -------
    (..., 3, 3)
    """
    angles = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (yaw, pitch, roll)))
    cy, cp, cr = (np.cos(a) for a in angles)
    sy, sp, sr = (np.sin(a) for a in angles)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def ypr_from_matrix(rotation: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute yaw, pitch, roll [rad] of rotation matrices ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Parameters
    ----------
    rotation
        (..., 3, 3).

    Returns
    -------
    yaw, pitch, roll : (...)
        Pitch within +-pi/2. Looking straight up or down (pitch +-pi/2) yaw and roll turn about the
        same axis: roll is zero there, and yaw takes the whole turn.
    """
    r = np.asarray(rotation, np.float64)
    cosine = np.hypot(r[..., 0, 0], r[..., 1, 0])
    pitch = np.arctan2(-r[..., 2, 0], cosine)
    locked = cosine < _LOCKED_COSINE
    yaw = np.where(
        locked,
        np.arctan2(-r[..., 0, 1], r[..., 1, 1]),
        np.arctan2(r[..., 1, 0], r[..., 0, 0]),
    )
    # Roll is the rotation that remains after removing this yaw, so the three are consistent.
    sin_yaw, cos_yaw = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(
        sin_yaw * r[..., 0, 2] - cos_yaw * r[..., 1, 2],
        cos_yaw * r[..., 1, 1] - sin_yaw * r[..., 0, 1],
    )
    return yaw, pitch, roll


def nearest_rotation(matrix: Floats) -> Floats:
    """Compute the rotations nearest to matrices M (..., 3, 3): largest trace of ``R^T M``.

    With M = sum of a b^T it is also the rotation that best turns the vectors b onto a (Kabsch 1976,
    "A solution for the best rotation to relate two sets of vectors"; Umeyama 1991 for the sign).
    """
    left, _, right = np.linalg.svd(matrix)
    left[..., 2] *= np.linalg.det(left @ right)[..., None]
    return np.asarray(left @ right)


def _combine(v: Floats, first: Floats, second: Floats) -> Floats:
    """Compute ``I + first hat(v) + second hat(v)^2``."""
    cross = hat(v)
    return _sum(cross, cross @ cross, first, second)


def _sum(cross: Floats, square: Floats, first: Floats, second: Floats) -> Floats:
    """Compute ``I + first cross + second square``."""
    return np.asarray(_IDENTITY + first[..., None, None] * cross + second[..., None, None] * square)


def _sinc(angle: Floats) -> Floats:
    """Compute sin(t) / t, 1 at zero."""
    return np.divide(np.sin(angle), angle, out=np.ones_like(angle), where=angle != 0)


def _near_or_far(
    squared: Floats, series: tuple[float, ...], closed: Callable[[Floats], Floats]
) -> Floats:
    """Evaluate a function of the squared angle: series for small angles, else closed form."""
    small = squared < _SMALL_ANGLE_SQUARED
    near = _horner(series, squared)
    if small.all():
        return near
    return np.where(small, near, closed(np.where(small, 1.0, squared)))


def _right_closed(squared: Floats) -> Floats:
    angle = np.sqrt(squared)
    return np.asarray((angle - np.sin(angle)) / (squared * angle))


def _inverse_closed(squared: Floats) -> Floats:
    half = 0.5 * np.sqrt(squared)
    return np.asarray((1 - half / np.tan(half)) / squared)


def _horner(coefficients: tuple[float, ...], x: Floats) -> Floats:
    *lower, highest = coefficients
    result = np.full_like(x, highest)
    for coefficient in reversed(lower):
        result = result * x + coefficient
    return result
