"""Ground below points: a plane for each area, and relief where it has any."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.plane import (
    Basis,
    evaluate_correlated_basis,
    evaluate_quadratic_basis,
    knots_root,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Ground, Relief, Survey

PLANE_SIZE = 3
"""Number of unknowns of a plane: height at the pivot [m], slope east, slope north."""


class SurfaceAt(NamedTuple):
    """Ground at n places.

    Attributes
    ----------
    height_m
        (n,) up.
    slope
        (n, 2) d up / d east, d up / d north.
    by_unknowns
        (n, w) derivatives of the height by the ground's own unknowns, see `GroundPlanes.columns`.
    """

    height_m: Floats
    slope: Floats
    by_unknowns: Floats


class PlanePrior(NamedTuple):
    """Prior of one area's plane: mean and sigma (3,), and the first of its unknowns."""

    area: str
    mean: Floats
    sigma: Floats
    first: int


class GroundPlanes:
    """Shape of the ground in the likelihood.

    The likelihood uses the ground only through `at` and `columns`: height, slope, and derivatives
    by unknowns of its own, at (east, north). An elevation model would be another class with these
    two methods, in which the height is a function of the place and an offset of its own is the
    unknown.

    Parameters
    ----------
    survey
        Survey, which holds the area of each label. With gauge ``plane`` the first area's plane is z
        = 0 and no unknown; the others are unknown, relative to it.
    pivot_m
        (A, 2) or (2,) places about which the slopes of each area turn.
    """

    def __init__(self, survey: Survey, pivot_m: Floats) -> None:
        grounds = survey.grounds
        self.pivot_m = np.array(np.broadcast_to(pivot_m, (len(grounds), 2)), dtype=np.float64)
        self._grounds = grounds
        self._area = survey.area
        self._fixed = count_fixed_planes(survey)
        self._planes = PLANE_SIZE * (len(grounds) - self._fixed)
        self._reliefs = list(_reliefs(grounds))
        self.size = self._planes + count_relief(survey)

    def at(self, planes: Floats, relief: Floats, label: Ints, east_north_m: Floats) -> SurfaceAt:
        """Compute the ground of n labels at their places (n, 2); for many states with leading axes.

        Parameters
        ----------
        planes
            (..., 3A) height at the pivot [m] and slopes of each area's plane.
        relief
            (..., R) coefficients of the areas' relief, one area after the other [m].
        label
            (n,) labels by index, which give the area of each place.
        east_north_m
            (..., n, 2) places.
        """
        area = self._area[label]
        plane = planes.reshape(*planes.shape[:-1], -1, PLANE_SIZE)[..., area, :]
        from_pivot = east_north_m - self.pivot_m[area]
        # Plane: height at the pivot + slope . (place - pivot).
        height = plane[..., 0] + np.einsum("...i,...i->...", plane[..., 1:], from_pivot)
        slope = np.array(plane[..., 1:])
        own = min(PLANE_SIZE, self._planes)
        by_unknowns = np.zeros((*height.shape, own + self._widest))
        if own:
            by_unknowns[..., 0], by_unknowns[..., 1:PLANE_SIZE] = 1.0, from_pivot
            by_unknowns[..., area < self._fixed, :] = 0.0
        # Relief: add coefficients times basis functions, with their gradients, area by area.
        for place, first, shape in self._reliefs:
            rows = np.flatnonzero(area == place)
            there = east_north_m[..., rows, :]
            basis = compute_relief_basis(shape, there.reshape(-1, 2))
            value = basis.value.reshape(*there.shape[:-1], shape.size)
            gradient = basis.gradient.reshape(*value.shape, 2)
            coefficient = relief[..., None, first : first + shape.size]
            height[..., rows] += np.einsum("...b,...b->...", value, coefficient)
            slope[..., rows, :] += np.einsum("...bi,...b->...i", gradient, coefficient)
            by_unknowns[..., rows, own : own + shape.size] = value
        return SurfaceAt(height, slope, by_unknowns)

    @property
    def _widest(self) -> int:
        """Largest number of coefficients of an area."""
        return max((shape.size for _, _, shape in self._reliefs), default=0)

    def columns(self, label: Ints) -> Ints:
        """Return the (n, w) ground unknowns of n labels, counted from the first.

        Those of the plane (3, or none), then those of the relief. For labels on a plane that is no
        unknown, or without relief, the columns are those of others, with derivatives of zero.
        """
        area = self._area[label]
        plane = np.maximum(area - self._fixed, 0)[:, None] * PLANE_SIZE + np.arange(PLANE_SIZE)
        relief = np.zeros((len(label), self._widest), dtype=np.int64)
        for place, first, shape in self._reliefs:
            own = self._planes + first + np.arange(shape.size)
            relief[area == place, : shape.size] = own
        return np.concatenate([plane[:, : self._planes], relief], axis=1)

    def priors(self) -> list[PlanePrior]:
        """Return the prior of every unknown plane, level about its stated height."""
        datum = self._grounds[0].height_m if self._fixed else 0.0
        return [
            PlanePrior(
                area=ground.name,
                mean=np.array([ground.height_m - datum, 0.0, 0.0]),
                sigma=np.array(
                    [ground.height_sigma_m, ground.slope_sigma_rad, ground.slope_sigma_rad]
                ),
                first=PLANE_SIZE * place,
            )
            for place, ground in enumerate(self._grounds[self._fixed :])
        ]

    @property
    def relief_sigma_m(self) -> Floats:
        """(R,) prior sigma of each coefficient of relief."""
        return np.concatenate([np.full(shape.size, shape.sigma_m) for *_, shape in self._reliefs])

    def relief_rows(self, area: int) -> Ints:
        """Return the rows of an area's coefficients of relief."""
        rows = [first + np.arange(shape.size) for at, first, shape in self._reliefs if at == area]
        return rows[0] if rows else np.zeros(0, dtype=np.int64)


