"""Rendering of a plate in a photo: its cells under a homography, blurred, averaged over pixels.

A cell's straight edge, blurred a little, is an error function of the distance from it. The pattern
is drawn that way on a grid twice as fine as the pixels, blurred there by the rest of the photo's
blur, and averaged over each pixel. The picture is then smooth in the plate's corners, and its
derivative by a corner is its gradient times the shift of the pattern with this corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import ndtr

from uavgram.model.arrays import Bools, Floats

FINER = 2
"""Steps of the fine grid per pixel."""

DRAWN_BLUR_PX = 0.3
"""Blur that is drawn, and least blur; the rest is a filter.

A grid of half pixels does not resolve less.
"""

_BLUR_STEP_PX = 0.02
_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0  # exact for polynomials of degree 4
_CORNER_STEP = 1e-4  # of the plate's side
UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Window:
    """Part of a photo: pixel of its first corner, and its size."""

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns in the photo."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)

    @property
    def pixels(self) -> Floats:
        """(height, width, 2) places of its pixels."""
        v, u = np.mgrid[: self.height, : self.width]
        return np.stack([u + self.left, v + self.top], axis=-1).astype(np.float64)

    @property
    def fine_pixels(self) -> Floats:
        """(2 height, 2 width, 2) places of the fine grid."""
        v, u = np.mgrid[: self.height * FINER, : self.width * FINER]
        fine = (np.stack([u, v], axis=-1) + 0.5) / FINER - 0.5
        return np.asarray(fine + np.array([self.left, self.top]), np.float64)


@dataclass(frozen=True, eq=False)
class Picture:
    """Rendered plate.

    Attributes
    ----------
    share
        (height, width) whiteness of each pixel, 0 to 1.
    by_corner
        (height, width, 8) its derivatives by u and v of the four corners [1 / px].
    by_blur
        (height, width) its derivative by the blur [1 / px].
    """

    share: Floats
    by_corner: Floats
    by_blur: Floats


def fit_homography(corner_px: Floats) -> Floats:
    """Compute the (3, 3) homography from the plate to pixels.

    On the plate the first corner is (0, 0), the second (1, 0), the fourth (0, 1).
    """
    x, y = UNIT_SQUARE.T
    u, v = np.asarray(corner_px, np.float64).T
    zero, one = np.zeros(4), np.ones(4)
    # Two linear equations for each corner, with the last element fixed at 1.
    rows_u = np.stack([x, y, one, zero, zero, zero, -x * u, -y * u], axis=1)
    rows_v = np.stack([zero, zero, zero, x, y, one, -x * v, -y * v], axis=1)
    solved = np.linalg.solve(np.vstack([rows_u, rows_v]), np.concatenate([u, v]))
    return np.append(solved, 1.0).reshape(3, 3)


def invert_homography(matrix: Floats) -> Floats:
    """Invert a (3, 3) homography."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def apply_homography(matrix: Floats, place: Floats) -> Floats:
    """Map places (..., 2) by a homography."""
    raw = place @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(raw[..., :2] / raw[..., 2:])


def render_plate(cells: Bools, corner_px: Floats, blur_px: float, window: Window) -> Picture:
    """Draw a plate with white around it.

    Parameters
    ----------
    cells
        (n, n) of the plate, True is white.
    corner_px
        (4, 2) corners of its black square, from the first one on.
    blur_px
        Standard deviation of the blur, without a pixel's own size.
    window
        Pixels to draw.
    """
    matrix = fit_homography(corner_px)
    fine = _drawn(cells, invert_homography(matrix), window.fine_pixels)
    blurred = _blurred(fine, blur_px)
    slopes = [cv2.filter2D(blurred, -1, kernel) for kernel in (_SLOPE[None], _SLOPE[:, None])]
    gradient = FINER * np.stack([_averaged(np.asarray(s, np.float64)) for s in slopes], axis=-1)
    more = _averaged(_blurred(fine, blur_px + _BLUR_STEP_PX))
    share = _averaged(blurred)
    moved = _moved(matrix, corner_px, window.pixels)
    return Picture(
        share=share,
        by_corner=-np.einsum("vui,vuik->vuk", gradient, moved),
        by_blur=(more - share) / _BLUR_STEP_PX,
    )


def _drawn(cells: Bools, inverse: Floats, pixel: Floats) -> Floats:
    """Draw the share of white under a blur of `DRAWN_BLUR_PX`, at any places (h, w, 2) [px]."""
    n = len(cells)
    place = n * apply_homography(inverse, pixel)
    framed = np.pad(cells, 1, constant_values=True).astype(np.float64)
    third = pixel @ inverse[2, :2] + inverse[2, 2]
    across = []
    for axis in (0, 1):
        # gradient of a projective coordinate: (h_axis - place h_third) / third
        slope = (n * inverse[axis, :2] - place[..., axis, None] * inverse[2, :2]) / third[..., None]
        width = DRAWN_BLUR_PX * np.linalg.norm(slope, axis=-1)
        edges = ndtr((place[..., axis, None] - np.arange(n + 1)) / width[..., None])
        ones, zeros = np.ones((*edges.shape[:-1], 1)), np.zeros((*edges.shape[:-1], 1))
        # Each cell's coverage along this axis: difference of the error functions of its edges.
        step = np.concatenate([ones, edges, zeros], axis=-1)
        across.append(step[..., :-1] - step[..., 1:])
    x, y = across
    return np.asarray(((y @ framed) * x).sum(axis=-1))


def _blurred(fine: Floats, blur_px: float) -> Floats:
    # the mean of the steps in a pixel is narrower than the pixel by a variance of 1 / (12 FINER^2)
    variance = blur_px**2 - DRAWN_BLUR_PX**2 + 1.0 / (12.0 * FINER**2)
    more = FINER * max(variance, 1e-6) ** 0.5
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), more, borderType=cv2.BORDER_REPLICATE))


def _averaged(fine: Floats) -> Floats:
    """Average the steps of each pixel."""
    height, width = fine.shape
    steps = fine.reshape(height // FINER, FINER, width // FINER, FINER)
    return np.asarray(steps.mean(axis=(1, 3)), np.float64)


def _moved(matrix: Floats, corner_px: Floats, pixel: Floats) -> Floats:
    """Compute shifts (h, w, 2, 8) of the pattern at each pixel by the corners' coordinates."""
    place = apply_homography(invert_homography(matrix), pixel)
    step = _CORNER_STEP * float(np.linalg.norm(corner_px[2] - corner_px[0]))
    moved = np.empty((*pixel.shape, 8))
    for k in range(8):
        other = np.array(corner_px, np.float64).ravel()
        other[k] += step
        moved[..., k] = (
            apply_homography(fit_homography(other.reshape(4, 2)), place) - pixel
        ) / step
    return moved
