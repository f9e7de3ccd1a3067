"""The variance that all corners have in common."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.estimation.calibration.reliability import estimate_common_error


@pytest.mark.parametrize("common", [0.1, 0.5, 2.0])
def test_the_common_part_is_recovered_beside_unequal_own_sigmas(common: float) -> None:
    rng = np.random.default_rng(0)
    own = rng.uniform(0.02, 0.4, 4000)
    residual = np.hypot(own, common)[:, None] * rng.standard_normal((4000, 2))
    found = estimate_common_error(residual, own, 8000)
    # a variance of 8000 draws is known to sqrt(2 / 8000); four of its sigmas, in the worst case
    total = np.mean(np.hypot(own, common) ** 2)
    assert found**2 == pytest.approx(common**2, abs=4 * np.sqrt(2 / 8000) * total)


def test_sigmas_that_are_large_enough_stay() -> None:
    rng = np.random.default_rng(1)
    own = np.full(500, 0.3)
    assert estimate_common_error(0.25 * rng.standard_normal((500, 2)), own, 1000) == 0.0
    assert estimate_common_error(np.zeros((0, 2)), np.zeros(0), 0) == 0.0


def test_unknowns_that_were_fitted_make_it_larger() -> None:
    residual = np.full((100, 2), 0.2)
    full, fitted = (estimate_common_error(residual, np.full(100, 0.01), n) for n in (200, 150))
    assert full == pytest.approx(np.sqrt(0.04 - 1e-4), rel=1e-6)
    assert fitted > full
