"""Key plan: camera positions and footprints of the photos, from above."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import footprints, shown_poses
from uavgram.views.style import INK
from uavgram.views.survey.drawing import Drawing, Look
from uavgram.views.survey.sheet import WIDTH, draw_frame, lay_sheet
from uavgram.views.survey.text_placement import TextRequest, box
from uavgram.views.units import units_of

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
CAMERA = 3.5
"""Half size of the sign of a camera."""
USED, UNUSED = "#0b4f8a", "#9aa3ad"
FOOTPRINT = Look("#4096ff", 0.6, fill="#4096ff", opacity=0.6, fill_opacity=0.05)
HALF_CAMERA, HALF_DOT = 4.5, 2.0
"""Half sizes of the areas around marks without texts."""


@dataclass(frozen=True)
class KeyPlan:
    """Drawing, and what its legend needs.

    Attributes
    ----------
    drawing
        The drawing.
    prefix
        Common prefix of the names of all photos, which is omitted from the texts.
    has_unused
        Whether cameras of unused photos are shown.
    """

    drawing: Drawing
    prefix: str
    has_unused: bool


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
    names = tuple(result.frames.frame_id[row].rpartition(".")[0] for row in rows)
    prefix = _common_prefix(names)
    drawing = Drawing("Key plan of cameras and points, to scale", WIDTH, sheet.height)
    draw_frame(
        drawing, sheet, WIDTH / sheet.scale / 6, units_of(result),
        is_north_known=result.world.gauge == "world",
    )  # fmt: skip
    for ring in rings.values():  # one by one: the ground of several photos is darker
        drawing.lines("footprints", [sheet(ring)], FOOTPRINT, closed=True)
    dots, cameras = sheet(points), sheet(centers)
    drawing.signs("points", dots, 1.8, Look(fill=INK["point"]))
    for is_used, colour in ((True, USED), (False, UNUSED)):
        own = adjusted == is_used
        _draw_cameras(drawing, cameras[own], poses.world_from_camera[own, :, 2], colour)
    drawing.reserve([box(at, HALF_CAMERA, HALF_CAMERA) for at in cameras])
    drawing.reserve([box(at, HALF_DOT, HALF_DOT) for at in dots])
    drawing.place(
        [
            TextRequest(text, kind, at[None])
            for kind, texts, places in (
                ("photo", [name[len(prefix) :] for name in names], cameras),
                ("label", result.points.label, dots),
            )
            for text, at in zip(texts, places, strict=True)
        ]
    )
    return KeyPlan(drawing, prefix, not adjusted.all())


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


def _draw_cameras(drawing: Drawing, places: Floats, forward: Floats, colour: str) -> None:
    """Draw cameras with arrows: the level part of the unit vector along the optical axis."""
    along = ARROW * forward[:, :2] * [1.0, -1.0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    has_arrow = length[:, 0] > MIN_ARROW
    tips, unit = (places + along)[has_arrow], (along / np.maximum(length, 1e-9))[has_arrow]
    across = unit[:, ::-1] * [-1.0, 1.0]
    arrows = np.stack([places[has_arrow], tips], axis=1)
    heads = np.stack(
        [tips + HEAD * unit, tips + HEAD * across / 2, tips - HEAD * across / 2], axis=1
    )
    drawing.lines("arrows", arrows, Look(colour, 1.4))
    drawing.lines("heads", heads, Look(fill=colour), closed=True)
    drawing.signs("cameras", places, CAMERA, Look(fill=colour), sign="square")


def _common_prefix(names: tuple[str, ...]) -> str:
    """Return the common prefix of all names; empty if it is short, or is a complete name."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    prefix = "".join(letters[0] for letters in alike)
    short = len(prefix) < MIN_PREFIX or len(names) == 1
    return "" if short or prefix in names else prefix
