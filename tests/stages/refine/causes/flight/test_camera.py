"""Photos of another zoom than the calibration's."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine import refine


def stated_zoom(scene: Scene, factor: float) -> Survey:
    """The survey with a camera file of another zoom."""
    parameters: Floats = scene.survey.calibration.parameters * np.array([factor] * 2 + [1.0] * 7)
    return replace(
        scene.survey, calibration=replace(scene.survey.calibration, parameters=parameters)
    )


@pytest.mark.parametrize("factor", [0.75, 1.1, 1.3])
def test_another_zoom_is_said_and_distances_are_right(factor: float) -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    refined, messages = refine(stated_zoom(scene, factor), SolveOptions())
    assert "other-zoom" in [message.code for message in messages]
    adjustment = refined.adjustment
    problem, layout = adjustment.problem, adjustment.problem.layout
    focal = problem.intrinsics(adjustment.state)[0]
    basis = problem.intrinsic_basis[0]
    variance = basis @ adjustment.shared(layout.first_intrinsic, layout.intrinsics) @ basis
    true = scene.survey.calibration.parameters[0]
    assert abs(focal - true) < 3.0 * np.sqrt(variance)
    start, end = (adjustment.label_rows([label]) for label in ("P0", "P7"))
    length, gradient, unknowns = adjustment.problem.lengths_between(adjustment.state, start, end)
    sigma = np.sqrt(adjustment.minimum.factor.variances(unknowns, gradient))
    error = length - np.linalg.norm(scene.world[0] - scene.world[7])
    assert np.abs(error / sigma).max() < 3.5


@pytest.mark.parametrize("seed", range(4))
def test_a_camera_that_fits_is_believed(seed: int) -> None:
    scene = make_scene(seed, frames=8, labels=24, lines=8)
    refined, messages = refine(scene.survey, SolveOptions())
    assert "other-zoom" not in [message.code for message in messages]
    given = refined.adjustment.survey.calibration.covariance
    assert (given == scene.survey.calibration.covariance).all()


def test_labels_in_disorder_are_no_other_zoom() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    label = scene.survey.pick_label.copy()
    rows = np.flatnonzero(scene.survey.pick_frame == 2)
    label[rows] = np.roll(label[rows], 1)
    _, messages = refine(replace(scene.survey, pick_label=label), SolveOptions())
    assert "other-zoom" not in [message.code for message in messages]


def test_stated_sigmas_stay_stated() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    refined, messages = refine(stated_zoom(scene, 1.3), SolveOptions(noise="stated"))
    (message,) = [message for message in messages if message.code == "other-zoom"]
    assert "into account" not in message.text
    given = refined.adjustment.survey.calibration.covariance
    assert (given == scene.survey.calibration.covariance).all()


def test_a_file_with_another_middle_is_told_with_what_it_should_say() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    stated = scene.survey.calibration
    moved: Floats = stated.parameters + np.array([0.0, 0.0, 200.0, -150.0] + [0.0] * 5)
    survey = replace(scene.survey, calibration=replace(stated, parameters=moved))
    refined, messages = refine(survey, SolveOptions())
    (message,) = [message for message in messages if message.level != "info"]
    assert message.code == "camera-contradicted"
    adjustment = refined.adjustment
    found = adjustment.problem.intrinsics(adjustment.state)[2:4]
    assert np.abs(found - stated.parameters[2:4]).max() < 60.0
    assert f"cx {found[0]:.0f} ±" in message.text
