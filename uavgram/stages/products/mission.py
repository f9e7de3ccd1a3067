"""Mission of a plan on earth, for an autopilot."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.geodesy import Origin, geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps import Autopilot, HeightFrame, Mission
from uavgram.model.planned import FlightPlanned

LEAST_HOLD_S = 1.0
"""Least waiting time [s], since drone and gimbal swing for about so long after a stop."""

_ROUNDING_M = 0.01


def planned_origin(planned: FlightPlanned) -> Origin:
    """Return latitude [deg], longitude [deg], height above mean sea level [m] of the origin."""
    site = planned.site
    return site.latitude_deg, site.longitude_deg, site.height_msl_m


def flight_mission(
    planned: FlightPlanned,
    autopilot: Autopilot = "ardupilot",
    height_frame: HeightFrame = "relative",
) -> Mission:
    """Return the stops of a plan, one for each photo.

    Take-off is assumed at the middle of the area, on the ground: heights ``relative`` count from
    there. A lower take-off lowers the flight by as much, as the sheet for the field states.

    Parameters
    ----------
    planned
        The plan.
    autopilot
        Autopilot whose commands are used.
    height_frame
        ``terrain``: heights over the ground below each photo, by the autopilot's own terrain data.

    Raises
    ------
    GeometryError
        A photo is higher above the ground than the plan allows.
    """
    frames, origin = planned.frames, planned_origin(planned)
    _check_heights(planned)
    latitude, longitude, _ = geodetic_from_enu(frames.center_world_m, origin)
    middle = planned.area_world_m.mean(axis=0)
    middle[2] = planned.site.ground_height_m
    home = np.concatenate(geodetic_from_enu(middle[None], origin)).tolist()
    # the up coordinate, not the geodetic height; over 1 km they differ by 8 cm, a barometer by more
    above_home = frames.center_world_m[:, 2] - middle[2]
    is_relative = height_frame == "relative"
    return Mission(
        name=planned.name,
        autopilot=autopilot,
        home=(home[0], home[1], home[2]),
        height_frame=height_frame,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=above_home if is_relative else frames.height_above_ground_m,
        heading_deg=frames.heading_deg % 360.0,
        gimbal_pitch_deg=frames.gimbal_pitch_deg,
        speed_m_s=planned.flight.speed_m_s,
        hold_s=max(planned.flight.seconds_per_photo, LEAST_HOLD_S),
        no_go=tuple(_on_earth(ring, origin) for ring in planned.no_go_world_m),
    )


def _check_heights(planned: FlightPlanned) -> None:
    most_m, heights = planned.flight.max_height_m, planned.frames.height_above_ground_m
    highest = int(np.argmax(heights))
    if heights[highest] > most_m + _ROUNDING_M:
        raise GeometryError(
            f"Photo {planned.frames.name[highest]} would be taken {heights[highest]:.1f} m above "
            f"the ground, and the plan allows {most_m:g} m: no mission was written. Plan a lower "
            "flight; or, if you may fly higher there, set max_height_m in the plan."
        )


def _on_earth(ring: Floats, origin: Origin) -> Floats:
    latitude, longitude, _ = geodetic_from_enu(ring, origin)
    return np.column_stack([latitude, longitude])
