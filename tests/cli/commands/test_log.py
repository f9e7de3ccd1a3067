"""``uavgram log FILE``: true statements of every real log, as found by pymavlink and pyulog."""

import json
import re
from pathlib import Path

import pytest

from uavgram.cli import main

# File: what must be said (counts by pymavlink's and pyulog's own readers, times by hand).
TRUE_OF = {
    "calm_nadir/flight.BIN": (
        *("ArduPilot DataFlash log", "ArduCopter V4.7.0-dev (2598e9d4)"),
        *("2026-11-21 09:21:41 UTC to 2026-11-21 09:26:04 UTC", "POS, 2631,", "CAM, 65,"),
        *("65 confirmed, at the command", "44963 messages of 27 types", "MNT, 2682,"),
    ),
    "calm_nadir/flight.tlog": (
        *("MAVLink telemetry log", "quadrotor", "CAMERA_FEEDBACK, 65,", "at the command"),
        *("ground station's clock is +3.7 s off", "48863 messages of 43 types"),
    ),
    "wind_oblique/flight.BIN": (
        *("TRIG+CAM, 65,", "62 confirmed, at the camera's feedback"),
        *(
            "3 triggered that the camera did not confirm (image 17, 34, 51)",
            "59107 messages of 27 types",
        ),
    ),
    "wind_oblique/flight.tlog": (
        *("CAMERA_FEEDBACK, 62,", "at the camera's feedback", "3 missing (image 17, 34, 51)"),
        *("ground station's clock is +3.1 s off", "63565 messages of 42 types"),
    ),
    "cuav/flight.tlog": (
        *("fixed wing", "SYSTEM_TIME is nonsense", "2018-08-05 00:59:55 UTC"),
        *("GLOBAL_POSITION_INT, 676,", "19205 messages of 38 types"),
    ),
    "logs/copter_3.4.4.bin": (
        *("APM:Copter V3.4.4-rc1 (65ffe9d7)", "2016-12-23 14:15:21 UTC", "POS, 1502,"),
        *("46458 messages of 39 types", "events      none"),
    ),
    "logs/pymavlink_test.BIN": (
        *("ArduPlane V3.8.2-dev (8178ab40)", "2017-10-29 01:47:09 UTC", "POS, 23,"),
        "24 of 65536 bytes belong to no complete message",
    ),
    "logs/dronekit_flight.tlog": (
        *("boot 1 of 2", "boot 2 of 2", "2015-07-05 00:27:51 UTC", "MOUNT_STATUS"),
        *(
            "1314 frames failed their checksum",
            "servo angles",
            "height jumps by 58",
            "75477 messages of 35 types",
        ),
    ),
    "logs/sample.ulg": (
        *(
            "PX4 ULog",
            "positions   none",
            "vehicle_attitude, 6461,",
            "ties its boot clock to no UTC",
        ),
        *("lost data 4 times", "never stated where the vehicle is", "[position-missing]"),
    ),
    "logs/sample_appended_multiple.ulg": (
        *("PX4 v1.6.0", "data was appended", "vehicle_attitude, 306,", "6852 messages of 19 types"),
    ),
    "logs/sample_log_small.ulg": (
        *("PX4 v1.11.2", "undulation  +39.95 m", "vehicle_gps_position, 32,"),
        *("2021-04-21 06:30:58 UTC", "receiver's own"),
    ),
    "logs/sample_logging_tagged_and_default_params.ulg": (
        *("PX4 v1.13.0", "vehicle_local_position, 130,", "2022-04-29 08:45:36 UTC"),
    ),
    "logs/sample_px4_events.ulg": (
        *("PX4 v1.15.0", "vehicle_global_position, 109,", "2024-03-18 14:49:20 UTC"),
        *("shows the time of day", "height 487.5 to 490.1 m above mean sea level"),
    ),
}

# Folders that carry the same flights once more, to the byte.
SAME_AS = {
    "street_nadir": "calm_nadir",
    "street_rolling": "calm_nadir",
    "street_oblique": "wind_oblique",
}
# What is only said of damaged rows: of the undamaged logs never.
OF_DAMAGE = ("taken for damaged", "contradict each other", "home by", "name no mount")


@pytest.mark.parametrize("name", TRUE_OF)
def test_true_things_are_said_of_every_real_log(
    data_dir: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", str(data_dir / name)]) == 0
    said = capsys.readouterr().out
    for statement in TRUE_OF[name]:
        assert statement in said, statement
    assert [words for words in OF_DAMAGE if words in said] == []


@pytest.mark.parametrize("folder", SAME_AS)
def test_the_streets_were_seen_on_the_same_flights(data_dir: Path, folder: str) -> None:
    for name in ("flight.BIN", "flight.tlog"):
        ours, first = (data_dir / place / name for place in (folder, SAME_AS[folder]))
        assert ours.read_bytes() == first.read_bytes()


def test_a_log_of_the_form_before_ulog_is_refused_by_name(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes((data_dir / "logs" / "px4_sdlog2.px4log").read_bytes())
    assert main(["log", str(path)]) == 1
    assert "is a PX4 log of the old form sdlog2" in capsys.readouterr().err


def test_every_real_log_is_among_them(data_dir: Path) -> None:
    suffix = re.compile(r"\.(bin|BIN|tlog|ulg|log)$")
    found = {
        str(path.relative_to(data_dir)).replace("\\", "/")
        for path in data_dir.rglob("*")
        if suffix.search(path.name)
    }
    streets = {f"{folder}/flight.{kind}" for folder in SAME_AS for kind in ("BIN", "tlog")}
    assert found == set(TRUE_OF) | streets


def test_json_and_plot_come_on_request(
    repository: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "log.png"
    path = repository / "logs" / "twin_short.tlog"
    assert main(["log", str(path), "--json", "--plot", str(picture)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["boots"][0]["events"]["count"] == 11
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_is_one_message(
    repository: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = repository / "logs" / "twin_short.tlog"
    assert main(["log", str(path), "--plot", str(tmp_path / "none" / "log.png")]) == 1
    assert "none" in capsys.readouterr().err


def test_a_file_that_is_no_log_is_one_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.ulg"
    path.write_bytes(b"nothing")
    assert main(["log", str(path)]) == 1
    assert "is no ULog" in capsys.readouterr().err
