"""From a scenario with its section `plan:` to a scene in the world's axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.io.area_file import AreaFile, read_areas
from uavgram.model.arrays import Floats
from uavgram.model.options import GroundOptions, MountOptions, TapeOptions, TelemetryOptions
from uavgram.model.planned.request import PlanRequest
from uavgram.model.scenario.scenario import Scenario, Site
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.pipeline.plan.area import area_of, in_scene, no_go_of, on_map, site_of
from uavgram.pipeline.simulate.scenario import measurement_fault, scenario_camera
from uavgram.stages.plan.scene import Deviation, Logged, PlanScene
from uavgram.stages.simulate.still import Still
from uavgram.stages.simulate.surface import draw_surface
from uavgram.stages.simulate.survey import calibration_of


class Asked(NamedTuple):
    """A scenario's plan.

    Attributes
    ----------
    scene
        In the world's axes.
    request
        What is wanted of the plan.
    site
        The scenario's, or where the file of the area lies.
    """

    scene: PlanScene
    request: PlanRequest
    site: Site


def scene_of(scenario: Scenario, path: Path) -> Asked:
    """Read what a plan needs, and put it into the world's axes.

    Parameters
    ----------
    scenario, path
        The scenario and its file, to which other files' names are relative.

    Raises
    ------
    InputError
        There is no section `plan`, or its area, its points or a file are wrong.
    """
    request = scenario.plan
    if request is None:
        raise InputError(
            path,
            "has no section `plan:`, which says what to plan for: add `plan: {area: [[-20, -15], "
            "[20, -15], [20, 15], [-20, 15]]}`, the corners of the scene in metres, or `plan: "
            "{area: area.kml}`",
        )
    file = read_areas(path.parent / request.area) if isinstance(request.area, str) else None
    site = site_of(scenario.site, request, file, path)
    area = area_of(request, file, site, path)
    no_go = no_go_of(request, site, path)
    surface = draw_surface(replace(scenario, site=site), Still())
    places = _places(scenario, file, site)
    requests, label, point = _wanted(request, places, site, path)
    stated, errors = scenario.stated, scenario.errors
    scene = PlanScene(
        calibration=scenario_camera(path, scenario.camera) or calibration_of(scenario.camera),
        height_m=surface.height_m + float((area.mean(axis=0) - surface.middle_m) @ surface.slope),
        slope=surface.slope,
        pivot_m=area.mean(axis=0),
        area_m=area,
        no_go_m=no_go,
        label=label,
        point_m=point,
        requests=requests,
        ground=GroundOptions(
            height_sigma_m=stated.ground_height_sigma_m,
            slope_sigma_deg=stated.ground_slope_sigma_deg,
            roughness_sigma_m=request.roughness_m,
        ),
        tape=TapeOptions(scale_sigma=stated.tape_scale_sigma),
        plates=scenario.plates,
        logged=_logged(scenario),
        picks_sigma_px=errors.pick_px,
        tape_sigma_m=errors.tape_m,
        deviation=Deviation(position_m=request.deviation_m, attitude_deg=request.deviation_deg),
    )
    return Asked(scene, request, site)


def _logged(scenario: Scenario) -> Logged | None:
    if scenario.telemetry == "none":
        return None
    stated = scenario.stated
    usual = Logged()
    position, attitude = stated.position_sigma_m, stated.attitude_sigma_deg
    return Logged(
        position_sigma_m=(position[0], position[1]) if position else usual.position_sigma_m,
        attitude_sigma_deg=(attitude[0], attitude[1]) if attitude else usual.attitude_sigma_deg,
        mount=MountOptions(
            boresight_sigma_deg=stated.boresight_sigma_deg,
            lever_arm_m=scenario.errors.lever_arm_m,
            lever_arm_sigma_m=stated.lever_arm_sigma_m,
        ),
        telemetry=TelemetryOptions(
            position_bias_sigma_m=stated.position_bias_sigma_m,
            heading_bias_sigma_deg=stated.heading_bias_sigma_deg,
        ),
    )


def _places(scenario: Scenario, file: AreaFile | None, site: Site) -> dict[str, Floats]:
    """East and north of everything that has a name."""
    xy = in_scene(tuple((one.x_m, one.y_m) for one in scenario.points), site)
    places = dict(zip((one.label for one in scenario.points), xy, strict=True))
    if file is not None and file.label:
        at = on_map(file.longitude_latitude_deg, site)
        places |= dict(zip(file.label, at, strict=True))
    return places


def _wanted(
    request: PlanRequest, places: dict[str, Floats], site: Site, path: Path
) -> tuple[tuple[MeasurementRequest, ...], tuple[str, ...], Floats]:
    """Requests, and labels and places of the points that they name."""
    label: dict[str, Floats] = {}
    requests = []
    for wanted in request.wanted:
        names = []
        for number, one in enumerate(wanted.points, start=1):
            if not isinstance(one, str):
                name, at = f"{wanted.name} {number}", in_scene((one,), site)[0]
            elif one in places:
                name, at = one, places[one]
            else:
                hint = near_miss(one, places)
                raise InputError(
                    path,
                    f"plan.wanted: {wanted.name!r} names the point {one!r}, which is nowhere"
                    f"{f' ({hint})' if hint else ''}: add it to `points:`, or give its place as "
                    "[x, y]",
                )
            label[name] = at
            names.append(name)
        asked = MeasurementRequest(
            name=wanted.name, kind=wanted.kind, points=tuple(names), parameters=wanted.parameters
        )
        if fault := measurement_fault(asked):
            raise InputError(path, f"plan.wanted: {fault}")
        requests.append(asked)
    return tuple(requests), tuple(label), np.array(list(label.values())).reshape(-1, 2)
