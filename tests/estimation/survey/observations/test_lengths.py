"""The scale of a tape: its sign, which tapes have an unknown, and what the survey learns of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene
from taped_scenes import read_on_tapes

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.lengths import TapedLengths
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

Make = Callable[..., Scene]


def adjusted(scene: Scene) -> Adjustment:
    return refine(scene.survey, SolveOptions(noise="stated"))[0].adjustment


def test_a_tape_that_is_too_long_has_a_positive_scale_and_reads_short(scene_factory: Make) -> None:
    scene = read_on_tapes(scene_factory(5, noise=0.0), {"long": 0.01}, sigma=0.001)
    survey = scene.survey
    span = scene.world[survey.line_end] - scene.world[survey.line_start]
    problem = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool))
    blocks = problem.evaluate(scene.truth)

    assert (survey.length_m < np.linalg.norm(span, axis=1)).all()
    assert blocks is not None
    assert np.abs(blocks["lengths"].residual).max() < 1e-8
    np.testing.assert_allclose(blocks["tape"].residual, 10.0)


def test_only_tapes_of_lengths_that_take_part_have_an_unknown(scene_factory: Make) -> None:
    scene = read_on_tapes(scene_factory(5), {"a": 0.0, "b": 0.0, "c": 0.0}, sigma=0.001)
    used = np.arange(6) % 3 != 1

    assert SurveyProblem(scene.survey, scene.pivot, used).tapes == ("a", "c")
    exact = replace(scene.survey, tape_scale_sigma=0.0)
    problem = SurveyProblem(exact, scene.pivot, used)
    assert problem.tapes == ()
    assert problem.layout.tape == 0


def test_a_tape_may_have_a_prior_of_its_own(scene_factory: Make) -> None:
    scene = read_on_tapes(scene_factory(5, noise=0.0), {"a": 0.01, "b": 0.01}, sigma=0.001)
    survey = replace(scene.survey, own_scale_sigma=(("b", 0.002),))
    blocks = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool)).evaluate(scene.truth)
    assert blocks is not None
    np.testing.assert_allclose(blocks["tape"].residual.ravel(), [10.0, 5.0])

    exact = replace(survey, tape_scale_sigma=0.0)
    assert SurveyProblem(exact, scene.pivot, np.ones(6, dtype=bool)).tapes == ("b",)


def test_control_points_teach_the_scale_of_each_tape(scene_factory: Make) -> None:
    scene = scene_factory(6, frames=8, labels=12, lines=10, control=6, spread=25.0)
    scene = read_on_tapes(scene, {"": 0.004, "red": -0.006}, sigma=0.01)
    found = adjusted(scene)
    layout = found.problem.layout
    sigma = np.sqrt(np.diag(found.shared_covariance(layout.first_tape, layout.tape)))

    assert (sigma < 0.003).all()
    assert (np.abs(found.state.tape - scene.truth.tape) < 3.0 * sigma).all()
    # planted: a tape taken as exact puts its error into the residuals
    exact = adjusted(replace(scene, survey=replace(scene.survey, tape_scale_sigma=0.0)))
    assert exact.minimum.cost > found.minimum.cost + 5.0


def test_without_anything_else_the_scale_is_its_prior_and_in_every_sigma(
    scene_factory: Make,
) -> None:
    options = {"frames": 4, "lines": 8, "telemetry": False, "gauge": "plane", "heights": None}
    scene = read_on_tapes(scene_factory(8, **options), {"": 0.0}, sigma=0.004)
    found = adjusted(scene)
    exact = adjusted(replace(scene, survey=replace(scene.survey, tape_scale_sigma=0.0)))
    ends = np.arange(0, 8), np.arange(1, 9)
    plain = TapedLengths(*ends, ("?",) * 8, np.zeros(8, dtype=bool))

    def lengths(adjustment: Adjustment) -> tuple[np.ndarray, np.ndarray]:
        problem, state = adjustment.problem, adjustment.state
        length, gradient, columns = problem.lengths_between(state, *ends)
        return length, np.sqrt(adjustment.minimum.factor.variances(columns, gradient))

    (length, sigma), (_, without) = lengths(found), lengths(exact)
    at = found.problem.layout.first_tape
    assert found.state.tape[0] == pytest.approx(0.0, abs=1e-7)
    assert np.sqrt(found.shared_covariance(at, 1)[0, 0]) == pytest.approx(0.004, rel=1e-6)
    np.testing.assert_allclose(sigma, np.hypot(without, 0.004 * length), rtol=1e-3)
    # a check on a tape that no used length was read on errs by that tape's own scale too
    _, of_other = found.readings(plain)
    np.testing.assert_allclose(of_other, np.hypot(sigma, 0.004 * length), rtol=1e-6)
    # a check on the tape of the lengths knows nothing of the scale: it cancels
    _, of_same = found.readings(plain._replace(tape=("",) * 8))
    np.testing.assert_allclose(of_same, without, rtol=1e-3)


def test_a_level_length_on_a_slope_is_the_distance_in_the_horizontal_plane(
    scene_factory: Make,
) -> None:
    slope = np.tan(np.deg2rad(5.0))
    scene = scene_factory(9, frames=6, lines=8, noise=0.0, tilt=0.1)
    survey = scene.survey
    span = scene.world[survey.line_end] - scene.world[survey.line_start]
    world = scene.world + [0, 0, 1] * (slope * scene.world[:, :1])
    on_slope = np.linalg.norm(world[survey.line_end] - world[survey.line_start], axis=1)
    tilted = replace(scene, world=world, survey=replace(survey, length_m=on_slope))
    level = read_on_tapes(tilted, {"": 0.0}, sigma=0.001, along=("horizontal",)).survey

    np.testing.assert_allclose(level.length_m, np.hypot(span[:, 0], span[:, 1]), atol=1e-9)
    problem = SurveyProblem(level, scene.pivot, np.ones(8, dtype=bool))
    state = replace(
        scene.truth, plane=scene.truth.plane + np.array([0.0, slope, 0.0]), tape=np.zeros(1)
    )
    blocks = problem.evaluate(state)
    assert blocks is not None
    assert np.abs(blocks["lengths"].residual).max() < 1e-8
