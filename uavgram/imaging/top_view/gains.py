"""One factor of brightness for each photo, from what photos show of the same places."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints

LEAST_GREY, MOST_GREY = 8.0, 247.0
"""What is darker or brighter says nothing of the light: it may be cut off."""

LEAST_PLACES = 12
"""Two photos are compared where they show so many places together."""

MOST_GAIN = 2.5


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
    normal, right = np.eye(count), np.zeros(count)
    for a, b in combinations(seen, 2):
        _, in_a, in_b = np.intersect1d(
            seen[a].place, seen[b].place, assume_unique=True, return_indices=True
        )
        if len(in_a) < LEAST_PLACES:
            continue
        difference = float(np.median(seen[b].log_grey[in_b] - seen[a].log_grey[in_a]))
        weight = float(len(in_a))
        normal[[a, b], [a, b]] += weight
        normal[[a, b], [b, a]] -= weight
        right[a] += weight * difference
        right[b] -= weight * difference
    gains = np.exp(np.linalg.solve(normal, right))
    return np.asarray(np.clip(gains, 1.0 / MOST_GAIN, MOST_GAIN))
