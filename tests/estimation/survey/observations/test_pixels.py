"""Points picked beside what was meant: against differences, and a dense solve of another model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from increments import compute_increment
from likelihood_scenes import beginning, with_found
from scenes import make_scene, picked_beside
from scipy_likelihood import Oracle, central

from uavgram.estimation.solver import normal_equations
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.neighbours import _part
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

SIGMA_M = 0.015
STATED = SolveOptions(noise="stated")


def identified(survey: Survey, targets: int = 0) -> Survey:
    """A survey whose labels may have been picked beside what was meant; the first are targets."""
    return replace(
        survey,
        identification_sigma_m=np.full(len(survey.label), SIGMA_M),
        target_pick=np.flatnonzero(survey.pick_label < targets),
    )


@pytest.mark.parametrize("roughness", [0.0, 0.05])
def test_every_jacobian_equals_central_differences(roughness: float) -> None:
    scene = make_scene(3, roughness=roughness)
    survey = identified(with_found(scene.survey, chains=2, ties=3), targets=2)
    problem = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    size = 0.003 * np.random.default_rng(1).normal(size=layout.size)
    start = beginning(problem, scene.truth)
    start = replace(start, picked=start.point[survey.identified])
    state = apply_increment(layout, start, size)
    blocks = problem.evaluate(state)

    assert blocks is not None
    assert layout.picked == len(survey.label) - 2
    assert compute_increment(layout, start, state) == pytest.approx(size)
    names = ("pixels", "matches", "identification", "linked")
    ends = [
        [problem.evaluate(apply_increment(layout, state, s * step)) for s in (1, -1)]
        for step in 1e-5 * np.eye(layout.size)
    ]
    for name in names:
        analytic = blocks[name].sparse(layout.size).toarray()
        numeric = np.stack(
            [(a[name].residual - b[name].residual).ravel() / 2e-5 for a, b in ends if a and b],
            axis=1,
        )
        scale = np.abs(analytic).max(axis=0)
        error = np.abs(analytic - numeric).max(axis=0)
        assert (error <= 1e-5 * np.maximum(scale, scale.max() * 1e-6)).all(), name


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(
    "alone", [{}, {"telemetry": False, "gauge": "plane", "lines": 9}], ids=["log", "no log"]
)
def test_it_is_a_covariance_that_all_picks_of_a_label_share(
    monkeypatch: pytest.MonkeyPatch, alone: dict[str, object], *, sparse: bool
) -> None:
    """Against generalised least squares: offsets are in the covariance of picks, and no unknown."""
    if sparse:
        monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
    made = make_scene(11, roughness=0.05, **alone)  # type: ignore[arg-type]
    survey = identified(picked_beside(made, SIGMA_M, 5).survey, targets=3)
    adjustment = refine(survey, STATED)[0].adjustment
    layout = adjustment.problem.layout
    basis, lens = adjustment.problem.intrinsic_basis, layout.first_intrinsic
    picked = layout.picked_columns(np.arange(layout.picked)).ravel()
    ours = np.delete(np.arange(layout.size), picked)
    joint = adjustment.minimum.factor.joint(ours)
    to_lens = np.eye(len(ours))
    first = int(np.flatnonzero(ours == lens)[0])
    to_lens[first : first + len(basis), first : first + len(basis)] = basis
    joint = to_lens @ joint @ to_lens.T
    sigma = np.sqrt(np.diag(joint))
    here = np.zeros(len(ours))
    here[first : first + len(basis)] = (
        adjustment.problem.intrinsics(adjustment.state) - survey.calibration.parameters
    )

    oracle = Oracle(survey, adjustment.state, adjustment.problem.pivot_m)
    residual = oracle.residuals(here)
    jacobian = central(lambda z: oracle.residuals(here + sigma * z), np.zeros(len(ours))) / sigma
    covariance = np.eye(len(residual))
    for label in survey.identified:
        rows = np.flatnonzero(survey.pick_label == label)
        rows = (2 * rows[:, None] + np.arange(2)).ravel()
        by_place = jacobian[rows][:, 3 * label : 3 * label + 2]
        covariance[np.ix_(rows, rows)] += SIGMA_M**2 * by_place @ by_place.T
    weight = np.linalg.inv(covariance)
    theirs = np.linalg.inv(jacobian.T @ weight @ jacobian)
    step = theirs @ jacobian.T @ weight @ residual

    assert np.abs(step / sigma).max() < 0.02  # bent projection, by a few centimetres
    apart = (theirs - joint) / np.outer(sigma, sigma)
    assert np.abs(apart).max() < 0.01


def errors_in_sigmas(seed: int, stated_m: float) -> Floats:
    """Of distances between all labels, where people picked 15 mm beside what they meant."""
    scene = picked_beside(make_scene(seed, frames=6, roughness=0.02), SIGMA_M, 1000 + seed)
    sigma = np.full(len(scene.survey.label), stated_m)
    survey = replace(scene.survey, identification_sigma_m=sigma)
    adjustment = refine(survey, STATED)[0].adjustment
    found, joint = adjustment.joint_points(np.arange(len(sigma)))
    one, other = np.triu_indices(len(sigma), 1)
    along = found[other] - found[one]
    length = np.linalg.norm(along, axis=1)
    gradient = np.zeros((len(one), len(sigma), 3))
    rows = np.arange(len(one))
    gradient[rows, one], gradient[rows, other] = -along / length[:, None], along / length[:, None]
    flat = gradient.reshape(len(one), -1)
    variance = np.einsum("ni,ij,nj->n", flat, joint, flat)
    true = np.linalg.norm(scene.world[other] - scene.world[one], axis=1)
    return np.asarray((length - true) / np.sqrt(variance))


def test_sigmas_of_distances_hold_where_labels_were_picked_beside_what_was_meant() -> None:
    known, ignored = (
        np.concatenate([errors_in_sigmas(seed, stated) for seed in range(25)])
        for stated in (SIGMA_M, 0.0)
    )

    assert 0.85 < np.sqrt(np.mean(known**2)) < 1.15
    assert np.mean(np.abs(known) < 1.96) > 0.92
    assert np.sqrt(np.mean(ignored**2)) > 1.4


def test_the_ends_of_a_taped_length_are_as_far_apart_as_the_tape_says() -> None:
    """However many photos show them: the tape is of what was meant."""
    scene = make_scene(5, frames=8, roughness=0.02, tape_sigma=0.003)
    adjustment = refine(identified(scene.survey), STATED)[0].adjustment
    survey = adjustment.survey
    length, gradient, columns = adjustment.problem.lengths_between(
        adjustment.state, survey.line_start, survey.line_end
    )
    sigma = np.sqrt(adjustment.minimum.factor.variances(columns, gradient))
    free = [k for k in range(len(survey.label)) if k not in {*survey.line_start, *survey.line_end}]
    between_free = adjustment.problem.lengths_between(
        adjustment.state, np.array(free[:1]), np.array(free[1:2])
    )
    assert (sigma < 1.05 * 0.003).all()
    assert np.sqrt(adjustment.minimum.factor.variances(between_free[2], between_free[1])) > 0.02
    assert len(length) == 6


def test_part_of_a_survey_has_its_own_picked_points() -> None:
    survey = identified(make_scene(4, frames=5, roughness=0.05).survey, targets=2)
    adjustment = refine(survey, STATED)[0].adjustment
    part = _part(adjustment, select_picks(adjustment.survey, adjustment.survey.pick_frame < 2))
    blocks, all_blocks = part.problem.evaluate(part.state), adjustment.minimum.blocks

    assert blocks is not None
    rows = adjustment.survey.pick_frame < 2
    np.testing.assert_allclose(blocks["pixels"].residual, all_blocks["pixels"].residual[rows])
    names = [adjustment.problem.layout.describe(int(c), adjustment.survey) for c in part.columns]
    own = [part.problem.layout.describe(c, part.problem.survey) for c in range(len(names))]
    assert names == own
