"""What lies on the ground of the built-in scene: cars, marks, plates, each a picture.

Details are rasters of the ground that may lie turned, and on a plane of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.demo_scene.ground_map import Sheet, ground_sheet, scene_from_world
from uavgram.imaging.demo_scene.marks import BLACK, WHITE, mark_raster
from uavgram.imaging.demo_scene.vehicles import vehicle_raster
from uavgram.imaging.plates.families import cells_of
from uavgram.imaging.raster import GroundRaster, Image
from uavgram.model.arrays import Floats
from uavgram.model.scenario.plates import FAMILY
from uavgram.model.scenario.simulated import SimulatedSurvey
from uavgram.model.target_families import CORNERS

PLATE_RESOLUTION_M = 0.004
WHITE_CELLS = 1  # of paper around a plate's black border
LEVEL_M = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Detail:
    """One of them.

    Attributes
    ----------
    image
        (H, W, 4) BGRA, colours multiplied by alpha.
    pixel_from_scene
        (2, 3) affine matrix from scene (x, y, 1) to pixel (u, v).
    corners_m
        (K, 2) what it lies between, in the scene.
    resolution_m
        Side of a pixel.
    sheet
        What it lies on; None: the ground.
    """

    image: Image
    pixel_from_scene: Floats
    corners_m: Floats
    resolution_m: float
    sheet: Sheet | None = None


def details(survey: SimulatedSurvey) -> list[Detail]:
    """All details of a survey's scene, in the order in which they cover each other."""
    scenario, truth = survey.scenario, survey.truth
    flat = [vehicle_raster(vehicle) for vehicle in scenario.road.vehicles]
    # Marks last: people walk round the cars to spray them.
    laid = [_of_raster(raster, None) for raster in flat]
    world = truth.point_world_m[: len(scenario.points)]
    above = world[:, 2] - truth.surface.up(world[:, :2] - truth.surface.middle_m)
    for point, height in zip(scenario.points, above.tolist(), strict=True):
        sheet = ground_sheet(survey, height) if abs(height) > LEVEL_M else None
        laid.append(_of_raster(mark_raster(point), sheet))
    plates = truth.point_world_m[len(scenario.points) :].reshape(-1, CORNERS, 3)
    return laid + [_plate(survey, number, corner) for number, corner in enumerate(plates)]


def _of_raster(raster: GroundRaster, sheet: Sheet | None) -> Detail:
    return Detail(
        image=raster.image,
        pixel_from_scene=raster.pixel_from_scene,
        corners_m=raster.corners_m,
        resolution_m=raster.resolution_m,
        sheet=sheet,
    )


def _plate(survey: SimulatedSurvey, number: int, corner_m: Floats) -> Detail:
    """A coded plate, its paper flat on the plane of its corners (4, 3)."""
    cells = np.pad(cells_of(FAMILY, number), WHITE_CELLS, constant_values=True)
    side = survey.scenario.plates.side_m
    cell_px = max(1, round(side / (len(cells) - 2 * WHITE_CELLS) / PLATE_RESOLUTION_M))
    white = np.kron(cells, np.ones((cell_px, cell_px), np.bool_))
    image = np.where(white[..., None], np.array(WHITE, np.uint8), np.array(BLACK, np.uint8))
    low, high = WHITE_CELLS * cell_px - 0.5, (len(cells) - WHITE_CELLS) * cell_px - 0.5
    corner_px = np.array([[low, low], [high, low], [high, high], [low, high]])
    axes = scene_from_world(survey)
    scene = corner_m[:, :2] @ axes[:, :2].T + axes[:, 2]
    affine = np.linalg.lstsq(np.column_stack([scene, np.ones(CORNERS)]), corner_px)[0].T
    rim = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * len(image) - 0.5
    place = (rim - affine[:, 2]) @ np.linalg.inv(affine[:, :2]).T
    offset = corner_m[:, :2] - survey.truth.surface.middle_m
    plane = np.linalg.lstsq(np.column_stack([np.ones(CORNERS), offset]), corner_m[:, 2])[0]
    return Detail(
        image=image,
        pixel_from_scene=affine,
        corners_m=place,
        resolution_m=PLATE_RESOLUTION_M,
        sheet=Sheet(float(plane[0]), np.asarray(plane[1:], np.float64)),
    )
