"""Scenes whose points stand off the ground, with heights that are to be found or were stated."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from scenes import Scene

from uavgram.model.arrays import Bools


def with_third_coordinates(
    scene: Scene, free: Collection[int] = (), stated: Mapping[int, float] | None = None
) -> Scene:
    """The scene with free heights of some labels, and sigmas of the stated heights of others."""
    labels = len(scene.survey.label)
    is_free: Bools = np.isin(np.arange(labels), list(free))
    sigma = np.zeros(labels)
    for label, size in (stated or {}).items():
        sigma[label] = size
    above = np.where(is_free, 0.0, scene.survey.height_above_m)
    survey = replace(scene.survey, height_above_m=above, height_sigma_m=sigma, is_free=is_free)
    point = np.zeros((labels, 3))
    point[:, : scene.truth.point.shape[1]] = scene.truth.point
    point[is_free, 2] += scene.survey.height_above_m[is_free]
    return replace(scene, survey=survey, truth=replace(scene.truth, point=point))
