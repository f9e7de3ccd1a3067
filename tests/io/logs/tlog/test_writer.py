"""The simulated flight as a .tlog, read back by pymavlink and by our reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil
from scipy.spatial.transform import Rotation

from uavgram.io.logs.tlog.reader import read_tlog
from uavgram.io.logs.tlog.writer import LINK_DELAY_S, write_tlog
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import SimulatedLog
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

Messages = dict[str, list[Any]]
"""Messages of pymavlink, which has no types, by their kind."""


@pytest.fixture(scope="module")
def log() -> SimulatedLog:
    return simulate(Scenario()).log


@pytest.fixture(scope="module")
def path(log: SimulatedLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "flight.tlog"
    write_tlog(path, log)
    return path


@pytest.fixture(scope="module")
def messages(path: Path) -> Messages:
    """Messages by type, read by pymavlink."""
    found: Messages = {}
    connection = mavutil.mavlink_connection(str(path))
    while (message := connection.recv_match()) is not None:
        found.setdefault(message.get_type(), []).append(message)
    connection.close()
    return found


def column(messages: list[Any], name: str) -> Floats:
    return np.array([getattr(message, name) for message in messages], dtype=float)


def test_pymavlink_reads_every_message_and_no_bad_data(
    messages: Messages, log: SimulatedLog
) -> None:
    assert "BAD_DATA" not in messages
    assert len(messages["GLOBAL_POSITION_INT"]) == len(log.position_time_s)
    assert len(messages["ATTITUDE"]) == len(messages["ATTITUDE_QUATERNION"])
    assert len(messages["CAMERA_FEEDBACK"]) == len(log.event_time_s) == 14
    assert messages["STATUSTEXT"][0].text == "uavgram demo"


def test_positions_are_those_of_the_flight(messages: Messages, log: SimulatedLog) -> None:
    rows = messages["GLOBAL_POSITION_INT"]
    np.testing.assert_allclose(column(rows, "lat") / 1e7, log.position_geodetic[:, 0], atol=6e-8)
    np.testing.assert_allclose(column(rows, "lon") / 1e7, log.position_geodetic[:, 1], atol=6e-8)
    np.testing.assert_allclose(column(rows, "alt") / 1e3, log.position_geodetic[:, 2], atol=6e-4)
    relative = log.position_geodetic[:, 2] - log.home_geodetic[2]
    np.testing.assert_allclose(column(rows, "relative_alt") / 1e3, relative, atol=1.1e-3)
    np.testing.assert_allclose(column(rows, "time_boot_ms") / 1e3, log.position_time_s, atol=6e-4)
    np.testing.assert_allclose(column(rows, "vx") / 100, log.velocity_ned_m_s[:, 0], atol=6e-3)


def test_velocities_are_the_rates_of_the_positions(log: SimulatedLog) -> None:
    north = np.deg2rad(log.position_geodetic[:, 0] - log.home_geodetic[0]) * 6.37e6
    np.testing.assert_allclose(
        np.gradient(north, log.position_time_s), log.velocity_ned_m_s[:, 0], atol=1.0
    )
    down = -np.gradient(log.position_geodetic[:, 2], log.position_time_s)
    np.testing.assert_allclose(down, log.velocity_ned_m_s[:, 2], atol=1.0)


def test_attitude_as_angles_and_as_quaternion_agree(messages: Messages) -> None:
    angles = np.stack([column(messages["ATTITUDE"], n) for n in ("yaw", "pitch", "roll")], axis=1)
    wxyz = [[m.q1, m.q2, m.q3, m.q4] for m in messages["ATTITUDE_QUATERNION"]]
    quaternion = Rotation.from_quat(wxyz, scalar_first=True)
    turn = Rotation.from_euler("ZYX", angles).inv() * quaternion
    assert turn.magnitude().max() < 1e-6
    assert np.abs(angles[:, 0]).max() <= np.pi + 1e-6


def test_the_gimbal_looks_ten_degrees_ahead_of_straight_down(messages: Messages) -> None:
    rows = messages["GIMBAL_DEVICE_ATTITUDE_STATUS"]
    yaw, pitch, roll = Rotation.from_quat([m.q for m in rows], scalar_first=True).as_euler(
        "ZYX", degrees=True
    ).T  # fmt: skip
    assert abs(np.mean(pitch) + 80) < 1
    # Seen from the vehicle: no trace of the road's azimuth. Near -90 yaw and roll lean together.
    assert abs(np.mean(yaw)) < 1
    assert abs(np.mean(roll)) < 1
    assert {m.flags for m in rows} == {4 + 8 + 32}  # roll, pitch to the earth; yaw to the vehicle


def test_exposures_are_stamped_in_utc(messages: Messages, log: SimulatedLog) -> None:
    stamp = column(messages["CAMERA_FEEDBACK"], "time_usec") * 1e-6
    np.testing.assert_allclose(stamp, log.boot_utc_s + log.event_time_s, atol=2e-6)
    assert column(messages["CAMERA_FEEDBACK"], "img_idx").tolist() == list(range(1, 15))


def test_the_clock_and_the_receive_time_say_utc(messages: Messages, log: SimulatedLog) -> None:
    for message in messages["SYSTEM_TIME"]:
        utc = message.time_unix_usec * 1e-6
        assert utc - message.time_boot_ms * 1e-3 == pytest.approx(log.boot_utc_s, abs=1e-3)
        assert message._timestamp - utc == pytest.approx(LINK_DELAY_S, abs=2e-3)


def test_the_receiver_states_its_accuracy_and_the_geoid(
    messages: Messages, log: SimulatedLog
) -> None:
    rows = messages["GPS_RAW_INT"]
    np.testing.assert_allclose(column(rows, "h_acc") / 1e3, log.gps_accuracy_m[:, 0], atol=6e-4)
    undulation = (column(rows, "alt_ellipsoid") - column(rows, "alt")) / 1e3
    np.testing.assert_allclose(undulation, log.undulation_m, atol=1e-3)


def test_the_same_flight_gives_the_same_bytes(
    log: SimulatedLog, path: Path, tmp_path: Path
) -> None:
    write_tlog(tmp_path / "again.tlog", log)
    assert (tmp_path / "again.tlog").read_bytes() == path.read_bytes()


def test_our_reader_finds_events_gimbal_home_and_clock(path: Path, log: SimulatedLog) -> None:
    flight = read_tlog(path)
    (boot,) = flight.boots
    assert boot.events is not None
    np.testing.assert_allclose(boot.events.time_boot_s, log.event_time_s, atol=2e-3)
    assert boot.gimbal is not None
    assert boot.gimbal.yaw_frame == "vehicle"
    assert np.rad2deg(boot.gimbal.pitch_rad.mean()) == pytest.approx(-80, abs=1)
    assert boot.home is not None
    home = [boot.home.latitude_deg[0], boot.home.longitude_deg[0], boot.home.height_m[0]]
    np.testing.assert_allclose(home, log.home_geodetic, atol=1e-6)
    assert boot.clocks[0].source == "system_time"
    assert flight.undulation_m == pytest.approx(log.undulation_m, abs=1e-3)
