"""Which observation to take out as a blunder, if any can be told from the others."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.data_snooping import RIVAL, suspicions
from uavgram.estimation.reliability.test_statistics import Observed, observed
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.suspicion import Member, Suspicion

STATED = ("lengths", "known")
"""Groups of readings that bear on several points each."""

MOST = 0.25
"""Share of the observations beyond which what is taken out is no blunder but the model."""

MOST_LENGTHS = 12
"""Lengths and known things up to which each is left out once, where the statistics may point at the
wrong one."""

LARGE = 20.0
"""Test statistic from which on a blunder has bent the adjustment out of the linear model."""


class Blunders(NamedTuple):
    """What could be taken out.

    Attributes
    ----------
    choices
        Picks, lengths or known things that could be the blunder, likeliest first; none where
        everything fits or nothing can be chosen.
    undecided
        Suspicions in which none can be chosen.
    """

    choices: list[Removal]
    undecided: list[Suspicion]


def blunders(refined: Refined, significance: float) -> Blunders:
    """The picks, lengths or known things one of which to take out.

    Of a length and the picks of its ends that no test can part, the length goes: its points keep
    their places; and so with whatever else is known. A group with two lengths, with two picks
    alone, or with a prior in it, stays: nothing tells which of them is wrong. Where a prior alone
    is suspected, nothing is taken out on its account.

    Notes
    -----
    Where lengths alone tell the pose, a large blunder in one may lead to another of the poses that
    three lengths allow, and all test statistics there point to an innocent one; with a log, so may
    a very large one. So each of a few lengths is a choice, and adjustments without each of them
    decide.
    """
    adjustment = refined.adjustment
    groups = observed(adjustment)
    undecided = []
    for suspicion in suspicions(adjustment, groups, significance):
        members = (suspicion.accused, *suspicion.group)
        stated = [m for m in members if m.kind in STATED]
        picks = [m for m in members if m.kind == "pixels"]
        if not stated and not picks:
            continue
        if len(stated or picks) > 1 or len(stated) + len(picks) < len(members):
            undecided.append(suspicion)
            continue
        choices = [_removal(refined, suspicion)]
        if stated and (adjustment.survey.telemetry is None or abs(suspicion.w) > LARGE):
            choices += _others(refined, groups, stated[0], significance)
        return Blunders(choices, undecided)
    return Blunders([], undecided)


def _removal(refined: Refined, suspicion: Suspicion) -> Removal:
    kind, row = suspicion.accused.kind, suspicion.accused.row
    if kind == "lengths":
        index = int(refined.line_index[refined.adjustment.problem.line_index[row]])
        return Removal("line", index, suspicion, refined)
    if kind == "known":
        problem = refined.adjustment.problem
        thing = problem.known[problem.known_thing[row]]
        return Removal("known", thing.index, suspicion, refined)
    return Removal("pick", int(refined.pick_index[row]), suspicion, refined)


def _others(
    refined: Refined, groups: dict[str, Observed], but: Member, significance: float
) -> list[Removal]:
    """Every other length and known thing that something checks, with what no test can part."""
    members = [
        Member(kind, row, 0)
        for kind in STATED
        if kind in groups
        for row in _first_rows(groups[kind])
        if groups[kind].checked[row, 0]
    ]
    if len(members) > MOST_LENGTHS:
        return []
    accused = _removal(refined, Suspicion(but, 0.0, (), ()))
    others = []
    for member in members:
        found = next(suspicions(refined.adjustment, groups, significance, member), None)
        removal = None if found is None else _removal(refined, found)
        if removal and (removal.kind, removal.index) != (accused.kind, accused.index):
            others.append(removal)
    return others


def _first_rows(group: Observed) -> list[int]:
    """A row of each observation of a group."""
    if group.thing is None:
        return list(range(len(group.w)))
    return [int(row) for row in np.unique(group.thing, return_index=True)[1]]


def best_of(tried: list[tuple[Removal, Refined]]) -> tuple[Removal, Refined]:
    """The removal that leaves the best fit; others nearly as good are its rivals."""
    costs = [after.adjustment.minimum.cost for _, after in tried]
    best = min(range(len(tried)), key=costs.__getitem__)
    removal, after = tried[best]
    rivals = tuple(
        other.suspicion.accused
        for k, (other, _) in enumerate(tried)
        if k != best and costs[k] - costs[best] < RIVAL
    )
    if len(tried) == 1:
        return removal, after
    return replace(removal, suspicion=replace(removal.suspicion, rivals=rivals)), after
