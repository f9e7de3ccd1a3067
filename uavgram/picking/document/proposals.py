"""Results of searching picked labels in the other photos, successful or not; pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.state import Pick, State

Pair = tuple[str, str]
"""Photo and label."""

BY_HAND = "what was found there was refused"
"""Reason for asking for a label in a photo in which a person refused the proposal."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of the search for a label in a photo.

    Attributes
    ----------
    source
        Photo and position of the pick that was searched for. None for points that need no pick,
        such as the corners of a coded plate.
    radius_px
        Half the side length of the searched region.
    found
        Proposed pick; None if nothing was found or the proposal was refused.
    why
        Reason why nothing was found, in words.
    is_alike
        Whether the whole surroundings look like those of the pick.
    is_over
        Whether a person refused it or will not pick it: it is not searched again.
    is_asked
        Whether it is to be picked by hand.
    withdrawn
        Match that is not proposed, as the point is probably not on the ground; it remains evidence
        of that.
    """

    source: tuple[str, float, float] | None
    radius_px: float
    found: c.Place | None = None
    why: str = ""
    is_alike: bool = False
    is_over: bool = False
    is_asked: bool = True
    withdrawn: c.Place | None = None

    @property
    def is_fixed(self) -> bool:
        """Whether searches leave it unchanged: a person's decision, or a point of a plate."""
        return self.is_over or self.source is None


Outcomes = Mapping[Pair, Outcome]


MIN_LIKE_PHOTOS = 3
"""Number of photos that must show a point with like surroundings for its matches to be sure.

On three rendered streets with cars and without stated heights, 46 of 460 matches are off by more
than 3 px; of 180 such matches two are, by 4 px, the error of the click that they were found from.
"""


def select_certain(outcomes: Outcomes) -> set[Pair]:
    """Return proposals that need no inspection: targets, and matches that agree."""
    alike = Counter(label for (_, label), one in outcomes.items() if one.found and one.is_alike)
    return {
        (image, label)
        for (image, label), one in outcomes.items()
        if one.found
        and (one.found.source == "target" or (one.is_alike and alike[label] >= MIN_LIKE_PHOTOS))
    }


def source_of(pick: Pick) -> tuple[str, float, float]:
    """Return the identifier of an outcome's source: photo and position of a pick."""
    return pick.image, pick.u_px, pick.v_px


def select_valid(outcomes: Outcomes, state: State) -> dict[Pair, Outcome]:
    """Return the outcomes whose source pick is unmoved."""
    there = {(pick.label, source_of(pick)) for pick in state.picks}
    return {
        (image, label): one
        for (image, label), one in outcomes.items()
        if one.source is None or (label, one.source) in there
    }


def make_accept_command(outcomes: Outcomes, state: State, pairs: Iterable[Pair]) -> c.PlaceAll:
    """Return the command that picks accepted proposals, in the order of their labels and photos.

    Parameters
    ----------
    outcomes, state
        Present search results and state.
    pairs
        Accepted proposals; those that are picked in the meantime stay unchanged.

    Raises
    ------
    RefusedError
        None of them is proposed any more.
    """
    found, holding = [], select_valid(outcomes, state)
    for pair in sorted(pairs, key=lambda pair: (pair[1], pair[0])):
        one = holding.get(pair)
        if one is not None and one.found is not None and state.pick(*pair) is None:
            found.append(one.found)
    if not found:
        raise RefusedError("that is not proposed any more: its pick was moved or removed")
    return c.PlaceAll(places=tuple(found))


def refuse(outcomes: Outcomes, pairs: Iterable[Pair]) -> dict[Pair, Outcome]:
    """Return the outcomes after a refusal.

    Refused proposals are then to be picked by hand; labels without a proposal are no longer asked
    for.
    """
    after = dict(outcomes)
    for pair in pairs:
        one = after.get(pair)
        if one is not None and one.found is not None:
            after[pair] = replace(one, found=None, why=BY_HAND, is_over=True)
        elif one is not None:
            after[pair] = replace(one, is_over=True, is_asked=False)
    return after


def reopen(outcomes: Outcomes, pairs: Iterable[Pair]) -> dict[Pair, Outcome]:
    """Return the outcomes without those whose refusal is taken back; they are searched again."""
    again = set(pairs)
    return {pair: one for pair, one in outcomes.items() if not (pair in again and one.is_over)}
