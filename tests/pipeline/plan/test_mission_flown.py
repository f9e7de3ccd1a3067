"""The mission that an autopilot is given: flown by the simulator, it is as exact as was planned."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil, mavwp
from qgc_plan_format import PlacedItem, QgcPlan

from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.io.exports.mission_litchi import litchi_text
from uavgram.io.exports.mission_qgc import qgc_plan_text
from uavgram.io.exports.mission_waypoints import waypoints_text
from uavgram.model.arrays import Floats
from uavgram.model.maps.mission import Mission
from uavgram.model.planned.plan import FlightPlanned
from uavgram.model.scenario.flight import Station
from uavgram.model.scenario.scenario import Scenario, Site
from uavgram.pipeline.plan.flown import in_scene_axes
from uavgram.pipeline.plan.run import plan
from uavgram.pipeline.simulate import repeat
from uavgram.pipeline.simulate.worlds import ScenarioWorld
from uavgram.stages.products.mission import flight_mission

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


def by_pymavlink(mission: Mission, folder: Path) -> Floats:
    (folder / "mission.waypoints").write_text(waypoints_text(mission))
    loader = mavwp.MAVWPLoader()
    loader.load(str(folder / "mission.waypoints"))
    rows, pitch = [], np.nan
    for item in (loader.wp(row) for row in range(1, loader.count())):
        if item.command == MAV.MAV_CMD_DO_MOUNT_CONTROL:
            pitch = item.param1
        if item.command == MAV.MAV_CMD_NAV_WAYPOINT:
            assert item.frame == MAV.MAV_FRAME_GLOBAL_RELATIVE_ALT
            rows.append((item.x, item.y, loader.wp(0).z + item.z, item.param4, pitch))
    return np.array(rows)


def by_plan(mission: Mission, _: Path) -> Floats:
    plan = QgcPlan.model_validate_json(qgc_plan_text(mission)).mission
    home_m = plan.plannedHomePosition[2]
    pitch: float | None = None
    rows = []
    for item in plan.items:
        if item.command == MAV.MAV_CMD_DO_MOUNT_CONTROL:
            pitch = item.params[0]
        if isinstance(item, PlacedItem):
            heading, latitude, longitude, height = item.params[3:]
            assert height == item.Altitude
            rows.append((latitude, longitude, home_m + item.Altitude, heading, pitch))
    return np.array(rows)


def by_litchi(mission: Mission, _: Path) -> Floats:
    columns = ("latitude", "longitude", "altitude(m)", "actionparam1", "actionparam2")
    table = csv.DictReader(litchi_text(mission).splitlines())
    rows = np.array([[float(row[column]) for column in columns] for row in table])
    rows[:, 2] += mission.home[2]  # its heights are above the place of take-off
    return rows


def stations(rows: Floats, site: Site) -> tuple[Station, ...]:
    """Stops in the scene's axes, of their latitude, longitude, height, heading and pitch."""
    origin = site.latitude_deg, site.longitude_deg, site.height_msl_m
    level = np.full(len(rows), site.height_msl_m)
    xy = in_scene_axes(site, enu_from_geodetic(rows[:, 0], rows[:, 1], level, origin)[:, :2])
    return tuple(
        Station(
            x_m=x,
            y_m=y,
            height_m=height - site.height_msl_m,
            heading_deg=site.road_azimuth_deg - heading,
            pitch_deg=pitch,
        )
        for (x, y), (height, heading, pitch) in zip(xy.tolist(), rows[:, 2:].tolist(), strict=True)
    )


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightPlanned, Scenario]:
    path = tmp_path_factory.mktemp("mission") / "yard.yaml"
    path.write_text(SCENARIO)
    return plan(path)


@pytest.mark.parametrize(
    ("read_by", "whole_deg"), [(by_pymavlink, 0.0), (by_plan, 0.0), (by_litchi, 0.5)]
)
def test_a_mission_flown_by_the_simulator_is_as_exact_as_predicted(
    yard: tuple[FlightPlanned, Scenario],
    tmp_path: Path,
    read_by: Callable[[Mission, Path], Floats],
    whole_deg: float,
) -> None:
    planned, as_planned = yard
    read = stations(read_by(flight_mission(planned), tmp_path), as_planned.site)
    flight = replace(
        as_planned.flight, poses=read, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0
    )

    name, _, sigma = repeat.predicted(ScenarioWorld(replace(as_planned, flight=flight)))
    assert name == planned.measurements.name
    assert planned.chosen_by == "mean"  # two lengths, and nothing stated of either
    np.testing.assert_allclose(sigma, planned.measurements.sigma, rtol=0.03)
    # a mission flown 5 m lower, or looking elsewhere, would not be as exact as that by chance
    for one, other in zip(read, as_planned.flight.poses, strict=True):
        there, planned_there = ((p.x_m, p.y_m, p.height_m) for p in (one, other))
        np.testing.assert_allclose(there, planned_there, atol=0.03)
        turned = (one.heading_deg - other.heading_deg + 180.0) % 360.0 - 180.0
        assert turned == pytest.approx(0.0, abs=whole_deg + 1e-3)
        assert one.pitch_deg == pytest.approx(other.pitch_deg, abs=1e-3)
