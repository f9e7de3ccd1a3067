"""Photos of very large surveys in the recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
import synthetic_survey as survey

from uavgram.pipeline.measure import outputs, pictures


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
    assert pictures.note_thinning(made) is made

    monkeypatch.setattr(pictures, "MAX_RECORDED", len(names) // 2)
    written.clear()
    grounded.clear()
    outputs.write_review(made, tmp_path / "r.rrd")
    told = pictures.note_thinning(made).messages[-1]
    assert tuple(grounded) == names
    assert 0 < len(written) <= len(names) // 2
    assert set(written) < set(names)
    assert f"carries {len(written)} of the {len(names)} photos" in told.text
