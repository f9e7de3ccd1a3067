"""Missions, read back from their files and flown: what an autopilot makes of a plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pymavlink import mavutil, mavwp
from qgc_plan_format import PlacedItem, QgcPlan

from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.io.exports.missions import qgc_plan_text, waypoints_text
from uavgram.model.arrays import Floats
from uavgram.model.maps import Mission
from uavgram.synthetic.scenario import Site, Station

MAV = mavutil.mavlink


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


def stations(rows: Floats, site: Site) -> tuple[Station, ...]:
    """Stops in the scene's axes, of their latitude, longitude, height, heading and pitch."""
    origin = site.latitude_deg, site.longitude_deg, site.height_msl_m
    level = np.full(len(rows), site.height_msl_m)
    xy = site.in_scene(enu_from_geodetic(rows[:, 0], rows[:, 1], level, origin)[:, :2])
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
