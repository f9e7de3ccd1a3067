"""Pictures of the report, cut out of photos that pass by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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
from uavgram.pipeline.measure import outputs
from uavgram.pipeline.measure.outputs import ReportPictures


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
    monkeypatch.setattr(outputs, "make_preview_of_decoded", reduce)
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


# Photos of very large surveys in the recording.


def test_a_recording_of_very_many_photos_carries_some_and_the_ground_is_of_all(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made = survey.build()
    names = made.frames.frame_id
    grounded: list[str] = []
    written: list[str] = []

    class Ground:
        def __init__(self, *_: object) -> None:
            pass

        def add(self, name: str, _: object) -> None:
            grounded.append(name)

    def prefetched(_: object, paths: Iterable[str]) -> Iterator[tuple[str, tuple[str, None]]]:
        return ((path, ("preview", None)) for path in paths)

    def taken(_: object, photos: Iterable[tuple[str, object]], *__: object) -> None:
        written.extend(name for name, _ in photos)

    monkeypatch.setattr(outputs, "Mosaic", Ground)
    monkeypatch.setattr(outputs, "prefetch", prefetched)
    monkeypatch.setattr(outputs, "write_recording", taken)
    outputs.write_review(made, tmp_path / "r.rrd")
    assert tuple(written) == tuple(grounded) == names
    assert outputs.note_thinning(made) is made

    monkeypatch.setattr(outputs, "MAX_RECORDED", len(names) // 2)
    written.clear()
    grounded.clear()
    outputs.write_review(made, tmp_path / "r.rrd")
    told = outputs.note_thinning(made).messages[-1]
    assert tuple(grounded) == names
    assert 0 < len(written) <= len(names) // 2
    assert set(written) < set(names)
    assert f"carries {len(written)} of the {len(names)} photos" in told.text
