"""Detection of plates in a photo: found, fitted, and verified by their whole picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from uavgram.imaging.plates.evidence import agreement_at, wrong_cells
from uavgram.imaging.plates.families import cells_of
from uavgram.imaging.plates.find import Candidate, candidates
from uavgram.imaging.plates.fit import PlateFit, fit_with_shadows
from uavgram.imaging.plates.picture import UNIT_SQUARE, Window, homography, mapped
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.model.survey.observations import LeftOut, SeenPlate

LEAST_SIDE_PX = 8.0
"""Least side of a plate: with a shorter one its cells are hardly a pixel wide."""

_LEAST_AGREEMENT = 0.93  # below, it is not a plate
_CLEAN_AGREEMENT = 0.97  # below, something covers it that the fit cannot model
_LEAST_CONTRAST = 5.0  # in rms of the residuals
_WIDER = 1.25
_LEAST_SIGMA_PX = 0.018
_MOST_SIGMA_PX = 0.3
_LARGEST_SIDE_PX = 72.0  # larger plates are fitted in a reduced photo
_PROMISING = 0.6  # correlation at OpenCV's corners
_AROUND = 1.3  # cells of the window around the black square


def shortest_side(corner_px: Floats) -> float:
    """Compute the length of the shortest side of a quadrilateral (4, 2)."""
    return float(np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).min())


def sight_plates(image: Image, family: str) -> tuple[SeenPlate, ...]:
    """Find and measure all plates of a family in a photo.

    Parameters
    ----------
    image
        (height, width) grey, original size and orientation.
    family
        One of `FAMILIES`.
    """
    return _sighted_all(image, family, candidates(image, family))


def sight_large_plates(
    reduced: Image, factor: int, whole: Callable[[], Image], family: str
) -> tuple[SeenPlate, ...]:
    """Find the plates that a reduced photo shows, and measure them in the photo itself.

    Parameters
    ----------
    reduced
        (height, width) grey, reduced by `factor` in each direction.
    factor
        Pixels of the photo per pixel of the reduced one.
    whole
        Gives the photo; called only where there may be a plate.
    family
        One of `FAMILIES`.
    """
    found = [
        one._replace(corner_px=(one.corner_px + 0.5) * factor - 0.5)
        for one in candidates(reduced, family, doubled=False)
    ]
    return _sighted_all(whole(), family, found) if found else ()


def _sighted_all(image: Image, family: str, found: Sequence[Candidate]) -> tuple[SeenPlate, ...]:
    """Measure candidates; return those that are plates, sorted by their ids."""
    seen = [_sighted(image, family, one) for one in found]
    plates = [one for one in seen if one is not None]
    certain = [one.plate for one in plates if one.left_out is not LeftOut.DOUBTFUL]
    count = np.bincount(certain, minlength=1 + max((one.plate for one in plates), default=0))
    marked = [
        replace(one, left_out=LeftOut.TWICE) if count[one.plate] > 1 else one for one in plates
    ]
    return tuple(sorted(marked, key=lambda one: one.plate))


def _sighted(image: Image, family: str, candidate: Candidate) -> SeenPlate | None:
    """Measure a candidate; None where it is not a plate."""
    corner = candidate.corner_px
    if shortest_side(corner) < LEAST_SIDE_PX - 1.0:
        return None
    cells = cells_of(family, candidate.plate)
    window = window_about(corner, len(cells), image.shape)
    rows, columns = window.slices
    grey = image[rows, columns]
    sides = np.linalg.norm(np.roll(corner, -1, axis=0) - corner, axis=1)
    # Large plates are measured in a reduced window.
    factor = max(1, math.ceil(float(sides.max()) / _LARGEST_SIDE_PX))
    if factor > 1:
        grey, window = _reduced(grey, window, factor)
        corner = (corner + 0.5) / factor - 0.5
    agreement = agreement_at(grey, window, cells, corner)
    if agreement < _PROMISING:
        return None
    fitted = fit_with_shadows(grey.astype(np.float64), window, cells, corner)
    if fitted is None:
        return _doubtful(candidate, agreement)
    if wrong_cells(fitted, cells, window):
        return None
    if not _is_plate(fitted):
        return _doubtful(candidate, fitted.agreement)
    return _seen(candidate.plate, fitted, factor)


def _doubtful(candidate: Candidate, agreement: float) -> SeenPlate:
    """Describe a doubtful plate, reported only where other photos confirm the same plate."""
    return SeenPlate(
        plate=candidate.plate,
        corner_px=candidate.corner_px,
        sigma_px=np.full(4, np.nan),
        center_px=candidate.corner_px.mean(axis=0),
        center_sigma_px=float("nan"),
        score=max(agreement, 0.0),
        left_out=LeftOut.DOUBTFUL,
    )


def _reduced(grey: Image, window: Window, factor: int) -> tuple[Image, Window]:
    """Reduce a window by `factor` each way; an incomplete block at its end is dropped."""
    left, top = (-(-n // factor) for n in (window.left, window.top))
    inner = grey[top * factor - window.top :, left * factor - window.left :]
    height, width = (n // factor for n in inner.shape)
    blocks = inner[: height * factor, : width * factor].reshape(height, factor, width, factor)
    mean = blocks.mean(axis=(1, 3), dtype=np.float64)
    return np.asarray(np.round(mean), np.uint8), Window(left, top, width, height)


def _is_plate(fitted: PlateFit) -> bool:
    strong = fitted.contrast > _LEAST_CONTRAST * fitted.rms
    large = shortest_side(fitted.corner_px) >= LEAST_SIDE_PX
    return strong and large and fitted.agreement >= _LEAST_AGREEMENT


def _seen(plate: int, fitted: PlateFit, factor: int) -> SeenPlate:
    """Describe a fitted plate in the photo, where `factor` pixels were reduced to one."""
    variance = np.diagonal(fitted.covariance_px2).reshape(4, 2).mean(axis=1)
    sigma = factor * np.hypot(_WIDER * np.sqrt(variance), _LEAST_SIGMA_PX)
    corner = (fitted.corner_px + 0.5) * factor - 0.5
    matrix = homography(corner)
    left_out = LeftOut.NO
    if sigma.max() > factor * _MOST_SIGMA_PX:
        left_out = LeftOut.FAINT
    if fitted.agreement < _CLEAN_AGREEMENT:
        left_out = LeftOut.COVERED
    return SeenPlate(
        plate=plate,
        corner_px=corner,
        sigma_px=sigma,
        center_px=mapped(matrix, UNIT_SQUARE.mean(axis=0)),
        center_sigma_px=float(np.sqrt((sigma**2).mean() / 4)),
        score=fitted.agreement,
        shadows=len(fitted.edges),
        left_out=left_out,
    )


def window_about(corner_px: Floats, cells: int, shape: tuple[int, ...]) -> Window:
    """Return the window of a plate and of the white around it, within the photo.

    Parameters
    ----------
    corner_px
        (4, 2) corners of its black square.
    cells
        Number of cells along a side.
    shape
        Shape of the photo.
    """
    side = np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).max()
    around = _AROUND * side / cells + 3.0
    height, width = shape[:2]
    left, top = np.floor(corner_px.min(axis=0) - around).astype(int).clip(0).tolist()
    last = np.ceil(corner_px.max(axis=0) + around).astype(int) + 1
    right, below = min(int(last[0]), width), min(int(last[1]), height)
    return Window(left, top, right - left, below - top)
