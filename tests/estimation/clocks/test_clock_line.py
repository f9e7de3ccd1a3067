"""Lines between clocks: outliers, drift, one-sided delays."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import (
    BOOT_DRIFT_SIGMA,
    ClockLine,
    convert_boot_to_utc,
    convert_utc_to_boot,
    fit_boot_clock,
    fit_lower_envelope,
)
from uavgram.estimation.clocks.clock_line import fit_line as fit_any_line
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Boot, ClockSamples

EPOCH = 1.7e9


def fit_line(time_s: Floats, other_s: Floats) -> ClockLine:
    return fit_any_line(time_s, other_s, BOOT_DRIFT_SIGMA)


def test_offset_and_drift_come_back_from_noisy_pairs_with_outliers() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(30, 1500, 0.2)
    other = EPOCH + time * (1 - 146e-6) + rng.normal(0, 0.01, len(time))
    other[rng.random(len(time)) < 0.2] += 18.0  # another leap second count
    line = fit_line(time, other)
    error = (
        time
        + line.offset_s
        + line.drift * (time - line.reference_s)
        - (EPOCH + time * (1 - 146e-6))
    )
    assert np.abs(error).max() < 0.003
    assert 0.009 < line.scatter_s < 0.014  # a fifth of outliers widens the median deviation


def test_the_sigma_of_the_line_is_that_of_its_level() -> None:
    rng = np.random.default_rng(2)
    time = np.linspace(0, 200, 400)
    errors = []
    for _ in range(300):
        line = fit_line(time, EPOCH + time + rng.normal(0, 0.05, len(time)))
        errors.append((line.at(100.0) - EPOCH - 100) / line.offset_sigma_s)
    assert 0.85 < np.std(errors) < 1.15  # 300 trials: sigma of std is 0.04


def test_a_short_log_invents_no_drift() -> None:
    rng = np.random.default_rng(3)
    time = np.array([10.0, 10.2, 10.4, 10.6])
    line = fit_line(time, EPOCH + time + rng.normal(0, 0.01, 4))
    assert abs(line.drift) < 1e-5


def test_a_single_pair_is_its_own_line() -> None:
    line = fit_line(np.array([5.0]), np.array([EPOCH + 5]))
    assert line.at(5.0) == pytest.approx(EPOCH + 5, abs=1e-6)


def test_the_lower_envelope_ignores_the_delays() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(100, 400, 0.25)
    delay = 0.02 + rng.exponential(0.2, len(time))
    late = EPOCH + time * (1 + 20e-6) + delay
    line = fit_lower_envelope(time, late)
    error = (
        time
        + line.offset_s
        + line.drift * (time - line.reference_s)
        - (EPOCH + time * (1 + 20e-6) + 0.02)
    )
    assert np.abs(error).max() < 0.03
    assert np.abs(fit_line(time, late).at(0.0) - EPOCH) > 0.1  # what the envelope is for


def test_the_sigma_of_the_drift_is_true() -> None:
    rng = np.random.default_rng(5)
    time = np.linspace(0, 600, 600)
    lines = [fit_line(time, EPOCH + time + rng.normal(0, 0.02, len(time))) for _ in range(300)]
    errors = [line.drift / line.drift_sigma for line in lines]
    assert 0.85 < np.std(errors) < 1.15  # 300 trials: sigma of std is 0.04


# Choice among the clocks of a log.


ClockSource = Literal["gps", "system_time", "receive"]
SOURCES: dict[str, ClockSource] = {
    "gps": "gps",
    "system_time": "system_time",
    "receive": "receive",
}
TIME = np.arange(20.0, 300.0, 0.5)


def boot(**clocks: Floats) -> Boot:
    return Boot(
        positions=None,
        attitudes=None,
        gimbal=None,
        sigmas=None,
        events=None,
        home=None,
        clocks=tuple(
            ClockSamples(time_boot_s=TIME, utc_s=utc, source=SOURCES[name])
            for name, utc in clocks.items()
        ),
    )


def test_system_time_wins_over_a_receive_clock_that_is_seconds_off() -> None:
    clock, messages = fit_boot_clock(
        boot(system_time=EPOCH + TIME, receive=EPOCH + 3.7 + 1.004 * TIME)
    )
    assert clock.source == "system_time"
    assert clock.offset_s == pytest.approx(EPOCH, abs=1e-3)
    assert [m.code for m in messages] == ["clock-station-off"]


@pytest.mark.parametrize("wrong_s", [2.8e10, -3 * 86400.0, -EPOCH])
def test_nonsense_system_time_yields_to_the_receive_clock(wrong_s: float) -> None:
    rng = np.random.default_rng(1)
    late = EPOCH + TIME + rng.exponential(0.1, len(TIME))
    clock, messages = fit_boot_clock(boot(system_time=EPOCH + TIME + wrong_s, receive=late))
    assert clock.source == "receive"
    assert clock.offset_s == pytest.approx(EPOCH, abs=0.05)
    assert [(m.level, m.code) for m in messages] == [("warning", "clock-receive")]


def test_a_system_time_that_stands_still_is_rejected() -> None:
    clock, _ = fit_boot_clock(boot(system_time=np.full(len(TIME), EPOCH), receive=EPOCH + TIME))
    assert clock.source == "receive"


def test_gps_wins_over_everything() -> None:
    clock, messages = fit_boot_clock(boot(receive=EPOCH + 5 + TIME, gps=EPOCH + TIME))
    assert clock.source == "gps"
    assert messages == ()


def test_a_log_without_any_utc_is_refused_with_the_way_out() -> None:
    with pytest.raises(UavgramError, match="no GPS time, no SYSTEM_TIME"):
        fit_boot_clock(boot())
    with pytest.raises(UavgramError, match="nonsense"):
        fit_boot_clock(boot(system_time=2.9e10 + TIME, receive=TIME))


def test_both_ways_of_the_clock_are_inverse() -> None:
    clock, _ = fit_boot_clock(boot(gps=EPOCH + TIME * (1 + 1e-4)))
    assert convert_utc_to_boot(clock, convert_boot_to_utc(clock, TIME)) == pytest.approx(
        TIME, abs=1e-6
    )


def test_the_real_cuav_clock_is_the_receive_clock(data_dir: Path) -> None:
    from uavgram.io.logs.tlog.reader import read_tlog

    clock, messages = fit_boot_clock(read_tlog(data_dir / "cuav" / "flight.tlog").boots[0])
    assert clock.source == "receive"
    assert "2909" in messages[0].text or "2908" in messages[0].text


def test_readings_that_jump_by_a_second_are_left_out_and_said() -> None:
    utc = EPOCH + TIME
    utc[:80] -= 1.0  # before the receiver knew the newest leap second
    clock, messages = fit_boot_clock(boot(gps=utc))
    assert clock.offset_s == pytest.approx(EPOCH, abs=1e-3)
    assert [m.code for m in messages] == ["clock-jumps"]
    assert "80 of 560" in messages[0].text
    assert "-1.00 s" in messages[0].text


def test_a_damaged_receive_time_does_not_move_the_envelope() -> None:
    rng = np.random.default_rng(3)
    late = EPOCH + TIME + rng.exponential(0.1, len(TIME))
    late[::7] -= rng.uniform(1e4, 1e7, len(late[::7]))
    clock, _ = fit_boot_clock(boot(receive=late))
    assert clock.offset_s == pytest.approx(EPOCH, abs=0.05)
    assert clock.sigma_s < 0.2


def test_a_boot_clock_that_is_ten_per_cent_slow_is_called_slow() -> None:
    with pytest.raises(UavgramError, match=r"the boot clock runs 9\.1 % slow against it"):
        fit_boot_clock(boot(gps=EPOCH + 1.1 * TIME))


def test_gps_time_of_another_century_is_called_that() -> None:
    with pytest.raises(UavgramError, match="its GPS time is nonsense"):
        fit_boot_clock(boot(gps=1e9 + TIME))


def test_gps_time_that_jumps_about_is_called_that() -> None:
    rng = np.random.default_rng(2)
    with pytest.raises(UavgramError, match=r"its GPS time scatters by \d\.\d s about"):
        fit_boot_clock(boot(gps=EPOCH + TIME + rng.normal(0, 1.0, len(TIME))))


@pytest.mark.parametrize("scatter_s", [0.3, 0.45])
def test_a_clock_that_scatters_is_no_better_than_its_scatter(scatter_s: float) -> None:
    rng = np.random.default_rng(3)
    wandering = rng.normal(0, 1, len(TIME) // 40).repeat(40)  # for twenty seconds the same way
    wandering *= scatter_s / 1.4826 / np.median(np.abs(wandering - np.median(wandering)))
    clock, _ = fit_boot_clock(boot(gps=EPOCH + TIME + wandering))
    assert scatter_s * 0.8 < clock.sigma_s < scatter_s * 1.6
