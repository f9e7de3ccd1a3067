"""5,000 damaged logs of each kind: read or refused, never a crash, a hang or nonsense."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import ulog_writer
from pymavlink import DFReader

SCRIPT = Path(__file__).with_name("mutated_logs.py")
COUNT, WORKERS = 5000, 2
ARENAS = 64 << 20  # the interpreter's and numpy's own; the logs are a few hundred kB at most


def text_log(binary: Path) -> bytes:
    """The first seconds of a binary log in its text form."""
    reader = DFReader.DFReader_binary(str(binary))
    lines = []
    while (message := reader.recv_match()) is not None:
        time = getattr(message, "TimeUS", 0)
        if time == 0 or time < 152.5e6:
            values = (getattr(message, field) for field in message.get_fieldnames())
            lines.append(", ".join([message.get_type(), *(str(v) for v in values)]))
    reader.close()
    return "\n".join(lines).encode("latin-1")


def small_ulog() -> bytes:
    topics = ulog_writer.flight(15.0)
    topics["camera_capture"] = (
        ulog_writer.CAPTURE,
        [ulog_writer.capture(11 + k, k) for k in range(8)],
    )
    topics["camera_trigger"] = (
        ulog_writer.TRIGGER,
        [(ulog_writer.us(10.9 + k), 0, k, False) for k in range(8)]
        + [(ulog_writer.us(11 + k), 0, k, True) for k in range(8)],
    )
    topics["gimbal_device_attitude_status"] = (
        ulog_writer.GIMBAL,
        [(ulog_writer.us(10 + k / 10), (1.0, 0.0, 0.0, 0.0), 32) for k in range(150)],
    )
    return ulog_writer.ulog(topics)


@pytest.mark.statistical
@pytest.mark.parametrize("suffix", [".BIN", ".log", ".tlog", ".ulg"])
def test_damaged_logs_are_read_or_refused(suffix: str, repository: Path, tmp_path: Path) -> None:
    binary = repository / "logs" / "twin_short.BIN"
    source = tmp_path / f"source{suffix}"
    contents = {
        ".BIN": lambda: binary.read_bytes()[:60_000],
        ".log": lambda: text_log(binary),
        ".tlog": lambda: binary.with_suffix(".tlog").read_bytes()[:20_000],
        ".ulg": small_ulog,
    }
    source.write_bytes(contents[suffix]())
    share = COUNT // WORKERS
    workers = [
        subprocess.Popen(
            [sys.executable, str(SCRIPT), str(source), suffix, str(k * share), str(share)],
            stdout=subprocess.PIPE,
            text=True,
        )
        for k in range(WORKERS)
    ]
    told = [json.loads(worker.communicate(timeout=600)[0]) for worker in workers]
    assert sum(t["read"] + t["refused"] + len(t["wrong"]) for t in told) >= COUNT
    assert sum(t["read"] for t in told) > 0.5 * COUNT  # damage is survived, not just refused
    assert [wrong for t in told for wrong in t["wrong"]] == []
    assert max(t["slowest_s"] for t in told) < 5.0
    # what a mutation adds to the file is less than the file
    allowed = 5 * 2 * source.stat().st_size + ARENAS
    assert max(t["growth_bytes"] for t in told) < allowed
