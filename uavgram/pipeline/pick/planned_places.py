"""Where the ends of planned lines, and planned plates, should lie in the world of a project."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.observed import NO_CONTROL
from uavgram.geometry.earth.geodesy import enu_from_geodetic, geodetic_from_enu
from uavgram.model.survey.observations import KnownWorldPoints
from uavgram.model.survey.world import World
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.stages.products.mission import planned_origin

LAID_SIGMA_M = 0.5
"""Who lays something by paces and sight is off by so much: half a step, a standard deviation."""


def planned_places(inputs: Inputs, world: World) -> KnownWorldPoints:
    """Ends of the plan's lines and middles of its plates; none without a plan or a place on earth.

    On the project's ground, whatever height the plan took it to have: a plan is made at home.

    Parameters
    ----------
    inputs
        The project.
    world
        Where its local world lies.
    """
    planned = inputs.planned
    if planned is None or world.origin is None:
        return NO_CONTROL
    lines, plates = planned.lines, planned.plates
    laid = np.concatenate([lines.start_world_m, lines.end_world_m, plates.center_world_m])
    latitude, longitude, _ = geodetic_from_enu(laid, planned_origin(planned))
    places = enu_from_geodetic(latitude, longitude, world.origin[2], world.origin)
    ground = inputs.project.ground
    places[:, 2] = ground.height_m
    sigma = [LAID_SIGMA_M, LAID_SIGMA_M, ground.height_sigma_m]
    return KnownWorldPoints(
        label=(*lines.start_label, *lines.end_label, *plates.name),
        world_m=places,
        sigma_m=np.broadcast_to(sigma, places.shape),
    )
