"""Drawing on a page: images, named shapes and texts as data, and its SVG.

Styles are written at each path and text: some readers, of PDF above all, ignore style sheets inside
drawings. Shapes of one look are one path, as drawing programs set the style again for each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple
from zlib import crc32

import numpy as np
from markupsafe import escape

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.views.survey.text_placement import (
    ASIDE,
    BASELINE,
    LETTERS,
    MIN_SIZE,
    REACH,
    Letters,
    PlacedText,
    TextRequest,
    half_size,
    place_texts,
    svg_points,
)

BLACK, PAPER = "#1b1f24", "#ffffff"
FONTS = "Arial, Liberation Sans, Helvetica, system-ui, sans-serif"
HATCH = "url(#hatch)"
"""Fill of diagonal lines."""

_PATTERN = (
    '<defs><pattern id="hatch" patternUnits="userSpaceOnUse" width="11" height="11"><path '
    'd="M-2 13 L13 -2 M-2 2 L2 -2 M9 13 L13 9" stroke="#000" stroke-width="1.1"/></pattern></defs>'
)
_NORTH = np.array([[0.0, -26.0], [7.0, 8.0], [0.0, 2.0], [-7.0, 8.0]])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
COMPASS_ROOM = 90.0
"""Side of the square in the upper right corner that is free for the arrow to the north."""

PATCH = 0.8
"""Opacity of the paper below placed texts."""

Sign = Literal["ring", "square", "diamond", "cross"]
SIGNS: dict[Sign, tuple[Floats, ...]] = {
    "square": (np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]),),
    "diamond": (np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]),),
    "cross": (np.array([[-1.0, -1.0], [1.0, 1.0]]), np.array([[-1.0, 1.0], [1.0, -1.0]])),
}
"""Lines of each sign, in its half sizes; a ring is round."""


class Look(NamedTuple):
    """Style of shapes: stroke, its width and dashes, fill, and opacities."""

    stroke: str = "none"
    width: float = 1.0
    fill: str = "none"
    dashes: str = ""
    opacity: float = 1.0
    fill_opacity: float = 1.0


class Shapes(NamedTuple):
    """Shapes of one look.

    Attributes
    ----------
    name
        What they are.
    lines
        (n, 2) corners of each line or ring; (1, 2) the middle of each sign.
    looks
        Their style; of several, each is drawn over the one before.
    closed
        Whether the last corner of a line is joined to the first.
    clip
        (n, 2) ring; shapes are clipped to its inside.
    sign, radius
        Form of signs, and half their size.
    title, link
        Text under the pointer, and address that opens with a click.
    """

    name: str
    lines: tuple[Floats, ...]
    looks: tuple[Look, ...]
    closed: bool = False
    clip: Floats | None = None
    sign: Sign | None = None
    radius: float = 0.0
    title: str = ""
    link: str = ""

    @property
    def look(self) -> Look:
        """Style that is drawn last."""
        return self.looks[-1]

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """Return the lines to draw: those of signs around their middles, except rings."""
        if self.sign is None or self.sign == "ring":
            return self.lines
        return tuple(at + self.radius * line for at in self.lines for line in SIGNS[self.sign])


class Image(NamedTuple):
    """Picture: (2,) its upper left corner and its size; its address or pixels; its opacity."""

    place: Floats
    size: Floats
    data: str | Pixels
    opacity: float


class Drawing:
    """Sheet under construction; y goes down.

    Attributes
    ----------
    width, height, corner, unit, letters
        See below.
    low, high
        Corners (2,) of the part in which texts are placed, and that scale bar and arrow are in.
    images, shapes, signs_over, written, texts
        Content in the order in which it is drawn: pictures, shapes, shapes under texts, texts at
        fixed places, and texts placed without overlaps.
    missing
        Number of texts without room.
    bar, bar_text
        Length of the scale bar, in the drawing and in words.

    Parameters
    ----------
    label
        Description for readers who do not see it.
    width, height
        Size of the drawing.
    corner
        Its upper left corner.
    unit
        Factor on the sizes of letters, signs and lines.
    letters
        Style of each kind of text.
    kind
        Class of the SVG in style sheets.
    frame
        Corners (2,) of the part for texts about things shown; by default the whole drawing.
    """

    def __init__(
        self,
        label: str,
        width: float,
        height: float,
        *,
        corner: Floats | tuple[float, float] = (0.0, 0.0),
        unit: float = 1.0,
        letters: Mapping[str, Letters] = LETTERS,
        kind: str = "drawing",
        frame: tuple[Floats, Floats] | None = None,
    ) -> None:
        self.width, self.height, self.unit, self.letters = width, height, unit, letters
        self.corner = np.array(corner, np.float64)
        self.low: Floats = self.corner if frame is None else frame[0]
        self.high: Floats = self.corner + np.array([width, height]) if frame is None else frame[1]
        self.images: list[Image] = []
        self.shapes: list[Shapes] = []
        self.signs_over: list[Shapes] = []
        self.written: list[PlacedText] = []
        self.texts: tuple[PlacedText, ...] = ()
        self.missing = 0
        self.bar, self.bar_text = 0.0, ""
        self._label, self._kind = label, kind
        self._taken: list[Floats] = []

    def __html__(self) -> str:
        """Return the SVG."""
        return "\n".join(_svg(self, self._label, self._kind))

    @property
    def border(self) -> Floats:
        """Ring (4, 2) around the part in which texts are placed."""
        (left, top), (right, bottom) = self.low, self.high
        return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])

    def find_shapes(self, name: str) -> list[Floats]:
        """Return the lines, rings and middles of signs of a name."""
        return [line for one in self.shapes if one.name == name for line in one.lines]

    def reserve(self, boxes: Floats | Sequence[Floats]) -> None:
        """Keep (n, 5) rectangles free of texts, see `place_texts`."""
        self._taken += list(np.reshape(boxes, (-1, 5)))

    def lines(
        self,
        name: str,
        lines: Iterable[Floats],
        *looks: Look,
        closed: bool = False,
        clip: Floats | None = None,
    ) -> None:
        """Draw polylines or rings.

        Parameters
        ----------
        name, lines, *looks, closed, clip
            See `Shapes`.
        """
        if several := tuple(lines):
            self.shapes.append(Shapes(name, several, looks, closed, clip))

    def lines_by_look(
        self, name: str, pairs: Iterable[tuple[Floats, Look]], clip: Floats | None = None
    ) -> None:
        """Draw polylines, those of one look together.

        Parameters
        ----------
        name, clip
            See `Shapes`.
        pairs
            (n, 2) corners of each, and its style.
        """
        alike: dict[Look, list[Floats]] = {}
        for line, look in pairs:
            alike.setdefault(look, []).append(line)
        for look, lines in alike.items():
            self.lines(name, lines, look, clip=clip)

    def signs(
        self,
        name: str,
        places: Floats,
        radius: float,
        *looks: Look,
        sign: Sign = "ring",
        title: str = "",
        link: str = "",
    ) -> None:
        """Draw signs.

        Parameters
        ----------
        name, *looks, sign, title, link
            See `Shapes`.
        places
            (n, 2) their middles.
        radius
            Half their size, in units of the letters.
        """
        if len(places):
            middles, half = tuple(places[:, None]), self.unit * radius
            own = Shapes(name, middles, looks, sign=sign, radius=half, title=title, link=link)
            self.shapes.append(own)

    def image(self, place: Floats, size: Floats, data: str | Pixels, opacity: float = 1.0) -> None:
        """Show a picture.

        Parameters
        ----------
        place, size, data, opacity
            See `Image`; an address is not escaped.
        """
        self.images.append(Image(place, size, data, opacity))

    def write(
        self,
        place: Sequence[float] | Floats,
        text: str,
        kind: str = "scale",
        *,
        side: int = 0,
        colour: str = "",
        patch: float = 0.0,
        size: float = 1.0,
    ) -> None:
        """Write a text, which is not moved; later texts are placed elsewhere.

        Parameters
        ----------
        place
            (2,) the middle of its baseline.
        text, kind
            Text, and kind of its letters.
        side
            -1: it begins at its place, 1: it ends there.
        colour
            Colour, by default that of its kind.
        patch
            Opacity of the paper below it.
        size
            Size of its letters, as a share of the usual.
        """
        look, (x, y) = self.letters[kind], place
        half = self.unit * size * half_size(text, look)
        middle = float(x - side * (half[0] - ASIDE * self.unit * size))
        self.written.append(
            PlacedText(
                *(middle, float(y), text, kind, size, float(half[0]), float(half[1])),
                colour=colour,
                side=side,
            )
        )
        box = np.array([middle, y - half[1] / 2, *half, 0.0])
        self.reserve(box)
        self._patch([box], patch)

    def _patch(self, boxes: Sequence[Floats], opacity: float) -> None:
        """Draw rectangles (5,) of paper, on which texts are legible."""
        if opacity:
            rings = [_rectangle(box) for box in boxes]
            self._over("patches", rings, Look(fill=PAPER, fill_opacity=opacity), closed=True)

    def _over(self, name: str, lines: Iterable[Floats], *looks: Look, closed: bool = False) -> None:
        if several := tuple(lines):
            self.signs_over.append(Shapes(name, several, looks, closed))

    def place(
        self, wanted: Sequence[TextRequest], reach: float = REACH, least: float = MIN_SIZE
    ) -> None:
        """Write texts without overlaps on patches, with lines to their objects.

        Parameters
        ----------
        wanted, reach, least
            See `place_texts`.
        """
        self.texts, self.missing = place_texts(
            wanted, (self.low, self.high), self._taken, self.unit, self.letters, reach, least
        )
        leaders = [one.leader for one in self.texts if one.leader is not None]
        looks = Look(PAPER, 1.8, opacity=PATCH), Look(BLACK, 0.6, opacity=PATCH)
        self._over("leaders", leaders, *looks)
        boxes = []
        for one in self.texts:
            height = one.size * self.unit * self.letters[one.kind].size
            above = BASELINE * height * np.array([math.sin(one.turn), -math.cos(one.turn)])
            middle = above + np.array([one.x, one.y])
            boxes.append(np.array([*middle, one.half_width, 0.55 * height, one.turn]))
        self._patch(boxes, PATCH)

    def scale_bar(
        self, left: float, base: float, length: float, text: str, patch: float = 0.0
    ) -> None:
        """Draw a scale bar with its length below it.

        Parameters
        ----------
        left, base
            Its left end.
        length, text
            Its length in the drawing and in words.
        patch
            Opacity of the paper below it.
        """
        self.bar, self.bar_text = length, text
        u = self.unit
        half = max(length / 2 + 10 * u, u * half_size(text, self.letters["scale"])[0])
        x, y = left + length / 2, base + 5.0 * u
        self.reserve(np.array([x, y, half, 22.0 * u, 0.0]))
        self._patch([np.array([x, y - u, half, 15.0 * u, 0.0])], patch)
        bar = np.array([[left, base - 5.0 * u], [left, base], [left, base], [left, base - 5.0 * u]])
        bar[2:, 0] += length
        self._over("bar", [bar], Look(BLACK, 2.0))
        self.write((x, base + 14 * u), text)

    def compass(self, text: str = "N", patch: float = 0.0) -> None:
        """Draw an arrow to the north in the upper right corner, on paper of an opacity."""
        u, (right, top) = self.unit, (self.high[0], self.low[1])
        half = COMPASS_ROOM * u / 2
        self.reserve(np.array([right - half, top + half, half, half, 0.0]))
        wide, from_right = (16.0, 30.0) if len(text) == 1 else (42.0, 44.0)
        at = np.array([right - from_right * u, top + 44.0 * u])
        self._patch([np.array([at[0], at[1] - u, wide * u, 31.0 * u, 0.0])], patch)
        self._over("north", [at + u * _NORTH], Look(fill=BLACK), closed=True)
        self.write(at + np.array([0.0, 24.0 * u]), text)


def _rectangle(box: Floats) -> Floats:
    """Return the corners (4, 2) of a rectangle (5,)."""
    cos, sin = math.cos(box[4]), math.sin(box[4])
    return np.asarray(box[:2] + _CORNERS * box[2:4] @ np.array([[cos, sin], [-sin, cos]]))


def _svg(drawing: Drawing, label: str, kind: str) -> Iterator[str]:
    """Yield the SVG of a drawing: all pictures and shapes, then all texts."""
    size = (*drawing.corner.tolist(), drawing.width, drawing.height)
    view = " ".join(f"{round(part, 1):.10g}" for part in size)
    yield (
        f'<svg class="{kind}" viewBox="{view}" role="img" aria-label="{escape(label)}" '
        f'font-family="{FONTS}" text-anchor="middle">'
    )
    for image in drawing.images:
        (x, y), (width, height) = (np.round(part, 2).tolist() for part in (image.place, image.size))
        yield (
            f'<image x="{x:.10g}" y="{y:.10g}" width="{width:.10g}" height="{height:.10g}" '
            f'preserveAspectRatio="none" opacity="{image.opacity:g}" href="{image.data}"/>'
        )
    every = [*drawing.shapes, *drawing.signs_over]
    if any(look.fill == HATCH for one in every for look in one.looks):
        yield _PATTERN
    clips = {_clip_key(one.clip): one.clip for one in every if one.clip is not None}
    for key, ring in clips.items():
        yield f'<clipPath id="{key}"><path d="M{svg_points(ring)}Z"/></clipPath>'
    for one in every:
        yield from _svg_shapes(one, drawing.unit)
    for text in (*drawing.written, *drawing.texts):
        yield _svg_text(drawing, text)
    yield "</svg>"


def _clip_key(ring: Floats) -> str:
    return f"clip-{crc32(svg_points(ring).encode()):x}"


def _svg_shapes(shapes: Shapes, unit: float) -> Iterator[str]:
    if shapes.sign == "ring":
        r = shapes.radius
        spots = (middle[0].tolist() for middle in shapes.lines)
        path = "".join(f"M{x - r:.2f} {y:.2f}{_ring(r)}" for x, y in spots)
    else:
        end = "Z" if shapes.closed else ""
        path = "".join(f"M{svg_points(line)}{end}" for line in shapes.outlines)
    if shapes.clip is not None:
        yield f'<g clip-path="url(#{_clip_key(shapes.clip)})">'
    if shapes.link:
        yield f'<a href="{escape(shapes.link)}">'
    if shapes.title:
        yield f"<g><title>{escape(shapes.title)}</title>"
    for look in shapes.looks:
        yield _svg_path(path, look, unit)
    yield "</g>" * (shapes.title != "") + "</a>" * (shapes.link != "")
    yield "</g>" * (shapes.clip is not None)


def _svg_path(path: str, look: Look, unit: float) -> str:
    attributes = [f'd="{path}"', f'fill="{look.fill}"']
    if look.fill_opacity != 1.0:
        attributes.append(f'fill-opacity="{look.fill_opacity:g}"')
    if look.stroke != "none":
        attributes += [f'stroke="{look.stroke}"', f'stroke-width="{round(look.width * unit, 2):g}"']
        if look.opacity != 1.0:
            attributes.append(f'stroke-opacity="{look.opacity:g}"')
        if look.dashes:
            dashes = (f"{float(one) * unit:.4g}" for one in look.dashes.split())
            attributes.append(f'stroke-dasharray="{" ".join(dashes)}"')
    return f"<path {' '.join(attributes)}/>"


def _svg_text(drawing: Drawing, text: PlacedText) -> str:
    """Write a text with the width of its box, whatever the font of the reader."""
    look, unit = drawing.letters[text.kind], drawing.unit * text.size
    weight = ' font-weight="bold"' if look.is_bold else ""
    style = "" if look.style == "normal" else f' font-style="{look.style}"'
    turn = f' transform="rotate({math.degrees(text.turn):.2f} {text.x:.1f} {text.y:.1f})"'
    return (
        f'<text x="{text.x:.1f}" y="{text.y:.1f}" class="{text.kind}" '
        f'textLength="{2 * (text.half_width - ASIDE * unit):.1f}" lengthAdjust="spacingAndGlyphs" '
        f'font-size="{round(look.size * unit, 2):g}"{weight}{style}'
        f'{turn if text.turn else ""} fill="{text.colour or look.colour}">'
        f"{escape(text.text)}</text>"
    )


@lru_cache(64)
def _ring(r: float) -> str:
    """Return four curves that differ from a circle by 0.03 % of its radius.

    With arcs some readers take thrice as long. Hundreds of rings of a page have the same size.
    """
    k = round(0.5523 * r, 2)
    q = round(r - k, 2)
    r = round(r, 2)
    return (
        f"c0 {-k} {q} {-r} {r} {-r} {k} 0 {r} {q} {r} {r} "
        f"0 {k} {-q} {r} {-r} {r} {-k} 0 {-r} {-q} {-r} {-r}Z"
    )
