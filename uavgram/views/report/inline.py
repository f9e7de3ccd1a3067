"""Pictures inside a page: marks in its text until it is written, as pictures take most space."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator
from itertools import zip_longest

from uavgram.model.result.pictures import Pictures

GROUND = "ground"
_MARK = re.compile(r"<!-- picture (\w+) -->")  # escaped text cannot contain this


def picture_mark(which: int | str) -> str:
    """Return the mark for the address of a picture: a photo by its row, or `GROUND`."""
    return f"<!-- picture {which} -->"


def with_pictures(html: str, pictures: Pictures) -> Iterator[bytes]:
    """Yield the page as pieces of UTF-8, with each mark replaced by a data URL of its picture."""
    parts = _MARK.split(html)
    for text, which in zip_longest(parts[::2], parts[1::2]):
        yield text.encode()
        if which is not None:
            shown = pictures.ground if which == GROUND else pictures.shown[int(which)]
            yield b"data:image/jpeg;base64," + b64encode(b"" if shown is None else shown.jpeg)
