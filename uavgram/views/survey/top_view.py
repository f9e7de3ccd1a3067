"""Top views of a survey: the scaled one of the report, and the key plan of the photos."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import GroundPicture, Result
from uavgram.stages.products.map_layers import (
    ENCLOSED,
    ellipse_outlines,
    footprints,
    ground_lines,
    measured_strips,
    position_strips,
    reference_strips,
    select_shown_poses,
)
from uavgram.stages.products.text_places import Where
from uavgram.views.formatting import measurement_text, number, order_worst_first
from uavgram.views.style import INK, LOOKS, hex_colour
from uavgram.views.survey.drawing import PAPER, Drawing, Look, Sign
from uavgram.views.survey.heights import Departures, collect_departures
from uavgram.views.survey.outlines import nice_factor
from uavgram.views.survey.sheet import MAX_HEIGHT, WIDTH, Sheet, draw_frame, lay_sheet
from uavgram.views.survey.text_placement import TextRequest, box, half_size
from uavgram.views.units import INCH_M, format_reading, format_value, units_of

ELLIPSE_SHARE, FILL_SHARE = 0.03, 0.05
MAX_ROOM = 0.3
# Half size of the area around a point without text.
HALF_DOT = 2.5
# Half the diagonal of the mark of a point off the ground.
DIAMOND = 5.0
# Departures from the plane are shown to millimetres if their sigma is below this.
WELL_KNOWN_M = 0.01
# With more lines than this they are thin, and only some of the measured ones are named.
MANY_LINES, MAX_MEASURED = 20, 12
# With more points than this only those of a measurement, a known length or a check are shown.
MANY_POINTS = 60
BOLD, FINE, THIN = 2.0, 1.0, 0.5
WIDTHS = {
    "measured_areas": (BOLD, THIN),
    "measured_lines": (BOLD, THIN),
    "known_lengths": (BOLD, FINE),
    "control_lines": (FINE, FINE),
}
"""Widths of the lines of each layer if they are few, and if they are many."""
DASHES = "7 4"
# Gap between a line and its name; half length of the line in the middle of an area for its name.
LINE_GAP, IN_MIDDLE = 2.0, 0.05
DOUBT_MARK = " ?"
"""Mark after a value that is doubtful, or differs in another solution that fits as well."""


class Sample(NamedTuple):
    """Entry of a legend: what it means, and how the line or the sign is drawn.

    Attributes
    ----------
    text
        Its meaning.
    look
        Style of the line, or of the sign.
    sign, radius
        Form of the sign, and half its size; None: a line.
    """

    text: str
    look: Look
    sign: Sign | None = None
    radius: float = 0.0

    def draw(self, drawing: Drawing, left: float, right: float, y: float) -> None:
        """Draw it from left to right at a height, a sign in the middle.

        Parameters
        ----------
        drawing
            The drawing.
        left, right, y
            Where to draw.
        """
        if self.sign is None:
            drawing.lines("samples", [np.array([[left, y], [right, y]])], self.look)
        else:
            at = np.array([[(left + right) / 2, y]])
            drawing.signs("samples", at, self.radius, self.look, sign=self.sign)

    def __html__(self) -> str:
        """Return the sample alone, as SVG."""
        drawing = Drawing(self.text, 26.0, 12.0, kind="sample")
        self.draw(drawing, 0.0, 26.0, 6.0)
        return drawing.__html__()


STATUS_TEXTS = {
    "used": "known length, used",
    "checked": "known length, withheld as a check",
    "suspect": "known length that does not fit",
    "removed": "known length that does not fit",
    "unseen": "known length, not seen",
}


def list_samples(result: Result, drawing: Drawing | None = None) -> list[Sample]:
    """Return the legend of a survey: the lines and signs that occur.

    Parameters
    ----------
    result
        The survey.
    drawing
        If given, the first text states how many of its measurements are named.
    """
    named = total = len(measured_strips(result))
    if drawing is not None:
        named = sum(text.kind == "measured" for text in drawing.texts)
    most = f" (of {total}, the {named} least certain for their size are named)"
    looks = {"measured" + most * (named < total): line_look("measured_lines", "ok")}
    for status in result.lines.status:
        looks.setdefault(STATUS_TEXTS[status], line_look("known_lengths", status))
    if result.control_lines.name:
        looks["line of known position"] = line_look("control_lines", "used")
    samples = [Sample(text, look) for text, look in looks.items()]
    samples.append(Sample("point", Look(fill=INK["point"]), "ring", 2.2))
    if result.points.is_off_ground.any():
        samples.append(
            Sample("a point off the ground", Look(INK["point"], 1.1), "diamond", DIAMOND)
        )
    return samples


@dataclass(frozen=True)
class TopView:
    """Drawing, and what its legend needs.

    Attributes
    ----------
    drawing
        The drawing.
    sheet
        Mapping from the world to it.
    full_m
        Departure from the plane from which on colours are full; 0 if there is none.
    legend
        Samples of its lines and signs.
    has_off_ground
        Whether points are marked that are off the ground.
    ellipse_factor, fill_ellipses
        Exaggeration of the ellipses within the survey; whether they are small enough to be filled.
    small_unit
        Unit of the numbers under points off their plane, in words.
    """

    drawing: Drawing
    sheet: Sheet
    full_m: float
    legend: tuple[Sample, ...]
    has_off_ground: bool
    ellipse_factor: int
    fill_ellipses: bool
    small_unit: str

    @property
    def has_doubt(self) -> bool:
        """Return whether it has a value that is doubtful."""
        return any(text.text.endswith(DOUBT_MARK) for text in self.drawing.texts)


class Layout(NamedTuple):
    """Scale and position of the drawing.

    Attributes
    ----------
    sheet
        Mapping from the world to it.
    extent_m
        Extent of the points, the larger one of east and north.
    ellipse_factor, ellipse_m
        Exaggeration of the ellipses within the survey, and half the length of the median one.
    """

    sheet: Sheet
    extent_m: float
    ellipse_factor: int
    ellipse_m: float


def list_used_labels(result: Result, measured: Iterable[int] | None = None) -> frozenset[str]:
    """Return the labels of the points used by a measurement, a known quantity or a check.

    Parameters
    ----------
    result
        The survey.
    measured
        Rows of the measurements that count; by default all.
    """
    lines, checks, points = result.lines, result.point_checks.label, result.measurements.points
    rows = range(len(points)) if measured is None else measured
    groups = (*(points[row] for row in rows), *result.known.points)
    return frozenset((*lines.start, *lines.end, *checks)).union(*groups)


def mark_used_points(result: Result) -> Bools:
    """Mark the (K,) points of `list_used_labels`; all points if there are none."""
    used = list_used_labels(result)
    found = np.array([label in used for label in result.points.label], np.bool_)
    return found if found.any() else np.ones_like(found)


def fit_layout(
    result: Result, most_height: float = MAX_HEIGHT, shown: Bools | None = None
) -> Layout | None:
    """Fit the points into a drawing; return None if there are none.

    Parameters
    ----------
    result
        Result of the run.
    most_height
        Largest height of the drawing.
    shown
        (K,) the points that it has to show; by default all.
    """
    position = result.points.position_world_m
    if not len(position):
        return None
    rows = slice(None) if shown is None else shown
    low, high = position[rows, :2].min(axis=0), position[rows, :2].max(axis=0)
    extent_m = max(float((high - low).max()), 1.0)
    major = result.points.relative.ellipse_95_m[rows, 0]
    usual = float(np.median(major))
    factor = nice_factor(usual, ELLIPSE_SHARE * extent_m)
    # room for the ellipses too, unless they would leave none for the points
    room = min(factor * float(major.max()), MAX_ROOM * extent_m)
    return Layout(lay_sheet(low - room, high + room, most_height), extent_m, factor, usual)


def top_view(
    result: Result,
    most_height: float = MAX_HEIGHT,
    shown: Bools | None = None,
    ground: GroundPicture | None = None,
    address: str = "",
    unit: float = 1.0,
) -> TopView | None:
    """Lay out the drawing; return None if there is no point to draw.

    Ellipses are drawn only without a picture of the ground: they would hide it.

    Parameters
    ----------
    result, most_height, shown
        See `fit_layout`; with `shown` there are no heights, and other points have names only where
        there is room, and of many points only these have dots.
    ground, address
        Picture of the ground below the drawing, and its address.
    unit
        Factor on the sizes of letters, signs and lines.
    """
    layout = fit_layout(result, most_height, shown)
    if layout is None:
        return None
    sheet, extent_m, factor, usual = layout
    units, is_bare = units_of(result), ground is None
    fill_ellipses = factor * usual <= FILL_SHARE * extent_m
    uneven = collect_departures(result) if shown is None else None
    drawing = Drawing("Top view of points and lines, to scale", WIDTH, sheet.height, unit=unit)
    if ground is not None:
        corner = sheet(np.array([ground.west_m, ground.north_m]))
        drawing.image(corner, np.array([ground.width_m, ground.height_m]) * sheet.scale, address)
    draw_frame(
        drawing, sheet, extent_m / 5, units,
        is_north_known=result.world.gauge == "world", on_picture=not is_bare,
    )  # fmt: skip
    if is_bare:
        ink = INK["ellipse"]
        look = Look(ink, 1.0, fill=ink, fill_opacity=0.15) if fill_ellipses else Look(ink, 0.6)
        drawing.lines("ellipses", _ellipses(result, sheet, factor), look)
    dotted = None if shown is None or len(shown) <= MANY_POINTS else shown
    off_ground = draw_survey(drawing, sheet, result, dotted, on_picture=not is_bare)
    texts = survey_texts(drawing, sheet, result, shown)
    if shown is None:
        spots = sheet(result.points.position_world_m)
        texts += _over_ground(result, spots)
        if uneven:
            for spot, colour in zip(spots[uneven.rows], uneven.colours, strict=True):
                look = Look(INK["point"], 0.7, fill=hex_colour(colour))
                drawing.signs("off_plane", spot[None], 4.5, look)
            texts += _off_their_plane(result, spots, uneven)
    drawing.place(texts)
    return TopView(
        drawing=drawing,
        sheet=sheet,
        full_m=uneven.full_m if uneven else 0.0,
        legend=tuple(list_samples(result, drawing)),
        has_off_ground=off_ground,
        ellipse_factor=factor,
        fill_ellipses=fill_ellipses,
        small_unit="centimetres" if units.length == "m" else "inches",
    )


def draw_survey(
    drawing: Drawing, sheet: Sheet, result: Result, shown: Bools | None, *, on_picture: bool
) -> bool:
    """Draw areas, lines and points within the drawing's frame.

    Parameters
    ----------
    drawing, sheet
        The drawing, and its place in the world.
    result
        The survey.
    shown
        (K,) the points with dots; by default all.
    on_picture
        Whether it has a picture of the ground: lines are then on wider, paler ones.

    Returns
    -------
    Whether a point off the ground is among those shown.
    """
    frame, area = drawing.border, LOOKS["measured_areas"]
    rings = [sheet(one.strip) for one in ground_lines(result) if one.layer == "measured_areas"]
    fill = Look(fill=area.colour, fill_opacity=area.filled)
    drawing.lines("areas", rings, fill, closed=True, clip=frame)
    lines = _lines(result, sheet)
    if on_picture:
        casings = [(line, Look(PAPER, look.width + 1.6, opacity=0.75)) for line, look in lines]
        drawing.lines_by_look("casings", casings, frame)
    drawing.lines_by_look("lines", lines, frame)
    edge = Look(PAPER, 0.8) if on_picture else Look(INK["point"])
    dots = sheet(result.points.position_world_m)
    rows = _is_inside(drawing, dots) & (True if shown is None else shown)
    dots, is_off = dots[rows], result.points.is_off_ground[rows]
    drawing.signs("points", dots, 2.2, edge._replace(fill=INK["point"]))
    drawing.signs("off_ground", dots[is_off], DIAMOND, Look(INK["point"], 1.1), sign="diamond")
    half = HALF_DOT * drawing.unit
    drawing.reserve([box(dot, half, half) for dot in dots])
    return bool(is_off.any())


def _is_inside(drawing: Drawing, places: Floats) -> Bools:
    return np.asarray(((places >= drawing.low) & (places <= drawing.high)).all(axis=1))


def _lines(result: Result, sheet: Sheet) -> list[tuple[Floats, Look]]:
    """Draw all lines; those of known position as they were stated."""
    lines = ground_lines(result)
    counts = Counter(line.layer for line in lines)
    return [
        (
            sheet(line.strip),
            line_look(line.layer, line.status, is_thin=counts[line.layer] > MANY_LINES),
        )
        for line in lines
    ]


def line_look(layer: str, status: str, *, is_thin: bool = False) -> Look:
    """Return the style of a line in the colours of maps: dashed if it is not used, bold if wrong.

    Parameters
    ----------
    layer, status
        Its layer and status.
    is_thin
        Whether there are many lines of that layer.
    """
    style, is_bad = LOOKS[layer], status in ("suspect", "removed")
    return Look(
        style.colour_of(status),
        BOLD if is_bad else WIDTHS[layer][is_thin],
        dashes=DASHES if status in style.by_status else "",
    )


def _ellipses(result: Result, sheet: Sheet, factor: int) -> list[Floats]:
    within = result.points.relative
    center = result.points.position_world_m[:, :2]
    outlines = ellipse_outlines(center, within.ellipse_95_m, within.ellipse_azimuth_rad, factor)
    return [sheet(outline) for outline in outlines]


def _heights(result: Result) -> dict[int, str]:
    """Return the height over the ground of each point off it, the highest first."""
    points, units = result.points, units_of(result)
    off, height = np.flatnonzero(points.is_off_ground), points.height_above_ground_m
    found = {}
    for k in off[np.argsort(-np.abs(height[off]), kind="stable")].tolist():
        sign = "+" if height[k] > 0 else ""
        text = format_value(float(height[k]), float(points.height_sigma_m[k]), "m", units)
        found[k] = sign + text
    return found


def _over_ground(result: Result, spots: Floats) -> Iterator[TextRequest]:
    """Yield heights of points over the ground, the highest first."""
    for k, text in _heights(result).items():
        yield TextRequest(text, "off_ground", spots[k : k + 1], is_needed=False)


def _off_their_plane(result: Result, spots: Floats, uneven: Departures) -> Iterator[TextRequest]:
    """Yield departures of points from their plane [cm or in], the farthest first."""
    small_m = 0.01 if units_of(result).length == "m" else INCH_M
    for k in np.argsort(-np.abs(uneven.value_m), kind="stable"):
        places = int(uneven.sigma_m[k] < WELL_KNOWN_M)
        text = number(float(uneven.value_m[k]) / small_m, places, signed=True)
        yield TextRequest(text, "off_plane", spots[uneven.rows[k]][None], is_needed=False)


def is_doubtful(result: Result) -> Bools:
    """Mark the (M,) measured values that have a question mark."""
    rows = result.measurements
    doubtful = [status in ("doubtful", "contradicted") for status in rows.status]
    return np.asarray(np.array(doubtful, np.bool_) | rows.is_ambiguous)


def count_unnamed(result: Result) -> int:
    """Return how many measured values, the most certain of many, need no name in a drawing."""
    count = len(measured_strips(result))
    return 0 if count <= MANY_LINES else count - MAX_MEASURED


def survey_texts(
    drawing: Drawing, sheet: Sheet, result: Result, named: Bools | None, *, is_full: bool = False
) -> list[TextRequest]:
    """Return names and values of all objects within the drawing's frame.

    Parameters
    ----------
    drawing, sheet
        The drawing, and its place in the world.
    result
        The survey.
    named
        (K,) the points that have names in any case, by default all; of these not the ends of
        measured lines that have no name. Others have one if there is room beside them, and if
        there are not many points.
    is_full
        Whether values have their sigmas and points their heights, and of many measured values all
        are named for which there is room, along their lines; otherwise only the least certain ones.
    """
    rows, units, measured = result.measurements, units_of(result), measured_strips(result)
    doubt, texts = is_doubtful(result), list[TextRequest | None]()
    where: Where = "along" if is_full else "near"
    shown = [int(i) for i in order_worst_first(rows) if int(i) in measured]
    needed = len(shown) - count_unnamed(result)
    for k, i in enumerate(shown if is_full else shown[:needed]):
        words = measurement_text(rows, i, units).value if is_full else ""
        words = words or format_value(
            float(rows.value[i]), float(rows.sigma[i]), rows.unit[i], units
        )
        text = f"{rows.name[i]}: {words}{DOUBT_MARK if doubt[i] else ''}"
        strip = sheet(measured[i])
        if rows.kind[i] in ENCLOSED:
            middle = strip[1:].mean(axis=0)
            if _is_inside(drawing, middle[None])[0]:
                spots = middle + IN_MIDDLE * drawing.unit * np.array([[-1.0, 0.0], [1.0, 0.0]])
                texts.append(TextRequest(text, "measured", spots, k < needed))
                continue
        ink = LOOKS["measured_lines"].colour
        texts.append(_along(drawing, strip, text, "measured", ink, where, is_needed=k < needed))
    for i, strip in reference_strips(result).items():
        length = format_reading(float(result.lines.length_m[i]), units)
        ink = LOOKS["known_lengths"].colour_of(result.lines.status[i])
        text = f"{result.lines.name[i]}: {length}"
        texts.append(_along(drawing, sheet(strip), text, "known", ink, where))
    for name, strip, status in zip(
        result.control_lines.name, position_strips(result), result.control_lines.status, strict=True
    ):
        ink = LOOKS["control_lines"].colour_of(status)
        texts.append(_along(drawing, sheet(strip), name, "known", ink, where))
    spots, heights = sheet(result.points.position_world_m), _heights(result) if is_full else {}
    needed_names = np.ones(len(spots), np.bool_) if named is None else named
    if named is not None and needed < len(shown):  # ends of lines without names have none either
        ends = list_used_labels(result, shown[:needed])
        needed_names = needed_names & np.array([one in ends for one in result.points.label])
    wanted = needed_names | (len(spots) <= MANY_POINTS)
    for row in np.flatnonzero(_is_inside(drawing, spots) & wanted).tolist():
        text = f"{result.points.label[row]} {heights.get(row, '')}".rstrip()
        texts.append(TextRequest(text, "name", spots[row : row + 1], bool(needed_names[row])))
    return [text for text in texts if text is not None]


def _along(
    drawing: Drawing,
    strip: Floats,
    text: str,
    kind: str,
    ink: str,
    where: Where,
    *,
    is_needed: bool = True,
) -> TextRequest | None:
    """Name a line along its longest visible part, or around its middle if that is too short."""
    parts = [clip_line(a, b, drawing.low, drawing.high) for a, b in pairwise(strip)]
    ends = [np.stack(part) for part in parts if part is not None]
    if not ends:
        return None
    spots = max(ends, key=lambda part: float(np.linalg.norm(part[1] - part[0])))
    half = drawing.unit * half_size(text, drawing.letters[kind])[0]
    is_long = float(np.linalg.norm(spots[1] - spots[0])) >= 2 * half
    spots = spots[np.lexsort(spots.T[::-1])]  # from left to right, as texts are read
    return TextRequest(
        text,
        kind,
        spots if is_long else spots.mean(axis=0)[None],
        is_needed,
        gap=LINE_GAP,
        where=where if is_long else "beside",
        colour=ink,
    )


def clip_line(
    start: Floats, end: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats] | None:
    """Clip a line to a rectangle (Liang and Barsky 1984); return None if it is outside.

    Parameters
    ----------
    start, end
        (2,) ends of the line.
    low, high
        (2,) corners of the rectangle.
    """
    # part of the line inside all four half planes, as an interval of its parameter
    way, enter, leave = end - start, 0.0, 1.0
    for axis in range(2):
        for edge, sign in ((low[axis], -1.0), (high[axis], 1.0)):
            speed, room = sign * way[axis], sign * (edge - start[axis])
            if speed == 0.0:
                if room < 0.0:
                    return None
            elif speed < 0.0:
                enter = max(enter, room / speed)
            else:
                leave = min(leave, room / speed)
    return None if enter >= leave else (start + enter * way, start + leave * way)


MAX_KEY_HEIGHT = 340.0
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
HALF_CAMERA, HALF_KEY_DOT = 4.5, 2.0
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
    rows, poses = select_shown_poses(result)
    if not len(rows):
        return None
    adjusted = result.has_refined[rows]
    rings = footprints(result) if int(adjusted.sum()) <= MAX_FOOTPRINTS else {}
    rings = {frame: ring for frame, ring in rings.items() if result.has_refined[frame]}
    centers, points = poses.center_world_m, result.points.position_world_m
    sheet = lay_sheet(
        *_extent(np.concatenate([centers[:, :2], points[:, :2]]), rings), MAX_KEY_HEIGHT
    )
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
    drawing.reserve([box(at, HALF_KEY_DOT, HALF_KEY_DOT) for at in dots])
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
