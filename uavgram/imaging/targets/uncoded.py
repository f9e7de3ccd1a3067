"""Measurement of uncoded targets near a known place: chequers, crosses and round targets.

The kind is recognised on rings about the centre. A two-by-two chequer changes its brightness four
times on each of them, along two straight lines through the centre; a cross eight times, along two
straight bars. A round target has outlines that are ellipses about one centre at many brightnesses.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from uavgram.imaging.patches import sample_grey
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.symmetry import SymmetryCentre, find_centre_of_symmetry
from uavgram.model.arrays import Bools, Floats

REACH_PX = 4.0
"""Largest distance of the centre from the place."""

LEAST_CONTRAST = 30.0
"""Least difference in grey values of the dark and the bright parts."""

LEAST_LIKENESS = 0.97
"""Least correlation of a target with itself after half a turn.

A target half in shadow or half hidden has less.
"""

MOST_SIGMA_PX = 0.25
"""Largest sigma in the worse direction."""

_LARGEST_PX = 40
_ANGLES = 64
_STRAIGHT_PX = 1.0
_LEAST_CROSSING = 0.45  # radians between the lines of a chequer, or the bars of a cross
_NEAR_PX, _LEVELS, _LEAST_LEVELS = 24, 16, 4
_LEAST_AREA_PX, _FLATTEST, _LEAST_ROUND, _CONCENTRIC_PX = 30.0, 0.3, 0.9, 1.0
_WITHIN = 0.75  # of the radius of the visible lines: the surroundings are beyond it
_RIM = 1.1  # of a round target's outline: radius that is used


class Kind(Enum):
    """Kind of a target."""

    CHEQUER = "chequer"
    CROSS = "cross"
    DISC = "round target"


@dataclass(frozen=True, eq=False)
class UncodedTarget:
    """Target: its centre (2,) [px], sigma of a coordinate [px], correlation with itself turned.

    `half_axes_px` are those of its outline, the larger one first; for chequers and crosses the
    radius that was used.
    """

    kind: Kind
    pixel_px: Floats
    sigma_px: float
    score: float
    half_axes_px: tuple[float, float]

    def off_center_px(self, focal_px: float) -> float:
        """Compute how far the middle of the outline may be from the image of the target's middle.

        A circle of half axes a and b is tilted by t with cos t = b / a; its ends at distances D -+
        r sin t appear f r cos t / (D -+ r sin t) from its middle: their mean is off by a b sin t /
        f. Lines that cross in the middle cross there in any view.
        """
        a, b = self.half_axes_px
        sine = (1.0 - min(b / a, 1.0) ** 2) ** 0.5
        return a * b * sine / focal_px if self.kind is Kind.DISC else 0.0


def measure_uncoded_target(photo: Image, place_px: Floats) -> UncodedTarget | None:
    """Measure the target whose centre is at a place, to a few pixels; None where there is none.

    Parameters
    ----------
    photo
        (height, width) grey values.
    place_px
        (2,) expected place.
    """
    start = find_centre_of_symmetry(photo, place_px, 6.0 * np.eye(2))
    if start is not None and _is_near(start, place_px):
        rings = _rings(photo, start.pixel_px)
        for kind, radius in ((Kind.CHEQUER, _chequer(rings)), (Kind.CROSS, _cross(rings))):
            if radius:
                axes = radius * np.eye(2)
                return _measured(photo, kind, place_px, start.pixel_px, axes)
    ellipse = _ellipse(photo, place_px)
    if ellipse is None:
        return None
    return _measured(photo, Kind.DISC, place_px, *ellipse)


def _is_near(found: SymmetryCentre, place_px: Floats) -> bool:
    return bool(np.hypot(*(found.pixel_px - place_px)) <= REACH_PX)


def _measured(
    photo: Image, kind: Kind, place_px: Floats, start_px: Floats, axes_px: Floats
) -> UncodedTarget | None:
    """Measure a target from start values; None where it fails a test.

    Parameters
    ----------
    photo, place_px
        As for `measure_uncoded_target`.
    kind
        Kind of the target.
    start_px
        (2,) its centre, to a pixel.
    axes_px
        (2, 2) half axes of its outline, as columns.
    """
    found = find_centre_of_symmetry(photo, start_px, axes_px * (_RIM if kind is Kind.DISC else 1.0))
    if found is None or not _is_near(found, place_px) or found.likeness < LEAST_LIKENESS:
        return None
    if not found.worst_sigma_px <= MOST_SIGMA_PX:
        return None
    a, b = sorted(np.linalg.norm(axes_px, axis=0).tolist(), reverse=True)
    return UncodedTarget(kind, found.pixel_px, found.sigma_px, found.likeness, (a, b))


def _rings(photo: Image, center_px: Floats) -> Floats:
    """Sample grey values (radii 1 px, 2 px, ...; 64) on rings about a place."""
    angle = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    radius = np.arange(1.0, _LARGEST_PX + 1)[:, None]
    u, v = center_px[0] + radius * np.cos(angle), center_px[1] + radius * np.sin(angle)
    return sample_grey(photo, u, v, cv2.INTER_LINEAR).astype(np.float64)


def _bright(ring: Floats) -> Bools | None:
    """Mark the bright part (64,) of a ring; None where no target has such a ring."""
    low, high = ring.min(), ring.max()
    if high - low < LEAST_CONTRAST:
        return None
    bright = ring > 0.5 * (low + high)
    alike = (bright == np.roll(bright, _ANGLES // 2)).mean()
    return np.asarray(bright) if alike >= 0.9 else None


def _chequer(rings: Floats) -> float:
    """Find the radius [px] up to which rings show four fields; 0 where it is not a chequer."""
    first: Floats | None = None
    reach = 0
    low, high = rings[2].min(), rings[2].max()
    if not 0.25 < (rings[0].mean() - low) / max(high - low, 1.0) < 0.75:
        return 0.0  # the middle of four fields is neither black nor white
    for radius in range(3, _LARGEST_PX + 1):
        edge = _edges(rings[radius - 1], 4)
        if edge is None:
            break
        lines = _axes(edge, 2)
        first = lines if first is None else first
        if not (_as_before(lines, first, radius) and _apart(lines)):
            break
        reach = radius
    return _WITHIN * reach if reach >= 5 else 0.0


def _cross(rings: Floats) -> float:
    """Find the radius [px] up to which rings show two bars; 0 where it is not a cross."""
    first: Floats | None = None
    begin = reach = 0
    center = rings[0].mean()
    for radius in range(3, _LARGEST_PX + 1):
        ring = rings[radius - 1]
        edge = _edges(ring, 8)
        if edge is None:
            if first is None:
                continue
            break
        inside = (ring > 0.5 * (ring.min() + ring.max())) == (
            center > 0.5 * (ring.min() + ring.max())
        )
        bars = _axes(_middles(edge, inside), 2)
        first = bars if first is None else first
        begin = begin or radius
        if inside.mean() > 0.7 or not (_as_before(bars, first, radius) and _apart(bars)):
            break
        reach = radius
    return _WITHIN * reach if reach >= max(6, begin + 3) else 0.0


def _edges(ring: Floats, count: int) -> Floats | None:
    """Find the angles (count,) at which a ring turns bright or dark; None for another count."""
    bright = _bright(ring)
    if bright is None:
        return None
    at = np.flatnonzero(bright != np.roll(bright, -1))
    if len(at) != count:
        return None
    level = 0.5 * (ring.min() + ring.max())
    here, there = ring[at] - level, np.roll(ring, -1)[at] - level
    return np.asarray(2 * np.pi / _ANGLES * (at + here / (here - there)))


def _middles(edge: Floats, inside: Bools) -> Floats:
    """Compute the middle angles of the arcs between edges that are inside a bar."""
    following = np.append(edge[1:], edge[0] + 2 * np.pi)
    middle = 0.5 * (edge + following)
    own = inside[np.round(middle * _ANGLES / (2 * np.pi)).astype(int) % _ANGLES]
    return np.asarray(np.sort(middle[own] % (2 * np.pi)))


def _axes(angle: Floats, count: int) -> Floats:
    """Compute the directions (count,) of lines from both of their ends (2 count,), in order."""
    if len(angle) != 2 * count:
        return np.zeros(count)
    double = np.exp(2j * angle[:count]) + np.exp(2j * angle[count:])
    return np.asarray(0.5 * np.angle(double))


def _as_before(line: Floats, first: Floats, radius: int) -> bool:
    """Return whether lines at a radius coincide with those of the first ring, in any order."""
    off = np.abs(_between(line[:, None], first[None])).min(axis=1)
    return bool(off.max() * radius <= _STRAIGHT_PX + 0.05 * radius)


def _apart(line: Floats) -> bool:
    return bool(abs(_between(line[0], line[1])) >= _LEAST_CROSSING)


def _between(one: Floats, other: Floats) -> Floats:
    """Compute the angle between undirected lines, -pi/2 to pi/2."""
    return np.asarray((one - other + np.pi / 2) % np.pi - np.pi / 2)


def _ellipse(photo: Image, place_px: Floats) -> tuple[Floats, Floats] | None:
    """Find centre (2,) and half axes (2, 2) of the largest round outline about a place."""
    low = np.maximum(np.round(place_px).astype(int) - _LARGEST_PX, 0)
    part = photo[low[1] : low[1] + 2 * _LARGEST_PX + 1, low[0] : low[0] + 2 * _LARGEST_PX + 1]
    around = slice(_LARGEST_PX - _NEAR_PX, _LARGEST_PX + _NEAR_PX + 1)
    near = part[around, around]
    if not near.size or float(near.max()) - float(near.min()) < LEAST_CONTRAST:
        return None
    smooth = cv2.GaussianBlur(part, (0, 0), 0.7)
    levels = np.linspace(float(near.min()), float(near.max()), _LEVELS + 2)[1:-1]
    found = [(k, *one) for k, level in enumerate(levels) for one in _round(smooth > level)]
    found = [one for one in found if np.hypot(*(one[1] + low - place_px)) <= REACH_PX]
    if not found:
        return None
    center = np.array([one[1] for one in found])
    # Keep the concentric outlines; they must cover enough brightness levels.
    together = np.hypot(*(center - np.median(center, axis=0)).T) <= _CONCENTRIC_PX
    own = [one for one, here in zip(found, together, strict=True) if here]
    seen = sorted({one[0] for one in own})
    if len(seen) < _LEAST_LEVELS or levels[seen[-1]] - levels[seen[0]] < 0.5 * LEAST_CONTRAST:
        return None
    largest = max(own, key=lambda one: float(np.abs(np.linalg.det(one[2]))))
    return np.median(center[together], axis=0) + low, largest[2]


def _round(bright: Bools) -> list[tuple[Floats, Floats]]:
    """Find centres (2,) and half axes (2, 2) of the outlines that are ellipses."""
    outlines = cv2.findContours(bright.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    found = []
    for outline in outlines:
        area = cv2.contourArea(outline)
        low, high = outline[:, 0].min(axis=0), outline[:, 0].max(axis=0)
        is_cut = low.min() == 0 or (high >= np.array(bright.shape[::-1]) - 1).any()
        if area < _LEAST_AREA_PX or len(outline) < 8 or is_cut:
            continue
        center, axes, turn = cv2.fitEllipse(outline)
        share = area / max(np.pi / 4 * axes[0] * axes[1], 1.0)
        if _LEAST_ROUND < share < 1 / _LEAST_ROUND and min(axes) > _FLATTEST * max(axes):
            angle = np.deg2rad(turn)
            along = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            found.append((np.array(center), along * (0.5 * np.array(axes) + 0.5)))
    return found
