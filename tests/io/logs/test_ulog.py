"""PX4 logs: columns against pyulog, meaning against written flights, old and new names, damage."""

from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
import ulog_writer
from pyulog import ULog

from uavgram.errors import InputError
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.logs.messages import Topic
from uavgram.io.logs.ulog.reader import TOPICS, _is_global, read_ulog, unproject_local
from uavgram.io.logs.ulog.tables import read_tables


class Save(Protocol):
    def __call__(self, data: bytes, name: str = ...) -> Path: ...


REAL = (
    "sample.ulg",
    "sample_appended_multiple.ulg",
    "sample_log_small.ulg",
    "sample_logging_tagged_and_default_params.ulg",
    "sample_px4_events.ulg",
)


@pytest.fixture
def save(tmp_path: Path) -> Save:
    def write(data: bytes, name: str = "flight.ulg") -> Path:
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


@pytest.mark.parametrize("name", REAL)
def test_every_field_equals_pyulogs(data_dir: Path, name: str) -> None:
    path = data_dir / "logs" / name
    tables = read_tables(path)
    expected = [d for d in ULog(str(path)).data_list if len(d.data["timestamp"])]
    assert sum(len(topics) for topics in tables.topics.values()) == len(expected) > 10
    for d in expected:
        same = [t for t in tables.topics[d.name] if len(t.time_s) == len(d.data["timestamp"])]
        assert any(
            all(np.array_equal(t.fields[f], d.data[f], equal_nan=True) for f in d.data)
            for t in same
        ), d.name


@pytest.mark.parametrize("name", REAL)
def test_topics_that_are_not_wanted_are_counted_all_the_same(data_dir: Path, name: str) -> None:
    path = data_dir / "logs" / name
    every, some = read_tables(path), read_tables(path, TOPICS)
    assert set(some.topics) == set(every.topics) & set(TOPICS) != set()
    assert some.started_s == every.started_s
    assert list(some.counts) == list(every.counts) == list(every.topics)
    for topic, instances in every.topics.items():
        time = np.concatenate([t.time_s for t in instances])
        stamped = time[np.concatenate([t.fields["timestamp"] for t in instances]) > 0]
        found = some.counts[topic]
        assert found.rows == every.counts[topic].rows == len(time)
        edges = [stamped.min(), stamped.max()] if len(stamped) else [np.nan, np.nan]
        np.testing.assert_array_equal([found.first_s, found.last_s], edges)
    with pytest.raises(KeyError):
        some.topic("of nobody")


def test_what_the_system_says_of_itself_equals_pyulogs(data_dir: Path) -> None:
    for name in REAL:
        path = data_dir / "logs" / name
        ours, log = read_tables(path), ULog(str(path))
        assert ours.info == {
            k: bytes(v) if isinstance(v, bytes) else v for k, v in log.msg_info_dict.items()
        }
        assert ours.parameters == log.initial_parameters
        assert len(ours.parameters) > 5


def test_messages_of_any_length_are_followed_across_the_pieces_that_are_read(save: Save) -> None:
    rows = [(k + 1, bytes([k % 256] * 60_000)) for k in range(40)]
    fields = ("uint64_t timestamp", "uint8_t[60000] filling")
    small = [(k + 1, k) for k in range(0, 40_000, 3)]
    topics: dict[str, ulog_writer.Topic] = {
        "large": (fields, rows), "small": (("uint64_t timestamp", "uint16_t count"), small),
    }  # fmt: skip
    tables = read_tables(save(ulog_writer.ulog(topics)), ("small",))
    found = tables.topic("small")
    assert found is not None
    assert found.fields["count"].tolist() == [count for _, count in small]
    assert tables.counts["large"].rows == 40
    assert tables.notes == ()


