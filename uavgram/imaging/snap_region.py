"""The one thing inside the region where a point is expected, or why none is taken.

Targets first: chequers, crosses and discs. Where there is none, and one may be meant, the corner
that stands out. The likeliest wins, by how much it stands out and by the region; where several are
about as likely and the pointer is on none of them, nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.raster import Image
from uavgram.imaging.snap import Snapped, snap_corner
from uavgram.imaging.targets.symmetric_places import symmetric_targets
from uavgram.model.arrays import Bools, Floats

WITHIN = 13.82
"""Squared distance in sigmas within which 99.9 % lie: chi-square of two degrees of freedom."""

AROUND_PX = 4.0
"""Beside the region: a pick's own error, and that of a place that is known exactly."""

WIDEST_PX = 250
"""Half the largest window that is searched."""

POINTED_PX = 4.0
"""Standard deviation of a click from the thing that was meant."""

SHARPNESS = 3
"""Power of how much targets stand out, as their likelihood.

Of 2, 3 and 4 the one that took fewest wrong ones on rendered streets, with what was expected
25 px away at a standard deviation of 10 px: of 249 searches for targets 197 ended at the right one
and 8 at another; of 54 for a corner of asphalt that is no target, 1 at something.
"""

SURE = 0.9
"""Probability from which one of several is the one."""

ALIKE = 0.6
"""Corners that stand out by so much of the most are as good."""

REACH_PX = 8.0
"""Of several, the one that the pointer is on counts as pointed at."""

SAME_PX = 3.0
"""What is measured so far from what was found is something else."""

MOST_SHOWN = 4
"""Of several that are about as likely."""

_BLOCK_PX = 5


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

    @classmethod
    def near(cls, pointer_px: Floats) -> Region:
        """What somebody pointed at."""
        return cls(pointer_px, POINTED_PX**2 * np.eye(2), pointer_px)

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


@dataclass(frozen=True, eq=False)
class Unclear:
    """Why nothing is taken, and the places (n, 2) [px] of things that are about as likely."""

    why: str
    place_px: Floats


def snap_within(photo: Pixels, region: Region, *, corners: bool) -> Snapped | Unclear:
    """The thing in a region that is meant, or why none is taken.

    Parameters
    ----------
    photo
        (height, width, 3) BGR.
    region
        Where it is expected.
    corners
        Whether a corner is meant where there is no target.
    """
    window = _window(photo, region)
    if window is None:
        return _nothing("it is expected outside this photo")
    grey, first = window
    targets = symmetric_targets(grey, lambda place: region.holds(place + first))
    if targets:
        place = np.array([one.pixel_px for one in targets]) + first
        strength = np.array([one.strength for one in targets])
        chosen = _chosen(place, strength**SHARPNESS, region)
        if isinstance(chosen, Unclear):
            return chosen
        u, v = place[chosen].tolist()
        return Snapped(u, v, targets[chosen].sigma_px, "target")
    if not corners:
        return _nothing("no target there: point at it")
    return _corner(photo, region, grey, first)


def _nothing(why: str) -> Unclear:
    return Unclear(why, np.empty((0, 2)))


def _corner(photo: Pixels, region: Region, grey: Image, first: Floats) -> Snapped | Unclear:
    """The corner that stands out in a region.

    Parameters
    ----------
    photo, region
        As of `snap_within`.
    grey, first
        The window that is searched, and its first pixel.
    """
    found = _corners(grey, lambda place: region.holds(place + first))
    if not len(found.strength):
        return _nothing("nothing there stands out: point at it")
    alike = found.place_px[found.strength >= ALIKE * found.strength.max()] + first
    chosen = _chosen(alike, np.ones(len(alike)), region)
    if isinstance(chosen, Unclear):
        return chosen
    exactly = snap_corner(photo, *alike[chosen].tolist())
    if not isinstance(exactly, Snapped):
        return _nothing(exactly)
    off = np.hypot(*(alike[chosen] - [exactly.u_px, exactly.v_px]))
    return exactly if off <= SAME_PX else _nothing("no clear corner there: point at it")


def _chosen(place_px: Floats, weight: Floats, region: Region) -> int | Unclear:
    """Which of several things is meant, by likelihood, else by the pointer.

    Parameters
    ----------
    place_px
        (n, 2) where they are.
    weight
        (n,) how likely each is wherever it lies.
    region
        How likely it is there.
    """
    likely = weight * np.exp(-0.5 * region.distance(place_px))
    best = int(np.argmax(likely))
    if likely[best] >= SURE * likely.sum():
        return best
    pointed = np.flatnonzero(np.linalg.norm(place_px - region.pointer_px, axis=1) <= REACH_PX)
    if len(pointed) == 1:
        return int(pointed[0])
    order = np.argsort(-likely)
    some = order[likely[order] >= (1 - SURE) / 2 * likely[best]][:MOST_SHOWN]
    why = f"{len(some)} things there are about as likely: point at the right one"
    return Unclear(why, place_px[some])


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
    """Corners, by the smaller eigenvalue of the structure tensor (Shi and Tomasi 1994)."""
    fine = cv2.GaussianBlur(grey, (0, 0), 1.0)
    return _peaks(cv2.cornerMinEigenVal(fine, _BLOCK_PX), holds)


def _peaks(strength: cv2.typing.MatLike, holds: Callable[[Floats], Bools]) -> _Found:
    """The highest places of a map, of those that are taken."""
    peak = strength >= cv2.dilate(strength, np.ones((2 * _BLOCK_PX + 1,) * 2, np.uint8))
    v, u = np.nonzero(peak & (strength > 0))
    place = np.column_stack([u, v]).astype(np.float64)
    return _Found(place, np.asarray(strength[v, u], np.float64)).those(holds(place))
