"""What is proposed on the page, for the threads that find it and the person who says of it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping

from uavgram.picking.document.proposals import (
    Outcome,
    Outcomes,
    Pair,
    refused,
    reopened,
    that_hold,
)
from uavgram.picking.document.state import State

Tell = Callable[[Outcomes, Collection[str], int], None]
"""Takes all outcomes, the labels of which some changed, and how many places are left to look at."""


class Proposed:
    """Outcomes of the search by photo and label.

    Parameters
    ----------
    tell
        Called with what changed, by whoever changed it.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._changed = threading.Lock()
        self._outcomes: dict[Pair, Outcome] = {}

    @property
    def outcomes(self) -> dict[Pair, Outcome]:
        """What stands so far."""
        with self._changed:
            return dict(self._outcomes)

    def put(
        self,
        new: Mapping[Pair, Outcome],
        left: int = 0,
        gone: Collection[Pair] = (),
        *,
        always: bool = False,
    ) -> None:
        """Keep new outcomes; what somebody refused stays refused.

        Parameters
        ----------
        new
            By photo and label.
        left
            Number of places that are still to be looked at.
        gone
            What is known no longer.
        always
            Whether to tell it even where nothing changed.
        """
        with self._changed:
            over = {pair for pair, one in self._outcomes.items() if one.is_over}
            known = {} if always else self._outcomes
            changed = {pair: one for pair, one in new.items() if known.get(pair) != one}
            self._outcomes |= {pair: one for pair, one in changed.items() if pair not in over}
            lost = [pair for pair in gone if pair in self._outcomes and pair not in over]
            for pair in lost:
                del self._outcomes[pair]
            told = dict(self._outcomes)
        labels = {label for _, label in (*changed, *lost)}
        if labels or always:
            self._tell(told, labels, left)

    def let_go(self, state: State) -> None:
        """Forget what was found from picks that are no longer there."""
        with self._changed:
            before = self._outcomes
            self._outcomes = that_hold(before, state)
            gone = {label for _, label in before.keys() - self._outcomes.keys()}
            told = dict(self._outcomes)
        if gone:
            self._tell(told, gone, 0)

    def refuse(self, pairs: Collection[Pair]) -> None:
        """Propose or ask for some no longer."""
        self._set(refused, pairs)

    def reopen(self, pairs: Collection[Pair]) -> None:
        """Know nothing of some that were refused."""
        self._set(reopened, pairs)

    def _set(
        self, how: Callable[[Outcomes, Collection[Pair]], dict[Pair, Outcome]], of: Collection[Pair]
    ) -> None:
        with self._changed:
            self._outcomes = how(self._outcomes, of)
            told = dict(self._outcomes)
        self._tell(told, {label for _, label in of}, 0)
