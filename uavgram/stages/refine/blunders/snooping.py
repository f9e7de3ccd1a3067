"""Which observation to take out as a blunder, if any can be told from the others."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from uavgram.estimation.reliability.data_snooping import RIVAL, suspicions
from uavgram.estimation.reliability.test_statistics import Observed, observed
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.suspicion import Member, Suspicion

MOST = 0.25
"""Share of the observations beyond which what is taken out is no blunder but the model."""

MOST_LENGTHS = 12
"""Lengths up to which each is left out once, where the statistics may point at the wrong one."""

LARGE = 20.0
"""Test statistic from which on a blunder has bent the adjustment out of the linear model."""


class Blunders(NamedTuple):
    """What could be taken out.

    Attributes
    ----------
    choices
        Picks or lengths that could be the blunder, likeliest first; none where everything fits
        or nothing can be chosen.
    undecided
        Suspicions in which none can be chosen.
    """

    choices: list[Removal]
    undecided: list[Suspicion]


def blunders(refined: Refined, significance: float) -> Blunders:
    """The picks or lengths one of which to take out.

    Of a length and the picks of its ends that no test can part, the length goes: its points keep
    their places. A group with two lengths, with two picks alone, or with a prior in it, stays:
    nothing tells which of them is wrong. Where a prior alone is suspected, nothing is taken out
    on its account.

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
        lines = [m for m in members if m.kind == "lengths"]
        picks = [m for m in members if m.kind == "pixels"]
        if not lines and not picks:
            continue
        if len(lines or picks) > 1 or len(lines) + len(picks) < len(members):
            undecided.append(suspicion)
            continue
        choices = [_removal(refined, suspicion)]
        if lines and (adjustment.survey.telemetry is None or abs(suspicion.w) > LARGE):
            choices += _other_lengths(refined, groups, lines[0].row, significance)
        return Blunders(choices, undecided)
    return Blunders([], undecided)


def _removal(refined: Refined, suspicion: Suspicion) -> Removal:
    kind, row = suspicion.accused.kind, suspicion.accused.row
    if kind == "lengths":
        index = int(refined.line_index[refined.adjustment.problem.line_index[row]])
        return Removal("line", index, suspicion, refined)
    return Removal("pick", int(refined.pick_index[row]), suspicion, refined)


def _other_lengths(
    refined: Refined, groups: dict[str, Observed], but: int, significance: float
) -> list[Removal]:
    """Every other length that something checks, with what no test can part from it."""
    checked = groups["lengths"].checked[:, 0]
    if len(checked) > MOST_LENGTHS:
        return []
    others = []
    for row in range(len(checked)):
        if row != but and checked[row]:
            first = Member("lengths", row, 0)
            found = suspicions(refined.adjustment, groups, significance, first)
            others.append(_removal(refined, next(found)))
    return others


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
