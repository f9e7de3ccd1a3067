"""Renderer of photos of the simulated scene through the true, distorting camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.imaging.raster import GroundRaster, Image, Weights
from uavgram.model.arrays import Floats
from uavgram.synthetic.scene_picture import Detail, list_details, paint_ground
from uavgram.synthetic.survey import SimulatedSurvey
from uavgram.synthetic.truth import Surface

# Rays are computed on a coarse grid and interpolated: with f = 2100 px, k1 = -0.1 the map bends by
# 2e-4 px per px^2, so linear interpolation over 8 px is wrong by 2e-3 px.
GRID_PX = 8
PADDING_NODES = 2
RELIEF_ROUNDS = 4
MARGIN_PX = 2
NOWHERE_M = 1e4
"""Coordinate of pixels without a ray in the lens model, and limit of all others [m]."""
READOUT_TIMES = np.array([-0.5, 0.0, 0.5])
"""First, middle and last row, in readout times."""


class PhotoPart(NamedTuple):
    """Columns [left, right) and rows [top, bottom) of a photo."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


def get_whole_photo(survey: SimulatedSurvey) -> PhotoPart:
    """Return the part that is the whole photo."""
    return PhotoPart(0, 0, survey.calibration.width_px, survey.calibration.height_px)


def compute_ground_map(
    survey: SimulatedSurvey, index: int, part: PhotoPart, sheet: Surface
) -> tuple[Weights, Weights]:
    """Compute the scene coordinates (x, y) of the pixels of a photo, (H, W) each [m].

    Parameters
    ----------
    survey, index
        The survey, and index of its frame.
    part
        Part of the photo.
    sheet
        Surface that the pixels show.
    """
    # nodes at the centres of blocks: cv2.resize then interpolates without a shift
    first = np.array([part.left, part.top]) // GRID_PX - PADDING_NODES
    last = -(-np.array([part.right, part.bottom]) // GRID_PX) + PADDING_NODES
    u, v = np.meshgrid(
        *((np.arange(a, b) + 0.5) * GRID_PX - 0.5 for a, b in zip(first, last, strict=True))
    )
    scene = survey.scenario.site.in_scene(
        _intersect_sheet(survey, index, np.stack([u, v], axis=-1), sheet)
    )
    whole = (u.shape[1] * GRID_PX, u.shape[0] * GRID_PX)
    scene = np.nan_to_num(np.clip(scene, -NOWHERE_M, NOWHERE_M), nan=NOWHERE_M)
    fine = cv2.resize(scene.astype(np.float32), whole, interpolation=cv2.INTER_LINEAR)
    left, top = (np.array([part.left, part.top]) - first * GRID_PX).tolist()
    cut = fine[top : top + part.bottom - part.top, left : left + part.right - part.left]
    return np.ascontiguousarray(cut[..., 0]), np.ascontiguousarray(cut[..., 1])


def find_part_showing(
    survey: SimulatedSurvey, index: int, corners_m: Floats, sheet: Surface
) -> PhotoPart:
    """Return the part of a photo that may show the area between some corners, or an empty part.

    Parameters
    ----------
    survey, index
        The survey, and index of its frame.
    corners_m
        (K, 2) in the scene.
    sheet
        Surface with the corners.
    """
    truth = survey.truth
    plane = survey.scenario.site.in_world(corners_m)
    up = sheet.up(plane - truth.surface.middle_m)
    center, rotation = _poses(survey, index, READOUT_TIMES)
    away = np.column_stack([plane, up]) - center[:, None]
    camera = survey.calibration
    corner = project(camera.model, truth.intrinsics, away @ rotation).reshape(-1, 2)
    if np.isnan(corner).any():  # behind the camera, or far outside the lens model
        return PhotoPart(0, 0, 0, 0)
    size = [camera.width_px, camera.height_px]
    low = np.maximum(np.floor(corner.min(axis=0)) - MARGIN_PX, 0)
    high = np.minimum(np.ceil(corner.max(axis=0)) + MARGIN_PX + 1, size)
    return PhotoPart(*low.astype(int).tolist(), *high.astype(int).tolist())


def _intersect_sheet(survey: SimulatedSurvey, index: int, pixel: Floats, sheet: Surface) -> Floats:
    """Intersect the rays of pixels (H, W, 2) with a sheet: east and north (H, W, 2)."""
    truth, camera = survey.truth, survey.calibration
    # one pose for each row of nodes
    share = compute_row_share(pixel[:, 0, 1], camera.height_px)
    center, rotation = _poses(survey, index, share)
    center = center[:, None]
    ray = back_project(camera.model, truth.intrinsics, pixel) @ np.swapaxes(rotation, -1, -2)
    falling = ray[..., :2] @ sheet.slope - ray[..., 2]
    from_middle = center[..., :2] - truth.surface.middle_m
    depth = (center[..., 2] - sheet.height_m - from_middle @ sheet.slope) / falling
    # fixed-point iteration for departures from the plane: their slopes of a few per cent are the
    # factor by which the error falls in each round
    for _ in range(0 if sheet.spec.is_plane else RELIEF_ROUNDS):
        up = sheet.up(from_middle + depth[..., None] * ray[..., :2])
        depth = depth + (center[..., 2] + depth * ray[..., 2] - up) / falling
    return np.asarray(center[..., :2] + depth[..., None] * ray[..., :2])


def _poses(survey: SimulatedSurvey, index: int, share: Floats) -> tuple[Floats, Floats]:
    """Return centres (R, 3) and rotations (R, 3, 3) at the times of rows (rolling shutter)."""
    truth = survey.truth
    if truth.rows is not None:
        return truth.rows.at(index, share)
    center = np.broadcast_to(truth.center_world_m[index], (len(share), 3))
    return center, np.broadcast_to(truth.world_from_camera[index], (len(share), 3, 3))


VIGNETTING = 0.2  # share of the light lost in the corners
SENSOR_NOISE = 2.2  # of 255
EXPOSURE_SIGMA = 0.02
PIXEL_SUBDIVISION_MAX = 4
MAX_DISTANCE_M = 500.0  # limit of the mirrored ground, since each reflection takes time
MIN_SIZE_PX = 3  # details on fewer pixels are left out


@dataclass(frozen=True, eq=False)
class _Sensor:
    """Effect of lens and sensor on the light."""

    falloff: Weights  # (H, W, 3)
    noise: Weights  # (H + 64, W + 64, 3), of which each photo gets another part


def render_photos(survey: SimulatedSurvey) -> Iterator[Image]:
    """Render the survey's photos, one by one in the order of its frames.

    Parameters
    ----------
    survey
        Survey whose truth is photographed; the same survey gives the same photos.

    Yields
    ------
    (height_px, width_px, 3) BGR, as a camera stores it.
    """
    camera, scenario = survey.calibration, survey.scenario
    rng = np.random.default_rng([scenario.seed, 1])
    ground = paint_ground(scenario.road, rng)
    laid = list_details(survey)
    sensor = _sensor(camera.width_px, camera.height_px, rng)
    whole, level = get_whole_photo(survey), survey.truth.surface
    for index in range(len(survey.frame_id)):
        maps = compute_ground_map(survey, index, whole, level)
        photo = _ground_photo(ground, maps)
        for detail in laid:
            part = find_part_showing(survey, index, detail.corners_m, detail.sheet or level)
            if part.right - part.left < MIN_SIZE_PX or part.bottom - part.top < MIN_SIZE_PX:
                continue
            _lay_detail(photo, detail, _maps(survey, index, part, detail.sheet, maps), part)
        yield _expose(photo, sensor, rng)


def _ground_photo(ground: GroundRaster, maps: tuple[Weights, Weights]) -> Image:
    """Render the ground, mirrored repeatedly beyond its raster; black where no ground is seen."""
    near = (
        np.clip(maps[0], -MAX_DISTANCE_M, MAX_DISTANCE_M),
        np.clip(maps[1], -MAX_DISTANCE_M, MAX_DISTANCE_M),
    )
    photo = _sample(ground.image, ground.pixel_from_scene, near, cv2.BORDER_REFLECT_101)
    photo[np.maximum(maps[0], maps[1]) >= NOWHERE_M / 2] = 0
    return photo


def _maps(
    survey: SimulatedSurvey,
    index: int,
    part: PhotoPart,
    sheet: Surface | None,
    of_ground: tuple[Weights, Weights],
) -> tuple[Weights, Weights]:
    """Return the scene coordinates of a part of a photo; those of the ground are given."""
    if sheet is None:
        return of_ground[0][part.slices], of_ground[1][part.slices]
    return compute_ground_map(survey, index, part, sheet)


def _sample(
    image: Image, pixel_from_scene: Floats, maps: tuple[Weights, Weights], border: int
) -> Image:
    """Sample an image of the ground at scene coordinates (H, W), bilinearly."""
    along, across = maps
    (ux, uy, u0), (vx, vy, v0) = pixel_from_scene.astype(np.float32)
    u = across * uy + u0
    v = along * vx + v0
    if ux or vy:  # the image is rotated
        u += along * ux
        v += across * vy
    sampled: Image = cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=border)  # type: ignore[assignment]
    return sampled


def _lay_detail(
    photo: Image, detail: Detail, maps: tuple[Weights, Weights], part: PhotoPart
) -> None:
    """Draw a detail onto a photo in place; each pixel is the mean of its subdivisions."""
    height, width = maps[0].shape
    gsd_m = abs(float(maps[0][0, 0] - maps[0][-1, 0])) / (height - 1)
    times = int(np.clip(np.ceil(gsd_m / detail.resolution_m), 1, PIXEL_SUBDIVISION_MAX))
    whole = (width * times, height * times)
    fine = tuple(np.asarray(cv2.resize(m, whole), np.float32) for m in maps)
    border = cv2.BORDER_CONSTANT
    sampled = _sample(detail.image, detail.pixel_from_scene, (fine[0], fine[1]), border)
    mean = cv2.resize(sampled.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    under = photo[part.slices] * (1.0 - mean[..., 3:] / 255.0)
    photo[part.slices] = np.clip(np.round(under + mean[..., :3]), 0, 255).astype(np.uint8)


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
