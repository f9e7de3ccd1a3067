"""Project of a synthetic survey: as inputs without files, and as text of its file."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal, NamedTuple, Protocol

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.frames import Photos
from uavgram.model.limits import number_text
from uavgram.model.options import (
    GroundOptions,
    MountOptions,
    Project,
    SolveOptions,
    TapeOptions,
    TargetOptions,
    TelemetryOptions,
    TimeOptions,
)
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import PosedFrames
from uavgram.synthetic.autopilot import make_flight_log
from uavgram.synthetic.scenario import PLATE_FAMILY, Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate

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


def make_project(scenario: Scenario, noise: str | None = None) -> Project:
    """Return the project of a simulated survey, with the scenario's stated sigmas.

    Parameters
    ----------
    scenario
        Of the survey.
    noise
        Replaces `solve.noise` of the scenario.
    """
    stated, errors, plates = scenario.stated, scenario.errors, scenario.plates
    return Project(
        name=scenario.name,
        images=("photos/*.jpg",),
        log=None if scenario.telemetry == "none" else "flight.tlog",
        camera="camera.yaml",
        picks="picks.csv",
        lines="lines.csv",
        measure="measure.csv",
        control="control.csv" if scenario.control else None,
        check="check.csv",
        ground=GroundOptions(
            height_sigma_m=stated.ground_height_sigma_m,
            slope_sigma_deg=stated.ground_slope_sigma_deg,
            roughness_sigma_m=stated.roughness_sigma_m,
        ),
        mount=MountOptions(
            boresight_sigma_deg=stated.boresight_sigma_deg,
            lever_arm_m=errors.lever_arm_m,
            lever_arm_sigma_m=stated.lever_arm_sigma_m,
        ),
        time=TimeOptions(
            offset_s="auto" if scenario.flight.tells_clock else errors.camera_clock_offset_s,
            offset_sigma_s=stated.clock_sigma_s,
        ),
        telemetry=TelemetryOptions(
            position_sigma_m=_pair(stated.position_sigma_m),
            attitude_sigma_deg=_pair(stated.attitude_sigma_deg),
            position_bias_sigma_m=stated.position_bias_sigma_m,
            heading_bias_sigma_deg=stated.heading_bias_sigma_deg,
        ),
        picks_sigma_px=errors.pick_px,
        picks_identification_sigma_m=stated.picks_identification_sigma_m,
        solve=SolveOptions(
            outliers=stated.outliers, noise="stated" if noise == "stated" else stated.noise
        ),
        tape=TapeOptions(scale_sigma=stated.tape_scale_sigma),
        targets=TargetOptions(family=PLATE_FAMILY, side_m=plates.side_m, sigma_m=plates.sigma_m)
        if plates.at
        else None,
    )


def _pair(stated: tuple[float, ...]) -> tuple[float, float] | Literal["auto"]:
    """Return two sigmas, or ``auto``."""
    return (stated[0], stated[1]) if stated else "auto"


def format_project(survey: SimulatedSurvey) -> str:
    """Return the text of the project file, with a comment on its first line.

    Parameters
    ----------
    survey
        Whose scenario it states.
    """
    errors, stated = survey.scenario.errors, survey.scenario.stated
    arm = ", ".join(number_text(v) for v in errors.lever_arm_m)
    height = number_text(stated.ground_height_sigma_m)
    beside = number_text(stated.picks_identification_sigma_m)
    rough = number_text(stated.roughness_sigma_m)
    text = f"""\
# A simulated survey of a road accident; truth.json has the true values.
name: {survey.scenario.name}
images: photos/*.jpg
log: flight.tlog
camera: camera.yaml
picks: picks.csv
lines: lines.csv           # taped lengths; the one of use "check" is withheld
measure: measure.csv
check: check.csv           # surveyed points, only to judge the result
output: out
ground:
  height_sigma_m: {height}      # the scene is a little below the place of take-off
  roughness_sigma_m: {rough}     # it is a plane; leave this out for a road
mount:
  gimbal: auto             # the log has the gimbal's attitude
  boresight_sigma_deg: {number_text(stated.boresight_sigma_deg)}
  lever_arm_m: [{arm}]
  lever_arm_sigma_m: {number_text(stated.lever_arm_sigma_m)}
time:
  offset_s: auto           # the camera's clock is wrong; the log's camera events show by how much
  offset_sigma_s: {number_text(stated.clock_sigma_s)}
picks_sigma_px: {number_text(errors.pick_px)}
picks_identification_sigma_m: {beside}  # nothing is picked beside; leave this out for photos
"""
    return _adapt_text(text, survey.scenario)


def _adapt_text(text: str, scenario: Scenario) -> str:
    """Adapt the demo's project text to the differences of another scenario."""
    errors = scenario.errors
    if scenario.telemetry == "none":
        text = text.replace("log: flight.tlog\n", "")
    if not scenario.flight.tells_clock:
        told = number_text(errors.camera_clock_offset_s)
        lines = text.splitlines()
        at = next(i for i, line in enumerate(lines) if line.startswith("  offset_s: "))
        lines[at] = f"  offset_s: {told}            # camera clock minus UTC"
        text = "\n".join([*lines, ""])
    if scenario.plates.at:
        side, sigma = map(number_text, (scenario.plates.side_m, scenario.plates.sigma_m))
        text += f"targets: {{family: {PLATE_FAMILY}, side_m: {side}, sigma_m: {sigma}}}\n"
    if scenario.control:
        text = text.replace("check: check.csv", "control: control.csv\ncheck: check.csv")
    own, demo = make_project(scenario), make_project(Scenario())
    for section in ("ground", "telemetry", "tape", "solve"):
        here, there = getattr(own, section), getattr(demo, section)
        rows = [
            f"  {one.name}: {_yaml(value)}\n"
            for one in fields(here)
            if (value := getattr(here, one.name)) != getattr(there, one.name)
            and f"  {one.name}: " not in text
        ]
        head = f"{section}:\n"
        if rows:
            text = text if head in text else text + head
            text = text.replace(head, head + "".join(rows))
    return text


def _yaml(value: str | float | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(number_text, value))}]"
    return value if isinstance(value, str) else number_text(value)


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

    def drawn(self, number: int) -> DrawnSurvey:
        """Return one repetition; the same number gives the same one."""

    def exact(self) -> DrawnSurvey:
        """Return the survey without any error, with its sigmas as stated."""

    def named(self) -> tuple[str, int]:
        """Return name and seed."""


@dataclass(frozen=True)
class ScenarioWorld:
    """Repetitions of a scenario with a camera of its own, or with one from a file."""

    scenario: Scenario
    calibration: Calibration | None = None

    def drawn(self, number: int) -> DrawnSurvey:
        """Return one repetition; the same number gives the same one."""
        survey = simulate(self.scenario, self.calibration, repetition=number)
        truth = survey.truth
        return DrawnSurvey(
            make_inputs(survey),
            None,
            truth.measurement_name,
            truth.measurement_unit,
            truth.measurement_value,
        )

    def exact(self) -> DrawnSurvey:
        """Return the survey without any error, with its sigmas as stated."""
        survey = simulate(self.scenario, self.calibration, exact=True)
        truth = survey.truth
        return DrawnSurvey(
            make_inputs(survey, noise="stated"),
            None,
            truth.measurement_name,
            truth.measurement_unit,
            truth.measurement_value,
        )

    def named(self) -> tuple[str, int]:
        """Return name and seed."""
        return self.scenario.name, self.scenario.seed
