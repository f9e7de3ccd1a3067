"""One damaged row of a log: left out and named, never taken and never the whole table's end."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
from log_mutants import short_logs

from uavgram.io.logs.dataflash.tables import index_binary
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.logs.messages import StatedValues
from uavgram.io.logs.samples import (
    compute_deviation,
    describe_left_out,
    find_plausible_rows,
    find_restarts,
    is_near_track,
    is_place,
    is_spike,
    merge_sigmas,
)
from uavgram.model.flight_log import FlightLog

ReadText = Callable[[str], FlightLog]
Change = Callable[[np.number], np.number]
"""Of a number as the log stores it: a scalar of the field's own type."""


class ReadChanged(Protocol):
    def __call__(
        self, message: str, rows: int | list[int] | slice, **fields: Change
    ) -> FlightLog: ...


@pytest.fixture(scope="module")
def good_text(repository: Path) -> str:
    """The first ten seconds of the flight as text."""
    return short_logs(repository / "logs")[".log"].decode("latin-1")


@pytest.fixture
def read_text(tmp_path: Path) -> ReadText:
    def read(text: str) -> FlightLog:
        path = tmp_path / "flight.log"
        path.write_text(text, encoding="latin-1")
        return read_flight_log(path)

    return read


@pytest.fixture
def read_changed(repository: Path, tmp_path: Path) -> ReadChanged:
    """Read the binary log with fields of some rows changed (raw numbers, as they are stored)."""

    def read(message: str, rows: int | list[int] | slice, **fields: Change) -> FlightLog:
        data = bytearray((repository / "logs" / "twin_short.BIN").read_bytes())
        (piece,) = index_binary("", bytes(data)).pieces[message]
        dtype = piece.format.dtype()
        assert dtype is not None
        assert dtype.fields is not None
        for row in np.atleast_1d(np.arange(len(piece.starts))[rows]):
            for name, change in fields.items():
                kind, offset = dtype.fields[name][:2]
                at = piece.starts[row] + 3 + offset
                old = np.frombuffer(data, kind, 1, at)[0]
                data[at : at + kind.itemsize] = np.array(change(old), kind).tobytes()
        path = tmp_path / "flight.BIN"
        path.write_bytes(data)
        return read_flight_log(path)

    return read


def test_the_undamaged_log_has_no_remark(read_text: ReadText, good_text: str) -> None:
    assert read_text(good_text).notes == ()


@pytest.mark.parametrize("number", ["nan", "-1", "7", "9" * 5000, ""])
def test_one_damaged_instance_does_not_cost_the_gimbal(
    read_text: ReadText, good_text: str, number: str
) -> None:
    whole = read_text(good_text).boots[0].gimbal
    assert whole is not None
    log = read_text(
        re.sub(r"^(MNT, \d+), 0,", rf"\1, {number},", good_text, count=1, flags=re.MULTILINE)
    )
    assert log.boots[0].gimbal is not None
    assert len(log.boots[0].gimbal.time_boot_s) == len(whole.time_boot_s) - 1
    assert any("MNT" in note and "dropped" in note for note in log.notes), log.notes


