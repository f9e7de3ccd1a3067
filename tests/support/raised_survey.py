"""A made-up survey of which some points stand off the ground, and with profiles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, ProfileResults

RAISED: dict[str, tuple[float, float, HeightSource]] = {
    "P00": (1.402, 0.021, "free"),
    "P13": (0.5, 0.0, "stated"),
    "P16": (2.25, 0.04, "stated"),
    "P26": (-0.8, 0.05, "free"),
}
"""Height over the ground and its sigma [m], and where they are from."""

PROFILE = ("P06", "P07", "P00", "P09")


def raised(result: Result) -> Result:
    """The result with those points raised from a ground at 0, and a profile over four of them."""
    rng = np.random.default_rng(5)
    labels = result.points.label
    count = len(labels)
    height, sigma = np.zeros(count), np.zeros(count)
    source: list[HeightSource] = ["ground"] * count
    for label, told in RAISED.items():
        k = labels.index(label)
        height[k], sigma[k], source[k] = told
    root = 0.05 * rng.normal(size=(count, 3, 3))
    position = np.array(result.points.position_world_m)
    position[:, 2] += height
    points = replace(
        result.points,
        position_world_m=position,
        height_above_ground_m=height,
        height_sigma_m=sigma,
        height_source=tuple(source),
        covariance_m3=root @ np.swapaxes(root, 1, 2),
    )
    rows = result.measurements
    value = np.array(rows.value)
    for i, kind in enumerate(rows.kind):
        if kind == "distance" and np.isfinite(value[i]):
            ends = position[[labels.index(label) for label in rows.points[i]]]
            value[i] = np.linalg.norm(ends[1] - ends[0])
    return replace(
        result,
        points=points,
        measurements=replace(rows, value=value),
        profiles=_profile(position, labels, height),
    )


def _profile(position: Floats, labels: tuple[str, ...], above: Floats) -> ProfileResults:
    rows = [labels.index(label) for label in PROFILE]
    along = position[rows[-1]] - position[rows[0]]
    along = along * [1.0, 1.0, 0.0] / np.linalg.norm(along[:2])
    away = position[rows] - position[rows[0]]
    right = away @ [along[1], -along[0], 0.0]
    up = away[:, 2]
    place = np.column_stack([away @ along, right, up, up - above[rows]])
    sigma = 0.02 + 0.01 * np.arange(4.0)[:, None] + np.arange(4.0) / 1000.0
    sigma[0] = 0.0
    return ProfileResults(
        profile=("over <the> car",) * 4, label=PROFILE, place_m=place, sigma_m=sigma
    )
