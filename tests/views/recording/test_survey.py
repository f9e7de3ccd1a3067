"""Measured profiles, in the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from profiled import PLACE, SIGMA, profiled
from recording_contents import Contents

from uavgram.model.arrays import Floats
from uavgram.views.recording import write_recording


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("profiles") / "recording.rrd"
    write_recording(profiled(survey.build(frame_count=2)), (), no_ground, path)
    return Contents(path)


def strips(contents: Contents, name: str) -> list[Floats]:
    return [np.array(s) for s in contents.static[f"/profiles/{name}"]["LineStrips2D:strips"]]


def test_a_profile_is_drawn_to_the_scale_that_it_tells(contents: Contents) -> None:
    kerb, bank = strips(contents, "line")
    texts = contents.static["/profiles/texts"]["Points2D:labels"]
    (title,) = [text for text in texts if text.startswith("kerb:")]
    factor = int(title.split("heights ")[1].split()[0])
    along, down = kerb.T
    scale = np.ptp(along) / 10.0

    np.testing.assert_allclose(along - along[0], scale * PLACE[:3, 0], atol=0.01)
    np.testing.assert_allclose(down - down[0], -factor * scale * PLACE[:3, 2], atol=0.01)
    ground = strips(contents, "ground")[0]
    np.testing.assert_allclose(ground[:, 1] - down[0], -factor * scale * PLACE[:3, 3], atol=0.01)
    (bar,) = [s for s in strips(contents, "bars") if abs(s[0, 0] - along[1]) < 0.01]
    assert np.ptp(bar[:, 1]) == pytest.approx(2 * 1.96 * SIGMA[1, 2] * factor * scale, rel=1e-3)
    assert bank[:, 1].min() > down.max()  # one below the other


def test_only_points_off_the_ground_have_a_ruler(contents: Contents) -> None:
    (ruler,) = strips(contents, "rulers")
    kerb, ground = strips(contents, "line")[0], strips(contents, "ground")[0]

    np.testing.assert_allclose(ruler, [kerb[1], ground[1]], atol=0.01)


def test_points_have_their_names_and_people_s_words_stand_in_texts(contents: Contents) -> None:
    texts = contents.static["/profiles/texts"]["Points2D:labels"]

    assert {"P02", "P03", "P05"} <= set(texts)
    assert any(text.startswith("bank | <b>: ") for text in texts)


def test_without_a_profile_there_is_no_drawing(tmp_path: Path) -> None:
    write_recording(survey.build(frame_count=2), (), no_ground, tmp_path / "recording.rrd")

    assert not [e for e in Contents(tmp_path / "recording.rrd").static if "profiles" in e]
