"""Photos and events under an unknown clock offset."""

import numpy as np
import pytest
import shutters

from uavgram.estimation.clocks.alignment import align
from uavgram.estimation.clocks.clock_line import fit_camera_clock
from uavgram.model.arrays import Floats


def survey(rng: np.random.Generator, events: int, spread: float) -> Floats:
    """Event times with uneven spacing."""
    return np.cumsum(rng.uniform(2 - spread, 2 + spread, events)) + 100.0


@pytest.mark.parametrize("offset", [4.37, -36000.0, 7200.25])
@pytest.mark.parametrize(("resolution", "spread"), [(0.001, 0.1), (1.0, 0.8)])
def test_uneven_spacing_gives_the_offset_and_every_pair(
    offset: float, resolution: float, spread: float
) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        event = survey(rng, 120, spread)
        taken = np.flatnonzero(rng.random(120) > 0.1)  # photos lost
        reading = event[taken] + offset
        reading = np.floor(reading / resolution) * resolution
        logged = np.flatnonzero(rng.random(120) > 0.05)  # events lost
        result = align(reading, resolution, event[logged])
        assert result.unique
        assert result.clock.offset_s == pytest.approx(
            offset - resolution / 2, abs=0.1 * resolution + 1e-3
        )
        paired = result.certain
        assert np.array_equal(logged[result.event_index[paired]], taken[paired])  # no wrong pair
        if resolution < 0.1:
            assert paired.sum() == np.isin(taken, logged).sum()


def test_even_spacing_is_seen_to_be_ambiguous() -> None:
    event = 100 + 2.0 * np.arange(40, dtype=float)
    result = align(event[10:25] + 4.37, 0.001, event)
    assert not result.unique
    assert len(result.candidates) > 10
    assert result.candidates[1].matched == 15


def test_bounds_settle_what_even_spacing_leaves_open() -> None:
    event = 100 + 2.0 * np.arange(40, dtype=float)
    result = align(event[10:25] + 4.37, 0.001, event, bounds_s=(4.0, 5.0))
    assert result.unique
    assert result.event_index.tolist() == list(range(10, 25))


def test_a_handful_of_pairs_is_never_certain() -> None:
    event = np.array([1.0, 2.5, 7.0])
    assert not align(event[:2] + 3, 0.001, event).unique
    assert not align(np.array([5.0]), 0.001, np.array([2.0])).unique


@pytest.mark.parametrize("photos", [4, 5, 6])
def test_few_photos_of_a_hovering_drone_find_their_offset(photos: int) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        event: Floats = 100.0 + np.cumsum(rng.uniform(20.0, 30.0, photos))
        result = align(event + 14.228, 0.001, event)
        assert result.unique, seed
        assert result.clock.offset_s == pytest.approx(14.228, abs=1e-3)
        even = 100.0 + 25.0 * np.arange(photos, dtype=float)
        assert not align(even + 14.228, 0.001, even).unique


def test_a_missed_shot_in_the_middle_shifts_no_pair() -> None:
    rng = np.random.default_rng(5)
    event = survey(rng, 60, 0.3)
    taken = np.delete(np.arange(60), [20, 33, 50])
    result = align(event[taken] - 1.25, 0.001, event)
    assert np.array_equal(result.event_index, taken)


def test_a_photo_that_no_event_belongs_to_stays_alone() -> None:
    rng = np.random.default_rng(6)
    event = survey(rng, 60, 0.3)
    photo = np.append(event, event[10] + 0.9) + 12.0
    result = align(photo, 0.001, event)
    assert result.unique
    assert result.event_index[-1] == -1
    assert np.isnan(result.residual_s[-1])


def test_two_events_within_the_resolution_leave_a_photo_uncertain() -> None:
    rng = np.random.default_rng(7)
    event = np.sort(np.append(survey(rng, 60, 0.8), 150.0))
    event = np.sort(np.append(event, 150.2))
    result = align(np.floor(event + 3.3), 1.0, event)
    doubtful = np.searchsorted(event, [150.0, 150.2])
    assert not result.certain[doubtful].any()
    assert {result.status[k] for k in doubtful} == {"crowded"}
    certain = np.flatnonzero(result.certain)
    assert np.array_equal(result.event_index[certain], certain)


def test_a_drifting_clock_is_followed() -> None:
    rng = np.random.default_rng(8)
    event = survey(rng, 300, 0.4)
    result = align(event * (1 + 80e-6) + 500, 0.001, event)
    assert result.unique
    assert np.array_equal(result.event_index, np.arange(300))


def test_nothing_to_align_is_said() -> None:
    result = align(np.zeros(3), 0.001, np.zeros(0))
    assert not result.unique
    assert result.candidates == ()
    assert (result.event_index == -1).all()


def test_an_event_that_two_photos_could_claim_is_nobodys_for_certain() -> None:
    event = survey(np.random.default_rng(9), 60, 0.8)
    event[30] = event[29] + 0.4  # closer than the step of the photos' clock
    photo = np.floor(event + 3.3)
    result = align(photo, 1.0, np.delete(event, 30))
    assert result.unique
    assert not result.certain[[29, 30]].any()


