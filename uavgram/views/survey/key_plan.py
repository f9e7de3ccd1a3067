"""Key plan: camera positions and footprints of the photos, from above."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import footprints, shown_poses
from uavgram.views.survey.sheet import WIDTH, GridLine, Sheet, grid_lines, lay_sheet
from uavgram.views.survey.text_placement import (
    PlacedText,
    TextRequest,
    around_drawing,
    box,
    place_texts,
    svg_points,
)
from uavgram.views.units import round_bar, units_of

MAX_HEIGHT = 340.0
MAX_FOOTPRINTS = 40
"""Number of photos above which only the cameras are drawn."""
ROOM = 0.08
"""Margin around the drawing, as a share of its extent."""
REACH = 0.15
"""Reach of footprints that counts for the extent, as a share of that of cameras and points."""
MIN_PREFIX = 3
"""Least length of a common prefix that is omitted from the names of photos."""
ARROW = 30.0
"""Length of the arrow of a level view; steeper views have shorter ones."""
MIN_ARROW = 5.0
"""Least length of an arrow; a camera that looks down more steeply has none."""
HEAD = 4.5
HALF_CAMERA, HALF_DOT = 4.5, 2.0
"""Half sizes of the areas around marks without texts."""


@dataclass(frozen=True)
class Camera:
    """Camera: its place, its arrow as SVG points and head, and whether it was adjusted.

    `arrow` and `head` are empty if it looks down.
    """

    x: float
    y: float
    arrow: str
    head: str
    adjusted: bool


@dataclass(frozen=True)
class KeyPlan:
    """Content of the drawing for the template.

    Attributes
    ----------
    width, height
        Size of the drawing.
    footprints
        SVG points of the footprint of each adjusted photo.
    cameras, dots
        Photos, and points on the ground.
    texts
        Names of photos and of points, without overlaps.
    prefix
        Common prefix of the names of all photos, which is omitted from the texts.
    unnamed
        Number of photos and points without a name for lack of room.
    grid, bar, bar_text, north_known
        As in the top view.
    """

    width: float
    height: float
    footprints: tuple[str, ...]
    cameras: tuple[Camera, ...]
    dots: tuple[tuple[float, float], ...]
    texts: tuple[PlacedText, ...]
    prefix: str
    unnamed: int
    grid: tuple[GridLine, ...]
    bar: float
    bar_text: str
    north_known: bool


def key_plan(result: Result) -> KeyPlan | None:
    """Lay out the drawing; return None if no photo has a pose."""
    rows, poses = shown_poses(result)
    if not len(rows):
        return None
    adjusted = result.has_refined[rows]
    rings = footprints(result) if int(adjusted.sum()) <= MAX_FOOTPRINTS else {}
    rings = {frame: ring for frame, ring in rings.items() if result.has_refined[frame]}
    centers, points = poses.center_world_m, result.points.position_world_m
    sheet = lay_sheet(*_extent(np.concatenate([centers[:, :2], points[:, :2]]), rings), MAX_HEIGHT)
    cameras = tuple(_cameras(sheet, centers, poses.world_from_camera[:, :, 2], adjusted))
    names = tuple(result.frames.frame_id[row].rpartition(".")[0] for row in rows)
    prefix = _common_prefix(names)
    units = units_of(result)
    bar_m, bar_text = round_bar(WIDTH / sheet.scale / 6, units)
    grid = tuple(grid_lines(sheet, units))
    taken = around_drawing(sheet, grid, bar_m * sheet.scale)
    short = tuple(name[len(prefix) :] for name in names)
    texts, unnamed = _texts(result, sheet, short, cameras, taken)
    return KeyPlan(
        width=WIDTH,
        height=sheet.height,
        footprints=tuple(svg_points(sheet(ring)) for ring in rings.values()),
        cameras=cameras,
        dots=tuple((float(x), float(y)) for x, y in sheet(points)),
        texts=texts,
        prefix=prefix,
        unnamed=unnamed,
        grid=grid,
        bar=bar_m * sheet.scale,
        bar_text=bar_text,
        north_known=result.world.gauge == "world",
    )


def _extent(places: Floats, rings: dict[int, Floats]) -> tuple[Floats, Floats]:
    """Return the corners (2,) of the drawn ground, limiting the footprints of oblique photos."""
    low, high = places.min(axis=0), places.max(axis=0)
    reach = REACH * max(float((high - low).max()), 1.0)
    if rings:
        shown = np.concatenate(list(rings.values()))[:, :2]
        low = np.minimum(low, np.maximum(shown.min(axis=0), low - reach))
        high = np.maximum(high, np.minimum(shown.max(axis=0), high + reach))
    room = ROOM * max(float((high - low).max()), 1.0)
    return low - room, high + room


def _cameras(sheet: Sheet, centers: Floats, forward: Floats, adjusted: Bools) -> Iterator[Camera]:
    """Draw the cameras; arrows are the level part of the unit vector along the optical axis."""
    for (x, y), axis, is_adjusted in zip(sheet(centers), forward, adjusted, strict=True):
        along = ARROW * axis[:2] * [1.0, -1.0]
        length, arrow, head = float(np.linalg.norm(along)), "", ""
        if length > MIN_ARROW:
            tip = np.array([x, y]) + along
            unit = along / length
            across = np.array([-unit[1], unit[0]])
            arrow = svg_points(np.stack([np.array([x, y]), tip]))
            head = svg_points(
                np.stack([tip + HEAD * unit, tip + HEAD * across / 2, tip - HEAD * across / 2])
            )
        yield Camera(float(x), float(y), arrow, head, bool(is_adjusted))


def _texts(
    result: Result,
    sheet: Sheet,
    names: tuple[str, ...],
    cameras: tuple[Camera, ...],
    taken: list[Floats],
) -> tuple[tuple[PlacedText, ...], int]:
    """Place the names of photos and of points; return also the number without room."""
    dots = sheet(result.points.position_world_m)
    wanted = [
        TextRequest(name, "photo", np.array([[one.x, one.y]]))
        for name, one in zip(names, cameras, strict=True)
    ]
    wanted += [
        TextRequest(label, "label", dot[None])
        for label, dot in zip(result.points.label, dots, strict=True)
    ]
    marks = [box((one.x, one.y), HALF_CAMERA, HALF_CAMERA) for one in cameras]
    marks += [box(dot, HALF_DOT, HALF_DOT) for dot in dots]
    return place_texts(wanted, sheet.corners, [*taken, *marks])


def _common_prefix(names: tuple[str, ...]) -> str:
    """Return the common prefix of all names; empty if it is short, or is a complete name."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    prefix = "".join(letters[0] for letters in alike)
    short = len(prefix) < MIN_PREFIX or len(names) == 1
    return "" if short or prefix in names else prefix
