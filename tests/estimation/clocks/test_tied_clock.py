"""Offset of a camera's clock from ties: determined where a flight turns, refused where straight."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.clocks.tied_clock import FlightPoses, TiedClock, estimate_tied_clock
from uavgram.geometry.motion.rotation import exp_so3, matrix_from_ypr
from uavgram.model.arrays import Floats

SPAN_S = (0.0, 300.0)
OFFSET_S = 7.3


def turning(time_s: Floats) -> tuple[Floats, Floats]:
    """A way with bends, climbs and changes of pace that never come again."""
    t = np.asarray(time_s)
    east = 3.0 * t + 20.0 * np.sin(t / 11.0)
    north = 60.0 * np.sin((t / 45.0) ** 1.3)
    place = np.stack([east, north, 40.0 + 4.0 * np.sin(t / 23.0)], axis=1)
    heading = 0.8 * np.sin(t / 17.0)
    return place, matrix_from_ypr(heading, 0.05 * np.sin(t / 7.0), 0.05 * np.cos(t / 5.0))


def straight(time_s: Floats) -> tuple[Floats, Floats]:
    """One line at one pace."""
    zero = np.zeros(len(time_s))
    place = np.stack([5.0 * time_s, zero, zero + 40.0], axis=1)
    return place, matrix_from_ypr(zero, zero, zero)


def clock(flown: FlightPoses, first_s: float = 120.0, photos: int = 10) -> TiedClock | None:
    """By ties of photos every four seconds, in axes and a scale of their own, mounted aslant."""
    rng = np.random.default_rng(5)
    exposed: Floats = first_s + 4.0 * np.arange(photos, dtype=np.float64)
    place, body = flown(exposed)
    mount, turn = exp_so3(np.array([[2.0, 0.4, 0.3], [0.0, 0.0, 1.1]]))
    center = (place - [place[0, 0], place[0, 1], 0.0]) @ turn.T / 40.0
    own = turn @ body @ mount @ exp_so3(rng.normal(0.0, 0.002, (photos, 3)))
    center = center + rng.normal(0.0, 0.001, center.shape)
    noisy = place + rng.normal(0.0, 0.3, place.shape)

    def logged(time_s: Floats) -> tuple[Floats, Floats]:
        at, attitude = flown(time_s)
        return at + (noisy - place), attitude

    return estimate_tied_clock((center, own), exposed + OFFSET_S, logged, SPAN_S)


def test_the_offset_is_found_where_the_flight_turns() -> None:
    found = clock(turning)

    assert found is not None
    assert abs(found.offset_s - OFFSET_S) < 3.0 * found.sigma_s
    assert found.sigma_s < 0.3
    assert found.misfit < 1.5
    assert found.rival_s == ()


def test_on_a_straight_line_several_offsets_fit() -> None:
    found = clock(straight)

    assert found is not None
    assert len(found.rival_s) > 10


def test_no_photo_was_taken_where_the_vehicle_stood() -> None:
    def stood(time_s: Floats) -> tuple[Floats, Floats]:
        place, body = straight(time_s)
        return place * [0.0, 0.0, 1.0], body

    exposed: Floats = 100.0 + 2.0 * np.arange(8, dtype=np.float64)
    center, own = straight(exposed)

    assert estimate_tied_clock((center, own), exposed, stood, SPAN_S) is None


def test_photos_over_a_longer_time_than_the_log_have_no_offset() -> None:
    exposed: Floats = 100.0 * np.arange(8, dtype=np.float64)

    assert estimate_tied_clock(straight(exposed), exposed, straight, SPAN_S) is None
