"""Simulation of a complete survey: true camera, true poses, observations with their errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import SimulatedLog
from uavgram.model.observations import KnownLines, KnownPoints, MeasurementRequest, Picks
from uavgram.synthetic.autopilot import draw_biases, record_flight
from uavgram.synthetic.flight import simulate_motion
from uavgram.synthetic.observe import (
    MeanGenerator,
    compute_pixels,
    draw_picks,
    draw_surveyed_points,
    draw_tape_readings,
)
from uavgram.synthetic.quantities import draw_true_friction
from uavgram.synthetic.scenario import CameraSpec, Scenario
from uavgram.synthetic.scene import compute_point_positions, draw_surface
from uavgram.synthetic.sight import compute_corner_rays, shows_horizon
from uavgram.synthetic.truth import SurveyTruth, compute_truth


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSurvey(FrozenArrays):
    """Content of all files of the survey, and the truth.

    Attributes
    ----------
    scenario
        Scenario from which it was made.
    calibration
        The camera as calibrated, not the true one.
    frame_id, file_time_utc_s
        (F,) of the stored photos: names, and the camera clock's reading without its zone.
    event_has_photo
        (E,) whether the log's exposure became a photo.
    log, picks, lines, checks, measurements, control
        Content of the files of those names.
    truth
        The true values.
    """

    scenario: Scenario
    calibration: Calibration
    frame_id: Annotated[tuple[str, ...], "n"]
    file_time_utc_s: Annotated[Floats, "n"]
    event_has_photo: Annotated[Bools, "e"]
    log: SimulatedLog
    picks: Picks
    lines: KnownLines
    checks: KnownPoints
    control: KnownPoints
    measurements: tuple[MeasurementRequest, ...]
    truth: SurveyTruth


FILE_TIME_STEP_S = 0.001  # three sub-second digits


class _Streams(NamedTuple):
    """One random stream for each kind of error: more points leave the flight unchanged."""

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
        Whether only the flight is drawn: observations then equal their expected values.

    Returns
    -------
    Content of the survey's files, and the truth behind them.
    """
    draw = _streams(scenario.seed, repetition)
    if exact:
        draw = _Streams(draw.motion, *(MeanGenerator() for _ in _Streams._fields[1:]))
    # true flight and its log
    motion = simulate_motion(scenario.flight, scenario.site, draw.motion)
    biases = draw_biases(scenario, draw.biases)
    log = record_flight(scenario, motion, biases, draw.log)
    calibration = calibration or make_calibration(scenario.camera)
    # true camera, drawn from its calibration
    intrinsics = draw.camera.multivariate_normal(calibration.parameters, calibration.covariance)
    intrinsics[:2] *= 1.0 + scenario.habits.focal_wrong
    lost = scenario.lost_exposure
    stored = np.arange(len(motion.exposure_time_s)) != (-1 if lost is None else lost)
    requests = draw_true_friction(scenario.measurements, draw.road)
    # true ground and points
    surface = draw_surface(scenario, draw.ground)
    ground = surface, compute_point_positions(scenario, surface, draw.ground)
    truth = compute_truth(scenario, requests, (motion, biases), ground, intrinsics, stored)
    errors = scenario.errors
    # readings of the camera clock
    jitter = errors.exif_jitter_s * draw.people.standard_normal(len(truth.frame_id))
    file_time = truth.time_utc_s + errors.camera_clock_offset_s + jitter
    if not scenario.flight.tells_clock:
        file_time += scenario.stated.clock_sigma_s * draw.habits.standard_normal()
    # observations of people
    lines = draw_tape_readings(scenario, truth, (draw.people, draw.habits))
    checked = [i for i, point in enumerate(scenario.points) if point.mark == "disc"]
    check_noise = errors.check_m * draw.people.standard_normal((len(checked), 3))
    used = [truth.label.index(label) for label in scenario.control]
    control_noise = errors.control_m * draw.habits.standard_normal((len(used), 3))
    seen = compute_pixels(scenario, calibration, truth, surface, draw.habits)
    return SimulatedSurvey(
        scenario=scenario,
        calibration=calibration,
        frame_id=truth.frame_id,
        file_time_utc_s=np.round(file_time / FILE_TIME_STEP_S) * FILE_TIME_STEP_S,
        event_has_photo=stored,
        log=log,
        picks=draw_picks(scenario, calibration, truth, seen, (draw.people, draw.habits)),
        lines=lines,
        checks=draw_surveyed_points(truth, checked, check_noise, errors.check_m),
        control=draw_surveyed_points(truth, used, control_noise, errors.control_m),
        measurements=scenario.measurements,
        truth=truth,
    )


