"""Telemetry logs: columns against pymavlink, meaning against simulated flights, damage."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as dialect
from scipy.spatial.transform import Rotation

from uavgram.errors import InputError
from uavgram.io.logs.messages import message_name
from uavgram.io.logs.tlog.frames import _apart, _Candidates, scan_frames
from uavgram.io.logs.tlog.reader import read_tlog
from uavgram.io.logs.tlog.writer import LINK_DELAY_S, write_tlog
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import SimulatedLog
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

Link = tuple[Any, bool]
"""An encoder of pymavlink, which has no types, and whether it is to speak MAVLink 1."""


class Message(Protocol):
    """Of pymavlink, which has no types."""

    def pack(self, mav: object, *, force_mavlink1: bool) -> bytes: ...


class Save(Protocol):
    def __call__(self, data: bytes | bytearray, name: str = ...) -> Path: ...


REAL = (
    "cuav/flight.tlog",
    "calm_nadir/flight.tlog",
    "wind_oblique/flight.tlog",
    "logs/dronekit_flight.tlog",
)
USED = {
    "HEARTBEAT",
    "GLOBAL_POSITION_INT",
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "GIMBAL_DEVICE_ATTITUDE_STATUS",
    "MOUNT_STATUS",
    "CAMERA_FEEDBACK",
    "SYSTEM_TIME",
    "HOME_POSITION",
    "GPS_RAW_INT",
    "STATUSTEXT",
    "LOCAL_POSITION_NED",
    "GPS2_RAW",
    "MOUNT_ORIENTATION",
    "CAMERA_TRIGGER",
    "CAMERA_IMAGE_CAPTURED",
    "ESTIMATOR_STATUS",
    "AUTOPILOT_VERSION",
}
UTC_S = 1_700_000_000.0


@pytest.mark.parametrize("name", REAL)
def test_every_field_equals_pymavlinks(data_dir: Path, name: str) -> None:
    path = data_dir / name
    connection = mavutil.mavlink_connection(str(path), dialect="all")
    expected: dict[str, list[Any]] = {}
    while (message := connection.recv_msg()) is not None:
        if message.get_type() in USED:
            expected.setdefault(message.get_type(), []).append(message)
    connection.close()
    frames = scan_frames(path.read_bytes())
    for kind, messages in expected.items():
        rows = frames.rows(kind)
        if len(rows) != len(messages):  # pymavlink loses good frames behind damaged bytes
            assert 0 < len(rows) - len(messages) < 5, kind
            stamps = {round(m._timestamp, 5) for m in messages}
            received = frames.receive_s(rows).round(5).tolist()
            rows = rows[[stamp in stamps for stamp in received]]
        if len(rows) != len(messages):
            continue
        columns = frames.columns(kind, rows)
        for field in messages[0].get_fieldnames():
            values = [getattr(m, field) for m in messages]
            if columns[field].dtype.kind == "S":
                assert [c.decode("latin-1") for c in columns[field]] == values
            else:
                np.testing.assert_array_equal(columns[field], np.array(values), f"{kind}.{field}")


def test_most_types_of_the_real_logs_were_compared(data_dir: Path) -> None:
    frames = scan_frames((data_dir / "logs" / "dronekit_flight.tlog").read_bytes())
    names = {message_name(int(n)) for n in np.unique(frames.message_id)}
    assert len(USED & names) >= 6


class Recorder:
    """Write a telemetry log with pymavlink."""

    def __init__(self) -> None:
        self.data = bytearray()

    def link(
        self, system: int = 1, component: int = 1, *, version: int = 2, key: bytes | None = None
    ) -> Link:
        """An encoder for one sender."""
        mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        mav.robust_parsing = True
        if key is not None:
            mav.signing.secret_key = key
            mav.signing.sign_outgoing = True
            mav.signing.link_id = 1
            mav.signing.timestamp = 1
        return mav, version == 1

    def add(self, link: Link, receive_s: float, message: Message) -> None:
        mav, first_version = link
        frame = message.pack(mav, force_mavlink1=first_version)
        self.data += struct.pack(">Q", int(receive_s * 1e6)) + frame

    def flight(
        self,
        link: Link,
        *,
        start_s: float = 10.0,
        seconds: int = 20,
        delay_s: float = 0.05,
        utc: float | None = UTC_S,
    ) -> None:
        """Heartbeats, positions, attitudes and SYSTEM_TIME at 10 Hz."""
        for k in range(seconds * 10):
            boot = start_s + k / 10
            ms, receive = round(boot * 1000), UTC_S + boot + delay_s
            self.add(link, receive, dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
            position = dialect.MAVLink_global_position_int_message(
                ms, -353600000 + k, 1491600000, 600000, 60000, 0, 0, 0, 0
            )
            self.add(link, receive, position)
            attitude = dialect.MAVLink_attitude_message(ms, 0.1, -0.2, 0.3, 0, 0, 0)
            self.add(link, receive, attitude)
            if utc is not None:
                clock = dialect.MAVLink_system_time_message(round((utc + boot) * 1e6), ms)
                self.add(link, receive, clock)

    def feedback(self, link: Link, receive_s: float, time_usec: int, number: int) -> None:
        message = dialect.MAVLink_camera_feedback_message(
            time_usec, 0, 0, number, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
        )
        self.add(link, receive_s, message)


@pytest.fixture
def save(tmp_path: Path) -> Save:
    """Write bytes to a log of their own."""

    def write(data: bytes | bytearray, name: str = "flight.tlog") -> Path:
        path = tmp_path / name
        path.write_bytes(bytes(data))
        return path

    return write


def test_both_versions_signed_frames_and_other_systems_are_told_apart(save: Save) -> None:
    log = Recorder()
    log.flight(log.link(version=1), start_s=10, seconds=5)
    log.flight(log.link(version=2), start_s=15, seconds=5)
    log.flight(log.link(version=2, key=bytes(32)), start_s=20, seconds=5)
    station = log.link(255, 190)
    log.add(station, UTC_S + 26, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    far = dialect.MAVLink_global_position_int_message(1, 10, 10, 0, 0, 0, 0, 0, 0)
    log.add(station, UTC_S + 26, far)
    read = read_tlog(save(log.data))
    (boot,) = read.boots
    assert boot.positions is not None
    assert len(boot.positions.time_boot_s) == 150
    assert boot.attitudes is not None
    assert boot.attitudes.source == "ATTITUDE"
    assert read.vehicle == "quadrotor"
    assert read.notes == ()


def test_a_trimmed_payload_is_filled_with_zeros() -> None:
    log = Recorder()
    link = log.link()
    message = dialect.MAVLink_global_position_int_message(5, 1, 2, 3, 0, 0, 0, 0, 0)
    log.add(link, UTC_S, message)
    frames = scan_frames(bytes(log.data))
    assert frames.payload_length[0] < 28  # pymavlink trims trailing zeros as the protocol says
    columns = frames.columns("GLOBAL_POSITION_INT", frames.rows("GLOBAL_POSITION_INT"))
    assert columns["alt"].tolist() == [3]
    assert columns["hdg"].tolist() == [0]


def test_a_clock_that_starts_again_makes_another_boot(data_dir: Path) -> None:
    log = read_tlog(data_dir / "logs" / "dronekit_flight.tlog")
    assert len(log.boots) == 2
    assert [b.positions and len(b.positions.time_boot_s) for b in log.boots] == [491, 2193]
    assert log.boots[0].gimbal is not None
    assert log.boots[0].gimbal.source == "MOUNT_STATUS"


def test_feedback_in_utc_is_brought_to_the_boot_clock(data_dir: Path) -> None:
    from uavgram.io.logs.dataflash.reader import read_dataflash

    for name in ("calm_nadir", "wind_oblique"):
        events = read_tlog(data_dir / name / "flight.tlog").boots[0].events
        assert events is not None
        reference = read_dataflash(data_dir / name / "flight.BIN").boots[0].events
        assert reference is not None
        confirmed = reference.confirmed > 0
        assert np.array_equal(events.image_number, reference.image_number[confirmed])
        gap = np.abs(events.time_boot_s - reference.time_boot_s[confirmed])
        assert gap.max() < 0.001  # SYSTEM_TIME counts whole milliseconds


def test_feedback_since_boot_that_wrapped_is_unwrapped(save: Save) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link, start_s=5000)
    log.feedback(link, UTC_S + 5010.05, round(5010.0 * 1e6) % 2**32, 1)
    events = read_tlog(save(log.data)).boots[0].events
    assert events is not None
    assert events.time_boot_s.tolist() == pytest.approx([5010.0], abs=1e-6)


def test_feedback_in_a_nonsense_utc_is_placed_by_the_same_nonsense(save: Save) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link, utc=29_618_000_000.0)  # the year 2908
    log.feedback(link, UTC_S + 20.1, round((29_618_000_000.0 + 20.0) * 1e6), 1)
    events = read_tlog(save(log.data)).boots[0].events
    assert events is not None
    assert events.time_boot_s.tolist() == pytest.approx([20.0], abs=1e-4)


def test_feedback_in_utc_without_system_time_is_left_out_with_a_note(save: Save) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link, utc=None)
    log.feedback(link, UTC_S + 20.1, round((UTC_S + 20.0) * 1e6), 1)
    read = read_tlog(save(log.data))
    assert read.boots[0].events is None
    assert any("no SYSTEM_TIME" in note for note in read.notes)


@pytest.mark.parametrize(("flags", "frame"), [(32, "vehicle"), (64, "earth"), (16, "earth")])
def test_the_gimbals_yaw_frame_is_what_its_flags_say(save: Save, flags: int, frame: str) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link)
    half = np.radians(30) / 2
    for k in range(5):
        message = dialect.MAVLink_gimbal_device_attitude_status_message(
            0, 0, 12000 + 100 * k, flags, [np.cos(half), 0, 0, np.sin(half)], 0, 0, 0, 0
        )
        log.add(link, UTC_S + 12, message)
    gimbal = read_tlog(save(log.data)).boots[0].gimbal
    assert gimbal is not None
    assert gimbal.yaw_frame == frame
    assert np.degrees(gimbal.yaw_rad) == pytest.approx([30] * 5, abs=1e-5)


def test_a_failed_checksum_drops_the_frame_and_is_counted(save: Save) -> None:
    log = Recorder()
    log.flight(log.link())
    data = bytearray(log.data)
    first = scan_frames(bytes(data))
    row = first.rows("GLOBAL_POSITION_INT")[7]
    data[first.payload_start[row] + 4] ^= 0xFF
    read = read_tlog(save(data))
    assert read.boots[0].positions is not None
    assert len(read.boots[0].positions.time_boot_s) == 199
    assert "1 frames failed their checksum and were dropped" in read.notes


def test_lost_bytes_cost_the_frames_that_they_hit() -> None:
    log = Recorder()
    log.flight(log.link())
    whole = scan_frames(bytes(log.data))
    cut = bytes(log.data[:2005] + log.data[2090:])
    frames = scan_frames(cut)
    assert len(whole.start) - 5 <= len(frames.start) < len(whole.start)
    assert frames.skipped_bytes > 0


def test_a_corrupt_length_does_not_swallow_what_follows() -> None:
    log = Recorder()
    log.flight(log.link())
    whole = scan_frames(bytes(log.data))
    data = bytearray(log.data)
    data[whole.start[50] + 1] = 255
    assert len(scan_frames(bytes(data)).start) == len(whole.start) - 1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"hello world\n" * 1000, "no intact MAVLink frame"),
        (np.random.default_rng(2).bytes(100_000), "no intact MAVLink frame"),
    ],
)
def test_what_is_no_log_is_refused_by_name(save: Save, content: bytes, words: str) -> None:
    path = save(content)
    with pytest.raises(InputError, match=words) as caught:
        read_tlog(path)
    assert caught.value.path == str(path)


def test_a_log_without_positions_says_what_it_holds(save: Save) -> None:
    log = Recorder()
    log.add(log.link(), UTC_S, dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
    with pytest.raises(InputError, match="it holds HEARTBEAT"):
        read_tlog(save(log.data))


@pytest.mark.parametrize(("pinned", "instant"), [(True, "feedback"), (False, "command")])
def test_feedbacks_time_base_tells_whether_a_pin_confirmed_it(
    save: Save, *, pinned: bool, instant: str
) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link)
    for k, number in enumerate((1, 2, 2, 4)):
        event = 12.0 + k
        stamp = event if pinned else UTC_S + event
        log.feedback(link, UTC_S + event + 0.05, round(stamp * 1e6), number)
    events = read_tlog(save(log.data)).boots[0].events
    assert events is not None
    assert events.instant == instant
    assert events.time_boot_s.tolist() == pytest.approx([12, 13, 14, 15], abs=1e-3)
    assert (events.repeated, events.lost) == ((2,), (3,))


@pytest.mark.parametrize("base_s", [0.0, UTC_S])
def test_camera_trigger_states_commands_in_either_clock(save: Save, base_s: float) -> None:
    log = Recorder()
    link = log.link()
    log.flight(link)
    for k in range(3):
        message = dialect.MAVLink_camera_trigger_message(round((base_s + 12.0 + k) * 1e6), k)
        log.add(link, UTC_S + 12.1 + k, message)
    events = read_tlog(save(log.data)).boots[0].events
    assert events is not None
    assert events.source == "CAMERA_TRIGGER"
    assert events.time_boot_s.tolist() == pytest.approx([12, 13, 14], abs=1e-3)
    assert events.confirmed.tolist() == [0, 0, 0]


def test_image_captured_asked_for_again_is_one_event(save: Save) -> None:
    log = Recorder()
    link, camera = log.link(), log.link(1, 100)
    log.flight(link)
    for k, (event, received, result) in enumerate(
        ((12.0, 12.1, 1), (13.0, 13.1, 1), (14.0, 14.1, 0), (12.0, 25.0, 1))
    ):
        index = (0, 1, 2, 0)[k]
        message = dialect.MAVLink_camera_image_captured_message(
            round(event * 1e3), 0, 0, 0, 0, 0, 0, [1, 0, 0, 0], index, result, b""
        )
        log.add(camera, UTC_S + received, message)
    events = read_tlog(save(log.data)).boots[0].events
    assert events is not None
    assert events.source == "CAMERA_IMAGE_CAPTURED"
    assert events.time_boot_s.tolist() == pytest.approx([12, 13, 14])
    assert events.confirmed.tolist() == [1, 1, 0]
    assert events.repeated == ()


def test_servo_angles_of_an_old_mount_are_turned_by_the_vehicle(data_dir: Path) -> None:
    log = read_tlog(data_dir / "logs" / "dronekit_flight.tlog")
    gimbal = log.boots[1].gimbal
    assert gimbal is not None
    # the vehicle pitches by 7 and rolls by 4 degrees (one sigma), the camera does not
    assert np.degrees(np.std(gimbal.pitch_rad)) < 1.0
    assert np.degrees(np.std(gimbal.roll_rad)) < 1.0
    assert gimbal.yaw_frame == "earth"
    assert any("servo angles" in note for note in log.notes)


def test_the_receiver_stands_in_where_the_estimator_is_silent(save: Save) -> None:
    log = Recorder()
    link = log.link()
    for k in range(50):
        boot = 10 + k / 5
        log.add(link, UTC_S + boot, dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
        ms = round(boot * 1e3)
        log.add(link, UTC_S + boot, dialect.MAVLink_attitude_message(ms, 0, 0, 1, 0, 0, 0))
        fix = dialect.MAVLink_gps_raw_int_message(
            round(boot * 1e6), 3, 470000000 + 10 * k, 80000000, 500000, 80, 90, 0, 0, 12
        )
        log.add(link, UTC_S + boot, fix)
    read = read_tlog(save(log.data))
    assert read.boots[0].positions is not None
    assert read.boots[0].positions.source == "GPS_RAW_INT"
    assert any("receiver's own" in note for note in read.notes)


def test_a_frame_inside_a_payload_is_no_frame_of_its_own() -> None:
    log = Recorder()
    link = log.link()
    inner = struct.pack(">Q", int(UTC_S * 1e6)) + dialect.MAVLink_heartbeat_message(
        2, 3, 0, 0, 4, 3
    ).pack(link[0])
    data = list(inner) + [0] * (251 - len(inner))
    carrier = dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, data)
    log.add(link, UTC_S, carrier)
    log.add(link, UTC_S, dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
    frames = scan_frames(bytes(log.data))
    assert frames.message_id.tolist() == [110, 0]
    assert frames.skipped_bytes == 0


def test_checksums_equal_pymavlinks() -> None:
    from pymavlink.generator.mavcrc import x25crc

    from uavgram.io.logs.tlog.frames import compute_checksums

    rng = np.random.default_rng(4)
    data = rng.integers(0, 256, 5000, dtype=np.uint8)
    start, length = rng.integers(0, 4700, 300), rng.integers(0, 290, 300)
    start[:4], length[:4] = (0, 0, 3, 1), (0, 5, 9, 17)  # at the beginning of the file
    extra = rng.integers(0, 256, 300)
    found = compute_checksums(data, start, length, extra)
    for k in range(300):
        part = bytes(data[start[k] : start[k] + length[k]]) + bytes([extra[k]])
        assert x25crc(part).crc == found[k]


def test_of_records_that_overlap_each_is_kept_that_begins_behind_the_last_kept_one() -> None:
    rng = np.random.default_rng(3)
    for spread in (3, 12, 40):
        start = np.sort(rng.integers(8, 8 + 300 * spread, 300))
        end = start + rng.integers(1, 60, 300)
        of_one_byte = np.zeros(300, dtype=np.uint8)
        found = _Candidates(start, end, of_one_byte > 0, of_one_byte, of_one_byte.astype(np.int32))
        expected, free_from = [], 0
        for first, last in zip(start.tolist(), end.tolist(), strict=True):
            expected.append(first - 8 >= free_from)
            free_from = last if expected[-1] else free_from
        assert 0 < sum(expected) < 300
        assert _apart(found).tolist() == expected


# The simulated flight as a .tlog, read back by pymavlink and by our reader.


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
