"""camera.yaml: both ways to state errors, and every way to get it wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from uavgram.config.camera import load_camera
from uavgram.errors import InputError
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

Load = Callable[[str], Calibration]

HEAD = "name: c\nmodel: brown\nwidth_px: 4000\nheight_px: 3000\n"
PARAMETERS = "parameters: [2900, 2900.5, 2000, 1500, -0.02, 1e-2, 0, 0, 0]\n"
SIGMA = "sigma: [6, 7, 4, 5, 0.002, 0.004, 1e-4, 2e-4, 0]\n"


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def _load(content: str) -> Calibration:
        path = tmp_path / "camera.yaml"
        path.write_text(content)
        return load_camera(path)

    return _load


def covariance_text(matrix: Floats) -> str:
    return "covariance:\n" + "".join(f"  - {row}\n" for row in np.asarray(matrix).tolist())


def a_covariance() -> Floats:
    root = np.random.default_rng(3).normal(size=(9, 12))
    scale = np.array([6, 6, 4, 4, 2e-3, 4e-3, 1e-4, 2e-4, 2e-3])
    return root @ root.T * np.outer(scale, scale) / 12


def test_sigmas_become_a_diagonal_covariance(load: Load) -> None:
    camera = load(HEAD + PARAMETERS + SIGMA)

    assert (camera.name, camera.model) == ("c", "brown")
    assert (camera.width_px, camera.height_px) == (4000, 3000)
    assert camera.parameters[5] == 0.01
    np.testing.assert_array_equal(
        camera.covariance, np.diag([36, 49, 16, 25, 4e-6, 1.6e-5, 1e-8, 4e-8, 0])
    )


def test_a_full_covariance_is_kept(load: Load) -> None:
    matrix = a_covariance()

    np.testing.assert_array_equal(
        load(HEAD + PARAMETERS + covariance_text(matrix)).covariance, (matrix + matrix.T) / 2
    )


def test_a_parameter_held_fixed_may_have_no_variance(load: Load) -> None:
    matrix = a_covariance()
    matrix[8] = matrix[:, 8] = 0.0

    assert load(HEAD + PARAMETERS + covariance_text(matrix)).covariance[8, 8] == 0.0


def test_a_fisheye_camera_has_eight_parameters(load: Load) -> None:
    camera = load(
        "model: fisheye\nwidth_px: 1000\nheight_px: 800\n"
        "parameters: [400, 400, 500, 400, 0.1, 0, 0, 0]\nsigma: [1, 1, 1, 1, 0, 0, 0, 0]\n"
    )

    assert camera.parameters.shape == (8,)
    assert camera.name == "camera"  # the file's


def _changed(i: int, j: int, value: float) -> str:
    matrix = a_covariance()
    matrix[i, j] = value
    return covariance_text(matrix)


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        (HEAD + PARAMETERS, 5, "parameters: have no uncertainty: add"),
        (HEAD + SIGMA, 1, "parameters: is missing"),
        (HEAD + PARAMETERS + SIGMA + covariance_text(a_covariance()), 6, "keep one of the two"),
        (
            HEAD + "parameters: [2900, 2900, 2000, 1500]\n" + SIGMA,
            5,
            "needs 9 numbers in the order",
        ),
        (HEAD + PARAMETERS + "sigma: [1, 2]\n", 6, "sigma: must be 9 numbers"),
        (HEAD + PARAMETERS + SIGMA.replace("5,", "-5,"), 6, "must not be negative (got -5.0)"),
        (HEAD + PARAMETERS.replace("2900,", "-2900,") + SIGMA, 5, "fx must be greater than 0"),
        (HEAD + PARAMETERS.replace("2900.5", "3.6") + SIGMA, 5, "fy must be in pixels (got 3.6"),
        (HEAD + PARAMETERS.replace("1500", "6500") + SIGMA, 5, "cy must be in pixels, inside"),
        (
            HEAD + PARAMETERS.replace("2000", "1490").replace("1500", "2010") + SIGMA,
            5,
            "cx and cy seem to be exchanged (got 1490 and 2010, the middle of the image is at "
            "1999.5 and 1499.5): write 2010, 1490",
        ),
        (HEAD.replace("4000", "-4000") + PARAMETERS + SIGMA, 3, "width_px: must be greater than 0"),
        (HEAD.replace("4000", "4000.5") + PARAMETERS + SIGMA, 3, "must be a whole number"),
        (HEAD.replace("brown", "pinhole") + PARAMETERS + SIGMA, 2, "must be brown or fisheye"),
        (HEAD + PARAMETERS + SIGMA.replace("sigma", "sigmas"), 6, "did you mean 'sigma'?"),
        (HEAD + PARAMETERS.replace("1e-2", "1e-2a") + SIGMA, 5, "parameters[5]: must be a number"),
        (HEAD + PARAMETERS.replace("1e-2", "1e300") + SIGMA, 5, "is far too large (got 1e+300)"),
        (HEAD + PARAMETERS + SIGMA.replace("5,", "1e300,"), 6, "sigma: is far too large"),
        (HEAD + PARAMETERS + "covariance: [[1, 2], [2, 4]]\n", 6, "must have 9 rows"),
        (HEAD + PARAMETERS + _changed(2, 3, 9.0), 9, "not symmetric: cx with cy is 9.0"),
        (HEAD + PARAMETERS + _changed(4, 4, -1.0), 11, "the variance of k1 is negative"),
        (HEAD + PARAMETERS + _changed(0, 0, 1e-3), 6, "is not positive semidefinite"),
        (HEAD + PARAMETERS + _changed(0, 0, 0.0), 6, "is not positive semidefinite"),
    ],
)
def test_a_mistake_is_named_with_its_line(load: Load, content: str, line: int, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load(content)

    assert words in caught.value.message
    assert caught.value.line == line
    assert "is missing" not in caught.value.message or "is missing" in words  # nothing made up


@pytest.mark.parametrize("flight", ["cuav", "calm_nadir", "wind_oblique"])
def test_the_real_cameras_load(data_dir: Path, flight: str) -> None:
    camera = load_camera(data_dir / flight / "camera.yaml")

    assert camera.model == "brown"
    assert camera.covariance[0, 0] > 0


def test_a_rational_camera_has_twelve_parameters(load: Load) -> None:
    rational = PARAMETERS.replace("]", ", 0.3, 0.1, 0.02]")
    camera = load(HEAD + rational + SIGMA.replace("]", ", 0.1, 0.1, 0.1]"))
    assert camera.parameter_names[-3:] == ("k4", "k5", "k6")
    assert camera.parameters[-3:].tolist() == [0.3, 0.1, 0.02]
    with pytest.raises(InputError, match="sigma: must be 12 numbers"):
        load(HEAD + rational + SIGMA)
