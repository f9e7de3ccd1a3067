"""The readout time in camera.yaml, and what is published of cameras."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from uavgram.config.camera import camera_text, load_camera
from uavgram.errors import InputError
from uavgram.model.camera import CameraProvenance, Readout, published_readout

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
    usual = published_readout("DJI", "FC330", 4000, 3000)
    assert usual == Readout(value_s=0.033, sigma_s=0.005)
    wide = published_readout("Hasselblad", "L1D-20c", 5472, 3078)
    whole = published_readout("Hasselblad", "L1D-20c", 5472, 3648)
    assert wide is not None
    assert whole is not None
    assert (wide.value_s, whole.value_s) == (0.047, 0.056)
    assert published_readout("DJI", "FC6310", 5472, 3648) is None  # it has two shutters
    assert published_readout("", "", 4000, 3000) is None
