"""The text of ``uavgram log FILE``."""

import json
from pathlib import Path
from typing import Any, Never

import numpy as np
import pytest

from uavgram.io.json_codec import replace_not_finite
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.stages.log_summary import summarise_log
from uavgram.views.flight_log import collect_log_content, log_summary_lines


def text_of(path: Path) -> str:
    return "\n".join(log_summary_lines(summarise_log(read_flight_log(path))))


def test_a_flight_is_summed_up_truly(data_dir: Path) -> None:
    text = text_of(data_dir / "wind_oblique" / "flight.BIN")
    assert "ArduPilot DataFlash log" in text
    assert "ArduCopter V4.7.0-dev" in text
    assert "2026-11-21 09:27:10 UTC to 2026-11-21 09:33:22 UTC" in text
    assert "gps, 1861 pairs, drift +0.0 ± 0.0 ppm" in text
    assert "62 confirmed, at the camera's feedback, 3 triggered that the camera did not" in text
    assert "confirm (image 17, 34, 51)" in text
    assert "59107 messages of 27 types" in text


def test_a_nonsense_clock_is_said(data_dir: Path) -> None:
    text = text_of(data_dir / "cuav" / "flight.tlog")
    assert "SYSTEM_TIME is nonsense" in text
    assert "fixed wing" in text


def test_every_boot_has_its_part(data_dir: Path) -> None:
    text = text_of(data_dir / "logs" / "dronekit_flight.tlog")
    assert "boot 1 of 2" in text
    assert "boot 2 of 2" in text
    assert "1314 frames failed their checksum" in text


def test_our_own_short_logs_are_summed_up(repository: Path) -> None:
    for name in ("twin_short.BIN", "twin_short.tlog"):
        assert "11 confirmed, at the command" in text_of(repository / "logs" / name)


# ``uavgram log FILE --json``: one object, numbers or null.


def summary_of(path: Path) -> dict[str, Any]:
    def refuse(constant: str) -> Never:
        raise AssertionError(f"{constant} is no JSON")

    summary = summarise_log(read_flight_log(path, positions_needed=False))
    content = replace_not_finite(collect_log_content(summary))
    told: dict[str, Any] = json.loads(json.dumps(content), parse_constant=refuse)
    return told


def test_a_flight_is_told_truly(data_dir: Path) -> None:
    summary = summary_of(data_dir / "wind_oblique" / "flight.BIN")
    truth = json.loads((data_dir / "truth" / "wind_oblique.json").read_text())
    (boot,) = summary["boots"]
    assert (summary["kind"], summary["vehicle"]) == ("dataflash", "ArduCopter")
    assert boot["clock"]["boot_to_utc_s"] == pytest.approx(truth["boot_to_utc_s"], abs=1e-3)
    assert boot["events"]["unconfirmed_images"] == [17, 34, 51]
    assert boot["events"]["instant"] == "feedback"
    assert len(boot["events"]["time_utc_s"]) == 65
    assert boot["gimbal"] is None
    assert {m["name"]: m["count"] for m in summary["messages"]}["POS"] == 3721


def test_what_a_log_has_not_is_null(data_dir: Path) -> None:
    summary = summary_of(data_dir / "logs" / "sample.ulg")
    (boot,) = summary["boots"]
    assert boot["positions"] is boot["clock"] is boot["span_utc"] is summary["undulation_m"] is None
    assert {m["code"] for m in boot["messages"]} == {"clock-missing", "position-missing"}


def test_the_path_over_ground_is_that_of_the_positions(data_dir: Path) -> None:
    from pyproj import Geod

    path = data_dir / "calm_nadir" / "flight.BIN"
    positions = read_flight_log(path).boots[0].positions
    assert positions is not None
    expected = Geod(ellps="WGS84").line_length(positions.longitude_deg, positions.latitude_deg)
    assert summary_of(path)["boots"][0]["path_m"] == pytest.approx(expected, rel=1e-3)
    assert np.isfinite(expected)
