"""Poses from ties alone against the truth of made-up flights."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tied_flights import TWENTY, Conditions, TiedFlight, errors_of, tied_flight

from uavgram.estimation.first_poses.tied.bundle import (
    TiedPoses,
    fit_to_positions,
    level_scene,
    transform,
)
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.geometry.motion.rotation import exp_so3


def found_of(flight: TiedFlight) -> TiedPoses:
    """Poses that must be there."""
    found = estimate_tied_poses(flight.sightings)
    assert found is not None
    return found


@cache
def case(number: int) -> tuple[TiedFlight, TiedPoses]:
    """One of the twenty, and what is found of it."""
    flight = tied_flight(TWENTY[number])
    return flight, found_of(flight)


@pytest.mark.parametrize("number", [0, 4, 19])
def test_all_frames_are_placed_and_wrong_ties_found(number: int) -> None:
    flight, found = case(number)
    assert found.placed.all()
    turn_deg, off = errors_of(flight, found)
    assert turn_deg < 0.05
    assert off < 0.002
    assert not (found.agrees & flight.wrong).any()
    assert (found.agrees | flight.wrong).mean() > 0.99


def test_a_shutter_that_reads_rows_one_after_the_other() -> None:
    flight = tied_flight(replace(TWENTY[4], readout_s=0.03))
    found = found_of(flight)
    assert found.placed.all()
    turn_deg, off = errors_of(flight, found)
    assert turn_deg < 1.0
    assert off < 0.02


def test_the_same_ties_give_the_same_poses() -> None:
    flight = tied_flight(Conditions(photos=5, seed=3))
    one, other = found_of(flight), found_of(flight)
    np.testing.assert_array_equal(one.center, other.center)


def test_frames_that_nothing_joins_have_no_pose() -> None:
    flight = tied_flight(Conditions(photos=6, seed=1))
    rays = flight.sightings
    alone = rays.take(rays.frame != 5)
    found = estimate_tied_poses(alone)
    assert found is not None
    np.testing.assert_array_equal(found.placed, np.arange(6) != 5)
    assert estimate_tied_poses(rays.take(rays.frame == 5)) is None


def test_ground_and_positions_tell_the_axes() -> None:
    """On a flight along a line the roll about it is the ground's to tell."""
    for number in (0, 4):
        flight, found = case(number)
        aside = transform(found, exp_so3(np.array([0.5, 2.0, -1.0])), 3.0, np.ones(3))
        level = level_scene(aside)
        assert level is not None
        tilt = np.arccos(np.einsum("fi,fi->f", level.rotation[:, 2], flight.rotation[:, 2]))
        assert np.degrees(tilt.max()) < 0.3
        known = fit_to_positions(aside, flight.center, np.ones(len(flight.center), np.bool_))
        assert known is not None
        np.testing.assert_allclose(known.center, flight.center, atol=0.2)
        np.testing.assert_allclose(known.rotation, flight.rotation, atol=0.01)
