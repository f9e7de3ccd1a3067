"""A whole simulated survey: true camera, true poses, and what people pick and tape of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.camera.calibration import Calibration
from uavgram.model.scenario.scenario import CameraSpec, Scenario
from uavgram.model.scenario.simulated import SimulatedSurvey
from uavgram.stages.simulate.motion import fly
from uavgram.stages.simulate.observe import pick, seen_pixels, survey_points, tape
from uavgram.stages.simulate.quantities import with_true_friction
from uavgram.stages.simulate.recording import draw_biases, record
from uavgram.stages.simulate.still import Still
from uavgram.stages.simulate.surface import draw_surface, point_positions
from uavgram.stages.simulate.truth import survey_truth

FILE_STEP_S = 0.001  # three sub-second digits


class _Streams(NamedTuple):
    """One for each kind of error: another number of points leaves the flight as it was."""

    motion: np.random.Generator
    biases: np.random.Generator
    log: np.random.Generator
    camera: np.random.Generator
    people: np.random.Generator
    road: np.random.Generator
    ground: np.random.Generator
    habits: np.random.Generator


def simulate(
    scenario: Scenario,
    calibration: Calibration | None = None,
    *,
    repetition: int | None = None,
    exact: bool = False,
) -> SimulatedSurvey:
    """Simulate a survey: the same scenario gives the same survey.

    Parameters
    ----------
    scenario
        Every number that defines it, seed included.
    calibration
        Of its camera, where that comes from a file; else the scenario's own.
    repetition
        Number of one of many draws of the same scenario; None: the scenario's own draw.
    exact
        Whether nothing but the flight is drawn: what is observed is what it is expected to be.

    Returns
    -------
    What the survey's files will say, and the truth behind them.
    """
    draw = _streams(scenario.seed, repetition)
    if exact:
        draw = _Streams(draw.motion, *(Still() for _ in _Streams._fields[1:]))
    motion = fly(scenario.flight, scenario.site, draw.motion)
    biases = draw_biases(scenario, draw.biases)
    log = record(scenario, motion, biases, draw.log)
    calibration = calibration or calibration_of(scenario.camera)
    intrinsics = draw.camera.multivariate_normal(calibration.parameters, calibration.covariance)
    intrinsics[:2] *= 1.0 + scenario.habits.focal_wrong
    lost = scenario.lost_exposure
    stored = np.arange(len(motion.exposure_time_s)) != (-1 if lost is None else lost)
    requests = with_true_friction(scenario.measurements, draw.road)
    surface = draw_surface(scenario, draw.ground)
    ground = surface, point_positions(scenario, surface, draw.ground)
    truth = survey_truth(scenario, requests, (motion, biases), ground, intrinsics, stored)
    errors = scenario.errors
    jitter = errors.exif_jitter_s * draw.people.standard_normal(len(truth.frame_id))
    file_time = truth.time_utc_s + errors.camera_clock_offset_s + jitter
    if not scenario.flight.tells_clock:
        file_time += scenario.stated.clock_sigma_s * draw.habits.standard_normal()
    lines = tape(scenario, truth, (draw.people, draw.habits))
    checked = [i for i, point in enumerate(scenario.points) if point.mark == "disc"]
    check_noise = errors.check_m * draw.people.standard_normal((len(checked), 3))
    used = [truth.label.index(label) for label in scenario.control]
    control_noise = errors.control_m * draw.habits.standard_normal((len(used), 3))
    seen = seen_pixels(scenario, calibration, truth, surface, draw.habits)
    return SimulatedSurvey(
        scenario=scenario,
        calibration=calibration,
        frame_id=truth.frame_id,
        file_time_utc_s=np.round(file_time / FILE_STEP_S) * FILE_STEP_S,
        event_has_photo=stored,
        log=log,
        picks=pick(scenario, calibration, truth, seen, (draw.people, draw.habits)),
        lines=lines,
        checks=survey_points(truth, checked, check_noise, errors.check_m),
        control=survey_points(truth, used, control_noise, errors.control_m),
        measurements=scenario.measurements,
        truth=truth,
    )


def _streams(seed: int, repetition: int | None) -> _Streams:
    entropy = seed if repetition is None else [seed, repetition]
    spawned = np.random.SeedSequence(entropy).spawn(len(_Streams._fields))
    return _Streams(*map(np.random.default_rng, spawned))


def calibration_of(camera: CameraSpec) -> Calibration:
    """Calibration as the survey's camera.yaml states it."""
    sigma = np.array(camera.sigma)
    correlation = np.eye(len(sigma))
    correlation[0, 1] = correlation[1, 0] = camera.focal_correlation
    return Calibration(
        name=camera.name,
        model="brown",
        width_px=camera.width_px,
        height_px=camera.height_px,
        parameters=np.array(camera.parameters),
        covariance=correlation * np.outer(sigma, sigma),
    )
