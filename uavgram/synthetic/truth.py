"""Truth of a synthetic survey: ground, points, camera poses, pixels, and values of measurements.

The measuring stage has its own code, with covariances; shared code would hide its mistakes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.constants import g as GRAVITY_M_S2  # noqa: N812

from uavgram.geometry.camera.projection import project
from uavgram.geometry.ground.figures import squares_on_plane
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.model.arrays import Bools, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementRequest
from uavgram.stages.plates import OWN_SIGMA_SHARE
from uavgram.synthetic.flight import (
    FlightBiases,
    Motion,
    PhotoRows,
    compute_photo_rows,
    compute_true_poses,
)
from uavgram.synthetic.scenario import GroundSpec, Scenario


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface(FrozenArrays):
    """Heights of the ground.

    Attributes
    ----------
    spec
        Its departures from the plane.
    height_m, slope, middle_m
        z = height + slope . ((e, n) - middle), (2,) and (2,).
    axes
        (2, 2) ``east_north = axes @ scene_xy``.
    wave_per_m, cosine_m, sine_m
        (W, 2), (W,), (W,) of the relief; W = 0 without.
    """

    spec: GroundSpec
    height_m: float
    slope: Annotated[Floats, 2]
    middle_m: Annotated[Floats, 2]
    axes: Annotated[Floats, 2, 2]
    wave_per_m: Annotated[Floats, "w", 2]
    cosine_m: Annotated[Floats, "w"]
    sine_m: Annotated[Floats, "w"]

    def up(self, offset_m: Floats) -> Floats:
        """Return heights (...) at (..., 2) east and north of the scene's middle."""
        plane = self.height_m + offset_m @ self.slope
        if self.spec.is_plane:
            return np.asarray(plane)
        left = (offset_m @ self.axes)[..., 1]
        angle = offset_m @ self.wave_per_m.T
        shape = (
            -self.spec.crown_percent / 100 * np.abs(left)
            + self.spec.slope_break_percent / 100 * np.maximum(left, 0.0)
            + self.spec.kerb_m * (left > self.spec.kerb_y_m)
        )
        return np.asarray(
            plane + shape + np.cos(angle) @ self.cosine_m + np.sin(angle) @ self.sine_m
        )


WAVE_COUNT = 200  # of a relief: enough for normally distributed heights


def draw_surface(scenario: Scenario, rng: np.random.Generator) -> Surface:
    """Draw the ground.

    Parameters
    ----------
    scenario
        Its site and its ground.
    rng
        Draws the plane, where that is drawn, and the relief: a sum of waves whose covariance is a
        Gaussian of the relief's length.
    """
    site, spec = scenario.site, scenario.ground
    axes = site.axes
    stated = (0.0, 0.0) if spec.shape == "level" else site.ground_slope_deg
    slope = np.tan(np.deg2rad(stated)) + np.tan(np.deg2rad(spec.slope_deg)) * axes[:, 0]
    drawn = rng.standard_normal(3)
    slope = slope + np.tan(np.deg2rad(spec.slope_sigma_deg)) * drawn[1:]
    count = WAVE_COUNT if spec.relief_m and spec.relief_length_m else 0
    size = spec.relief_m / np.sqrt(max(count, 1))
    return Surface(
        spec=spec,
        height_m=site.ground_height_m + spec.height_sigma_m * float(drawn[0]),
        slope=slope,
        middle_m=site.middle_m,
        axes=axes,
        wave_per_m=rng.standard_normal((count, 2)) / (spec.relief_length_m or 1.0),
        cosine_m=size * rng.standard_normal(count),
        sine_m=size * rng.standard_normal(count),
    )


PLATE_STEP_M = 0.2
"""Distance to either side over which the slope of the ground at a plate is computed [m]."""


def compute_point_positions(
    scenario: Scenario, surface: Surface, rng: np.random.Generator
) -> Floats:
    """Return world positions (K, 3) of the scenario's points and of its plates' corners.

    Parameters
    ----------
    scenario
        Its points.
    surface
        The ground below them.
    rng
        Draws each point's own departure, where the relief has no length.
    """
    raised = {one.label: one.height_m for one in scenario.habits.raised}
    xy = np.array([[point.x_m, point.y_m] for point in scenario.points])
    offset = xy @ surface.axes.T
    up = surface.up(offset)
    up = up + [point.height_m + raised.get(point.label, 0.0) for point in scenario.points]
    if surface.spec.relief_m and not surface.spec.relief_length_m:
        up = up + surface.spec.relief_m * rng.standard_normal(len(up))
    points = np.column_stack([offset + surface.middle_m, up])
    return np.concatenate([points, _plate_corners(scenario, surface, rng)])


def _plate_corners(scenario: Scenario, surface: Surface, rng: np.random.Generator) -> Floats:
    """Return the (N, 3) corners of all plates: flat, in their printed size, on the ground.

    Clockwise from above, as they are found in photos, from the left end of the far edge. The height
    of a plate is that of the ground below its middle.
    """
    plates = scenario.plates
    if not plates.at:
        return np.zeros((0, 3))
    placed = np.array(plates.at)
    offset = placed[:, :2] @ surface.axes.T
    up = surface.up(offset)
    if surface.spec.relief_m and not surface.spec.relief_length_m:
        up = up + surface.spec.relief_m * rng.standard_normal(len(up))
    # slope of the ground by central differences
    step = PLATE_STEP_M * np.array([[1.0, 0.0], [0.0, 1.0]])
    slope = np.stack([surface.up(offset + d) - surface.up(offset - d) for d in step], axis=-1)
    middle = np.column_stack([offset + surface.middle_m, up])
    east = np.arctan2(*surface.axes[::-1, 0])
    turn = east + np.deg2rad(placed[:, 2])
    side = plates.side_m + plates.sigma_m * float(rng.standard_normal())
    corners = squares_on_plane(middle, slope / (2 * PLATE_STEP_M), turn, side)[:, ::-1]
    own = OWN_SIGMA_SHARE * plates.sigma_m / np.sqrt(2.0)
    return np.asarray((corners + own * rng.standard_normal(corners.shape)).reshape(-1, 3))


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
            units.append(MEASUREMENT_FORMS[request.kind].unit)
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
    return _measure_line_or_plane(request, at)


