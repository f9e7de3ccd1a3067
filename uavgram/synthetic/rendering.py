"""Pictures of the built-in scene, and photos of it through the true, distorting camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.imaging.raster import (
    GroundRaster,
    Image,
    Painter,
    Weights,
    blur_mask,
    colour_noise,
    make_arc,
    make_box,
    make_texture,
    paint_layer,
)
from uavgram.imaging.targets.plates import read_cells
from uavgram.model.arrays import Floats
from uavgram.model.naming import PLATE_CORNERS
from uavgram.synthetic.accident_scene import RoadLayout, ScenePoint, Vehicle
from uavgram.synthetic.scenario import PLATE_FAMILY, GroundSpec
from uavgram.synthetic.survey import SimulatedSurvey
from uavgram.synthetic.truth import Surface

MARK_RESOLUTION_M = 0.004
HALF_HEIGHT_PX, NEAR_PX, FAR_PX = 72, 72, 384  # FAR: on the side of the label
TEXT_SCALE, TEXT_THICKNESS, TEXT_GAP_PX = 3.0, 10, 88
RIM_PX = 13

WHITE = (236, 240, 240, 255)
BLACK = (26, 26, 28, 255)
SPRAY = (40, 226, 250, 255)
RED = (52, 44, 206, 255)


def draw_mark(point: ScenePoint) -> GroundRaster:
    """Draw one mark and its label: BGRA, colours multiplied by alpha."""
    left_px = NEAR_PX if point.label_side == "right" else FAR_PX
    image = np.zeros((2 * HALF_HEIGHT_PX, NEAR_PX + FAR_PX, 4), np.uint8)
    # metres from the mark's middle, at the pixels' centres: right, down
    v, u = np.indices(image.shape[:2]) + 0.5
    right, down = (u - left_px) * MARK_RESOLUTION_M, (v - HALF_HEIGHT_PX) * MARK_RESOLUTION_M
    square = np.maximum(np.abs(right), np.abs(down))
    if point.mark == "checker":
        paint_layer(image, WHITE, _mask(square < 0.24))
        paint_layer(image, BLACK, _mask((square < 0.21) & (right * down > 0)))
    elif point.mark == "disc":
        radius = np.hypot(right, down)
        for color, size in ((BLACK, 0.24), (WHITE, 0.2), (RED, 0.13), (WHITE, 0.05)):
            paint_layer(image, color, _mask(radius < size))
    else:
        narrow = np.minimum(np.abs(right), np.abs(down))
        paint_layer(image, BLACK, _mask((narrow < 0.048) & (square < 0.24)), 0.35)
        paint_layer(image, SPRAY, _mask((narrow < 0.028) & (square < 0.22)), 0.95)
    _write(image, point, left_px)
    return GroundRaster(
        image=image,
        x_top_m=point.x_m + HALF_HEIGHT_PX * MARK_RESOLUTION_M,
        y_left_m=point.y_m + left_px * MARK_RESOLUTION_M,
        resolution_m=MARK_RESOLUTION_M,
    )


def _mask(where: NDArray[np.bool_]) -> Image:
    return np.where(where, np.uint8(255), np.uint8(0))


def _write(image: Image, point: ScenePoint, left_px: int) -> None:
    """Draw the label, upright for a viewer looking along x, with a dark rim for legibility."""
    font = cv2.FONT_HERSHEY_DUPLEX
    (width, height), _ = cv2.getTextSize(point.label, font, TEXT_SCALE, TEXT_THICKNESS)
    at_px = left_px + TEXT_GAP_PX if point.label_side == "right" else left_px - TEXT_GAP_PX - width
    base = (at_px, HALF_HEIGHT_PX + height // 2)
    mask = np.zeros(image.shape[:2], np.uint8)
    cv2.putText(mask, point.label, base, font, TEXT_SCALE, [255], TEXT_THICKNESS, cv2.LINE_AA)
    rim = np.asarray(cv2.dilate(mask, np.ones((RIM_PX, RIM_PX), np.uint8)), np.uint8)
    paint_layer(image, BLACK, blur_mask(rim, 2.5), 0.55)
    paint_layer(image, _text_color(point), mask, 0.95)


def _text_color(point: ScenePoint) -> tuple[int, int, int, int]:
    return SPRAY if point.mark == "cross" else WHITE


VEHICLE_RESOLUTION_M = 0.01
MARGIN_M = 1.2
SHADOW_M = (-0.4, -0.55)  # offset of a car's shadow in the scene

GLASS = (52, 46, 40, 255)
DARK = (22, 22, 24, 255)


def draw_vehicle(vehicle: Vehicle) -> GroundRaster:
    """Draw one car with its shadow: BGRA, colours multiplied by alpha."""
    half = 0.5 * np.hypot(vehicle.length_m, vehicle.width_m) + MARGIN_M
    size = int(np.ceil(2 * half / VEHICLE_RESOLUTION_M))
    raster = GroundRaster(
        image=np.zeros((size, size, 4), np.uint8),
        x_top_m=vehicle.x_m + half,
        y_left_m=vehicle.y_m + half,
        resolution_m=VEHICLE_RESOLUTION_M,
    )
    _draw(raster.image, Painter(raster), vehicle)
    return raster


def _draw(image: Image, painter: Painter, vehicle: Vehicle) -> None:
    body = _outline(vehicle)
    shadow = painter.polygons(body + np.array(SHADOW_M), body + 0.5 * np.array(SHADOW_M))
    paint_layer(image, DARK, blur_mask(shadow, 7), 0.62)
    paint = vehicle.color_rgb[::-1]
    # the body is darker towards its rounded edge
    for inset, light in ((1.0, 0.5), (0.965, 0.75), (0.87, 1.0)):
        paint_layer(image, _shade(paint, light), painter.polygons(_outline(vehicle, inset)))
    windscreen = _quad(vehicle, (0.07, -0.36), (0.2, -0.43), (0.2, 0.43), (0.07, 0.36))
    rear = _quad(vehicle, (-0.3, -0.33), (-0.39, -0.4), (-0.39, 0.4), (-0.3, 0.33))
    paint_layer(image, GLASS, painter.polygons(windscreen, rear), 0.95)
    roof = _part(vehicle, (-0.28, 0.05), (-0.34, 0.34))
    paint_layer(image, _shade(paint, 1.3), blur_mask(painter.polygons(roof), 12), 0.8)
    lamp = _part(vehicle, (0.455, 0.485), (-0.42, -0.28))  # the other one is broken
    paint_layer(image, WHITE, painter.polygons(lamp), 0.9)


def _shade(color: tuple[int, ...], light: float) -> tuple[int, ...]:
    return (*(min(255, round(c * light)) for c in color), 255)


def _outline(vehicle: Vehicle, inset: float = 1.0) -> Floats:
    """Return the body (72, 2) in the scene: a superellipse."""
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ahead = 0.5 * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.36
    side = 0.5 * np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.3
    return _place(vehicle, np.column_stack([ahead, side]) * inset)


def _part(vehicle: Vehicle, ahead: tuple[float, float], side: tuple[float, float]) -> Floats:
    """Return a rectangle (4, 2), given in fractions of the car's length and width."""
    (a0, a1), (s0, s1) = ahead, side
    return _place(vehicle, np.array([[a0, s0], [a1, s0], [a1, s1], [a0, s1]]))


