"""What would put a survey in order: changes of its observations, by index, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from uavgram.model.message import Message


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
    level
        Known lengths that were taped level.
    free
        Label -> whether its height is to be found, or it lies on the ground.
    """

    label_of_pick: Mapping[int, int] = field(default_factory=dict)
    without_picks: frozenset[int] = frozenset()
    pixel_of_pick: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    length_m: Mapping[int, float] = field(default_factory=dict)
    ends: Mapping[int, Ends] = field(default_factory=dict)
    without_lines: frozenset[int] = frozenset()
    level: frozenset[int] = frozenset()
    free: Mapping[int, bool] = field(default_factory=dict)

    @property
    def picks(self) -> frozenset[int]:
        """Picks that it keeps but changes."""
        return frozenset(self.label_of_pick) | frozenset(self.pixel_of_pick)

    @property
    def lines(self) -> frozenset[int]:
        """Known lengths that it keeps but changes."""
        return frozenset(self.length_m) | frozenset(self.ends) | self.level


@dataclass(frozen=True, kw_only=True)
class Cause:
    """What explains misfits of a survey.

    Attributes
    ----------
    message
        What it is and what to do, for people.
    mend
        What would put it in order; None where only a person can.
    gain
        Fall of the weighted sum of squares, and of what was left out for it.
    settles
        Lengths and frames, by name, of which it explains that they did not fit.
    """

    message: Message
    mend: Mend | None
    gain: float
    settles: frozenset[str] = frozenset()
