"""The text of ``uavgram log FILE``."""

from pathlib import Path

from uavgram.io.logs.flight_log import read_flight_log
from uavgram.stages.log_summary import summarise_log
from uavgram.views.flight_log.text import log_summary_lines


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