def _quad(vehicle: Vehicle, *corners: tuple[float, float]) -> Floats:
    return _place(vehicle, np.array(corners))


def _place(vehicle: Vehicle, parts: Floats) -> Floats:
    """Convert (K, 2) fractions of the car's length (ahead) and width (left) to the scene."""
    c, s = np.cos(np.deg2rad(vehicle.heading_deg)), np.sin(np.deg2rad(vehicle.heading_deg))
    body = parts * [vehicle.length_m, vehicle.width_m]
    placed: Floats = body @ np.array([[c, s], [-s, c]]) + [vehicle.x_m, vehicle.y_m]
    return placed


PLATE_RESOLUTION_M = 0.004
WHITE_CELLS = 1  # white cells of paper around a plate's black border
LEVEL_M = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Detail:
    """Picture of an object on the ground.

    Attributes
    ----------
    image
        (H, W, 4) BGRA, colours multiplied by alpha.
    pixel_from_scene
        (2, 3) affine matrix from scene (x, y, 1) to pixel (u, v).
    corners_m
        (K, 2) its corners in the scene.
    resolution_m
        Side of a pixel.
    sheet
        Surface that carries it; None: the ground.
    """

    image: Image
    pixel_from_scene: Floats
    corners_m: Floats
    resolution_m: float
    sheet: Surface | None = None


