"""Drawings of a calibration: maps of the image, and the rules that the recording shares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.board import CalibrationResult, LensEffect
from uavgram.views.calibration.verdict import percent, pixels_text
from uavgram.views.style import scale_colours
from uavgram.views.survey.drawing import Drawing, Look
from uavgram.views.survey.outlines import nice_factor
from uavgram.views.survey.text_placement import Letters

RESIDUAL_SHARE = 0.04
"""Share of the photo's width that the larger exaggerated residuals fill."""

SQRT2 = 2.0**0.5
"""Ratio of the rms length of residuals to the rms of one coordinate."""

CELL_SHARE = 0.5
"""Share of a cell of the maps that the longest exaggerated mean residual fills."""


def rows_by_photo(result: CalibrationResult) -> dict[str, Ints]:
    """Return the rows of the corners of each used photo, by its name."""
    photo = result.corners.photo
    return {file: np.flatnonzero(photo == k) for k, file in enumerate(result.photos.file)}


def residual_factor(result: CalibrationResult) -> int:
    """Return the exaggeration of residuals on the photos, a number of the 1-2-5 series."""
    return nice_factor(_large(result.corners.residual_px), _wanted(result, RESIDUAL_SHARE))


def mean_residual_factor(result: CalibrationResult) -> int:
    """Return the exaggeration of the mean residuals in the cells of the maps."""
    maps = result.maps
    mean = maps.residual_px[np.isfinite(maps.residual_px[..., 0])]
    cell = CELL_SHARE / maps.cell_px.shape[1]
    longest = float(np.linalg.norm(mean, axis=-1).max()) if len(mean) else 0.0
    return nice_factor(longest, _wanted(result, cell))


def _large(residual_px: Floats) -> float:
    size = np.linalg.norm(residual_px, axis=1)
    return float(np.quantile(size, 0.9)) if len(size) else 0.0


def _wanted(result: CalibrationResult, share: float) -> float:
    return share * result.calibration.width_px


def tilt_directions(result: CalibrationResult) -> Floats:
    """Compute the (M, 2) tilt of the board in each photo [degrees], as a vector in the image.

    It points to where the board goes away from the camera: right and down are positive.
    """
    normal = result.photos.poses.world_from_camera[:, 2]  # the board's z in the camera's frame
    side = normal[:, :2] * np.sign(normal[:, 2:])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    unit = np.divide(side, length, out=np.zeros_like(side), where=length > 0)
    # A plane with the normal n falls away along -n: depth = (d - n_xy . p) / n_z.
    return np.asarray(-unit * result.photos.tilt_deg[:, None])


def uncertainty_shares(values: Floats) -> tuple[Floats, float, float]:
    """Scale values by their logarithms to 0 to 1; return the shares and the two ends.

    NaN becomes 1, the worst.
    """
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.1, 1.0)
    high = max(high, 2.0 * low)
    share = (np.log(np.clip(np.nan_to_num(values, nan=high), low, high)) - np.log(low)) / (
        np.log(high) - np.log(low)
    )
    return share, low, high


def hex_colours(share: Floats) -> list[str]:
    """Return the colours of the scale as ``#rrggbb``, for a flat array."""
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in scale_colours(share).tolist()]


def is_dark(colour: str) -> bool:
    """Return whether white letters are more legible on a colour (ITU-R BT.601 luma)."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return 0.299 * red + 0.587 * green + 0.114 * blue < 140


WIDTH = 520.0
MAX_DOTS = 6000
UNLIKELY = 0.001
"""Probability of a cell's mean residual below which the lens model is considered wrong there."""

EMPTY, DARK, LIGHT = "#f6d5d2", "#1b1f24", "#ffffff"
COVERED = np.array([[226.0, 236, 247], [84, 141, 202]])
FITS, MISFITS = "#2f6fb5", "#c92a2a"
STAGGER = 26.0
HEIGHT_M = 50.0
"""Height of the camera above the ground for which errors of lengths are given in millimetres."""
DIAL = 260.0
DIAL_RINGS_DEG = (15, 30, 45, 60)


LETTERS = {"cell": Letters(12.0), "over": Letters(12.0, colour=DARK)}


