"""Picks, and known coordinates beside them, as another program's file holds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.message import Message
from uavgram.model.survey.observations import KnownPoints


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedPicks(FrozenArrays):
    """P picks in this program's convention.

    Attributes
    ----------
    image, label
        (P,) file name of the photo, and name of the point.
    pixel_px
        (P, 2) u right, v down of the original, unrotated file; (0, 0) is the centre of the
        top-left pixel.
    known
        Coordinates that the file holds of its points, with the sigma that was stated for them.
    messages
        What was left out, or had to be assumed.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2]
    known: KnownPoints | None
    messages: tuple[Message, ...]
