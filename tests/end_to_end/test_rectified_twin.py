"""A twin's rectified photos: the marks on the ground lie where the simulator put them.

The marks (a black dot in a white ring) are found in the rectified picture itself, as the centroid of
the dot. They are compared with the simulator's coordinates on the map after one shift and turn in
the plane common to all of them: the receiver's bias and the heading's move the whole survey, and
its own sigmas say so. No scale is taken out.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import rasterio
from pyproj import Transformer

from uavgram.pipeline.rectify import rectify

DOT_PX2 = 0.033  # of a mark's dot on the ground [m2]


@pytest.fixture(scope="module", params=["frame", "mosaic"])
def rectified(request, data_dir, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rectified")
    frame, size = ("IMG_0045.jpg", None) if request.param == "frame" else (None, 0.04)
    done = rectify(data_dir / "calm_nadir" / "project.yaml", folder, frame, size)
    return request.param, done


def true_places(truth, crs):
    """(label, easting, northing) of every mark, by pyproj."""
    world = truth["world"]
    origin = "+lat_0={latitude_deg} +lon_0={longitude_deg} +h_0={height_amsl_m}".format(**world)
    to_earth = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 "
        f"{origin} +step +inv +proj=cart +ellps=WGS84"
    )
    longitude, latitude, _ = to_earth.transform(*np.array(list(truth["points"].values())).T)
    to_map = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    return list(truth["points"]), np.stack(to_map.transform(longitude, latitude), 1)


def dot(grey, opaque, pixel_m):
    """Centroid (column, row) of the one black dot in a white ring, or None."""
    dark = ((grey < 90) & opaque).astype(np.uint8)
    count, label, stats, middle = cv2.connectedComponentsWithStats(dark)
    found = []
    for k in range(1, count):
        area = stats[k, cv2.CC_STAT_AREA] * pixel_m**2
        if not 0.4 * DOT_PX2 < area < 2.0 * DOT_PX2:
            continue
        ring = cv2.dilate((label == k).astype(np.uint8), np.ones((9, 9))) - cv2.dilate(
            (label == k).astype(np.uint8), np.ones((5, 5))
        )
        if grey[ring > 0].min() < 150:
            continue
        near = cv2.dilate((label == k).astype(np.uint8), np.ones((5, 5))) > 0
        row, column = np.nonzero(near)
        weight = np.maximum(220.0 - grey[near], 0.0)
        found.append((weight @ column / weight.sum(), weight @ row / weight.sum()))
        assert np.hypot(*(np.array(found[-1]) - middle[k])) < 1.0
    return found[0] if len(found) == 1 else None


def find_marks(path, places, search_m=1.2):
    """Rows of the places whose mark was found, and (n, 2) where [m on the map]."""
    rows, found = [], []
    with rasterio.open(path) as file:
        size, west, north = file.transform.a, file.transform.c, file.transform.f
        half = round(search_m / size)
        picture = np.moveaxis(file.read(), 0, 2)
    grey = picture[..., :3].mean(axis=2)
    for row, (east, up) in enumerate(places):
        c, r = round((east - west) / size), round((north - up) / size)
        if c - half < 0 or r - half < 0:
            continue
        part = np.s_[r - half : r + half, c - half : c + half]
        if not (picture[part][..., 3] == 255).all() or grey[part].shape != (2 * half, 2 * half):
            continue
        at = dot(grey[part], picture[part][..., 3] == 255, size)
        if at is not None:
            rows.append(row)
            found.append(
                (west + (c - half + at[0] + 0.5) * size, north - (r - half + at[1] + 0.5) * size)
            )
    return np.array(rows), np.array(found)


def without_shift_and_turn(found, true):
    """(n, 2) what is left between two sets of places (Kabsch 1976, in the plane)."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return a @ turn - b, turn


def test_marks_lie_within_a_pixel_and_a_half_of_their_true_coordinates(rectified, truth):
    kind, done = rectified
    _, places = true_places(truth("calm_nadir"), done.raster.crs)
    rows, found = find_marks(done.folder / "rectified.tif", places)

    apart, turn = without_shift_and_turn(found, places[rows])

    assert len(rows) >= (13 if kind == "frame" else 25)
    assert np.hypot(*apart.T).max() < 1.5 * done.raster.pixel_m
    # what was taken out is what the survey's own sigmas allow
    shift = np.hypot(*(found - places[rows]).mean(axis=0))
    assert shift < 3.0 * done.sigma_m[0]
    assert abs(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))) < 1.0


def test_the_files_say_where_they_lie_and_hold_overviews(rectified):
    _, done = rectified
    with rasterio.open(done.folder / "rectified.tif") as file:
        assert file.crs.to_string() == done.raster.crs == "EPSG:32755"
        assert file.overviews(1)[:3] == [2, 4, 8]
        assert file.tags()["survey"] == "calm_nadir"
    with rasterio.open(done.folder / "rectified_sigma.tif") as file:
        assert file.crs.to_string() == "EPSG:32755"
        sigma = file.read(1)
    assert np.nanmin(sigma) == pytest.approx(done.sigma_m[0], rel=1e-6)
    assert np.isfinite(sigma).mean() == pytest.approx(done.covered, abs=0.02)
    sheet = cv2.imread(str(done.folder / "rectified.png"))
    assert max(sheet.shape[:2]) <= 3000 * 1.1