def _measure_line_or_plane(request: MeasurementRequest, at: Floats) -> float:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyTruth(FrozenArrays):
    """True values, in the world whose origin is the log's home.

    Attributes
    ----------
    frame_id, time_utc_s, center_world_m, world_from_camera
        (F,), (F,), (F, 3), (F, 3, 3) of the stored photos, at their middle rows.
    rows
        Of photos that are read row after row; None: all rows at once.
    intrinsics
        (P,) of the true camera.
    boresight_rad
        (3,) rotation vector in the camera frame, true = nominal @ exp(boresight).
    lever_arm_m, position_bias_m, heading_bias_rad, clock_offset_s
        As in `SharedResult`: biases are log minus truth; camera clock minus UTC.
    surface
        The ground.
    label, point_world_m
        (K,), (K, 3).
    line_length_m
        (L,) in the order of the survey's lines.
    measurement_name, measurement_value, measurement_unit
        (M,) in SI units and degrees; a coordinate has two rows, ``NAME east`` and ``NAME north``.
    """

    frame_id: Annotated[tuple[str, ...], "f"]
    time_utc_s: Annotated[Floats, "f"]
    center_world_m: Annotated[Floats, "f", 3]
    world_from_camera: Annotated[Floats, "f", 3, 3]
    rows: PhotoRows | None
    intrinsics: Annotated[Floats, "p"]
    boresight_rad: Annotated[Floats, 3]
    lever_arm_m: Annotated[Floats, 3]
    position_bias_m: Annotated[Floats, 3]
    heading_bias_rad: float
    clock_offset_s: float
    surface: Surface
    label: Annotated[tuple[str, ...], "k"]
    point_world_m: Annotated[Floats, "k", 3]
    line_length_m: Annotated[Floats, "l"]
    measurement_name: Annotated[tuple[str, ...], "m"]
    measurement_value: Annotated[Floats, "m"]
    measurement_unit: tuple[str, ...]


MAX_ROUNDS = 3


def compute_truth(
    scenario: Scenario,
    requests: tuple[MeasurementRequest, ...],
    flown: tuple[Motion, FlightBiases],
    ground: tuple[Surface, Floats],
    intrinsics: Floats,
    stored: Bools,
) -> SurveyTruth:
    """Return the true values of a survey.

    Parameters
    ----------
    scenario
        Scenario from which it is made.
    requests
        Requested measurements, with true friction.
    flown
        The true flight, and the constant errors of its log.
    ground
        The surface, and the points (K, 3) on it.
    intrinsics
        (P,) of the true camera.
    stored
        (E,) mask of exposures that became photos.
    """
    (motion, biases), (surface, points) = flown, ground
    exposed = motion.exposure_time_s[stored]
    center, rotation = compute_true_poses(motion, biases, exposed)
    row = {label: i for i, label in enumerate(scenario.labels)}
    # ends of the taped lengths, as rows of the points
    ends = np.array([[row[line.start], row[line.end]] for line in scenario.lines], dtype=int)
    ends = ends.reshape(-1, 2)
    names, values, units = compute_true_values(requests, row, points)
    return SurveyTruth(
        frame_id=tuple(f"IMG_{i + 1:04d}.jpg" for i in range(len(center))),
        time_utc_s=scenario.flight.start_utc_s + exposed,
        center_world_m=center,
        world_from_camera=rotation,
        rows=compute_photo_rows(motion, biases, exposed, 1e-3 * scenario.errors.readout_ms),
        intrinsics=intrinsics,
        boresight_rad=biases.boresight_rad,
        lever_arm_m=biases.lever_arm_m,
        position_bias_m=biases.position_m,
        heading_bias_rad=biases.heading_rad,
        clock_offset_s=scenario.errors.camera_clock_offset_s,
        surface=surface,
        label=tuple(row),
        point_world_m=points,
        line_length_m=np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1),
        measurement_name=names,
        measurement_value=values,
        measurement_unit=units,
    )


def project_rolling_shutter(
    calibration: Calibration, truth: SurveyTruth, places_m: Floats
) -> Floats:
    """Project points (F, K, 3) of each photo with a rolling shutter, (F, K, 2) px.

    The time of a row moves a pixel by far less than one row per row, so a few fixed-point
    iterations converge.

    Parameters
    ----------
    calibration
        Calibration with lens model and size.
    truth
        Of the survey.
    places_m
        In the world.
    """
    offset = places_m - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    pixel = project(calibration.model, truth.intrinsics, in_camera)
    if truth.rows is None:
        return pixel
    height = calibration.height_px
    frame = np.broadcast_to(np.arange(len(offset))[:, None], offset.shape[:2])
    # fixed-point iteration: pixel -> row -> pose at its time -> pixel
    for _ in range(MAX_ROUNDS):
        row = np.clip(np.nan_to_num(pixel[..., 1]), 0.0, height - 1.0)
        center, rotation = truth.rows.at(frame, compute_row_share(row, height))
        seen = np.einsum("fkij,fki->fkj", rotation, places_m - center)
        pixel = project(calibration.model, truth.intrinsics, seen)
    return pixel
