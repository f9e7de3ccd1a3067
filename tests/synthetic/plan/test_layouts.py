"""Layouts of reference lines: against all combinations, and against the real likelihood."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from plan_scenes import PlanCase, plan_case

from uavgram.synthetic.plan.accuracy import list_ends
from uavgram.synthetic.plan.layouts import (
    Candidates,
    ChosenLines,
    add_greedily,
    compute_criterion,
    compute_criterion_with_one_more,
    compute_criterion_without_each,
    exchange_lines,
    find_best_layout,
    find_robust_layout,
    invert,
)
from uavgram.synthetic.plan.possible import PossibleReferences, compute_possible
from uavgram.synthetic.plan.survey import predict_values


def options(case: PlanCase) -> PossibleReferences:
    return compute_possible(
        case.scene, case.cameras, case.wanted, (3.0, case.longest_m), most_spots=60
    )


def few(candidates: Candidates, count: int) -> Candidates:
    """Every so many of the candidates."""
    some = np.linspace(0, len(candidates.ends) - 1, count).astype(int)
    return Candidates(candidates.whitened[some], candidates.ends[some], candidates.node_root)


@pytest.mark.parametrize("pattern", ["single", "strip"])
@pytest.mark.parametrize("seed", [1, 2])
def test_exchange_comes_close_to_the_best_of_all_combinations(pattern: str, seed: int) -> None:
    found = options(plan_case(pattern, seed, lines=3))  # type: ignore[arg-type]
    candidates = few(found.candidates, 24)
    allowed = [
        lines
        for lines in combinations(range(24), 3)
        if len(np.unique(candidates.ends[list(lines)])) == 6
    ]
    best = min(compute_criterion(found.aim, candidates, lines) for lines in allowed)
    layout = find_best_layout(found.aim, candidates, 3)
    assert layout.criterion == pytest.approx(compute_criterion(found.aim, candidates, layout.lines))
    assert best <= layout.criterion * (1 + 1e-9)
    assert layout.criterion < 1.03 * best


@pytest.mark.parametrize("pattern", ["single", "strip"])
def test_one_more_line_is_reckoned_as_if_it_were_there(pattern: str) -> None:
    found = options(plan_case(pattern, 6))  # type: ignore[arg-type]
    there = add_greedily(found.aim, found.candidates, 3)[-1].lines
    among = np.flatnonzero(found.candidates.apart_from(there))[::37]
    covariance = invert(found.aim.information + found.candidates.information(there))
    quick = compute_criterion_with_one_more(found.aim, found.candidates, covariance, among)
    slow = np.array([compute_criterion(found.aim, found.candidates, (*there, i)) for i in among])
    assert int(np.argmin(quick)) == int(np.argmin(slow))
    assert quick.min() == pytest.approx(slow.min(), rel=1e-7)
    assert (quick >= slow * (1 - 1e-7)).all()  # what was not looked at closely is an upper bound


@pytest.mark.parametrize("pattern", ["single", "strip"])
@pytest.mark.parametrize("roughness_m", [0.0, 0.05])
def test_the_criterion_is_the_mean_sigma_of_the_real_likelihood(
    pattern: str, roughness_m: float
) -> None:
    case = plan_case(pattern, 7, roughness_m=roughness_m, lines=5)  # type: ignore[arg-type]
    found = options(case)
    layout = add_greedily(found.aim, found.candidates, 5)[-1]
    ends = list_ends(found, layout.lines)
    real = predict_values(case.scene, case.cameras, case.wanted, ends)
    assert compute_criterion(found.aim, found.candidates, layout.lines) == pytest.approx(
        real.sigma.mean(), rel=1e-6
    )


def test_planned_lines_are_far_better_than_random_ones() -> None:
    for pattern, share in (("single", 0.8), ("strip", 0.9)):
        case = plan_case(pattern, 8, lines=4)  # type: ignore[arg-type]
        found = options(case)
        rng = np.random.default_rng(0)
        count = len(found.candidates.ends)
        others = [
            compute_criterion(
                found.aim, found.candidates, rng.choice(count, 4, replace=False).tolist()
            )
            for _ in range(60)
        ]
        layout = find_best_layout(found.aim, found.candidates, 4)
        assert layout.criterion < share * np.median(others)


def test_a_sturdy_layout_bears_the_loss_of_any_line_better() -> None:
    found = options(plan_case("single", 9, lines=4))
    layout = find_best_layout(found.aim, found.candidates, 4)
    sturdy = find_robust_layout(found.aim, found.candidates, layout)
    lost, sturdy_lost = (
        compute_criterion_without_each(found.aim, found.candidates, one.lines).max()
        for one in (layout, sturdy)
    )
    assert sturdy_lost < 0.95 * lost
    assert sturdy.criterion < 1.15 * layout.criterion
    three = [one for one in layout.lines if one != layout.lines[0]]
    first = compute_criterion_without_each(found.aim, found.candidates, layout.lines)[0]
    assert first == pytest.approx(compute_criterion(found.aim, found.candidates, three))


def test_exchange_never_makes_it_worse() -> None:
    found = options(plan_case("strip", 10, lines=3))
    start = ChosenLines((0, 5, 9), compute_criterion(found.aim, found.candidates, (0, 5, 9)))
    assert exchange_lines(found.aim, found.candidates, start).criterion < start.criterion
