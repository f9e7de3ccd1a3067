"""Photos of the simulated scene through the true, distorting camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.camera.projection import project
from uavgram.imaging.demo_scene.ground_texture import paint_ground
from uavgram.imaging.demo_scene.marks import mark_raster
from uavgram.imaging.demo_scene.vehicles import vehicle_raster
from uavgram.imaging.raster import GroundRaster, Image, Weights
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import LensModel
from uavgram.model.scenario.simulated import SimulatedSurvey, SurveyTruth

LENS: LensModel = "brown"
# Rays are computed on a coarse grid and interpolated: with f = 2100 px, k1 = -0.1 the map bends by
# 2e-4 px per px^2, so straight lines across 8 px are 2e-3 px off.
GRID_PX = 8
PADDING_NODES = 2
VIGNETTING = 0.2  # of the light is lost in the corners
SENSOR_NOISE = 2.2  # of 255
EXPOSURE_SIGMA = 0.02
PIXEL_SUBDIVISION_MAX = 4
RELIEF_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class _Sensor:
    """What a lens and a sensor do to the light."""

    falloff: Weights  # (H, W, 3)
    noise: Weights  # (H + 64, W + 64, 3), another part for each photo


def render_photos(survey: SimulatedSurvey) -> Iterator[Image]:
    """Render the survey's photos, one by one in the order of its frames.

    Parameters
    ----------
    survey
        Its truth is photographed; the same survey gives the same photos.

    Yields
    ------
    (height_px, width_px, 3) BGR, as a camera stores it.
    """
    camera, scenario = survey.calibration, survey.scenario
    rng = np.random.default_rng([scenario.seed, 1])
    ground = paint_ground(scenario.road, rng)
    # Marks last: people walk round the cars to spray them.
    details = [vehicle_raster(vehicle) for vehicle in scenario.road.vehicles]
    details += [mark_raster(point) for point in scenario.points]
    sensor = _sensor(camera.width_px, camera.height_px, rng)
    axes = scene_from_world(survey)
    for index in range(len(survey.frame_id)):
        map_x, map_y = ground_map(survey.truth, index, axes, (camera.width_px, camera.height_px))
        photo = _sample(ground, map_x, map_y, cv2.BORDER_REFLECT_101)
        for detail in details:
            _lay_detail(photo, detail, (map_x, map_y), _bounds(survey, index, detail, axes))
        yield _expose(photo, sensor, rng)


def scene_from_world(survey: SimulatedSurvey) -> Floats:
    """(2, 3) affine matrix from world (east, north, 1) to scene (x, y)."""
    site = survey.scenario.site
    azimuth = np.deg2rad(site.road_azimuth_deg)
    turn = np.array([[np.sin(azimuth), np.cos(azimuth)], [-np.cos(azimuth), np.sin(azimuth)]])
    shift = -turn @ [site.scene_east_m, site.scene_north_m]
    return np.column_stack([turn, shift])


def ground_map(
    truth: SurveyTruth, index: int, scene_from_world_m: Floats, size_px: tuple[int, int]
) -> tuple[Weights, Weights]:
    """Scene coordinates (x, y) of the ground seen by every pixel of a photo, (H, W) each [m].

    Parameters
    ----------
    truth, index
        Whose frame.
    scene_from_world_m
        (2, 3), see `scene_from_world`.
    size_px
        Width and height.
    """
    # Nodes at the centres of blocks: cv2.resize then interpolates without any shift.
    nodes = [np.arange(-PADDING_NODES, -(-n // GRID_PX) + PADDING_NODES) for n in size_px]
    u, v = np.meshgrid(*((node + 0.5) * GRID_PX - 0.5 for node in nodes))
    scene = _ground_of(truth, index, np.stack([u, v], axis=-1)) @ scene_from_world_m[:, :2].T
    scene += scene_from_world_m[:, 2]
    whole = (u.shape[1] * GRID_PX, u.shape[0] * GRID_PX)
    fine = cv2.resize(scene.astype(np.float32), whole, interpolation=cv2.INTER_LINEAR)
    first = PADDING_NODES * GRID_PX
    part = fine[first : first + size_px[1], first : first + size_px[0]]
    return np.ascontiguousarray(part[..., 0]), np.ascontiguousarray(part[..., 1])


def _ground_of(truth: SurveyTruth, index: int, pixel: Floats) -> Floats:
    """East and north (..., 2) where the rays of pixels (..., 2) meet the ground."""
    ray = back_project(LENS, truth.intrinsics, pixel) @ truth.world_from_camera[index].T
    center, surface = truth.center_world_m[index], truth.surface
    falling = ray[..., :2] @ surface.slope - ray[..., 2]
    below = center[2] - surface.height_m - float(surface.slope @ (center[:2] - surface.middle_m))
    depth = below / falling
    # What it has beyond its plane slopes by a few per cent: so much of it is left each time.
    for _ in range(0 if surface.spec.is_plane else RELIEF_ROUNDS):
        place = center[:2] + depth[..., None] * ray[..., :2] - surface.middle_m
        up = surface.up(place.reshape(-1, 2)).reshape(depth.shape)
        depth = depth + (center[2] + depth * ray[..., 2] - up) / falling
    ground: Floats = center[:2] + depth[..., None] * ray[..., :2]
    return ground


def _bounds(
    survey: SimulatedSurvey, index: int, detail: GroundRaster, scene_from_world_m: Floats
) -> tuple[int, int, int, int]:
    """Columns and rows [u0, u1), [v0, v1) of a photo that a detail may cover; empty if none."""
    truth, camera = survey.truth, survey.calibration
    plane = (detail.corners_m - scene_from_world_m[:, 2]) @ scene_from_world_m[:, :2]
    up = truth.surface.up(plane - truth.surface.middle_m)
    offset = np.column_stack([plane, up]) - truth.center_world_m[index]
    corner = project(LENS, truth.intrinsics, offset @ truth.world_from_camera[index])
    if np.isnan(corner).any():  # behind the camera, or far outside the lens model
        return 0, 0, 0, 0
    low = np.maximum(np.floor(corner.min(axis=0)) - 2, 0)
    high = np.minimum(np.ceil(corner.max(axis=0)) + 3, [camera.width_px, camera.height_px])
    (u0, v0), (u1, v1) = low.astype(int).tolist(), high.astype(int).tolist()
    return u0, u1, v0, v1


def _sample(raster: GroundRaster, map_x: Weights, map_y: Weights, border: int) -> Image:
    """Look a raster up at scene coordinates (H, W), bilinearly."""
    affine = raster.pixel_from_scene
    u = map_y * np.float32(affine[0, 1]) + np.float32(affine[0, 2])
    v = map_x * np.float32(affine[1, 0]) + np.float32(affine[1, 2])
    sampled: Image = cv2.remap(raster.image, u, v, cv2.INTER_LINEAR, borderMode=border)  # type: ignore[assignment]
    return sampled


def _lay_detail(
    photo: Image,
    detail: GroundRaster,
    maps: tuple[Weights, Weights],
    bounds: tuple[int, int, int, int],
) -> None:
    """Lay a detail over a photo in place; each pixel is the mean of its subdivisions."""
    u0, u1, v0, v1 = bounds
    if u1 - u0 < 3 or v1 - v0 < 3:
        return
    part = np.s_[v0:v1, u0:u1]
    gsd_m = abs(float(maps[0][v0, u0] - maps[0][v1 - 1, u0])) / (v1 - 1 - v0)
    times = int(np.clip(np.ceil(gsd_m / detail.resolution_m), 1, PIXEL_SUBDIVISION_MAX))
    width, height = u1 - u0, v1 - v0
    whole = (width * times, height * times)
    fine = [np.asarray(cv2.resize(m[part], whole), np.float32) for m in maps]
    sampled = _sample(detail, fine[0], fine[1], cv2.BORDER_CONSTANT).astype(np.float32)
    mean = cv2.resize(sampled, (width, height), interpolation=cv2.INTER_AREA)
    under = photo[part] * (1.0 - mean[..., 3:] / 255.0)
    photo[part] = np.clip(np.round(under + mean[..., :3]), 0, 255).astype(np.uint8)


def _sensor(width: int, height: int, rng: np.random.Generator) -> _Sensor:
    v, u = np.indices((height, width), dtype=np.float32)
    radius2 = (u / width - 0.5) ** 2 + (v / height - 0.5) ** 2
    falloff = (1.0 - 2.0 * VIGNETTING * radius2).astype(np.float32)
    noise = rng.standard_normal((height + 64, width + 64, 3), dtype=np.float32)
    return _Sensor(cv2.merge([falloff] * 3), noise * np.float32(SENSOR_NOISE))  # type: ignore[arg-type]


def _expose(photo: Image, sensor: _Sensor, rng: np.random.Generator) -> Image:
    gain = 1.0 + EXPOSURE_SIGMA * float(rng.standard_normal())
    du, dv = rng.integers(0, 64, 2).tolist()
    noise = sensor.noise[dv : dv + photo.shape[0], du : du + photo.shape[1]]
    light = cv2.multiply(photo, sensor.falloff, scale=gain, dtype=cv2.CV_32F)
    exposed: Image = cv2.add(light, noise, dtype=cv2.CV_8U)  # type: ignore[assignment]
    return exposed
