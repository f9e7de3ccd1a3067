"""Pictures inside a page: marks in its text, until it is written, as they are nearly all of it."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator
from itertools import zip_longest

from uavgram.model.result.pictures import Pictures

GROUND = "ground"
_MARK = re.compile(r"<!-- picture (\w+) -->")  # what people wrote is escaped: it has no such thing


def picture_mark(which: int | str) -> str:
    """Stands for the address of a picture: of one of the photos' by its row, or of `GROUND`."""
    return f"<!-- picture {which} -->"


def with_pictures(html: str, pictures: Pictures) -> Iterator[bytes]:
    """The page as pieces of UTF-8, each picture where its mark was, as an address that holds it."""
    parts = _MARK.split(html)
    for text, which in zip_longest(parts[::2], parts[1::2]):
        yield text.encode()
        if which is not None:
            shown = pictures.ground if which == GROUND else pictures.shown[int(which)]
            yield b"data:image/jpeg;base64," + b64encode(b"" if shown is None else shown.jpeg)
