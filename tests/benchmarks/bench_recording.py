"""The review of a long flight: what it costs beside decoding the photos' previews alone.

    python tests/benchmarks/bench_recording.py [FRAMES] [ROUNDS] [WIDTH_PX]
    python tests/benchmarks/bench_recording.py --large RECORDING.rrd

One photo of 20 megapixels (5,472 wide), made here, stands for all FRAMES (1,000): hard links, so
every one is read and decoded. WIDTH_PX stores it smaller, which is sooner decoded. Rounds go in
turn, each in its own process: decode and encode the previews, on all cores; write the recording
with the same previews, the ground, and everything else. The ratio is the median of neighbouring
runs, of wall and of processor time. Demanded: at most 1.3 times the wall time, 0.3 MB a frame,
1.5 GB of memory.

--large writes 5,000 frames and 100,000 points without photos, says what it took, and leaves the
file for a look at it in the viewer.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import deque
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from large_result import HEIGHT_PX, WIDTH_PX, large_result

from uavgram.imaging.photos.preview import read_preview
from uavgram.io.files import photo_files
from uavgram.pipeline.measure.outputs import write_review
from uavgram.pipeline.parallel import prefetch
from uavgram.views.recording import write_recording

FRAMES, ROUNDS, POINTS_PER_FRAME = 1000, 3, 5
DEMAND_RATIO, DEMAND_MB, DEMAND_GB = 1.3, 0.3, 1.5
QUALITY = 92


def make_photo(path: Path, width_px: int) -> None:
    """Grass-like noise of every size: of 20 megapixels some 5 MB, as a drone's camera writes."""
    rng = np.random.default_rng(1)
    total = np.zeros((HEIGHT_PX, WIDTH_PX), np.float32)
    for grain, weight in ((400, 30), (60, 20), (8, 12), (2, 9)):
        small = rng.standard_normal((HEIGHT_PX // grain + 2, WIDTH_PX // grain + 2), np.float32)
        total += weight * cv2.resize(small, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
    bgr = np.stack([70 + 0.5 * total, 120 + total, 90 + 0.7 * total], axis=-1)
    picture = np.clip(bgr, 0, 255).astype(np.uint8)
    if width_px < WIDTH_PX:
        size = width_px, round(width_px * HEIGHT_PX / WIDTH_PX)
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    cv2.imwrite(str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def lay_out(folder: Path, frames: int, width_px: int) -> None:
    """One photo under many names."""
    first = folder / "photo.jpg"
    make_photo(first, width_px)
    (folder / "photos").mkdir()
    for path in photo_files(large_result(frames, 30, str(folder / "photos")).frames):
        Path(path).hardlink_to(first)


def one(what: str, folder: Path, frames: int) -> None:
    """Run one side, and say what it took."""
    result = large_result(frames, POINTS_PER_FRAME * frames, str(folder / "photos"))
    cv2.setNumThreads(1)
    before, started = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
    if what == "decode":
        deque(prefetch(read_preview, photo_files(result.frames)), maxlen=0)
    else:
        write_review(result, folder / "recording.rrd")
    wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_SELF)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(json.dumps({"wall": wall, "cpu": cpu, "gb": peak_gb()}))


def peak_gb() -> float:
    """Of this process alone: what getrusage says contains the parent's from before the start."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024**2
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2


def side_by_side(frames: int, rounds: int, width_px: int) -> bool:
    """Both sides in turn; whether all demands are met."""
    ratios, peak = [], 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lay_out(folder, frames, width_px)
        print(f"photo: {(folder / 'photo.jpg').stat().st_size / 1e6:.1f} MB, {frames} frames")
        for turn in range(rounds):
            took = {}
            for what in ("decode", "record"):
                command = [sys.executable, __file__, "--one", what, name, str(frames)]
                run = subprocess.run(command, check=True, capture_output=True, text=True)
                took[what] = json.loads(run.stdout)
            ratios.append([took["record"][k] / took["decode"][k] for k in ("wall", "cpu")])
            peak = max(peak, took["record"]["gb"])
            for what, t in took.items():
                numbers = f"{t['wall']:6.1f} s wall, {t['cpu']:6.1f} s cpu, {t['gb']:.2f} GB"
                print(f"round {turn + 1} {what}: {numbers}", flush=True)
        size = (folder / "recording.rrd").stat().st_size / 1e6 / frames
    wall, cpu = np.median(ratios, axis=0)
    print(f"recording over decoding: {wall:.2f} wall, {cpu:.2f} cpu (demanded {DEMAND_RATIO})")
    print(f"{size:.3f} MB a frame (demanded {DEMAND_MB}), peak {peak:.2f} GB ({DEMAND_GB})")
    return bool(wall <= DEMAND_RATIO and size <= DEMAND_MB and peak <= DEMAND_GB)


def large(path: Path) -> None:
    """5,000 frames and 100,000 points."""
    result = large_result(5000, 100_000)
    started = time.perf_counter()
    write_recording(result, (), lambda: None, path)
    took = time.perf_counter() - started
    print(f"{took:.1f} s, {path.stat().st_size / 1e6:.1f} MB, peak {peak_gb():.2f} GB: {path}")


def main(arguments: list[str]) -> int:
    """Exit status: whether all demands are met."""
    if arguments[:1] == ["--one"]:
        one(arguments[1], Path(arguments[2]), int(arguments[3]))
    elif arguments[:1] == ["--large"]:
        large(Path(arguments[1]))
    else:
        numbers = [int(a) for a in arguments]
        return 0 if side_by_side(*numbers, *(FRAMES, ROUNDS, WIDTH_PX)[len(numbers) :]) else 1
    return 0


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main(sys.argv[1:]))
