"""The plane of most: as long as they are most, what the others do has no influence."""

import numpy as np
import pytest

from uavgram.geometry.ground.plane import fit_robust_plane

PLANE = np.array([2.0, 0.03, -0.02])


def heights(place: np.ndarray) -> np.ndarray:
    return np.asarray(PLANE[0] + place @ PLANE[1:])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("off", [0, 10, 18])
def test_points_off_the_plane_do_not_move_it(seed: int, off: int) -> None:
    rng = np.random.default_rng(seed)
    place = rng.uniform(-20, 20, (36, 2))
    true = heights(place)
    height = true + 0.01 * rng.standard_normal(36)
    height[:off] += rng.choice([0.9, 1.4, 2.5], off)

    found = fit_robust_plane(place, height, np.full(36, 0.03))

    assert found is not None
    assert np.abs(found - true).max() < 0.03


def test_exact_points_give_the_exact_plane() -> None:
    place = np.random.default_rng(0).uniform(-20, 20, (9, 2))

    found = fit_robust_plane(place, heights(place), np.full(9, 0.03))

    assert found is not None
    np.testing.assert_allclose(found, heights(place), atol=1e-12)


@pytest.mark.parametrize(
    "place",
    [
        np.zeros((3, 2)),
        np.zeros((8, 2)),
        np.column_stack([np.arange(8.0), 2.0 * np.arange(8.0)]),
    ],
    ids=["few", "one place", "a line"],
)
def test_without_three_corners_there_is_no_plane(place: np.ndarray) -> None:
    assert fit_robust_plane(place, np.zeros(len(place)), np.ones(len(place))) is None
