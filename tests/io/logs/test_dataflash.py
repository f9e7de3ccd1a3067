"""DataFlash logs: columns against pymavlink, meaning against a simulated flight, broken files."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from pymavlink import DFReader

from uavgram.errors import InputError
from uavgram.io.logs.dataflash.reader import read_dataflash
from uavgram.io.logs.dataflash.tables import (
    index_binary,
    index_by_loop,
    index_by_pymavlink,
    index_text,
)
from uavgram.io.logs.flight_log import read_flight_log


class PathOf(Protocol):
    def __call__(self, data: bytes, name: str = ...) -> Path: ...


REAL = (
    "calm_nadir/flight.BIN",
    "wind_oblique/flight.BIN",
    "logs/copter_3.4.4.bin",
    "logs/pymavlink_test.BIN",
)
USED = (
    *("POS", "ATT", "MNT", "GPS", "GPA", "CAM", "TRIG", "ORGN", "MSG", "VER", "BARO", "MODE"),
    *("PARM", "XKF1", "XKF4", "XKQ", "XKV1", "NKF1", "NKF4", "NKQ1"),
    *("EKF1", "EKF4", "GPS2", "GPA2", "NKV1", "NKQ", "XKQ1"),
)


@pytest.fixture
def path_of(tmp_path: Path) -> PathOf:
    """Write bytes to a file of their own."""

    def write(data: bytes, name: str = "cut.BIN") -> Path:
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


@pytest.mark.parametrize("name", REAL)
def test_every_field_equals_pymavlinks(data_dir: Path, name: str) -> None:
    path = data_dir / name
    tables = index_binary(str(path), path.read_bytes())
    reader = DFReader.DFReader_binary(str(path))
    expected: dict[tuple[str, str], list[Any]] = {}
    while (message := reader.recv_match(type=USED, strict=True)) is not None:
        for field in message.get_fieldnames():
            expected.setdefault((message.get_type(), field), []).append(getattr(message, field))
    reader.close()
    assert len(expected) > 40
    for (message, field), values in expected.items():
        column = tables.columns(message)[field][: len(values)]
        # pymavlink's index counts an incomplete last message, its loop does not
        assert tables.count(message) == len(values), message
        if column.dtype.kind == "S":
            assert [c.split(b"\0")[0].decode("latin-1") for c in column] == values
        else:
            np.testing.assert_array_equal(column, np.array(values), err_msg=f"{message}.{field}")


@pytest.mark.parametrize("name", REAL)
def test_the_loop_finds_the_messages_that_the_compiled_indexer_finds(
    data_dir: Path, name: str
) -> None:
    data = (data_dir / name).read_bytes()
    compiled = index_by_pymavlink(data)
    if compiled is None:
        pytest.skip("this pymavlink has no compiled indexer")
    loop = index_by_loop(data)
    assert compiled[129:] == loop[129:]


def test_tables_of_a_flight_have_their_meaning(data_dir: Path) -> None:
    log = read_dataflash(data_dir / "wind_oblique" / "flight.BIN")
    (boot,) = log.boots
    assert log.vehicle == "ArduCopter"
    assert log.firmware.startswith("ArduCopter V4.7.0-dev")
    assert boot.positions is not None
    assert boot.positions.source == "POS"
    assert boot.positions.datum == "msl"
    assert abs(boot.positions.height_m.max() - boot.positions.height_home_m.max() - 584.45) < 0.3
    assert boot.attitudes is not None
    assert np.allclose(np.linalg.norm(boot.attitudes.ned_from_body_xyzw, axis=1), 1)
    assert boot.gimbal is None
    assert log.undulation_m == pytest.approx(0.0, abs=1e-9)
    assert boot.sigmas is not None
    assert 0.25 < np.median(boot.sigmas.horizontal_m) < 0.4
    assert 0.1 < np.degrees(np.median(boot.sigmas.tilt_rad)) < 2
    assert boot.home is not None
    assert boot.home.height_m[0] == 584.45


def test_triggers_without_feedback_are_kept_as_unconfirmed_and_named(data_dir: Path) -> None:
    log = read_dataflash(data_dir / "wind_oblique" / "flight.BIN")
    events = log.boots[0].events
    assert events is not None
    assert events.source == "TRIG+CAM"
    assert len(events.time_boot_s) == 65
    assert events.image_number[events.confirmed == 0].tolist() == [17, 34, 51]
    assert events.time_boot_s[0] == pytest.approx(83.531574, abs=1e-9)  # CAM, not TRIG (83.411622)
    assert any("17, 34, 51" in note for note in log.notes)


def test_the_gimbals_yaw_is_from_north_where_the_log_has_it(data_dir: Path) -> None:
    gimbal = read_dataflash(data_dir / "calm_nadir" / "flight.BIN").boots[0].gimbal
    assert gimbal is not None
    assert gimbal.yaw_frame == "earth"
    assert np.degrees(np.median(gimbal.pitch_rad)) == pytest.approx(-89.98, abs=0.01)


def test_gps_time_is_tied_to_the_arrival_of_the_fix(
    data_dir: Path, truth: Callable[[str], dict[str, Any]]
) -> None:
    (clock,) = read_dataflash(data_dir / "calm_nadir" / "flight.BIN").boots[0].clocks
    boot_to_utc = truth("calm_nadir")["boot_to_utc_s"]
    assert np.abs(clock.utc_s - clock.time_boot_s - boot_to_utc).max() < 1e-5


def test_an_old_firmware_is_read(data_dir: Path) -> None:
    log = read_dataflash(data_dir / "logs" / "copter_3.4.4.bin")
    boot = log.boots[0]
    assert log.firmware == "APM:Copter V3.4.4-rc1 (65ffe9d7)"
    assert boot.positions is not None
    assert len(boot.positions.time_boot_s) == 1502
    assert np.isfinite(boot.positions.height_home_m).all()  # the field's old name, RelAlt
    assert boot.sigmas is not None
    assert boot.sigmas.source == "GPA+NKF4"


def test_a_log_without_pos_falls_back_to_the_estimator_and_then_to_the_receiver(
    data_dir: Path, path_of: PathOf
) -> None:
    path = data_dir / "calm_nadir" / "flight.BIN"
    data = path.read_bytes()
    reference = read_dataflash(path).boots[0].positions
    assert reference is not None

    def without(*names: str) -> bytes:
        table = index_binary(str(path), data)
        order = sorted(
            (at, piece.format.length)
            for name, pieces in table.pieces.items()
            for piece in pieces
            for at in piece.starts
            if name not in names
        )
        return b"".join(data[at : at + length] for at, length in order)

    for names, source, tolerance_m in ((("POS",), "XKF1+ORGN", 0.2), (("POS", "XKF1"), "GPS", 2)):
        cut = path_of(without(*names))
        boot = read_dataflash(cut).boots[0]
        found = boot.positions
        assert found is not None
        assert found.source == source
        inside = (found.time_boot_s > 60) & (found.time_boot_s < 280)
        north = np.interp(found.time_boot_s, reference.time_boot_s, reference.latitude_deg)
        assert np.abs(found.latitude_deg - north)[inside].max() * 111e3 < tolerance_m
        height = np.interp(found.time_boot_s, reference.time_boot_s, reference.height_m)
        assert np.abs(found.height_m - height)[inside].max() < 1.5


@pytest.mark.parametrize("name", ["calm_nadir/flight.BIN", "logs/copter_3.4.4.bin"])
def test_a_text_log_gives_the_columns_of_its_binary_form(
    data_dir: Path, name: str, path_of: PathOf
) -> None:
    path = data_dir / name
    reader = DFReader.DFReader_binary(str(path))
    lines = []
    while (message := reader.recv_match(type=[*USED, "FMT"], strict=True)) is not None:
        values = (getattr(message, field) for field in message.get_fieldnames())
        lines.append(", ".join([message.get_type(), *(str(v) for v in values)]))
    reader.close()
    text_path = path_of("\n".join(lines).encode("latin-1"), "flight.log")
    binary, text = read_dataflash(path).boots[0], read_dataflash(text_path).boots[0]
    assert binary.positions is not None
    assert text.positions is not None
    np.testing.assert_array_equal(binary.positions.latitude_deg, text.positions.latitude_deg)
    assert binary.attitudes is not None
    assert text.attitudes is not None
    np.testing.assert_array_equal(
        binary.attitudes.ned_from_body_xyzw, text.attitudes.ned_from_body_xyzw
    )
    np.testing.assert_array_equal(binary.clocks[0].utc_s, text.clocks[0].utc_s)
    if binary.events is not None:
        assert text.events is not None
        np.testing.assert_array_equal(binary.events.time_boot_s, text.events.time_boot_s)


def test_text_fields_keep_their_commas() -> None:
    tables = index_text(
        "x.log",
        b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
        b"FMT, 134, 75, MSG, QZ, TimeUS,Message\n"
        b"MSG, 5, one, two\n"
        b"??? , nothing\n",
    )
    assert tables.columns("MSG")["Message"].tolist() == [b"one, two"]
    assert tables.columns("MSG")["TimeUS"].tolist() == [5]
    assert tables.notes == ("1 lines belong to no defined message",)


def test_two_logs_in_one_file_are_two_boots(data_dir: Path, path_of: PathOf) -> None:
    data = (data_dir / "calm_nadir" / "flight.BIN").read_bytes()
    log = read_dataflash(path_of(data + data))
    assert len(log.boots) == 2
    assert log.boots[0].positions is not None
    assert log.boots[1].positions is not None
    np.testing.assert_array_equal(log.boots[0].positions.height_m, log.boots[1].positions.height_m)


def test_a_truncated_tail_costs_one_message_and_is_noted(data_dir: Path, path_of: PathOf) -> None:
    data = (data_dir / "calm_nadir" / "flight.BIN").read_bytes()
    log = read_dataflash(path_of(data[:1_000_003]))
    assert any("belong to no complete message" in note for note in log.notes)
    assert log.boots[0].positions is not None
    assert len(log.boots[0].positions.time_boot_s) > 1000


def test_damaged_rows_do_not_reach_the_track(data_dir: Path, path_of: PathOf) -> None:
    path = data_dir / "calm_nadir" / "flight.BIN"
    data = bytearray(path.read_bytes())
    starts = index_binary(str(path), bytes(data)).places("POS")
    struct.pack_into("<Q", data, int(starts[100]) + 3, 2**40)  # a wild time
    struct.pack_into("<i", data, int(starts[200]) + 11, 0)  # latitude 0
    struct.pack_into("<f", data, int(starts[300]) + 19, float("nan"))  # no altitude
    clean, log = read_dataflash(path), read_dataflash(path_of(bytes(data)))
    assert clean.boots[0].positions is not None
    kept = np.delete(clean.boots[0].positions.time_boot_s, [100, 200, 300])
    assert log.boots[0].positions is not None
    np.testing.assert_array_equal(log.boots[0].positions.time_boot_s, kept)
    assert "3 of 2631 POS rows make no sense and were dropped" in log.notes


def test_skipped_bytes_print_nothing(
    data_dir: Path, capfd: pytest.CaptureFixture[str], path_of: PathOf
) -> None:
    data = bytearray((data_dir / "calm_nadir" / "flight.BIN").read_bytes())
    data[300_000:300_600] = bytes(600)
    log = read_dataflash(path_of(bytes(data)))
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err == ""
    assert any("belong to no complete message" in note for note in log.notes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"hello world\n" * 1000, "is no DataFlash log"),
        (np.random.default_rng(1).bytes(100_000), "is no DataFlash log"),
        (b"\xa3\x95\x80", "no complete message"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n", "no complete message"),
    ],
)
def test_what_is_no_log_is_refused_by_name(content: bytes, words: str, path_of: PathOf) -> None:
    path = path_of(content, "flight.bin")
    with pytest.raises(InputError, match=words) as caught:
        read_dataflash(path)
    assert caught.value.path == str(path)


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_dataflash(tmp_path / "none.BIN")


def test_a_log_without_positions_says_what_it_holds(data_dir: Path, path_of: PathOf) -> None:
    path = data_dir / "calm_nadir" / "flight.BIN"
    data = path.read_bytes()
    tables = index_binary(str(path), data)
    parts = [
        data[at : at + piece.format.length]
        for name in ("FMT", "ATT", "BARO")
        for piece in tables.pieces[name]
        for at in piece.starts
    ]
    with pytest.raises(InputError, match="it holds ATT, BARO, FMT"):
        read_flight_log(path_of(b"".join(parts)))


def message(number: int, layout: str, *values: float | bytes) -> bytes:
    return b"\xa3\x95" + bytes([number]) + struct.pack("<" + layout, *values)


def defined(number: int, layout: str, name: str, characters: str, fields: str) -> bytes:
    length = 3 + struct.calcsize("<" + layout)
    texts = (name.encode(), characters.encode(), fields.encode())
    return message(0x80, "BB4s16s64s", number, length, *texts)


FMT = defined(0x80, "BB4s16s64s", "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")


def positions(count: int = 40, start_s: float = 10.0) -> bytes:
    """A POS format and rows at 10 Hz."""
    fmt = defined(1, "Qiiff", "POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt")
    rows = (
        message(1, "Qiiff", round((start_s + k / 10) * 1e6), -353600000 + k, 1491600000, 600, 60)
        for k in range(count)
    )
    return FMT + fmt + b"".join(rows)


def test_a_format_that_changes_midway_is_followed(path_of: PathOf) -> None:
    old = defined(2, "Qf", "CAM", "Qf", "TimeUS,X")
    new = defined(2, "QHf", "CAM", "QHf", "TimeUS,Img,X")
    rows_old = b"".join(message(2, "Qf", int((11 + k) * 1e6), 1.5) for k in range(3))
    rows_new = b"".join(message(2, "QHf", int((20 + k) * 1e6), k, 2.5) for k in range(4))
    data = positions() + old + rows_old + new + rows_new
    tables = index_binary("x", data)
    columns = tables.columns("CAM")
    assert columns["TimeUS"].tolist() == [11e6, 12e6, 13e6, 20e6, 21e6, 22e6, 23e6]
    np.testing.assert_array_equal(columns["Img"], [np.nan] * 3 + [0, 1, 2, 3])
    assert columns["X"].tolist() == [1.5] * 3 + [2.5] * 4
    assert any("format of CAM changes" in note for note in tables.notes)
    events = read_dataflash(path_of(data)).boots[0].events
    assert events is not None
    assert len(events.time_boot_s) == 7


def test_a_log_of_2014_is_complete() -> None:
    """ArduCopter 3.1.3 names four of its FMT's five fields, and none of STRT, which has none."""
    fmt = defined(0x80, "BB4s16s64s", "FMT", "BBnNZ", "Type,Length,Name,Format")
    start = defined(10, "", "STRT", "", "")
    data = fmt + start + message(10, "") + positions()[len(FMT) :]
    tables = index_binary("x", data)

    assert tables.notes == ()
    assert (tables.count("POS"), tables.count("STRT"), tables.count("FMT")) == (40, 1, 3)
    assert tables.columns("STRT") == {}
    assert tables.columns("FMT")["Name"].tolist() == [b"FMT", b"STRT", b"POS"]


