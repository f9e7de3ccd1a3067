"""In the recording nobody can take a value without its standing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from found_survey import found, tie_cloud
from recording_contents import Contents
from standings import with_status

from uavgram.model.result.reliability import Reason, Verdict, VerdictLevel
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.views.recording import write_recording
from uavgram.views.recording.labels import measured_text
from uavgram.views.recording.legend import draw_legend
from uavgram.views.recording.pages import measured_page, summary
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.stream import CENTRE_PX
from uavgram.views.style import FOUND, LEVEL_COLOURS, TIE
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


# The recording draws what the program found otherwise than what people picked, and tie points.


TIED_FRAME = 12


@pytest.fixture(scope="module")
def cloud() -> TieCloud:
    return tie_cloud(survey.build())


@pytest.fixture(scope="module")
def matched_result(cloud: TieCloud) -> Result:
    return found(survey.build(), cloud)


@pytest.fixture(scope="module")
def matched_contents(
    matched_result: Result, cloud: TieCloud, tmp_path_factory: pytest.TempPathFactory
) -> Contents:
    path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    write_recording(matched_result, (), no_ground, path, cloud)
    return Contents(path)


def picked(matched_result: Result, *sources: str) -> list[tuple[float, float]]:
    """Where the picks of a photo that fit are, of those who made them."""
    rows = zip(
        matched_result.picks.image,
        matched_result.picks.source,
        matched_result.picks.status,
        strict=True,
    )
    keep = [
        image == matched_result.frames.frame_id[TIED_FRAME]
        and source in sources
        and status == "used"
        for image, source, status in rows
    ]
    return [(u, v) for u, v in (matched_result.picks.pixel_px[keep] + CENTRE_PX).tolist()]


def test_matches_and_targets_have_marks_of_their_own(
    matched_result: Result, matched_contents: Contents
) -> None:
    dots = matched_contents.by_frame[f"{PHOTO}/picked"]["Points2D:positions"][TIED_FRAME]
    np.testing.assert_allclose(dots, picked(matched_result, "hand"), atol=1e-3)
    for source, lines, corners in (("match", 2, 2), ("target", 1, 5)):
        strips = matched_contents.by_frame[f"{PHOTO}/picked_by_program/{source}"][
            "LineStrips2D:strips"
        ]
        marks = np.array(strips[TIED_FRAME], dtype=np.float64)
        assert marks.shape == (lines * len(picked(matched_result, source)), corners, 2)
        middles = (marks.max(axis=1) + marks.min(axis=1))[::lines] / 2
        np.testing.assert_allclose(middles, picked(matched_result, source), atol=1e-3)


def test_tie_points_are_small_dots_in_the_photos_that_show_them(
    cloud: TieCloud, matched_contents: Contents
) -> None:
    dots = matched_contents.by_frame[f"{PHOTO}/tie_points"]["Points2D:positions"]
    seen = cloud.pixel_px[cloud.frame == TIED_FRAME] + CENTRE_PX
    np.testing.assert_allclose(dots[TIED_FRAME], seen, atol=1e-3)
    assert len(dots[5]) == 0  # this photo is in no adjustment
    (space,) = (matched_contents.static["/survey/tie_points"]["Points3D:positions"],)
    np.testing.assert_allclose(space, cloud.position_world_m, atol=1e-3)


def test_pages_say_who_made_picks_and_what_ties(
    matched_result: Result, matched_contents: Contents
) -> None:
    pages = {
        path: columns["TextDocument:text"][0]
        for path, columns in matched_contents.static.items()
        if "TextDocument:text" in columns
    }
    text = "\n".join(pages.values())
    assert "| skid left |" in text
    row = next(line for line in text.splitlines() if line.startswith("| skid left |"))
    assert "only the program's picks" in row
    point = next(line for line in text.splitlines() if line.startswith("| P13 |"))
    assert point.endswith(" matched |")
    assert "400 tie points found by the program" in text
    sheets = next(
        columns["TextDocument:text"]
        for columns in matched_contents.by_frame.values()
        if "TextDocument:text" in columns
    )
    assert (
        f"- tie points: {matched_result.frames.ties[TIED_FRAME]}, residuals 0.32 px"
        in sheets[TIED_FRAME][0]
    )


def test_the_legend_has_the_colours_of_what_was_found(matched_result: Result) -> None:
    for made, there in ((matched_result, True), (survey.build(), False)):
        image = np.asarray(draw_legend(made, measure_scene(made)))
        for colour in (FOUND, TIE):
            assert bool((image == colour).all(axis=-1).any()) == there
