"""A plan as a scenario: to be flown by the simulator, as often as one likes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.planned.plan import FlightPlanned
from uavgram.model.scenario.flight import FlightPlan, Station
from uavgram.model.scenario.road import SceneLine, ScenePoint
from uavgram.model.scenario.scenario import Scenario, Site
from uavgram.pipeline.plan.scene import Asked
from uavgram.stages.plan.wanted import wanted_of
from uavgram.stages.simulate.route import scene_axes


def flown(scenario: Scenario, asked: Asked, planned: FlightPlanned) -> Scenario:
    """The scenario in which a plan is carried out as it stands.

    Parameters
    ----------
    scenario
        That the plan was made from: camera, log, errors.
    asked
        What it asks for.
    planned
        Photos and lines.
    """
    site, lines = asked.site, planned.lines
    wanted = wanted_of(asked.scene)
    labels = (*wanted.label, *lines.start_label, *lines.end_label)
    ends = np.concatenate([lines.start_world_m, lines.end_world_m])[:, :2]
    xy = in_scene_axes(site, np.concatenate([wanted.point_m, ends]))
    return replace(
        scenario,
        name=f"{scenario.name} as planned",
        site=site,
        flight=replace(
            FlightPlan(),
            pattern="poses",
            height_m=planned.flight.height_m + asked.scene.height_m,
            speed_m_s=planned.flight.speed_m_s,
            poses=_stations(site, planned),
        ),
        stated=replace(scenario.stated, roughness_sigma_m=planned.assumptions.roughness_m),
        habits=replace(scenario.habits, raised=(), swapped=(), wrong_lengths=()),
        points=tuple(
            ScenePoint(label=label, x_m=float(x), y_m=float(y))
            for label, (x, y) in zip(labels, xy, strict=True)
        ),
        lines=tuple(
            SceneLine(name=name, start=start, end=end)
            for name, start, end in zip(lines.name, lines.start_label, lines.end_label, strict=True)
        ),
        plates=replace(scenario.plates, at=_plates(site, planned)),
        control=(),
        measurements=wanted.requests,
        plan=None,
    )


def _plates(site: Site, planned: FlightPlanned) -> tuple[tuple[float, float, float], ...]:
    plates = planned.plates
    xy = in_scene_axes(site, plates.center_world_m[:, :2])
    side = plates.corner_world_m[:, 1] - plates.corner_world_m[:, 0]
    turn = np.rad2deg(np.arctan2(side[:, 1], side[:, 0])) + site.road_azimuth_deg - 90.0
    return tuple(zip(*xy.T.tolist(), turn.tolist(), strict=True)) if len(xy) else ()


def in_scene_axes(site: Site, east_north_m: Floats) -> Floats:
    """(N, 2) places of the world in the scene's axes [m]."""
    from_origin = east_north_m - np.array([site.scene_east_m, site.scene_north_m])
    return np.asarray(from_origin @ scene_axes(site))


def _stations(site: Site, planned: FlightPlanned) -> tuple[Station, ...]:
    frames = planned.frames
    xy = in_scene_axes(site, frames.center_world_m[:, :2])
    return tuple(
        Station(
            x_m=float(xy[i, 0]),
            y_m=float(xy[i, 1]),
            height_m=float(frames.center_world_m[i, 2]),
            heading_deg=float(site.road_azimuth_deg - frames.heading_deg[i]),
            pitch_deg=float(frames.gimbal_pitch_deg[i]),
        )
        for i in range(len(xy))
    )