def test_a_format_stated_anew_in_mid_log_holds_from_there_on(
    read_text: ReadText, good_text: str
) -> None:
    lines = good_text.splitlines()
    mounts = [k for k, line in enumerate(lines) if line.startswith("MNT,")]
    (stated,) = (line for line in lines if line.startswith("FMT,") and ", MNT," in line)
    lines.insert(mounts[len(mounts) // 2], stated.replace("Pitch", "Patch"))
    whole, half = read_text(good_text), read_text("\n".join(lines))
    assert half.boots[0].gimbal is not None
    kept = half.boots[0].gimbal.pitch_rad
    assert whole.boots[0].gimbal is not None
    assert np.array_equal(kept, whole.boots[0].gimbal.pitch_rad[: len(kept)])
    assert len(kept) > 0.4 * len(mounts)
    assert any(note.startswith("the format of MNT changes at byte") for note in half.notes)
    assert any("MNT rows make no sense" in note for note in half.notes)


def test_a_format_number_of_5000_digits_is_skipped(read_text: ReadText, good_text: str) -> None:
    log = read_text(f"FMT, {'9' * 5000}, 20, NEW, Q, TimeUS\n{good_text}")
    assert any("format message at byte 0 makes no sense" in note for note in log.notes)


def test_rows_without_a_pitch_are_told_not_forgotten(read_text: ReadText, good_text: str) -> None:
    stated = re.sub(r"^(FMT,.* MNT,.*),Pitch", r"\1,Patch", good_text, flags=re.MULTILINE)
    log = read_text(stated)
    assert log.boots[0].gimbal is None
    assert any("no Pitch" in note for note in log.notes)


@pytest.mark.parametrize(
    ("message", "first", "second"),
    [("MNT", "Roll", "Pitch"), ("MNT", "TimeUS", "YawB"), ("ATT", "Roll", "Yaw")],
)
def test_field_names_that_were_exchanged_are_told(
    read_text: ReadText, good_text: str, message: str, first: str, second: str
) -> None:
    (stated,) = (x for x in good_text.splitlines() if x.startswith("FMT,") and f", {message}," in x)
    names = stated.rsplit(", ", 1)[1].split(",")
    i, j = names.index(first), names.index(second)
    names[i], names[j] = second, first
    log = read_text(good_text.replace(stated, f"{stated.rsplit(', ', 1)[0]}, {','.join(names)}"))
    assert any(f"the format of {message} names" in note for note in log.notes), log.notes


@pytest.mark.parametrize(
    ("message", "field", "change", "size"),
    [
        ("MNT", "Pitch", lambda old: old + 149, "by 149 degrees at 153.94 s"),
        ("MNT", "YawE", lambda old: old + 20, r"by 1[5-9]\.\d degrees at 153.94 s"),
        ("ATT", "Roll", lambda old: old + 15, r"by 1[3-5](\.\d)? degrees at 154.04 s"),
        ("POS", "Alt", lambda old: old + 13.1, "by 13.1 m at 154.04 s"),
        ("POS", "Lat", lambda old: old + 4096, r"by 45\.\d m at 154.04 s"),
    ],
)
def test_a_row_off_its_neighbours_is_left_out_by_name(
    read_changed: ReadChanged, message: str, field: str, change: Change, size: str
) -> None:
    row = {"MNT": 42}.get(message, 40)
    log = read_changed(message, row, **{field: change})
    (note,) = log.notes
    assert re.search(rf"\({message}: {size}", note), note
    boot = log.boots[0]
    table = {"MNT": boot.gimbal, "ATT": boot.attitudes, "POS": boot.positions}[message]
    assert table is not None
    assert len(table.time_boot_s) == (229 if message == "MNT" else 219)


def test_a_home_that_positions_contradict_is_left_out(read_changed: ReadChanged) -> None:
    log = read_changed("ORGN", 3, Alt=lambda old: old - 4096)
    assert log.boots[0].home is not None
    assert log.boots[0].home.height_m.tolist() == [584.08]
    assert any("home by ORGN at 41.94 s" in n and "-41.0 m" in n for n in log.notes), log.notes


def test_a_home_far_from_another_is_told(read_changed: ReadChanged) -> None:
    log = read_changed("ORGN", 3, Lat=lambda old: old + (1 << 16))
    assert any("home by ORGN moves by 727 m" in note for note in log.notes), log.notes


def test_attitudes_that_another_message_contradicts_are_told(read_changed: ReadChanged) -> None:
    log = read_changed("ATT", slice(100, 160), Roll=lambda old: old + 20)
    (note,) = log.notes
    assert "attitudes by ATT and by XKF1 contradict each other at 60 of 220 times" in note


def test_positions_that_the_receiver_contradicts_are_told(read_changed: ReadChanged) -> None:
    log = read_changed("POS", slice(100, 160), Lat=lambda old: old + 8000)
    (note,) = log.notes
    assert "positions by POS and by the receiver (GPS) contradict each other" in note
    assert "by 88" in note


def test_a_step_that_stays_and_a_turn_are_no_damage() -> None:
    time = np.arange(40, dtype=np.float64) * 0.1
    step = np.where(time > 2, 100.0, 0.0)[:, None]
    assert compute_deviation(time, step).max() == 0
    turn = np.column_stack([np.cos(time), np.sin(time)])
    assert compute_deviation(time, turn).max() < 0.011  # the acceleration of a step of 0.1 s
    turn[20] += 3
    assert np.flatnonzero(compute_deviation(time, turn) > 1).tolist() == [20]


def test_of_two_positions_that_no_aircraft_joins_neither_is_taken() -> None:
    time_s, height_m = np.array([1.0, 1.2]), np.array([50.0, 50.0])
    joined = is_near_track(time_s, np.array([47.4, 47.40001]), np.array([8.5, 8.5]), height_m)
    apart = is_near_track(time_s, np.array([47.4, 42.8]), np.array([8.5, 8.5]), height_m)
    assert joined.all()
    assert not apart.any()


def test_a_time_that_is_no_number_is_a_spike_and_no_restart() -> None:
    """Two infinite times side by side: their difference is no number."""
    time = np.array([1.0, 2.0, np.inf, np.inf, np.nan, 3.0, 4.0, 5.0])

    assert is_spike(time).tolist() == [False, False, True, True, True, False, False, False]
    assert find_restarts(time).tolist() == []


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (3, r"^home by ORGN moves by 23 m at 41.94 s since boot: was the vehicle carried there"),
        ([1, 3], r"^home by ORGN at 41.94 s since boot is 23 m off the estimator's origin"),
    ],
)
def test_a_home_that_jumps_or_lies_off_the_estimators_origin_is_told(
    read_changed: ReadChanged, rows: int | list[int] | slice, said: str
) -> None:
    log = read_changed("ORGN", rows, Lat=lambda old: old - 2048)
    assert any(re.search(said, note) for note in log.notes), log.notes


