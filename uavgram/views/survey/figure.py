"""Drawings as Matplotlib figures: for PDF and PNG that need no library of the system."""

from __future__ import annotations

import io
from functools import lru_cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.textpath import TextPath

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.naming import Units
from uavgram.views.survey.drawing import Drawing, Look, Shapes
from uavgram.views.survey.text_placement import ASIDE, PlacedText
from uavgram.views.units import round_bar

MM_OF_POINT = 25.4 / 72.0
SMALLER = 0.87
"""Size of letters of this font that are as wide as those of a browser's."""


def draw_figure(drawing: Drawing) -> Figure:
    """Draw on paper a drawing in millimetres; its pictures are pixels.

    Parameters
    ----------
    drawing
        The drawing.
    """
    figure = Figure(figsize=(drawing.width / 25.4, drawing.height / 25.4))
    draw_in_axes(drawing, figure.add_axes((0.0, 0.0, 1.0, 1.0)), 1.0)
    return figure


LEAST_WIDTH_PX = 480
"""Least width: narrower top views get a margin, so that scale bar and arrow fit."""

FOOT = 70.0
"""Height below a top view, in units of the letters: for the scale bar and the caption."""


def draw_map_sheet(rgba: Pixels, pixel_m: float, caption: str, units: Units) -> bytes:
    """Draw a north-up picture with north arrow, scale bar and caption; return a PNG.

    Parameters
    ----------
    rgba
        (H, W, 4).
    pixel_m
        Edge of a pixel.
    caption
        One line.
    units
        Units of the scale bar.
    """
    height, width = rgba.shape[:2]
    wide = max(width, LEAST_WIDTH_PX)
    unit = wide / 720.0
    drawing = Drawing("Top view, to scale", wide, height + FOOT * unit, unit=unit)
    white = np.where(rgba[..., 3:] > 0, rgba[..., :3], 255).astype(np.uint8)
    drawing.image(np.zeros(2), np.array([width, height], np.float64), white)
    bar_m, text = round_bar(0.25 * wide * pixel_m, units)
    drawing.scale_bar(24.0 * unit, height + 18.0 * unit, bar_m / pixel_m, text)
    drawing.write((24.0 * unit, height + 58.0 * unit), caption, side=-1)
    drawing.compass(patch=0.8)
    stored = io.BytesIO()
    draw_figure(drawing).savefig(stored, format="png", dpi=25.4, pil_kwargs={"compress_level": 1})
    return stored.getvalue()


def draw_in_axes(drawing: Drawing, axes: Axes, mm: float) -> None:
    """Draw into axes, without their frame.

    Parameters
    ----------
    drawing
        The drawing; its pictures are pixels.
    axes
        The axes.
    mm
        Millimetres on paper of a unit of the drawing.
    """
    axes.set_xlim(0.0, drawing.width)
    axes.set_ylim(drawing.height, 0.0)
    axes.set_axis_off()
    point = MM_OF_POINT / mm
    frame = Path(drawing.border)
    for image in drawing.images:
        (left, top), (right, bottom) = image.place, image.place + image.size
        shown = axes.imshow(
            np.asarray(image.data), extent=(left, right, bottom, top), aspect="auto",
            interpolation="none", alpha=None if image.opacity == 1.0 else image.opacity, zorder=0,
        )  # fmt: skip
        shown.set_clip_path(frame, axes.transData)
    every = [*drawing.shapes, *drawing.signs_over]
    for order, shapes in enumerate(every, start=1):
        path = _path(shapes)
        for look in shapes.looks:
            patch = _patch(path, look, drawing.unit / point, order)
            axes.add_artist(patch)
            if shapes.clip is not None:
                patch.set_clip_path(Path(shapes.clip), axes.transData)
    for text in (*drawing.written, *drawing.texts):
        _write(axes, drawing, text, point, len(every) + 1)


def _path(shapes: Shapes) -> Path:
    if shapes.sign == "ring":
        circles = [Path.circle(tuple(at[0]), shapes.radius) for at in shapes.lines]
        return Path.make_compound_path(*circles)
    lines = shapes.outlines
    if not shapes.closed:
        return Path.make_compound_path(*(Path(line) for line in lines))
    rings = (np.concatenate([line, line[:1]]) for line in lines)
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))


def _patch(path: Path, look: Look, points: float, order: int) -> PathPatch:
    """Return a path with its style; a unit has so many points, dashes are in widths of lines."""
    path.should_simplify = False
    dashes = tuple(float(one) / look.width for one in look.dashes.split())
    edge, face = (
        "none" if colour == "none" else (colour, opacity)
        for colour, opacity in ((look.stroke, look.opacity), (look.fill, look.fill_opacity))
    )
    return PathPatch(
        path,
        edgecolor=edge,
        facecolor=face,
        linewidth=look.width * points,
        linestyle=(0.0, dashes) if dashes else "solid",
        capstyle="butt",
        zorder=order,
    )


def _write(axes: Axes, drawing: Drawing, text: PlacedText, point: float, order: int) -> None:
    """Write a text no wider than its box; a point is so long in the drawing."""
    look, unit = drawing.letters[text.kind], drawing.unit * text.size
    weight = "bold" if look.is_bold else "normal"
    half = text.half_width - ASIDE * unit
    widest = 2 * half / max(_width(text.text, weight), 1e-9)
    axes.text(
        text.x + text.side * half, text.y, _plain(text.text),
        fontsize=min(SMALLER * look.size * unit, widest) / point,
        color=text.colour or look.colour, weight=weight, style=look.style,
        ha=("center", "right", "left")[text.side], va="baseline",
        rotation=-float(np.degrees(text.turn)), rotation_mode="anchor", zorder=order,
    )  # fmt: skip


def _plain(text: str) -> str:
    """Escape dollars, between which Matplotlib would see a formula."""
    return text.replace("$", r"\$")


@lru_cache(maxsize=2048)
def _width(text: str, weight: str) -> float:
    """Return the width of a text, in heights of its letters."""
    if not text.strip():
        return 0.0
    path = TextPath((0.0, 0.0), _plain(text), size=1.0, prop=FontProperties(weight=weight))
    return float(path.get_extents().width)
