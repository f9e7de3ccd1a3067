"""What a search for picks in the other photos came to."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.model.survey.observations import Picks
from uavgram.stages.match.found import Record


@dataclass(frozen=True, kw_only=True)
class Matches:
    """What a search found.

    Attributes
    ----------
    path
        The table of picks.
    record
        Found and missed, by photo and label.
    labels
        Those that were looked for.
    picks
        Those that the table has now, or would have.
    replaced, kept
        Number of earlier matches whose pick was moved, or that fit no longer, and which are taken
        out; and of those that stay as they are.
    not_sought
        Labels that take no part in the adjustment, so that nobody knows where to look.
    unplaced
        Photos of which it is not known where they were taken.
    turned_rad
        By how much the camera looked elsewhere than mount and log have it, more than they may err;
        0: it did not.
    """

    path: str
    record: Record
    labels: tuple[str, ...]
    picks: Picks
    replaced: int
    kept: int = 0
    not_sought: tuple[str, ...] = ()
    unplaced: tuple[str, ...] = ()
    turned_rad: float = 0.0

    @property
    def sightings(self) -> dict[str, int]:
        """Of each label that was looked for, the number of photos in which the table has it."""
        count = dict.fromkeys(self.labels, 0)
        for label in self.picks.label:
            if label in count:
                count[label] += 1
        return count
