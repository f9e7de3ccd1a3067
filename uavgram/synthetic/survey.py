"""Simulation of a complete survey: camera, poses, observations with errors, and its project."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Protocol

import numpy as np

from uavgram.config.strict_yaml import plain_settings, yaml_text
from uavgram.model import options
from uavgram.model.arrays import Bools, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import SimulatedLog
from uavgram.model.frames import Photos
from uavgram.model.observations import KnownLines, KnownPoints, MeasurementRequest, Picks
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import PosedFrames
from uavgram.synthetic.flight import draw_biases, make_flight_log, record_flight, simulate_motion
from uavgram.synthetic.observations import (
    MeanGenerator,
    compute_corner_rays,
    compute_pixels,
    draw_picks,
    draw_surveyed_points,
    draw_tape_readings,
    shows_horizon,
)
from uavgram.synthetic.scenario import PLATE_FAMILY, CameraSpec, Scenario
from uavgram.synthetic.truth import (
    SurveyTruth,
    compute_point_positions,
    compute_truth,
    draw_surface,
    draw_true_friction,
)


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


TIME_STEP_S = 0.001


def make_inputs(survey: SimulatedSurvey, *, noise: str | None = None) -> Inputs:
    """Return the survey in the form in which `read_inputs` reads the output of `write_demo`.

    Parameters
    ----------
    survey
        Of a scenario.
    noise
        Replaces `solve.noise` of the scenario.
    """
    count = len(survey.frame_id)
    camera = survey.calibration
    project = make_project(survey.scenario, noise)
    return Inputs(
        project_path="project.yaml",
        project=project,
        calibration=camera,
        photos=Photos(
            frame_id=survey.frame_id,
            path=tuple(f"photos/{name}" for name in survey.frame_id),
            width_px=np.full(count, float(camera.width_px)),
            height_px=np.full(count, float(camera.height_px)),
            file_time_s=survey.file_time_utc_s,
            file_time_resolution_s=np.full(count, TIME_STEP_S),
            time_source="exif",
        ),
        picks=survey.picks,
        lines=survey.lines,
        requests=survey.measurements,
        control=survey.control,
        check=survey.checks,
        log=None if project.log is None else make_flight_log(survey.log),
        poses=None,
        digests=(),
        messages=(),
    )


def make_project(scenario: Scenario, noise: str | None = None) -> options.Project:
    """Return the project of a simulated survey, with the scenario's stated sigmas.

    Parameters
    ----------
    scenario
        Of the survey.
    noise
        Replaces `solve.noise` of the scenario.
    """
    stated, errors, plates = scenario.stated, scenario.errors, scenario.plates
    return options.Project(
        name=scenario.name,
        images=("photos/*.jpg",),
        log=None if scenario.telemetry == "none" else "flight.tlog",
        camera="camera.yaml",
        picks="picks.csv",
        lines="lines.csv",
        measure="measure.csv",
        control="control.csv" if scenario.control else None,
        check="check.csv",
        ground=options.GroundOptions(
            height_sigma_m=stated.ground_height_sigma_m,
            slope_sigma_deg=stated.ground_slope_sigma_deg,
            roughness_sigma_m=stated.roughness_sigma_m,
        ),
        mount=options.MountOptions(
            boresight_sigma_deg=stated.boresight_sigma_deg,
            lever_arm_m=errors.lever_arm_m,
            lever_arm_sigma_m=stated.lever_arm_sigma_m,
        ),
        time=options.TimeOptions(
            offset_s="auto" if scenario.flight.tells_clock else errors.camera_clock_offset_s,
            offset_sigma_s=stated.clock_sigma_s,
        ),
        telemetry=options.TelemetryOptions(
            position_sigma_m=_pair(stated.position_sigma_m),
            attitude_sigma_deg=_pair(stated.attitude_sigma_deg),
            position_bias_sigma_m=stated.position_bias_sigma_m,
            heading_bias_sigma_deg=stated.heading_bias_sigma_deg,
        ),
        picks_sigma_px=errors.pick_px,
        picks_identification_sigma_m=stated.picks_identification_sigma_m,
        solve=options.SolveOptions(
            outliers=stated.outliers, noise="stated" if noise == "stated" else stated.noise
        ),
        tape=options.TapeOptions(scale_sigma=stated.tape_scale_sigma),
        targets=options.TargetOptions(
            family=PLATE_FAMILY, side_m=plates.side_m, sigma_m=plates.sigma_m
        )
        if plates.at
        else None,
    )


def _pair(stated: tuple[float, ...]) -> tuple[float, float] | Literal["auto"]:
    """Return two sigmas, or ``auto``."""
    return (stated[0], stated[1]) if stated else "auto"


ABOUT = "# A simulated survey of a road accident; truth.json has the true values."
REMARKS = {
    "lines": 'taped lengths; the one of use "check" is withheld',
    "check": "surveyed points, only to judge the result",
    "ground": "a plane, a little below the place of take-off; leave its roughness out for a road",
    "picks_identification_sigma_m": "nothing is picked beside; leave this out for photos",
}
"""Remarks on keys of the project file."""


def format_project(project: options.Project, about: str = ABOUT) -> str:
    """Return the text of a project file, without the options that have their default values.

    Parameters
    ----------
    project
        What it states.
    about
        First line, a comment.
    """
    rows = [about, *yaml_text(plain_settings(project)).splitlines()]
    remarks = (REMARKS.get(row.partition(":")[0]) for row in rows)
    return "".join(
        f"{row}  # {remark}\n" if remark else f"{row}\n"
        for row, remark in zip(rows, remarks, strict=True)
    )


class DrawnSurvey(NamedTuple):
    """One draw: content of a project, and the true values of its measurements.

    `posed` are the frames where no log has to be read for them; `name`, `unit` (M,) and `true` (M,)
    are of the values.
    """

    inputs: Inputs
    posed: PosedFrames | None
    name: tuple[str, ...]
    unit: tuple[str, ...]
    true: Floats


class World(Protocol):
    """Survey that can be repeated."""

    def draw(self, number: int) -> DrawnSurvey:
        """Return one repetition; the same number gives the same one."""

    def exact(self) -> DrawnSurvey:
        """Return the survey without any error, with its sigmas as stated."""

    def get_name_and_seed(self) -> tuple[str, int]:
        """Return name and seed."""


@dataclass(frozen=True)
class ScenarioWorld:
    """Repetitions of a scenario with a camera of its own, or with one from a file."""

    scenario: Scenario
    calibration: Calibration | None = None

    def draw(self, number: int) -> DrawnSurvey:
        """Return one repetition; the same number gives the same one."""
        return _draw(simulate(self.scenario, self.calibration, repetition=number))

    def exact(self) -> DrawnSurvey:
        """Return the survey without any error, with its sigmas as stated."""
        return _draw(simulate(self.scenario, self.calibration, exact=True), noise="stated")

    def get_name_and_seed(self) -> tuple[str, int]:
        """Return name and seed."""
        return self.scenario.name, self.scenario.seed


def _draw(survey: SimulatedSurvey, noise: str | None = None) -> DrawnSurvey:
    truth = survey.truth
    names = truth.measurement_name, truth.measurement_unit
    return DrawnSurvey(make_inputs(survey, noise=noise), None, *names, truth.measurement_value)
