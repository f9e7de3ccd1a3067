"""The one target or corner inside the region where a point is expected, or why none is taken.

What stands out most wins; where several things stand out alike, and the region does not tell them
apart, nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.raster import Image
from uavgram.imaging.snap import Snapped, snap_circle, snap_corner
from uavgram.model.arrays import Bools, Floats

WITHIN = 13.82
"""Squared distance in sigmas within which 99.9 % lie: chi-square of two degrees of freedom."""

AROUND_PX = 4.0
"""Beside the region: a pick's own error, and that of a place that is known exactly."""

WIDEST_PX = 400
"""Half the largest window that is searched."""

ALIKE = 0.6
"""What stands out by so much of the most is as good a target."""

SURE = 0.95
"""Probability, by the region alone, from which one of several is the one."""

REACH_PX = 8.0
"""Of several, the one that the pointer is on counts as pointed at."""

SAME_PX = 3.0
"""What is measured so far from what was found is something else."""

_LEVELS = 12
_LEAST_LEVELS = 4  # in which a target is round: stones and grass are in two or three
_LEAST_OUTLINE, _LEAST_AREA_PX = 8, 16.0
_FLATTEST, _LEAST_ROUND = 0.4, 0.85
_BLOCK_PX = 5
_CLEAR = 0.75  # a field's own corners are saddles of two thirds of the crossing's strength
_RING, _RING_PX, _ALIKE_FIELDS, _CONTRAST = 32, 4.0, 0.5, 0.2
_CONCENTRIC_PX = 2.5


@dataclass(frozen=True, eq=False)
class Region:
    """Where a point is expected: the pixel (2,), its covariance (2, 2), and the pointer (2,)."""

    pixel_px: Floats
    covariance_px2: Floats
    pointer_px: Floats

    def holds(self, place_px: Floats) -> Bools:
        """(n,) whether places (n, 2) lie in it."""
        return np.asarray(self.distance(place_px) <= WITHIN)

    def distance(self, place_px: Floats) -> Floats:
        """(n,) squared distances of places (n, 2), in sigmas."""
        off = place_px - self.pixel_px
        covariance = self.covariance_px2 + (AROUND_PX / 3.0) ** 2 * np.eye(2)
        solved = np.linalg.solve(covariance, off[..., None])[..., 0]
        return np.asarray(np.einsum("ni,ni->n", off, solved))

    @property
    def reach_px(self) -> Floats:
        """(2,) how far it goes from its middle, along u and v."""
        spread = np.diag(self.covariance_px2) + (AROUND_PX / 3.0) ** 2
        return np.asarray(np.minimum(np.sqrt(WITHIN * spread), WIDEST_PX))


@dataclass(frozen=True, eq=False)
class _Found:
    """Things (n, 2) in the photo, and how much each stands out (n,)."""

    place_px: Floats
    strength: Floats

    def those(self, which: Bools) -> _Found:
        """Some of them."""
        return _Found(self.place_px[which], self.strength[which])


def snap_corner_within(photo: Pixels, region: Region) -> Snapped | str:
    """The corner that stands out in a region, or why there is none.

    Parameters
    ----------
    photo
        (height, width, 3) BGR.
    region
        Where it is expected.
    """
    return _snapped(photo, region, _corners, "corner", snap_corner)


def snap_circle_within(photo: Pixels, region: Region) -> Snapped | str:
    """The round target that stands out in a region, or why there is none.

    Parameters
    ----------
    photo, region
        As for `snap_corner_within`.
    """
    return _snapped(photo, region, _circles, "round target", _exact_circle)


