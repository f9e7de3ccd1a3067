"""Adjust robustly with two lengths, or two control points, in exchange."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from uavgram.estimation.reliability.redundancy import GROSS_SIGMAS
from uavgram.estimation.solver.normal_equations import (
    NormalEquations,
    compute_cost,
    compute_gradient,
)
from uavgram.stages.refine.cleaned_adjustment import adjust_without_candidate
from uavgram.stages.refine.first_values import do_all_agree
from uavgram.stages.refine.minima import Participants, Patience
from uavgram.stages.refine.rival_errors import MAX_RIVAL_INCREASE
from uavgram.stages.refine.robust_candidate import (
    COORDINATES,
    Candidate,
    add_small_roughness,
    adjust_from_reduced,
)
from uavgram.stages.refine.staged_sigmas import DAMPING

MOST_STARTS = 12
"""Largest number of lengths, or photos, that are left out of the first values in turn; with more of
them the search is skipped."""

MOST_EXCHANGES = 28
"""Largest number of pairs of control points that are tried as exchanged: of eight points."""

CONTROL_EXCHANGE_COST, LENGTH_EXCHANGE_COST = GROSS_SIGMAS**2 / COORDINATES, GROSS_SIGMAS**2
"""Costs of two control points, or two lengths, with each other's readings. An exchange has no
unknown amount, where a gross control point has three; two lengths often differ by little, so that
their exchange explains an error of one of them by chance."""

LEAST_AGREEING_CONTROL = 3
"""Number of control points that determine the place and direction of a scene, and check it."""

MIN_DECREASE_SHARE = 0.8
"""Share of the gross error's decrease of the sum of squares that another observation must reach, in
the linear model, to be tried instead."""


def try_exchanged_readings(
    tried: set[tuple[str, int, int]], taking: Participants, found: Sequence[Candidate]
) -> Iterator[Candidate]:
    """Adjust with the readings of two lengths, or the coordinates of two control points, exchanged.

    Of few control points, two that are exchanged agree with each other in another direction of the
    scene, and a right one contradicts them. Two exchanged lengths lead to another pose, in which a
    right reading is a gross error. Lengths are left out then; coordinates remain exchanged, as
    nothing else may place the scene. An exchange has to explain everything, unless nothing else
    gives a result.

    Parameters
    ----------
    tried
        Kind and rows of exchanges that were tried before; those of this call are added.
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    if found and found[0].leaves_out_nothing():
        return
    goal = found[0].bound_exchange(taking) if found else np.inf
    survey = taking.survey
    control, is_explained = _list_control_to_exchange(taking, found), False
    for pair in _choose_untried("control", control, tried):
        world_m, sigma_m = survey.control_world_m.copy(), survey.control_sigma_m.copy()
        world_m[pair], sigma_m[pair] = world_m[pair[::-1]], sigma_m[pair[::-1]]
        other = replace(survey, control_world_m=world_m, control_sigma_m=sigma_m)
        exchanged = replace(taking, survey=other)
        whole = add_small_roughness(exchanged)
        names = tuple(survey.label[k] for k in survey.control_label[pair])
        patience = Patience(goal=goal, limit=goal)
        for one in adjust_from_reduced(whole, whole, exchanged, patience, again=True):
            explains_all = one.leaves_out_nothing()
            is_explained |= explains_all
            if explains_all or not found:
                candidate = replace(one, price=CONTROL_EXCHANGE_COST, exchanged=names)
                limit = candidate.cost(taking) + MAX_RIVAL_INCREASE
                goal = min(goal, limit) if explains_all else goal
                yield candidate
    if is_explained:
        return  # two lengths would cost more
    several = [one for one in found[:1] if len(one.annealed.problem.survey.frame_id) > 1]
    lines = _list_lengths_to_exchange(taking)
    for best in several:
        lines = _choose_promising_lengths(best, goal, lines)
    for pair in _choose_untried("lengths", lines, tried):
        length_m = survey.length_m.copy()
        length_m[pair] = length_m[pair[::-1]]
        reduced = replace(taking, survey=replace(survey, length_m=length_m))
        rest = taking.leave_out_lines(pair)
        patience = Patience(goal=goal, limit=goal)
        parts = (add_small_roughness(reduced), add_small_roughness(rest), rest)
        for one in adjust_from_reduced(*parts, patience, again=True):
            if one.leaves_out_nothing() and adjust_without_candidate(one) is not None:
                candidate = replace(one, price=LENGTH_EXCHANGE_COST)
                goal = min(goal, candidate.cost(taking) + MAX_RIVAL_INCREASE)
                yield candidate