class Figure(NamedTuple):
    """Drawing, and its explanation."""

    drawing: Drawing
    note: str = ""


def _make_image_drawing(result: CalibrationResult, label: str) -> Drawing:
    camera = result.calibration
    height = WIDTH * camera.height_px / camera.width_px
    return Drawing(label, WIDTH, height, letters=LETTERS)


def coverage_map(result: CalibrationResult) -> Figure:
    """Draw the corners found and their number in each cell."""
    corners = result.maps.corners
    strength = np.log1p(corners) / np.log1p(max(int(corners.max()), 1))
    colours = COVERED[0] + strength[..., None] * (COVERED[1] - COVERED[0])
    fills = [
        EMPTY if count == 0 else "#{:02x}{:02x}{:02x}".format(*np.round(colour).astype(int))
        for count, colour in zip(corners.ravel(), colours.reshape(-1, 3), strict=True)
    ]
    removed = np.array([status == "removed" for status in result.corners.status])
    place, step = _place(result, result.corners.pixel_px)
    drawing = _make_image_drawing(result, "Corners in the image")
    texts = [str(count) for count in corners.ravel().tolist()]
    _draw_cells(drawing, result, fills, texts, DARK)
    drawing.signs("corners", place[~removed][::step], 1.1, Look(fill=FITS))
    drawing.signs("removed", place[removed], 2.0, Look(fill=MISFITS))
    return Figure(drawing, _thin(step))


def residual_map(result: CalibrationResult) -> Figure:
    """Draw the residual of every corner and their mean in each cell."""
    corners, maps = result.corners, result.maps
    factor = mean_residual_factor(result)
    used = np.array([status != "removed" for status in corners.status])
    start, step = _place(result, corners.pixel_px)
    end, _ = _place(result, corners.pixel_px + factor * corners.residual_px)
    mean_from, _ = _place(result, maps.cell_px.reshape(-1, 2))
    tips = maps.cell_px + factor * maps.residual_px
    mean_to, _ = _place(result, tips.reshape(-1, 2))
    known = np.isfinite(mean_to[:, 0])
    odd = known & (maps.residual_probability.ravel() < UNLIKELY)
    drawing = _make_image_drawing(result, "Residuals in the image")
    each = np.stack([start, end], axis=1)[used][::step]
    drawing.lines("corners", each, Look("#b9c6d6", 0.6))
    for name, rows, look in (
        ("mean", known & ~odd, Look(FITS, 2.0)),
        ("odd", odd, Look(MISFITS, 2.4)),
    ):
        drawing.lines(name, _arrows(mean_from[rows], mean_to[rows]), look)
    return Figure(drawing, f"Drawn {factor} times too long. {_thin(step)}".strip())


def uncertainty_map(result: CalibrationResult) -> Figure:
    """Draw the sigma of a projected direction in each cell."""
    values = result.maps.uncertainty_px.ravel()
    share, _, _ = uncertainty_shares(values)
    fills = hex_colours(1 - share)
    texts = [pixels_text(value) for value in values.tolist()]
    drawing = _make_image_drawing(result, "Sigma of a projected direction in the image")
    _draw_cells(drawing, result, fills, texts, None)
    return Figure(drawing)