def _snapped(
    photo: Pixels,
    region: Region,
    find: Callable[[Image, Callable[[Floats], Bools]], _Found],
    name: str,
    exact: Callable[[Pixels, float, float], Snapped | str],
) -> Snapped | str:
    """The thing of one kind in a region.

    Parameters
    ----------
    photo, region
        Where to look.
    find
        Finds things of that kind in a window, of the places that it is told to take.
    name
        What people call it.
    exact
        Measures one from a place on it.
    """
    window = _window(photo, region)
    if window is None:
        return "it is expected outside this photo"
    grey, first = window
    found = find(grey, lambda place: region.holds(place + first))
    if not len(found.strength):
        return f"no {name} where it is expected: point at it"
    alike = found.place_px[found.strength >= ALIKE * found.strength.max()] + first
    chosen = _chosen(alike, region)
    if chosen is None:
        return f"{len(alike)} of them are where it is expected: point at the right one"
    exactly = exact(photo, float(chosen[0]), float(chosen[1]))
    if isinstance(exactly, Snapped):
        off = np.hypot(exactly.u_px - chosen[0], exactly.v_px - chosen[1])
        return exactly if off <= SAME_PX else f"no clear {name} where it is expected: point at it"
    return exactly


def _chosen(place_px: Floats, region: Region) -> Floats | None:
    """The one of several places (n, 2), by the region, else by the pointer; None: neither tells."""
    likely = np.exp(-0.5 * region.distance(place_px))
    if likely.max() >= SURE * likely.sum():
        return np.asarray(place_px[np.argmax(likely)])
    pointed = np.linalg.norm(place_px - region.pointer_px, axis=1) <= REACH_PX
    return np.asarray(place_px[pointed][0]) if np.count_nonzero(pointed) == 1 else None


def _window(photo: Pixels, region: Region) -> tuple[Image, Floats] | None:
    """Grey surroundings of a region with a margin for what lies on its edge, and their first pixel.

    None where the region is outside the photo.
    """
    height, width = photo.shape[:2]
    reach = region.reach_px + 24.0
    low = np.maximum(np.floor(region.pixel_px - reach), 0).astype(int)
    high = np.minimum(np.ceil(region.pixel_px + reach) + 1, [width, height]).astype(int)
    if (high - low < 2 * _BLOCK_PX).any():
        return None
    part = photo[low[1] : high[1], low[0] : high[0]]
    return np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY), dtype=np.uint8), low.astype(float)