def test_nested_topics_and_filling_are_taken_apart_as_pyulog_does(save: Save) -> None:
    topics: dict[str, ulog_writer.Topic] = {
        "whole": (
            ("uint64_t timestamp", "float x", "uint8_t[3] _padding0"),
            [(5, 1.5, (0, 0, 0)), (6, 2.5, (0, 0, 0))],
        ),
    }
    data = ulog_writer.ulog(topics)
    # a format within a format within another, told apart from rows of their own
    nested = ulog_writer.message("F", b"inner:int16_t[2] a;uint8_t b;")
    nested += ulog_writer.message("F", b"middle:inner[2] i;double d;")
    nested += ulog_writer.message("F", b"outer:uint64_t timestamp;middle m;bool last;")
    at = data.index(ulog_writer.message("F", b"whole")[2:]) - 2
    data = data[:at] + nested + data[at:]
    data += ulog_writer.message("A", b"\0\x07\0outer")
    data += ulog_writer.message("D", b"\x07\0" + bytes(range(1, 28)))
    path = save(data)
    ours = {name: instances[0].fields for name, instances in read_tables(path).topics.items()}
    theirs = {d.name: d.data for d in ULog(str(path)).data_list}
    assert list(ours["outer"]) == list(theirs["outer"])
    assert "m.i[1].a[0]" in ours["outer"]
    assert all(np.array_equal(ours["outer"][f], theirs["outer"][f]) for f in theirs["outer"])
    # which pyulog 1.3 takes for damage where a logger does write the filling
    assert list(ours["whole"]) == ["timestamp", "x"]
    assert ours["whole"]["x"].tolist() == [1.5, 2.5]


def test_damage_costs_the_messages_that_it_hits(save: Save, data_dir: Path) -> None:
    path = data_dir / "logs" / "sample_px4_events.ulg"
    whole = read_tables(path)
    rows = sum(count.rows for count in whole.counts.values())
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(4)
    for at in rng.integers(200_000, len(data), 60).tolist():
        data[at : at + 3] = rng.bytes(3)
    damaged = read_tables(save(bytes(data)))
    found = sum(count.rows for count in damaged.counts.values())
    assert rows - 2 * 60 < found < rows  # the logger's own recovery mark comes every 500 ms only
    assert damaged.notes[0].startswith("the file is damaged or cut")


def test_flags_that_nobody_here_knows_are_refused(save: Save) -> None:
    data = bytearray(ulog_writer.ulog(ulog_writer.flight()))
    data[16 + 3 + 8] = 2
    with pytest.raises(InputError, match="of a kind that is not known here"):
        read_ulog(save(bytes(data)))


@pytest.mark.parametrize(
    ("name", "source", "rows", "firmware"),
    [
        ("sample_px4_events.ulg", "vehicle_global_position", 109, "PX4 v1.15.0 (development"),
        (
            "sample_logging_tagged_and_default_params.ulg",
            "vehicle_local_position",
            130,
            "PX4 v1.13.0",
        ),
        ("sample_log_small.ulg", "vehicle_gps_position", 32, "PX4 v1.11.2"),
    ],
)
def test_the_best_position_that_a_log_has_is_taken(
    data_dir: Path, name: str, source: str, rows: int, firmware: str
) -> None:
    log = read_flight_log(data_dir / "logs" / name)
    positions = log.boots[0].positions
    assert positions is not None
    assert (log.kind, positions.source, len(positions.time_boot_s)) == ("ulog", source, rows)
    assert log.firmware.startswith(firmware)


def test_a_log_without_positions_is_read_but_refused_where_they_are_needed(data_dir: Path) -> None:
    path = data_dir / "logs" / "sample.ulg"
    log = read_flight_log(path, positions_needed=False)
    assert log.boots[0].positions is None
    assert log.boots[0].attitudes is not None
    assert len(log.boots[0].attitudes.time_boot_s) == 6461
    with pytest.raises(InputError, match="holds no usable position"):
        read_flight_log(path)


def test_the_local_frame_is_put_on_the_earth_as_px4_does(data_dir: Path) -> None:
    path = data_dir / "logs" / "sample_px4_events.ulg"
    tables = read_tables(path)
    local, world = tables.topic("vehicle_local_position"), tables.topic("vehicle_global_position")
    assert local is not None
    assert world is not None
    latitude, longitude, height = unproject_local(local)
    # both topics are published with one time by the estimator
    tied = _is_global(local)
    shared, a, b = np.intersect1d(local.time_s[tied], world.time_s, return_indices=True)
    assert len(shared) > 50
    assert np.abs(latitude[tied][a] - world.column("lat")[b]).max() < 1e-8
    assert np.abs(longitude[tied][a] - world.column("lon")[b]).max() < 1e-8
    assert np.abs(height[tied][a] - world.column("alt")[b]).max() < 0.01


