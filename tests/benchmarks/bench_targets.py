"""Corners of 20 megapixel photos of a chessboard: this program and OpenCV side by side.

    python tests/benchmarks/bench_targets.py [PHOTOS]

A few photos are rendered and taken in turn until there are PHOTOS (30). Each program decodes every
JPEG and finds all corners, two photos at a time: this program, findChessboardCornersSB, and
findChessboardCorners with cornerSubPix, both on the full photo. The peers take their time: PEER
photos of each, the mean is printed. Demanded: at least as fast per photo as the faster peer.
"""

from __future__ import annotations

import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle, islice
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from board_photos import Sensor, look, photograph, true_corners

from uavgram.imaging.targets.boards import detect_in_photos
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.board import flat_board

SIZE_PX = (5472, 3648)
LENS = [3700.0, 3700.0, 2735.5, 1823.5, -0.1, 0.03, 2e-4, -1e-4, 0.0]
BOARD = flat_board(9, 6, 0.025)
RENDERED, PEER, WORKERS = 4, 6, 2


def rendered(folder: Path) -> tuple[list[str], list[np.ndarray]]:
    """Write the photos; their names, and their true corners."""
    names, truth = [], []
    for k in range(RENDERED):
        pose = look(
            BOARD, tilt_deg=30, azimuth_deg=90 * k + 20, roll_deg=12 * k, distance_m=0.34,
            shift_m=(0.02 * (k - 1.5), 0.01),
        )  # fmt: skip
        photo = photograph(BOARD, "brown", LENS, pose, SIZE_PX, Sensor(1.2, 3.0, 0.3), step_px=8)
        name = str(folder / f"{k}.jpg")
        cv2.imwrite(name, photo, [cv2.IMWRITE_JPEG_QUALITY, 92])
        names.append(name)
        truth.append(true_corners(BOARD, "brown", LENS, pose))
    return names, truth


def sector(name: str) -> np.ndarray | None:
    """OpenCV's sector-based detector on the full photo."""
    found, corners = cv2.findChessboardCornersSB(read_grey(name), (BOARD.columns, BOARD.rows))
    return corners.reshape(-1, 2) if found else None


def classical(name: str) -> np.ndarray | None:
    """OpenCV's older detector and its sub-pixel operator."""
    grey = read_grey(name)
    found, corners = cv2.findChessboardCorners(grey, (BOARD.columns, BOARD.rows))
    if not found:
        return None
    return cv2.cornerSubPix(grey, corners, (11, 11), (-1, -1), (3, 50, 1e-3)).reshape(-1, 2)


def error_px(found: np.ndarray | None, truth: np.ndarray) -> float:
    """Rms per coordinate to the nearest true corners."""
    if found is None or not len(found):
        return float("nan")
    nearest = np.linalg.norm(truth[:, None] - found[None], axis=2).argmin(axis=0)
    return float(np.sqrt(np.mean((found - truth[nearest]) ** 2)))


def main(photos: int) -> int:
    """Print seconds per photo and errors; status 1 where the demand is not met."""
    with tempfile.TemporaryDirectory() as scratch:
        names, truth = rendered(Path(scratch))
        many = list(islice(cycle(names), photos))
        start = time.perf_counter()
        sightings = list(detect_in_photos(many, BOARD, read_grey, WORKERS))
        own = (time.perf_counter() - start) / photos
        worst = max(error_px(s.pixel_px, truth[k % RENDERED]) for k, s in enumerate(sightings))
        missed = sum(len(s.corner) < BOARD.columns * BOARD.rows for s in sightings)
        print(
            f"uavgram: {own:.2f} s per photo of {photos}, rms {worst:.4f} px, {missed} incomplete"
        )
        fastest = np.inf
        for what, peer in (("SB", sector), ("classical + SubPix", classical)):
            start = time.perf_counter()
            with ThreadPoolExecutor(WORKERS) as pool:
                found = list(pool.map(peer, islice(cycle(names), PEER)))
            spent = (time.perf_counter() - start) / PEER
            errors = [error_px(f, truth[k % RENDERED]) for k, f in enumerate(found)]
            lost = sum(f is None for f in found)
            fastest = min(fastest, spent)
            print(
                f"OpenCV {what}: {spent:.2f} s per photo of {PEER}, rms {np.nanmax(errors):.4f} "
                f"px, {lost} not found; uavgram is {spent / own:.1f} times as fast"
            )
    return 0 if own <= fastest else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 30))
