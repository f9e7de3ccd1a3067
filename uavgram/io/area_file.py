"""Reader of polygons and named points: GeoJSON (RFC 7946) and KML (OGC 2.3), in degrees."""

from __future__ import annotations

import codecs
import json
import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_bytes, refuse_utf_16
from uavgram.io.json_codec import parse_json
from uavgram.model.arrays import Floats

FORMATS = "a GeoJSON file (.geojson, .json) or a KML file (.kml)"
_DECLARED = re.compile(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([^"'>]*)""")
_BYTE_BY_BYTE = re.compile(r"ascii|iso8859-\d+|cp125\d")
"""Encodings besides UTF-8 in which old programs save KML, by their Python names."""
_MAX_SHOWN = 40
"""Characters of an unknown encoding's name that a message repeats."""


class Area(NamedTuple):
    """A polygon: its name, empty where it has none, and its corners (V, 2) in degrees."""

    name: str
    longitude_latitude_deg: Floats


class AreaFile(NamedTuple):
    """Contents of a file of areas.

    Attributes
    ----------
    areas
        Polygons, their outer rings.
    label, longitude_latitude_deg
        (K,), (K, 2) points that have names.
    """

    areas: tuple[Area, ...]
    label: tuple[str, ...]
    longitude_latitude_deg: Floats


def read_areas(path: Path) -> AreaFile:
    """Read polygons, and points with names.

    Raises
    ------
    InputError
        The file cannot be read, is neither GeoJSON nor KML, or holds no polygon in longitude and
        latitude.
    """
    text = _decode_text(path, read_bytes(path, f"name {FORMATS} with a polygon"))
    text = text.lstrip("\ufeff")  # some programs write the mark twice
    if text.startswith("PK"):
        raise InputError(path, "is zipped, as KMZ files are: save it as KML, or unpack it")
    found = _kml(path, text) if text.lstrip().startswith("<") else _geojson(path, text)
    if not found.areas:
        raise InputError(path, "holds no polygon: draw one around the area and save it again")
    for place in (*(area.longitude_latitude_deg for area in found.areas), found[2]):
        if len(place) and not (np.abs(place) <= (180.0, 90.0)).all():
            raise InputError(
                path,
                "is not in longitude and latitude: save it in WGS 84 degrees (EPSG:4326), "
                "longitude first",
            )
    return found


def _decode_text(path: Path, data: bytes) -> str:
    """Decode a text as UTF-16 with a mark, with the encoding declared in XML, or as UTF-8."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    refuse_utf_16(path, data)
    declared = _DECLARED.match(data.removeprefix(codecs.BOM_UTF8))
    if declared is None:
        return data.decode("utf-8", errors="replace")
    stated = declared[1].decode("ascii", errors="replace")
    shown = stated if len(stated) <= _MAX_SHOWN else f"{stated[:_MAX_SHOWN]}..."
    try:
        name = codecs.lookup(stated).name
        if name == "utf-8" or _BYTE_BY_BYTE.fullmatch(name):
            return data.decode(name)
    except (LookupError, ValueError):
        pass  # an unknown encoding, or bytes that are not in it
    raise InputError(
        path, f"cannot be read in the encoding that it declares, {shown!r}: save it as UTF-8"
    )


def _geojson(path: Path, text: str) -> AreaFile:
    try:
        root = parse_json(path, text)
    except json.JSONDecodeError as fault:
        raise InputError(path, f"is no JSON ({fault.msg}): name {FORMATS}", fault.lineno) from fault
    areas: list[Area] = []
    points: list[tuple[str, list[float]]] = []
    try:
        for name, geometry in _geometries(root):
            kind, at = geometry["type"], geometry["coordinates"]
            if kind == "Polygon":
                areas.append(Area(name, _ring(at[0])))
            elif kind == "MultiPolygon":
                areas += [Area(name, _ring(rings[0])) for rings in at]
            elif kind == "Point" and name:
                points.append((name, [float(at[0]), float(at[1])]))
    except (TypeError, KeyError, IndexError, ValueError, AttributeError) as fault:
        raise InputError(
            path, f"is no GeoJSON that can be read: save it again ({fault!r})"
        ) from fault
    return _file(areas, points)


def _geometries(root: object) -> list[tuple[str, dict[str, Any]]]:
    """Return names and geometries of a collection, a feature or a geometry."""
    if not isinstance(root, dict):
        raise TypeError("no object")
    if root["type"] == "FeatureCollection":
        return [pair for one in root["features"] for pair in _geometries(one)]
    if root["type"] == "Feature":
        name = str((root.get("properties") or {}).get("name") or "")
        return [] if root["geometry"] is None else [(name, root["geometry"])]
    return [("", root)]


def _ring(at: list[list[float]]) -> Floats:
    return np.array([[float(x), float(y)] for x, y, *_ in at]).reshape(-1, 2)


def _kml(path: Path, text: str) -> AreaFile:
    if "<!ENTITY" in text:  # never used in KML, and a way to exhaust the memory
        raise InputError(path, "defines entities, which no KML does: save it again")
    try:
        root = fromstring(text)  # noqa: S314  (text: the declaration no longer counts)
    except ParseError as fault:
        line = fault.position[0]
        raise InputError(
            path, f"is no XML that can be read ({fault}): save it again", line
        ) from None
    areas: list[Area] = []
    points: list[tuple[str, list[float]]] = []
    try:
        for mark in root.iterfind(".//{*}Placemark"):
            name = (mark.findtext("{*}name") or "").strip()
            for polygon in mark.iterfind(".//{*}Polygon"):
                ring = polygon.find("{*}outerBoundaryIs//{*}coordinates")
                areas.append(Area(name, _ring(_coordinates(ring))))
            for point in mark.iterfind(".//{*}Point"):
                at = _coordinates(point.find("{*}coordinates"))
                points += [(name, at[0][:2])] if name else []
    except (ValueError, IndexError) as fault:
        raise InputError(
            path, f"holds coordinates that cannot be read: save it again ({fault})"
        ) from fault
    return _file(areas, points)


def _coordinates(element: Element | None) -> list[list[float]]:
    """Parse ``lon,lat[,height]`` separated by blanks."""
    text = "" if element is None else element.text or ""
    return [[float(part) for part in one.split(",")] for one in text.split()]


def _file(areas: list[Area], points: list[tuple[str, list[float]]]) -> AreaFile:
    label = tuple(name for name, _ in points)
    drawn = tuple(area for area in areas if len(area.longitude_latitude_deg))
    return AreaFile(drawn, label, np.array([at for _, at in points]).reshape(-1, 2))