def test_a_text_log_of_2014_is_complete() -> None:
    tables = index_text(
        "x.log",
        b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n"
        b"FMT, 10, 3, STRT, , \n"
        b"FMT, 13, 4, EV, B, Id\n"
        b"STRT\nEV, 10\n",
    )

    assert tables.notes == ()
    assert (tables.count("STRT"), tables.columns("EV")["Id"].tolist()) == (1, [10])


def test_the_index_goes_on_behind_an_unknown_type() -> None:
    data = positions(3000)
    behind = positions(20, 310.0)[len(positions(0)) :]  # too little for the file to be suspicious
    assert index_binary("x", data + b"\xa3\x95\x99 garbage" + behind).count("POS") == 3020


def test_images_counted_twice_and_lost_ones_are_named(path_of: PathOf) -> None:
    cam = defined(2, "QH", "CAM", "QH", "TimeUS,Img")
    numbers = (1, 2, 3, 3, 4, 6, 7)
    rows = b"".join(message(2, "QH", int((10.5 + k / 2) * 1e6), n) for k, n in enumerate(numbers))
    log = read_dataflash(path_of(positions() + cam + rows))
    events = log.boots[0].events
    assert events is not None
    assert (events.repeated, events.lost, events.instant) == ((3,), (5,), "command")
    assert "1 image numbers occur more than once in CAM: 3" in log.notes
    assert "1 image numbers are missing in CAM: 5" in log.notes


