"""The recording draws what the program found otherwise than what people picked, and tie points."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_survey as survey
from found_survey import found, tie_cloud
from recording_contents import Contents

from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.views.recording import write_recording
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.stream import CENTRE_PX
from uavgram.views.recording.world.legend import draw_legend
from uavgram.views.style import FOUND, TIE

PHOTO = "/survey/current_camera/photo"
FRAME = 12


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def cloud() -> TieCloud:
    return tie_cloud(survey.build())


@pytest.fixture(scope="module")
def result(cloud: TieCloud) -> Result:
    return found(survey.build(), cloud)


@pytest.fixture(scope="module")
def contents(result: Result, cloud: TieCloud, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    write_recording(result, (), no_ground, path, cloud)
    return Contents(path)


def picked(result: Result, *sources: str) -> list[tuple[float, float]]:
    """Where the picks of a photo that fit are, of those who made them."""
    rows = zip(result.picks.image, result.picks.source, result.picks.status, strict=True)
    keep = [
        image == result.frames.frame_id[FRAME] and source in sources and status == "used"
        for image, source, status in rows
    ]
    return [(u, v) for u, v in (result.picks.pixel_px[keep] + CENTRE_PX).tolist()]


def test_matches_and_targets_have_marks_of_their_own(result: Result, contents: Contents) -> None:
    dots = contents.by_frame[f"{PHOTO}/picked"]["Points2D:positions"][FRAME]
    np.testing.assert_allclose(dots, picked(result, "hand"), atol=1e-3)
    for source, lines, corners in (("match", 2, 2), ("target", 1, 5)):
        strips = contents.by_frame[f"{PHOTO}/picked_by_program/{source}"]["LineStrips2D:strips"]
        marks = np.array(strips[FRAME], dtype=np.float64)
        assert marks.shape == (lines * len(picked(result, source)), corners, 2)
        middles = (marks.max(axis=1) + marks.min(axis=1))[::lines] / 2
        np.testing.assert_allclose(middles, picked(result, source), atol=1e-3)


def test_tie_points_are_small_dots_in_the_photos_that_show_them(
    cloud: TieCloud, contents: Contents
) -> None:
    dots = contents.by_frame[f"{PHOTO}/tie_points"]["Points2D:positions"]
    seen = cloud.pixel_px[cloud.frame == FRAME] + CENTRE_PX
    np.testing.assert_allclose(dots[FRAME], seen, atol=1e-3)
    assert len(dots[5]) == 0  # this photo is in no adjustment
    (space,) = (contents.static["/survey/tie_points"]["Points3D:positions"],)
    np.testing.assert_allclose(space, cloud.position_world_m, atol=1e-3)


def test_pages_say_who_made_picks_and_what_ties(result: Result, contents: Contents) -> None:
    pages = {
        path: columns["TextDocument:text"][0]
        for path, columns in contents.static.items()
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
        for columns in contents.by_frame.values()
        if "TextDocument:text" in columns
    )
    assert f"- tie points: {result.frames.ties[FRAME]}, residuals 0.32 px" in sheets[FRAME][0]


def test_the_legend_has_the_colours_of_what_was_found(result: Result) -> None:
    for made, there in ((result, True), (survey.build(), False)):
        image = np.asarray(draw_legend(made, measure_scene(made)))
        for colour in (FOUND, TIE):
            assert bool((image == colour).all(axis=-1).any()) == there
