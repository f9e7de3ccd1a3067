"""Rotations of many rotation vectors at once, with the number of the rotation as the last axis."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

SMALL_ANGLE_RAD = 1e-2
"""Angle below which series replace the closed forms, which suffer from cancellation [rad]."""


def rotate(base: Floats, vector: Floats) -> tuple[Floats, Floats]:
    """Compute ``base exp(v)``, and that times the right Jacobian of exp at v.

    Rodrigues' formula, and Sola, Deray, Atchuthan (2018), "A micro Lie theory", eq. 143.

    Parameters
    ----------
    base
        (3, 3, B) rotations.
    vector
        (3, B) rotation vectors [rad].

    Returns
    -------
    rotation, by_vector : (3, 3, B)
        The second converts a change of v into the rotation vector of its effect, in the world.
    """
    t2 = np.einsum("kb,kb->b", vector, vector)
    t = np.sqrt(t2)
    near = t < SMALL_ANGLE_RAD
    with np.errstate(invalid="ignore", divide="ignore"):
        sine, versine = np.sin(t), 1 - np.cos(t)
        a = np.where(near, 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42)), sine / t)
        b = np.where(near, 0.5 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56))), versine / t2)
        c = np.where(near, (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72))) / 6, (t - sine) / t2 / t)
    # exp = cos I + a [v] + b v v^T; its right Jacobian = a I - b [v] + c v v^T.
    rotation = np.einsum("ijb,jkb->ikb", base, _make_matrix(1.0 - b * t2, a, b, vector))
    jacobian = np.einsum("ijb,jkb->ikb", rotation, _make_matrix(a, -b, c, vector))
    return rotation, jacobian


def _make_matrix(diagonal: Floats, cross: Floats, outer: Floats, v: Floats) -> Floats:
    """Compute ``diagonal I + cross [v] + outer v v^T``, (3, 3, B)."""
    out = outer * v[:, None] * v[None]
    for k in range(3):
        out[k, k] += diagonal
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = cross * v[k]
        out[j, i] += turn
        out[i, j] -= turn
    return np.asarray(out)