def test_feedback_and_command_are_told_apart(data_dir: Path) -> None:
    found = {
        name: read_dataflash(data_dir / name / "flight.BIN").boots[0].events
        for name in ("calm_nadir", "wind_oblique")
    }
    assert {name: events and events.instant for name, events in found.items()} == {
        "calm_nadir": "command",
        "wind_oblique": "feedback",
    }


def test_cam_without_boot_time_is_placed_by_its_gps_time(path_of: PathOf) -> None:
    # as firmware before 3.3 wrote them
    gps = defined(3, "BIHiifI", "GPS", "BIHLLfI", "Status,TimeMS,Week,Lat,Lng,Alt,T")
    cam = defined(2, "IHiif", "CAM", "IHLLf", "GPSTime,GPSWeek,Lat,Lng,Alt")
    fixes = b"".join(
        message(
            3, "BIHiifI", 3, 5_000_000 + 200 * k, 1800, 470000000, 80000000, 500, 60_000 + 200 * k
        )
        for k in range(50)
    )
    shots = b"".join(
        message(2, "IHiif", 5_000_000 + 200 * k, 1800, 470000000, 80000000, 500)
        for k in (5, 20, 31)
    )
    log = read_dataflash(path_of(FMT + gps + cam + fixes + shots))
    events = log.boots[0].events
    assert events is not None
    assert events.time_boot_s.tolist() == pytest.approx([61.0, 64.0, 66.2])
    assert any("no boot time" in note for note in log.notes)


