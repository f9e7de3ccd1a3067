"""What a log states of its estimator's resets and velocity, in each format."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from ulog_writer import ulog

from uavgram.io.logs.boots import find_resets_in_texts, find_stated_resets
from uavgram.io.logs.dataflash.reader import TABLE, BootMessages
from uavgram.io.logs.dataflash.tables import index_text
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.logs.ulog.reader import read_ulog
from uavgram.model.flight_log import EstimatorReset

EVENTS = b"""FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 134, 75, MSG, QZ, TimeUS,Message
FMT, 135, 12, EV, QB, TimeUS,Id
FMT, 136, 13, ERR, QBB, TimeUS,Subsys,ECode
EV, 5000000, 62
EV, 6000000, 10
ERR, 7000000, 24, 1
ERR, 8000000, 11, 2
ERR, 9000000, 11, 0
MSG, 10000000, EKF3 lane switch 1
MSG, 11000000, PreArm: check
"""


def resets_of(data: bytes) -> tuple[EstimatorReset, ...]:
    return find_stated_resets(BootMessages(index_text("x.log", data)), TABLE.resets)


def test_dataflash_events_errors_and_texts() -> None:
    resets = resets_of(EVENTS)
    assert [(reset.time_boot_s, reset.what) for reset in resets] == [
        (5.0, "reset of the heading"),
        (7.0, "change to another estimator"),
        (8.0, "glitch of the GPS"),
        (10.0, "change to another estimator"),
    ]


def test_columns_that_damage_made_numbers_of_are_no_text() -> None:
    bad = EVENTS.replace(b"FMT, 134, 75, MSG, QZ,", b"FMT, 134, 75, MSG, QQ,")
    assert len(resets_of(bad)) == 3
    other = EVENTS.replace(b"TimeUS,Message", b"TimeUS,Massage")
    assert len(resets_of(other)) == 3


def test_texts_without_a_time_are_left_out() -> None:
    assert not list(find_resets_in_texts([np.nan], ["EKF3 IMU0 emergency yaw reset"]))


@pytest.mark.parametrize("name", ["flight.BIN", "flight.tlog"])
def test_the_twins_align_their_heading_before_take_off(data_dir: Path, name: str) -> None:
    boot = read_flight_log(data_dir / "calm_nadir" / name).boots[0]
    at = {reset.time_boot_s for reset in boot.resets if reset.what == "reset of the heading"}
    assert min(abs(time - 47.5) for time in at) < 0.2


@pytest.mark.parametrize("name", ["flight.BIN", "flight.tlog"])
def test_the_stated_velocity_is_that_of_the_stated_positions(data_dir: Path, name: str) -> None:
    boot = read_flight_log(data_dir / "calm_nadir" / name).boots[0]
    velocity, places = boot.velocities, boot.positions
    assert velocity is not None
    assert places is not None
    assert boot.receiver is not None
    time = np.arange(90.0, 200.0, 0.5)
    north_m = 111_195 * np.interp(time, places.time_boot_s, places.latitude_deg)
    stated = np.interp(time, velocity.time_boot_s, velocity.ned_m_s[:, 0])
    assert np.abs(np.gradient(north_m, time) - stated).max() < 1.0
    climb = np.gradient(np.interp(time, places.time_boot_s, places.height_m), time)
    down = np.interp(time, velocity.time_boot_s, velocity.ned_m_s[:, 2])
    assert np.abs(climb + down).max() < 0.2


def test_the_stated_rates_are_those_of_the_stated_attitudes(data_dir: Path) -> None:
    """Of a tlog and of a real copter's RATE: integrated they are the turns."""
    for name in ("calm_nadir/flight.tlog", "logs/copter_3.4.4.bin"):
        boot = read_flight_log(data_dir / name).boots[0]
        rates, attitudes = boot.turn_rates, boot.attitudes
        assert rates is not None
        assert attitudes is not None
        time = attitudes.time_boot_s
        rotation = Rotation.from_quat(attitudes.ned_from_body_xyzw)
        turn = (rotation[:-1].inv() * rotation[1:]).as_rotvec()
        at = np.stack([np.interp(time, rates.time_boot_s, c) for c in rates.body_rad_s.T], axis=1)
        told = (at[1:] + at[:-1]) / 2 * np.diff(time)[:, None]
        assert np.square(turn - told).sum() < 0.1 * np.square(turn).sum()


def test_px4_counts_its_resets(tmp_path: Path) -> None:
    fields = ["uint64_t timestamp", "float[4] q", "uint8_t quat_reset_counter"]
    rows = [(1_000_000 * k, (1.0, 0.0, 0.0, 0.0), 3 + (k >= 4)) for k in range(1, 8)]
    place = ["uint64_t timestamp", "double lat", "double lon", "float alt"]
    places = [(1_000_000 * k, 48.0, 11.0, 500.0) for k in range(1, 8)]
    path = tmp_path / "flight.ulg"
    path.write_bytes(
        ulog({"vehicle_attitude": (fields, rows), "vehicle_global_position": (place, places)})
    )
    (reset,) = read_ulog(path).boots[0].resets
    assert (reset.time_boot_s, reset.what) == (4.0, "reset of the attitude")
