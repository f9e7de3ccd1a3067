"""Choose the observation to remove as a blunder, if it can be separated from the others."""

from __future__ import annotations

from typing import NamedTuple

from uavgram.estimation.reliability.data_snooping import find_suspicions
from uavgram.estimation.reliability.redundancy import compute_test_statistics
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.observations.observation import Suspicion

READING_GROUPS = ("lengths", "known")
"""Groups of readings that concern several points each."""

MAX_REMOVED_SHARE = 0.25
"""Share of the observations beyond which removals point to a wrong model, not to blunders."""


class BlunderSearch(NamedTuple):
    """Possible removals.

    Attributes
    ----------
    choice
        The pick, length or known thing that is the likeliest blunder; None where everything fits or
        none can be chosen.
    undecided
        Suspicions in which none can be chosen.
    """

    choice: Removal | None
    undecided: list[Suspicion]


def find_blunder(refined: Refined, significance: float) -> BlunderSearch:
    """Choose the pick, length or known thing to remove.

    If no test can separate a length from the picks of its ends, the length is removed, since its
    points keep their places; likewise any other known thing. A group with two lengths, with two
    picks only, or with a prior in it stays: no observation shows which of them is wrong. Where a
    prior alone is suspected, nothing is removed because of it.
    """
    undecided = []
    groups = compute_test_statistics(refined.adjustment)
    for suspicion in find_suspicions(refined.adjustment, groups, significance):
        members = (suspicion.suspect, *suspicion.group)
        stated = [m for m in members if m.kind in READING_GROUPS]
        picks = [m for m in members if m.kind == "pixels"]
        if not stated and not picks:
            continue
        if len(stated or picks) > 1 or len(stated) + len(picks) < len(members):
            undecided.append(suspicion)
            continue
        return BlunderSearch(_removal(refined, suspicion), undecided)
    return BlunderSearch(None, undecided)


def _removal(refined: Refined, suspicion: Suspicion) -> Removal:
    kind, row = suspicion.suspect.kind, suspicion.suspect.row
    if kind == "lengths":
        index = int(refined.line_index[refined.adjustment.problem.line_index[row]])
        return Removal("line", index, suspicion, refined)
    if kind == "known":
        problem = refined.adjustment.problem
        thing = problem.known[problem.known_thing[row]]
        return Removal("known", thing.index, suspicion, refined)
    return Removal("pick", int(refined.pick_index[row]), suspicion, refined)