def length_map(result: CalibrationResult, effect: LensEffect, picture: str = "") -> Figure | None:
    """Draw level lengths on the ground with the error that the calibration causes in each.

    Parameters
    ----------
    result
        The camera.
    effect
        Effect of its errors on lengths on level ground.
    picture
        A photo of the camera as background, as a data URL.

    Returns
    -------
    None if no ground is seen.
    """
    lengths = effect.lengths
    if lengths is None:
        return None
    ends = _place(result, lengths.pixel_px.reshape(-1, 2))[0].reshape(-1, 2, 2)
    level = np.flatnonzero(np.abs(ends[:, 1, 1] - ends[:, 0, 1]) < 1.0)
    # lengths of one row overlap a little: every other one is drawn lower
    column = np.unique(np.round(ends[level, 0, 0]), return_inverse=True)[1]
    ends = ends[level] + np.array([0.0, STAGGER]) * (column % 2)[:, None, None]
    values = lengths.pose_fitted[level]
    cost_mm = 1000.0 * values * lengths.length[level] * HEIGHT_M
    colours = hex_colours(1 - uncertainty_shares(values)[0])
    drawing = _make_image_drawing(result, "Lengths in the image")
    if picture:
        size = np.array([drawing.width, drawing.height])
        drawing.image(np.zeros(2), size, picture, opacity=0.5)
    ticks = np.array([[0.0, -5.0], [0.0, 5.0]])
    for pair, colour, value, cost in zip(ends, colours, values, cost_mm, strict=True):
        lines = [pair, *(end + ticks for end in pair)]
        drawing.lines("lengths", lines, Look(colour, 3.0))
        x, y = pair.mean(axis=0)
        drawing.write((x, y - 7), f"{percent(value)}, {cost:.2g} mm", "over", patch=0.7)
    worst = int(np.argmax(cost_mm))
    note = (
        f"Millimetres are those from {HEIGHT_M:g} m above the ground: a length of "
        f"{HEIGHT_M * lengths.length[level][worst]:.1f} m is uncertain by up to "
        f"{cost_mm[worst]:.2g} mm. From twice the height it is twice as long, and so is its error."
    )
    return Figure(drawing, note)


def tilt_dial(result: CalibrationResult) -> Figure:
    """Draw the tilt of the board in each photo: away from the camera towards that side."""
    tilt = tilt_directions(result)
    reach = max(float(np.linalg.norm(tilt, axis=1).max(initial=0.0)), 20.0) * 1.12
    middle, scale = DIAL / 2, DIAL / 2 / reach
    drawing = Drawing("Tilts of the board", DIAL, DIAL, letters=LETTERS)
    thin = Look("#d5d9de", 1.0)
    drawing.lines("axes", DIAL * np.array([[[0.5, 0], [0.5, 1]], [[0, 0.5], [1, 0.5]]]), thin)
    for ring in (ring for ring in DIAL_RINGS_DEG if 1.1 * ring < reach):
        drawing.signs("rings", np.full((1, 2), middle), ring * scale, thin)
        drawing.write((middle + 12, middle - ring * scale - 3), f"{ring}°", "over", patch=0.7)
    removed = np.array([status == "removed" for status in result.photos.status])
    spots = middle + scale * tilt
    drawing.signs("tilts", spots[~removed], 4.0, Look(fill=FITS))
    drawing.signs("removed", spots[removed], 4.0, Look(fill=MISFITS))
    return Figure(drawing)


def _place(result: CalibrationResult, pixel: Floats) -> tuple[Floats, int]:
    """Return (N, 2) places in the drawing, and the step by which corners are thinned out."""
    scale = WIDTH / result.calibration.width_px
    return np.asarray((pixel + 0.5) * scale), max(1, -(-len(pixel) // MAX_DOTS))


def _thin(step: int) -> str:
    return f"Of many corners, one in {step} is drawn." if step > 1 else ""


def _draw_cells(
    drawing: Drawing, result: CalibrationResult, fills: list[str], texts: list[str], ink: str | None
) -> None:
    """Draw the cells of the image with their colours and texts."""
    rows, columns = result.maps.corners.shape
    size = np.array([drawing.width / columns, drawing.height / rows])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for k, (fill, text) in enumerate(zip(fills, texts, strict=True)):
        corner = np.array([k % columns, k // columns])
        look = Look(LIGHT, 0.7, fill=fill)
        drawing.lines("cells", [size * (corner + square)], look, closed=True)
        x, y = size * (corner + 0.5)
        colour = ink or (LIGHT if is_dark(fill) else DARK)
        drawing.write((x, y + 4), text, "cell", colour=colour)


def _arrows(start: Floats, end: Floats) -> Floats:
    """Draw lines with heads of a fixed size, or smaller on short lines; (3n, 2, 2)."""
    along = end - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    unit = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    # normal of the line: the head reaches half its length to both sides
    side = unit[:, ::-1] * [-1.0, 1.0]
    head = np.minimum(7.0, 0.5 * length)
    left, right = end - head * (unit - 0.5 * side), end - head * (unit + 0.5 * side)
    tails = np.concatenate([start, left, right])
    return np.stack([tails, np.tile(end, (3, 1))], axis=1)