def test_a_photo_whose_event_and_whose_neighbours_photo_are_both_lost_is_never_certain() -> None:
    # Events down to 0.5 s apart and a clock of 1 s: the photo falls on the neighbour's event.
    rng = np.random.default_rng(3)
    event = 100 + np.cumsum(rng.uniform(0.5, 4.0, 200))
    photo = np.floor(event + 3.3)
    fell = 0
    for k in 1 + np.flatnonzero(np.diff(event)[:-1] < 1.0):
        result = align(np.delete(photo, k), 1.0, np.delete(event, k - 1))
        assert result.unique
        wrong = result.event_index[k - 1] == k - 1  # its own is gone: this is the next event
        fell += wrong
        assert not (wrong and result.certain[k - 1])
    assert fell >= 3  # the trap was there


def test_exposures_at_whole_seconds_leave_the_offset_open_over_the_step() -> None:
    event = 100.0 + np.cumsum(np.random.default_rng(4).integers(2, 6, 80), dtype=float)
    coarse = fit_camera_clock(event, np.floor(event + 0.9), 1.0)
    assert coarse.offset_sigma_s == pytest.approx(1 / np.sqrt(12), abs=0.01)
    spread = survey(np.random.default_rng(4), 80, 0.8)
    filled = fit_camera_clock(spread, np.floor(spread + 0.9), 1.0)
    assert filled.offset_sigma_s < 0.03
    assert filled.offset_s == pytest.approx(0.4, abs=3 * filled.offset_sigma_s)


@pytest.mark.parametrize("resolution", [0.001, 1.0])
def test_offset_and_drift_lie_within_their_sigmas(resolution: float) -> None:
    z = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        event = survey(rng, int(rng.integers(10, 300)), 0.8)
        offset, drift = rng.uniform(-5, 5), rng.normal(0, 1e-4)
        exposure = event + rng.normal(0, 0.008, len(event))
        reading = exposure + offset + drift * (exposure - event.mean())
        clock = fit_camera_clock(event, np.floor(reading / resolution) * resolution, resolution)
        error = clock.offset_s - (offset - resolution / 2)
        z.append([error / clock.offset_sigma_s, (clock.drift - drift) / clock.drift_sigma])
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    # 200 draws of a unit normal: 1 +- 0.05; a coarse clock's slack is counted generously
    assert 0.85 < rms[1] < 1.15 if resolution < 0.1 else 0.5 < rms[1] < 1.15
    assert 0.85 < rms[0] < 1.15 if resolution < 0.1 else 0.4 < rms[0] < 1.15


def test_a_significant_drift_is_told_and_a_small_one_is_not() -> None:
    event = survey(np.random.default_rng(8), 300, 0.4)
    assert align(event * (1 + 80e-6) + 500, 0.001, event).clock.drifts
    assert not align(event + 500, 0.001, event).clock.drifts


@pytest.mark.parametrize("resolution", [0.001, 1.0])
def test_an_even_interval_with_losses_on_both_sides_is_not_settled_by_who_was_lost(
    resolution: float,
) -> None:
    for seed in range(25):
        rng = np.random.default_rng(seed)
        exposure = 100 + 2.3 * np.arange(80)
        has_photo, has_event = rng.random((2, 80)) >= 0.15
        event = exposure + rng.normal(0, 0.005, 80)
        reading = np.floor((exposure + 7200.4) / resolution) * resolution
        assert not align(reading[has_photo], resolution, event[has_event]).unique


def test_a_log_that_holds_the_events_of_few_photos_is_refused() -> None:
    event = survey(np.random.default_rng(12), 40, 0.8)
    assert align(event + 3.0, 0.001, event[:26]).unique
    assert not align(event + 3.0, 0.001, event[:20]).unique


def test_a_few_coarse_photos_fall_on_events_by_chance() -> None:
    # Eight of eight, and no rival near: still one of some hundred offsets that were tried.
    rng = np.random.default_rng(87)
    count = int(rng.integers(4, 12))
    event = 100 + np.cumsum(rng.uniform(2, rng.uniform(5, 30), count))
    assert not align(np.floor(event + 3.3), 1.0, event).unique
    assert align(event + 3.3, 0.001, event).unique


def test_photos_of_another_flight_are_refused() -> None:
    cases = [shutters.make_case(seed) for seed in range(40)]
    for one, other in zip(cases, cases[1:] + cases[:1], strict=True):
        assert not align(one.photo_s, one.resolution_s, other.event_s).unique


def test_random_flights_give_right_pairs_or_a_refusal() -> None:
    # A sample of tests/statistical/test_matching.py.
    for seed in range(5000, 5060):
        case = shutters.make_case(seed)
        result = align(case.photo_s, case.resolution_s, case.event_s)
        if result.unique:
            wrong = result.certain & (result.event_index != case.truth)
            assert not wrong.any(), seed
        elif len(case.photo_s) >= 30:
            assert not case.uneven, seed


@pytest.mark.parametrize("resolution", [0.001, 1.0])
def test_400_photos_find_their_offset_among_450_events(resolution: float) -> None:
    event = survey(np.random.default_rng(11), 450, 0.9)
    photo = np.floor((event[:400] + 36000.3) / resolution) * resolution
    result = align(photo, resolution, event)

    assert result.unique
    assert result.clock.offset_s == pytest.approx(36000.3, abs=max(resolution, 0.01))
