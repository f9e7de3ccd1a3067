"""Convert a result on the ground to layers for maps, drawings and the review."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, sight_lines
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Poses
from uavgram.model.maps import Features, Layer, ProfileSheet, ShapeKind, close_ring
from uavgram.model.naming import round_up
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PlanarUncertainty, PointResults, ProfileResults
from uavgram.stages.products.columns import (
    CONTROL_LINES,
    LENGTHS,
    MEASUREMENTS,
    POINTS,
    attributes,
)

ENCLOSED = frozenset({"area", "volume"})
"""Kinds of measurement that are drawn as polygons of their points."""


def shape(kind: str, corners: Floats) -> Floats:
    """Return the polyline (n, 3) of a measurement on its corners (k, 3); n = 0 for one point."""
    if kind == "coordinate" or len(corners) < 2:
        return np.empty((0, 3))
    if kind in ENCLOSED:
        return close_ring(corners)
    if kind == "plane_distance" and len(corners) == 4:
        return np.stack([corners[0], _foot_on_plane(corners)])
    if kind == "line_distance" and len(corners) > 2:
        start, end = corners[1], corners[-1]
        along = end - start
        squared = float(along @ along)
        share = float((corners[0] - start) @ along) / squared if squared > 0 else 0.0
        return np.stack([corners[0], start + share * along])
    return corners


def _foot_on_plane(corners: Floats) -> Floats:
    """Return the foot (3,) of the first of four points on the plane through the others."""
    across = np.cross(corners[2] - corners[1], corners[3] - corners[1])
    squared = float(across @ across)
    share = float((corners[0] - corners[1]) @ across) / squared if squared > 0 else 0.0
    return np.asarray(corners[0] - share * across)


def counterclockwise(ring: Floats) -> Floats:
    """Orient a ring (v, 3) counterclockwise, seen from above (shoelace formula)."""
    east, north = (ring[:, :2] - ring[0, :2]).T
    doubled = float(np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north))
    return ring[::-1].copy() if doubled < 0 else ring


HEIGHT_COLUMNS = ("height_above_ground_m", "height_sigma_m")
"""Columns of a point's height in maps and drawings."""


def ground_below(points: PointResults) -> Floats:
    """Return places (K, 3) on the ground straight below the points; their own if on the ground."""
    feet = np.array(points.position_world_m)
    feet[:, 2] -= np.nan_to_num(points.height_above_ground_m)
    return feet


def compute_heights_over_ground(
    points: PointResults, shapes: Sequence[Floats], labels: Sequence[Sequence[str]]
) -> tuple[Floats, ...]:
    """Compute heights of the vertices of shapes over the ground; empty where all are on it.

    A vertex that is not a point of the shape, such as a foot, is assumed to have the ground of the
    nearest one.

    Parameters
    ----------
    points
        All points.
    shapes
        (v, 3) vertices of each shape; v = 0 where it has no place.
    labels
        Points of each shape.

    Returns
    -------
    (v,)
        For each shape [m].
    """
    rows = {label: k for k, label in enumerate(points.label)}
    off, feet = points.is_off_ground, ground_below(points)
    if not any(off[rows[label]] for names in labels for label in names if label in rows):
        return ()
    above = []
    for vertices, names in zip(shapes, labels, strict=True):
        if not len(vertices):
            above.append(np.zeros(0))
            continue
        below = feet[[rows[label] for label in names]]
        apart = np.linalg.norm(vertices[:, None, :2] - below[None, :, :2], axis=2)
        above.append(vertices[:, 2] - below[apart.argmin(axis=1), 2])
    return tuple(above)


def verticals(points: PointResults) -> Layer:
    """Return lines from the ground up to each point off it."""
    rows, feet = np.flatnonzero(points.is_off_ground), ground_below(points)
    return Layer(
        name="verticals",
        kind="line",
        vertices_m=tuple(np.stack([feet[k], points.position_world_m[k]]) for k in rows),
        attributes={
            "label": tuple(points.label[k] for k in rows),
            **{name: tuple(getattr(points, name)[rows].tolist()) for name in HEIGHT_COLUMNS},
            "height_source": tuple(points.height_source[k] for k in rows),
        },
        above_ground_m=tuple(np.array([0.0, points.height_above_ground_m[k]]) for k in rows),
    )


