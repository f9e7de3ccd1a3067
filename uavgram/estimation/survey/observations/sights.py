"""How pixels of seen points hang on the unknowns: the chain of derivatives, row by row.

The chain is run from the pixels' side: what stands before it is both coordinates of each pixel,
which makes the Jacobian J, or one weighted sum of the two, which makes J^T v without J.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Sights:
    """n points as cameras see them, and what moves them there.

    Attributes
    ----------
    by_camera, by_lens
        (..., n, 2, 3), (..., n, 2, P) derivatives of pixels by points in camera axes and the lens.
    camera_from_world
        (..., n, 3, 3) rotations.
    by_point, by_ground
        (..., n, 3, point_size), (..., n, 3, w) derivatives of the points in the world by their own
        unknowns and by those of the ground.
    by_turn
        (..., n, 3, 3) derivatives of the points in camera axes by turns of the camera.
    lens
        (P, I) the lens by its unknowns.
    by_rest
        (..., n, 3, q) derivatives of the points in camera axes by what else moves them.
    """

    by_camera: Floats
    by_lens: Floats
    camera_from_world: Floats
    by_point: Floats
    by_ground: Floats
    by_turn: Floats
    lens: Floats
    by_rest: tuple[Floats, ...]

    def jacobian(self) -> Floats:
        """(..., n, 2, k) derivatives of the pixels."""
        return self._by_unknowns(self.by_camera, self.by_lens)

    def pulled(self, along: Floats) -> Floats:
        """(..., n, k) derivatives of sums of both coordinates with weights (..., n, 2)."""
        rows = along[..., None, :]
        return self._by_unknowns(rows @ self.by_camera, rows @ self.by_lens)[..., 0, :]

    def _by_unknowns(self, by_camera: Floats, by_lens: Floats) -> Floats:
        """(..., n, r, k) from (..., n, r, 3) and (..., n, r, P)."""
        by_world = by_camera @ self.camera_from_world
        # One product for all rows, where the stack's own would take one for each.
        many, (parameters, unknowns) = by_lens.shape[:-1], self.lens.shape
        by_intrinsic = by_lens.reshape(math.prod(many), parameters) @ self.lens
        parts = [
            by_world @ self.by_point,
            -by_world,
            by_camera @ self.by_turn,
            by_intrinsic.reshape(*many, unknowns),
            by_world @ self.by_ground,
            *(by_camera @ each for each in self.by_rest),
        ]
        return np.concatenate(parts, axis=-1)


class SightedBlock(Block):
    """Rows of which no Jacobian is formed before it is asked for: J^T v is had without it.

    Parameters
    ----------
    residual, columns
        As of any block.
    sights, weight
        The points, and (n,) one over the sigma of each coordinate.
    """

    _sights: Sights
    _weight: Floats

    def __init__(self, residual: Floats, columns: Ints, sights: Sights, weight: Floats) -> None:
        vars(self).update(residual=residual, columns=columns, _sights=sights, _weight=weight)

    @cached_property
    def jacobian(self) -> Floats:
        """(..., n, 2, k)."""
        return self._sights.jacobian() * self._weight[:, None, None]

    def pulled(self, along: Floats) -> Floats:
        """(..., n, k) products of (..., n, 2) with the Jacobian."""
        return self._sights.pulled(along * self._weight[:, None])
