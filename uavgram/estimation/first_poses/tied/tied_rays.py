"""What is given, and what is found: sightings of tie points, and poses that explain them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.sparse import csr_array

from uavgram.model.arrays import Bools, Floats, FrozenArrays, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class TiedRays(FrozenArrays):
    """N sightings of T tie points in F frames; a frame sees a point at most once.

    Attributes
    ----------
    frame, point
        (N,) which frame sees which point.
    ray
        (N, 3) unit vectors towards it, in the camera.
    sigma_rad
        (N,) standard deviation of a ray, per axis.
    frames, points
        F and T.
    """

    frame: Annotated[Ints, "n"]
    point: Annotated[Ints, "n"]
    ray: Annotated[Floats, "n", 3]
    sigma_rad: Annotated[Floats, "n"]
    frames: int
    points: int

    def take(self, rows: Ints | Bools) -> TiedRays:
        """Some of the sightings, of the same frames and points."""
        return TiedRays(
            frame=self.frame[rows],
            point=self.point[rows],
            ray=self.ray[rows],
            sigma_rad=self.sigma_rad[rows],
            frames=self.frames,
            points=self.points,
        )

    def shared(self) -> Ints:
        """(F, F) how many points two frames have in common."""
        ones = np.ones(len(self.frame), dtype=np.int64)
        seen = csr_array((ones, (self.frame, self.point)), shape=(self.frames, self.points))
        return np.asarray((seen @ seen.T).todense())

    def of_pair(self, first: int, second: int) -> tuple[Ints, Ints]:
        """(m,), (m,) rows of the points that two frames have in common, alike ordered."""
        one, other = np.flatnonzero(self.frame == first), np.flatnonzero(self.frame == second)
        _, at_one, at_other = np.intersect1d(
            self.point[one], self.point[other], assume_unique=True, return_indices=True
        )
        return one[at_one], other[at_other]


@dataclass(frozen=True, kw_only=True, eq=False)
class TiedPoses:
    """Poses of frames that hang together, in axes and a scale of their own.

    Attributes
    ----------
    center, rotation
        (F, 3), (F, 3, 3) world from camera; NaN for frames that do not hang together with them.
    point
        (T, 3); NaN where no two rays of such frames tell.
    agrees
        (N,) sightings that fit by and large; the others are of frames without a pose, or wrong.
    spread_rad
        How far rays pass the points, per axis (root mean square of those that agree).
    """

    center: Floats
    rotation: Floats
    point: Floats
    agrees: Bools
    spread_rad: float

    @property
    def placed(self) -> Bools:
        """(F,) whether a frame has a pose."""
        return np.isfinite(self.center[:, 0])
