"""Setting of tags in an XMP packet, keeping all others."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from xml.etree import ElementTree as ET

from uavgram.io.photos.metadata import DJI, PIX4D, parse_xmp

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
META = "adobe:ns:meta/"
_PREFIXES = {"x": META, "rdf": RDF, "Camera": f"{PIX4D}/", "drone-dji": f"{DJI}/"}
_RESERVED = re.compile(r"ns\d+|xml|")  # reserved by ElementTree
_EMPTY = (
    f'<x:xmpmeta xmlns:x="{META}"><rdf:RDF xmlns:rdf="{RDF}"><rdf:Description rdf:about=""/>'
    "</rdf:RDF></x:xmpmeta>"
).encode()
_BEGIN = '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
_END = '\n<?xpacket end="w"?>'


def with_tags(packet: bytes | None, tags: Mapping[tuple[str, str], str]) -> bytes:
    """Set tags in a packet (its ``x:xmpmeta``), and wrap it for a file.

    Parameters
    ----------
    packet
        The photo's packet; None starts a new one.
    tags
        Text by (namespace without its last slash, name); they replace those of the same name.

    Raises
    ------
    xml.parsers.expat.ExpatError, ValueError
        The packet is not XML, declares entities, or has no description.
    """
    source = _EMPTY if packet is None else packet
    parse_xmp(source)  # refuses declarations of entities
    for prefix, uri in {**_PREFIXES, **_prefixes(source)}.items():
        if not _RESERVED.fullmatch(prefix):
            ET.register_namespace(prefix, uri)
    root = ET.fromstring(source)  # noqa: S314 - declarations were refused above
    places = list(root.iter(f"{{{RDF}}}Description"))
    if not places:
        raise ValueError("it has no rdf:Description")
    for place in places:
        _remove(place, tags)
    for (namespace, name), text in tags.items():
        places[0].set(f"{{{namespace}/}}{name}", text)
    body = ET.tostring(root, encoding="unicode")
    return (_BEGIN + body + _END).encode("utf-8")


def _prefixes(packet: bytes) -> dict[str, str]:
    events = ET.iterparse(io.BytesIO(packet), events=("start-ns",))  # noqa: S314 - as above
    return {str(prefix): str(uri) for _, (prefix, uri) in events}


def _remove(place: ET.Element, tags: Mapping[tuple[str, str], str]) -> None:
    """Remove the tags, both as attributes and as elements."""
    for key in [key for key in place.attrib if _key(key) in tags]:
        del place.attrib[key]
    for child in [child for child in place if _key(child.tag) in tags]:
        place.remove(child)


def _key(qualified: str) -> tuple[str, str]:
    namespace, _, name = qualified.removeprefix("{").rpartition("}")
    return namespace.rstrip("/"), name
