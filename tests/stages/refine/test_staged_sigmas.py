"""Strips without a log whose camera is hardly known: from any focal length to the same minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import Scene

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.survey.observed import Observations
from uavgram.estimation.survey.unknowns import State
from uavgram.io.cameras import read_drone_cameras
from uavgram.model.camera import CameraTags
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.assemble import assemble
from uavgram.stages.camera import assume_camera
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.staged_sigmas import approach_minimum

TOO_WIDE = 22.0 / 25.9
"""A camera of 22 mm in the place of an ordinary one; the twins have 26 mm."""


@pytest.fixture(scope="module")
def strip(data_dir: Path) -> Callable[..., Survey]:
    """``strip(share)``: a twin's photos without their log, the focal length that far off."""
    inputs = read_inputs(data_dir / "wind_oblique" / "project.yaml")
    tags = CameraTags(path="", width_px=3000, height_px=2250)
    camera, _ = assume_camera(tags, read_drone_cameras(), may_be_unknown=True)

    def make(share: float = 1.0) -> Survey:
        parameters, covariance = np.array(camera.parameters), np.array(camera.covariance)
        parameters[:2] *= share
        covariance[:2, :2] *= share**2
        wrong = replace(camera, parameters=parameters, covariance=covariance)
        ground = inputs.project.ground
        observed = Observations(
            calibration=wrong,
            picks=inputs.picks,
            lines=inputs.lines,
            ground=ground,
            picks_sigma_px=0.8,
        )
        return assemble(observed).survey

    return make


def adjusted(survey: Survey) -> Minimum[State]:
    every, no_line = np.ones(len(survey.pick_frame), bool), np.zeros(len(survey.line_start), bool)
    return find_best_minima(Participants(survey, every, no_line, {})).adjustment.minimum


@pytest.mark.parametrize("share", [TOO_WIDE, 24.0 / 25.9, 1.2])
def test_a_wrong_focal_length_leads_to_the_same_minimum(
    strip: Callable[..., Survey], share: float
) -> None:
    right, other = adjusted(strip()), adjusted(strip(share))

    assert right.converged
    assert other.converged
    # But for the focal length's own prior, at most a few sigmas squared.
    assert other.cost == pytest.approx(right.cost, abs=4)


def test_first_values_stay_as_they_are_without_matches_and_free_heights(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(1, telemetry=False, gauge="plane")
    used = np.ones(len(scene.survey.line_start), bool)
    poor = np.array(scene.survey.calibration.covariance)
    poor[0, 0] = poor[1, 1] = (0.2 * scene.survey.calibration.parameters[0]) ** 2
    camera = replace(scene.survey.calibration, covariance=poor)
    softened = replace(scene.survey, calibration=camera)

    assert camera.is_poorly_known
    assert not scene.survey.calibration.is_poorly_known
    for survey in (scene.survey, softened):
        assert approach_minimum(survey, scene.truth, scene.pivot, used) is scene.truth
