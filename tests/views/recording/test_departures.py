"""Where the ground is no plane, in the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from recording_contents import Contents
from uneven_ground import DEPARTURE_M, uneven

from uavgram.model.result.result import Result
from uavgram.views.recording import write_recording
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.world.legend import BAND_PX, LEGEND_BACKGROUND, draw_legend
from uavgram.views.style import ABOVE, BELOW

BARS = "/survey/points/off_plane"


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def result() -> Result:
    built: Result = survey.build(frame_count=2)
    return uneven(built)


@pytest.fixture(scope="module")
def contents(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("uneven") / "recording.rrd"
    write_recording(result, (), no_ground, path)
    return Contents(path)


def test_bars_stand_on_points_off_the_plane_as_tall_as_said(
    result: Result, contents: Contents
) -> None:
    bars = np.array(contents.static[BARS]["LineStrips3D:strips"])
    rows = [result.points.label.index(label) for label in DEPARTURE_M]
    factor = measure_scene(result).departure_factor
    size = np.abs(list(DEPARTURE_M.values()))

    assert factor > 1
    np.testing.assert_allclose(bars[:, 0], result.points.position_world_m[rows], atol=1e-5)
    np.testing.assert_allclose(bars[:, 1, :2], bars[:, 0, :2], atol=1e-5)
    np.testing.assert_allclose(bars[:, 1, 2] - bars[:, 0, 2], factor * size, atol=1e-5)
    assert contents.static[BARS]["LineStrips3D:colors"][3] == 0x0571B0FF
    text = contents.static["/documents/summary"]["TextDocument:text"][0]
    assert f"{factor} times as tall as the departure of their ground from its plane" in text
    assert "farthest off is P21, by -0.200 m" in text


def test_the_page_of_points_has_their_departures(contents: Contents) -> None:
    text = contents.static["/documents/points"]["TextDocument:text"][0]
    widths = {line.count("|") for line in text.splitlines() if line.startswith("|")}

    assert "-0.200 ± 0.020" in text
    assert len(widths) == 1


def test_a_plane_has_neither_bars_nor_words_of_them(tmp_path: Path) -> None:
    write_recording(survey.build(frame_count=2), (), no_ground, tmp_path / "flat.rrd")
    flat = Contents(tmp_path / "flat.rrd")

    assert BARS not in flat.static
    for page in ("summary", "points"):
        assert "its plane" not in flat.static[f"/documents/{page}"]["TextDocument:text"][0]


def test_the_legend_has_both_colours_only_where_bars_are(result: Result) -> None:
    def colours(of: Result) -> set[tuple[int, ...]]:
        image = np.asarray(draw_legend(of, measure_scene(of)))
        return {tuple(pixel) for pixel in np.unique(image.reshape(-1, 3), axis=0).tolist()}

    assert {ABOVE, BELOW} <= colours(result)
    assert not {ABOVE, BELOW} & colours(survey.build(frame_count=2))


@pytest.mark.parametrize("telemetry", [True, False])
def test_the_legend_has_room_for_them(telemetry: bool) -> None:  # noqa: FBT001
    rough = uneven(survey.build(telemetry=telemetry))
    image = np.asarray(draw_legend(rough, measure_scene(rough), brightened=True))
    assert (image[BAND_PX + 1 :, -8:] == LEGEND_BACKGROUND).all()
