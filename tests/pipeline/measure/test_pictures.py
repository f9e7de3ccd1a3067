"""Pictures of the report, cut out of photos that pass by."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.imaging.photos.preview import make_preview_of_decoded, read_preview
from uavgram.io.files import photo_files
from uavgram.model.result.result import Result
from uavgram.pipeline.measure import pictures
from uavgram.pipeline.measure.pictures import ReportPictures


@pytest.fixture
def result(tmp_path: Path) -> Result:
    """A survey whose photos are noise, each another one."""
    made = survey.build()
    size = made.camera.height_px // 8, made.camera.width_px // 8, 3
    paths = []
    for k, name in enumerate(made.frames.frame_id):
        noise = np.random.default_rng(k).integers(0, 256, size, np.uint8)
        large = cv2.resize(noise, (made.camera.width_px, made.camera.height_px))
        paths.append(str(tmp_path / name) + ".jpg")
        assert cv2.imwrite(paths[-1], large)
    return replace(made, frames=replace(made.frames, path=tuple(paths)))


@pytest.mark.parametrize("width", [300, 1600, 1700])  # a half, most of the photo, all of it
def test_photos_of_which_parts_are_shown_do_not_spoil_each_other(
    result: Result, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    reduce = partial(make_preview_of_decoded, max_width_px=width)
    monkeypatch.setattr(pictures, "make_preview_of_decoded", reduce)
    parts = ReportPictures(result)
    wanted = [path for path in photo_files(result.frames) if parts.needs_photo(path)]
    assert 1 < len(wanted) < len(photo_files(result.frames))

    made = [parts.cut_parts(path) for path in wanted]

    for path, (preview, pixels) in zip(wanted, made, strict=True):
        other, reduced = read_preview(path, width)
        assert preview.scale == other.scale
        assert np.abs(pixels.astype(float) - reduced).mean() < 2.0
    assert {one.region.frame for one in parts.pictures().shown} == {
        photo_files(result.frames).index(path) for path in wanted
    }
