"""`uavgram calibrate` of 20 megapixel photos, all files written, against OpenCV's detector alone.

    python tests/benchmarks/bench_calibrate_command.py [PHOTOS] [PEER]

PHOTOS (30) photos are rendered. The command reads
them, finds all corners, compares lens models, and writes every file; the peers decode and detect
PEER (6) of them, nothing more, two photos at a time: findChessboardCornersSB on the full photo, and
findChessboardCorners with cornerSubPix. Wall and processor time per photo, taken by turns in one
process. Demanded: at least as fast per photo as the faster peer.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).parent))

from bench_targets import BOARD, LENS, SIZE_PX, classical, sector
from board_photos import Sensor, look, photograph

from uavgram.pipeline.cameras.calibrate import Calibrated, calibrate

WORKERS = 2


def rendered(folder: Path, count: int) -> list[str]:
    """Write the photos."""
    names: list[str] = []
    for k in range(count):
        pose = look(
            BOARD, tilt_deg=20 + k % 20, azimuth_deg=36 * k, roll_deg=90 * (k % 2) + 5 * k,
            distance_m=0.36, shift_m=(0.03 * np.cos(k), 0.02 * np.sin(k)),
        )  # fmt: skip
        sensor = Sensor(1.2, 3.0, 0.3)
        photo = photograph(BOARD, "brown", LENS, pose, SIZE_PX, sensor, seed=k, step_px=8)
        names.append(str(folder / f"{k:03d}.jpg"))
        cv2.imwrite(names[-1], photo, [cv2.IMWRITE_JPEG_QUALITY, 92])
    return names


def timed(what: Callable[[], object]) -> tuple[float, float, object]:
    """Wall and processor seconds, and the result."""
    wall, processor = time.perf_counter(), time.process_time()
    done = what()
    return time.perf_counter() - wall, time.process_time() - processor, done


def main(photos: int, peer: int) -> int:
    """Print seconds per photo; status 1 where the demand is not met."""
    with tempfile.TemporaryDirectory() as scratch:
        names = rendered(Path(scratch), photos)

        def whole() -> Calibrated:
            return calibrate(names, "chessboard:9x6:25mm", Path(scratch) / "out")

        def peers(detect: Callable[[str], object]) -> object:
            with ThreadPoolExecutor(WORKERS) as pool:
                return list(pool.map(detect, names[:peer]))

        wall, processor, done = timed(whole)
        own = wall / photos, processor / photos
        assert isinstance(done, Calibrated)
        result = done.account.result
        sigma = np.sqrt(result.calibration.covariance[0, 0])
        print(
            f"uavgram calibrate: {own[0]:.2f} s wall, {own[1]:.2f} s processor per photo of "
            f"{photos}; {len(result.photos.file)} used, fx {result.calibration.parameters[0]:.2f} "
            f"± {sigma:.2f} px (true {LENS[0]:.0f})"
        )
        fastest = [np.inf, np.inf]
        for what, detect in (("SB", sector), ("classical + SubPix", classical)):
            wall, processor, _ = timed(partial(peers, detect))
            spent = wall / peer, processor / peer
            fastest = [min(pair) for pair in zip(fastest, spent, strict=True)]
            print(
                f"OpenCV {what}: {spent[0]:.2f} s wall, {spent[1]:.2f} s processor per photo of "
                f"{peer}; uavgram is {spent[0] / own[0]:.1f} and {spent[1] / own[1]:.1f} times as "
                "fast"
            )
    return 0 if own[0] <= fastest[0] and own[1] <= fastest[1] else 1


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    sys.exit(main(*(numbers + [30, 6][len(numbers) :])))
