"""The mission that an autopilot is given: flown by the simulator, it is as exact as was planned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil, mavwp

from uavgram.config.scenario import load_scenario
from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.io.exports.mission_waypoints import write_waypoints
from uavgram.model.arrays import Floats
from uavgram.model.scenario.flight import Station
from uavgram.model.scenario.scenario import Site
from uavgram.pipeline.plan.flown import flown, in_scene_axes
from uavgram.pipeline.plan.make import plan_of
from uavgram.pipeline.plan.scene import scene_of
from uavgram.pipeline.simulate import repeat
from uavgram.pipeline.simulate.worlds import ScenarioWorld

MAV = mavutil.mavlink
SCENARIO = """
site: {ground_slope_deg: [4.0, -3.0]}
plan:
  area: [[-14, -10], [14, -10], [14, 10], [-14, 10]]
  wanted:
    - {name: width, points: [[-8, -6], [-8, 6]]}
    - {name: way, points: [[-8, -6], [8, 5]]}
  patterns: [strip]
  heights_m: [40]
  pitches_deg: [-75]
  frames: [3]
  lines: 3
  deviation_m: 0.5
  deviation_deg: 0.5
"""


def stations(path: Path, site: Site) -> tuple[Station, ...]:
    """Where a mission stops, how it looks there: as pymavlink reads the file."""
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    home, *items = [loader.wp(row) for row in range(loader.count())]
    origin = site.latitude_deg, site.longitude_deg, site.height_msl_m
    found, pitch = [], np.nan
    for item in items:
        if item.command == MAV.MAV_CMD_DO_MOUNT_CONTROL:
            pitch = item.param1
        if item.command != MAV.MAV_CMD_NAV_WAYPOINT:
            continue
        assert item.frame == MAV.MAV_FRAME_GLOBAL_RELATIVE_ALT
        height_m = home.z - site.height_msl_m + item.z
        latitude, longitude = np.array([item.x]), np.array([item.y])
        level = np.array([site.height_msl_m])
        east_north: Floats = enu_from_geodetic(latitude, longitude, level, origin)[:, :2]
        x_m, y_m = in_scene_axes(site, east_north)[0].tolist()
        heading_deg = site.road_azimuth_deg - item.param4
        found.append(
            Station(x_m=x_m, y_m=y_m, height_m=height_m, heading_deg=heading_deg, pitch_deg=pitch)
        )
    return tuple(found)


def test_a_mission_flown_by_the_simulator_is_as_exact_as_predicted(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(SCENARIO)
    scenario = load_scenario(path)
    asked = scene_of(scenario, path)
    planned = plan_of(scenario, asked)
    write_waypoints(tmp_path / "mission.waypoints", planned)
    as_planned = flown(scenario, asked, planned)
    read = stations(tmp_path / "mission.waypoints", asked.site)
    flight = replace(
        as_planned.flight, poses=read, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0
    )

    name, _, sigma = repeat.predicted(ScenarioWorld(replace(as_planned, flight=flight)))
    assert name == planned.measurements.name
    np.testing.assert_allclose(sigma, planned.measurements.sigma, rtol=0.03)
    # a mission flown 5 m lower, or looking elsewhere, would not be as exact as that by chance
    for one, other in zip(read, as_planned.flight.poses, strict=True):
        there, planned_there = ((p.x_m, p.y_m, p.height_m) for p in (one, other))
        np.testing.assert_allclose(there, planned_there, atol=0.03)
        turned = (one.heading_deg - other.heading_deg + 180.0) % 360.0 - 180.0
        assert turned == pytest.approx(0.0, abs=1e-3)
        assert one.pitch_deg == pytest.approx(other.pitch_deg, abs=1e-3)
