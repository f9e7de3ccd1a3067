"""Ties around labels say how high the ground is there, and how well they know it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from likelihood_scenes import beginning, with_found
from scenes import make_scene
from tied_flights import Conditions, tied_flight
from tied_surveys import TiedSurvey, tied_survey

from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.ground import ThirdCoordinate
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.survey import GroundConstraints, Survey
from uavgram.stages.refine.ground_from_ties import (
    OTHER_OBJECT_M,
    _ground_constraints,
    _Prediction,
    _unclear_ground_m,
)
from uavgram.stages.refine.tie_outliers import remove_wrong_ties
from uavgram.stages.refine.tied_frames import add_tied_frames

SWELL_M = 0.2


def over(swell_m: float, rough_m: float) -> TiedSurvey:
    """A flight over waves of such a height, of points that lie off them by so much each."""
    weather = Conditions(photos=6, seed=4, density=200.0, rough_m=rough_m, swell_m=swell_m)
    return tied_survey(tied_flight(weather), labels=40)


def sound(survey: TiedSurvey) -> Survey:
    """With ties that fit each other, and what they show of the ground."""
    return remove_wrong_ties(add_tied_frames(survey.survey)[0]).survey


def guessed(survey: TiedSurvey, found: Survey) -> tuple[Floats, Floats]:
    """Errors of the heights that true ties and the prior of the ground make, and their sigmas."""
    rays = survey.flight.sightings
    tie = {f"t{t}": survey.flight.point[t] for t in rays.point}
    first = np.unique(found.ties.point, return_index=True)[1]
    true = np.array([tie[survey.observed.ties.tie[row]] for row in found.ties.row[first]])
    beside = found.ties.constraints
    said = np.sum(beside.weight * true[beside.tie, 2], axis=1)
    prior = 1.0 / (beside.uneven * found.ground.roughness_sigma_m) ** 2
    known = np.where(np.isfinite(beside.sigma_m), beside.sigma_m, np.inf) ** -2.0
    variance = 1.0 / (prior + known)
    return variance * known * said - survey.world[beside.label, 2], np.sqrt(variance)


@pytest.fixture(scope="module")
def waves() -> tuple[TiedSurvey, Survey]:
    """Smooth waves, and what ties show of them."""
    survey = over(SWELL_M, 0.02)  # as uneven as `tied_survey` makes the labels
    return survey, sound(survey)


def test_labels_on_waves_have_the_height_of_the_ties_around_them(
    waves: tuple[TiedSurvey, Survey],
) -> None:
    error, sigma = guessed(*waves)
    assert len(error) == 40  # all of them: a tie may tell of several
    assert np.sqrt(np.mean(error**2)) < 0.4 * SWELL_M / np.sqrt(2)  # on a plane they are off by all
    assert 0.4 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.6


def test_ties_that_disagree_know_no_more_than_they_show() -> None:
    survey = over(0.0, 0.05)
    _, sigma = guessed(survey, sound(survey))
    assert np.all(sigma > 0.03)
    assert np.median(sigma) > 0.042  # told by the prior and by the ties once more: 0.035
    assert np.median(sigma) < 0.1


def test_prior_and_ties_together_are_the_guess_of_which_the_prior_was_a_part() -> None:
    height, sigma, prior = np.array([0.1, -0.2]), np.array([0.03, 0.05]), np.array([0.06, 0.09])
    told = _Prediction(np.zeros((2, 1), np.int64), height[:, None], sigma)
    made = _ground_constraints(np.arange(2), told, prior, 0.06)

    weight = 1.0 / np.stack([prior, made.sigma_m]) ** 2
    both = weight[1] * made.weight[:, 0] / weight.sum(axis=0)
    np.testing.assert_allclose(both, height)
    np.testing.assert_allclose(1.0 / np.sqrt(weight.sum(axis=0)), sigma)


def test_ties_off_the_ground_leave_unclear_what_they_would_have_told() -> None:
    across, along = np.meshgrid(np.arange(0.0, 40.0, 2.0), np.arange(0.0, 20.0, 2.0))
    ties = np.column_stack([across.ravel(), along.ravel()])
    road = np.flatnonzero(ties[:, 0] < 20.0)  # a bank beyond
    place = np.array([[9.0, 9.0], [19.0, 9.0], [31.0, 9.0]])
    on_road, at_foot, on_bank = _unclear_ground_m(place, ties, road, (0.01, 8.0))

    assert on_road == 0.0
    assert at_foot == pytest.approx(OTHER_OBJECT_M / np.sqrt(12.0))  # half of them are off
    assert on_bank == pytest.approx(OTHER_OBJECT_M / np.sqrt(3.0))


def test_labels_left_out_take_no_tie_with_them(waves: tuple[TiedSurvey, Survey]) -> None:
    _, found = waves
    kept = found.pick_label >= 4
    less = select_picks(found, kept).survey

    before, after = found.ties, less.ties
    assert after.points == before.points
    assert [less.label[k] for k in after.constraints.label] == [
        name for k in before.constraints.label if (name := found.label[k]) in less.label
    ]
    rows = np.flatnonzero(np.isin(before.constraints.label, np.unique(found.pick_label[kept])))
    np.testing.assert_array_equal(after.constraints.tie, before.constraints.tie[rows])


def test_ties_that_are_gone_leave_what_they_said_to_the_others(
    waves: tuple[TiedSurvey, Survey],
) -> None:
    ties = waves[1].ties
    least = ties.constraints.tie[0, np.argmin(np.abs(ties.constraints.weight[0]))]
    less, points = ties.remove(ties.point == least)

    before, after = ties.constraints, less.constraints
    assert least not in points
    here = np.flatnonzero((before.tie == least).any(axis=1))
    np.testing.assert_allclose(
        np.abs(after.weight[here]).sum(axis=1), np.abs(before.weight[here]).sum(axis=1)
    )
    assert np.all(after.sigma_m[here] > before.sigma_m[here])
    said = points[after.tie[after.weight != 0.0]]
    assert set(said) == set(before.tie[before.weight != 0.0]) - {least}


def test_a_label_that_has_lost_most_of_its_ties_is_on_ground_as_uneven_as_before(
    waves: tuple[TiedSurvey, Survey],
) -> None:
    found = waves[1]
    beside = found.ties.constraints
    ties, _ = found.ties.remove(np.isin(found.ties.point, beside.tie[0]))

    assert np.isfinite(beside.sigma_m[0])
    assert np.isnan(ties.constraints.sigma_m[0])
    before, after = (ThirdCoordinate.of(replace(found, ties=each)) for each in (found.ties, ties))
    np.testing.assert_array_equal(before.sigma_m, after.sigma_m)


def test_derivatives_of_heights_beside_labels() -> None:
    scene = make_scene(3, roughness=0.05, verge=(0, 1, 2, 5), control=3)
    found = with_found(scene.survey, chains=1, ties=4)
    beside = GroundConstraints(
        label=np.array([0, 3]),
        tie=np.array([[0, 3, 1], [2, 0, 1]]),
        weight=np.array([[0.7, 0.5, -0.2], [1.0, 0.0, 0.0]]),
        sigma_m=np.array([0.02, 0.03]),
        uneven=np.ones(2),
    )
    ties = replace(found.ties, constraints=beside)
    survey = replace(found, ties=ties)
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    size = problem.layout.size
    step = 0.01 * np.random.default_rng(2).normal(size=size)
    state = apply_increment(problem.layout, beginning(problem, scene.truth), step)
    blocks = problem.evaluate(state)
    assert blocks is not None
    block = blocks["beside"]
    assert block.residual.shape == (2, 1)
    analytic, numeric = np.zeros((2, size)), np.zeros((2, size))
    np.add.at(analytic, (np.arange(2)[:, None], block.columns), block.jacobian[:, 0])
    for column in np.unique(block.columns):
        step = np.zeros(size)
        step[column] = 1e-5
        both = [
            problem.evaluate(apply_increment(problem.layout, state, side * step))
            for side in (1, -1)
        ]
        ahead, behind = (each["beside"].residual[:, 0] for each in both if each is not None)
        numeric[:, column] = (ahead - behind) / 2e-5
    np.testing.assert_allclose(analytic, numeric, atol=1e-5 * np.abs(analytic).max())