def _corners(grey: Image, holds: Callable[[Floats], Bools]) -> _Found:
    """Where black and white fields cross, which nothing on the ground does by itself; else corners.

    Corners by the smaller eigenvalue of the structure tensor (Shi and Tomasi 1994); crossings are
    saddles of the brightness, by the determinant of its second derivatives.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.5).astype(np.float32)
    along, down, across = (
        cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1))
    )
    saddles = _peaks(np.sqrt(np.maximum(across**2 - along * down, 0.0)), holds)
    best = saddles.those(saddles.strength >= _CLEAR * saddles.strength.max(initial=0.0))
    if (crossing := best.those(_four_fields(grey, best.place_px))).strength.size:
        return crossing
    fine = cv2.GaussianBlur(grey, (0, 0), 1.0)
    return _peaks(cv2.cornerMinEigenVal(fine, _BLOCK_PX), holds)


def _peaks(strength: cv2.typing.MatLike, holds: Callable[[Floats], Bools]) -> _Found:
    """The highest places of a map, of those that are taken."""
    peak = strength >= cv2.dilate(strength, np.ones((2 * _BLOCK_PX + 1,) * 2, np.uint8))
    v, u = np.nonzero(peak & (strength > 0))
    place = np.column_stack([u, v]).astype(np.float64)
    return _Found(place, np.asarray(strength[v, u], np.float64)).those(holds(place))


def _four_fields(grey: Image, place_px: Floats) -> Bools:
    """(n,) whether four fields, bright and dark in turn, meet at places (n, 2)."""
    angle = 2 * np.pi * np.arange(_RING) / _RING
    ring = place_px[:, None] + _RING_PX * np.column_stack([np.cos(angle), np.sin(angle)])
    at = ring.astype(np.float32)
    value = cv2.remap(
        grey, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float64)
    low, high = np.percentile(grey, [1, 99])
    off = value - 0.5 * (value.min(axis=1) + value.max(axis=1))[:, None]
    changes = np.count_nonzero(np.diff(np.sign(off), axis=1, append=np.sign(off[:, :1])), axis=1)
    # Opposite fields are alike, neighbours are not.
    quarter, half = np.roll(off, _RING // 4, axis=1), np.roll(off, _RING // 2, axis=1)
    contrast = np.abs(off).mean(axis=1)
    alike = (off * half).mean(axis=1) > _ALIKE_FIELDS * (off**2).mean(axis=1)
    unlike = (off * quarter).mean(axis=1) < 0
    return np.asarray((changes == 4) & alike & unlike & (contrast > _CONTRAST * (high - low)))


def _circles(grey: Image, holds: Callable[[Floats], Bools]) -> _Found:
    """Round targets: outlines that are round at many brightnesses, one in the other counted once.

    The strength is the number of brightnesses.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), 0.7)
    low, high = (float(value) for value in np.percentile(smooth, [0.5, 99.5]))
    places: list[Floats] = []
    level: list[int] = []
    for k, cut in enumerate(np.linspace(low, high, _LEVELS + 2)[1:-1]):
        binary = (smooth > cut).astype(np.uint8)
        for outline in cv2.findContours(binary, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
            center = _round_center(np.asarray(outline[:, 0], np.float64))
            if center is not None:
                places.append(center)
                level.append(k)
    found = _concentric(np.array(places).reshape(-1, 2), np.array(level, dtype=np.int64))
    return found.those(holds(found.place_px))


def _round_center(outline_px: Floats) -> Floats | None:
    """Centre of an outline (n, 2) that is an ellipse; None of any other."""
    if len(outline_px) < _LEAST_OUTLINE:
        return None
    shape = outline_px.astype(np.float32)
    area = cv2.contourArea(shape)
    if area < _LEAST_AREA_PX:
        return None
    center, axes, _ = cv2.fitEllipse(shape)
    ellipse = np.pi / 4 * axes[0] * axes[1]
    # The outline runs through the middles of pixels, half a pixel inside of what they cover.
    is_round = _LEAST_ROUND < area / max(ellipse, 1.0) < 1 / _LEAST_ROUND
    return np.array(center) if is_round and min(axes) > _FLATTEST * max(axes) else None


def _concentric(center_px: Floats, level: np.ndarray[tuple[int], np.dtype[np.int64]]) -> _Found:
    """Centres (n, 2) that lie together as one, with the number of their levels (n,)."""
    left: Bools = np.ones(len(center_px), dtype=np.bool_)
    places, strengths = [], []
    while left.any():
        # The centre that has most others about it.
        away = np.linalg.norm(center_px[left, None] - center_px[None, left], axis=2)
        together = away <= _CONCENTRIC_PX
        best = int(np.argmax(together.sum(axis=1)))
        own = np.flatnonzero(left)[together[best]]
        places.append(np.median(center_px[own], axis=0))
        strengths.append(len(np.unique(level[own])))
        left[own] = False
    strength = np.array(strengths, dtype=np.float64)
    good = strength >= _LEAST_LEVELS
    return _Found(np.array(places).reshape(-1, 2)[good], strength[good])


def _exact_circle(photo: Pixels, u_px: float, v_px: float) -> Snapped | str:
    """A target measured from its middle, or from a ring of it where its middle is too small."""
    refused = "the target is too faint"
    for radius in (0.0, 4.0, 7.0, 11.0):
        for angle in np.arange(0.0, 2 * np.pi, np.pi / 2):
            at = u_px + radius * np.cos(angle), v_px + radius * np.sin(angle)
            found = snap_circle(photo, *at)
            if not isinstance(found, Snapped):
                refused = found if radius == 0.0 else refused
            elif np.hypot(found.u_px - u_px, found.v_px - v_px) <= _CONCENTRIC_PX:
                return found
            if radius == 0.0:
                break
    return refused