def test_the_local_frame_is_an_azimuthal_equidistant_projection() -> None:
    from pyproj import Transformer

    rng = np.random.default_rng(1)
    east, north = rng.uniform(-5000, 5000, (2, 50))
    fields = {"x": north, "y": east, "z": np.full(50, -20.0), "ref_alt": np.full(50, 480.0)}
    fields |= {"ref_lat": np.full(50, 63.4), "ref_lon": np.full(50, 10.4)}
    latitude, longitude, height = unproject_local(Topic("local", np.arange(50.0), fields))
    sphere = "+proj=aeqd +R=6371000 +lat_0=63.4 +lon_0=10.4"
    to_degrees = Transformer.from_crs(sphere, "+proj=longlat +R=6371000", always_xy=True)
    expected = to_degrees.transform(east, north)
    np.testing.assert_allclose(longitude, expected[0], atol=1e-10)
    np.testing.assert_allclose(latitude, expected[1], atol=1e-10)
    np.testing.assert_array_equal(height, 500.0)


def test_the_simulators_boot_clock_of_the_day_is_counted_from_the_start(data_dir: Path) -> None:
    log = read_ulog(data_dir / "logs" / "sample_px4_events.ulg")
    assert log.boots[0].positions is not None
    assert 10 < log.boots[0].positions.time_boot_s[0] < 11
    assert any("time of day" in note for note in log.notes)


def test_the_undulation_is_the_receivers(data_dir: Path) -> None:
    # its first row: alt_ellipsoid 106766 mm, alt 66814 mm (by pyulog)
    assert read_ulog(data_dir / "logs" / "sample_log_small.ulg").undulation_m == pytest.approx(
        39.95, abs=0.01
    )


@pytest.mark.parametrize("gps", ["old", "new"])
def test_old_and_new_names_of_the_receivers_fields_are_read(save: Save, gps: str) -> None:
    log = read_ulog(save(ulog_writer.ulog(ulog_writer.flight(gps=gps))))
    (boot,) = log.boots
    assert log.undulation_m == pytest.approx(ulog_writer.UNDULATION_M, abs=1e-3)
    np.testing.assert_allclose(
        boot.clocks[0].utc_s - boot.clocks[0].time_boot_s, ulog_writer.UTC_S, atol=1e-6
    )
    assert boot.sigmas is not None
    assert np.median(boot.sigmas.horizontal_m) == pytest.approx(0.8)  # the larger of 0.5 and 0.8
    assert boot.home is not None
    assert boot.home.height_m[0] == 440.0
    topics = ulog_writer.flight(gps=gps)
    del topics["vehicle_global_position"]
    found = read_ulog(save(ulog_writer.ulog(topics))).boots[0].positions
    assert found is not None
    assert found.source == "vehicle_gps_position"
    assert found.latitude_deg[0] == pytest.approx(ulog_writer.LATITUDE, abs=1e-7)
    assert found.height_m[0] == pytest.approx(500.0)


def test_attitude_is_body_to_ned(save: Save) -> None:
    from scipy.spatial.transform import Rotation

    boot = read_ulog(save(ulog_writer.ulog(ulog_writer.flight()))).boots[0]
    assert boot.attitudes is not None
    yaw = Rotation.from_quat(boot.attitudes.ned_from_body_xyzw).as_euler("ZYX", degrees=True)[:, 0]
    np.testing.assert_allclose(yaw, 90.0, atol=1e-4)


def test_commands_without_feedback_are_missed_shots_by_time_not_by_number(save: Save) -> None:
    topics = ulog_writer.flight()
    shots = [12.0, 14.0, 18.0, 20.0]  # none after the command at 15.9
    commands = [11.9, 13.9, 15.9, 17.9, 19.9]
    topics["camera_capture"] = (
        ulog_writer.CAPTURE,
        [ulog_writer.capture(t, k) for k, t in enumerate(shots)],
    )
    topics["camera_trigger"] = (
        ulog_writer.TRIGGER,
        [(ulog_writer.us(t), 0, k, False) for k, t in enumerate(commands)]
        + [(ulog_writer.us(t), 0, k, True) for k, t in enumerate(shots)],
    )
    events = read_ulog(save(ulog_writer.ulog(topics))).boots[0].events
    assert events is not None
    assert events.source == "camera_capture+camera_trigger"
    assert events.instant == "feedback"
    assert events.time_boot_s.tolist() == pytest.approx([12.0, 14.0, 15.9, 18.0, 20.0])
    assert events.confirmed.tolist() == [1, 1, 0, 1, 1]
    assert events.image_number.tolist() == [0, 1, -1, 2, 3]


