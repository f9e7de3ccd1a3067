"""Which finds in one photo the others there contradict, before any adjustment rests on them.

Places in one photo are predicted with errors that they share: its pose. So what they are off
by must be as the joint covariance of their predictions has it, and a look-alike a hundred pixels
away stands out where it could not by its own prediction. The test is Baarda's, in the linear model
(Baarda 1968), for pairs of coordinates.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from uavgram.model.arrays import Bools, Floats

CONTRADICTED = float(chdtri(2, 1e-5))
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
        if fall.max() <= CONTRADICTED:
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
