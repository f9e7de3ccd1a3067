"""A result of which some points stand off the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource

# Height over the ground, its sigma, and where it is from.
HEIGHTS: dict[str, tuple[float, float, HeightSource]] = {
    "P09": (1.4, 0.03, "free"),
    "P14": (6.0, 0.12, "free"),
    "P15": (0.8, 0.0, "stated"),
    "P20": (2.5, 0.05, "stated"),
    "P21": (-0.3, 0.04, "found"),
}


def covariances(count: int) -> Floats:
    """(n, 3, 3) of unequal axes, which lie askew."""
    turn = Rotation.from_rotvec(np.random.default_rng(5).normal(0, 0.6, (count, 3))).as_matrix()
    sigma = np.array([0.12, 0.04, 0.02]) * np.linspace(1, 2, count)[:, None]
    made: Floats = np.einsum("nij,nj,nkj->nik", turn, sigma**2, turn)
    return made


def raised(result: Result, factor: float = 1.0) -> Result:
    """The same survey with some points off the ground, their covariances times a factor."""
    points = result.points
    rows = [points.label.index(label) for label in HEIGHTS]
    height, sigma = points.height_above_ground_m.copy(), points.height_sigma_m.copy()
    source, position = list(points.height_source), points.position_world_m.copy()
    in_space = np.full((len(points.label), 3, 3), np.nan)
    in_space[rows] = factor * covariances(len(rows))
    for row, (up, uncertain, known) in zip(rows, HEIGHTS.values(), strict=True):
        height[row], sigma[row], source[row] = up, uncertain, known
        position[row, 2] += up
    return replace(
        result,
        points=replace(
            points,
            position_world_m=position,
            height_above_ground_m=height,
            height_sigma_m=sigma,
            height_source=tuple(source),
            relative=replace(points.relative, covariance_m3=in_space),
        ),
    )
