"""camera.yaml: both ways to state errors, and every way to get it wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.config.camera import camera_text, load_camera, load_camera_file
from uavgram.errors import InputError
from uavgram.model.arrays import Floats
from uavgram.model.camera import (
    Calibration,
    CameraProvenance,
    LensModel,
    Readout,
    find_published_readout,
)
from uavgram.model.limits import number_text
from uavgram.model.provenance import InputDigest

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


# The readout time in camera.yaml, and what is published of cameras.


CAMERA = """\
model: brown
width_px: 4000
height_px: 3000
parameters: [3000, 3000, 2000, 1500, 0, 0, 0, 0, 0]
sigma: [3, 3, 3, 3, 0, 0, 0, 0, 0]
"""


def written(folder: Path, more: str) -> Path:
    path = folder / "camera.yaml"
    path.write_text(CAMERA + more)
    return path


@pytest.mark.parametrize(
    ("more", "readout"),
    [
        ("", None),
        ("readout_ms: 0\n", Readout(value_s=0.0, sigma_s=0.0)),
        ("readout_ms: 33\n", Readout(value_s=0.033, sigma_s=0.005)),
        ("readout_ms: 33\nreadout_sigma_ms: 2\n", Readout(value_s=0.033, sigma_s=0.002)),
    ],
)
def test_it_is_read_and_written(tmp_path: Path, more: str, readout: Readout | None) -> None:
    camera = load_camera(written(tmp_path, more))
    assert camera.readout == readout
    source = CameraProvenance(program="p", version="1", created_utc="2026-01-01", source="s")
    (tmp_path / "again.yaml").write_text(camera_text(replace(camera, name="c"), source))
    assert load_camera(tmp_path / "again.yaml").readout == readout


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("readout_sigma_ms: 2\n", "needs a readout time: add 'readout_ms'"),
        ("readout_ms: 33000\n", "far too long"),
        ("readout_ms: 33\nreadout_sigma_ms: -1\n", "must be from 0"),
    ],
)
def test_nonsense_is_refused_with_its_line(tmp_path: Path, more: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        load_camera(written(tmp_path, more))


def test_published_values_are_those_of_opendronemap() -> None:
    usual = find_published_readout("DJI", "FC330", 4000, 3000)
    assert usual == Readout(value_s=0.033, sigma_s=0.005)
    wide = find_published_readout("Hasselblad", "L1D-20c", 5472, 3078)
    whole = find_published_readout("Hasselblad", "L1D-20c", 5472, 3648)
    assert wide is not None
    assert whole is not None
    assert (wide.value_s, whole.value_s) == (0.047, 0.056)
    assert find_published_readout("DJI", "FC6310", 5472, 3648) is None  # it has two shutters
    assert find_published_readout("", "", 4000, 3000) is None


# camera.yaml as this program writes it: read back to the bit, with where it comes from.


class Reread(Protocol):
    def __call__(
        self, calibration: Calibration, provenance: CameraProvenance = ...
    ) -> tuple[Calibration, CameraProvenance | None]: ...


PROVENANCE = CameraProvenance(
    program="uavgram",
    version="1.2",
    created_utc="2026-01-05T10:00:00+00:00",
    source="calibrated from 13 photos",
    inputs=(InputDigest(path="photos/a: b.jpg", sha256="0a" * 32, size_bytes=123),),
    board="chessboard 9 x 6, 25 mm",
    options={"fixed aspect": True, "rounds": 3, "corner_sigma_px": 1e-7, "note": "no: #1"},
    variance_factor=1.0,
    make="DJI",
    camera_model="FC300X",
    focal_mm=3.61,
    focus_m=2.5,
)
MINIMAL = CameraProvenance(program="uavgram", version="1", created_utc="now", source="converted")


def camera(
    count: int = 9, model: LensModel = "brown", seed: int = 0, name: str = "c"
) -> Calibration:
    rng = np.random.default_rng(seed)
    scale = np.array([5, 5, 8, 8, *[1e-3] * 8])[:count]
    root = rng.normal(size=(count, count)) * scale[:, None]
    covariance = root @ root.T
    value = np.array([2300.1, 2305.7, 2005, 1490, *rng.normal(size=8) * 1e-2])[:count]
    return Calibration(
        name=name,
        model=model,
        width_px=4000,
        height_px=3000,
        parameters=value,
        covariance=(covariance + covariance.T) / 2,
    )


@pytest.fixture
def reread(tmp_path: Path) -> Reread:
    def read(
        calibration: Calibration, provenance: CameraProvenance = PROVENANCE
    ) -> tuple[Calibration, CameraProvenance | None]:
        path = tmp_path / "camera.yaml"
        path.write_text(camera_text(calibration, provenance), encoding="utf-8")
        return load_camera_file(path)

    return read


@pytest.mark.parametrize(("count", "model"), [(9, "brown"), (12, "brown"), (8, "fisheye")])
@pytest.mark.parametrize("provenance", [PROVENANCE, MINIMAL])
def test_every_digit_comes_back(
    reread: Reread, count: int, model: LensModel, provenance: CameraProvenance
) -> None:
    written = camera(count, model)
    read, told = reread(written, provenance)

    np.testing.assert_array_equal(read.parameters, written.parameters)
    np.testing.assert_array_equal(read.covariance, written.covariance)
    assert (read.name, read.model, read.width_px, read.height_px) == ("c", model, 4000, 3000)
    assert told == provenance


@settings(max_examples=60)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_any_number_is_read_back_as_that_number(value: float) -> None:
    text = number_text(value)

    assert float(text) == value
    assert "." in text  # YAML 1.1 takes 1e-05 for text


@pytest.mark.parametrize(
    "name", ['a "b"', "x: y # z", "é ü ☃ \U0001f600", "two\nlines", "null", "1", "1e-3", "1,5"]
)
def test_any_name_comes_back(reread: Reread, name: str) -> None:
    assert reread(camera(name=name))[0].name == name


def test_a_person_finds_name_and_sigma_beside_each_value() -> None:
    lines = camera_text(camera(), PROVENANCE).splitlines()
    sigma = np.sqrt(camera().covariance[0, 0])

    assert f"  - 2300.1  # fx ± {sigma:.3g} px" in lines


def test_a_file_without_provenance_has_none(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    text = camera_text(camera(), PROVENANCE)
    path.write_text(text[: text.index("provenance:")], encoding="utf-8")

    assert load_camera_file(path)[1] is None
    np.testing.assert_array_equal(load_camera(path).parameters, camera().parameters)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("  source: ", "  sauce: ", "provenance.sauce: unknown"),
        ("    size_bytes: 123", "    size_bytes: many", "size_bytes"),
        ("  focal_mm: 3.61", "  focal_mm: short", "provenance.focal_mm"),
    ],
)
def test_a_mistake_in_the_provenance_is_named(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    path = tmp_path / "camera.yaml"
    text = camera_text(camera(), PROVENANCE).replace(old, new)
    path.write_text(text, encoding="utf-8")
    line = text[: text.index(new)].count("\n") + 1

    with pytest.raises(InputError, match=rf":{line}: [\s\S]*{words}"):
        load_camera(path)


def test_the_options_of_a_provenance_cannot_change() -> None:
    with pytest.raises(TypeError):
        PROVENANCE.options["rounds"] = 4  # type: ignore[index]  # what must fail
