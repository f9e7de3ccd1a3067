"""The third coordinate of points: how far each may be from where the ground puts it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey


@dataclass(frozen=True, eq=False)
class ThirdCoordinate:
    """What is known of the departure of each of K points, in metres up.

    A point lies at ground(east, north) + stated height + departure. Where the ground is smooth and
    the height exact, there is no departure; where any point of a survey has one, all have the
    unknown, and it is `idle` where nothing uses it.

    Attributes
    ----------
    rough, stated, free, idle
        Labels by index: on rough ground, at a height that was stated with a sigma, at a height of
        which nothing is known, and the rest.
    sigma_m
        (K,) of the departure; 1 where it is idle, and where it is free, of no meaning.
    """

    rough: Ints
    stated: Ints
    free: Ints
    idle: Ints
    sigma_m: Floats

    @classmethod
    def of(cls, survey: Survey) -> ThirdCoordinate:
        """Of the points of a survey."""
        roughness = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
        free, stated = survey.is_free, survey.height_sigma_m > 0
        departs = free | stated | (roughness > 0)
        beside = survey.ties.beside
        roughness[beside.label] *= beside.uneven
        sigma = np.hypot(roughness, survey.height_sigma_m)
        return cls(
            rough=np.flatnonzero((roughness > 0) & ~stated & ~free),
            stated=np.flatnonzero(stated & ~free),
            free=np.flatnonzero(free),
            idle=np.flatnonzero(~departs),
            sigma_m=np.where(departs & ~free, sigma, 1.0),
        )

    @property
    def is_unknown(self) -> bool:
        """Whether any point has a departure."""
        return len(self.idle) < len(self.sigma_m)

    @property
    def departs(self) -> Bools:
        """(K,) which points have one."""
        departs = np.ones(len(self.sigma_m), dtype=np.bool_)
        departs[self.idle] = False
        return departs

    def priors(self, departure_m: Floats) -> dict[str, Block]:
        """What is known of the departures (..., K), as rows; of a free point, none."""
        kinds = {"roughness": self.rough, "heights": self.stated, "idle": self.idle}
        return {kind: self._rows(label, departure_m) for kind, label in kinds.items() if len(label)}

    def _rows(self, label: Ints, departure_m: Floats) -> Block:
        weight = 1.0 / self.sigma_m[label]
        columns = 3 * label[:, None] + 2  # where any point departs, each has three unknowns
        return Block((departure_m[..., label] * weight)[..., None], columns, weight[:, None, None])
