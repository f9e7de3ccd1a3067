"""Views of a plane with chosen cameras, photos of a pattern on it, and exact warps by OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import synthetic_survey
from numpy.typing import ArrayLike
from pyproj import Transformer
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, LensModel
from uavgram.model.maps import GroundRaster
from uavgram.model.result.result import AreaPlane, Estimate
from uavgram.model.result.tables import FrameResults, FrameStatus, PoseTable

REFINED: FrameStatus = "refined"
SIZE_PX = (800, 600)
BROWN = np.array([620.0, 618.0, 404.0, 297.0, -0.12, 0.05, 6e-4, -4e-4, 0.008])
FOLDED = np.array([620.0, 618.0, 404.0, 297.0, -0.62, 0.0, 0.0, 0.0, 0.0])
"""The picture's corners lie beyond this lens's fold, so they show nothing."""

FISHEYE = np.array([410.0, 409.0, 404.0, 297.0, 0.02, -0.01, 0.003, -0.001])
LENSES = {"brown": BROWN, "folded": FOLDED, "fisheye": FISHEYE}
NADIR = np.diag([1.0, -1.0, -1.0])
ORIGIN = (48.1372, 11.5755, 519.2)
UTM = "EPSG:32632"


def looking(tilt_deg: float = 0.0, azimuth_deg: float = 0.0, roll_deg: float = 0.0) -> Floats:
    """World from camera: down, image up towards the azimuth, raised towards it by the tilt."""
    turn = Rotation.from_euler("z", -azimuth_deg, degrees=True).as_matrix()
    raised = Rotation.from_euler("xz", [tilt_deg, roll_deg], degrees=True).as_matrix()
    return turn @ NADIR @ raised


def make_view(
    centers: ArrayLike,
    rotations: ArrayLike,
    *,
    lens: str = "brown",
    plane: ArrayLike = (0.0, 0.0, 0.0),
    pivot: ArrayLike = (0.0, 0.0),
    crs: str | None = None,
    paths: Sequence[str] | None = None,
    sweep: Floats | None = None,
) -> View:
    """A view of all those cameras; `plane` is height and slopes (as tangents).

    `sweep` is how each moved while its rows were read (default: not at all).
    """
    result = synthetic_survey.build()
    center_world_m = np.array(centers, float)
    count = len(center_world_m)
    name: LensModel = "fisheye" if lens == "fisheye" else "brown"
    parameters = LENSES[lens]
    shared = replace(
        result.shared,
        intrinsics=Estimate(value=parameters, sigma=np.zeros(len(parameters))),
    )
    table = PoseTable(
        center_world_m=center_world_m,
        world_from_camera=np.array(rotations, float),
        covariance=np.tile(np.eye(6) * 1e-4, (count, 1, 1)),
    )
    frames = FrameResults(
        frame_id=tuple(f"{k}.png" for k in range(count)),
        path=tuple(paths or [f"{k}.png" for k in range(count)]),
        time_utc_s=np.zeros(count),
        status=(REFINED,) * count,
        reason=("",) * count,
        seed=table,
        refined=table,
        sweep=np.zeros((count, 6)) if sweep is None else np.array(sweep),
    )
    world = replace(result.world, crs=crs)
    if crs is None:
        world = replace(world, origin=None, gauge="plane")
    camera = Calibration(
        name="test",
        model=name,
        width_px=SIZE_PX[0],
        height_px=SIZE_PX[1],
        parameters=parameters,
        covariance=np.eye(len(parameters)) * 1e-6,
    )
    ground = AreaPlane(
        name="default",
        height_m=Estimate(value=np.array(plane, float)[:1], sigma=np.zeros(1)),
        slope_deg=Estimate(
            value=np.rad2deg(np.arctan(np.array(plane, float)[1:])), sigma=np.zeros(2)
        ),
        pivot_m=np.array(pivot, float),
    )
    made = replace(
        result, world=world, camera=camera, shared=shared, areas=(ground,), frames=frames
    )
    return View(made, np.arange(count))


def cv_project(lens: str, center: Floats, rotation: Floats, world: ArrayLike) -> Floats:
    """(N, 2) pixels of world points (N, 3) by OpenCV."""
    parameters = LENSES[lens]
    camera = (np.asarray(world) - center) @ rotation
    fx, fy, cx, cy = parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    if lens == "fisheye":
        flat = camera[:, None] / camera[:, None, 2:]
        pixel, _ = cv2.fisheye.projectPoints(flat, np.zeros(3), np.zeros(3), matrix, parameters[4:])
    else:
        pixel, _ = cv2.projectPoints(camera, np.zeros(3), np.zeros(3), matrix, parameters[4:])
    pixel = np.asarray(pixel, np.float64).reshape(-1, 2)
    pixel[camera[:, 2] <= 0] = np.nan
    return pixel


def pattern(shift: float = 0.0) -> Image:
    """(H, W, 3) a photo of smooth waves, so that places show in the grey values."""
    u, v = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    waves = [np.sin(u / 9.0 + shift), np.sin(v / 7.0 - u / 31.0), np.cos((u + v) / 13.0)]
    return np.round(127.5 + 100.0 * np.stack(waves, axis=-1)).astype(np.uint8)


def write_photo(path: Path, rgb: Image) -> str:
    """Store without loss."""
    cv2.imwrite(str(path), np.ascontiguousarray(rgb[..., ::-1]))
    return str(path)


def world_of(view: View, raster: GroundRaster, column: Floats, row: Floats) -> Floats:
    """(N, 3) world positions of raster pixels by pyproj and the plane's equation."""
    east = raster.west_m + (column + 0.5) * raster.pixel_m
    north = raster.north_m - (row + 0.5) * raster.pixel_m
    height, *slope = view.surface
    pivot = view.result.plane.pivot_m
    if raster.crs is None:
        up = height + (np.stack([east, north], 1) - pivot) @ slope
        return np.stack([east, north, up], 1)
    longitude, latitude = Transformer.from_crs(raster.crs, "EPSG:4979", always_xy=True).transform(
        east, north
    )
    local = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={ORIGIN[0]} +lon_0={ORIGIN[1]} +h_0={ORIGIN[2]}"
    )
    up = np.full(len(east), height)
    for _ in range(6):
        e, n, _ = local.transform(longitude, latitude, ORIGIN[2] + up)
        up = height + (np.stack([e, n], 1) - pivot) @ slope
    # the plane's up is above the local horizontal plane, the ellipsoidal height is not: settle both
    tall = ORIGIN[2] + up
    for _ in range(6):
        e, n, u = local.transform(longitude, latitude, tall)
        tall = tall + (height + (np.stack([e, n], 1) - pivot) @ slope - u)
    return np.stack([e, n, u], 1)


def exact_warp(
    view: View, raster: GroundRaster, lens: str, index: int, rgb: Image
) -> tuple[Floats, Floats]:
    """(h, w, 3) bilinear grey values of a photo, and (h, w, 2) its pixels, by OpenCV and scipy."""
    row, column = np.mgrid[: raster.height, : raster.width].reshape(2, -1).astype(float)
    world = world_of(view, raster, column, row)
    poses = view.result.frames.refined
    pixel = cv_project(lens, poses.center_world_m[index], poses.world_from_camera[index], world)
    shape = (raster.height, raster.width)
    at = np.nan_to_num(pixel[:, ::-1].T, nan=-1e3)
    colour = [
        map_coordinates(rgb[..., k].astype(float), at, order=1, mode="nearest") for k in range(3)
    ]
    return np.stack(colour, -1).reshape(*shape, 3), pixel.reshape(*shape, 2)
