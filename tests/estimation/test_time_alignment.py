"""Photos and events under an unknown clock offset."""

import numpy as np
import pytest

from uavgram.estimation.time_alignment import align


def survey(rng, events, spread):
    """Event times with uneven spacing."""
    return np.cumsum(rng.uniform(2 - spread, 2 + spread, events)) + 100.0


@pytest.mark.parametrize("offset", [4.37, -36000.0, 7200.25])
@pytest.mark.parametrize(("resolution", "spread"), [(0.001, 0.1), (1.0, 0.8)])
def test_uneven_spacing_gives_the_offset_and_every_pair(offset, resolution, spread):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        event = survey(rng, 120, spread)
        taken = np.flatnonzero(rng.random(120) > 0.1)  # photos lost
        reading = event[taken] + offset
        reading = np.floor(reading / resolution) * resolution
        logged = np.flatnonzero(rng.random(120) > 0.05)  # events lost
        result = align(reading, resolution, event[logged])
        assert result.unique
        assert result.offset_s == pytest.approx(
            offset - resolution / 2, abs=0.1 * resolution + 1e-3
        )
        paired = result.event_index >= 0
        assert np.array_equal(logged[result.event_index[paired]], taken[paired])  # no wrong pair
        if resolution < 0.1:
            assert paired.sum() == np.isin(taken, logged).sum()


def test_even_spacing_is_seen_to_be_ambiguous():
    event = 100 + 2.0 * np.arange(40)
    result = align(event[10:25] + 4.37, 0.001, event)
    assert not result.unique
    assert len(result.candidates) > 10
    assert result.candidates[1].matched == 15


def test_bounds_settle_what_even_spacing_leaves_open():
    event = 100 + 2.0 * np.arange(40)
    result = align(event[10:25] + 4.37, 0.001, event, bounds_s=(4.0, 5.0))
    assert result.unique
    assert result.event_index.tolist() == list(range(10, 25))


def test_a_handful_of_pairs_is_never_certain():
    event = np.array([1.0, 2.5, 7.0])
    assert not align(event[:2] + 3, 0.001, event).unique
    assert not align(np.array([5.0]), 0.001, np.array([2.0])).unique


def test_a_missed_shot_in_the_middle_shifts_no_pair():
    rng = np.random.default_rng(5)
    event = survey(rng, 60, 0.3)
    taken = np.delete(np.arange(60), [20, 33, 50])
    result = align(event[taken] - 1.25, 0.001, event)
    assert np.array_equal(result.event_index, taken)


def test_a_photo_that_no_event_belongs_to_stays_alone():
    rng = np.random.default_rng(6)
    event = survey(rng, 60, 0.3)
    photo = np.append(event, event[10] + 0.9) + 12.0
    result = align(photo, 0.001, event)
    assert result.unique
    assert result.event_index[-1] == -1
    assert np.isnan(result.residual_s[-1])


def test_two_events_within_the_resolution_leave_a_photo_unpaired():
    rng = np.random.default_rng(7)
    event = np.sort(np.append(survey(rng, 60, 0.8), 150.0))
    event = np.sort(np.append(event, 150.2))
    result = align(np.floor(event + 3.3), 1.0, event)
    paired = result.event_index >= 0
    assert not paired[np.searchsorted(event, [150.0, 150.2])].any()
    assert np.array_equal(result.event_index[paired], np.flatnonzero(paired))


def test_a_drifting_clock_is_followed():
    rng = np.random.default_rng(8)
    event = survey(rng, 300, 0.4)
    result = align(event * (1 + 80e-6) + 500, 0.001, event)
    assert result.unique
    assert np.array_equal(result.event_index, np.arange(300))


def test_nothing_to_align_is_said():
    result = align(np.zeros(3), 0.001, np.zeros(0))
    assert not result.unique
    assert result.candidates == ()
    assert (result.event_index == -1).all()


def test_an_event_that_two_photos_could_claim_is_nobodys():
    event = survey(np.random.default_rng(9), 60, 0.8)
    event[30] = event[29] + 0.4  # closer than the step of the photos' clock
    photo = np.floor(event + 3.3)
    result = align(photo, 1.0, np.delete(event, 30))
    assert result.unique
    assert result.event_index[29] == -1
    assert result.event_index[30] == -1
