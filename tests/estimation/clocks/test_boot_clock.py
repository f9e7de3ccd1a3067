"""Which of a log's clocks is believed."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import fit_boot_clock, to_boot, to_utc
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Boot, ClockSamples

EPOCH = 1.7e9
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
    assert to_boot(clock, to_utc(clock, TIME)) == pytest.approx(TIME, abs=1e-6)


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