TWO_SIDED_95 = 1.959963984540054
"""Half width of a 95 % interval of a normal distribution, in sigmas."""

_EXAGGERATIONS = (1, 2, 5, 10, 20, 50, 100)
_HEIGHT_SHARE = 0.3  # largest height of a drawing, as a share of the length
_LEAST_SHARE = 0.06  # smallest height, as a share of the length
_STATION_TICKS, _HEIGHT_TICKS = 8, 5


def profile_sheets(profiles: ProfileResults, unit_m: float = 1.0) -> tuple[ProfileSheet, ...]:
    """Return all profiles, each with axes that show its points and the intervals of their heights.

    Parameters
    ----------
    profiles
        Profiles as measured.
    unit_m
        Length in which the numbers at the axes are round.
    """
    return tuple(
        _sheet(
            name,
            [profiles.label[i] for i in rows],
            profiles.place_m[rows],
            profiles.sigma_m[rows],
            unit_m,
        )
        for name, rows in profiles.each()
    )


def _sheet(
    name: str, label: list[str], place_m: Floats, sigma_m: Floats, unit_m: float
) -> ProfileSheet:
    station, _, height, ground = place_m.T
    station_sigma, _, height_sigma, ground_sigma = sigma_m.T
    bounds = np.concatenate(
        [height + side * TWO_SIDED_95 * height_sigma for side in (-1, 1)]
        + [ground + side * TWO_SIDED_95 * ground_sigma for side in (-1, 1)]
    )
    low, high = float(bounds.min()), float(bounds.max())
    length = float(np.ptp(station))
    wanted = [x for x in _EXAGGERATIONS if x * (high - low) <= _HEIGHT_SHARE * length]
    exaggeration = max(wanted, default=1)
    missing = _LEAST_SHARE * length / exaggeration - (high - low)
    if missing > 0:
        low, high = low - missing / 2, high + missing / 2
    return ProfileSheet(
        name=name,
        label=tuple(label),
        station_m=station,
        height_m=height,
        ground_m=ground,
        station_sigma_m=station_sigma,
        height_sigma_m=height_sigma,
        ground_sigma_m=ground_sigma,
        station_ticks_m=unit_m
        * ticks(float(station.min()) / unit_m, float(station.max()) / unit_m, _STATION_TICKS),
        height_ticks_m=unit_m * ticks(low / unit_m, high / unit_m, _HEIGHT_TICKS),
        exaggeration=exaggeration,
    )


def ticks(low: float, high: float, most: int) -> Floats:
    """Return multiples of 1, 2 or 5 times a power of ten that enclose `low` and `high`.

    Parameters
    ----------
    low, high
        Enclosed values; they differ.
    most
        Largest number of steps in between; one or two more where the ends are no multiples.
    """
    step = round_up((high - low) / most)
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return np.arange(first, last + 0.5) * float(step)


ELLIPSE_VERTICES = 36
"""Vertices of an ellipse drawn as a polygon: its area is 0.5 % less than the curve's."""

BORDER_SAMPLES = 8
"""Samples on each side of a photo: its border on the ground is curved by the lens."""