def list_details(survey: SimulatedSurvey) -> list[Detail]:
    """Return all details of a survey's scene, in the order in which they cover each other."""
    scenario, truth, ground = survey.scenario, survey.truth, survey.truth.surface
    flat = [draw_vehicle(vehicle) for vehicle in scenario.road.vehicles]
    # marks last: they are sprayed around the cars
    laid = [_make_detail(raster, None) for raster in flat]
    world = truth.point_world_m[: len(scenario.points)]
    above = world[:, 2] - ground.up(world[:, :2] - ground.middle_m)
    for point, height in zip(scenario.points, above.tolist(), strict=True):
        ground = truth.surface
        sheet = (
            replace(ground, height_m=ground.height_m + height) if abs(height) > LEVEL_M else None
        )
        laid.append(_make_detail(draw_mark(point), sheet))
    plates = truth.point_world_m[len(scenario.points) :].reshape(-1, PLATE_CORNERS, 3)
    return laid + [_plate(survey, number, corner) for number, corner in enumerate(plates)]


def _make_detail(raster: GroundRaster, sheet: Surface | None) -> Detail:
    return Detail(
        image=raster.image,
        pixel_from_scene=raster.pixel_from_scene,
        corners_m=raster.corners_m,
        resolution_m=raster.resolution_m,
        sheet=sheet,
    )


def _plate(survey: SimulatedSurvey, number: int, corner_m: Floats) -> Detail:
    """Draw a coded plate, its paper flat on the plane of its corners (4, 3)."""
    # picture of the code: one block of pixels for each cell
    cells = np.pad(read_cells(PLATE_FAMILY, number), WHITE_CELLS, constant_values=True)
    side = survey.scenario.plates.side_m
    cell_px = max(1, round(side / (len(cells) - 2 * WHITE_CELLS) / PLATE_RESOLUTION_M))
    white = np.kron(cells, np.ones((cell_px, cell_px), np.bool_))
    image = np.where(white[..., None], np.array(WHITE, np.uint8), np.array(BLACK, np.uint8))
    # affine map from the scene to the picture by the corners of the black square
    low, high = WHITE_CELLS * cell_px - 0.5, (len(cells) - WHITE_CELLS) * cell_px - 0.5
    corner_px = np.array([[low, low], [high, low], [high, high], [low, high]])
    scene = survey.scenario.site.in_scene(corner_m[:, :2])
    affine = np.linalg.lstsq(np.column_stack([scene, np.ones(PLATE_CORNERS)]), corner_px)[0].T
    # corners of the paper in the scene
    rim = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * len(image) - 0.5
    place = (rim - affine[:, 2]) @ np.linalg.inv(affine[:, :2]).T
    # plane through the corners, on which the paper is
    ground = survey.truth.surface
    offset = corner_m[:, :2] - ground.middle_m
    rows = np.column_stack([np.ones(PLATE_CORNERS), offset])
    plane = np.asarray(np.linalg.lstsq(rows, corner_m[:, 2])[0], np.float64)
    return Detail(
        image=image,
        pixel_from_scene=affine,
        corners_m=place,
        resolution_m=PLATE_RESOLUTION_M,
        sheet=replace(ground, spec=GroundSpec(), height_m=float(plane[0]), slope=plane[1:]),
    )


RESOLUTION_M = 0.02
HALF_LENGTH_M, HALF_WIDTH_M = 38.0, 26.0

WHITE_PAINT = (222, 228, 230)
YELLOW_PAINT = (70, 178, 226)
KERB_M = 0.16
FOOTPATH_M = (4.7, 6.5)
EDGE_LINE_M = 0.3  # from the asphalt's edge to the line's middle
TREE_DISTANCE_M = 60.0


