"""In the recording nobody can take a value without its standing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from recording_contents import Contents
from standings import with_status

from uavgram.model.result.reliability import Reason, Verdict, VerdictLevel
from uavgram.model.result.result import Result
from uavgram.views.recording import write_recording
from uavgram.views.recording.pages import measured_page, summary
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.world.labels import measured_text
from uavgram.views.recording.world.legend import draw_legend
from uavgram.views.style import LEVEL_COLOURS
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.verdict import verdict_words

PHOTO = "/survey/current_camera/photo"
FRAME = "DSC_0003.jpg"


def no_ground() -> None:
    """In place of a mosaic."""


def label_in_frame(result: Result) -> str:
    """A label that is picked in `FRAME`."""
    return result.picks.label[result.picks.image.index(FRAME)]


@pytest.fixture(scope="module")
def result() -> Result:
    """Red: one measurement contradicted, one that nothing checks, the others doubtful."""
    made = with_status(survey.build(), "contradicted", "not-checked", "doubtful")
    reason = Reason(
        cause="labels-swapped",
        text=f"Two labels seem to be swapped in {FRAME}: swap them there.",
        frames=(FRAME,),
        labels=(label_in_frame(made), "nowhere"),
    )
    return replace(made, verdict=Verdict(level="red", reasons=(reason,)))


@pytest.fixture(scope="module")
def contents(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path: Path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    write_recording(result, (), no_ground, path)
    return Contents(path)


def test_the_first_page_begins_with_the_level_and_the_cause(result: Result) -> None:
    page = summary(result, verdict_words(result), measure_scene(result))

    opening = "# ⚠ Do not use: it does not fit together\n\n1. Two labels seem"
    assert page.startswith(opening)


def test_each_row_has_its_status_and_no_value_in_doubt_is_loud(result: Result) -> None:
    rows = [line for line in measured_page(result).splitlines() if line.startswith("| ")]

    assert any("| ~~39.612 ± 0.021 m~~ | **contradicted** |" in row for row in rows)
    assert any(" ± 0.034 m** | **not checked** |" in row for row in rows)
    assert any("| 6.310 ± 0.012 m ? | **doubtful** |" in row for row in rows)


def test_what_is_contradicted_is_dashed_and_its_label_says_so(
    result: Result, contents: Contents
) -> None:
    dashes = contents.static["/survey/measured/contradicted"]["LineStrips3D:strips"]

    assert len(dashes) == 15
    assert measured_text(result, 0) == "skid left 39.612 ± 0.021 m (contradicted)"
    assert contents.static["/survey/measured/doubtful"]
    in_photos = contents.by_frame[f"{PHOTO}/measured/contradicted"]["LineStrips2D:strips"]
    assert max(map(len, in_photos.values())) > 1


def test_picks_that_a_reason_names_are_marked_in_their_photo(
    result: Result, contents: Contents
) -> None:
    frame = result.frames.frame_id.index(FRAME)
    pixel = result.picks.pixel_px[result.picks.image.index(FRAME)]
    marked = contents.by_frame[f"{PHOTO}/picked_suspect"]["Points2D:positions"]

    assert np.array(marked[frame]) - 0.5 == pytest.approx(pixel[None], abs=0.01)
    assert frame_states(result)[frame] == "check"


@pytest.mark.parametrize("level", ["green", "amber", "red"])
def test_the_legend_has_the_colour_of_the_verdict(result: Result, level: VerdictLevel) -> None:
    judged = replace(result, verdict=Verdict(level=level))
    image = np.asarray(draw_legend(judged, measure_scene(judged)))

    for one, colour in LEVEL_COLOURS.items():
        assert bool((image[2, 2] == colour).all()) == (one == level)
    assert (image[:40] != image[2, 2]).any()  # and words on it