def features_of(result: Result, crs: str | None, unit_m: float = 1.0) -> Features:
    """Return all layers of a result.

    Parameters
    ----------
    result
        Result of a run.
    crs
        Projected coordinate system for maps; None where the survey is not tied to the earth.
    unit_m
        Length in which numbers at the axes of drawings are round.
    """
    world, points = result.world, result.points
    return Features(
        name=result.name,
        layers=(
            _footprints(result),
            _cameras(result),
            _ellipses("ellipses_95", points, points),
            _ellipses("ellipses_95_within_survey", points, points.relative),
            _known_lengths(result),
            *([_control_lines(result)] if result.control_lines.name else []),
            _make_measured_layer("measured_areas", "polygon", result),
            _make_measured_layer("measured_lines", "line", result),
            *([verticals(points)] if points.is_off_ground.any() else []),
            _points(result),
        ),
        origin=world.origin,
        height_datum=world.height_datum,
        crs=crs if world.origin is not None else None,
        profiles=profile_sheets(result.profiles, unit_m),
        ellipsoid_shift_m=world.ellipsoid_shift_m,
    )


def make_located_layers(result: Result) -> tuple[Layer, ...]:
    """Return points, their ellipses, and a layer without attributes for each measurement."""
    points, strips, rows = result.points, _strips(result), point_index(result)
    layers = [
        replace(_points(result), name="point"),
        _ellipses("ellipse_95", points, points),
    ]
    measured = result.measurements
    for i, (kind, labels) in enumerate(zip(measured.kind, measured.outlines, strict=True)):
        shape_kind: ShapeKind = "line"
        vertices = strips.get(i, np.empty((0, 3)))
        if len(labels) == 1 and labels[0] in rows:
            shape_kind, vertices = "point", points.position_world_m[[rows[labels[0]]]]
        elif kind in ENCLOSED and len(vertices):
            shape_kind, vertices = "polygon", counterclockwise(vertices[:-1])
        layers.append(
            Layer(name="measurement", kind=shape_kind, vertices_m=(vertices,), attributes={})
        )
    return tuple(layers)


def point_index(result: Result) -> dict[str, int]:
    """Return the row of each label."""
    return {label: k for k, label in enumerate(result.points.label)}


def reference_strips(result: Result) -> dict[int, Floats]:
    """Return the ends (2, 3) in the world of each known length that has both, by its row."""
    rows, lines = point_index(result), result.lines
    position = result.points.position_world_m
    return {
        i: position[[rows[start], rows[end]]]
        for i, (start, end) in enumerate(zip(lines.start, lines.end, strict=True))
        if start in rows and end in rows
    }


def position_strips(result: Result) -> list[Floats]:
    """Return the ends (2, 3) in the world of each line of known position."""
    lines = result.control_lines
    return list(np.stack([lines.start_world_m, lines.end_world_m], axis=1))


def measured_strips(result: Result) -> dict[int, Floats]:
    """Return the polyline (n, 3) of each computed measurement, by its row; coordinates have none.

    Those of areas are closed.
    """
    value = result.measurements.value
    return {i: strip for i, strip in _strips(result).items() if np.isfinite(value[i])}


class GroundLine(NamedTuple):
    """Line of a survey on the ground: its layer, its status, and its polyline (n, 3)."""

    layer: str
    status: str
    strip: Floats


def ground_lines(result: Result) -> list[GroundLine]:
    """Return all lines with a place: measured ones, known lengths, and lines of known position."""
    measured, known, stated = result.measurements, result.lines, result.control_lines
    return [
        *(
            GroundLine(
                "measured_areas" if measured.kind[i] in ENCLOSED else "measured_lines",
                measured.status[i],
                strip,
            )
            for i, strip in measured_strips(result).items()
        ),
        *(
            GroundLine("known_lengths", known.status[i], strip)
            for i, strip in reference_strips(result).items()
        ),
        *(
            GroundLine("control_lines", status, strip)
            for status, strip in zip(stated.status, position_strips(result), strict=True)
        ),
    ]


def _strips(result: Result) -> dict[int, Floats]:
    """Return the polyline (n, 3) of each measurement whose points have places, by its row."""
    rows, strips = point_index(result), dict[int, Floats]()
    measured = result.measurements
    for i, (kind, labels) in enumerate(zip(measured.kind, measured.outlines, strict=True)):
        if all(label in rows for label in labels):
            at = [rows[label] for label in labels]
            corners = result.points.position_world_m[at]
            if kind == "height" and len(at) == 1:  # from the ground below
                corners = np.concatenate([ground_below(result.points)[at], corners])
            if len(strip := shape(kind, corners)):
                strips[i] = strip
    return strips


