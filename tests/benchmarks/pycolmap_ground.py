"""The ground of points that another program found: where rays of picks meet it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats

NEAREST = 30
_TRIALS = 400
_FAR = 8.0  # robust sigmas above or below the plane: houses, wrong points


@dataclass(frozen=True, eq=False)
class Ground:
    """A plane normal . x = offset, and the points near it; the normal is up."""

    normal: Floats
    offset: float
    point: Floats

    def met(self, center: Floats, ray: Floats, near: int = 0) -> Floats:
        """(3,) where a ray meets the plane, lifted to the median of so many nearest points."""
        place, lift = center, 0.0
        for _ in range(3 if near else 1):
            along = (self.offset + lift - self.normal @ center) / (self.normal @ ray)
            place = center + along * ray
            if near:
                away = np.cross(self.point - place, self.normal)
                nearest = np.argpartition(np.sum(away**2, axis=1), near)[:near]
                lift = float(np.median(self.point[nearest] @ self.normal)) - self.offset
        return np.asarray(place)


def ground_of(point: Floats, center: Sequence[Floats]) -> Ground:
    """The plane with the least median distance of the points (n, 3), refined on those near it."""
    rng = np.random.default_rng(0)
    three = point[rng.integers(0, len(point), (_TRIALS, 3))]
    normal = np.cross(three[:, 1] - three[:, 0], three[:, 2] - three[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    offset = np.sum(normal * three[:, 0], axis=1)
    away = np.median(np.abs(point @ normal.T - offset), axis=0)
    best = int(np.argmin(np.where(np.linalg.norm(normal, axis=1) > 0.5, away, np.inf)))
    n, d = normal[best], float(offset[best])
    for _ in range(5):
        off = np.abs(point @ n - d)
        on = point[off < 2.5 * 1.4826 * np.median(off)]
        middle = on.mean(axis=0)
        n = np.linalg.svd(on - middle, full_matrices=False)[2][2]
        d = float(n @ middle)
    if float(np.mean([n @ c - d for c in center])) < 0:
        n, d = -n, -d
    off = np.abs(point @ n - d)
    return Ground(n, d, point[off < _FAR * 1.4826 * np.median(off)])
