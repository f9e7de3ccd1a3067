"""Cameras of resized and cropped photos: against OpenCV's resizing, and by the law of errors."""

import cv2
import numpy as np
import pytest

from uavgram.geometry.camera.projection import project
from uavgram.geometry.camera.properties import crop_calibration, scale_calibration
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

PARAMETERS = np.array([2300.0, 2310, 1950, 1480, -0.05, 0.02, 4e-4, -2e-4, 0.001])


@pytest.fixture
def camera() -> Calibration:
    root = np.random.default_rng(1).normal(size=(9, 9)) * np.array([[5, 6, 7, 8, *[1e-3] * 5]]).T
    return Calibration(
        name="c",
        model="brown",
        width_px=4000,
        height_px=3000,
        parameters=PARAMETERS,
        covariance=root @ root.T,
    )


def blob(u: float, v: float, width: int = 160, height: int = 120) -> Floats:
    """An image with one smooth spot."""
    y, x = np.mgrid[:height, :width]
    image: Floats = np.exp(-((x - u) ** 2 + (y - v) ** 2) / 50.0)
    return image


def centroid(image: Floats) -> Floats:
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    place: Floats = np.array([(image * x).sum(), (image * y).sum()]) / image.sum()
    return place


@pytest.mark.parametrize("size", [(80, 60), (320, 240), (160, 60)])
def test_a_point_is_seen_where_opencv_puts_it_when_it_resizes_the_photo(
    camera: Calibration, size: tuple[int, int]
) -> None:
    small = scale_calibration(camera, 160, 120)
    point = np.array([0.1, -0.2, 1.0])
    u, v = project("brown", small.parameters, point)
    shrinks = size[0] < 160
    image = cv2.resize(
        blob(u, v), size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    )
    resized = scale_calibration(small, *size)

    np.testing.assert_allclose(
        project("brown", resized.parameters, point),
        centroid(np.asarray(image, np.float64)),
        atol=2e-3,
    )


def test_a_point_is_seen_where_it_lies_in_the_cropped_photo(camera: Calibration) -> None:
    part = crop_calibration(camera, 100, 375, 3800, 2250)
    points = np.random.default_rng(0).uniform([-0.3, -0.3, 1], [0.3, 0.3, 2], (20, 3))

    assert (part.width_px, part.height_px) == (3800, 2250)
    np.testing.assert_allclose(
        project("brown", part.parameters, points) + np.array([100, 375]),
        project("brown", PARAMETERS, points),
        atol=1e-9,
    )
    np.testing.assert_array_equal(part.covariance, camera.covariance)


def test_the_covariance_of_a_resized_camera_is_that_of_its_pixels(camera: Calibration) -> None:
    small = scale_calibration(camera, 1000, 1500)
    step = np.eye(9) * [1, 1, 1, 1, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]

    def moved(by: Floats) -> Floats:
        return scale_calibration(
            Calibration(**{**vars(camera), "parameters": PARAMETERS + by}), 1000, 1500
        ).parameters

    jacobian = np.stack([(moved(s) - moved(-s)) / (2 * s.sum()) for s in step], axis=1)
    np.testing.assert_allclose(
        small.covariance, jacobian @ camera.covariance @ jacobian.T, rtol=1e-8, atol=1e-16
    )


def test_there_and_back_is_the_same_camera(camera: Calibration) -> None:
    back = scale_calibration(scale_calibration(camera, 1234, 777), 4000, 3000)

    np.testing.assert_allclose(back.parameters, PARAMETERS, rtol=1e-13)
    np.testing.assert_allclose(back.covariance, camera.covariance, rtol=1e-12)


@pytest.mark.parametrize("part", [(-1, 0, 10, 10), (0, 0, 4001, 10), (3995, 0, 10, 10)])
def test_a_part_outside_the_photo_is_refused(camera: Calibration, part: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="does not lie inside"):
        crop_calibration(camera, *part)
