"""A planned flight on earth: its mission for an autopilot, and its layers for maps and globes."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.geodesy import Origin, geodetic_from_enu, utm_crs
from uavgram.model.arrays import Floats
from uavgram.model.maps import (
    Attribute,
    Autopilot,
    Features,
    HeightFrame,
    Layer,
    Mission,
    ShapeKind,
)
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.map_layers import shape

LEAST_HOLD_S = 1.0
"""Least waiting time [s], since drone and gimbal swing for about so long after a stop."""

_ROUNDING_M = 0.01


def find_planned_origin(planned: FlightPlanned) -> Origin:
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
    frames, origin = planned.frames, find_planned_origin(planned)
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


MOST_BASES = 60
"""Cells whose neighbours give the orientation of the map: enough to include some with all
neighbours."""

_CELL = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2


def plan_layers(planned: FlightPlanned) -> Features:
    """Return all layers of a plan; the last drawn is on top."""
    frames, lines, points, grid = planned.frames, planned.lines, planned.points, planned.grid
    corners = range(1, len(planned.area_world_m) + 1)
    layers = (
        _layer(
            "planned_accuracy",
            "polygon",
            tuple(grid_cells(planned)),
            sigma_m=_numbers(grid.sigma_m),
            length_m=(grid.length_m,) * len(grid.sigma_m),
        ),
        _layer(
            "planned_footprints",
            "polygon",
            tuple(frames.footprint_world_m),
            frame=frames.name,
        ),
        _layer("planned_area", "polygon", (planned.area_world_m,), name=(planned.name,)),
        _layer(
            "planned_no_go",
            "polygon",
            planned.no_go_world_m,
            name=tuple(f"keep out {k}" for k in range(1, len(planned.no_go_world_m) + 1)),
        ),
        _layer(
            "planned_corners",
            "point",
            tuple(planned.area_world_m[:, None]),
            name=tuple(f"corner {k}" for k in corners),
        ),
        _flight(planned),
        Layer(
            name="planned_photos",
            kind="point",
            vertices_m=tuple(frames.center_world_m[:, None]),
            attributes={
                "frame": frames.name,
                "height_above_ground_m": _numbers(frames.height_above_ground_m),
                "heading_deg": _numbers(frames.heading_deg),
                "gimbal_pitch_deg": _numbers(frames.gimbal_pitch_deg),
            },
            above_ground_m=tuple(frames.height_above_ground_m[:, None]),
        ),
        *_make_wanted_layer(planned),
        _layer("planned_points", "point", tuple(points.world_m[:, None]), label=points.label),
        _layer(
            "planned_lines",
            "line",
            tuple(np.stack([lines.start_world_m, lines.end_world_m], axis=1)),
            name=lines.name,
            length_m=_numbers(lines.length_m),
            sigma_m=_numbers(lines.sigma_m),
            start=lines.start_label,
            end=lines.end_label,
        ),
        _layer(
            "planned_plates",
            "polygon",
            tuple(planned.plates.corner_world_m),
            name=planned.plates.name,
        ),
        _layer(
            "planned_line_ends",
            "point",
            tuple(np.concatenate([lines.start_world_m, lines.end_world_m])[:, None]),
            label=(*lines.start_label, *lines.end_label),
        ),
    )
    origin = find_planned_origin(planned)
    return Features(
        name=planned.name,
        layers=tuple(layer for layer in layers if len(layer)),
        origin=origin,
        height_datum="msl",
        crs=utm_crs(origin[0], origin[1]),
    )


def grid_cells(planned: FlightPlanned) -> Floats:
    """Return corners (K, 4, 3) of the cells of the accuracy map, counterclockwise from above.

    The cells adjoin as their middles do: rotated, and a little longer in one direction, where the
    map is fitted to its area.
    """
    grid = planned.grid
    steps = _grid_steps(grid.center_world_m[:, :2], grid.cell_m)
    corners = np.column_stack([_CELL @ steps, np.zeros(4)])
    return np.asarray(grid.center_world_m[:, None] + corners)


def _grid_steps(middles_m: Floats, cell_m: float) -> Floats:
    """Return the steps (2, 2) from one cell (K, 2) to the next, and to the one on its left."""
    away = (middles_m[None] - middles_m[:MOST_BASES, None]).reshape(-1, 2)
    far = np.hypot(away[:, 0], away[:, 1])
    away = away[(far > 0.5 * cell_m) & (far < 1.5 * cell_m)]
    if not len(away):  # one cell, or cells apart
        return cell_m * np.eye(2)
    far = np.hypot(away[:, 0], away[:, 1])
    first = away[np.argmin(far)]
    left = np.array([-first[1], first[0]])
    others = away[away @ left > 0.9 * far * np.hypot(*left)]
    if not len(others):  # one row
        return np.stack([first, left])
    return np.stack([first, others[np.argmin(np.hypot(others[:, 0], others[:, 1]))]])


def _flight(planned: FlightPlanned) -> Layer:
    frames = planned.frames
    return Layer(
        name="planned_flight",
        kind="line",
        vertices_m=(frames.center_world_m,) if len(frames.name) > 1 else (),
        attributes={"name": (planned.name,) if len(frames.name) > 1 else ()},
        above_ground_m=(frames.height_above_ground_m,) if len(frames.name) > 1 else (),
    )


def wanted_strips(planned: FlightPlanned) -> dict[int, Floats]:
    """Return the polyline (n, 3) of each wanted value, by its row; coordinates have none."""
    place = dict(zip(planned.points.label, planned.points.world_m, strict=True))
    measured = planned.measurements
    strips = {
        k: shape(kind, np.array([place[label] for label in labels]))
        for k, (kind, labels) in enumerate(zip(measured.kind, measured.points, strict=True))
    }
    return {k: strip for k, strip in strips.items() if len(strip)}


def _make_wanted_layer(planned: FlightPlanned) -> list[Layer]:
    rows, strips = planned.measurements, wanted_strips(planned)
    return [
        _layer(
            "planned_measurements",
            "line",
            tuple(strips.values()),
            name=tuple(rows.name[k] for k in strips),
            kind=tuple(rows.kind[k] for k in strips),
            sigma=tuple(float(rows.sigma[k]) for k in strips),
            wanted_sigma=tuple(float(rows.wanted_sigma[k]) for k in strips),
            unit=tuple(rows.unit[k] for k in strips),
        )
    ]


def _layer(
    layer: str, shapes: ShapeKind, vertices_m: tuple[Floats, ...], /, **attributes: Attribute
) -> Layer:
    return Layer(name=layer, kind=shapes, vertices_m=vertices_m, attributes=attributes)


def _numbers(values: Floats) -> tuple[float, ...]:
    return tuple(values.tolist())
