"""Drawing on a page: named shapes and texts, in the order in which they are drawn, and its SVG.

Styles are written at each path and text: some readers, of PDF above all, ignore style sheets inside
drawings. Shapes of one look are one path, as drawing programs set the style again for each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple
from zlib import crc32

import numpy as np
from markupsafe import escape

from uavgram.model.arrays import Floats
from uavgram.views.survey.text_placement import (
    LETTERS,
    REACH,
    Letters,
    PlacedText,
    TextRequest,
    half_size,
    place_texts,
    svg_points,
)

BLACK, PAPER = "#1b1f24", "#ffffff"
FONTS = "system-ui, Segoe UI, Arial, sans-serif"
HATCH = "url(#hatch)"
"""Fill of diagonal lines."""

_PATTERN = (
    '<defs><pattern id="hatch" patternUnits="userSpaceOnUse" width="11" height="11"><path '
    'd="M-2 13 L13 -2 M-2 2 L2 -2 M9 13 L13 9" stroke="#000" stroke-width="1.1"/></pattern></defs>'
)
_NORTH = np.array([[0.0, -26.0], [7.0, 8.0], [0.0, 2.0], [-7.0, 8.0]])
COMPASS_ROOM = 90.0
"""Side of the square in the upper right corner that is free for the arrow to the north."""

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
    """Shapes of one look: (n, 2) corners of each line or ring; (1, 2) the middle of each sign."""

    name: str
    lines: tuple[Floats, ...]
    look: Look


class Drawing:
    """Sheet under construction; y goes down.

    Attributes
    ----------
    width, height, unit
        See below.
    shapes
        Shapes in the order in which they are drawn.
    written
        Texts at fixed places.
    texts, missing
        Texts placed without overlaps, and the number of texts without room.
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
    ) -> None:
        self.width, self.height, self.unit = width, height, unit
        self.shapes: list[Shapes] = []
        self.written: list[PlacedText] = []
        self.texts: tuple[PlacedText, ...] = ()
        self.missing = 0
        self.bar, self.bar_text = 0.0, ""
        self._low = np.array(corner)
        self._letters, self._clips = letters, set[str]()
        self._taken: list[Floats] = []
        view = " ".join(f"{round(part, 1):.10g}" for part in (*corner, width, height))
        self._under = [
            f'<svg class="{kind}" viewBox="{view}" role="img" aria-label="{escape(label)}">'
        ]
        self._over: list[str] = []

    def __html__(self) -> str:
        """Return the SVG: all shapes, then all texts."""
        return "\n".join([*self._under, *self._over, "</svg>"])

    def named(self, name: str) -> list[Floats]:
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
        name
            What they are.
        lines
            (n, 2) corners of each.
        *looks
            Their style; of several, each is drawn over the one before.
        closed
            Whether the last corner is joined to the first.
        clip
            (n, 2) ring; shapes are clipped to its inside.
        """
        several = tuple(lines)
        end, around = "Z" if closed else "", ("", "")
        if clip is not None:
            border = f"M{svg_points(clip)}Z"
            key = f"clip-{crc32(border.encode()):x}"
            if key not in self._clips:
                self._clips.add(key)
                self._under.append(f'<clipPath id="{key}"><path d="{border}"/></clipPath>')
            around = f'<g clip-path="url(#{key})">', "</g>"
        path = "".join(f"M{svg_points(one)}{end}" for one in several)
        self._draw(name, several, path, looks, around)

    def lines_by_look(self, name: str, pairs: Iterable[tuple[Floats, Look]]) -> None:
        """Draw polylines, those of one look together."""
        alike: dict[Look, list[Floats]] = {}
        for line, look in pairs:
            alike.setdefault(look, []).append(line)
        for look, lines in alike.items():
            self.lines(name, lines, look)

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
        name
            What they are.
        places
            (n, 2) their middles.
        radius
            Half their size, in units of the letters.
        *looks
            Their style; of several, each is drawn over the one before.
        sign
            Their form.
        title, link
            Text under the pointer, and address that opens with a click.
        """
        r = self.unit * radius
        if sign == "ring":
            path = "".join(f"M{x - r:.2f} {y:.2f}{_ring(r)}" for x, y in places.tolist())
        else:
            lines = (at + r * line for at in places for line in SIGNS[sign])
            path = "".join(f"M{svg_points(line)}" for line in lines)
        before, after = "", ""
        if title:
            before, after = f"<g><title>{escape(title)}</title>", "</g>"
        if link:
            before, after = f'<a href="{escape(link)}">{before}', f"{after}</a>"
        self._draw(name, tuple(places[:, None]), path, looks, (before, after))

    def image(self, place: Floats, size: Floats, data: str, opacity: float = 1.0) -> None:
        """Show a picture.

        Parameters
        ----------
        place, size
            (2,) its upper left corner, and its size.
        data
            Its address, which is not escaped.
        opacity
            Its opacity.
        """
        (x, y), (width, height) = np.round(place, 2).tolist(), np.round(size, 2).tolist()
        self._under.append(
            f'<image x="{x:.10g}" y="{y:.10g}" width="{width:.10g}" height="{height:.10g}" '
            f'preserveAspectRatio="none" opacity="{opacity:g}" href="{data}"/>'
        )

    def write(
        self,
        place: Sequence[float] | Floats,
        text: str,
        kind: str = "scale",
        *,
        side: int = 0,
        colour: str = "",
        patch: float = 0.0,
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
        """
        look, (x, y) = self._letters[kind], place
        half_width, half_height = self.unit * half_size(text, look)
        box = np.array([x - side * half_width, y - half_height / 2, half_width, half_height, 0.0])
        size = half_width, half_height
        self.written.append(PlacedText(float(box[0]), float(y), text, kind, 1.0, *size))
        self.reserve(box)
        self.patches([box.tolist()], patch)
        self._write(x, y, text, kind, 1.0, side, colour)

    def _write(
        self, x: float, y: float, text: str, kind: str, share: float, side: int, colour: str = ""
    ) -> None:
        look = self._letters[kind]
        self._over.append(
            f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}" '
            f'text-anchor="{("middle", "end", "start")[side]}" font-family="{FONTS}" '
            f'font-size="{round(look.size * share * self.unit, 2):g}" '
            f'font-weight="{"bold" if look.is_bold else "normal"}" font-style="{look.style}" '
            f'fill="{colour or look.colour}">{escape(text)}</text>'
        )

    def patches(self, boxes: Sequence[Sequence[float]], opacity: float) -> None:
        """Draw rectangles (5,) of paper, on which texts are legible."""
        path = "".join(
            f"M{x - half_width:.1f} {y - half_height:.1f}h{2 * half_width:.1f}"
            f"v{2 * half_height:.1f}h{-2 * half_width:.1f}Z"
            for x, y, half_width, half_height, _ in boxes
        )
        self._path(self._over, path if opacity else "", Look(fill=PAPER, fill_opacity=opacity))

    def place(self, wanted: Sequence[TextRequest], reach: float = REACH) -> None:
        """Write texts without overlaps on patches, with lines to their objects: see `place_texts`.

        A line that comes from the side ends where letters begin, whatever their font; the patch has
        room for the widest.
        """
        bounds = self._low, self._low + np.array([self.width, self.height])
        self.texts, self.missing = place_texts(
            wanted, bounds, self._taken, self.unit, self._letters, reach
        )
        leaders = "".join(f"M{one.leader}" for one in self.texts if one.leader)
        for look in (Look(PAPER, 1.8, opacity=0.8), Look(BLACK, 0.6, opacity=0.8)):
            self._path(self._over, leaders, look)
        boxes = []
        for one in self.texts:
            height = one.size * self.unit * self._letters[one.kind].size
            boxes.append([one.x, one.y - 0.295 * height, one.half_width, 0.525 * height, 0.0])
        self.patches(boxes, 0.8)
        for one in self.texts:
            x = one.x + one.side * (one.half_width - one.size * self.unit)
            self._write(x, one.y, one.text, one.kind, one.size, one.side)

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
        half = max(
            length / 2 + 10 * self.unit, self.unit * half_size(text, self._letters["scale"])[0]
        )
        middle = np.array([left + length / 2, base + 5.0 * self.unit])
        box = np.array([*middle, half, 22.0 * self.unit, 0.0])
        self.reserve(box)
        self.patches([[middle[0], middle[1] - self.unit, half, 15.0 * self.unit, 0.0]], patch)
        tick = 5.0 * self.unit
        path = f"M{left:.1f} {base - tick:.1f}v{tick:.1f}h{length:.1f}v{-tick:.1f}"
        self._path(self._over, path, Look(BLACK, 2.0))
        self.write((float(middle[0]), base + 14 * self.unit), text)

    def compass(self, text: str = "N", patch: float = 0.0) -> None:
        """Draw an arrow to the north in the upper right corner, on paper of an opacity."""
        half = COMPASS_ROOM / 2
        self.reserve(np.array([self.width - half, half, half, half, 0.0]))
        wide, from_right = (16.0, 30.0) if len(text) == 1 else (42.0, 44.0)
        at = np.array([self.width - from_right, 44.0])
        self.patches([[at[0], at[1] - 1.0, wide, 31.0, 0.0]], patch)
        self._path(self._over, f"M{svg_points(at + _NORTH)}Z", Look(fill=BLACK))
        self.write(at + np.array([0.0, 24.0]), text)

    def _draw(
        self,
        name: str,
        lines: tuple[Floats, ...],
        path: str,
        looks: tuple[Look, ...],
        around: tuple[str, str] = ("", ""),
    ) -> None:
        if not lines:
            return
        self.shapes.append(Shapes(name, lines, looks[-1]))
        if any(look.fill == HATCH for look in looks):
            self._under.append(_PATTERN)
        self._under.append(around[0])
        for look in looks:
            self._path(self._under, path, look)
        self._under.append(around[1])

    def _path(self, layer: list[str], path: str, look: Look) -> None:
        if not path:
            return
        attributes = [f'd="{path}"', f'fill="{look.fill}"']
        if look.fill_opacity != 1.0:
            attributes.append(f'fill-opacity="{look.fill_opacity:g}"')
        if look.stroke != "none":
            width = round(look.width * self.unit, 2)
            attributes += [f'stroke="{look.stroke}"', f'stroke-width="{width:g}"']
            if look.opacity != 1.0:
                attributes.append(f'stroke-opacity="{look.opacity:g}"')
            if look.dashes:
                dashes = (f"{float(one) * self.unit:.4g}" for one in look.dashes.split())
                attributes.append(f'stroke-dasharray="{" ".join(dashes)}"')
        layer.append(f"<path {' '.join(attributes)}/>")


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
