"""What a calibration means, against OpenCV and pencil and paper."""

import cv2
import numpy as np
import pytest
from opencv_rays import undistort

from uavgram.geometry.camera.properties import compute_camera_properties
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
