"""On the ground or off it: the mixture's rates, and departures without their own priors."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.reliability.off_ground import Seen, label_misfit, mixture, seen_departures
from uavgram.estimation.solver.normal_equations import NormalEquations
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.stages.refine.begin.softened import iterate


def adjusted(prior_sigma_m: Floats) -> Adjustment:
    scene = make_scene(3, frames=5)
    survey = replace(scene.survey, height_sigma_m=prior_sigma_m)
    problem = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool))
    point = np.column_stack([scene.truth.point[:, :2], np.zeros(12)])
    state: State = replace(scene.truth, point=point)
    minimum = iterate(problem, state, 20)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def test_a_departure_without_its_own_prior_is_that_of_the_model_without_it() -> None:
    sigma = np.linspace(0.03, 0.2, 12)
    adjustment = adjusted(sigma)
    seen = seen_departures(adjustment, sigma)
    blocks, size = adjustment.minimum.blocks, adjustment.problem.layout.size
    normal = np.asarray(NormalEquations(list(blocks.values()), size).normal)
    for label in (0, 7):
        column, own = 3 * label + 2, sigma[label] ** -2.0
        departure = adjustment.state.point[label, 2]
        without = normal.copy()
        without[column, column] -= own
        inverse = np.linalg.inv(without)
        assert seen.variance_m2[label] == pytest.approx(inverse[column, column], rel=1e-5)
        # The gradient was zero with the prior: without it, minus what the prior pulled.
        step = inverse[column, column] * own * departure
        assert seen.departure_m[label] == pytest.approx(departure + step, rel=1e-4, abs=1e-5)


def test_picks_by_label_sum_up_to_all() -> None:
    adjustment = adjusted(np.full(12, 0.05))
    fit, block = label_misfit(adjustment), adjustment.minimum.blocks["pixels"]

    assert fit.squares.sum() == pytest.approx(np.sum(block.residual**2))
    leverage = adjustment.covariance.leverage(block)
    assert fit.redundancy.sum() == pytest.approx(leverage.size - leverage.sum())
    assert fit.photos.sum() == len(adjustment.survey.pick_frame)


@pytest.mark.parametrize("relief", [0.0, 0.05])
def test_the_mixture_parts_cars_from_relief_and_learns_it(relief: float) -> None:
    rng = np.random.default_rng(4)
    sigma = rng.uniform(0.01, 0.05, 400)
    stands = np.arange(400) < 120
    true = np.where(stands, rng.uniform(0.5, 2.5, 400), relief * rng.standard_normal(400))
    seen = Seen(true + sigma * rng.standard_normal(400), sigma**2)

    found = mixture(seen, np.zeros(400), np.full(400, 0.5))

    assert 0.6 * relief <= found.relief_m <= 1.5 * relief + 0.02
    assert (found.off[stands] > 0.99).all()
    assert (found.off[~stands] < 0.99).mean() >= 0.999


def test_a_stated_roughness_explains_what_smooth_ground_does_not() -> None:
    departure = 0.05 * np.random.default_rng(5).standard_normal(60)
    departure[0] = 0.9
    seen = Seen(departure, np.full(60, 0.01**2))

    rough, smooth = (mixture(seen, np.full(60, size), np.zeros(60)) for size in (0.3, 0.0))

    assert rough.off[0] < 0.5
    assert smooth.off[0] > 0.99