def paint_ground(road: RoadLayout, rng: np.random.Generator) -> GroundRaster:
    """Paint the scene without its marks and vehicles, at `RESOLUTION_M`.

    Parameters
    ----------
    road
        Layout of the road.
    rng
        Draws grain, wear and debris.
    """
    shape = (round(2 * HALF_LENGTH_M / RESOLUTION_M), round(2 * HALF_WIDTH_M / RESOLUTION_M))
    raster = GroundRaster(
        image=np.zeros((*shape, 3), np.uint8),
        x_top_m=HALF_LENGTH_M,
        y_left_m=HALF_WIDTH_M,
        resolution_m=RESOLUTION_M,
    )
    painter = Painter(raster)
    grain = make_texture(rng, shape, {1: 0.6, 2: 0.5, 5: 0.45})
    patches = make_texture(rng, shape, {30: 0.5, 120: 0.7, 500: 0.5})
    image = colour_noise(
        grain + 0.5 * patches, (22, 46, 34), (44, 92, 74), (62, 122, 104), (92, 158, 146)
    )
    _trees(image, painter, rng)
    _footpath(image, painter, road, grain)
    asphalt = colour_noise(
        0.9 * grain + 0.35 * patches, (70, 68, 66), (98, 96, 94), (114, 112, 110), (150, 149, 148)
    )
    repairs = painter.polygons(make_box(-27.0, -23.2, 0.5, 3.0), make_box(24.0, 27.5, -3.0, -0.4))
    paint_layer(asphalt, (68, 66, 65), repairs, 0.55)
    paint_layer(image, asphalt, painter.polygons(*compute_road_outlines(road)))
    _road_paint(image, painter, road, grain, patches)
    _skid_marks(image, painter, road, grain)
    _debris(image, painter, road, rng)
    return GroundRaster(
        image=image,
        x_top_m=raster.x_top_m,
        y_left_m=raster.y_left_m,
        resolution_m=RESOLUTION_M,
    )


def compute_road_outlines(road: RoadLayout) -> tuple[Floats, Floats]:
    """Return the outlines of the main road and of the side road with its rounded corners."""
    half, radius = road.width_m / 2, road.corner_radius_m
    left, right = road.side_x_m - road.side_width_m / 2, road.side_x_m + road.side_width_m / 2
    side = np.vstack(
        [
            make_arc((left - radius, -half - radius), radius, 90.0, 0.0),
            [[left, -TREE_DISTANCE_M], [right, -TREE_DISTANCE_M]],
            make_arc((right + radius, -half - radius), radius, 180.0, 90.0),
            [[right, 0.0], [left, 0.0]],
        ]
    )
    return make_box(-TREE_DISTANCE_M, TREE_DISTANCE_M, -half, half), side


def _footpath(image: Image, painter: Painter, road: RoadLayout, grain: Weights) -> None:
    """Paint the slabs of the footpath, and the kerb."""
    inner, outer = FOOTPATH_M
    concrete = colour_noise(0.6 * grain, (128, 138, 142), (150, 160, 164), (174, 182, 186))
    edge = road.width_m / 2
    paved = [
        make_box(-TREE_DISTANCE_M, TREE_DISTANCE_M, low, high)
        for low, high in (FOOTPATH_M, (edge, edge + KERB_M))
    ]
    paint_layer(image, concrete, painter.polygons(*paved))
    joints = np.arange(-HALF_LENGTH_M, HALF_LENGTH_M, 1.5)
    lines = [np.array([[x, inner], [x, outer]]) for x in joints]
    paint_layer(image, (78, 86, 86), painter.stripes(*lines, width_m=0.025), 0.8)


