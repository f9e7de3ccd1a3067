"""A plan on the ground as layers, for maps and globes."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.earth.map_projection import utm_crs
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Attribute, Features, Layer, ShapeKind
from uavgram.model.planned.plan import FlightPlanned
from uavgram.stages.products.measured_shapes import shape
from uavgram.stages.products.mission import planned_origin

_CELL = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2


def plan_layers(planned: FlightPlanned) -> Features:
    """All layers of a plan; what is drawn last lies on top."""
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
        *_wanted(planned),
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
            "planned_line_ends",
            "point",
            tuple(np.concatenate([lines.start_world_m, lines.end_world_m])[:, None]),
            label=(*lines.start_label, *lines.end_label),
        ),
    )
    origin = planned_origin(planned)
    return Features(
        name=planned.name,
        layers=tuple(layer for layer in layers if len(layer)),
        origin=origin,
        height_datum="msl",
        crs=utm_crs(origin[0], origin[1]),
    )


def grid_cells(planned: FlightPlanned) -> Floats:
    """(K, 4, 3) corners of the cells of the accuracy map, which lie as their middles do.

    Counterclockwise from above; turned where the map is.
    """
    grid = planned.grid
    middles = grid.center_world_m
    flat = grid.cell_m * _CELL
    away = middles[:, :2] - middles[:1, :2]
    near = np.flatnonzero(np.abs(np.hypot(*away.T) - grid.cell_m) < 1e-3 * grid.cell_m)
    if len(near):
        east, north = away[near[0]] / grid.cell_m
        flat = flat @ np.array([[east, north], [-north, east]])
    return np.asarray(middles[:, None] + np.column_stack([flat, np.zeros(4)]))


def _flight(planned: FlightPlanned) -> Layer:
    frames = planned.frames
    return Layer(
        name="planned_flight",
        kind="line",
        vertices_m=(frames.center_world_m,) if len(frames.name) > 1 else (),
        attributes={"name": (planned.name,) if len(frames.name) > 1 else ()},
        above_ground_m=(frames.height_above_ground_m,) if len(frames.name) > 1 else (),
    )


def wanted_shapes(planned: FlightPlanned) -> list[list[Floats]]:
    """(M,) polylines (n, 3) of each wanted value."""
    place = dict(zip(planned.points.label, planned.points.world_m, strict=True))
    measured = planned.measurements
    return [
        shape(kind, np.array([place[label] for label in labels]))
        for kind, labels in zip(measured.kind, measured.points, strict=True)
    ]


def _wanted(planned: FlightPlanned) -> list[Layer]:
    rows = planned.measurements
    strips = [(k, strip) for k, several in enumerate(wanted_shapes(planned)) for strip in several]
    return [
        _layer(
            "planned_measurements",
            "line",
            tuple(strip for _, strip in strips),
            name=tuple(rows.name[k] for k, _ in strips),
            kind=tuple(rows.kind[k] for k, _ in strips),
            sigma=tuple(float(rows.sigma[k]) for k, _ in strips),
            wanted_sigma=tuple(float(rows.wanted_sigma[k]) for k, _ in strips),
            unit=tuple(rows.unit[k] for k, _ in strips),
        )
    ]


def _layer(
    layer: str, shapes: ShapeKind, vertices_m: tuple[Floats, ...], /, **attributes: Attribute
) -> Layer:
    return Layer(name=layer, kind=shapes, vertices_m=vertices_m, attributes=attributes)


def _numbers(values: Floats) -> tuple[float, ...]:
    return tuple(values.tolist())
