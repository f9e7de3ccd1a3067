"""Renderer of photos of the simulated scene through the true, distorting camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.raster import GroundRaster, Image, Weights
from uavgram.model.arrays import Floats
from uavgram.synthetic.picture.ground_map import (
    NOWHERE_M,
    PhotoPart,
    compute_ground_map,
    find_part_showing,
    get_whole_photo,
)
from uavgram.synthetic.picture.ground_texture import paint_ground
from uavgram.synthetic.picture.things import Detail, list_details
from uavgram.synthetic.scene import Surface
from uavgram.synthetic.survey import SimulatedSurvey

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
