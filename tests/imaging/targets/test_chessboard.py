"""Chessboards: found whole and in part, in rendered and in real photos."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_photos import Sensor, look, photograph, true_corners

from uavgram.imaging.raster import Image
from uavgram.imaging.targets import chessboard as module
from uavgram.imaging.targets.boards import collect_observations, detect_in_photos
from uavgram.imaging.targets.chessboard import detect_chessboard
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, LensSetting, flat_board
from uavgram.model.camera import LensModel


@pytest.mark.parametrize("model", ["brown", "fisheye"])
@pytest.mark.parametrize("k", [0, 1, 2])
def test_every_corner_of_a_rendered_board_has_its_number_and_its_place(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]], model: LensModel, k: int
) -> None:
    photo, truth = shoot(chessboard, model, k, Sensor(0.7, 2.0, 0.3, jpeg_quality=90))
    seen = detect_chessboard(photo, chessboard)
    assert seen.corner.tolist() == list(range(54))
    assert seen.found_size == (9, 6)
    error = seen.pixel_px - truth
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.abs(error).max() < 0.1


def test_corners_are_nearer_to_the_truth_than_the_sector_detectors_own(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, truth = shoot(chessboard, "brown", 1)
    ours = detect_chessboard(photo, chessboard).pixel_px - truth
    found, corners = cv2.findChessboardCornersSB(photo, (9, 6), flags=cv2.CALIB_CB_ACCURACY)
    assert found
    corners = corners.reshape(-1, 2)
    nearest = np.linalg.norm(corners[:, None] - truth[None], axis=2).argmin(axis=1)
    theirs = corners - truth[nearest]
    assert np.mean(ours**2) < 0.5 * np.mean(theirs**2)


def test_a_large_photo_searched_on_a_reduced_copy_is_measured_at_full_size(
    monkeypatch: pytest.MonkeyPatch, chessboard: Board
) -> None:
    size, lens = (1701, 1301), [1200.0, 1200.0, 850.0, 650.0, -0.1, 0.02, 0.0, 0.0, 0.0]
    pose = look(chessboard, tilt_deg=30, azimuth_deg=200, roll_deg=5, distance_m=0.32)
    photo = photograph(chessboard, "brown", lens, pose, size, Sensor(1.0, 3.0), step_px=8)
    truth = true_corners(chessboard, "brown", lens, pose)
    seen = []
    for width in (550, max(size)):
        monkeypatch.setattr(module, "WIDTHS_PX", (width,))
        seen.append(detect_chessboard(photo, chessboard))
    reduced, whole = seen
    assert len(reduced.corner) == len(whole.corner) == 54
    errors = [np.sqrt(np.mean((seen.pixel_px - truth) ** 2)) for seen in seen]
    assert max(errors) < 0.02
    np.testing.assert_allclose(reduced.pixel_px, whole.pixel_px, atol=0.015)


def test_a_board_that_is_cut_by_the_image_is_numbered_from_its_first_corner(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, truth = shoot(
        chessboard, "brown", 0, tilt_deg=10, roll_deg=0, distance_m=0.22, shift_m=(0.09, 0.0)
    )
    seen = detect_chessboard(photo, chessboard)
    assert seen.found_size is not None
    assert not seen.is_other_board
    assert seen.found_size != (9, 6)
    assert 20 <= len(seen.corner) < 54
    distance = np.linalg.norm(seen.pixel_px[:, None] - truth[None], axis=2)
    true = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 0.1
    # the part is the board's but for a shift by whole squares (and a turn of the whole)
    column, row = seen.corner % 9, seen.corner // 9
    for ours, theirs in ((column, true % 9), (row, true // 9)):
        assert len(set((theirs - ours).tolist())) == 1 or len(set((theirs + ours).tolist())) == 1


def test_a_larger_board_is_another_board_and_its_size_is_said(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, _ = shoot(chessboard, "brown", 0)
    seen = detect_chessboard(photo, flat_board(7, 5, 0.025))
    assert seen.is_other_board
    assert seen.found_size == (9, 6)
    assert len(seen.corner) == 0


def test_a_photo_without_a_board_holds_no_corner(chessboard: Board) -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (480, 640)).astype(np.uint8)
    photo = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0), np.uint8)
    seen = detect_chessboard(photo, chessboard)
    assert len(seen.corner) == 0
    assert seen.found_size is None


def test_numbers_turn_with_the_board_but_are_never_mirrored(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    for roll in (90, 180):
        photo, truth = shoot(chessboard, "brown", 0, roll_deg=roll)
        seen = detect_chessboard(photo, chessboard)
        np.testing.assert_allclose(seen.pixel_px, truth, atol=0.1)


@pytest.mark.parametrize("side", ["left", "right"])
def test_all_of_opencvs_sample_photos_are_found_whole(
    data_dir: Path, chessboard: Board, side: str
) -> None:
    paths = [str(path) for path in sorted((data_dir / "opencv_chess").glob(f"{side}??.jpg"))]
    assert len(paths) == 13
    seen = list(detect_in_photos(paths, chessboard, read_grey))
    assert [len(sighting.corner) for sighting in seen] == [54] * 13
    # held against OpenCV's own detector, which chooses one of the two ends as the first
    for path, sighting in zip(paths, seen, strict=True):
        photo = read_grey(path)
        found, corners = cv2.findChessboardCorners(photo, (9, 6))
        assert found
        corners = cv2.cornerSubPix(photo, corners, (5, 5), (-1, -1), (3, 50, 1e-3)).reshape(-1, 2)
        apart = min(
            np.abs(np.median(order - sighting.pixel_px, axis=0)).max()
            for order in (corners, corners[::-1])
        )
        assert apart < 0.1, path


def test_corners_of_a_drones_photos_agree_with_the_published_ones(data_dir: Path) -> None:
    """Published by the UAV Processing Toolbox (Caltech's corner finder, window of 10 px).

    Their pixels have (0, 0) at the centre of the first pixel, as ours: the mean difference is
    below 0.1 px, where MATLAB's count from 1 would show as 1 px.
    """
    folder = data_dir / "phantom3_lenscalib"
    control = json.loads((folder / "control.json").read_text())
    board = flat_board(11, 9, 0.06)
    files = [photo["file"] for photo in control["photos"]]
    seen = list(detect_in_photos([str(folder / file) for file in files], board, read_grey))
    observations, messages = collect_observations(
        board, files, (4000, 2250), [LensSetting()] * len(files), seen
    )
    assert [message.code for message in messages] == ["corners-misfit"]
    differences = []
    for photo, published in zip(observations.photos, control["photos"], strict=True):
        pixel = np.array([entry["uv"] for entry in published["observations"]])
        place = [[int(n) for n in e["id"].split("_")] for e in published["observations"]]
        nearest = np.linalg.norm(photo.pixel_px[:, None] - pixel[None], axis=2).argmin(axis=1)
        assert len(set(nearest.tolist())) == len(nearest)
        differences.append(photo.pixel_px - pixel[nearest])
        # the same corner of the board, but for the end that counting starts from
        published_place = np.array(place)[nearest]
        ours = np.stack([photo.corner % 11, photo.corner // 11], axis=1)
        for axis in (0, 1):
            total = (published_place + ours)[:, axis]
            apart = (published_place - ours)[:, axis]
            assert min(np.ptp(total), np.ptp(apart)) == 0
    found = np.concatenate(differences)
    assert len(found) >= 0.9 * 6 * 99
    assert np.sqrt(np.mean(found**2)) < 0.3
    assert np.abs(found.mean(axis=0)).max() < 0.1
