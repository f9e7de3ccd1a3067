"""Detection of targets by their symmetry: chequers, crosses and discs are unchanged by a half turn.

Lines and plain ground are, too, but their centre is undetermined. The remaining places are marks
made by people, and few other objects.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.raster import Image, Weights
from uavgram.imaging.targets.symmetry import compute_symmetry, find_centre_of_symmetry
from uavgram.model.arrays import Bools, Floats

RADII_PX = (4, 7, 12)
"""Radii of the discs that are turned at each of the scales, as objects may be close to a target."""

SCALES = (1, 2, 4)

LEAST_LIKENESS = 0.6
"""Least correlation in the search, on the smoothed picture at whole pixels."""

LEAST_CONTRAST = 8.0
"""Least standard deviation in grey values; the fields of a target differ by 30 or more."""

MAX_TARGETS = 16
"""Number of places that are measured: those with the strongest symmetry."""

LEAST_MEASURED_LIKENESS = 0.9
"""Least correlation of a target with itself after half a turn.

Less means another object, or a half hidden target.
"""

MOST_SIGMA_PX = 0.25
"""Largest sigma in the worse direction."""

WIDER_PX = (6, 8, 10, 13, 17, 22, 28, 36, 48)
"""Radii of the discs from which the extent of a target is found."""

_MOST_OF_PART = 3.0  # largest ratio of a part's strength to that of the whole
_SMOOTH_PX = 1.0
_APART_PX = 3
_STAYS_PX = 3.0  # from the place at whole pixels to the measured one


@dataclass(frozen=True, eq=False)
class SymmetricTarget:
    """Target: its centre (2,) [px], and its sigma of a coordinate [px].

    `reach_px` is the radius in which the picture is unchanged by a half turn. `strength` is in grey
    values a pixel: the least slope over all directions that is the same on both sides, which
    determines the centre.
    """

    pixel_px: Floats
    sigma_px: float
    reach_px: float
    strength: float


def find_symmetric_targets(grey: Image, holds: Callable[[Floats], Bools]) -> list[SymmetricTarget]:
    """Find targets in a picture, the strongest first.

    Parameters
    ----------
    grey
        (height, width).
    holds
        Marks the places (n, 2) that are wanted.
    """
    found: list[SymmetricTarget] = []
    for place, radius in _places(grey, holds):
        one = _measured(grey, place, radius)
        if one is not None and holds(one.pixel_px[None])[0]:
            found.append(one)
    return _without_parts(found)


def _without_parts(found: list[SymmetricTarget]) -> list[SymmetricTarget]:
    """Remove parts of other targets: a field of a chequer is symmetric, too."""
    kept: list[SymmetricTarget] = []
    for one in sorted(found, key=lambda one: -one.reach_px * one.strength):
        for other in kept:
            apart = np.hypot(*(one.pixel_px - other.pixel_px))
            is_part = apart <= other.reach_px and one.reach_px <= other.reach_px
            if apart <= _APART_PX or (is_part and one.strength <= _MOST_OF_PART * other.strength):
                break
        else:
            kept.append(one)
    return sorted(kept, key=lambda one: -one.strength)


def _places(grey: Image, holds: Callable[[Floats], Bools]) -> list[tuple[Floats, float]]:
    """Find places (2,) to about a pixel, and the radius of symmetry of each."""
    found: list[tuple[float, Floats, float]] = []
    for scale in SCALES:
        size = (grey.shape[1] // scale, grey.shape[0] // scale)
        if min(size) <= 2 * RADII_PX[0]:
            break
        part = grey[: size[1] * scale, : size[0] * scale]
        small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
        smooth = np.asarray(cv2.GaussianBlur(small, (0, 0), _SMOOTH_PX), np.float32)
        for radius in RADII_PX if scale == 1 else RADII_PX[1:]:
            if min(size) <= 2 * radius:
                break
            value = _symmetry(smooth, radius)
            # Local maxima of the symmetry at wanted places.
            peak = value >= cv2.dilate(value, np.ones((2 * _APART_PX + 1,) * 2, np.uint8))
            v, u = np.nonzero(peak & (value > 0))
            place = np.asarray((np.column_stack([u, v]) + 0.5) * scale - 0.5, np.float64)
            own = holds(place)
            strong = value[v, u][own].tolist()
            found += [
                (float(s), at, float(radius * scale))
                for s, at in zip(strong, place[own], strict=True)
            ]
    found.sort(key=lambda one: -one[0])
    return [(place, radius) for _, place, radius in found[:MAX_TARGETS]]


def _symmetry(smooth: Weights, radius: int) -> Weights:
    """Compute how symmetric each place's disc is under a half turn [grey values]; else 0.

    It is the correlation times the standard deviation, where both are as large as those of targets.
    """
    height, width = smooth.shape
    inner = np.s_[radius : height - radius, radius : width - radius]
    middle = np.asarray(cv2.GaussianBlur(smooth, (0, 0), radius)[inner], np.float32)
    squares, turned = np.zeros_like(middle), np.zeros_like(middle)
    pairs = [
        (du, dv)
        for dv in range(-radius, radius + 1)
        for du in range(radius + 1)
        if du**2 + dv**2 <= radius**2 and (du > 0 or dv > 0)
    ]
    # Sums over opposite pixels: 2 a b and a^2 + b^2, so that their ratio is a correlation.
    for du, dv in pairs:
        one = smooth[radius + dv : height - radius + dv, radius + du : width - radius + du] - middle
        other = (
            smooth[radius - dv : height - radius - dv, radius - du : width - radius - du] - middle
        )
        turned += 2 * one * other
        squares += one * one + other * other
    spread, alike = np.sqrt(squares / (2 * len(pairs))), turned / np.maximum(squares, 1e-6)
    found = np.zeros_like(smooth)
    found[inner] = np.where((alike > LEAST_LIKENESS) & (spread > LEAST_CONTRAST), alike * spread, 0)
    return found


def _measured(grey: Image, place_px: Floats, radius_px: float) -> SymmetricTarget | None:
    """Measure the target at a place known to about a pixel; None where there is none."""
    found = find_centre_of_symmetry(grey, place_px, radius_px * np.eye(2))
    if found is None or np.hypot(*(found.pixel_px - place_px)) > _STAYS_PX + radius_px / 8:
        return None
    if found.likeness < LEAST_MEASURED_LIKENESS or not found.worst_sigma_px <= MOST_SIGMA_PX:
        return None
    reach = radius_px
    for wider in WIDER_PX:
        if wider > radius_px:
            if compute_symmetry(grey, found.pixel_px, wider) < LEAST_MEASURED_LIKENESS:
                break
            reach = float(wider)
    strength = found.likeness**2 * found.slope
    return SymmetricTarget(found.pixel_px, found.sigma_px, reach, strength)
