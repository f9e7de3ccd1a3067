"""What was looked for so far: what was found, and what was tried without it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from uavgram.model.arrays import Bools, Floats

Pair = tuple[str, str]
"""A photo and a label."""


CONTRADICTED = "what looks like it has moved, or is something else: the other photos contradict it"


RAISED_PX = 0.5
"""Sigma that is added to finds of what stands off the ground: what is seen behind its edges is
another thing in each photo (on rendered streets they were off by 0.2 to 0.5 px)."""


def pick_sigmas(covariance_px2: Floats, is_raised: Bools) -> Floats:
    """(n,) sigmas of picks that are made of finds: of the matching, in its worse direction.

    Parameters
    ----------
    covariance_px2
        (n, 2, 2) of the matching; NaN where nothing was found.
    is_raised
        (n,) whether what was found stands off the ground.
    """
    worse = np.sqrt(np.linalg.eigvalsh(np.nan_to_num(covariance_px2))[:, 1])
    return np.asarray(np.hypot(worse, np.where(is_raised, RAISED_PX, 0.0)))


@dataclass(frozen=True)
class Found:
    """A label found in a photo.

    Attributes
    ----------
    pick
        Number of the pick that it was found from.
    pixel_px
        (u, v).
    sigma_px, score
        Of the matching alone, in its worse direction; and how alike both places look, 0 to 1.
    radius_px
        Half the length of the region that was searched.
    """

    pick: int
    pixel_px: tuple[float, float]
    sigma_px: float
    score: float
    radius_px: float

    def missed(self, why: str) -> Missed:
        """The same, taken back."""
        return Missed(self.pick, self.radius_px, why, self.pixel_px)


@dataclass(frozen=True)
class Missed:
    """A label that was looked for in a photo in vain.

    Attributes
    ----------
    pick, radius_px
        As of `Found`.
    why
        Why not, in words.
    pixel_px
        (u, v) of what looks like it, where the others contradict that.
    """

    pick: int
    radius_px: float
    why: str
    pixel_px: tuple[float, float] | None = None


@dataclass(frozen=True)
class Record:
    """The search so far, by photo and label.

    Attributes
    ----------
    found
        What stands.
    missed
        What was tried, in order.
    """

    found: Mapping[Pair, Found] = field(default_factory=dict)
    missed: Mapping[Pair, tuple[Missed, ...]] = field(default_factory=dict)

    def with_results(self, results: Mapping[Pair, Found | Missed]) -> Record:
        """The record after another round."""
        found, missed = dict(self.found), dict(self.missed)
        for pair, result in results.items():
            if isinstance(result, Found):
                found[pair] = result
            else:
                missed[pair] = (*missed.get(pair, ()), result)
        return Record(found, missed)

    def without(self, pairs: Mapping[Pair, str]) -> Record:
        """The record with some finds taken back, and why."""
        out = {pair: self.found[pair].missed(why) for pair, why in pairs.items()}
        rest = {pair: one for pair, one in self.found.items() if pair not in pairs}
        return replace(self, found=rest).with_results(out)

    def without_labels(self, labels: Collection[str]) -> Record:
        """The record as if some labels had not been looked for."""
        found = {pair: one for pair, one in self.found.items() if pair[1] not in labels}
        missed = {pair: all_ for pair, all_ in self.missed.items() if pair[1] not in labels}
        return Record(found, missed)

    @property
    def in_vain(self) -> dict[Pair, str]:
        """What was not found in the end, and why: contradicted, else the last reason."""
        left = {pair: tried for pair, tried in self.missed.items() if pair not in self.found}
        return {
            pair: CONTRADICTED if any(one.why == CONTRADICTED for one in tried) else tried[-1].why
            for pair, tried in left.items()
        }
