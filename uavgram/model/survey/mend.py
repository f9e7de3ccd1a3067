"""What would put a survey in order: changes of its observations, by index, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


class Ends(NamedTuple):
    """Labels between which a length is, by index."""

    start: int
    end: int


@dataclass(frozen=True, kw_only=True)
class Mend:
    """Changes of what people wrote, by index into the survey that was handed in.

    Attributes
    ----------
    label_of_pick
        Pick -> the label that it should have.
    without_picks
        Picks to take out.
    pixel_of_pick
        Pick -> column and row [px] where it should be, of a photo that was mirrored or turned.
    length_m
        Known length -> what it should read [m].
    ends
        Known length -> the labels between which it is.
    without_lines
        Known lengths to take out.
    renamed
        Label -> the label that its points should have, in all photos; lengths, known things and
        control keep their labels.
    free
        Labels whose heights are to be found.
    """

    label_of_pick: Mapping[int, int] = field(default_factory=dict)
    without_picks: frozenset[int] = frozenset()
    pixel_of_pick: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    length_m: Mapping[int, float] = field(default_factory=dict)
    ends: Mapping[int, Ends] = field(default_factory=dict)
    without_lines: frozenset[int] = frozenset()
    renamed: Mapping[int, int] = field(default_factory=dict)
    free: frozenset[int] = frozenset()