def _choose_promising_lengths(
    best: Candidate, goal: float, pairs: Iterable[list[int]]
) -> Iterator[list[int]]:
    """Choose the pairs of lengths whose exchange explains what a candidate of several photos left.

    One Gauss-Newton step with all observations and the exchanged readings gives the sum of squares
    in the linear model. Several photos show the shape of the ground without lengths.

    Parameters
    ----------
    best
        The candidate of least cost.
    goal
        Sum of squares that the exchange has to reach.
    pairs
        Pairs of lengths, by row of the whole survey.
    """
    problem = best.annealed.problem
    blocks = problem.evaluate(best.annealed.minimum.state)
    if blocks is None or "lengths" not in blocks:
        return
    normal = NormalEquations(list(blocks.values()), problem.layout.size, problem.layout.structure)
    factor, own = normal.factor(DAMPING), blocks["lengths"]
    row = {int(line): k for k, line in enumerate(best.first.line_index[problem.line_index])}
    survey = best.taking.survey
    whole = normal.cost - float(normal.gradient @ factor.solve(normal.gradient))
    for pair in pairs:
        rows = [row[line] for line in pair if line in row]
        change = survey.length_m[pair[::-1]] - survey.length_m[pair]
        if len(rows) < 2:
            yield pair
            continue
        residual = own.residual.copy()
        residual[rows, 0] -= change / survey.length_sigma_m[pair]
        exchanged = {**blocks, "lengths": replace(own, residual=residual)}
        gradient = compute_gradient(exchanged.values(), problem.layout.size)
        squares = compute_cost(exchanged.values()) - float(gradient @ factor.solve(gradient))
        if squares <= max(goal, (1.0 - MIN_DECREASE_SHARE) * whole):
            yield pair


def _choose_untried(
    kind: str, pairs: Iterable[list[int]], tried: set[tuple[str, int, int]]
) -> Iterator[list[int]]:
    """Choose the pairs of rows of a kind that were not tried before, and add them to those."""
    for first, second in pairs:
        if (kind, first, second) not in tried:
            tried.add((kind, first, second))
            yield [first, second]


def _list_control_to_exchange(
    taking: Participants, found: Sequence[Candidate]
) -> Iterator[list[int]]:
    """List pairs of control points, by row, that may have each other's coordinates.

    Where a log, or three others, place the scene, those that the best candidate leaves out are
    among them.
    """
    survey = taking.survey
    number, is_logged = len(survey.control_label), survey.telemetry is not None
    wrong = found[0].list_unused_control(taking) if found else np.arange(number)
    is_shown = is_logged and bool(found) and found[0].fits()
    least = 0
    if is_shown or number - len(wrong) >= LEAST_AGREEING_CONTROL:
        least = min(len(wrong), 2)
    pairs = [
        list(pair)
        for pair in combinations(range(number), 2)
        if np.isin(pair, wrong).sum() >= max(least, int(is_shown))
        and not (found and _contradicts_exchange(found[0], taking, list(pair)))
    ]
    if len(pairs) <= MOST_EXCHANGES and number + int(is_logged) >= LEAST_AGREEING_CONTROL:
        yield from pairs


def _contradicts_exchange(best: Candidate, taking: Participants, pair: list[int]) -> bool:
    """Return whether several photos show another shape than the control with a pair exchanged."""
    found, survey = best.annealed, taking.survey
    is_reliable = best.fits() and found.minimum.converged and not best.misplaced
    if not is_reliable or len(found.problem.survey.frame_id) < 2:
        return False
    row = best.annealed.problem.survey.row_of_label
    known = [k for k, label in enumerate(survey.control_label) if survey.label[label] in row]
    here = found.minimum.state.point[[row[survey.label[k]] for k in survey.control_label[known]]]
    there = survey.control_world_m.copy()
    there[pair] = there[pair[::-1]]
    return not do_all_agree(here[:, :2], there[known, :2])


def _list_lengths_to_exchange(taking: Participants) -> Iterator[list[int]]:
    """List pairs of lengths, by row, that may have each other's readings, without a log."""
    survey = taking.survey
    lines = np.flatnonzero(~taking.line_removed).tolist()
    pairs = [
        list(pair)
        for pair in combinations(lines, 2)
        if abs(np.diff(survey.length_m[list(pair)])[0])
        > GROSS_SIGMAS * survey.length_sigma_m[list(pair)].max()
    ]
    if survey.telemetry is None and len(pairs) <= MOST_STARTS:
        yield from pairs
