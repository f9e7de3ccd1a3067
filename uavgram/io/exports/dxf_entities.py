"""Entities of a CAD drawing, written as they stand in the file.

ezdxf makes the document (header, tables, styles, layouts), and checks it in the tests. Its entities
know all that a drawing can be: to make one and to write it takes forty times as long as its text,
and a survey has thousands.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity
from ezdxf.layouts.base import BaseLayout
from ezdxf.lldxf.tagwriter import AbstractTagWriter
from ezdxf.lldxf.validator import fix_one_line_text
from ezdxf.tools.text import escape_dxf_line_endings, split_mtext_string

from uavgram.model.arrays import Floats

LABELS = "LABELS"
"""Layer of texts beside points."""

Tag = tuple[int, str | float]
Place = Sequence[float]

_HEAD = "  0\n%s\n  5\n%s\n330\n%s\n100\nAcDbEntity\n  8\n%s\n"
_TAG = "%3d\n%s\n"
_WHOLE_TURN = 6.283185307179586
_MOST_LETTERS = 250  # of a paragraph, in one tag


class Drawn(DXFEntity):
    """Entities of one layout, in the order in which they were drawn.

    Places are (x, y, z) in the units of the drawing.
    """

    DXFTYPE = "DRAWN"

    def __init__(self, document: Drawing, layout: BaseLayout) -> None:
        super().__init__()
        self._next_handle = document.entitydb.next_handle
        self._owner = layout.layout_key
        self._pieces: list[str] = []
        layout.entity_space.add(self)

    def export_dxf(self, tagwriter: AbstractTagWriter) -> None:
        """Write all of them; called by ezdxf where the layout stands in the file."""
        tagwriter.write_str("".join(self._pieces))

    def add(self, kind: str, layer: str, tags: Iterable[Tag], owner: str = "") -> str:
        """Draw an entity of any kind; its handle.

        Parameters
        ----------
        kind, layer
            Names in the drawing.
        tags
            Group codes and values, beginning with the first subclass of its own.
        owner
            Handle of what it is a part of; by default the layout.
        """
        handle = self._next_handle()
        head = _HEAD % (kind, handle, owner or self._owner, layer)
        self._pieces.append(head + "".join([_TAG % tag for tag in tags]))
        return handle

    def line(self, layer: str, start: Place, end: Place) -> None:
        """Draw a straight line."""
        self.add("LINE", layer, [(100, "AcDbLine"), *at(10, start), *at(11, end)])

    def point(self, layer: str, place: Place) -> None:
        """Draw a point."""
        self.add("POINT", layer, [(100, "AcDbPoint"), *at(10, place)])

    def polyline(self, layer: str, places: Floats, *, closed: bool) -> None:
        """Draw a line through (n, 3) places."""
        flags = 9 if closed else 8
        head = [(100, "AcDb3dPolyline"), (66, 1), *at(10, (0.0, 0.0, 0.0)), (70, flags)]
        own = self.add("POLYLINE", layer, head)
        kind: list[Tag] = [(100, "AcDbVertex"), (100, "AcDb3dPolylineVertex")]
        for place in places.tolist():
            self.add("VERTEX", layer, [*kind, *at(10, place), (70, 32)])
        self.add("SEQEND", layer, [], own)

    def outline(self, layer: str, places: Floats, height: float) -> None:
        """Draw a closed level line through (n, 2) places."""
        head: list[Tag] = [(100, "AcDbPolyline"), (90, len(places)), (70, 1), (38, height)]
        corners = [tag for place in places.tolist() for tag in at(10, place)]
        self.add("LWPOLYLINE", layer, head + corners)

    def ellipse(self, layer: str, middle: Place, axis: Place, ratio: float) -> None:
        """Draw an ellipse by its middle, half its longer axis, and what the shorter is of that."""
        places = [*at(10, middle), *at(11, axis)]
        shape: list[Tag] = [(40, ratio), (41, 0.0), (42, _WHOLE_TURN)]
        self.add("ELLIPSE", layer, [(100, "AcDbEllipse"), *places, *shape])

    def text(self, layer: str, middle: Place, height: float, text: str) -> None:
        """Write one line about its middle."""
        head = [(100, "AcDbText"), *at(10, middle), (40, height), (1, fix_one_line_text(text))]
        self.add("TEXT", layer, [*head, (72, 1), *at(11, middle), (100, "AcDbText"), (73, 2)])

    def paragraph(
        self, layer: str, middle: Place, height: float, along: Place, text: str, style: str
    ) -> None:
        """Write a text of any length about its middle.

        Parameters
        ----------
        layer
            Its layer.
        middle
            Of the text.
        height
            Of its letters.
        along
            (x, y, z) direction in which it is read.
        text, style
            What is written, and the name of its style.
        """
        *more, last = split_mtext_string(escape_dxf_line_endings(text), _MOST_LETTERS) or [""]
        words: list[Tag] = [*((3, piece) for piece in more), (1, last)]
        head: list[Tag] = [(100, "AcDbMText"), *at(10, middle), (40, height), (71, 5)]
        self.add("MTEXT", layer, [*head, *words, (7, style), *at(11, along)])

    def block(
        self, layer: str, name: str, place: Place, size: float = 1.0, turn: float = 0.0
    ) -> None:
        """Refer to a block.

        Parameters
        ----------
        layer
            Its layer.
        name
            Of the block.
        place
            Where its origin lies.
        size
            By which it is scaled.
        turn
            Counterclockwise [degrees].
        """
        scaled: list[Tag] = [(41, size), (42, size), (50, turn)]
        self.add("INSERT", layer, [(100, "AcDbBlockReference"), (2, name), *at(10, place), *scaled])

    def named_block(
        self,
        layer: str,
        name: str,
        place: Place,
        letters: float,
        attributes: Iterable[tuple[str, str, Place]],
    ) -> None:
        """Refer to a block, with what belongs to this one.

        Parameters
        ----------
        layer
            Its layer.
        name
            Of the block.
        place
            Where its origin lies.
        letters
            Height of the attributes' letters.
        attributes
            Tag, text and place of each; no program shows them.
        """
        head: list[Tag] = [(100, "AcDbBlockReference"), (66, 1), (2, name)]
        own = self.add("INSERT", layer, [*head, *at(10, place)])
        for tag, text, where in attributes:
            words = [(100, "AcDbText"), *at(10, where), (40, letters), (1, fix_one_line_text(text))]
            hidden: list[Tag] = [(100, "AcDbAttribute"), (2, tag), (70, 1)]
            self.add("ATTRIB", LABELS, [*words, *at(11, where), *hidden])
        self.add("SEQEND", layer, [], own)


def at(code: int, place: Place) -> list[Tag]:
    """Tags of a place (x, y) or (x, y, z)."""
    return [(code + 10 * axis, value) for axis, value in enumerate(place)]
