"""Matches and ties in the likelihood: against central differences, and correlated errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from increments import compute_increment
from likelihood_scenes import MATCH_PX, PATCH_PX, beginning, with_found
from rolling_scenes import read_in_rows
from scenes import Scene, make_scene

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.arrays import Floats


def dense(block: Block, size: int) -> Floats:
    """(n r, size) Jacobian of a block by all unknowns."""
    n, r, _ = block.jacobian.shape
    whole = np.zeros((n, r, size))
    rows = np.arange(n)[:, None, None]
    np.add.at(whole, (rows, np.arange(r)[:, None], block.columns[:, None, :]), block.jacobian)
    return whole.reshape(n * r, size)


def problem_of(scene: Scene) -> SurveyProblem:
    return SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))


@pytest.mark.parametrize(
    ("roughness", "rolling"), [(0.0, False), (0.05, True)], ids=["plane", "rough, rolling"]
)
def test_every_jacobian_equals_central_differences(roughness: float, *, rolling: bool) -> None:
    scene = make_scene(3, roughness=roughness)
    if rolling:
        scene = read_in_rows(scene, 0.04)
    found = with_found(scene.survey, chains=2, ties=3)
    problem = SurveyProblem(found, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    size = 0.003 * np.random.default_rng(1).normal(size=layout.size)
    state = apply_increment(layout, beginning(problem, scene.truth), size)
    blocks = problem.evaluate(state)

    assert blocks is not None
    assert layout.turning == rolling
    names = {"pixels", "matches", "ties", "tie heights"}
    names |= {"linked", "turning"} if rolling else {"linked"}
    assert names <= set(blocks)
    numeric: dict[str, list[Floats]] = {name: [] for name in names}
    for step in 1e-5 * np.eye(layout.size):
        ahead, behind = (
            problem.evaluate(apply_increment(layout, state, s * step)) for s in (1, -1)
        )
        assert ahead is not None
        assert behind is not None
        for name in names:
            apart = ahead[name].residual - behind[name].residual
            numeric[name].append(apart.ravel() / 2e-5)
    for name in names:
        analytic = dense(blocks[name], layout.size)
        scale = np.abs(analytic).max(axis=0)
        error = np.abs(analytic - np.stack(numeric[name], axis=1)).max(axis=0)
        assert (error <= 1e-5 * np.maximum(scale, scale.max() * 1e-6)).all(), name


def test_between_undoes_a_move_of_tied_points_and_turning() -> None:
    scene = read_in_rows(make_scene(3), 0.04)
    problem = SurveyProblem(
        with_found(scene.survey, chains=2, ties=3), scene.pivot, np.ones(6, dtype=bool)
    )
    start = beginning(problem, scene.truth)
    step = 0.01 * np.random.default_rng(2).normal(size=problem.layout.size)

    assert compute_increment(
        problem.layout, start, apply_increment(problem.layout, start, step)
    ) == pytest.approx(step)


def test_a_match_repeats_the_error_of_the_pick_that_it_was_found_from() -> None:
    """Against correlated errors: match = J_t x + A e + m, pick = J_s x + e.

    A is the map from the source photo to the other one through the ground.
    """
    scene = make_scene(3)
    survey = with_found(scene.survey, chains=1, ties=0)
    picks = np.flatnonzero((survey.pick_label != 0) | (np.arange(len(survey.pick_label)) == 0))
    assert survey.matches.pick[0] == 0
    once = replace(
        survey,
        pick_frame=survey.pick_frame[picks],
        pick_label=survey.pick_label[picks],
        pixel_px=survey.pixel_px[picks],
        pick_sigma_px=survey.pick_sigma_px[picks],
    )
    problem = SurveyProblem(once, scene.pivot, np.ones(6, dtype=bool))
    layout, state = problem.layout, beginning(problem, scene.truth)
    blocks = problem.evaluate(state)
    assert blocks is not None
    rows = {name: dense(block, layout.size) for name, block in blocks.items()}
    information = sum(jacobian.T @ jacobian for jacobian in rows.values())
    others = np.setdiff1d(np.arange(layout.size), layout.tie_columns(np.zeros(1, int)).ravel())
    ours = np.linalg.inv(information)[np.ix_(others, others)]

    # The same pixels, as picks of the label itself with correlated errors.
    matches = once.matches
    count = len(matches.frame) - 1
    sigma_px = np.repeat(matches.sigma_px, 2)[:, None]
    seen = rows["matches"] * sigma_px
    chain, label = (
        layout.tie_columns(np.zeros(1, int))[0],
        layout.point_columns(np.zeros(1, int))[0],
    )
    as_picks = seen.copy()
    as_picks[:, label] += seen[:, chain]
    as_picks[:, chain] = 0.0
    by_ground = [seen[2 * k : 2 * k + 2][:, chain] for k in range(count + 1)]
    to_other = np.concatenate([own @ np.linalg.inv(by_ground[0]) for own in by_ground[1:]])
    pick_sigma = once.pick_sigma_px[0]
    mapped = np.concatenate([np.eye(2), to_other])
    covariance = pick_sigma**2 * mapped @ mapped.T
    covariance[2:, 2:] += MATCH_PX**2 * np.eye(2 * count) + PATCH_PX**2 * to_other @ to_other.T
    rest = {n: r for n, r in rows.items() if n not in ("matches", "pixels", "linked")}
    other_picks = rows["pixels"][2:]
    information = sum(jacobian.T @ jacobian for jacobian in rest.values())
    information = information + other_picks.T @ other_picks
    information += as_picks.T @ np.linalg.solve(covariance, as_picks)
    theirs = np.linalg.inv(information[np.ix_(others, others)])

    scale = np.sqrt(np.outer(np.diag(theirs), np.diag(theirs)))
    assert np.abs((ours - theirs) / scale).max() < 1e-6
