"""`uavgram calibrate` of 20 megapixel photos, all files written, against the same job by OpenCV.

    python tests/benchmarks/bench_calibrate_command.py [PHOTOS] [ROUNDS]

PHOTOS (30) photos of a chessboard are rendered. The command reads them, finds all corners, compares
lens models, and writes every file. The peers do what users of OpenCV do, from files to parameters
with standard deviations: decode all PHOTOS, findChessboardCornersSB, or findChessboardCorners with
cornerSubPix, on the full photo, two photos at a time, and calibrateCameraExtended; they write
nothing, and test no other lens. Each in a process of its own, by turns, ROUNDS (3) times: seconds
of the clock and of the processor (user and system, loading of modules left out), and medians of the
rounds' ratios. Demanded: at least as fast as the faster peer, by both.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).parent))

from bench_targets import BOARD, LENS, SIZE_PX, classical, sector
from board_photos import Sensor, look, photograph

from uavgram.pipeline.calibrate import calibrate

WORKERS = 2
PEERS = {"SB": sector, "classical + SubPix": classical}
OURS = "uavgram calibrate"


def render(folder: Path, count: int) -> None:
    """Write the photos."""
    for k in range(count):
        pose = look(
            BOARD, tilt_deg=20 + k % 20, azimuth_deg=36 * k, roll_deg=90 * (k % 2) + 5 * k,
            distance_m=0.36, shift_m=(0.03 * np.cos(k), 0.02 * np.sin(k)),
        )  # fmt: skip
        sensor = Sensor(1.2, 3.0, 0.3)
        photo = photograph(BOARD, "brown", LENS, pose, SIZE_PX, sensor, seed=k, step_px=8)
        cv2.imwrite(str(folder / f"{k:03d}.jpg"), photo, [cv2.IMWRITE_JPEG_QUALITY, 92])


def ours(names: list[str], folder: Path) -> tuple[int, float, float]:
    """Photos used, focal length and its sigma."""
    result = calibrate(names, "chessboard:9x6:25mm", folder / "out").account.result
    sigma = float(np.sqrt(result.calibration.covariance[0, 0]))
    return len(result.photos.file), float(result.calibration.parameters[0]), sigma


def opencv(names: list[str], what: str) -> tuple[int, float, float]:
    """The same by OpenCV."""
    with ThreadPoolExecutor(WORKERS) as pool:
        found = [corners for corners in pool.map(PEERS[what], names) if corners is not None]
    row, column = np.divmod(np.arange(BOARD.rows * BOARD.columns), BOARD.columns)
    board = 0.025 * np.column_stack([column, row, np.zeros_like(row)]).astype(np.float32)
    _, matrix, _, _, _, spread, *_ = cv2.calibrateCameraExtended(
        [board] * len(found),
        [one.astype(np.float32) for one in found],
        SIZE_PX,
        np.eye(3),
        np.zeros(5),
    )
    return len(found), float(matrix[0, 0]), float(spread[0, 0])


def one(what: str, folder: Path) -> None:
    """Do the job, and print what it took and what it found."""
    names = sorted(map(str, folder.glob("*.jpg")))
    wall, before = time.perf_counter(), cpu_s()
    found = ours(names, folder) if what == OURS else opencv(names, what)
    took = time.perf_counter() - wall, cpu_s() - before
    print(json.dumps({"seconds": took, "found": found}))


def cpu_s() -> float:
    """Of this process and of those that it waited for."""
    both = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


def main(photos: int, rounds: int) -> int:
    """Print seconds per photo; status 1 where the demand is not met."""
    took: dict[str, list[list[float]]] = {what: [] for what in (OURS, *PEERS)}
    with tempfile.TemporaryDirectory() as folder:
        render(Path(folder), photos)
        for _ in range(rounds):
            for what, seconds in took.items():
                command = [sys.executable, __file__, "--one", what, folder]
                done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
                told = json.loads(done.stdout.splitlines()[-1])
                seconds.append(told["seconds"])
                used, focal, sigma = told["found"]
                wall, processor = (each / photos for each in told["seconds"])
                print(
                    f"{what}: {wall:.2f} s wall, {processor:.2f} s processor per photo of "
                    f"{photos}; {used} used, fx {focal:.2f} ± {sigma:.2f} px (true {LENS[0]:.0f})",
                    flush=True,
                )
    own, least = np.array(took.pop(OURS)), np.inf
    for what, seconds in took.items():
        ratio = np.median(np.array(seconds) / own, axis=0)
        least = min(least, float(ratio.min()))
        print(f"OpenCV {what}: {ratio[0]:.1f} times our time, {ratio[1]:.1f} times the processor's")
    return 0 if least >= 1.0 else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2], Path(sys.argv[3]))
    else:
        numbers = [int(text) for text in sys.argv[1:]]
        sys.exit(main(*(numbers + [30, 3][len(numbers) :])))