def _streams(seed: int, repetition: int | None) -> _Streams:
    entropy = seed if repetition is None else [seed, repetition]
    spawned = np.random.SeedSequence(entropy).spawn(len(_Streams._fields))
    return _Streams(*map(np.random.default_rng, spawned))


def make_calibration(camera: CameraSpec) -> Calibration:
    """Return the calibration in the survey's camera.yaml."""
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


class SenselessKey(NamedTuple):
    """A key of the scenario, from its root, and its fault."""

    key: tuple[str | int, ...]
    text: str


def find_senseless(survey: SimulatedSurvey) -> Iterator[SenselessKey]:
    """Find senseless values in a survey without errors.

    Parameters
    ----------
    survey
        Result of `simulate` with `exact`.
    """
    scenario, truth = survey.scenario, survey.truth
    offset = truth.center_world_m[:, :2] - truth.surface.middle_m
    ground_m = truth.surface.height_m + offset @ truth.surface.slope
    for i in np.flatnonzero(truth.center_world_m[:, 2] <= ground_m + 1.0)[:1].tolist():
        above = float(truth.center_world_m[i, 2] - ground_m[i])
        text = (
            f"{'is below' if above <= 0 else 'is hardly above'} the ground: the camera of photo "
            f"{i + 1} would be {above:.1f} m above it. Fly higher (heights are above home; the "
            f"ground there is at {ground_m[i]:.1f} m)"
        )
        yield SenselessKey(_find_photo_key(scenario, i, "height_m"), text)
        return
    ray = compute_corner_rays(survey.calibration, truth.intrinsics, truth.world_from_camera)
    for i in np.flatnonzero(shows_horizon(ray, np.zeros(2)))[:1].tolist():
        text = (
            f"photo {i + 1} would show the horizon, and nothing can be measured near it: tilt the "
            "camera further down (-90 is straight down)"
        )
        yield SenselessKey(_find_photo_key(scenario, i, "gimbal_pitch_deg"), text)
        return
    yield from _find_unseen(survey)


def _find_photo_key(scenario: Scenario, photo: int, key: str) -> tuple[str | int, ...]:
    """Return the key that defines the position of a photo, or its orientation."""
    plan = scenario.flight
    if plan.pattern == "poses":
        return "flight", "poses", photo, {"gimbal_pitch_deg": "pitch_deg"}.get(key, key)
    if plan.pattern == "orbit" and key == "gimbal_pitch_deg":
        return "flight", "radius_m"
    return "flight", key


def _find_unseen(survey: SimulatedSurvey) -> Iterator[SenselessKey]:
    """Find lengths and measurements whose points are in no photo."""
    scenario, seen = survey.scenario, set(survey.picks.label)
    if not seen:
        text = "no photo shows any of them: fly over the scene, whose middle is x 0, y 0"
        yield SenselessKey(("points",), text)
        return
    used = [line for line in scenario.lines if line.use == "adjust"]
    shown = [line for line in used if {line.start, line.end} <= seen]
    if used and not shown:
        text = f"no line is in view: no photo shows both ends of {used[0].name!r}" + (
            "" if len(used) == 1 else f", nor of the {len(used) - 1} others"
        )
        yield SenselessKey(("lines",), f"{text}. Lay them where the photos look, or fly over them")
    plates = seen.intersection(scenario.plates.labels)
    if not shown and not plates and scenario.telemetry == "none" and len(scenario.control) < 2:
        text = (
            "is none, and there is no length, plate or control point in view: the scale is "
            "unknown. Give lines, plates, control or a log"
        )
        yield SenselessKey(("telemetry",), text)
    if not any(set(one.points) <= seen for one in scenario.measurements):
        text = "no photo shows all points of any of them: there is nothing to repeat"
        yield SenselessKey(("measurements",), text)
