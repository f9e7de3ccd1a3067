"""Photos of plates and marks, by sampling: twelve by twelve samples in a pixel, then a blur.

Nothing is shared with the fit's own drawing but the cells of the dictionary.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Bools, Floats

FINER = 12
BLACK, WHITE, GROUND = 22.0, 225.0, 105.0
BLUR_PX, NOISE = 0.7, 2.0


def quad(
    center_px: tuple[float, float], side_px: float, turn_deg: float, squeeze: float = 1.0
) -> Floats:
    """(4, 2) corners of a plate seen aslant, its far sides a little shorter.

    Parameters
    ----------
    center_px, side_px, turn_deg
        Where it lies, how large it is, and how it is turned.
    squeeze
        Height over width of what the view makes of a square.
    """
    turn = np.deg2rad(turn_deg)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    flat = side_px * np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) @ rotation.T
    flat[:, 1] *= squeeze
    away = 1.0 + 0.0006 * flat[:, 1:]
    return np.asarray(flat * away + center_px)


def plate_samples(
    cells: Bools, corner_px: Floats, shape: tuple[int, int], margin: float = 1.0
) -> Floats:
    """(12 h, 12 w) brightness of a plate with a white margin on grey ground.

    Parameters
    ----------
    cells
        (n, n), True is white.
    corner_px
        (4, 2) of the black square.
    shape
        Height and width of the photo.
    margin
        In cells.
    """
    n = len(cells)
    square = n * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    matrix = _exact_homography(square.astype(np.float64), corner_px)
    x, y = _places(np.asarray(np.linalg.inv(matrix), np.float64), shape)
    picture = np.full(x.shape, GROUND)
    on = (np.abs(x - n / 2) < n / 2 + margin) & (np.abs(y - n / 2) < n / 2 + margin)
    picture[on] = WHITE
    inside = (x >= 0) & (x < n) & (y >= 0) & (y < n)
    white = cells[np.clip(y.astype(int), 0, n - 1), np.clip(x.astype(int), 0, n - 1)]
    picture[inside] = np.where(white[inside], WHITE, BLACK)
    return picture


def photo_of(
    samples: Floats,
    rng: np.random.Generator,
    *,
    blur_px: float = BLUR_PX,
    noise: float = NOISE,
    quality: int | None = None,
) -> NDArray[np.uint8]:
    """A photo of samples: blurred, averaged over pixels, with noise, in whole grey values.

    Parameters
    ----------
    samples
        (12 h, 12 w).
    rng
        Draws the noise.
    blur_px, noise
        Standard deviations.
    quality
        Of a JPEG; None: none is made.
    """
    soft = cv2.GaussianBlur(samples, (0, 0), blur_px * FINER)
    h, w = (n // FINER for n in samples.shape)
    mean = np.asarray(soft).reshape(h, FINER, w, FINER).mean(axis=(1, 3))
    noisy = mean + noise * rng.standard_normal(mean.shape)
    photo: NDArray[np.uint8] = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
    if quality is None:
        return photo
    jpeg = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), np.uint8)


def shadowed(samples: Floats, angle_deg: float, away_px: float, left: float = 0.45) -> Floats:
    """The same with a shadow behind a straight edge.

    Parameters
    ----------
    samples
        (12 h, 12 w).
    angle_deg, away_px
        Of the edge's normal, and how far it is from the middle of the photo.
    left
        Share of the light in the shadow.
    """
    v, u = np.mgrid[: samples.shape[0], : samples.shape[1]] / FINER
    middle = np.array(samples.shape) / FINER / 2
    turn = np.deg2rad(angle_deg)
    ahead = np.cos(turn) * (u - middle[1]) + np.sin(turn) * (v - middle[0]) - away_px
    return np.where(ahead > 0, left * samples, samples)


def _places(inverse: Floats, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    v, u = (np.mgrid[: shape[0] * FINER, : shape[1] * FINER] + 0.5) / FINER - 0.5
    x, y, z = (inverse[i, 0] * u + inverse[i, 1] * v + inverse[i, 2] for i in range(3))
    return x / z, y / z


def _exact_homography(source: Floats, target: Floats) -> Floats:
    """By the null space of its twelve coefficients' equations (Hartley and Zisserman 2004, 4.1)."""
    rows = []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y, -u], [0, 0, 0, x, y, 1, -v * x, -v * y, -v]]
    last = np.linalg.svd(np.array(rows, np.float64))[2][-1]
    return np.asarray(last.reshape(3, 3), np.float64)
