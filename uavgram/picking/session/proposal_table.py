"""Proposals on the page, shared by the search threads and the person who accepts or refuses."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping

from uavgram.picking.document.proposals import (
    Outcome,
    Outcomes,
    Pair,
    refuse,
    reopen,
    select_valid,
)
from uavgram.picking.document.state import State

Tell = Callable[[Outcomes, Collection[str], int], None]
"""Receiver of all outcomes, the labels with changed ones, and the number of the searched state."""


class ProposalTable:
    """Search outcomes by photo and label.

    Parameters
    ----------
    tell
        Called after each change, in the thread that made it.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._changed = threading.Lock()
        self._outcomes: dict[Pair, Outcome] = {}
        self.searched = -1  # number of the last state for which all was searched

    @property
    def outcomes(self) -> dict[Pair, Outcome]:
        """Copy of the present outcomes."""
        with self._changed:
            return dict(self._outcomes)

    def put(
        self,
        new: Mapping[Pair, Outcome],
        gone: Collection[Pair] = (),
        searched: int | None = None,
    ) -> None:
        """Store new outcomes; only a person refuses, and takes a refusal back.

        A search that began before either of them ends with the outcomes that it began with.

        Parameters
        ----------
        new
            Outcomes by photo and label.
        gone
            Photos and labels whose outcomes are void.
        searched
            Number of the state for which the search is finished; None: it is not.
        """
        with self._changed:
            over = {pair for pair, one in self._outcomes.items() if one.is_over}
            changed = {
                pair: one
                for pair, one in new.items()
                if not one.is_over and pair not in over and self._outcomes.get(pair) != one
            }
            self._outcomes |= changed
            lost = [pair for pair in gone if pair in self._outcomes and pair not in over]
            for pair in lost:
                del self._outcomes[pair]
            if searched is not None:
                self.searched = searched
            now = dict(self._outcomes)
        labels = {label for _, label in (*changed, *lost)}
        if labels or searched is not None:
            self._tell(now, labels, self.searched)

    def let_go(self, state: State) -> None:
        """Remove outcomes whose source pick no longer exists."""
        with self._changed:
            before = self._outcomes
            self._outcomes = select_valid(before, state)
            gone = {label for _, label in before.keys() - self._outcomes.keys()}
            now = dict(self._outcomes)
        if gone:
            self._tell(now, gone, self.searched)

    def refuse(self, pairs: Collection[Pair]) -> None:
        """Stop proposing, or asking for, some labels."""
        self._set(refuse, pairs)

    def reopen(self, pairs: Collection[Pair]) -> None:
        """Forget the outcomes of some refused proposals."""
        self._set(reopen, pairs)

    def _set(
        self, how: Callable[[Outcomes, Collection[Pair]], dict[Pair, Outcome]], of: Collection[Pair]
    ) -> None:
        with self._changed:
            self._outcomes = how(self._outcomes, of)
            now = dict(self._outcomes)
        self._tell(now, {label for _, label in of}, self.searched)
