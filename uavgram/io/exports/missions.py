"""Planned flights as MAVLink missions: flight.plan for QGroundControl, flight.waypoints for others.

The commands do not arm a drone, take off, land or fly home: a person does that. The mission begins
in the air and ends hovering over the last stop.

At each stop an autopilot hovers, takes one photo, then turns drone and gimbal on the way to the
next. Both ArduPilot and PX4 execute commands that follow a waypoint once its hover time is over
(https://ardupilot.org/copter/docs/mission-command-list.html). They differ in two of them:

=========  ==========================================  =====================================
..         ArduPilot                                   PX4
=========  ==========================================  =====================================
heading    MAV_CMD_CONDITION_YAW, as param 4 of a      param 4 of the waypoint; it refuses
           waypoint is ignored                         missions with MAV_CMD_CONDITION_YAW
photo      MAV_CMD_DO_DIGICAM_CONTROL                  MAV_CMD_IMAGE_START_CAPTURE
=========  ==========================================  =====================================

The format of flight.plan is
https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. A fence polygon with
``inclusion: false`` is a no-go area (QGCFencePolygon.cc). flight.waypoints has lines of twelve
numbers between tabs: index, current, frame, command, params 1 to 4, latitude, longitude, height,
autocontinue (https://mavlink.io/en/file_formats/#mission_plain_text_file).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from uavgram.io.json_codec import Record
from uavgram.model.arrays import Floats
from uavgram.model.maps import Autopilot, HeightFrame, Mission

ACCEPTED_M = 1.0
"""Distance at which a stop counts as reached, if the autopilot does not stop by itself."""

_SHORTEST_TURN = 0
_GROUND_SPEED = 1
_THROTTLE_AS_IT_IS = -1


class Command(IntEnum):
    """Commands that are used (MAV_CMD, https://mavlink.io/en/messages/common.html#mav_commands)."""

    NAV_WAYPOINT = 16
    CONDITION_YAW = 115
    DO_CHANGE_SPEED = 178
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONTROL = 205
    IMAGE_START_CAPTURE = 2000


class Frame(IntEnum):
    """Reference of an item's height (MAV_FRAME)."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_TERRAIN_ALT = 10


FRAMES: dict[HeightFrame, Frame] = {
    "relative": Frame.GLOBAL_RELATIVE_ALT,
    "terrain": Frame.GLOBAL_TERRAIN_ALT,
}

_MOUNT_BY_ANGLES = 2  # MAV_MOUNT_MODE_MAVLINK_TARGETING


@dataclass(frozen=True)
class MissionItem:
    """One MISSION_ITEM: command, frame, and params 1 to 7 (5 to 7: latitude, longitude, height)."""

    command: Command
    frame: Frame
    params: tuple[float, float, float, float, float, float, float]


def mission_items(mission: Mission) -> tuple[MissionItem, ...]:
    """Return all commands in their order, without the place of take-off."""
    return tuple(_items(mission))


def _items(mission: Mission) -> Iterator[MissionItem]:
    is_ardupilot = mission.autopilot == "ardupilot"
    yield _do(Command.DO_CHANGE_SPEED, _GROUND_SPEED, mission.speed_m_s, _THROTTLE_AS_IT_IS)
    frame, pitch_before = FRAMES[mission.height_frame], None
    stops = np.column_stack(
        [
            *(mission.latitude_deg, mission.longitude_deg, mission.height_m),
            *(mission.heading_deg, mission.gimbal_pitch_deg),
        ]
    )
    for number, (latitude, longitude, height, heading, pitch) in enumerate(stops.tolist(), start=1):
        if pitch != pitch_before:
            yield _do(Command.DO_MOUNT_CONTROL, pitch, 0, 0, 0, 0, 0, _MOUNT_BY_ANGLES)
            pitch_before = pitch
        if is_ardupilot:  # on each leg: a waypoint turns the nose back to the direction of flight
            yield _do(Command.CONDITION_YAW, heading, 0, _SHORTEST_TURN)
        yield MissionItem(
            Command.NAV_WAYPOINT,
            frame,
            (mission.hold_s, ACCEPTED_M, 0.0, heading, latitude, longitude, height),
        )
        if is_ardupilot:
            yield _do(Command.DO_DIGICAM_CONTROL, 0, 0, 0, 0, 1)
        else:
            yield _do(Command.IMAGE_START_CAPTURE, 0, 0, 1, number)


def _do(command: Command, *params: float) -> MissionItem:
    """Return an item without a position; omitted params are 0."""
    one, two, three, four, five, six, seven = (*map(float, params), *[0.0] * (7 - len(params)))
    return MissionItem(command, Frame.MISSION, (one, two, three, four, five, six, seven))


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


_HEAD = "QGC WPL 110"


def waypoints_text(mission: Mission) -> str:
    """Return the lines of a mission for ArduPilot; its first item is the place of take-off.

    Not for PX4: tools that upload such a file to PX4 use that place, on the ground, as the first
    stop. flight.plan is for both.
    """
    home = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0, 0.0, 0.0, 0.0, *mission.home))
    items = (home, *mission_items(mission))
    lines = [_HEAD, *(_line(row, item) for row, item in enumerate(items))]
    return "\n".join(lines) + "\n"


def _line(row: int, item: MissionItem) -> str:
    one, two, three, four, latitude, longitude, height = item.params
    fields = (
        *(str(row), str(int(row == 0)), str(int(item.frame)), str(int(item.command))),
        *(f"{param:.6f}" for param in (one, two, three, four)),
        *(f"{latitude:.9f}", f"{longitude:.9f}", f"{height:.3f}", "1"),
    )
    return "\t".join(fields)
