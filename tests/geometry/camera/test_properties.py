"""What a calibration means, against OpenCV and pencil and paper."""

import cv2
import numpy as np
import pytest
from opencv_rays import undistort

from uavgram.geometry.camera.projection import project
from uavgram.geometry.camera.properties import (
    compute_camera_properties,
    crop_calibration,
    scale_calibration,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, LensModel


def camera(
    parameters: Floats | list[float],
    sigma: float = 1.0,
    size: tuple[int, int] = (4000, 3000),
    model: LensModel = "brown",
) -> Calibration:
    n = len(parameters)
    covariance = np.full((n, n), 0.5 * sigma**2) + 0.5 * sigma**2 * np.eye(n)
    return Calibration(
        name="c",
        model=model,
        width_px=size[0],
        height_px=size[1],
        parameters=np.array(parameters, dtype=float),
        covariance=covariance,
    )


def test_the_field_of_view_is_opencvs() -> None:
    facts = compute_camera_properties(camera([2300, 2310, 1999.5, 1499.5, 0, 0, 0, 0, 0]))
    matrix = np.array([[2300, 0, 2000], [0, 2310, 1500], [0, 0, 1.0]])
    wide, high, *_ = cv2.calibrationMatrixValues(matrix, (4000, 3000), 1.0, 1.0)

    np.testing.assert_allclose(np.degrees(facts.field_of_view_rad[:2]), [wide, high], atol=1e-9)


def test_a_lens_of_43_mm_on_a_frame_of_36_by_24_is_one_of_43_mm() -> None:
    diagonal_px = np.hypot(3600, 2400)
    facts = compute_camera_properties(
        camera([diagonal_px, diagonal_px, 0, 0, 0, 0, 0, 0, 0], size=(3600, 2400))
    )

    assert facts.equivalent_mm == pytest.approx(np.hypot(36, 24))


def test_distortion_at_the_corners_is_how_far_opencv_moves_them() -> None:
    parameters = np.array([2300, 2310, 2010, 1480, -0.05, 0.01, 1e-3, -5e-4, 0.001])
    corners = np.array([[-0.5, -0.5], [3999.5, -0.5], [3999.5, 2999.5], [-0.5, 2999.5]])
    matrix = np.array([[2300, 0, 2010], [0, 2310, 1480], [0, 0, 1.0]])
    rays = undistort(corners[:, None], matrix, parameters[4:])[:, 0]
    straight = rays * parameters[:2] + parameters[2:4]
    centre = parameters[2:4]
    moved = np.linalg.norm(corners - centre, axis=1) - np.linalg.norm(straight - centre, axis=1)
    facts = compute_camera_properties(camera(parameters))

    np.testing.assert_allclose(facts.corner_distortion_px, moved, atol=1e-3)
    assert (facts.corner_distortion_px < -20).all()  # a barrel pulls them inward
    np.testing.assert_allclose(facts.centre_offset_px, [10.5, -19.5])


def test_a_lens_that_folds_back_says_where() -> None:
    facts = compute_camera_properties(camera([2300, 2300, 1999.5, 1499.5, -0.5, 0, 0, 0, 0]))

    # r (1 - r^2 / 2) stops growing at r^2 = 2/3
    assert facts.fold_rad == pytest.approx(np.arctan(np.sqrt(2 / 3)))
    assert 0.1 < facts.share_without_rays < 1
    assert np.isnan(facts.corner_distortion_px).all()
    assert (
        compute_camera_properties(camera([2300, 2300, 0, 0, 0, 0, 0, 0, 0])).fold_rad == np.pi / 2
    )


def test_correlations_are_those_of_the_covariance() -> None:
    facts = compute_camera_properties(camera([2300, 2300, 2000, 1500, 0, 0, 0, 0, 0], sigma=3.0))

    np.testing.assert_allclose(facts.correlation, 0.5 + 0.5 * np.eye(9))


# Cameras of resized and cropped photos: against OpenCV's resizing, and by the law of errors.


PARAMETERS = np.array([2300.0, 2310, 1950, 1480, -0.05, 0.02, 4e-4, -2e-4, 0.001])


@pytest.fixture
def make_camera() -> Calibration:
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
    make_camera: Calibration, size: tuple[int, int]
) -> None:
    small = scale_calibration(make_camera, 160, 120)
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


def test_a_point_is_seen_where_it_lies_in_the_cropped_photo(make_camera: Calibration) -> None:
    part = crop_calibration(make_camera, 100, 375, 3800, 2250)
    points = np.random.default_rng(0).uniform([-0.3, -0.3, 1], [0.3, 0.3, 2], (20, 3))

    assert (part.width_px, part.height_px) == (3800, 2250)
    np.testing.assert_allclose(
        project("brown", part.parameters, points) + np.array([100, 375]),
        project("brown", PARAMETERS, points),
        atol=1e-9,
    )
    np.testing.assert_array_equal(part.covariance, make_camera.covariance)


def test_the_covariance_of_a_resized_camera_is_that_of_its_pixels(make_camera: Calibration) -> None:
    small = scale_calibration(make_camera, 1000, 1500)
    step = np.eye(9) * [1, 1, 1, 1, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]

    def moved(by: Floats) -> Floats:
        return scale_calibration(
            Calibration(**{**vars(make_camera), "parameters": PARAMETERS + by}), 1000, 1500
        ).parameters

    jacobian = np.stack([(moved(s) - moved(-s)) / (2 * s.sum()) for s in step], axis=1)
    np.testing.assert_allclose(
        small.covariance, jacobian @ make_camera.covariance @ jacobian.T, rtol=1e-8, atol=1e-16
    )


def test_there_and_back_is_the_same_camera(make_camera: Calibration) -> None:
    back = scale_calibration(scale_calibration(make_camera, 1234, 777), 4000, 3000)

    np.testing.assert_allclose(back.parameters, PARAMETERS, rtol=1e-13)
    np.testing.assert_allclose(back.covariance, make_camera.covariance, rtol=1e-12)


@pytest.mark.parametrize("part", [(-1, 0, 10, 10), (0, 0, 4001, 10), (3995, 0, 10, 10)])
def test_a_part_outside_the_photo_is_refused(
    make_camera: Calibration, part: tuple[int, ...]
) -> None:
    with pytest.raises(ValueError, match="does not lie inside"):
        crop_calibration(make_camera, *part)
