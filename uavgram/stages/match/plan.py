"""What to look for next: the best-predicted places first, each from the pick that looks most alike.

The more is found, the better the poses, and the smaller the regions that are left to search. So a
round takes only what is predicted about as well as the best of what is left, and a place that was
not found is tried again from another pick, or once its region has become much smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.measuring.transferred_pixels import Transferred
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.stages.match.found import Pair, Record

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