def test_triggers_alone_are_commands(save: Save) -> None:
    topics = ulog_writer.flight()
    topics["camera_trigger"] = (
        ulog_writer.TRIGGER,
        [(ulog_writer.us(t), 0, k, False) for k, t in enumerate((12.0, 14.0, 18.0))],
    )
    events = read_ulog(save(ulog_writer.ulog(topics))).boots[0].events
    assert events is not None
    assert (events.source, events.instant) == ("camera_trigger", "command")
    assert events.confirmed.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("topic", "fields", "row", "frame", "yaw_deg"),
    [
        (
            "gimbal_device_attitude_status",
            "GIMBAL",
            ((0.5**0.5, 0, 0, 0.5**0.5), 32),
            "vehicle",
            90,
        ),
        ("gimbal_device_attitude_status", "GIMBAL", ((0.5**0.5, 0, 0, 0.5**0.5), 64), "earth", 90),
        ("mount_orientation", "MOUNT", ((0.0, -1.5, 0.5),), "vehicle", 28.6479),
    ],
)
def test_both_gimbal_topics_are_read(
    save: Save, topic: str, fields: str, row: tuple[object, ...], frame: str, yaw_deg: float
) -> None:
    topics = ulog_writer.flight()
    rows = [(ulog_writer.us(11 + k / 10), *row) for k in range(50)]
    topics[topic] = (getattr(ulog_writer, fields), rows)
    gimbal = read_ulog(save(ulog_writer.ulog(topics))).boots[0].gimbal
    assert gimbal is not None
    assert (gimbal.source, gimbal.yaw_frame) == (topic, frame)
    np.testing.assert_allclose(np.degrees(gimbal.yaw_rad), yaw_deg, atol=1e-3)


def test_a_cut_log_is_read_as_far_as_it_goes(data_dir: Path, save: Save) -> None:
    data = (data_dir / "logs" / "sample_px4_events.ulg").read_bytes()
    whole = read_ulog(data_dir / "logs" / "sample_px4_events.ulg")
    part = read_ulog(save(data[: len(data) // 2 + 1]))
    assert part.boots[0].attitudes is not None
    assert 100 < len(part.boots[0].attitudes.time_boot_s) < 500
    assert whole.boots[0].attitudes is not None
    assert len(whole.boots[0].attitudes.time_boot_s) == 622


@pytest.mark.parametrize("left", [1, 2, 3, 4])
def test_a_log_cut_inside_of_a_header_ends(save: Save, left: int) -> None:
    data = ulog_writer.ulog(ulog_writer.flight())
    tables = read_tables(save(data + b"\x10\0D\0"[:left]))
    assert len(tables.topics["vehicle_attitude"][0].time_s) == 200
    assert tables.notes == ("the file is damaged or cut: what could be read was read",)


def test_appended_data_is_read_and_said(data_dir: Path) -> None:
    log = read_ulog(data_dir / "logs" / "sample_appended_multiple.ulg")
    assert sum(m.count for m in log.messages) == 6852
    assert "data was appended after a crash of the autopilot" in log.notes


def test_a_log_cut_in_its_definitions_ends(save: Save) -> None:
    data = ulog_writer.ulog(ulog_writer.flight())
    at = data.index(b"vehicle_attitude:") - 3
    with pytest.raises(InputError, match=r"damaged beyond use|no complete message"):
        read_ulog(save(data[:at] + b"\x40\x00\x00" + data[at : at + 30]))


@pytest.mark.parametrize("content", [b"", b"ULog", b"hello" * 100, b"ULog\x01\x12\x35" + bytes(9)])
def test_what_is_no_ulog_is_refused(save: Save, content: bytes) -> None:
    with pytest.raises(InputError):
        read_ulog(save(content))
