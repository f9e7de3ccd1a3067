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
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import move
from uavgram.model.arrays import Floats
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.tied_frames import with_tied_frames
from uavgram.stages.refine.sound_ties import with_sound_ties

SWELL_M = 0.2


def over(swell_m: float, rough_m: float) -> TiedSurvey:
    """A flight over waves of such a height, of points that lie off them by so much each."""
    weather = Conditions(photos=6, seed=4, density=200.0, rough_m=rough_m, swell_m=swell_m)
    return tied_survey(tied_flight(weather), labels=10)


def sound(survey: TiedSurvey) -> Survey:
    """With ties that fit each other, and what they show of the ground."""
    return with_sound_ties(with_tied_frames(survey.survey)[0]).survey


def guessed(survey: TiedSurvey, found: Survey) -> tuple[Floats, Floats]:
    """Errors of the heights that true ties around labels say, and their stated sigmas."""
    rays = survey.flight.sightings
    tie = {f"t{t}": survey.flight.point[t, 2] for t in rays.point}
    first = np.unique(found.ties.point, return_index=True)[1]
    true = np.array([tie[survey.observed.ties.tie[row]] for row in found.ties.row[first]])
    true = true + found.ties.near_rise_m
    error, sigma = [], []
    for label in np.unique(found.ties.near[found.ties.near >= 0]):
        mine = found.ties.near == label
        error.append(true[mine].mean() - survey.world[label, 2])
        sigma.append(found.ties.near_sigma_m[mine].mean() / np.sqrt(mine.sum()))
    return np.array(error), np.array(sigma)


@pytest.fixture(scope="module")
def waves() -> tuple[TiedSurvey, Survey]:
    """Smooth waves, and what ties show of them."""
    survey = over(SWELL_M, 0.01)
    return survey, sound(survey)


def test_labels_on_waves_have_the_height_of_the_ties_around_them(
    waves: tuple[TiedSurvey, Survey],
) -> None:
    error, sigma = guessed(*waves)
    assert len(error) > 5
    assert np.sqrt(np.mean(error**2)) < 0.4 * SWELL_M / np.sqrt(2)  # on a plane they are off by all
    assert 0.4 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.6


def test_ties_that_disagree_know_no_more_than_they_show() -> None:
    survey = over(0.0, 0.05)
    _, sigma = guessed(survey, sound(survey))
    assert np.all(sigma > 0.03)
    assert np.median(sigma) < 0.1


def test_labels_left_out_take_no_tie_with_them(waves: tuple[TiedSurvey, Survey]) -> None:
    _, found = waves
    kept = found.pick_label >= 4
    less = select_picks(found, kept).survey
    for name in less.label:
        before = found.ties.near == found.label.index(name)
        after = less.ties.near == less.label.index(name)
        assert set(less.ties.row[np.isin(less.ties.point, np.flatnonzero(after))]) <= set(
            found.ties.row[np.isin(found.ties.point, np.flatnonzero(before))]
        )


def test_derivatives_of_heights_beside_labels() -> None:
    scene = make_scene(3, roughness=0.05, verge=(0, 1, 2, 5), control=3)
    found = with_found(scene.survey, chains=1, ties=4)
    ties = replace(
        found.ties,
        near=np.array([0, -1, 3, 0]),
        near_rise_m=np.ones(4),
        near_sigma_m=np.full(4, 0.02),
    )
    survey = replace(found, ties=ties)
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    size = problem.layout.size
    step = 0.01 * np.random.default_rng(2).normal(size=size)
    state = move(problem.layout, beginning(problem, scene.truth), step)
    blocks = problem.evaluate(state)
    assert blocks is not None
    block = blocks["beside"]
    assert block.residual.shape == (3, 1)
    analytic, numeric = np.zeros((3, size)), np.zeros((3, size))
    np.add.at(analytic, (np.arange(3)[:, None], block.columns), block.jacobian[:, 0])
    for column in np.unique(block.columns):
        step = np.zeros(size)
        step[column] = 1e-5
        both = [problem.evaluate(move(problem.layout, state, side * step)) for side in (1, -1)]
        ahead, behind = (each["beside"].residual[:, 0] for each in both if each is not None)
        numeric[:, column] = (ahead - behind) / 2e-5
    np.testing.assert_allclose(analytic, numeric, atol=1e-5 * np.abs(analytic).max())
