"""Time of a camera calibration beside OpenCV's, on the same corners.

    python tests/benchmarks/bench_calibration.py

The bar: the adjustment within 5 times cv2.calibrateCameraExtended, first values included.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import board_scenes as scenes
import cv2
import numpy as np

from uavgram.estimation.calibration.adjustment import Fit, adjust
from uavgram.estimation.calibration.problem import make_lens, pad
from uavgram.estimation.calibration.start import estimate_first_values
from uavgram.model.board import BoardObservations, CalibrationOptions
from uavgram.stages.calibrate.calibration import calibrate

REPEATS = 7


def best_ms(function: Callable[[], object]) -> float:
    """Shortest of some runs: what the others add is not the function's."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def compare(name: str, observations: BoardObservations, coefficients: int, flags: int) -> None:
    """Print one line: OpenCV, our first values and adjustment, their ratio; the whole stage."""
    options = CalibrationOptions(coefficients=coefficients)
    photo = observations.photos[0]
    size = photo.width_px, photo.height_px

    def ours() -> Fit:
        lens, corners = make_lens(options), pad(observations, "flat")
        return adjust(lens, corners, estimate_first_values(lens, corners, size))

    # OpenCV with its own stopping rule (30 steps), and run until it rests as ours does
    board = observations.board.corner_board_m.astype(np.float32)
    points = [board[p.corner] for p in observations.photos]
    pixels = [p.pixel_px.astype(np.float32)[:, None] for p in observations.photos]
    theirs = best_ms(
        lambda: cv2.calibrateCameraExtended(  # type: ignore[call-overload] # no None in its stubs
            points, pixels, size, None, None, flags=flags
        )
    )
    rested = best_ms(lambda: scenes.opencv_calibration(observations, flags, times=1))
    mine = best_ms(ours)
    whole = best_ms(lambda: calibrate(observations, options))
    print(
        f"{name:34s} OpenCV {theirs:7.1f} ms (to rest {rested:7.1f})   ours {mine:7.1f} ms   "
        f"ratio {mine / theirs:5.2f}   with tests, held-out photos and maps {whole:8.1f} ms"
    )


def main() -> None:
    """Synthetic sets of two sizes and, where it lies, OpenCV's own."""
    small = scenes.make_scene(0, photos=13).observations
    compare("13 photos, 54 corners", small, 5, 0)
    large = scenes.make_scene(1, photos=30, shape=(11, 9), distance=(10, 18)).observations
    compare("30 photos, 99 corners", large, 5, 0)
    compare("30 photos, 99 corners, rational", large, 8, cv2.CALIB_RATIONAL_MODEL)
    folder = Path(os.environ.get("UAVGRAM_DATA", Path(__file__).parents[3] / "shared" / "data"))
    if (folder / "opencv_chess").is_dir():
        compare("opencv_chess left", scenes.opencv_chess(folder, "left"), 5, 0)


if __name__ == "__main__":
    main()
