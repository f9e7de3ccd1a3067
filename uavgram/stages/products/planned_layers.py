"""Layers of a plan on the ground, for maps and globes."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.geodesy import utm_crs
from uavgram.model.arrays import Floats
from uavgram.model.maps import Attribute, Features, Layer, ShapeKind
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.map_layers import shape
from uavgram.stages.products.mission import planned_origin

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
    origin = planned_origin(planned)
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


def wanted_shapes(planned: FlightPlanned) -> list[list[Floats]]:
    """Return polylines (n, 3) of each wanted value (M,)."""
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
