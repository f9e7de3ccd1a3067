"""Uncoded targets, found and measured by their symmetry: chequers, crosses and round targets.

Chequers, crosses and discs are unchanged by a half turn, in any affine view. So the centre is where
the differences I(c + d) - I(c - d) are least; neither shape, size nor brightness need be known.
Lines and plain ground are unchanged, too, but their centre is undetermined. The remaining places
are marks made by people, and few other objects.

The kind is recognised on rings about the centre. A two-by-two chequer changes its brightness four
times on each of them, along two straight lines through the centre; a cross eight times, along two
straight bars. A round target has outlines that are ellipses about one centre at many brightnesses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from uavgram.imaging.patches import (
    Fit,
    compute_slopes,
    compute_variance_growth,
    estimate_neighbour_correlation,
    fit_windows,
    sample_grey,
)
from uavgram.imaging.raster import Image, Weights
from uavgram.model.arrays import Bools, Floats, Ints

MODEL_SIGMA_PX = 0.03
"""Error of real cameras in addition to noise: uneven blur, sharpening, demosaicing.

Inner corners of OpenCV's chessboard photos scatter by 0.048 px, where noise alone explains 0.038
px; in rendered photos the error is less than 0.005 px.
"""

_LEAST_NOISE = 0.3  # of rounding to whole grey values: 1 / sqrt(12)
_RING = 4  # pixels beyond the requested ones: the effect of the spline's end has decayed there


class SymmetryCentre(NamedTuple):
    """Centre (2,) [px], its covariance (2, 2) [px^2] and the correlation of both halves, -1 to 1.

    `slope` [grey values/px] is the root mean square slope common to both halves, in the direction
    in which it is least.
    """

    pixel_px: Floats
    covariance_px2: Floats
    likeness: float
    slope: float

    @property
    def sigma_px(self) -> float:
        """Sigma of a coordinate in any direction, in a real photo."""
        return float(np.hypot(np.sqrt(np.trace(self.covariance_px2) / 2.0), MODEL_SIGMA_PX))

    @property
    def worst_sigma_px(self) -> float:
        """Sigma in the direction in which it is largest."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance_px2)[1]))


def find_centre_of_symmetry(
    photo: Image, start_px: Floats, axes_px: Floats
) -> SymmetryCentre | None:
    """Find the centre of symmetry near a place; None where there is none or the search diverges.

    Parameters
    ----------
    photo
        (height, width) grey values.
    start_px
        (2,) to about a pixel.
    axes_px
        (2, 2) half axes of the ellipse in which the picture is symmetric, as columns.
    """
    half = int(np.ceil(np.abs(axes_px).sum(axis=1).max())) + 1
    v, u = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    inside = ((np.linalg.inv(axes_px) @ np.stack([u.ravel(), v.ravel()])) ** 2).sum(axis=0) <= 1.0
    weight = inside.reshape(u.shape)
    start = np.array(start_px, np.float64)[None]
    surface = _Surface(photo, start[0], half + 1 + half // 2)

    def model(center: Floats, _: Ints) -> tuple[Floats, Floats]:
        around = surface.window(center[0], half + 1)
        if around is None:
            return np.full((1, inside.size), np.nan), np.zeros((1, 2, inside.size))
        odd = (around - around[::-1, ::-1])[1:-1, 1:-1]
        slope = np.stack(compute_slopes(around[None]), axis=1)
        # d/dc of I(c + d) - I(c - d): twice the slope where both halves are alike
        change = (slope - slope[..., ::-1, ::-1]) * weight
        return (odd * weight).reshape(1, -1), change.reshape(1, 2, -1)

    # no damping: differences over two pixels are not the exact derivatives of the residuals
    fit = fit_windows(model, start, damping=0.0)
    center = fit.state[0]
    value = surface.window(center, half)
    if value is None or not np.isfinite(fit.cost[0]):
        return None
    least = float(np.linalg.eigvalsh(fit.normal[0])[0])
    if least <= 0 or np.abs(center - start).max() > 0.5 * half:
        return None
    slope = float(np.sqrt(least / weight.sum()))
    return SymmetryCentre(center, _covariance(fit, weight), _likeness(value, weight), slope)


def compute_symmetry(photo: Image, center_px: Floats, radius_px: int) -> float:
    """Correlate both halves of a disc; -1 where the photo's edge cuts it.

    Parameters
    ----------
    photo
        (height, width) grey values.
    center_px
        (2,) its middle.
    radius_px
        Its radius.
    """
    value = _Surface(photo, center_px, radius_px).window(center_px, radius_px)
    if value is None:
        return -1.0
    v, u = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1]
    return _likeness(value, u**2 + v**2 <= radius_px**2)


