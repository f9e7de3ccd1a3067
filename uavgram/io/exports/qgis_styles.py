"""Styles of layers in QGIS: the XML (QML), the same in GeoPackage and project."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement

from uavgram.model.maps import ShapeKind

_DASHES_MM = "3;2"
_LABEL_PT = "8"
_GEOMETRY: dict[ShapeKind, str] = {"point": "0", "line": "1", "polygon": "2"}
# QgsPalLayerSettings.Placement: around a point, along a line, horizontal in an area
_PLACEMENT: dict[ShapeKind, str] = {"point": "0", "line": "2", "polygon": "4"}

# QgsLabeling.LinePlacementFlag: above, below, map orientation; and the distance by which texts may
# extend beyond the ends of lines: otherwise short or crowded lines have none
_BESIDE_LINE, _BEYOND_MM = str(2 + 4 + 8), "40"


@dataclass(frozen=True, kw_only=True)
class Look:
    """Style of a layer.

    Attributes
    ----------
    title
        Displayed name.
    colour
        ``#rrggbb``.
    width_mm
        Of lines and outlines; of a point, its size.
    dashed
        Whether lines are.
    filled
        Opacity inside polygons.
    label
        The column that is written beside each shape; empty: none.
    shown
        Whether it is visible at first.
    by_status
        Colours of shapes by their column ``status``; all others have `colour`.
    """

    title: str
    colour: str
    width_mm: float
    dashed: bool = False
    filled: float = 0.0
    label: str = ""
    shown: bool = True
    by_status: dict[str, str] = field(default_factory=dict)


def style_of(look: Look, kind: ShapeKind) -> Element:
    """Return the style as the content of its own file.

    Parameters
    ----------
    look
        Style of the layer.
    kind
        Kind of its shapes.
    """
    root = Element("qgis", version="3.22.0", styleCategories="Symbology|Labeling")
    fill_style(root, look, kind)
    SubElement(root, "layerGeometryType").text = _GEOMETRY[kind]
    return root


def fill_style(parent: Element, look: Look, kind: ShapeKind) -> None:
    """Add symbols and labels to an element that describes a layer.

    Parameters
    ----------
    parent
        Such as a project's ``maplayer``.
    look, kind
        See `style_of`.
    """
    parent.set("labelsEnabled", "1" if look.label else "0")
    colours = [*look.by_status.values(), look.colour]
    if look.by_status:
        renderer = SubElement(parent, "renderer-v2", type="categorizedSymbol", attr="status")
        categories = SubElement(renderer, "categories")
        for number, status in enumerate([*look.by_status, ""]):
            SubElement(
                categories, "category", value=status, symbol=str(number), render="true",
                label=status or "other",
            )  # fmt: skip
    else:
        renderer = SubElement(parent, "renderer-v2", type="singleSymbol")
    symbols = SubElement(renderer, "symbols")
    for number, colour in enumerate(colours):
        _symbol(symbols, str(number), kind, look, colour)
    if look.label:
        _labels(parent, look, kind)


def _symbol(symbols: Element, name: str, kind: ShapeKind, look: Look, colour: str) -> None:
    symbol = SubElement(
        symbols, "symbol", type={"point": "marker", "line": "line", "polygon": "fill"}[kind],
        name=name, alpha="1",
    )  # fmt: skip
    dashes = {"use_custom_dash": "1", "customdash": _DASHES_MM, "customdash_unit": "MM"}
    casing = {"line_color": "255,255,255,220", "line_width": f"{look.width_mm * 2.2:.2f}"}
    if kind == "point":
        _layer(
            symbol, "SimpleMarker",
            {"name": "circle", "color": _rgba(colour), "size": f"{look.width_mm}",
             "outline_color": "255,255,255,255", "outline_width": "0.2"},
        )  # fmt: skip
    elif kind == "line":
        line = {"line_color": _rgba(colour), "line_width": f"{look.width_mm}"}
        _layer(symbol, "SimpleLine", casing)
        _layer(symbol, "SimpleLine", line | (dashes if look.dashed else {}))
    else:
        _layer(
            symbol, "SimpleFill",
            {"color": _rgba(colour, look.filled), "style": "solid" if look.filled else "no",
             "outline_color": _rgba(colour), "outline_width": f"{look.width_mm}"},
        )  # fmt: skip


def _layer(symbol: Element, kind: str, properties: dict[str, str]) -> None:
    layer = SubElement(symbol, "layer", {"class": kind, "enabled": "1", "pass": "0", "locked": "0"})
    for key, value in properties.items():
        SubElement(layer, "prop", k=key, v=value)


def _labels(parent: Element, look: Look, kind: ShapeKind) -> None:
    settings = SubElement(SubElement(parent, "labeling", type="simple"), "settings")
    text = SubElement(
        settings, "text-style", fieldName=look.label, isExpression="0", fontSize=_LABEL_PT,
        fontSizeUnit="Point", textOpacity="1",
        namedStyle="Bold", fontWeight="75", fontFamily="Sans Serif",
        textColor=_rgba(look.colour),
    )  # fmt: skip
    SubElement(
        text, "text-buffer", bufferDraw="1", bufferSize="0.8", bufferSizeUnits="MM",
        bufferColor="255,255,255,230", bufferOpacity="1",
    )  # fmt: skip
    SubElement(
        settings, "placement", placement=_PLACEMENT[kind], dist="1", distUnits="MM",
        placementFlags=_BESIDE_LINE, overrunDistance=_BEYOND_MM, overrunDistanceUnit="MM",
        geometryGeneratorType="PointGeometry",
    )  # fmt: skip
    SubElement(settings, "rendering", obstacle="1", drawLabels="1", scaleVisibility="0")


def _rgba(colour: str, opacity: float = 1.0) -> str:
    """Convert a colour: ``0,121,107,255`` for ``#00796b``."""
    parts = [str(int(colour[k : k + 2], 16)) for k in (1, 3, 5)]
    return ",".join([*parts, str(round(255 * opacity))])
