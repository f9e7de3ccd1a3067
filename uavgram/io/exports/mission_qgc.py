"""Writer of flight.plan: the mission with its no-go areas, for QGroundControl.

Its format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. A fence
polygon with ``inclusion: false`` is a no-go area (QGCFencePolygon.cc).
"""

from __future__ import annotations

import json

import numpy as np

from uavgram.io.exports.mission_items import Command, MissionItem, mission_items
from uavgram.io.results.codec import Record
from uavgram.model.arrays import Floats
from uavgram.model.maps import Autopilot, HeightFrame, Mission

_FIRMWARE: dict[Autopilot, int] = {"ardupilot": 3, "px4": 12}  # MAV_AUTOPILOT
_QUADROTOR = 2  # MAV_TYPE
# QGroundControlQmlGlobal.h: AltitudeModeRelative, AltitudeModeTerrainFrame
_ALTITUDE_MODES: dict[HeightFrame, int] = {"relative": 1, "terrain": 4}


def qgc_plan_text(mission: Mission) -> str:
    """Return the JSON of the mission and its no-go areas."""
    items = enumerate(mission_items(mission), start=1)
    plan: Record = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": _FIRMWARE[mission.autopilot],
            "vehicleType": _QUADROTOR,
            "globalPlanAltitudeMode": _ALTITUDE_MODES[mission.height_frame],
            "cruiseSpeed": mission.speed_m_s,
            "hoverSpeed": mission.speed_m_s,
            "plannedHomePosition": list(mission.home),
            "items": [_item(number, item, mission.height_frame) for number, item in items],
        },
        "geoFence": {
            "version": 2,
            "circles": [],
            "polygons": [
                {"version": 1, "inclusion": False, "polygon": _clockwise(ring)}
                for ring in mission.no_go
            ],
        },
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(plan, indent=1, allow_nan=False) + "\n"


def _item(number: int, item: MissionItem, height_frame: HeightFrame) -> Record:
    made: Record = {
        "type": "SimpleItem",
        "doJumpId": number,
        "autoContinue": True,
        "command": int(item.command),
        "frame": int(item.frame),
        "params": list(item.params),
    }
    if item.command == Command.NAV_WAYPOINT:
        made |= {
            "Altitude": item.params[6],
            "AltitudeMode": _ALTITUDE_MODES[height_frame],
            "AMSLAltAboveTerrain": None,
        }
    return made


def _clockwise(ring: Floats) -> list[list[float]]:
    """Return latitudes and longitudes [deg] in the order required by the format."""
    latitude, longitude = (ring - ring[0]).T  # small numbers: no digits of the area are lost
    doubled = longitude @ np.roll(latitude, -1) - np.roll(longitude, -1) @ latitude
    ordered: list[list[float]] = (ring if doubled < 0 else ring[::-1]).tolist()
    return ordered
