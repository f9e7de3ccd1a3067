"""A synthetic survey as the inputs of a project, without any file."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.model.flight.frames import Photos
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
from uavgram.synthetic.autopilot import flight_log
from uavgram.synthetic.scenario import FAMILY, Scenario
from uavgram.synthetic.survey import SimulatedSurvey

TIME_STEP_S = 0.001


def inputs_of(survey: SimulatedSurvey, *, noise: str | None = None) -> Inputs:
    """Give the survey as `read_inputs` gives what `write_demo` writes.

    Parameters
    ----------
    survey
        Of a scenario.
    noise
        In place of what the scenario states of `solve.noise`.
    """
    count = len(survey.frame_id)
    camera = survey.calibration
    project = project_of(survey.scenario, noise)
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
        log=None if project.log is None else flight_log(survey.log),
        poses=None,
        digests=(),
        messages=(),
    )


def project_of(scenario: Scenario, noise: str | None = None) -> Project:
    """Give the project file of a simulated survey: what it states is the scenario's.

    Parameters
    ----------
    scenario
        Of the survey.
    noise
        In place of what it states of `solve.noise`.
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
        targets=TargetOptions(family=FAMILY, side_m=plates.side_m, sigma_m=plates.sigma_m)
        if plates.at
        else None,
    )


def _pair(stated: tuple[float, ...]) -> tuple[float, float] | Literal["auto"]:
    """Two sigmas, or ``auto``."""
    return (stated[0], stated[1]) if stated else "auto"