def _road_paint(
    image: Image, painter: Painter, road: RoadLayout, grain: Weights, patches: Weights
) -> None:
    edge = road.width_m / 2 - EDGE_LINE_M
    reach = road.side_width_m / 2 + road.corner_radius_m
    before, after = road.side_x_m - reach, road.side_x_m + reach
    corner = -road.width_m / 2 - road.corner_radius_m
    radius = road.corner_radius_m + EDGE_LINE_M
    side = road.side_width_m / 2 - EDGE_LINE_M
    white = painter.stripes(
        np.array([[-TREE_DISTANCE_M, edge], [TREE_DISTANCE_M, edge]]),
        np.array([[-TREE_DISTANCE_M, -edge], [before, -edge]]),
        np.array([[after, -edge], [TREE_DISTANCE_M, -edge]]),
        make_arc((before, corner), radius, 90.0, 0.0),
        make_arc((after, corner), radius, 180.0, 90.0),
        np.array([[road.side_x_m - side, corner], [road.side_x_m - side, -TREE_DISTANCE_M]]),
        np.array([[road.side_x_m + side, corner], [road.side_x_m + side, -TREE_DISTANCE_M]]),
        width_m=0.12,
    )
    stop = corner - 0.7
    painter.polygons(
        make_box(road.side_x_m + 0.2, road.side_x_m + side - 0.1, stop - 0.2, stop + 0.2),
        mask=white,
    )
    starts = np.arange(-36.0, 38.0, 6.0)
    centre = painter.stripes(
        *(np.array([[x, 0.0], [x + 3.0, 0.0]]) for x in starts),
        np.array([[road.side_x_m, stop + 0.2], [road.side_x_m, -TREE_DISTANCE_M]]),
        width_m=0.12,
    )
    # old paint: thin where the aggregate protrudes
    wear = np.clip(0.86 + 0.14 * grain + 0.1 * patches, 0.25, 1.0).astype(np.float32)
    paint_layer(image, WHITE_PAINT, white, wear)
    paint_layer(image, YELLOW_PAINT, centre, wear)


def _skid_marks(image: Image, painter: Painter, road: RoadLayout, grain: Weights) -> None:
    mask = painter.blank()
    for mark in road.skid_marks:
        painter.stripes(np.array(mark), width_m=0.2, mask=mask)
    rubber = np.clip(0.74 - 0.12 * grain, 0.3, 0.95).astype(np.float32)
    paint_layer(image, (30, 29, 28), blur_mask(mask, 0.8), rubber)


def _debris(image: Image, painter: Painter, road: RoadLayout, rng: np.random.Generator) -> None:
    """Paint glass, plastic and dirt inside the debris field, denser towards its first corner."""
    if not road.debris:
        return
    corners = np.array(road.debris)
    colors = ((206, 212, 214), (40, 40, 42), (40, 48, 176), (150, 156, 160), (60, 130, 210))
    for color, count in zip(colors, (260, 110, 60, 120, 40), strict=True):
        u, v = rng.random((2, count)) ** 1.3
        middle = (
            np.outer((1 - u) * (1 - v), corners[0])
            + np.outer(u * (1 - v), corners[1])
            + np.outer(u * v, corners[2])
            + np.outer((1 - u) * v, corners[3])
        )
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, (count, 5)), axis=1)
        size = rng.gamma(2.0, 0.018, (count, 1)) + 0.012
        shards = middle[:, None] + size[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1)
        paint_layer(image, color, painter.polygons(*shards), 0.9)


def _trees(image: Image, painter: Painter, rng: np.random.Generator) -> None:
    """Paint bushes and trees far from the road, seen from above, with their shadows."""
    places = np.array(
        [[-29, 13], [-22, 15.5], [-9, 17], [4, 14.5], [12, 18], [24, 14], [31, 16.5],
         [-31, -12], [-24, -16], [-12, -15], [20, -14.5], [27, -12], [33, -17], [14.5, -18]]
    )  # fmt: skip
    for place, radius in zip(places, rng.uniform(1.2, 2.6, len(places)), strict=True):
        angle, away = rng.uniform(0.0, 2.0 * np.pi, 160), radius * np.sqrt(rng.random(160))
        leaves = place + away[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        sun = np.array([0.35, 0.5])  # direction of the shadow, per metre of radius
        shade = painter.discs(leaves - 1.1 * radius * sun, 0.42, painter.blank())
        paint_layer(image, (18, 30, 24), blur_mask(shade, 3), 0.7)
        for i, tone in enumerate(((24, 50, 34), (32, 68, 48), (42, 86, 62), (58, 110, 84))):
            layer = painter.discs(leaves[i::4] + 0.12 * i * sun, 0.42 - 0.07 * i, painter.blank())
            paint_layer(image, tone, layer, 0.9)


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