def test_rows_out_of_the_order_of_time_are_told(read_changed: ReadChanged) -> None:
    log = read_changed("ATT", 40, TimeUS=lambda old: old - 198_000)
    assert any(
        note.startswith("1 ATT rows are out of the order of time (the first at 153.85 s")
        for note in log.notes
    ), log.notes


def test_the_gimbals_messages_under_a_damaged_name_are_told(
    read_text: ReadText, good_text: str
) -> None:
    log = read_text(good_text.replace("MNT,", "MNU,"))
    assert log.boots[0].gimbal is None
    assert any(note.startswith("MNU messages look like the gimbal's (MNT)") for note in log.notes)


def test_damaged_bytes_that_are_almost_zero_are_no_place() -> None:
    """Of two rows no neighbours tell which one is damaged."""
    latitude = np.array([47.4, -6e-278, 0.0, 0.0, 1e-6])
    longitude = np.array([8.5, -3e-37, 0.0, 8.5, 0.0])
    assert is_place(latitude, longitude).tolist() == [True, False, False, True, True]


def test_times_that_utc_cannot_tell_apart_are_one_instant() -> None:
    time = np.array([1.0, 1.0 + 1e-7, 1.0 + 1e-6, 2.0])  # a damaged format makes such numbers
    assert find_plausible_rows(time, np.ones(4, dtype=bool)).tolist() == [0, 2, 3]


# Accuracies that logs state, and whether the receiver's solution was a fixed RTK one.


TIME_S = np.arange(6.0)
KNOWN = StatedValues("GPA", TIME_S, (np.full(6, 0.02), np.full(6, 0.03)))


def test_a_row_is_fixed_where_the_solutions_before_and_after_are() -> None:
    fix = np.array([3.0, 6.0, 6.0, 5.0, 6.0, 8.0])
    merged = merge_sigmas([KNOWN], [], StatedValues("GPS", TIME_S + 0.1, (fix,)))

    assert merged is not None
    assert merged.is_fixed.tolist() == [False, False, True, False, False, False]


def test_nothing_is_fixed_where_no_receiver_says_so() -> None:
    for fix in (None, StatedValues("GPS", np.zeros(0), (np.zeros(0),))):
        merged = merge_sigmas([KNOWN], [], fix)
        assert merged is not None
        assert not merged.is_fixed.any()


def test_rows_without_a_time_are_not_called_senseless() -> None:
    """Firmware of 2012 wrote attitudes without a time."""
    time_s = np.array([0.0, np.nan, 2.0, 1e9, np.nan])
    notes = describe_left_out("ATT", time_s, np.array([0, 2]))
    assert notes == (
        "1 of 5 ATT rows make no sense and were dropped",
        "2 of 5 ATT rows have no time and were dropped",
    )
