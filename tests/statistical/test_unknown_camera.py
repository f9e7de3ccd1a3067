"""Surveys by a camera that nobody knows: is what is measured as uncertain as is said?

Every scene has another camera: its focal length drawn as those of ordinary drones are spread, its
distortion taken from the table of drone cameras, which the assumed one knows nothing of. Where the
second-order check says that first order is not enough, it is believed.

The environment raises the number of scenes:

    UAVGRAM_REPETITIONS=200 pytest tests/statistical/test_unknown_camera.py
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
import random_scenes
import scenes
from random_scenes import MEASURED, Kind, random_scene
from scenes import NO_TIMES, Scene
from scipy.spatial.transform import Rotation
from scipy.stats import binom, norm

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.measuring.second_order import compute_curvature
from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.camera.lens import largest_radius
from uavgram.geometry.ground import measurements
from uavgram.io.cameras import read_drone_cameras
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, CameraTags
from uavgram.model.frames import Poses
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.camera import assume_camera
from uavgram.stages.measure import MAX_BIAS_SIGMAS, MAX_SIGMA_DIFFERENCE
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

SCENES = max(24, int(os.environ.get("UAVGRAM_REPETITIONS", "0")))
TAIL = 0.001
STRONGEST = 1.0
"""Of k1 and k2: beyond are tele lenses, and no wide ones."""
CORNER_PX = 1250
SEED_SIGMA = np.array([1.0, 1.0, 1.5, 0.03, 0.03, 0.04])

KINDS = {
    "a log, and lengths in half": Kind(
        sources=None, telemetry=("good", "poor"), log=True, bare=0.5
    ),
    "several photos, no log": Kind(sources=None, telemetry=("absent",), frames=(2, 3, 4, 5)),
    "one photo, eight lengths": Kind(
        sources=None, telemetry=("absent",), frames=(1,), lines=(8, 10)
    ),
}
DISTANCE = (
    MeasurementRequest(
        name="distance", kind="distance", points=tuple(f"P{label}" for label in MEASURED)
    ),
)


class Cameras:
    """Stands in the place of a root of the covariance: gives errors of cameras as they are."""

    def __init__(self, assumed: Calibration) -> None:
        self._assumed = assumed
        self._share = np.sqrt(assumed.covariance[0, 0]) / assumed.parameters[0]
        self._lenses = [
            camera.distortion
            for camera in read_drone_cameras()
            if camera.is_perspective
            and not camera.is_thermal
            and 0 < np.abs(camera.distortion[:2]).max() < STRONGEST
        ]

    def __rmul__(self, _: float) -> Cameras:
        return self

    def __matmul__(self, draw: Floats) -> Floats:
        mean = self._assumed.parameters
        focal = mean[0] * np.exp(self._share * draw[0])
        squareness = np.array([1.0, 1.0 + 0.003 * draw[1]])
        first = int(len(self._lenses) * norm.cdf(draw[4]))
        for lens in self._lenses[first:] + self._lenses[:first]:
            true = np.array([*focal * squareness, *(mean[2:4] + 20 * draw[2:4]), *lens])
            if largest_radius("brown", true) > 1.15 * CORNER_PX / focal:
                error: Floats = true - mean
                return error
        raise AssertionError


@pytest.fixture
def _unknown_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    tags = CameraTags(path="", width_px=2000, height_px=1500)
    assumed, _ = assume_camera(tags, read_drone_cameras(), may_be_unknown=True)
    monkeypatch.setattr(scenes, "INTRINSICS", assumed.parameters)
    monkeypatch.setattr(random_scenes, "CALIBRATION_COVARIANCE", assumed.covariance)
    monkeypatch.setattr(random_scenes, "CALIBRATION_ROOT", Cameras(assumed))


def with_seeds(scene: Scene, rng: np.random.Generator) -> Survey:
    """What the log says of the poses before the adjustment."""
    survey, truth = scene.survey, scene.truth
    if survey.telemetry is None:
        return survey
    frames = len(survey.frame_id)
    error = SEED_SIGMA * (rng.normal(size=6) + 0.3 * rng.normal(size=(frames, 6)))
    turn = Rotation.from_rotvec(error[:, 3:]).as_matrix()
    seeds = Poses(
        frame_id=survey.frame_id,
        center_world_m=truth.center + error[:, :3],
        world_from_camera=truth.rotation @ turn,
        covariance=np.tile(np.diag(1.1 * SEED_SIGMA**2), (frames, 1, 1)),
    )
    return replace(survey, seeds=seeds)


def error_of(scene: Scene, refined: Refined) -> tuple[float, bool]:
    """Error of the distance in sigmas, and whether first order is enough for it."""
    adjustment = refined.adjustment
    measured = propagate(adjustment, DISTANCE, NO_TIMES)
    terms = compute_curvature(adjustment, measured, NO_TIMES)
    enough = abs(terms.sigma[0] / measured.sigma[0] - 1.0) <= MAX_SIGMA_DIFFERENCE
    enough &= abs(terms.bias[0] / measured.sigma[0]) <= MAX_BIAS_SIGMAS
    world, _ = adjustment.joint_points(np.array(MEASURED))
    value, _ = measurements.distance(world)
    true = np.linalg.norm(np.subtract(*scene.world[list(MEASURED)]))
    return (value - true) / measured.sigma[0], bool(enough)


@pytest.mark.usefixtures("_unknown_cameras")
@pytest.mark.parametrize("kind", KINDS)
def test_lengths_lie_within_their_sigmas_or_the_second_order_speaks(kind: str) -> None:
    errors = []
    for trial in range(SCENES):
        scene = random_scene((31, trial), KINDS[kind])
        refined, messages = refine(with_seeds(scene, np.random.default_rng(trial)), SolveOptions())
        assert "not-converged" not in {message.code for message in messages}, trial
        error, enough = error_of(scene, refined)
        if enough:
            errors.append(abs(error))

    assert len(errors) > 0.4 * SCENES
    for sigmas in (1, 2, 3):
        share = 2 * norm.cdf(sigmas) - 1
        inside = int(np.sum(np.array(errors) <= sigmas))
        assert inside >= binom.ppf(TAIL, len(errors), share), (sigmas, sorted(errors)[-5:])
