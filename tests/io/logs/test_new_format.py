"""A log format that does not exist, read by a table and twenty lines: all that a new one needs.

Its lines are a kind of message, milliseconds since boot, and numbers.
"""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.boots import StatedResets, Table, build_log
from uavgram.io.logs.messages import Messages, Row, Topic
from uavgram.model.flight_log import FlightLog

FIELDS = {
    "place": ("lat_e7", "lon_e7", "alt_cm", "above_home_cm"),
    "angles": ("roll_deg", "pitch_deg", "yaw_deg"),
    "speed": ("north_cm_s", "east_cm_s", "down_cm_s"),
    "gnss": ("lat_e7", "lon_e7", "alt_cm", "ellipsoid_cm", "satellites", "utc_s", "fix"),
    "shot": ("number", "confirmed"),
    "count": ("resets",),
}


class Lines(Messages):
    """The messages of one boot."""

    def __init__(self, text: str) -> None:
        self.rows = [line.split(",") for line in text.splitlines()]

    def read(self, name: str) -> Topic | None:
        """The lines of one kind."""
        rows = [np.array(row[1:], dtype=np.float64) for row in self.rows if row[0] == name]
        if not rows:
            return None
        time_ms, *columns = np.stack(rows, axis=1)
        return Topic(name, time_ms * 1e-3, dict(zip(FIELDS[name], columns, strict=True)))


def fixed(lines: Lines) -> Topic | None:
    """What no row can say: messages of the receiver with a fix."""
    topic = lines.topic("gnss")
    return None if topic is None else topic.only(topic.column("fix") >= 3)


PLACE, UNITS = ("lat_e7", "lon_e7", "alt_cm"), (1e7, 1e7, 100.0)
TABLE = Table(
    positions=(
        Row("place", (*PLACE, "above_home_cm"), (*UNITS, 100.0)),
        Row(fixed, PLACE, UNITS, remark="positions are the receiver's own"),
    ),
    receiver=(Row(fixed, PLACE, UNITS),),
    attitudes=(Row("angles", ("roll_deg", "pitch_deg", "yaw_deg")),),
    events=(Row("shot", ("number", "confirmed")),),
    velocities=(Row("speed", ("north_cm_s", "east_cm_s", "down_cm_s"), 100.0),),
    reception=(Row(fixed, ("satellites", "hdop")),),
    clocks=(Row(fixed, ("utc_s",), source="gps"),),
    undulation=(Row(fixed, ("ellipsoid_cm", "alt_cm"), 100.0),),
    resets=StatedResets(counters=(("count", "resets", "reset of the position"),)),
)


def flight() -> str:
    """Ten seconds northwards at 3 m/s, with a photo every two."""
    lines = []
    for k in range(101):
        at, north_e7 = 1000 + 100 * k, round(0.3 * k / 111e3 * 1e7)
        fix = 3 if k > 9 else 1
        lines += [
            f"place,{at},{634000000 + north_e7},104000000,15000,4500",
            f"angles,{at},1.5,-2.0,90.0",
            f"speed,{at},300,0,0",
            f"gnss,{at},{634000000 + north_e7},104000000,15010,19010,14,{1.7e9 + at / 1e3},{fix}",
        ]
    lines += [f"shot,{2000 + 2000 * k},{k + 1},{int(k != 1)}" for k in range(4)]
    lines += ["count,1000,4", "count,5000,4", "count,5200,5"]
    return "\n".join(lines)


def read(*boots: str) -> FlightLog:
    # a name for it would be added to the kinds of logs
    log = FlightLog(path="", kind="tlog", vehicle="", firmware="", messages=(), notes=())
    return build_log(log, [Lines(text) for text in boots], TABLE)


def test_every_quantity_of_the_table_is_read_in_our_units() -> None:
    log = read(flight())
    boot = log.boots[0]
    assert boot.positions is not None
    assert boot.attitudes is not None
    assert boot.velocities is not None
    assert boot.receiver is not None
    assert boot.reception is not None
    assert boot.positions.source == "place"
    np.testing.assert_allclose(boot.positions.latitude_deg[[0, 100]], [63.4, 63.4 + 30 / 111e3])
    assert (boot.positions.height_m[0], boot.positions.height_home_m[0]) == (150.0, 45.0)
    np.testing.assert_allclose(boot.attitudes.time_boot_s[[0, 100]], [1.0, 11.0])
    assert boot.velocities.ned_m_s[0].tolist() == [3.0, 0.0, 0.0]
    assert len(boot.receiver.time_boot_s) == 91
    assert boot.reception.satellites[0] == 14
    assert [clock.source for clock in boot.clocks] == ["gps"]
    np.testing.assert_allclose(boot.clocks[0].utc_s - boot.clocks[0].time_boot_s, 1.7e9)
    assert [(reset.time_boot_s, reset.what) for reset in boot.resets] == [
        (5.2, "reset of the position")
    ]
    assert log.undulation_m == 40.0
    assert log.notes == (
        "1 camera trigger not confirmed by the camera: perhaps there is no photo (image 2)",
    )


def test_what_the_format_does_not_state_is_none() -> None:
    boot = read(flight()).boots[0]
    assert (boot.gimbal, boot.sigmas, boot.home, boot.turn_rates) == (None, None, None, None)


def test_the_next_row_stands_in_for_a_message_that_is_missing() -> None:
    without = "\n".join(line for line in flight().splitlines() if not line.startswith("place"))
    log = read(without, flight())
    senseless = read(flight().replace(",104000000,15000,", ",0,9999999,"))
    assert senseless.boots[0].positions is not None
    assert senseless.boots[0].positions.source == "gnss"
    boot = log.boots[0]
    assert boot.positions is not None
    assert boot.positions.source == "gnss"
    assert "positions are the receiver's own" in log.notes
    assert "the boot clock starts again 1 times: several boots" in log.notes


def test_damaged_values_are_left_out_and_contradictions_are_named() -> None:
    damaged = flight().replace("place,6000,634", "place,6000,734", 1)
    log = read(damaged)
    boot = log.boots[0]
    assert boot.positions is not None
    assert len(boot.positions.time_boot_s) == 100
    assert "1 of 101 place rows make no sense and were dropped" in log.notes
    apart = flight().replace(",104000000,15000,", ",104020000,15000,")
    assert any("contradict each other at 91 of 91 times" in note for note in read(apart).notes)
