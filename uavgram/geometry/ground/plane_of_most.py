"""The plane that most of some points lie on, where many lie above or below it."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

DRAWS = 400
"""Planes through three points that are tried: where 40 % of the points lie on one plane, all draws
miss it with a probability of 3e-12."""

FAR = 3.0
"""Sigmas beyond which a point does not lie on a plane: how far does not matter any more."""

STEEPEST = 0.5
"""Slope that no ground has."""

THIN = 0.02
"""Twice the area of three points, over the square of the extent, below which they make no plane."""

REFINEMENTS = 10


def plane_of_most(place_m: Floats, height_m: Floats, sigma_m: Floats) -> Floats | None:
    """Heights (n,), at all points, of the plane that most points lie on; None where there is none.

    Parameters
    ----------
    place_m
        (n, 2) east and north.
    height_m, sigma_m
        (n,) heights and by how much each may lie off the plane.

    References
    ----------
    Torr and Zisserman 2000, "MLESAC: a new robust estimator", sec. 3 (the sum of squares, cut off,
    as the measure of a draw).
    """
    extent = float(np.ptp(place_m, axis=0).max(initial=0.0))
    if len(place_m) < 4 or extent == 0.0:
        return None
    design = np.column_stack([np.ones(len(place_m)), (place_m - place_m.mean(axis=0)) / extent])
    drawn = _through_three(design, height_m)
    drawn = drawn[np.abs(drawn[:, 1:]).max(axis=1, initial=0.0) < STEEPEST * extent]
    if not len(drawn):
        return None
    off = ((height_m - drawn @ design.T) / sigma_m) ** 2
    plane = drawn[np.minimum(off, FAR**2).sum(axis=1).argmin()]
    for _ in range(REFINEMENTS):
        weight = (np.abs(height_m - design @ plane) < FAR * sigma_m) / sigma_m
        plane = np.linalg.lstsq(design * weight[:, None], height_m * weight, rcond=None)[0]
    return np.asarray(design @ plane)


def _through_three(design: Floats, height_m: Floats) -> Floats:
    """(m, 3) planes through three points drawn at random, always the same ones."""
    order = np.random.default_rng(0).random((DRAWS, len(design))).argpartition(2, axis=1)
    three = order[:, :3]
    three = three[np.abs(np.linalg.det(design[three])) > THIN]
    return np.asarray(np.linalg.solve(design[three], height_m[three][..., None])[..., 0])
