"""The route of a simulated flight: its legs, when each is flown, and where photos are taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.scenario.flight import FlightPlan
from uavgram.model.scenario.scenario import Site

ON_GROUND_S = 8.0
CLIMB_M_S = 3.0
LEAD_M = 6.0  # straight flight before and after the exposures of a strip
HOVER_S = 5.0  # at a place from which one photo is taken: time to come to rest before and after


@dataclass(frozen=True, kw_only=True, eq=False)
class Route(FrozenArrays):
    """A flight of W waypoints over L legs on which photos are taken.

    Attributes
    ----------
    waypoint_world_m
        (W, 3) home, above home, start and end of each leg, above home, home.
    start_s
        (W,) when each is passed, from the start of the recording.
    yaw_rad, pitch_rad
        (L,) of the vehicle, and of the gimbal's optical axis; yaw without jumps.
    turn_s
        (L - 1,) half-way between two legs.
    """

    waypoint_world_m: Annotated[Floats, "w", 3]
    start_s: Annotated[Floats, "w"]
    yaw_rad: Annotated[Floats, "l"]
    pitch_rad: Annotated[Floats, "l"]
    turn_s: Floats


class _Leg(NamedTuple):
    """Flown straight, in scene axes [m]; heading [rad] from its x axis, counterclockwise."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    heading: float
    pitch: float


def scene_axes(site: Site) -> Floats:
    """Give the (2, 2) rotation ``east_north = axes @ scene_xy``."""
    azimuth = np.deg2rad(site.road_azimuth_deg)
    return np.array([[np.sin(azimuth), -np.cos(azimuth)], [np.cos(azimuth), np.sin(azimuth)]])


def route(plan: FlightPlan, site: Site) -> Route:
    """Lay the legs of a plan one after the other.

    Parameters
    ----------
    plan, site
        Of the scenario.
    """
    legs = _hovers(plan, site) if plan.is_hovering else _strips(plan, site)
    ends = np.array([end for leg in legs for end in (leg.start, leg.end)])
    plane = ends[:, :2] @ scene_axes(site).T + [site.scene_east_m, site.scene_north_m]
    above = [[0.0, 0.0, plan.height_m]]
    flown = np.vstack([above, np.hstack([plane, ends[:, 2:]]), above])
    waypoints = np.vstack([np.zeros(3), flown, np.zeros(3)])
    speed = np.full(len(waypoints) - 1, plan.speed_m_s)
    speed[[0, -1]] = CLIMB_M_S
    leg_s = np.linalg.norm(np.diff(waypoints, axis=0), axis=1) / speed
    if plan.is_hovering:
        leg_s[2:-2:2] = HOVER_S
        leg_s[3:-2:2] = np.maximum(leg_s[3:-2:2], 1.0)  # two photos of one place: turn meanwhile
    start = ON_GROUND_S + np.concatenate([[0.0], np.cumsum(leg_s)])
    yaw = np.deg2rad(site.road_azimuth_deg) - np.array([leg.heading for leg in legs])
    return Route(
        waypoint_world_m=waypoints,
        start_s=start,
        yaw_rad=np.unwrap(yaw) if plan.is_hovering else yaw,
        pitch_rad=np.array([leg.pitch for leg in legs]),
        turn_s=0.5 * (start[3:-3:2] + start[4:-2:2]),
    )


def exposures(plan: FlightPlan, flown: Route, rng: np.random.Generator) -> Floats:
    """Instants (E,) at which the vehicle passes the planned places.

    Parameters
    ----------
    plan, flown
        The plan and its route.
    rng
        Draws each exposure's place along its strip.
    """
    begin = flown.start_s[2:-2:2]
    if plan.is_hovering:
        return begin + 0.5 * HOVER_S
    count = plan.photos_per_strip
    along = LEAD_M + np.linspace(0.0, 2.0 * plan.strip_half_length_m, count)
    jitter = rng.uniform(-plan.trigger_jitter_m, plan.trigger_jitter_m, (len(begin), count))
    return (begin[:, None] + (along + jitter) / plan.speed_m_s).ravel()


def _ahead(plan: FlightPlan, site: Site) -> float:
    """How far ahead of the vehicle the optical axis meets the ground [m]."""
    above = plan.height_m - site.ground_height_m
    return float(above / np.tan(np.deg2rad(-plan.gimbal_pitch_deg)))


def _strips(plan: FlightPlan, site: Site) -> list[_Leg]:
    """Strips there and back, and for a grid as many across.

    The optical axis meets the ground ahead of the vehicle: it flies so that the footprints, not the
    vehicle, are spread about the scene's middle.
    """
    reach, ahead = plan.strip_half_length_m + LEAD_M, _ahead(plan, site)
    count = {"strip": 1, "grid": plan.grid_strips}.get(plan.pattern, 2)
    pitch = float(np.deg2rad(plan.gimbal_pitch_deg))
    legs = []
    for across in (False, True)[: 2 if plan.pattern == "grid" else 1]:
        for i in range(count):
            way = -1.0 if i % 2 else 1.0
            side = (i - (count - 1) / 2) * 2 * plan.strip_offset_m
            ends = [(way * (-reach - ahead), side), (way * (reach - ahead), side)]
            if across:
                ends = [(-y, x) for x, y in ends]
            start, end = ((x, y, plan.height_m) for x, y in ends)
            heading = (np.pi / 2 if across else 0.0) - (np.pi if i % 2 else 0.0)
            legs.append(_Leg(start, end, heading, pitch))
    return legs


def _hovers(plan: FlightPlan, site: Site) -> list[_Leg]:
    """Places at rest."""
    height, pitch = plan.height_m, float(np.deg2rad(plan.gimbal_pitch_deg))
    if plan.pattern == "single":
        place = (-_ahead(plan, site), 0.0, height)
        return [_Leg(place, place, 0.0, pitch)]
    if plan.pattern == "orbit":
        legs = []
        down = -float(np.arctan2(height - site.ground_height_m, plan.radius_m))
        for angle in 2.0 * np.pi * np.arange(plan.frames) / plan.frames:
            place = (plan.radius_m * np.cos(angle), plan.radius_m * np.sin(angle), height)
            legs.append(_Leg(place, place, angle + np.pi, down))
        return legs
    return [
        _Leg(
            (one.x_m, one.y_m, one.height_m),
            (one.x_m, one.y_m, one.height_m),
            float(np.deg2rad(one.heading_deg)),
            float(np.deg2rad(one.pitch_deg)),
        )
        for one in plan.poses
    ]
