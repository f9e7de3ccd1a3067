"""Choose the photos and the raster of a metric top view."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError, suggest_spelling
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.geodesy import projected_from_enu
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import row_poses, sight_lines
from uavgram.geometry.ground.top_view import MIN_SINE, View
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps import GroundRaster
from uavgram.model.naming import format_digits
from uavgram.model.result.result import Result

EXTENT_SAMPLES = 41
"""Samples along each side of a photo for the extent of its ground."""

HALVINGS = 10
"""Bisections between a sample with ground and a neighbour without: to a thousandth of a step."""

MOST_PIXELS = 2_000_000_000
LEAST_PIXELS = 16
"""Least number of pixels on the shorter side of a top view."""

NICE_DIGITS = 2


def choose_view(result: Result, frame: str | None = None) -> View:
    """Return the adjusted frame of that name, or all adjusted ones.

    Raises
    ------
    GeometryError
        There is no adjusted frame, or none of that name.
    """
    rows = np.flatnonzero(result.has_refined)
    if frame is not None:
        if frame not in result.frames.frame_id:
            hint = suggest_spelling(frame, result.frames.frame_id)
            raise GeometryError(
                f"there is no frame {frame!r} in this project" + (f" ({hint})" if hint else "")
            )
        rows = rows[rows == result.frames.frame_id.index(frame)]
        if not rows.size:
            raise GeometryError(
                f"frame {frame!r} has no adjusted pose: pick points in it, or take another"
            )
    if not rows.size:
        raise GeometryError(
            "no photo was adjusted, so there is nothing to rectify: pick points in some"
        )
    return View(result, rows)


def lay_raster(view: View, pixel_m: float | None = None) -> GroundRaster:
    """Return the raster that covers the ground in the photos.

    Parameters
    ----------
    view
        The photos.
    pixel_m
        Edge of a pixel; by default the size on the ground of a pixel at the middle of a photo, the
        median over the photos, to two digits.

    Raises
    ------
    GeometryError
        No photo shows the ground, or the raster would be too large.
    """
    shown = [_shown_ground(view, index) for index in range(len(view.rows))]
    together = np.concatenate(shown)
    if not len(together):
        raise GeometryError(
            "no adjusted photo looks down at the ground, so there is nothing to rectify: pick "
            "points in one that does"
        )
    origin, crs = view.origin, view.result.world.crs
    if origin is not None and crs is not None:
        together = projected_from_enu(together, origin, crs)
    else:
        crs = None
    size_m = _usual_pixel(view) if pixel_m is None else pixel_m
    low, high = together[:, :2].min(axis=0), together[:, :2].max(axis=0)
    _check_size(high - low, size_m)
    low, high = np.floor(low / size_m) * size_m, np.ceil(high / size_m) * size_m
    width, height = np.round((high - low) / size_m).astype(int)
    return GroundRaster(
        west_m=float(low[0]),
        north_m=float(high[1]),
        pixel_m=size_m,
        width=int(width),
        height=int(height),
        crs=crs,
    )


def _check_size(extent_m: Floats, pixel_m: float) -> None:
    """Refuse pixels that are too many, or too few."""
    shown = f"the photos show {format_digits(extent_m[0], 3)} x {format_digits(extent_m[1], 3)} m"
    # in this order, as the square of a tiny number underflows
    if extent_m[0] / pixel_m > MOST_PIXELS / max(extent_m[1] / pixel_m, 1.0):
        least = float(np.sqrt(np.prod(extent_m) / MOST_PIXELS))
        raise GeometryError(
            f"pixels of {format_digits(pixel_m, 6)} m are too many: {shown}; ask for --pixel-size "
            f"{format_digits(least)} or "
            "more, or for one --frame"
        )
    if extent_m.min() < LEAST_PIXELS * pixel_m:
        raise GeometryError(
            f"pixels of {format_digits(pixel_m, 6)} m are too large: {shown}; ask for --pixel-size "
            f"{format_digits(extent_m.min() / LEAST_PIXELS)} or less"
        )


def boxes(view: View, raster: GroundRaster) -> Floats:
    """Return first column and row, last column and row (N, 4) of each photo; NaN without ground."""
    out = np.full((len(view.rows), 4), np.nan)
    origin = view.origin
    for index in range(len(view.rows)):
        place = _shown_ground(view, index)
        if raster.crs is not None and origin is not None:
            place = projected_from_enu(place, origin, raster.crs)
        if len(place):
            columns = (place[:, 0] - raster.west_m) / raster.pixel_m
            rows = (raster.north_m - place[:, 1]) / raster.pixel_m
            out[index] = columns.min(), rows.min(), columns.max(), rows.max()
    return out


def _shown_ground(view: View, index: int) -> Floats:
    """Return places (n, 3) on the ground all over a photo, and along the edge of its ground."""
    camera = view.result.camera
    share = np.linspace(0.0, 1.0, EXTENT_SAMPLES)
    size = np.array([camera.width_px, camera.height_px])
    pixel = np.stack(np.meshgrid(share, share), axis=-1) * size - 0.5
    place = _ground_behind(view, index, pixel)
    shown = np.isfinite(place[..., 0])
    ends = []
    for a, b in (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]):
        for inner, outer in ((a, b), (b, a)):
            edge = shown[inner] & ~shown[outer]
            ends.append(np.stack([pixel[inner][edge], pixel[outer][edge]]))
    good, bad = np.concatenate(ends, axis=1)
    # Bisection between pixels with and without ground.
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        is_good = np.isfinite(_ground_behind(view, index, middle)[:, :1])
        good, bad = np.where(is_good, middle, good), np.where(is_good, bad, middle)
    return np.concatenate([place[shown], _ground_behind(view, index, good)])


def _ground_behind(view: View, index: int, pixel: Floats) -> Floats:
    """Intersect pixels (..., 2) of a photo with the ground (..., 3), if steep enough; else NaN."""
    result, row = view.result, view.rows[index]
    center, ray = sight_lines(
        result.camera, result.shared.intrinsics.value, row_poses(result, row), pixel
    )
    place = intersect_ground(center, ray, view.surface, result.plane.pivot_m)
    steep = -ray[..., 2] > MIN_SINE * np.linalg.norm(ray, axis=-1)
    return np.where(steep[..., None], place, np.nan)


def photo_pixels_m(view: View) -> Floats:
    """Return the ground size (N,) of a pixel at the middle of each photo; NaN without ground."""
    result = view.result
    middle = np.array([result.camera.width_px, result.camera.height_px]) / 2 - 0.5
    corners = middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ray = back_project(result.camera.model, result.shared.intrinsics.value, corners)
    poses = result.frames.refined
    place = intersect_ground(
        poses.center_world_m[view.rows, None],
        np.einsum("nij,kj->nki", poses.world_from_camera[view.rows], ray),
        view.surface,
        result.plane.pivot_m,
    )
    aside, along = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    return np.asarray(np.sqrt(np.abs(aside[:, 0] * along[:, 1] - aside[:, 1] * along[:, 0])))


def reductions(view: View, raster: GroundRaster) -> Ints:
    """Return powers of two (N,) that reduce photos so that a coarse raster skips no pixel."""
    ratio = raster.pixel_m / np.nan_to_num(photo_pixels_m(view), nan=np.inf)
    return np.asarray(2 ** np.log2(np.maximum(ratio, 1.0)).astype(np.int64))


def _usual_pixel(view: View) -> float:
    """Return the median ground size of a pixel at the middle of a photo, to two digits."""
    sizes = photo_pixels_m(view)
    if not np.isfinite(sizes).any():
        raise GeometryError(
            "the centre of no photo shows the ground: state the size of a pixel with --pixel-size"
        )
    size = float(np.nanmedian(sizes))
    digits = NICE_DIGITS - 1 - int(np.floor(np.log10(size)))
    return round(size, digits)
