"""Observations that moved, adjusted near by: against the whole survey adjusted anew."""

from __future__ import annotations

import numpy as np
import pytest
from likelihood_scenes import with_found
from rolling_scenes import read_in_rows
from scenes import NO_TIMES, make_scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.propagation import compute_values, propagate
from uavgram.estimation.measuring.second_order import MOVE_SIGMAS, compute_curvature
from uavgram.estimation.solver.normal_equations import Block, compute_gradient
from uavgram.estimation.survey import neighbours as of_near
from uavgram.estimation.survey import readjustment
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbours import find_neighbourhood, split_into_groups
from uavgram.estimation.survey.readjustment import Functionals, add_errors, readjust_moved, refit
from uavgram.estimation.survey.selection import select_picks
from uavgram.model.arrays import Floats, Ints
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine


def adjusted(survey: Survey) -> Adjustment:
    return refine(survey, SolveOptions())[0].adjustment


@pytest.fixture(scope="module")
def adjustment() -> Adjustment:
    return adjusted(make_scene(8, frames=5, control=2).survey)


def distances(survey: Survey, count: int) -> tuple[MeasurementRequest, ...]:
    pairs = zip(survey.label[:count], survey.label[1:], strict=False)
    return tuple(
        MeasurementRequest(name="-".join(pair), kind="distance", points=pair) for pair in pairs
    )


def moved_by(block: Block, step: Floats) -> Floats:
    """(n, r) by which whitened observations move with a step (size,)."""
    moved: Floats = np.einsum("nrk,nk->nr", block.jacobian, step[block.columns])
    return moved


