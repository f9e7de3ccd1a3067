"""Columns of a geotagger's messages from large logs: this program and the peers side by side.

    python tests/benchmarks/bench_logs.py [FOLDER]

FOLDER holds the files of CASES (default: UAVGRAM_DATA, or ../shared/data beside the repository).
Real logs are repeated to 100 MB and more; each program reads each file in a process of its own,
from opening it to all fields of the messages in memory, the same ones for both. Three pairs for
each file; a ratio is the median of the pairs' ratios. Printed: CPU seconds, messages, peak memory,
and the ratios that are demanded. The peer is pymavlink, and pyulog for PX4's logs.
"""

from __future__ import annotations

import itertools
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from uavgram.io.logs.ulog.reader import TOPICS

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
FEW = ("GLOBAL_POSITION_INT", "ATTITUDE", "CAMERA_FEEDBACK")
# File, messages, how many times as fast as the peer.
CASES: tuple[tuple[str, tuple[str, ...], float], ...] = (
    ("wind_oblique/flight.BIN", DATAFLASH, 12.0),
    ("logs/copter_3.4.4.bin", DATAFLASH, 12.0),
    ("wind_oblique/flight.tlog", TLOG, 7.0),
    ("wind_oblique/flight.tlog", FEW, 10.0),
    ("logs/dronekit_flight.tlog", FEW, 10.0),
    ("logs/sample.ulg", TOPICS, 3.0),
    ("logs/sample_px4_events.ulg", TOPICS, 3.0),
)
PAIRS = 3


def say(line: str) -> None:
    """Print at once, for whoever waits."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def ours(path: str, names: tuple[str, ...]) -> int:
    """Read the columns with uavgram."""
    if path.endswith(".ulg"):
        from uavgram.io.logs.ulog.tables import read_tables

        topics = read_tables(path, names).topics.values()
        return sum(len(topic.time_s) for instances in topics for topic in instances)
    data = Path(path).read_bytes()
    if path.endswith(".tlog"):
        from uavgram.io.logs.tlog.frames import scan_frames

        frames = scan_frames(data)
        tables = [frames.columns(name, frames.rows(name)) for name in names]
    else:
        from uavgram.io.logs.dataflash.tables import index_binary

        log = index_binary(path, data)
        tables = [log.columns(name) for name in names]
    return sum(len(next(iter(table.values()), ())) for table in tables)


def peers(path: str, names: tuple[str, ...]) -> int:
    """Read every field of the same messages with pyulog, or pymavlink's recv_match."""
    if path.endswith(".ulg"):
        from pyulog import ULog

        return sum(len(d.data["timestamp"]) for d in ULog(path, list(names)).data_list)
    from pymavlink import mavutil

    wanted = list(names)
    log = mavutil.mavlink_connection(path, dialect="all")
    tables: dict[str, list[list[object]]] = {}
    while (message := log.recv_match(type=wanted)) is not None:
        row = [getattr(message, field) for field in message.get_fieldnames()]
        tables.setdefault(message.get_type(), []).append(row)
    return sum(len(rows) for rows in tables.values())


def measure(reader: str, path: str, names: tuple[str, ...]) -> dict[str, float]:
    """Run one reader in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, "--child", reader, path, *names],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return dict(json.loads(done.stdout.splitlines()[-1]))


def child(reader: str, path: str, names: tuple[str, ...]) -> None:
    """Time one reader, all imports left out, and print the figures."""
    import pyulog  # noqa: F401
    from pymavlink import mavutil  # noqa: F401

    import uavgram.io.logs.dataflash.tables
    import uavgram.io.logs.tlog.frames
    import uavgram.io.logs.ulog.tables  # noqa: F401

    start = time.process_time()
    messages = {"ours": ours, "peer": peers}[reader](path, names)
    spent = time.process_time() - start
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
    head, data = parted(data) if source.suffix == ".ulg" else (b"", data)
    with target.open("wb") as file:
        file.write(head)
        for _ in range(SIZE // len(data) + 1):
            file.write(data)


def parted(data: bytes) -> tuple[bytes, bytes]:
    """What a ULog says once, its definitions and subscriptions; and all that may be repeated."""
    from uavgram.io.logs.ulog.tables import ADDED, follow_sizes

    edges = follow_sizes(data, 16, len(data) - 2).tolist()
    messages = [data[a:b] for a, b in itertools.pairwise(edges) if b <= len(data)]
    begin = next(k for k, message in enumerate(messages) if message[2] == ADDED)
    once = [m for m in messages[begin:] if m[2] == ADDED]
    rest = [m for m in messages[begin:] if m[2] != ADDED]
    return b"".join([data[:16], *messages[:begin], *once]), b"".join(rest)


def main(folder: Path) -> int:
    """Print a line for each file; status 1 where a demand is not met."""
    met = True
    for name, names, wanted in CASES:
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / Path(name).name
            repeated(folder / name, path)
            size = path.stat().st_size
            pairs = [
                (measure("ours", str(path), names), measure("peer", str(path), names))
                for _ in range(PAIRS)
            ]
        ratio = statistics.median(peer["seconds"] / own["seconds"] for own, peer in pairs)
        own, peer = pairs[-1]
        is_ulog = name.endswith(".ulg")
        allowed = 1.5 * peer["peak_bytes"] if is_ulog else 3 * size + (150 << 20)
        met = met and ratio >= wanted and own["peak_bytes"] <= allowed
        say(
            f"{name} x {size / 1e6:.0f} MB, {len(names)} types: {own['seconds']:.2f} s, peer "
            f"{peer['seconds']:.2f} s: {ratio:.1f} times as fast (wanted {wanted:.0f}); "
            f"{own['messages']:.0f} messages (peer {peer['messages']:.0f}); peak "
            f"{own['peak_bytes'] / 1e6:.0f} MB (allowed {allowed / 1e6:.0f}, peer "
            f"{peer['peak_bytes'] / 1e6:.0f})"
        )
    return 0 if met else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], sys.argv[3], tuple(sys.argv[4:]))
    else:
        default = os.environ.get("UAVGRAM_DATA", str(ROOT.parent / "shared" / "data"))
        sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else default)))