def _covariance(fit: Fit, weight: Bools) -> Floats:
    """Compute the covariance of the centre from the differences of both halves.

    The sums go over both halves, so every difference occurs twice: with the variance q of the
    differences the covariance is 2 q N^-1. Correlated differences (JPEG, texture of the
    surroundings) count for fewer.
    """
    variance = max(fit.cost[0] / max(weight.sum() - 4.0, 1.0), 2 * _LEAST_NOISE**2)
    odd = fit.residual.reshape(1, *weight.shape)
    more = compute_variance_growth(estimate_neighbour_correlation(odd, weight.astype(np.float64)))
    return np.asarray(2.0 * variance * more * fit.inverse[0])


def _likeness(value: Floats, weight: Bools) -> float:
    here, there = value[weight], value[::-1, ::-1][weight]
    spread = float(here.std() * there.std())
    return float(((here - here.mean()) * (there - there.mean())).mean() / max(spread, 1e-9))


class _Surface:
    """Grey values about a place as a smooth surface: the cubic spline through all pixels.

    The usual four-point interpolation of pictures (`cv2.remap`) is not symmetric between pixels,
    and rounds places to 1/32 px: it moved centres of sharp targets by 0.03 px, where this spline
    moves them by less than 0.001 px.

    Parameters
    ----------
    photo
        (height, width) grey values.
    middle_px
        (2,) middle of the part that is cut out.
    half
        Least distance from the middle that can be evaluated.
    """

    def __init__(self, photo: Image, middle_px: Floats, half: int) -> None:
        size = np.array(photo.shape[1::-1])
        first = np.round(middle_px).astype(int) - half - _RING
        self._first = np.maximum(first, 0)
        u, v = self._first
        beyond = np.minimum(first + 2 * (half + _RING) + 1, size)
        part = photo[v : max(beyond[1], v), u : max(beyond[0], u)].astype(np.float64)
        self._size = np.array(part.shape[1::-1])
        self._knots = spline_filter(part, order=3, mode="mirror") if part.size else part

    def window(self, center_px: Floats, half: int) -> Floats | None:
        """Evaluate (2 half + 1, 2 half + 1) values about a place; None where some are outside."""
        first = center_px - self._first - half
        if not ((first >= 2) & (first + 2 * half <= self._size - 3)).all():
            return None
        u, v = np.floor(first).astype(int).tolist()
        side = 2 * half + 1
        knots = self._knots[v - 1 : v + side + 2, u - 1 : u + side + 2]
        across, down = (_knot_weights(float(share)) for share in first - [u, v])
        values = cv2.sepFilter2D(knots, -1, across, down, anchor=(0, 0))
        return np.asarray(values[:side, :side])


def _knot_weights(share: float) -> Floats:
    """Compute weights (4,) of the knots about a place in a cubic spline.

    The place is a share of a step beyond the second knot.
    """
    rest = 1.0 - share
    inner = [4.0 - 6.0 * s**2 + 3.0 * s**3 for s in (share, rest)]
    return np.array([rest**3, *inner, share**3]) / 6.0


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
                return _measure_target(photo, kind, place_px, start.pixel_px, axes)
    ellipse = _ellipse(photo, place_px)
    if ellipse is None:
        return None
    return _measure_target(photo, Kind.DISC, place_px, *ellipse)


def _is_near(found: SymmetryCentre, place_px: Floats) -> bool:
    return bool(np.hypot(*(found.pixel_px - place_px)) <= REACH_PX)


def _measure_target(
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
        if not (_coincides_with_first_ring(lines, first, radius) and _apart(lines)):
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
        if inside.mean() > 0.7 or not (
            _coincides_with_first_ring(bars, first, radius) and _apart(bars)
        ):
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


def _coincides_with_first_ring(line: Floats, first: Floats, radius: int) -> bool:
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


RADII_PX = (4, 7, 12)
"""Radii of the discs that are turned at each of the scales, as objects may be close to a target."""

SCALES = (1, 2, 4)

LEAST_SEARCH_LIKENESS = 0.6
"""Least correlation in the search, on the smoothed picture at whole pixels."""

LEAST_SEARCH_SPREAD = 8.0
"""Least standard deviation in grey values; the fields of a target differ by 30 or more."""

MAX_TARGETS = 16
"""Number of places that are measured: those with the strongest symmetry."""

LEAST_MEASURED_LIKENESS = 0.9
"""Least correlation of a target with itself after half a turn.

Less means another object, or a half hidden target.
"""


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
        one = _measure_place(grey, place, radius)
        if one is not None and holds(one.pixel_px[None])[0]:
            found.append(one)
    return _remove_parts(found)


def _remove_parts(found: list[SymmetricTarget]) -> list[SymmetricTarget]:
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
    found[inner] = np.where(
        (alike > LEAST_SEARCH_LIKENESS) & (spread > LEAST_SEARCH_SPREAD), alike * spread, 0
    )
    return found


def _measure_place(grey: Image, place_px: Floats, radius_px: float) -> SymmetricTarget | None:
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
