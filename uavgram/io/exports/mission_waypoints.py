"""Writer of flight.waypoints: the mission as text, for Mission Planner, MAVProxy, QGroundControl.

Lines of twelve numbers between tabs: index, current, frame, command, params 1 to 4, latitude,
longitude, height, autocontinue (https://mavlink.io/en/file_formats/#mission_plain_text_file).
"""

from __future__ import annotations

from uavgram.io.exports.mission_items import Command, Frame, MissionItem, mission_items
from uavgram.model.maps import Mission

_HEAD = "QGC WPL 110"


def waypoints_text(mission: Mission) -> str:
    """Return the lines of a mission for ArduPilot; its first item is the place of take-off.

    Not for PX4: tools that upload such a file to PX4 use that place, on the ground, as the first
    stop. `mission_qgc` has a file for both.
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
