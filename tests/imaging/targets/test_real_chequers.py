"""Centres of chequers in photos of a real camera: how far they scatter, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.symmetry import find_centre_of_symmetry
from uavgram.model.arrays import Floats

BOARD = (9, 6)
DEGREE = 5
RADIUS_PX = 10.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_corners_of_a_real_board_scatter_as_is_said(data_dir: Path, side: str) -> None:
    """A flat board and a lens map corners smoothly: what is left over is the error of centres."""
    every = [residuals(path) for path in sorted((data_dir / "opencv_chess").glob(f"{side}*.jpg"))]
    off, sigma = (np.concatenate(part) for part in zip(*every, strict=True))
    assert len(off) > 600
    assert np.sqrt((off**2).mean()) < 0.06  # OpenCV's cornerSubPix: 0.10
    z = off / sigma[:, None]
    assert 0.8 < np.sqrt((z**2).mean()) < 1.25


def residuals(path: Path) -> tuple[Floats, Floats]:
    """(n, 2) what a smooth map of the board leaves over, as large as errors are; sigmas (n,)."""
    photo: Image = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)
    seen, corner = cv2.findChessboardCorners(photo, BOARD)
    if not seen:
        return np.zeros((0, 2)), np.zeros(0)
    start = corner.reshape((*BOARD[::-1], 2)).astype(np.float64)
    steps = (np.linalg.norm(np.diff(start, axis=k), axis=2).min() for k in (0, 1))
    radius = min(0.55 * min(steps), RADIUS_PX)
    board = np.stack(np.meshgrid(*map(np.arange, BOARD)), -1).reshape(-1, 2).astype(np.float64)
    found = [
        find_centre_of_symmetry(photo, place, radius * np.eye(2)) for place in start.reshape(-1, 2)
    ]
    there = [(at, one) for at, one in zip(board, found, strict=True) if one and one.likeness > 0.97]
    if len(there) < 35:
        return np.zeros((0, 2)), np.zeros(0)
    at = np.array([place for place, _ in there])
    center = np.array([one.pixel_px for _, one in there])
    matrix, _ = cv2.findHomography(at, center)
    bent = center - cv2.perspectiveTransform(at[:, None], matrix)[:, 0]
    x, y = ((at - at.mean(axis=0)) / 4.0).T
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    design = np.stack([x**i * y**j for i, j in powers], axis=1)
    hat = design @ np.linalg.pinv(design)
    off = (bent - hat @ bent) / np.sqrt(1.0 - np.diag(hat))[:, None]
    return off, np.array([one.sigma_px for _, one in there])