def ellipse_outlines(
    center: Floats, semi_axes: Floats, azimuth_rad: Floats, factor: float, samples: int = 33
) -> Floats:
    """Compute closed outlines (K, samples, 2) of ellipses, east and north.

    Parameters
    ----------
    center
        (K, 2) east, north.
    semi_axes
        (K, 2) semi-major, semi-minor [m].
    azimuth_rad
        (K,) of the major axis, clockwise from north.
    factor
        Exaggeration.
    samples
        Number of samples of the outline, first and last the same; clockwise.
    """
    turn = np.linspace(0.0, 2 * np.pi, samples)
    along = np.stack([np.sin(azimuth_rad), np.cos(azimuth_rad)], axis=-1)
    across = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    major = (factor * semi_axes[:, 0])[:, None, None] * along[:, None, :]
    minor = (factor * semi_axes[:, 1])[:, None, None] * across[:, None, :]
    outline = center[:, None, :] + np.cos(turn)[:, None] * major + np.sin(turn)[:, None] * minor
    return np.asarray(outline, dtype=np.float64)


def footprints(result: Result) -> dict[int, Floats]:
    """Compute the border (v, 3) on the ground of each frame with a pose, by row; counterclockwise.

    The part of a photo above the horizon, or outside the lens model, has no ground: its border runs
    straight between the parts with ground.
    """
    # Pixels along the border of the photo, with the outer edges of the outer pixels.
    camera = result.camera
    along = np.arange(BORDER_SAMPLES) / BORDER_SAMPLES
    zero, one = np.zeros_like(along), np.ones_like(along)
    east = np.concatenate([along, one, one - along, zero])
    side = np.column_stack([east, np.roll(east, BORDER_SAMPLES)])
    border = side * [camera.width_px, camera.height_px] - 0.5
    seen, poses = select_shown_poses(result)
    of_rows = RowPoses(
        poses.center_world_m[:, None],
        poses.world_from_camera[:, None],
        result.frames.sweep[seen][:, None],
    )
    world = intersect_ground(
        *sight_lines(camera, result.shared.intrinsics.value, of_rows, border),
        result.plane.surface,
        result.plane.pivot_m,
    )
    rings = {int(f): ring[np.isfinite(ring[:, 0])] for f, ring in zip(seen, world, strict=True)}
    return {f: counterclockwise(ring) for f, ring in rings.items() if len(ring) >= 3}


def select_shown_poses(result: Result) -> tuple[Ints, Poses]:
    """Return rows of the frames with a pose, and the adjusted pose, or else the telemetry's."""
    frames, adjusted = result.frames, result.has_refined
    rows = np.flatnonzero(adjusted | result.has_seed)
    tables = {
        name: np.where(
            adjusted[rows].reshape(-1, *[1] * (after.ndim - 1)),
            after[rows],
            getattr(frames.seed, name)[rows],
        )
        for name, after in vars(frames.refined).items()
    }
    return rows, Poses(frame_id=tuple(frames.frame_id[i] for i in rows), **tables)


def _column(values: Floats) -> tuple[float, ...]:
    return tuple(values.tolist())


def _columns(values: Floats, *names: str) -> dict[str, tuple[float, ...]]:
    """Return the columns of values (n, k) by their names."""
    return {name: _column(column) for name, column in zip(names, values.T, strict=True)}


def _points(result: Result) -> Layer:
    points = result.points
    return Layer(
        name="points",
        kind="point",
        vertices_m=tuple(one.copy() for one in points.position_world_m[:, None]),
        attributes=attributes(POINTS, result),
        above_ground_m=compute_heights_over_ground(
            points,
            list(points.position_world_m[:, None]),
            [(label,) for label in points.label],
        ),
    )


