"""True values of measurements, from true positions, by independent short formulas.

The measuring stage has its own code, with covariances; shared code would hide its mistakes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.constants import g as GRAVITY_M_S2  # noqa: N812

from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementRequest

UNITS = {"area": "m2", "angle": "deg", "skid_speed": "m/s", "slope": "deg", "volume": "m3"}
"""Units of the kinds that are not lengths [m]."""


def compute_true_values(
    requests: Sequence[MeasurementRequest], row: Mapping[str, int], points_world_m: Floats
) -> tuple[tuple[str, ...], Floats, tuple[str, ...]]:
    """Return names, true values and units of the requests; a coordinate gives east and north.

    Parameters
    ----------
    requests
        Requested measurements; kind ``speed`` is left out, since a simulated scene is static.
    row
        Index of each label in `points_world_m`.
    points_world_m
        (K, 3), all of them on the ground.
    """
    names: list[str] = []
    values: list[float] = []
    units: list[str] = []
    for request in requests:
        at = points_world_m[[row[label] for label in request.points]]
        if request.kind == "coordinate":
            names += [f"{request.name} east", f"{request.name} north"]
            values += at[0, :2].tolist()
            units += ["m", "m"]
        elif request.kind != "speed":
            names.append(request.name)
            values.append(_value(request, at))
            units.append(UNITS.get(request.kind, "m"))
    return tuple(names), np.array(values), tuple(units)


def draw_true_friction(
    requests: Sequence[MeasurementRequest], rng: np.random.Generator
) -> tuple[MeasurementRequest, ...]:
    """Replace the stated friction of skids (mu, mu_sigma) by a true one drawn from it."""
    return tuple(
        replace(request, parameters=(("mu", _draw_friction(dict(request.parameters), rng)),))
        if request.kind == "skid_speed"
        else request
        for request in requests
    )


def _draw_friction(stated: Mapping[str, float], rng: np.random.Generator) -> float:
    drawn = stated["mu"] + stated.get("mu_sigma", 0.0) * float(rng.standard_normal())
    return max(drawn, 0.01)  # friction is positive


def _value(request: MeasurementRequest, at: Floats) -> float:
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    if request.kind in {"distance", "polyline"}:
        return float(steps.sum())
    if request.kind == "skid_speed":
        return float(np.sqrt(2.0 * dict(request.parameters)["mu"] * GRAVITY_M_S2 * steps.sum()))
    if request.kind == "area":
        # area of a plane polygon in space: half the norm of the summed cross products
        return float(np.linalg.norm(np.cross(at, np.roll(at, -1, axis=0)).sum(axis=0)) / 2.0)
    if request.kind == "angle":
        a, b = at[0] - at[1], at[2] - at[1]
        return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
    if request.kind == "volume":
        return _volume(dict(request.parameters), at)
    return _of_lines_and_planes(request, at)


def _of_lines_and_planes(request: MeasurementRequest, at: Floats) -> float:
    east, north, up = at[-1] - at[0]
    if request.kind == "line_distance":
        along = at[2] - at[1]
        return float(np.linalg.norm(np.cross(at[0] - at[1], along)) / np.linalg.norm(along))
    if request.kind == "plane_distance":
        legs = at[1:] - at[0]
        twice = np.cross(legs[1] - legs[0], legs[2] - legs[0])
        return float(-np.linalg.det(legs) / np.linalg.norm(twice))
    if request.kind == "slope":
        return float(np.rad2deg(np.arcsin(up / np.linalg.norm(at[1] - at[0]))))
    if request.kind in {"horizontal_distance", "profile"}:
        return float(np.hypot(east, north))
    return float(up)  # 0 for a single point, above the ground on which it is


def _volume(parameters: Mapping[str, float], at: Floats) -> float:
    """Sum prisms under a fan of triangles; above the ground, on which all points are, it is 0."""
    corner, base = at, at[:, 2]
    if "plane" in parameters:
        corner = at[:-3]
        plane = np.linalg.solve(np.column_stack([at[-3:, :2], np.ones(3)]), at[-3:, 2])
        base = np.column_stack([corner[:, :2], np.ones(len(corner))]) @ plane
    elif "level" in parameters:
        base = np.full(len(at), parameters["level"])
    solid = np.column_stack([corner[:, :2], corner[:, 2] - base])
    middle = solid[-1] if "top" in parameters else solid.mean(axis=0)
    around = solid[:-1] if "top" in parameters else solid
    pairs = zip(around, np.roll(around, -1, axis=0), strict=True)
    prisms = [
        (np.linalg.det([a[:2] - middle[:2], b[:2] - middle[:2]]), (a[2] + b[2] + middle[2]) / 6)
        for a, b in pairs
    ]
    sense = np.sign(sum(area for area, _ in prisms))
    return float(sense * sum(area * height for area, height in prisms))