def _reliefs(grounds: tuple[Ground, ...]) -> Iterator[tuple[int, int, Relief]]:
    """Yield index of the area, first of its coefficients, and relief, for all areas with relief."""
    first = 0
    for place, ground in enumerate(grounds):
        if ground.relief is not None:
            yield place, first, ground.relief
            first += ground.relief.size


def count_relief(survey: Survey) -> int:
    """Return the number R of coefficients of all areas' relief."""
    return sum(shape.size for _, _, shape in _reliefs(survey.grounds))


def compute_relief_basis(relief: Relief, east_north_m: Floats) -> Basis:
    """Compute the basis functions of a relief at places (n, 2)."""
    if relief.kind == "quadratic":
        return evaluate_quadratic_basis(east_north_m, relief.knots_m[0], relief.scale_m)
    return evaluate_correlated_basis(east_north_m, relief.knots_m, relief.scale_m, _root(relief))


@lru_cache(maxsize=8)
def _root(relief: Relief) -> Floats:
    """Return the whitening matrix of a relief's knots, equal in every state and adjustment."""
    return knots_root(relief.knots_m, relief.scale_m)


def count_fixed_planes(survey: Survey) -> int:
    """Return how many planes, counted from the first, are the gauge and no unknowns: 1 or 0."""
    return int(survey.gauge == "plane")


def make_first_planes(grounds: tuple[Ground, ...], height_m: float) -> Floats:
    """Return (3A,) level initial planes: the first at `height_m`, others at the stated offsets."""
    planes = np.zeros((len(grounds), PLANE_SIZE))
    planes[:, 0] = height_m + np.array([g.height_m - grounds[0].height_m for g in grounds])
    return planes.ravel()


def compute_area_centroids(survey: Survey, point_m: Floats) -> Floats:
    """Return (A, 2) medians of the points (K, 2) of each area; robust to points near the horizon.

    An area whose points were all left out gets the median of all points.
    """
    middle = np.median(point_m, axis=0)
    area = survey.area
    return np.stack(
        [
            np.median(point_m[area == a], axis=0) if (area == a).any() else middle
            for a in range(len(survey.grounds))
        ]
    )


class GroundBelow(NamedTuple):
    """Ground straight below k points.

    Attributes
    ----------
    feet
        (k, 3) places on it [m].
    is_determined
        (k,) whether the point determines its place on the ground: the point is on the ground, or at
        a height over it that is stated without a sigma. Then the foot moves with the point.
    sigma_m
        (k,) roughness of the ground there, its departure from the smooth one [m]; 0 where the point
        determines the place.
    """

    feet: Floats
    is_determined: Bools
    sigma_m: Floats


def find_ground_below(survey: Survey, label: Ints, points: Floats, feet: Floats) -> GroundBelow:
    """Compute the places on the ground below points, some of which are known to be on it.

    Parameters
    ----------
    survey
        Survey, which holds the heights of the points above the ground.
    label
        (k,) labels of the points, by index.
    points, feet
        (k, 3) points, and the places on the smooth ground straight below them [m].
    """
    is_determined = np.asarray((survey.height_sigma_m[label] == 0) & ~survey.is_free[label])
    roughness = np.array([survey.grounds[a].roughness_sigma_m for a in survey.area[label]])
    below = points - np.outer(survey.height_above_m[label], [0.0, 0.0, 1.0])
    return GroundBelow(
        np.where(is_determined[:, None], below, feet),
        is_determined,
        np.where(is_determined, 0.0, roughness),
    )
