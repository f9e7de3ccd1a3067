"""Marks and scale bars that are drawn over the photos of the report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.result.pictures import Region
from uavgram.model.result.result import Result
from uavgram.views.survey.outlines import project_from
from uavgram.views.units import round_bar, units_of


class Mark(NamedTuple):
    """Pick: its place, its colour, and two paths: its outline, and a cross in its middle."""

    x: float
    y: float
    colour: str
    outline: str
    middle: str


def draw_mark(
    place: tuple[float, float], kind: str, colour: str, half_widths: tuple[float, float]
) -> Mark:
    """Draw a pick.

    Parameters
    ----------
    place
        Place of its middle.
    kind
        Its origin as in `Source`; or ``removed`` for a removed one.
    colour
        Colour of its lines.
    half_widths
        Half widths of the outline, and of the cross in its middle.
    """
    outer, inner = half_widths
    return Mark(*place, colour, _SHAPES[kind](*place, outer), _cross(*place, inner))


def draw_rings(places: Iterable[tuple[float, float]], r: float) -> str:
    """Draw one ring about each place, as one path.

    Drawing programs set the style again for each path.
    """
    return "".join(_ring(x, y, r) for x, y in places)


def _ring(x: float, y: float, r: float) -> str:
    return f"M{round(x - r, 2)} {round(y, 2)} {_curves(r)}"


@lru_cache(64)
def _curves(r: float) -> str:
    """Return four curves that differ from a circle by 0.03 % of its radius.

    With arcs some readers take thrice as long. Hundreds of rings of a page have the same size.
    """
    k = round(0.5523 * r, 2)
    q = round(r - k, 2)
    return (
        f"c0 {-k} {q} {-r} {r} {-r} {k} 0 {r} {q} {r} {r} "
        f"0 {k} {-q} {r} {-r} {r} {-k} 0 {-r} {-q} {-r} {-r} Z"
    )


def _cross(x: float, y: float, r: float) -> str:
    left, top, right, bottom = (round(part, 2) for part in (x - r, y - r, x + r, y + r))
    return f"M{left} {top} L{right} {bottom} M{left} {bottom} L{right} {top}"


def _square(x: float, y: float, r: float) -> str:
    return f"M{round(x - r, 2)} {round(y - r, 2)} h{2 * r} v{2 * r} h{-2 * r} Z"


def _diamond(x: float, y: float, r: float) -> str:
    left, top, right, bottom = (round(part, 2) for part in (x - r, y - r, x + r, y + r))
    return f"M{x} {top} L{right} {y} L{x} {bottom} L{left} {y} Z"


_SHAPES = {"match": _square, "target": _diamond, "hand": _ring, "removed": _cross}


class Bar(NamedTuple):
    """Scale bar in pixels of the photo, its length in words, and the left edge of its box."""

    length: float
    text: str
    left: float = 0.0
    width: float = 0.0


def scale_bars(result: Result, regions: Sequence[Region]) -> dict[Region, Bar]:
    """Compute scale bars at the depth of each picture's subject; an overview has none."""
    shown = [region for region in regions if region.subject != "overview"]
    if not shown:
        return {}
    row_of = {label: row for row, label in enumerate(result.points.label)}
    place = result.points.position_world_m
    around = [[row_of[label] for label in _around(result, region)] for region in shown]
    middle = np.stack([place[rows].mean(axis=0) for rows in around])
    poses = row_poses(result, np.array([region.frame for region in shown]))
    # ground size of a pixel: depth along the optical axis over the focal length
    depth_m = np.sum((middle - poses.center) * poses.rotation[:, :, 2], axis=1)
    pixel_m = depth_m / float(result.shared.intrinsics.value[0])
    units = units_of(result)
    bars = [
        round_bar(0.35 * region.width_px * size_m, units) if size_m > 0 else (np.nan, "")
        for region, size_m in zip(shown, pixel_m.tolist(), strict=True)
    ]
    # ends of a bar parallel to the rows of the photo
    half = poses.rotation[:, :, 0] * np.array([[bar_m] for bar_m, _ in bars]) / 2
    # project the bars of all pictures at once: there may be hundreds
    ends = project_from(result, poses, np.stack([middle - half, middle + half]))
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    return {
        region: Bar(long, text)
        for region, long, (_, text) in zip(shown, length.tolist(), bars, strict=True)
        if np.isfinite(long)
    }


def place_bar(bar: Bar | None, region: Region, marks: Sequence[Mark], unit: float) -> Bar | None:
    """Place the bar at the left end of the lower edge, or at the right one if it hides less there.

    Parameters
    ----------
    bar
        Bar to place, if there is one.
    region
        Part of the photo.
    marks
        Marks that it should not hide.
    unit
        Pixels of the photo for one unit of a drawing.
    """
    if bar is None:
        return None
    width = max(bar.length + 12 * unit, 48 * unit)
    low = region.top_px + region.height_px - 36 * unit
    sides = (region.left_px + 4 * unit, region.left_px + region.width_px - width - 4 * unit)
    hidden = [
        sum(m.y > low and x - 8 * unit < m.x < x + width + 8 * unit for m in marks) for x in sides
    ]
    return bar._replace(left=sides[hidden[1] < hidden[0]], width=width)


def _around(result: Result, region: Region) -> tuple[str, ...]:
    """Return the labels at whose centre a scale bar is valid."""
    if region.subject == "point":
        return (result.points.label[region.row],)
    return result.measurements.outlines[region.row]
