"""Files for COLMAP and OpenDroneMap: places judged by OpenCV and pyproj."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from csv_rows import read_rows
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from uavgram.io.exports.photogrammetry import write_colmap_model, write_gcp_list
from uavgram.model.maps import Features
from uavgram.model.result.result import Result


def test_colmap_poses_and_points_project_to_the_picks(result: Result, tmp_path: Path) -> None:
    write_colmap_model(result, tmp_path)
    points = {
        int(row[0]): np.array(row[1:4], float)
        for row in map(str.split, (tmp_path / "points3D.txt").read_text().splitlines())
        if row[0] != "#"
    }
    lines = [r for r in (tmp_path / "images.txt").read_text().splitlines() if r[:1] != "#"]
    camera = (tmp_path / "cameras.txt").read_text().splitlines()[-1].split()
    assert camera[1:4] == ["FULL_OPENCV", "1640", "1232"]
    fx, fy, cx, cy, *lens = map(float, camera[4:])
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    seen = []
    for pose, picks in zip(lines[::2], lines[1::2], strict=True):
        _, *numbers, _, name = pose.split()
        w, x, y, z, *shift = map(float, numbers)
        rotation = Rotation.from_quat([x, y, z, w])
        cells = np.array(picks.split(), float).reshape(-1, 3)
        if not len(cells):
            continue
        world = np.array([points[int(n)] for n in cells[:, 2]])
        pixel, _ = cv2.projectPoints(
            world, rotation.as_rotvec(), np.array(shift), matrix, np.array(lens)
        )
        seen.append(pixel[:, 0] - cells[:, :2])
        assert name in result.frames.frame_id
    apart = np.concatenate(seen)
    assert len(apart) > 100
    assert np.median(np.abs(apart)) < 1.0  # picks have a pixel of noise
    assert np.abs(np.median(apart, axis=0)).max() < 0.2  # half a pixel would show


def test_the_covariances_beside_the_model_are_those_of_the_centres(
    result: Result, tmp_path: Path
) -> None:
    write_colmap_model(result, tmp_path)
    rows = read_rows(tmp_path / "pose_priors.csv")
    at = {name: k for k, name in enumerate(result.frames.frame_id)}

    assert len(rows) == int(result.has_refined.sum())
    for row in rows:
        covariance = result.frames.refined.covariance[at[row["image"]]]
        assert float(row["xx_m2"]) == pytest.approx(covariance[0, 0], rel=1e-6)
        assert float(row["yz_m2"]) == pytest.approx(covariance[1, 2], rel=1e-6, abs=1e-15)


def test_ground_control_has_the_place_and_the_pixel_of_each_used_pick(
    result: Result, features: Features, tmp_path: Path
) -> None:
    write_gcp_list(result, features, tmp_path / "gcp_list.txt")
    head, *lines = (tmp_path / "gcp_list.txt").read_text().splitlines()
    to_earth = Transformer.from_crs(head, "EPSG:4326", always_xy=True)
    used = [i for i, s in enumerate(result.picks.status) if s in {"used", "suspect"}]

    assert head == result.world.crs
    assert len(lines) == len(used)
    for i, line in zip(used, lines, strict=True):
        east, north, _, u, v, image, label = line.split()
        k = result.points.label.index(label)
        longitude, latitude = to_earth.transform(float(east), float(north))
        assert longitude == pytest.approx(result.points.longitude_deg[k], abs=2e-9)
        assert latitude == pytest.approx(result.points.latitude_deg[k], abs=2e-9)
        np.testing.assert_allclose([float(u), float(v)], result.picks.pixel_px[i], atol=1e-3)
        assert image == result.picks.image[i]
