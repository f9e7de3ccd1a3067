"""Drawings of a calibration for the page: shapes in units of the drawing, no estimation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration_result import CalibrationResult, LensEffect
from uavgram.views.calibration.drawing_rules import (
    hex_colours,
    is_dark,
    mean_residual_factor,
    pixels_text,
    tilt_directions,
    uncertainty_shares,
)
from uavgram.views.calibration.verdict import percent

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


@dataclass(frozen=True)
class Cell:
    """Cell of the image with its colour and text."""

    x: float
    y: float
    width: float
    height: float
    fill: str
    text: str
    ink: str


@dataclass(frozen=True)
class Mark:
    """Text at a place."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Drawing:
    """Shapes by kind; paths are SVG's, by colour.

    Attributes
    ----------
    width, height
        Size of the drawing.
    cells, marks
        In the order in which they are drawn.
    paths
        Triples of path, colour and width.
    note
        Explanation of the drawing.
    picture
        A photo under it, as a data URL; empty: none.
    """

    width: float
    height: float
    cells: tuple[Cell, ...] = ()
    paths: tuple[tuple[str, str, float], ...] = ()
    marks: tuple[Mark, ...] = ()
    note: str = ""
    picture: str = ""


def coverage_map(result: CalibrationResult) -> Drawing:
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
    paths = [(_dots(place[~removed][::step], 1.1), FITS, 0.0)]
    if removed.any():
        paths.append((_dots(place[removed], 2.0), MISFITS, 0.0))
    texts = [str(count) for count in corners.ravel().tolist()]
    return Drawing(
        width=WIDTH,
        height=_height(result),
        cells=_cells(result, fills, texts, DARK),
        paths=tuple(paths),
        note=_thin(step),
    )


def residual_map(result: CalibrationResult) -> Drawing:
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
    return Drawing(
        width=WIDTH,
        height=_height(result),
        paths=(
            (_lines(start[used][::step], end[used][::step]), "#b9c6d6", 0.6),
            (_arrows(mean_from[known & ~odd], mean_to[known & ~odd]), FITS, 2.0),
            (_arrows(mean_from[odd], mean_to[odd]), MISFITS, 2.4),
        ),
        note=f"Drawn {factor} times too long. {_thin(step)}".strip(),
    )


def uncertainty_map(result: CalibrationResult) -> Drawing:
    """Draw the sigma of a projected direction in each cell."""
    values = result.maps.uncertainty_px.ravel()
    share, _, _ = uncertainty_shares(values)
    fills = hex_colours(1 - share)
    texts = [pixels_text(value) for value in values.tolist()]
    return Drawing(width=WIDTH, height=_height(result), cells=_cells(result, fills, texts, None))


def length_map(result: CalibrationResult, effect: LensEffect, picture: str = "") -> Drawing | None:
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
    ticks = np.array([[0.0, -5.0], [0.0, 5.0]])
    paths = []
    for pair, colour in zip(ends, colours, strict=True):
        bars = [_lines(end[None] + ticks[:1], end[None] + ticks[1:]) for end in pair]
        paths.append((_lines(pair[:1], pair[1:]) + "".join(bars), colour, 3.0))
    marks = [
        Mark(x, y - 7, f"{percent(value)}, {cost:.2g} mm")
        for (x, y), value, cost in zip(
            ends.mean(axis=1).tolist(), values.tolist(), cost_mm.tolist(), strict=True
        )
    ]
    worst = int(np.argmax(cost_mm))
    return Drawing(
        width=WIDTH,
        height=_height(result),
        paths=tuple(paths),
        marks=tuple(marks),
        note=f"Millimetres are those from {HEIGHT_M:g} m above the ground: a length of "
        f"{HEIGHT_M * lengths.length[level][worst]:.1f} m is uncertain by up to "
        f"{cost_mm[worst]:.2g} mm. From twice the height it is twice as long, and so is its error.",
        picture=picture,
    )


def tilt_dial(result: CalibrationResult) -> Drawing:
    """Draw the tilt of the board in each photo: away from the camera towards that side."""
    tilt = tilt_directions(result)
    reach = max(float(np.linalg.norm(tilt, axis=1).max(initial=0.0)), 20.0) * 1.12
    middle, scale = DIAL / 2, DIAL / 2 / reach
    rings = [ring for ring in DIAL_RINGS_DEG if 1.1 * ring < reach]
    circles = "".join(
        f"M{middle - ring * scale:.1f} {middle:.1f}a{ring * scale:.1f} {ring * scale:.1f} 0 1 0 "
        f"{2 * ring * scale:.1f} 0a{ring * scale:.1f} {ring * scale:.1f} 0 1 0 "
        f"{-2 * ring * scale:.1f} 0"
        for ring in rings
    )
    cross = f"M{middle} 0V{DIAL}M0 {middle}H{DIAL}"
    removed = np.array([status == "removed" for status in result.photos.status])
    spots = middle + scale * tilt
    return Drawing(
        width=DIAL,
        height=DIAL,
        paths=(
            (circles + cross, "#d5d9de", 1.0),
            (_dots(spots[~removed], 4.0), FITS, 0.0),
            (_dots(spots[removed], 4.0), MISFITS, 0.0),
        ),
        marks=tuple(Mark(middle + 12, middle - ring * scale - 3, f"{ring}°") for ring in rings),
    )


def _height(result: CalibrationResult) -> float:
    camera = result.calibration
    return WIDTH * camera.height_px / camera.width_px


def _place(result: CalibrationResult, pixel: Floats) -> tuple[Floats, int]:
    """Return (N, 2) places in the drawing, and the step by which corners are thinned out."""
    scale = WIDTH / result.calibration.width_px
    return np.asarray((pixel + 0.5) * scale), max(1, -(-len(pixel) // MAX_DOTS))


def _thin(step: int) -> str:
    return f"Of many corners, one in {step} is drawn." if step > 1 else ""


def _cells(
    result: CalibrationResult, fills: list[str], texts: list[str], ink: str | None
) -> tuple[Cell, ...]:
    rows, columns = result.maps.corners.shape
    width, height = WIDTH / columns, _height(result) / rows
    return tuple(
        Cell(
            x=(k % columns) * width,
            y=(k // columns) * height,
            width=width,
            height=height,
            fill=fill,
            text=text,
            ink=ink or (LIGHT if is_dark(fill) else DARK),
        )
        for k, (fill, text) in enumerate(zip(fills, texts, strict=True))
    )


def _dots(place: Floats, radius: float) -> str:
    """Draw round dots as filled paths."""
    r = f"{radius:g}"
    return "".join(
        f"M{x - radius:.1f} {y:.1f}a{r} {r} 0 1 0 {2 * radius:g} 0a{r} {r} 0 1 0 {-2 * radius:g} 0"
        for x, y in place.tolist()
    )


def _lines(start: Floats, end: Floats) -> str:
    return "".join(
        f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}"
        for (a, b), (c, d) in zip(start.tolist(), end.tolist(), strict=True)
    )


def _arrows(start: Floats, end: Floats) -> str:
    """Draw lines with heads of a fixed size, or smaller on short lines."""
    along = end - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    unit = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    # normal of the line: the head reaches half its length to both sides
    side = unit[:, ::-1] * [-1.0, 1.0]
    head = np.minimum(7.0, 0.5 * length)
    left, right = end - head * (unit - 0.5 * side), end - head * (unit + 0.5 * side)
    return _lines(start, end) + _lines(left, end) + _lines(right, end)
