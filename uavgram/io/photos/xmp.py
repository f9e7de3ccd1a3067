"""XMP packets of photos as flat tags: attribute and element form alike (ISO 16684-1)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

# Expat itself, not a tree: declarations of types and entities are refused before they can expand.
from xml.parsers import expat

from uavgram.errors import InputError
from uavgram.input_files import read_bytes
from uavgram.io.photos.jpeg_segments import XMP_HEAD, parse_jpeg

XmpTags = Mapping[tuple[str, str], str]
"""(namespace without its last slash, name) -> text."""

DJI = "http://www.dji.com/drone-dji/1.0"
PIX4D = "http://pix4d.com/camera/1.0"
XMP = "http://ns.adobe.com/xap/1.0"
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_START, _END = b"<x:xmpmeta", b"</x:xmpmeta>"
LARGEST_PACKET = 4_000_000
_SEPARATOR = "\n"  # between namespace and name; in neither of them


class _DeclarationError(ValueError):
    """A document type or entity: XMP has neither, attacks do."""


def read_xmp(path: str | Path) -> XmpTags:
    """Read the XMP tags of a photo; empty where it has none.

    Raises
    ------
    InputError
        The file cannot be read, or its packet is no XML, or declares entities.
    """
    packet = xmp_packet(Path(path))
    if packet is None:
        return {}
    try:
        return parse_xmp(packet)
    except (expat.ExpatError, _DeclarationError) as fault:
        raise InputError(
            path,
            f"its XMP packet cannot be read ({fault}): leave this photo out, or give the poses in "
            "a CSV file",
        ) from fault


def xmp_packet(path: Path) -> bytes | None:
    """XML of a photo's XMP packet; of anything but a JPEG, the first that lies in the file."""
    data = read_bytes(path)
    jpeg = parse_jpeg(data)
    place = data if jpeg is None else jpeg.app1(XMP_HEAD)
    if place is None:
        return None
    start = place.find(_START)
    end = place.find(_END, start)
    if start < 0 or end < 0 or end - start > LARGEST_PACKET:
        return None
    return place[start : end + len(_END)]


def parse_xmp(packet: bytes) -> XmpTags:
    """Collect the tags of a packet: attributes, and elements that hold nothing but text.

    Raises
    ------
    xml.parsers.expat.ExpatError
        The packet is no XML.
    ValueError
        It declares a document type or an entity.
    """
    tags: dict[tuple[str, str], str] = {}
    text: list[str] = []

    def start(_name: str, attributes: dict[str, str]) -> None:
        text.clear()
        for key, value in attributes.items():
            tags.setdefault(_key(key), value.strip())

    def end(name: str) -> None:
        value = "".join(text).strip()
        text.clear()
        if value and _key(name)[0] != _RDF.rstrip("/"):
            tags.setdefault(_key(name), value)

    def refuse(*_: object) -> None:
        raise _DeclarationError("it declares a document type or an entity")

    parser = expat.ParserCreate(namespace_separator=_SEPARATOR)
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text.append
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.Parse(packet, True)  # noqa: FBT003 - expat takes it by position: the last piece
    return tags


def _key(qualified: str) -> tuple[str, str]:
    namespace, _, name = qualified.rpartition(_SEPARATOR)
    return namespace.rstrip("/"), name
