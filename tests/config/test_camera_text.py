"""camera.yaml as this program writes it: read back to the bit, with where it comes from."""

from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.config.camera import camera_text, load_camera, load_camera_file
from uavgram.errors import InputError
from uavgram.model.camera import Calibration, CameraProvenance, LensModel
from uavgram.model.limits import number_text
from uavgram.model.provenance import InputDigest


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
    "name", ['a "b"', "x: y # z", "é ü ☃ \U0001f600", "two\nlines", "null", "1"]
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
        ('  source: "', '  sauce: "', "provenance.sauce: unknown"),
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
