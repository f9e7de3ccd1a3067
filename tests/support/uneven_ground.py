"""A result whose ground is no plane at some of its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.result.reliability import AreaNoise, Noise, PickNoise
from uavgram.model.result.result import Result

DEPARTURE_M = {"P03": 0.031, "P08": -0.012, "P12": 0.004, "P21": -0.2}
SIGMA_M = 0.02
NOISE = Noise(
    picks=(PickNoise(source="hand", stated_px=1.0, factor=1.6, sigma=0.1),),
    roughness=(
        AreaNoise(
            area="default",
            stated_m=0.0,
            estimated_m=0.03,
            sigma_m=0.01,
            shape="quadratic",
            relief_m=0.05,
        ),
    ),
)


def uneven(result: Result) -> Result:
    """The same survey with four points off the plane; all others stay on it."""
    labels = result.points.label
    departure = np.array([DEPARTURE_M.get(label, 0.0) for label in labels])
    sigma = np.array([SIGMA_M * (label in DEPARTURE_M) for label in labels])
    points = replace(result.points, departure_m=departure, departure_sigma_m=sigma)
    return replace(result, points=points, noise=NOISE)
