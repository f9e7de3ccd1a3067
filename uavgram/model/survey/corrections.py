"""Corrections of a survey's observations, by index."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from uavgram.model.message import Message


class Ends(NamedTuple):
    """Labels of the ends of a length, by index."""

    start: int
    end: int


@dataclass(frozen=True, kw_only=True)
class SurveyCorrection:
    """Changes of the user's input, by index into the given survey.

    Attributes
    ----------
    label_of_pick
        Pick to its correct label.
    without_picks
        Picks to remove.
    pixel_of_pick
        Pick to its correct column and row [px], for a photo that was mirrored or turned.
    length_m
        Known length to its correct value [m].
    ends
        Known length to its correct end labels.
    without_lines
        Known lengths to remove.
    level
        Known lengths that were taped horizontally.
    free
        Label to whether its height is an unknown (True) or it is on the ground (False).
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
    """Possible cause of misfits in a survey.

    Attributes
    ----------
    message
        Finding and action, for people.
    mend
        Changes that correct it; None where only a person can.
    gain
        Decrease of the weighted sum of squares, plus that of observations left out for it.
    settles
        Names of lengths and frames whose misfit it explains.
    """

    message: Message
    mend: SurveyCorrection | None
    gain: float
    settles: frozenset[str] = frozenset()
