"""Which flights show all of an area, within what drone and law allow."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.ground.polygons import contains, long_axis
from uavgram.model.arrays import Floats
from uavgram.model.planned.request import PlanRequest
from uavgram.stages.plan.cameras import Cameras, seen
from uavgram.stages.plan.flights import (
    MOST_IN_GRID,
    USABLE,
    Flight,
    flights,
    heights_to_try,
    keeps_out,
)
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.spots import grid_in
from uavgram.stages.plan.wanted import Wanted

HEIGHTS_EACH = 3
"""Of the lowest heights from which a pattern shows everything, those that are looked at."""

TO_COVER = 60
"""Places of the area that photos must show."""


def covering(scene: PlanScene, request: PlanRequest, wanted: Wanted) -> list[Flight]:
    """Flights that show the area and what is wanted, and end before the battery does.

    Parameters
    ----------
    scene, request
        What the plan is for.
    wanted
        Whose points must be seen.

    Raises
    ------
    GeometryError
        There is none; the message says what stands in the way.
    """
    must = scene.on_ground(np.concatenate([_area_points(scene), wanted.point_m]))
    found, obstacles = [], dict.fromkeys(("cover", "battery", "no-go", "horizon", "height"), 0)
    for pattern in request.patterns:
        heights = 0
        for height in heights_to_try(request):
            good = 0
            choices = flights(scene, request, pattern, height)
            obstacles["battery"] += int(not choices)  # a grid of far too many photos
            for one in choices:
                obstacle = _obstacle(scene, request, one, must)
                if obstacle:
                    obstacles[obstacle] += 1
                else:
                    good += 1
                    found.append(one)
            heights += bool(good)
            if heights == HEIGHTS_EACH and not request.heights_m:
                break
    if not found:
        raise GeometryError(_why_not(scene, request, obstacles))
    return found


def _area_points(scene: PlanScene) -> Floats:
    size = np.ptp(scene.area_m, axis=0)
    inside = grid_in(scene.area_m, float(np.sqrt(size.prod() / TO_COVER)))
    return np.concatenate([scene.area_m, inside])


def _obstacle(scene: PlanScene, request: PlanRequest, one: Flight, must_m: Floats) -> str:
    ground = scene.on_ground(one.cameras.center_m[:, :2])[:, 2]
    above = one.cameras.center_m[:, 2] - ground
    if above.max() > request.max_height_m + 1e-6 or above.min() < 0.3 * one.height_m:
        return "height"
    if not keeps_out(scene, one.cameras):
        return "no-go"
    if one.duration_s > USABLE * 60.0 * request.battery_min:
        return "battery"
    if shows_horizon(scene, one.cameras):
        return "horizon"
    shown = seen(scene.calibration, one.cameras, must_m, scene.deviation).certain
    return "" if shown.any(axis=0).all() else "cover"


def shows_horizon(scene: PlanScene, cameras: Cameras) -> bool:
    """Whether a photo shows what is not on the ground: a corner looks level, or upwards."""
    camera = scene.calibration
    right, bottom = camera.width_px - 1.0, camera.height_px - 1.0
    corner = np.array([[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]])
    ray = back_project(camera.model, camera.parameters, corner)
    down = np.einsum("fij,nj->fni", cameras.world_from_camera, ray) @ [*-scene.slope, 1.0]
    return bool((down > -0.05 * np.linalg.norm(ray, axis=-1)).any())


def _why_not(scene: PlanScene, request: PlanRequest, obstacles: dict[str, int]) -> str:
    size = long_axis(scene.area_m)[2]
    area = f"The area is {size[0]:.0f} m by {size[1]:.0f} m"
    tried = ", ".join(request.patterns)
    if not heights_to_try(request):
        return (
            "no height is left to fly at: heights_m, min_height_m "
            f"({request.min_height_m:g}) and max_height_m ({request.max_height_m:g}) exclude each "
            "other"
        )
    if obstacles["battery"]:
        return (
            f"{area}: no flight ({tried}) that shows all of it ends within "
            f"{USABLE:.0%} of the battery's {request.battery_min:g} minutes, with at most "
            f"{MOST_IN_GRID} photos. Make the area "
            "smaller, fly higher (heights_m), allow more time (battery_min), or plan it in parts"
        )
    if obstacles["no-go"] and not obstacles["cover"]:
        return (
            "every flight crosses what is out of bounds for drone and tape (no_go): draw that as "
            "small as it really is, or plan the area in parts beside it"
        )
    if obstacles["horizon"] and not obstacles["cover"]:
        return (
            "the horizon is in every photo: point the camera further down (pitches_deg nearer -90)"
        )
    if obstacles["height"] and not obstacles["cover"]:
        return (
            "the ground is so steep that every flight comes too close to it or above "
            f"{request.max_height_m:g} m over it: make the area smaller, or plan it in parts"
        )
    more = "" if "grid" in request.patterns else " allow the pattern grid,"
    if max(heights_to_try(request)) < request.max_height_m:
        more = f" fly higher (heights_m),{more}"
    away = np.linalg.norm(scene.point_m - scene.area_m.mean(axis=0), axis=1)
    away[contains(scene.area_m, scene.point_m)] = 0.0
    if away.any():
        farthest = scene.label[int(away.argmax())]
        more += f" leave out what lies outside of the area ({farthest}),"
    return (
        f"{area}: from at most {max(heights_to_try(request)):g} m up, no flight ({tried}) shows "
        f"all of it for certain, as the drone may depart by {request.deviation_m:g} m and "
        f"{request.deviation_deg:g} degrees. Make the area smaller,{more} or plan it in parts"
    )