def _ellipses(
    name: str, points: PointResults, uncertainty: PointResults | PlanarUncertainty
) -> Layer:
    outline = ellipse_outlines(
        points.position_world_m[:, :2],
        uncertainty.ellipse_95_m,
        uncertainty.ellipse_azimuth_rad,
        1.0,
        ELLIPSE_VERTICES + 1,
    )[:, -1:0:-1]  # open, and against the clock
    up = np.broadcast_to(points.position_world_m[:, None, 2:], (*outline.shape[:2], 1))
    return Layer(
        name=name,
        kind="polygon",
        vertices_m=tuple(np.concatenate([outline, up], axis=2)),
        attributes={
            "label": points.label,
            **_columns(uncertainty.ellipse_95_m, "semi_major_m", "semi_minor_m"),
            "azimuth_deg": _column(np.rad2deg(uncertainty.ellipse_azimuth_rad)),
        },
    )


def _known_lengths(result: Result) -> Layer:
    lines, strips = result.lines, reference_strips(result)
    nowhere = np.empty((0, 3))
    vertices = tuple(strips.get(i, nowhere) for i in range(len(lines.name)))
    ends = list(zip(lines.start, lines.end, strict=True))
    return Layer(
        name="known_lengths",
        kind="line",
        vertices_m=vertices,
        above_ground_m=compute_heights_over_ground(result.points, vertices, ends),
        attributes=attributes(LENGTHS, result),
    )


def _control_lines(result: Result) -> Layer:
    return Layer(
        name="control_lines",
        kind="line",
        vertices_m=tuple(position_strips(result)),
        attributes=attributes(CONTROL_LINES, result),
    )


def _make_measured_layer(name: str, kind: str, result: Result) -> Layer:
    """Return measurements of areas (``polygon``), or lines; coordinates are points already."""
    measured, strips = result.measurements, measured_strips(result)
    is_area = np.array([k in ENCLOSED for k in measured.kind], dtype=bool)
    is_line = ~is_area & np.array([k != "coordinate" for k in measured.kind], dtype=bool)
    rows = np.flatnonzero(is_area if kind == "polygon" else is_line)
    vertices = []
    for i in rows:
        strip = strips.get(int(i), np.empty((0, 3)))
        vertices.append(counterclockwise(strip[:-1]) if is_area[i] and len(strip) else strip)
    return Layer(
        name=name,
        kind="polygon" if kind == "polygon" else "line",
        vertices_m=tuple(vertices),
        above_ground_m=compute_heights_over_ground(
            result.points, vertices, [measured.outlines[i] for i in rows]
        ),
        attributes=attributes(MEASUREMENTS, result, rows.tolist()),
    )


def _footprints(result: Result) -> Layer:
    rings, frames = footprints(result), result.frames
    rows = list(rings)
    return Layer(
        name="footprints",
        kind="polygon",
        vertices_m=tuple(rings.values()),
        attributes={
            "frame": tuple(frames.frame_id[i] for i in rows),
            "status": tuple(frames.status[i] for i in rows),
        },
    )


def _cameras(result: Result) -> Layer:
    rows, poses = select_shown_poses(result)
    frames = result.frames
    variance = np.einsum("nii->ni", poses.covariance)
    optical = poses.world_from_camera[:, :, 2]
    return Layer(
        name="camera_poses",
        kind="point",
        vertices_m=tuple(poses.center_world_m[:, None].copy()),
        attributes={
            "frame": poses.frame_id,
            "status": tuple(frames.status[i] for i in rows),
            "time_utc_s": _column(frames.time_utc_s[rows]),
            "tilt_deg": _column(np.rad2deg(np.arccos(np.clip(-optical[:, 2], -1.0, 1.0)))),
            "azimuth_deg": _column(np.rad2deg(np.arctan2(optical[:, 0], optical[:, 1])) % 360.0),
            **_columns(np.sqrt(variance[:, :3]), "sigma_east_m", "sigma_north_m", "sigma_up_m"),
        },
    )
