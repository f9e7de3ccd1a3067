"""Squares on a plane, whatever its slope."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.ground.polygons import squares_on_plane


def test_sides_and_diagonals_are_those_of_a_square_that_lies_on_the_plane() -> None:
    slope, turn = np.array([0.3, -0.2]), np.deg2rad([0.0, 33.0, 250.0])
    middle = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [-5.0, 4.0, 1.0]])
    corner = squares_on_plane(middle, slope, turn, 0.6)
    side = np.roll(corner, -1, axis=1) - corner
    np.testing.assert_allclose(np.linalg.norm(side, axis=-1), 0.6)
    diagonal = np.linalg.norm(corner[:, [2, 3]] - corner[:, [0, 1]], axis=-1)
    np.testing.assert_allclose(diagonal, 0.6 * np.sqrt(2.0))
    away = corner - middle[:, None]
    np.testing.assert_allclose(away[..., 2], away[..., :2] @ slope, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(side[:, 0, 1], side[:, 0, 0]) % (2 * np.pi), turn)
    assert (np.cross(side[:, 0], side[:, 1])[:, 2] > 0).all()  # counterclockwise
