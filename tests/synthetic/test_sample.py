"""The sample to play with: whole or not at all, never over anything, gone on with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.synthetic import demo
from uavgram.synthetic.accident_scene import TAPE_FILE
from uavgram.synthetic.demo import make_sample
from uavgram.synthetic.survey import SimulatedSurvey


def grey(survey: SimulatedSurvey) -> Iterator[NDArray[np.uint8]]:
    size = (survey.calibration.height_px, survey.calibration.width_px, 3)
    yield from (np.full(size, 90, np.uint8) for _ in survey.frame_id)


@pytest.fixture(autouse=True)
def quick_photos(monkeypatch: pytest.MonkeyPatch) -> None:
    """The scene itself is rendered in the tests of the demo."""
    monkeypatch.setattr(demo, "render_photos", grey)


def test_the_sample_has_photos_log_and_camera_and_nothing_picked(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "sample"
    inputs = read_inputs(make_sample(folder), unfinished=True)
    assert len(inputs.photos.frame_id) == 13
    assert inputs.log is not None
    assert (inputs.picks.image, inputs.lines.name, inputs.requests) == ((), (), ())
    assert (folder / "picks.csv").read_text(encoding="utf-8").count("\n") == 1
    assert "R3 to R4   13.00 m" in (folder / TAPE_FILE).read_text(encoding="utf-8")
    assert "P5 to P7   4.3" in (folder / TAPE_FILE).read_text(encoding="utf-8")
    assert sorted(p.name for p in folder.parent.iterdir()) == ["sample"]


def test_a_sample_that_is_there_is_gone_on_with(tmp_path: Path) -> None:
    project = make_sample(tmp_path / "sample")
    project.write_text(project.read_text(encoding="utf-8") + "# mine\n", encoding="utf-8")
    picks = project.with_name("picks.csv")
    picks.write_text(
        picks.read_text(encoding="utf-8") + "IMG_0001.jpg,P1,5,5,,\n", encoding="utf-8"
    )
    before = {path: path.read_bytes() for path in (project, picks)}
    assert make_sample(tmp_path / "sample") == project
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.parametrize("name", ["project.yaml", "notes.txt"])
def test_a_folder_of_something_else_is_refused_and_left_as_it_is(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("name: mine\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"nothing was written.*--sample FOLDER"):
        make_sample(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_sample_that_was_broken_off_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(survey: SimulatedSurvey) -> Iterator[NDArray[np.uint8]]:
        yield next(grey(survey))
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "render_photos", broken)
    with pytest.raises(KeyboardInterrupt):
        make_sample(tmp_path / "sample")
    assert list(tmp_path.iterdir()) == []
