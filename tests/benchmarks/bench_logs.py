"""Columns of a geotagger's messages from large logs: this program and pymavlink side by side.

    python tests/benchmarks/bench_logs.py [FOLDER]

FOLDER holds wind_oblique/flight.BIN, .tlog and logs/copter_3.4.4.bin (default: UAVGRAM_DATA, or
../shared/data beside the repository). Real logs are repeated to 100 MB and more; each program
reads each file in a process of its own, from opening it to all fields of 18 message types in
memory. Printed: seconds, messages, peak memory, and the ratios that are demanded.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
SIZE = 100 << 20
DATAFLASH = (
    *("POS", "ATT", "GPS", "GPA", "CAM", "TRIG", "MNT", "XKF1", "XKF4", "XKQ", "XKV1", "XKV2"),
    *("NKF1", "NKF4", "ORGN", "BARO", "RFND", "TERR"),
)
TLOG = (
    *("GLOBAL_POSITION_INT", "ATTITUDE", "ATTITUDE_QUATERNION", "GPS_RAW_INT", "GPS2_RAW"),
    *("SYSTEM_TIME", "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "CAMERA_FEEDBACK", "CAMERA_TRIGGER"),
    *("CAMERA_IMAGE_CAPTURED", "MOUNT_STATUS", "MOUNT_ORIENTATION", "HEARTBEAT"),
    *("GIMBAL_DEVICE_ATTITUDE_STATUS", "ESTIMATOR_STATUS", "EKF_STATUS_REPORT", "TERRAIN_REPORT"),
)
CASES = (
    ("wind_oblique/flight.BIN", 12.0),
    ("logs/copter_3.4.4.bin", 12.0),
    ("wind_oblique/flight.tlog", 7.0),
)


def say(line: str) -> None:
    """Print at once, for whoever waits."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def ours(path: str) -> int:
    """Read the columns with uavgram."""
    data = Path(path).read_bytes()
    if path.endswith(".tlog"):
        from uavgram.io.logs.tlog.frames import scan_frames

        frames = scan_frames(data)
        tables = [frames.columns(name, frames.rows(name)) for name in TLOG]
    else:
        from uavgram.io.logs.dataflash.binary import index_binary

        log = index_binary(path, data)
        tables = [log.columns(name) for name in DATAFLASH]
    return sum(len(next(iter(table.values()), ())) for table in tables)


def pymavlink(path: str) -> int:
    """Read every field of the same messages with pymavlink's recv_match."""
    from pymavlink import mavutil

    wanted = list(TLOG if path.endswith(".tlog") else DATAFLASH)
    log = mavutil.mavlink_connection(path, dialect="all")
    tables: dict[str, list[list[object]]] = {}
    while (message := log.recv_match(type=wanted)) is not None:
        row = [getattr(message, field) for field in message.get_fieldnames()]
        tables.setdefault(message.get_type(), []).append(row)
    return sum(len(rows) for rows in tables.values())


def measure(reader: str, path: str) -> dict[str, float]:
    """Run one reader in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, "--child", reader, path],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return dict(json.loads(done.stdout.splitlines()[-1]))


def child(reader: str, path: str) -> None:
    """Time one reader, its imports left out, and print the figures."""
    from pymavlink import mavutil  # noqa: F401

    import uavgram.io.logs.dataflash.binary
    import uavgram.io.logs.tlog.frames  # noqa: F401

    start = time.perf_counter()
    messages = {"ours": ours, "pymavlink": pymavlink}[reader](path)
    spent = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    say(json.dumps({"seconds": spent, "messages": messages, "peak_bytes": peak}))


def repeated(source: Path, target: Path) -> None:
    """One log after itself until it is large; a .tlog without the rest of a cut record."""
    data = source.read_bytes()
    if source.suffix == ".tlog":
        from uavgram.io.logs.tlog.frames import scan_frames

        frames = scan_frames(data)
        last = len(frames.start) - 1
        data = data[: int(frames.payload_start[last]) + int(frames.payload_length[last]) + 2]
    with target.open("wb") as file:
        for _ in range(SIZE // len(data) + 1):
            file.write(data)


def main(folder: Path) -> int:
    """Print a line for each file; status 1 where a demand is not met."""
    met = True
    for name, wanted in CASES:
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / Path(name).name
            repeated(folder / name, path)
            size = path.stat().st_size
            own, peer = measure("ours", str(path)), measure("pymavlink", str(path))
        ratio = peer["seconds"] / own["seconds"]
        allowed = 3 * size + (150 << 20)
        met = met and ratio >= wanted and own["peak_bytes"] <= allowed
        say(
            f"{name} x {size / 1e6:.0f} MB: {own['seconds']:.2f} s, pymavlink "
            f"{peer['seconds']:.2f} s: {ratio:.1f} times as fast (wanted {wanted:.0f}); "
            f"{own['messages']:.0f} messages (pymavlink {peer['messages']:.0f}); peak "
            f"{own['peak_bytes'] / 1e6:.0f} MB (allowed {allowed / 1e6:.0f}, pymavlink "
            f"{peer['peak_bytes'] / 1e6:.0f})"
        )
    return 0 if met else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], sys.argv[3])
    else:
        default = os.environ.get("UAVGRAM_DATA", str(ROOT.parent / "shared" / "data"))
        sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else default)))
