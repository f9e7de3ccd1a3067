"""From a scene to a plan."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.model.arrays import Floats
from uavgram.model.planned.parts import (
    PlannedFrames,
    PlannedMeasurements,
    PlannedPoints,
)
from uavgram.model.planned.plan import Assumptions, FlightFacts, FlightPlanned, PlannedSite
from uavgram.model.scenario.scenario import Scenario, Site
from uavgram.pipeline.plan.accuracy import (
    accuracy_grid,
    chosen_by,
    ends_of,
    gained_by,
    gains,
    mean_sigma,
    planned_lines,
    planned_measurements,
    planned_plates,
)
from uavgram.pipeline.plan.choose import Choice, choose
from uavgram.pipeline.plan.predicted import predicted
from uavgram.pipeline.plan.scene import Asked
from uavgram.pipeline.progress import Progress, silent
from uavgram.stages.plan.cover import covering
from uavgram.stages.plan.footprints import footprints
from uavgram.stages.plan.remarks import nowhere, remarks
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.wanted import wanted_of


def plan_of(scenario: Scenario, asked: Asked, progress: Progress = silent) -> FlightPlanned:
    """Choose flight and lines, and predict what they reach.

    Parameters
    ----------
    scenario
        Its name, its camera and its log's class.
    asked
        What it asks for, in the world's axes.
    progress
        Shows long loops.

    Raises
    ------
    GeometryError
        No flight shows the area, or no line fits into it.
    """
    scene, request = asked.scene, asked.request
    wanted = wanted_of(scene)
    flown = covering(scene, request, wanted)
    choice = choose(scene, request, wanted, flown, progress)
    layout = choice.sturdy if request.robust else choice.layout
    ends = ends_of(choice.possible, layout.lines)
    try:
        found = predicted(scene, choice.flight.cameras, wanted, ends)
    except SingularError as fault:
        raise GeometryError(
            f"with {len(ends)} reference {choice.laid} nothing says where the photos were taken "
            "from: allow more (lines), or fly with a log (telemetry)"
        ) from fault
    lines = planned_lines(scene, choice, layout.lines, found)
    plates = planned_plates(scene, choice, layout.lines)
    shown = scene.requests
    measured = planned_measurements(request, wanted, found)
    return FlightPlanned(
        name=scenario.name,
        site=PlannedSite(
            latitude_deg=asked.site.latitude_deg,
            longitude_deg=asked.site.longitude_deg,
            height_msl_m=asked.site.height_msl_m,
            undulation_m=asked.site.undulation_m,
            ground_height_m=scene.height_m,
        ),
        camera=scene.calibration,
        drone=scenario.camera.drone or "",
        area_world_m=scene.on_ground(scene.area_m),
        no_go_world_m=tuple(scene.on_ground(polygon) for polygon in scene.no_go_m),
        flight=_facts(asked, choice),
        assumptions=Assumptions(
            telemetry=scenario.telemetry,
            pick_sigma_px=scene.picks_sigma_px,
            tape_sigma_m=scene.tape_sigma_m,
            tape_scale_sigma=scene.tape.scale_sigma,
            roughness_m=request.roughness_m,
            deviation_m=request.deviation_m,
            deviation_deg=request.deviation_deg,
        ),
        frames=_frames(scene, choice),
        lines=lines,
        plates=plates,
        points=PlannedPoints(label=scene.label, world_m=scene.on_ground(scene.point_m)),
        measurements=measured if shown else _nothing(),
        grid=accuracy_grid(scene, choice, layout.lines),
        mean_sigma=mean_sigma(found),
        chosen_by=chosen_by(choice.possible),
        gains=tuple(gains(scene, request, wanted, choice, layout.lines)),
        messages=(
            *((nowhere(),) if is_nowhere(asked) else ()),
            *remarks(
                (lines, plates),
                measured,
                gained_by(choice.possible, layout.lines),
                len(choice.flight.cameras.center_m),
            ),
        ),
    )


def is_nowhere(asked: Asked) -> bool:
    """Whether the area is in metres from a place that nobody named."""
    own, usual = asked.site, Site()
    named = (own.latitude_deg, own.longitude_deg) != (usual.latitude_deg, usual.longitude_deg)
    return not named and not isinstance(asked.request.area, str)


def _facts(asked: Asked, choice: Choice) -> FlightFacts:
    flown, request = choice.flight, asked.request
    slant = flown.height_m / max(np.sin(np.deg2rad(-flown.pitch_deg)), 0.1)
    return FlightFacts(
        pattern=flown.pattern,
        height_m=flown.height_m,
        gimbal_pitch_deg=flown.pitch_deg,
        speed_m_s=request.speed_m_s,
        seconds_per_photo=request.seconds_per_photo,
        path_m=flown.path_m,
        duration_s=flown.duration_s,
        battery_s=60.0 * request.battery_min,
        max_height_m=request.max_height_m,
        ground_sample_m=float(slant / asked.scene.calibration.parameters[0]),
    )


def _frames(scene: PlanScene, choice: Choice) -> PlannedFrames:
    cameras = choice.flight.cameras
    whole, certain = footprints(scene, cameras)
    ground = scene.on_ground(cameras.center_m[:, :2])[:, 2]
    return PlannedFrames(
        name=tuple(f"P{i + 1}" for i in range(len(ground))),
        center_world_m=cameras.center_m,
        world_from_camera=cameras.world_from_camera,
        heading_deg=cameras.heading_deg,
        gimbal_pitch_deg=cameras.pitch_deg,
        height_above_ground_m=cameras.center_m[:, 2] - ground,
        footprint_world_m=whole,
        safe_footprint_world_m=certain,
    )


def _nothing() -> PlannedMeasurements:
    empty: Floats = np.zeros(0)
    return PlannedMeasurements(
        name=(), kind=(), unit=(), points=(), value=empty, sigma=empty, wanted_sigma=empty
    )
