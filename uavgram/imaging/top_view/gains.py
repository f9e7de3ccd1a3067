"""One factor of brightness for each photo, from what photos show of the same places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, triu

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints

LEAST_GREY, MOST_GREY = 8.0, 247.0
"""What is darker or brighter says nothing of the light: it may be cut off."""

LEAST_PLACES = 12
"""Two photos are compared where they show so many places together."""

MOST_GAIN = 2.5

DENSE = 500
"""Photos up to which their factors are solved for as a full matrix."""


class Light(NamedTuple):
    """(n,) places that a photo shows, increasing, and the logarithm of its grey value there."""

    place: Ints
    log_grey: Floats


def light_at(place: Ints, colours: Pixels | Floats) -> Light:
    """Of (n, 3) colours at (n,) places, those that say something of the light."""
    grey = np.asarray(colours, dtype=np.float64).mean(axis=1)
    good = (grey > LEAST_GREY) & (grey < MOST_GREY)
    return Light(place[good], np.log(grey[good]))


def gains_between(seen: Mapping[int, Light], count: int) -> Floats:
    """(N,) factors of the photos' brightness that make them alike where they show the same.

    Least squares on logarithms: the difference of the gains of two photos is the median ratio of
    what they show of the same ground, weighted by how much that is. Their mean stays as it is: a
    weak observation of each gain as one.

    Parameters
    ----------
    seen
        By photo; those that show nothing are not in it.
    count
        N, of all photos.
    """
    photos = list(seen)
    normal: dict[tuple[int, int], float] = {(k, k): 1.0 for k in range(count)}
    right = np.zeros(count)
    for one, other in _overlapping([seen[photo].place for photo in photos]):
        a, b = photos[one], photos[other]
        _, in_a, in_b = np.intersect1d(
            seen[a].place, seen[b].place, assume_unique=True, return_indices=True
        )
        difference = float(np.median(seen[b].log_grey[in_b] - seen[a].log_grey[in_a]))
        weight = float(len(in_a))
        normal[a, a] += weight
        normal[b, b] += weight
        normal[a, b] = normal[b, a] = -weight
        right[a] += weight * difference
        right[b] -= weight * difference
    row, column = np.array(list(normal)).T.reshape(2, -1)
    whole = coo_array((list(normal.values()), (row, column)), shape=(count, count))
    gains = np.exp(_solved(whole, right))
    return np.asarray(np.clip(gains, 1.0 / MOST_GAIN, MOST_GAIN))


def _solved(whole: coo_array, right: Floats) -> Floats:
    """(N,) solution of a symmetric system."""
    if len(right) <= DENSE:
        return np.asarray(np.linalg.solve(whole.toarray(), right))
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415 - slow to load

    return np.asarray(spsolve(whole.tocsc(), right))


def _overlapping(places: list[Ints]) -> list[tuple[int, int]]:
    """Pairs of photos that show enough places together: of thousands of photos, few."""
    photo = np.repeat(np.arange(len(places)), [len(each) for each in places])
    place = np.concatenate([np.zeros(0, np.int64), *places])
    size = len(places), int(place.max(initial=0)) + 1
    shows = coo_array((np.ones(len(photo)), (photo, place)), shape=size).tocsr()
    common = triu(shows @ shows.T, 1).tocoo()
    is_enough = common.data >= LEAST_PLACES
    pairs = np.column_stack([common.row, common.col])[is_enough]
    return [(int(a), int(b)) for a, b in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]]
