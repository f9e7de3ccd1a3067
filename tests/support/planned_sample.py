"""A plan of a crossing, made up: what a plan leaves the house as is tested on it."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from pyproj import Transformer

from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.planned import (
    AccuracyGrid,
    Assumptions,
    FlightFacts,
    FlightPlanned,
    Gain,
    PlannedFrames,
    PlannedLines,
    PlannedMeasurements,
    PlannedPlates,
    PlannedPoints,
    PlannedSite,
)

GROUND_M = -0.4
HEIGHT_M = 40.0
PITCH_DEG = -80.0
SIZE_PX = (4000, 3000)
FOCAL_PX = 3000.0
_TURN = np.deg2rad(20.0)


def sample_plates() -> PlannedPlates:
    """Two plates of 70 cm in that area."""
    middle = _on_ground([(-15.0, -12.0), (18.0, 10.0)])
    square = 0.35 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return PlannedPlates(
        name=("T0", "T1"),
        corner_world_m=middle[:, None] + square,
        side_m=0.7,
        frames_seen=np.array([3.0, 2.0]),
        mean_sigma_without=np.array([0.02, 0.03]),
    )


def sample_plan() -> FlightPlanned:
    """Two strips of three photos over 40 x 30 m, five lines, four values."""
    lines = _lines()
    points = {"A": (-12.0, -3.0), "B": (11.0, -2.0), "C": (-6.0, 8.0), "D": (9.0, 9.5)}
    grid = _grid()
    return FlightPlanned(
        name="crossing",
        site=PlannedSite(
            latitude_deg=-33.8567844,
            longitude_deg=151.2152967,
            height_msl_m=12.5,
            undulation_m=22.6,
            ground_height_m=GROUND_M,
        ),
        camera=_camera(),
        drone="DJI Mavic 3",
        area_world_m=_on_ground([(-20, -15), (20, -15), (20, 15), (-20, 15)]),
        no_go_world_m=(_on_ground([(13, -15), (20, -15), (20, -8), (15, -6)]),),
        flight=FlightFacts(
            pattern="strip",
            height_m=HEIGHT_M,
            gimbal_pitch_deg=PITCH_DEG,
            speed_m_s=4.0,
            seconds_per_photo=3.0,
            path_m=74.0,
            duration_s=96.0,
            battery_s=1500.0,
            max_height_m=120.0,
            ground_sample_m=HEIGHT_M / FOCAL_PX,
        ),
        assumptions=Assumptions(
            telemetry="consumer",
            pick_sigma_px=0.8,
            tape_sigma_m=0.01,
            tape_scale_sigma=0.001,
            roughness_m=0.05,
            deviation_m=2.0,
            deviation_deg=1.8,
        ),
        frames=_frames(),
        lines=lines,
        points=PlannedPoints(label=tuple(points), world_m=_on_ground(list(points.values()))),
        measurements=PlannedMeasurements(
            name=("skid left", "car to kerb", "debris", "impact <to> kerb"),
            kind=("distance", "distance", "area", "line_distance"),
            unit=("m", "m", "m2", "m"),
            points=(("A", "B"), ("C", "D"), ("A", "B", "D", "C"), ("A", "C", "D")),
            value=np.array([23.02, 15.07, 208.4, 11.3]),
            sigma=np.array([0.021, 0.016, 0.31, 0.034]),
            wanted_sigma=np.array([0.03, 0.02, np.nan, 0.025]),
        ),
        grid=grid,
        mean_sigma=float(np.nanmean(grid.sigma_m)),
        gains=(Gain(what="a sixth line", mean_sigma=0.013), Gain(what="no loss", mean_sigma=0.016)),
        messages=(
            Message("warning", "plan-hidden", "1 wanted value stays above what was asked for."),
        ),
    )


def in_metres(lonlat: Floats | list[Any]) -> Floats:
    """(n, 2) in the sample's world, of longitudes and latitudes [deg].

    By another projection (azimuthal equidistant) than the program's.
    """
    site = sample_plan().site
    flat = Transformer.from_crs(
        "EPSG:4326",
        f"+proj=aeqd +lat_0={site.latitude_deg} +lon_0={site.longitude_deg} +datum=WGS84",
        always_xy=True,
    )
    longitude, latitude = np.asarray(lonlat)[:, :2].T
    return np.column_stack(flat.transform(longitude, latitude))


def none_of(part: Any) -> Any:  # noqa: ANN401
    """The same part of a plan with no row."""
    return replace(part, **{field.name: getattr(part, field.name)[:0] for field in fields(part)})


def bare_plan() -> FlightPlanned:
    """The same photos, and nothing else: no line, nothing wanted, nothing that can be measured."""
    plan = sample_plan()
    grid = replace(plan.grid, sigma_m=np.full(len(plan.grid.sigma_m), np.nan))
    return replace(
        plan,
        lines=none_of(plan.lines),
        measurements=none_of(plan.measurements),
        points=none_of(plan.points),
        grid=grid,
        no_go_world_m=(),
        messages=(),
    )


def _on_ground(places: list[tuple[float, float]]) -> Floats:
    """(n, 3) in the world of (n, 2) places in axes turned by 20 degrees."""
    flat = np.array(places, dtype=np.float64)
    turn = np.array([[np.cos(_TURN), np.sin(_TURN)], [-np.sin(_TURN), np.cos(_TURN)]])
    return np.column_stack([flat @ turn, np.full(len(flat), GROUND_M)])


def _camera() -> Calibration:
    width, height = SIZE_PX
    parameters = np.array([FOCAL_PX, FOCAL_PX, width / 2, height / 2, -0.02, 0.01, 0.0, 0.0, 0.0])
    return Calibration(
        name="sample",
        model="brown",
        width_px=width,
        height_px=height,
        parameters=parameters,
        covariance=np.diag([4.0, 4.0, 2.0, 2.0, 1e-3, 1e-3, 1e-4, 1e-4, 1e-3]) ** 2,
    )


def world_from_camera(heading_deg: float, pitch_deg: float) -> Floats:
    """(3, 3) columns: image right, image down, optical axis, of a level camera."""
    heading, pitch = np.deg2rad([heading_deg, pitch_deg])
    ahead = np.array([np.sin(heading), np.cos(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    axis = np.cos(pitch) * ahead + np.sin(pitch) * up
    right = np.cross(ahead, up)
    return np.stack([right, np.cross(axis, right), axis], axis=1)


def _frames() -> PlannedFrames:
    along = (-14.0, 0.0, 14.0)
    places = [(x, -5.0) for x in along] + [(x, 5.0) for x in reversed(along)]
    heading = np.repeat([90.0 - 20.0, 270.0 - 20.0], 3)
    center = _on_ground(places) + np.array([0.0, 0.0, HEIGHT_M])
    poses = np.stack([world_from_camera(h, PITCH_DEG) for h in heading])
    return PlannedFrames(
        name=tuple(f"P{k}" for k in range(1, 7)),
        center_world_m=center,
        world_from_camera=poses,
        heading_deg=heading,
        gimbal_pitch_deg=np.full(6, PITCH_DEG),
        height_above_ground_m=np.full(6, HEIGHT_M),
        footprint_world_m=_footprints(center, poses, 1.0),
        safe_footprint_world_m=_footprints(center, poses, 0.85),
    )


def _footprints(center: Floats, poses: Floats, share: float) -> Floats:
    half = share * np.array(SIZE_PX) / 2 / FOCAL_PX
    corners = np.array([[-1, 1, 1], [1, 1, 1], [1, -1, 1], [-1, -1, 1]]) * np.array([*half, 1.0])
    rays = np.einsum("nij,kj->nki", poses, corners)
    depth = (GROUND_M - center[:, None, 2]) / rays[..., 2]
    return np.asarray(center[:, None] + depth[..., None] * rays)


def _lines() -> PlannedLines:
    ends = [
        ((-18.8, -13.8), (-4.6, -13.8)), ((-18.8, 13.8), (-4.6, 13.8)),
        ((18.8, 13.8), (18.8, -0.2)), ((-18.8, -7.0), (-18.8, 7.0)), ((0.0, -13.8), (12.0, -9.0)),
    ]  # fmt: skip
    start = _on_ground([one for one, _ in ends])
    end = _on_ground([other for _, other in ends])
    return PlannedLines(
        name=tuple(f"L{k}" for k in range(1, len(ends) + 1)),
        start_world_m=start,
        end_world_m=end,
        length_m=np.linalg.norm(end - start, axis=1),
        sigma_m=np.full(len(ends), 0.01),
        frames_seen=np.array([4.0, 5.0, 4.0, 2.0, 3.0]),
        redundancy=np.array([0.3, 0.31, 0.28, 0.0, 0.22]),
        mdb_m=np.array([0.076, 0.074, 0.079, np.nan, 0.09]),
        mean_sigma_without=np.array([0.0151, 0.0155, 0.019, 0.0172, np.nan]),
    )


def _grid() -> AccuracyGrid:
    east, north = np.meshgrid(np.arange(-19, 20, 2.0), np.arange(-14, 15, 2.0))
    places = np.stack([east.ravel(), north.ravel()], axis=1)
    sigma = 0.012 + 2e-5 * (places**2).sum(axis=1)
    sigma[(places > 16).any(axis=1) & (places[:, 1] < -10)] = np.nan
    return AccuracyGrid(
        center_world_m=_on_ground([(float(x), float(y)) for x, y in places]),
        cell_m=2.0,
        length_m=5.0,
        sigma_m=sigma,
    )
