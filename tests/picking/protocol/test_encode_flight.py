"""The track that the page's map shows."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.picking.protocol.encode_flight import MAX_VERTICES, cut_track


def track(time_s: Floats) -> Track:
    """Ten metres a second to the east."""
    none = np.zeros(0)
    return Track(
        position_time_s=time_s,
        position_world_m=np.stack([10.0 * time_s, 0.0 * time_s, 50.0 + 0.0 * time_s], axis=1),
        attitude_time_s=none,
        world_from_body_xyzw=np.zeros((0, 4)),
        gimbal_time_s=none,
        world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=np.zeros(1),
        sigma_position_m=np.ones((1, 2)),
        sigma_attitude_rad=np.ones((1, 2)),
        source="none",
    )


@pytest.mark.parametrize(
    ("photos_s", "first_s", "last_s"),
    [([200.0, np.nan, 300.0], 175.0, 325.0), ([200.0], 195.0, 205.0), ([np.nan], 0.0, 1000.0)],
)
def test_it_goes_a_little_beyond_the_photos(
    photos_s: list[float], first_s: float, last_s: float
) -> None:
    vertices = cut_track(track(np.arange(0.0, 1000.5, 0.5)), np.array(photos_s))

    assert vertices[0, 0] == first_s
    assert vertices[-1, 0] == last_s
    assert len(vertices) <= MAX_VERTICES
    np.testing.assert_array_equal(vertices[:, 1], 10.0 * vertices[:, 0])
