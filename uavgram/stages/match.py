"""Match: which places to look for in other photos, what was found, and what contradicts it.

The more is found, the better the poses, and the smaller the regions that are left to search. So a
round takes only what is predicted about as well as the best of what is left, and a place that was
not found is tried again from another pick, or once its region has become much smaller.

Places in one photo are predicted with errors that they share: its pose. So what they are off
by must be as the joint covariance of their predictions has it, and a look-alike a hundred pixels
away stands out where it could not by its own prediction. The test is Baarda's, in the linear model
(Baarda 1968), for pairs of coordinates.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.measuring.transferred_pixels import Transferred
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.observations import Picks

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


@dataclass(frozen=True, kw_only=True)
class Matches:
    """What a search found.

    Attributes
    ----------
    path
        The table of picks.
    record
        Found and missed, by photo and label.
    labels
        Those that were looked for.
    picks
        Those that the table has now, or would have.
    replaced, kept
        Number of earlier matches whose pick was moved, or that fit no longer, and which are taken
        out; and of those that stay as they are.
    not_sought
        Labels that take no part in the adjustment, so that nobody knows where to look.
    unplaced
        Photos of which it is not known where they were taken.
    turned_rad
        By how much the camera looked elsewhere than mount and log have it, more than they may err;
        0: it did not.
    """

    path: str
    record: Record
    labels: tuple[str, ...]
    picks: Picks
    replaced: int
    kept: int = 0
    not_sought: tuple[str, ...] = ()
    unplaced: tuple[str, ...] = ()
    turned_rad: float = 0.0

    @property
    def sightings(self) -> dict[str, int]:
        """Of each label that was looked for, the number of photos in which the table has it."""
        count = dict.fromkeys(self.labels, 0)
        for label in self.picks.label:
            if label in count:
                count[label] += 1
        return count


REGION = float(chdtri(2, 0.001))
"""Squared sigmas from the middle of a region that holds 99.9 % to its edge."""

FINE_PX = 25.0
"""Radius of a region that is searched without waiting for better poses."""

BEST = 0.2
"""Share of the places left that a round takes at least."""

ALIKE = 1.5
"""Times the radius of those up to which others are taken too."""

NARROWED = 0.5
"""Share of its radius to which a region must have shrunk to be searched again."""


def radii(covariance_px2: Floats) -> Floats:
    """(n,) half lengths of the regions (n, 2, 2) that hold 99.9 % [px]."""
    return np.asarray(np.sqrt(REGION * np.linalg.eigvalsh(covariance_px2)[:, 1]))


def stretches(affine: Floats) -> Floats:
    """(n,) by how much a photo shows things larger, smaller or foreshortened: 0 is not at all."""
    size = np.linalg.svd(affine, compute_uv=False)
    return np.asarray(np.abs(np.log(np.maximum(size, 1e-9))).max(axis=1))


@dataclass(frozen=True, eq=False)
class Candidates:
    """n predicted places to choose from.

    Attributes
    ----------
    places
        The predictions.
    pair
        (n,) photo and label of each.
    pick
        (n,) number of the pick that each is predicted from.
    is_raised
        (n,) whether the label stands off the ground: what is seen behind its edges changes from
        photo to photo, so it waits for the poses that the ground gives.
    is_alone
        (n,) whether one photo alone shows such a label, so that nothing says how high it stands.
    """

    places: Transferred
    pair: tuple[Pair, ...]
    pick: Ints
    is_raised: Bools
    is_alone: Bools


def next_places(candidates: Candidates, wanted: Bools, record: Record) -> Ints:
    """Which places to look at in the next round; none where there is nothing left to try.

    Parameters
    ----------
    candidates
        n predicted places.
    wanted
        (n,) which are asked for.
    record
        The search so far.
    """
    places, pairs, picks = candidates.places, candidates.pair, candidates.pick
    radius, stretch = radii(places.covariance_px2), stretches(places.affine)
    best: dict[Pair, int] = {}
    for row in np.argsort(stretch, kind="stable").tolist():
        pair = pairs[row]
        open_ = wanted[row] and pair not in record.found and pair not in best
        if open_ and not candidates.is_alone[row]:
            tried = [m.radius_px for m in record.missed.get(pair, ()) if m.pick == picks[row]]
            if not tried or radius[row] < NARROWED * min(tried):
                best[pair] = row
    rows = np.array(sorted(best.values()), dtype=np.int64)
    if not candidates.is_raised[rows].all():
        rows = rows[~candidates.is_raised[rows]]
    if not rows.size:
        return rows
    limit = max(FINE_PX, ALIKE * float(np.quantile(radius[rows], BEST)))
    return rows[radius[rows] <= limit]


def lines_left(candidates: Candidates, wanted: Bools, record: Record) -> Ints:
    """Places of labels of unknown height to look at along their lines of sight, each pick once.

    Parameters
    ----------
    candidates
        n predicted places.
    wanted
        (n,) which are asked for.
    record
        The search so far.
    """
    over = record.missed.keys() | record.found.keys()
    is_open = np.array([pair not in over for pair in candidates.pair], dtype=np.bool_)
    return np.flatnonzero(candidates.is_alone & wanted & is_open)


CONTRADICTED_SQUARED = float(chdtri(2, 1e-5))
"""Squared sigmas of the difference from what the others let expect."""

AS_BAD = 0.7
"""Share of the worst one's squared sigmas from which another one may be the culprit as well."""

TURNED = float(chdtri(3, 1e-4))
"""Squared sigmas of the camera's direction on its mount from which on the log is not believed."""

CURVED = 0.03
"""Of how far a place is off, what the linear model may miss: a pose that is off by a degree or two
moves places by other amounts at its edges."""


def contradicted(off_px: Floats, covariance_px2: Floats, sigma_px: Floats) -> Bools:
    """(n,) which finds do not go together with the others.

    Parameters
    ----------
    off_px
        (n, 2) found less predicted.
    covariance_px2
        (2 n, 2 n) of the predictions.
    sigma_px
        (n,) of the finds.
    """
    n = len(off_px)
    noise = sigma_px**2 + (CURVED * np.linalg.norm(off_px, axis=1)) ** 2
    weight = np.linalg.inv(covariance_px2 + np.diag(np.repeat(noise, 2)))
    left = np.arange(n)
    while left.size:
        both = 2 * left[:, None] + np.arange(2)
        own = weight[both[:, :, None], both[:, None, :]]
        pull = (weight[:, both.ravel()] @ off_px[left].ravel())[both]
        fall = np.einsum("ni,ni->n", pull, np.linalg.solve(own, pull[..., None])[..., 0])
        if fall.max() <= CONTRADICTED_SQUARED:
            break
        out = both[fall >= AS_BAD * fall.max()].ravel()
        left = left[fall < AS_BAD * fall.max()]
        weight = weight - weight[:, out] @ np.linalg.solve(weight[np.ix_(out, out)], weight[out])
    return ~np.isin(np.arange(n), left)


def turned_rad(boresight_rad: Floats, sigma_rad: float) -> float:
    """By how much the camera looked elsewhere than mount and log have it; 0: within their errors.

    While the log's direction counts, what the photos show is drawn towards it: it is rather more.

    Parameters
    ----------
    boresight_rad
        (3,) rotation vector, adjusted.
    sigma_rad
        Of its prior, each axis.
    """
    angle = float(np.linalg.norm(boresight_rad))
    return angle if angle**2 > TURNED * sigma_rad**2 else 0.0