@pytest.mark.parametrize(
    "straight", [0.0, readjustment.MAX_NONLINEARITY_AT_END], ids=["mixed", "one step"]
)
def test_values_of_moved_observations_are_those_of_the_survey_adjusted_anew(
    adjustment: Adjustment, straight: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(readjustment, "MAX_NONLINEARITY_AT_END", straight)
    requests = distances(adjustment.survey, 4)
    measured = propagate(adjustment, requests, NO_TIMES)
    near = find_neighbourhood(adjustment, np.arange(4))
    steps = MOVE_SIGMAS * (measured.solved / measured.sigma).T
    asked = Functionals(
        gradient=measured.gradient.toarray().T / measured.sigma[:, None],
        solved=measured.solved.T / measured.sigma[:, None],
        of=np.eye(len(requests), dtype=np.bool_),
    )
    found = readjust_moved(near, adjustment.minimum.factor, steps, asked)
    for row, request in enumerate(requests):
        state = found.states[row]
        assert state is not None
        value = compute_values(near.problem, state, (request,), NO_TIMES)[0]
        blocks = adjustment.minimum.blocks
        errors = {name: moved_by(block, steps[row]) for name, block in blocks.items()}
        alone = refit(adjustment, errors, 1e-12)
        assert alone is not None
        truth = compute_values(adjustment.problem, alone, (request,), NO_TIMES)[0]
        sigma = measured.sigma[row]
        assert value + found.rest[row, row] * sigma == pytest.approx(truth, abs=0.01 * sigma)


def test_what_the_last_step_leaves_is_told(
    adjustment: Adjustment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a step of twelve sigmas alone: by how much the next one would move each value."""
    monkeypatch.setattr(readjustment, "MAX_NONLINEARITY_AT_END", np.inf)
    requests = distances(adjustment.survey, 4)
    measured = propagate(adjustment, requests, NO_TIMES)
    sigma, size = measured.sigma, adjustment.problem.layout.size
    steps = 12.0 * (measured.solved / sigma).T
    asked = Functionals(
        gradient=np.zeros((len(requests), size)),
        solved=measured.solved.T / sigma[:, None],
        of=np.eye(len(requests), dtype=np.bool_),
    )
    near = find_neighbourhood(adjustment, np.arange(4))
    found = readjust_moved(near, adjustment.minimum.factor, steps, asked)
    for row, state in enumerate(found.states):
        assert state is not None
        blocks = adjustment.problem.evaluate(state)
        assert blocks is not None
        errors = {
            name: moved_by(block, steps[row]) for name, block in adjustment.minimum.blocks.items()
        }
        gradient = compute_gradient(add_errors(blocks, errors).values(), size)
        further = -adjustment.minimum.factor.solve(gradient)
        by_it = measured.gradient[:, [row]].toarray()[:, 0] @ further / sigma[row]
        assert abs(by_it) > 0.01
        assert found.rest[row, row] == pytest.approx(by_it, rel=1e-6)


def in_a_ring(survey: Survey) -> Survey:
    """Of a survey whose photos show everything, each label in two photos next to each other."""
    between = (survey.pick_frame - survey.pick_label) % len(survey.frame_id)
    return select_picks(survey, between < 2).survey


def with_all_sorts() -> Survey:
    """Rows read one by one, ties and matches, two tapes."""
    scene = make_scene(3, frames=8, labels=24, roughness=0.05)
    scene = read_in_rows(read_on_tapes(scene, {"A": 0.0, "B": 0.01}, sigma=0.02), 0.04)
    return with_found(in_a_ring(scene.survey), chains=4, ties=3)


def dense(block: Block, columns: Ints, size: int) -> Floats:
    """(n, r, size) derivatives by all unknowns."""
    found = np.zeros((*block.residual.shape, size))
    for row, (own, jacobian) in enumerate(zip(columns, block.jacobian, strict=True)):
        np.add.at(found[row].T, own, jacobian.T)
    return found


def test_a_part_of_a_survey_says_what_the_whole_says_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    adjustment = adjusted(with_all_sorts())
    monkeypatch.setattr(of_near, "MAX_PHOTOS_FOR_WHOLE", 0)
    monkeypatch.setattr(of_near, "RING_COUNT", 1)
    near = find_neighbourhood(adjustment, np.array([0]))
    part, whole = near.problem.evaluate(near.state), adjustment.minimum.blocks
    assert part is not None
    assert len(part["pixels"].residual) < len(whole["pixels"].residual)
    assert "telemetry" in part
    size = adjustment.problem.layout.size
    for name, block in part.items():
        # Each row of the part is a row of the whole, with the same derivatives.
        ours = dense(block, near.columns[block.columns], size)
        theirs = dense(whole[name], whole[name].columns, size)
        for residual, jacobian in zip(block.residual, ours, strict=True):
            row = np.argmin(np.abs(whole[name].residual - residual).sum(axis=1))
            np.testing.assert_allclose(residual, whole[name].residual[row], atol=1e-9)
            np.testing.assert_allclose(jacobian, theirs[row], atol=1e-9)


def test_second_order_near_by_is_that_of_the_whole_survey(monkeypatch: pytest.MonkeyPatch) -> None:
    survey = in_a_ring(make_scene(5, frames=12, labels=36).survey)
    adjustment = adjusted(survey)
    requests = distances(survey, 6)
    measured = propagate(adjustment, requests, NO_TIMES)
    whole = compute_curvature(adjustment, measured, NO_TIMES)
    monkeypatch.setattr(of_near, "MAX_PHOTOS_FOR_WHOLE", 0)
    assert len(find_neighbourhood(adjustment, np.arange(2)).problem.survey.frame_id) < 10
    part = compute_curvature(adjustment, measured, NO_TIMES)
    np.testing.assert_allclose(part.sigma, whole.sigma, rtol=0.01)
    np.testing.assert_allclose(part.bias, whole.bias, atol=0.01 * measured.sigma.max())


def test_groups_hold_everything_once_and_lie_together() -> None:
    place = np.random.default_rng(3).uniform(0, 100, (200, 2))
    found = split_into_groups(place, 16)
    assert sorted(np.concatenate(found).tolist()) == list(range(200))
    assert max(map(len, found)) <= 16
    assert np.mean([np.ptp(place[rows], axis=0).max() for rows in found]) < 50
