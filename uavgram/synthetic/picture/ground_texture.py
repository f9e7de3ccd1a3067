"""Texture of the ground of the built-in scene: grass, road, paint, skid marks, debris."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.raster import (
    GroundRaster,
    Image,
    Painter,
    Weights,
    blend,
    blur_mask,
    colour_noise,
    make_arc,
    make_box,
    make_texture,
    paint_layer,
    stripe_outline,
)
from uavgram.model.arrays import Floats
from uavgram.synthetic.accident_scene import RoadLayout

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
    image = _grass(grain, patches)
    _trees(image, painter, rng)
    asphalt = painter.polygons(*compute_road_outlines(road))
    image = _verge(image, asphalt, grain, patches)
    _footpath(image, painter, grain, rng)
    paint_layer(image, _asphalt(painter, road, grain, patches, rng), asphalt)
    _kerb(image, painter, road, grain)
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


def _grass(grain: Weights, patches: Weights) -> Image:
    lush = colour_noise(
        grain + 0.5 * patches, (22, 46, 34), (44, 92, 74), (62, 122, 104), (92, 158, 146)
    )
    dry = colour_noise(grain, (58, 84, 92), (88, 124, 136), (122, 164, 178))
    return blend(lush, dry, np.clip(0.35 * patches - 0.12, 0.0, 0.75))


def _verge(image: Image, asphalt: Image, grain: Weights, patches: Weights) -> Image:
    """Paint gravel beside the asphalt, with a ragged edge."""
    distance = cv2.distanceTransform(255 - asphalt, cv2.DIST_L2, 3) * np.float32(RESOLUTION_M)
    ragged = np.clip((0.75 + 0.12 * patches + 0.1 * grain - distance) / 0.25, 0.0, 1.0)
    gravel = colour_noise(1.2 * grain, (66, 78, 86), (110, 124, 134), (160, 172, 180))
    return blend(image, gravel, ragged.astype(np.float32) * np.float32(0.85))


def _footpath(image: Image, painter: Painter, grain: Weights, rng: np.random.Generator) -> None:
    inner, outer = FOOTPATH_M
    concrete = colour_noise(0.6 * grain, (128, 138, 142), (150, 160, 164), (174, 182, 186))
    paint_layer(
        image, concrete, painter.polygons(make_box(-TREE_DISTANCE_M, TREE_DISTANCE_M, inner, outer))
    )
    joints = np.arange(-HALF_LENGTH_M, HALF_LENGTH_M, 1.5)
    # slabs weather differently
    slabs = painter.blank()
    for x, shade in zip(joints, rng.integers(0, 50, len(joints)), strict=True):
        painter.polygons(make_box(x, x + 1.5, inner, outer), mask=slabs, value=int(shade))
    paint_layer(image, (96, 104, 104), slabs)
    lines = [np.array([[x, inner], [x, outer]]) for x in joints]
    edges = [np.array([[-TREE_DISTANCE_M, y], [TREE_DISTANCE_M, y]]) for y in (inner, outer)]
    paint_layer(image, (78, 86, 86), painter.stripes(*lines, *edges, width_m=0.025), 0.8)


def _asphalt(
    painter: Painter,
    road: RoadLayout,
    grain: Weights,
    patches: Weights,
    rng: np.random.Generator,
) -> Image:
    image = colour_noise(
        0.9 * grain + 0.35 * patches, (70, 68, 66), (98, 96, 94), (114, 112, 110), (150, 149, 148)
    )
    # wheels polish four tracks; oil darkens the middle of each lane
    lane = road.width_m / 4
    tracks = [
        np.array([[-TREE_DISTANCE_M, y], [TREE_DISTANCE_M, y]])
        for middle in (-lane, lane)
        for y in (middle - 0.75, middle + 0.75)
    ]
    worn = blur_mask(painter.stripes(*tracks, width_m=0.45), 12)
    paint_layer(image, (84, 82, 80), worn, 0.45)
    repairs = painter.polygons(make_box(-27.0, -23.2, 0.5, 3.0), make_box(24.0, 27.5, -3.0, -0.4))
    paint_layer(image, (68, 66, 65), repairs, 0.55)
    cracks = [_crack(rng, start) for start in rng.uniform((-34, -3), (34, 3), (16, 2))]
    cracks += [_crack(rng, start) for start in rng.uniform((3.5, -24), (8.5, -8), (5, 2))]
    paint_layer(image, (46, 45, 44), painter.stripes(*cracks, width_m=0.03), 0.6)
    return image


def _crack(rng: np.random.Generator, start_m: Floats) -> Floats:
    """Draw a random path (K, 2)."""
    turn = np.cumsum(rng.normal(0.0, 0.35, 24)) + rng.uniform(0.0, 2.0 * np.pi)
    step = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(0.06, 0.2)
    path: Floats = start_m + np.cumsum(step, axis=0)
    return path


def _kerb(image: Image, painter: Painter, road: RoadLayout, grain: Weights) -> None:
    edge = road.width_m / 2
    stone = painter.polygons(make_box(-TREE_DISTANCE_M, TREE_DISTANCE_M, edge, edge + KERB_M))
    gutter = painter.polygons(make_box(-TREE_DISTANCE_M, TREE_DISTANCE_M, edge - 0.06, edge))
    concrete = colour_noise(0.5 * grain, (140, 148, 152), (168, 176, 180), (190, 196, 200))
    paint_layer(image, concrete, stone)
    paint_layer(image, (60, 60, 60), gutter, 0.6)


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
        path = _smooth(np.array(mark))
        painter.stripes(path, width_m=0.2, mask=mask, value=200)
        # rubber is thickest under the tyre's shoulders
        outline = stripe_outline(path, 0.16)
        half = len(path)
        painter.stripes(outline[:half], outline[half:], width_m=0.05, mask=mask)
    rubber = np.clip(0.74 - 0.12 * grain, 0.3, 0.95).astype(np.float32)
    paint_layer(image, (30, 29, 28), blur_mask(mask, 0.8), rubber)


def _smooth(corners_m: Floats) -> Floats:
    """Resample a polyline (K, 2) to a smooth curve through (nearly) the same points."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners_m, axis=0), axis=1))])
    places = np.linspace(0.0, along[-1], 80)
    return np.stack([np.interp(places, along, column) for column in corners_m.T], axis=1)


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
        leaf_angle = rng.uniform(0.0, 2.0 * np.pi, 160)
        leaf_away = radius * np.sqrt(rng.random(160)) * rng.uniform(0.85, 1.05, 160)
        leaves = place + leaf_away[:, None] * np.column_stack(
            [np.cos(leaf_angle), np.sin(leaf_angle)]
        )
        _canopy(image, painter, leaves, radius)


def _canopy(image: Image, painter: Painter, leaves_m: Floats, radius_m: float) -> None:
    sun = np.array([0.35, 0.5])  # direction of the shadow, per metre of radius
    shade = painter.discs(leaves_m - 1.1 * radius_m * sun, 0.42, painter.blank())
    paint_layer(image, (18, 30, 24), blur_mask(shade, 3), 0.7)
    tones = ((24, 50, 34), (32, 68, 48), (42, 86, 62), (58, 110, 84))
    for i, tone in enumerate(tones):
        shifted = leaves_m[i::4] + 0.12 * i * sun
        layer = painter.discs(shifted, 0.42 - 0.07 * i, painter.blank())
        paint_layer(image, tone, layer, 0.9)
