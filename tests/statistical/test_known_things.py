"""Known things with the sigma they state: what is adjusted is as far from the truth as it says.

The thing is known far better than the picks tell it, so that the adjusted value's sigma is that of
the known thing: one that is counted twice, or on the wrong scale, breaks the bounds.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from adjusted_scenes import adjust_from_truth
from known_scenes import PLACES, known_scene
from scipy.stats import chi2

from uavgram.estimation.survey.observations.known import KnownRows, compute_known_rows
from uavgram.model.arrays import Floats

pytestmark = pytest.mark.statistical

TRIALS = max(16, int(os.environ.get("UAVGRAM_REPETITIONS", "0")))
TAIL = 0.0005


def errors(name: str) -> tuple[Floats, Floats]:
    """(n,) errors of all rows of many scenes in their sigmas; and (n,) sigmas over that stated."""
    found, share = [], []
    for seed in range(TRIALS):
        scene, truth = known_scene(seed, name)
        adjustment = adjust_from_truth(scene)
        assert adjustment is not None
        rows = compute_known_rows(adjustment.problem, adjustment.state, scene.survey.known)
        sigma = np.sqrt(adjustment.minimum.factor.variances(rows.columns, rows.gradient))
        found.append((rows.value - truth) / sigma)
        share.append(sigma / rows.sigma)
    return np.concatenate(found), np.concatenate(share)


def is_honest(error: Floats) -> bool:
    """Whether the mean square of errors in sigmas is what chance allows."""
    squares, degrees = float(error @ error), len(error)
    return bool(chi2.ppf(TAIL, degrees) <= squares <= chi2.ppf(1 - TAIL, degrees))


@pytest.mark.parametrize("name", PLACES)
def test_errors_are_as_large_as_the_sigmas_say(name: str) -> None:
    error, share = errors(name)

    assert is_honest(error), float(np.mean(error**2))
    # The known thing decides, yet not alone: else nothing would be tested.
    assert 0.5 < np.median(share) < 1.0


@pytest.mark.parametrize("name", ["right_angle", "level"])
def test_a_sigma_taken_for_its_half_breaks_the_bounds(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = KnownRows.block
    monkeypatch.setattr(
        KnownRows, "block", lambda self: right(self._replace(sigma=0.5 * self.sigma))
    )

    assert not is_honest(errors(name)[0])
