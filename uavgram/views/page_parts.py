"""Page split for paper: its drawings and photos become separate files.

A layout program styles each element of a page, including those inside drawings, and reads
addresses letter by letter. Content in separate files avoids this cost.
"""

from __future__ import annotations

import base64
import re
from typing import NamedTuple

DRAWING, PHOTO = "image/svg+xml", "image/jpeg"
SCHEME = "part"
"""Scheme of the addresses of parts."""

_DRAWING = re.compile(r"<svg\b([^>]*)>(.*?)</svg>", re.DOTALL)
_PHOTO = re.compile(r"data:image/jpeg;base64,([A-Za-z0-9+/=]+)")
_STYLE = re.compile(r"<style>.*?</style>", re.DOTALL)
_CLASS = re.compile(r'class="([^"]*)"')
_LABEL = re.compile(r'aria-label="([^"]*)"')
_SPACE = 'xmlns="http://www.w3.org/2000/svg"'


class Part(NamedTuple):
    """File of the page: its type and content."""

    kind: str
    content: bytes


class TakenApart(NamedTuple):
    """Page without its drawings and photos, and these parts by their addresses."""

    html: str
    parts: dict[str, Part]


def take_apart(html: str) -> TakenApart:
    """Move each drawing and photo to a file of its own; styles of drawings then apply to images.

    Parameters
    ----------
    html
        A page with inline drawings, and photos as data URLs.
    """
    parts: dict[str, Part] = {}

    def photo(found: re.Match[str]) -> str:
        return _add(parts, PHOTO, base64.b64decode(found[1]))

    def drawing(found: re.Match[str]) -> str:
        content = f"<svg {_SPACE}{found[1]}>{found[2]}</svg>".encode()
        label, looks = _LABEL.search(found[1]), _CLASS.search(found[1])
        return (
            f'<img class="{looks[1] if looks else ""}" alt="{label[1] if label else ""}" '
            f'src="{_add(parts, DRAWING, content)}">'
        )

    short = _DRAWING.sub(drawing, _PHOTO.sub(photo, html))
    styled = _STYLE.sub(lambda found: re.sub(r"\bsvg\b", "img", found[0]), short)
    return TakenApart(styled, parts)


def _add(parts: dict[str, Part], kind: str, content: bytes) -> str:
    address = f"{SCHEME}:{len(parts)}"
    parts[address] = Part(kind, content)
    return address