def test_the_second_receiver_stands_in_where_the_first_has_no_fix(path_of: PathOf) -> None:
    formats = [
        defined(n, "QBiif", name, "QBLLf", "TimeUS,Status,Lat,Lng,Alt")
        for n, name in ((3, "GPS"), (4, "GPS2"))
    ]
    rows = b"".join(
        message(3, "QBiif", k * 200_000, 1, 0, 0, 0)
        + message(4, "QBiif", k * 200_000, 3, 470000000 + k, 80000000, 500)
        for k in range(1, 40)
    )
    log = read_dataflash(path_of(FMT + b"".join(formats) + rows))
    assert log.boots[0].positions is not None
    assert len(log.boots[0].positions.time_boot_s) == 39


def test_several_boots_of_a_text_log_are_told_apart(path_of: PathOf) -> None:
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 1, 27, POS, QLLff, TimeUS,Lat,Lng,Alt,RelHomeAlt",
    ]
    for _ in range(2):
        lines += [f"POS, {10_000_000 + 100_000 * k}, 47.0, 8.0, 500, 50" for k in range(30)]
    log = read_dataflash(path_of("\n".join(lines).encode(), "flight.log"))
    assert [b.positions and len(b.positions.time_boot_s) for b in log.boots] == [30, 30]


def test_a_position_with_a_flipped_bit_is_dropped(path_of: PathOf) -> None:
    data = bytearray(positions(60))
    starts = index_binary("x", bytes(data)).places("POS")
    data[int(starts[30]) + 3 + 8 + 2] ^= 0x10  # latitude off by a tenth of a degree
    data[int(starts[40]) + 3 + 16 + 2] ^= 0x20  # height off by far
    log = read_dataflash(path_of(bytes(data)))
    assert log.boots[0].positions is not None
    assert len(log.boots[0].positions.time_boot_s) == 58
