"""OpenCV's calibration file as this program writes it: read by OpenCV, and back to the bit."""

import dataclasses
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.geometry.camera.projection import project
from uavgram.io.cameras.opencv import is_opencv_calibration, opencv_text, read_opencv_calibration
from uavgram.model.camera.calibration import Calibration, LensModel


class Write(Protocol):
    def __call__(self, calibration: Calibration, old: str = ..., new: str = ...) -> Path: ...


VALUES = [2300.1, 2305.7, 2005, 1490, -0.05, 0.02, 1e-3, -5e-4, 0.01, 0.1, 0.02, 0.03]
CASES = [(9, "brown"), (12, "brown"), (8, "fisheye")]


def camera(count: int, model: LensModel, name: str = "c") -> Calibration:
    rng = np.random.default_rng(count)
    root = rng.normal(size=(count, count)) * np.array([5, 5, 8, 8, *[1e-3] * 8])[:count, None]
    covariance = root @ root.T
    return Calibration(
        name=name,
        model=model,
        width_px=4000,
        height_px=3000,
        parameters=np.array(VALUES[:count]),
        covariance=(covariance + covariance.T) / 2,
    )


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(calibration: Calibration, old: str = "", new: str = "") -> Path:
        path = tmp_path / "calibration.yml"
        text = opencv_text(calibration, "2026-01-05T10:00:00+00:00")
        path.write_text(text.replace(old, new) if old else text, encoding="utf-8")
        return path

    return _write


@pytest.mark.parametrize(("count", "model"), CASES)
def test_every_digit_comes_back(write: Write, count: int, model: LensModel) -> None:
    written = camera(count, model, name='a "b": é')
    path = write(written)
    read, messages = read_opencv_calibration(path)

    assert is_opencv_calibration(path)
    np.testing.assert_array_equal(read.parameters, written.parameters)
    np.testing.assert_array_equal(read.covariance, written.covariance)
    assert (read.name, read.model, read.width_px, read.height_px) == ('a "b": é', model, 4000, 3000)
    assert [m.code for m in messages] == ["camera-sigma-from-file"]


@pytest.mark.parametrize(("count", "model"), CASES)
def test_opencv_projects_with_the_file_as_this_program_does(
    write: Write, count: int, model: LensModel
) -> None:
    written = camera(count, model)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 2], (30, 1, 3))
    storage = cv2.FileStorage(str(write(written)), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    none = np.zeros(3)
    if model == "fisheye":
        pixel, _ = cv2.fisheye.projectPoints(points, none, none, matrix, distortion)
    else:
        pixel, _ = cv2.projectPoints(points, none, none, matrix, distortion)

    np.testing.assert_allclose(
        pixel[:, 0], project(model, written.parameters, points[:, 0]), atol=1e-9
    )
    np.testing.assert_array_equal(
        storage.getNode("std_deviation_intrinsics").mat()[:, 0],
        np.sqrt(np.diag(written.covariance)),
    )


def test_without_the_covariance_its_sigmas_serve(write: Write) -> None:
    written = camera(9, "brown")
    read, _ = read_opencv_calibration(write(written, "intrinsics_covariance", "someone_elses_key"))

    np.testing.assert_allclose(read.covariance, np.diag(np.diag(written.covariance)))


def test_a_covariance_of_another_size_is_refused(tmp_path: Path) -> None:
    nine, eight = (opencv_text(camera(*case), "now") for case in ((9, "brown"), (8, "fisheye")))
    key = "intrinsics_covariance"
    path = tmp_path / "calibration.yml"
    path.write_text(nine[: nine.index(key)] + eight[eight.index(key) :], encoding="utf-8")

    with pytest.raises(InputError, match=r"must be 9 x 9 \(got 64 numbers\)"):
        read_opencv_calibration(path)


@pytest.mark.parametrize(
    ("element", "factor"), [((0, 1), -1.0), (([0, 1], [1, 0]), 50.0)], ids=["lopsided", "too much"]
)
def test_a_matrix_that_is_no_covariance_is_refused(
    write: Write, element: tuple[int | list[int], int | list[int]], factor: float
) -> None:
    good = camera(9, "brown")
    bad = good.covariance.copy()
    bad[element] *= factor

    with pytest.raises(InputError, match="is no covariance"):
        read_opencv_calibration(write(dataclasses.replace(good, covariance=bad)))
