"""A label that occurs once is reported where one that is a letter off belongs, and there alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine


def add_label(survey: Survey, frame: int, written: str, pick: int, away_px: float = 0.0) -> Survey:
    """Give a pick of one photo a label of its own, and move it by some pixels."""
    label, pixel = survey.pick_label.copy(), survey.pixel_px.copy()
    assert survey.pick_frame[pick] == frame
    label[pick] = len(survey.label)
    pixel[pick] += away_px
    return replace(
        survey,
        label=(*survey.label, written),
        pick_label=label,
        pixel_px=pixel,
        height_above_m=np.append(survey.height_above_m, 0.0),
        height_sigma_m=np.append(survey.height_sigma_m, 0.0),
        identification_sigma_m=np.append(survey.identification_sigma_m, 0.0),
        is_free=np.append(survey.is_free, False),
        area=np.append(survey.area, 0),
    )


def told(survey: Survey) -> list[Message]:
    return [m for m in refine(survey, SolveOptions())[1] if m.code == "label-resembles"]


@pytest.fixture(scope="module")
def survey() -> Survey:
    return make_scene(2, frames=8, labels=20, lines=6).survey


@pytest.mark.parametrize("how", ["added", "lost", "changed", "moved"])
def test_a_label_one_letter_off_where_another_belongs_is_told(survey: Survey, how: str) -> None:
    pick = int(np.flatnonzero(survey.pick_frame == 3)[2])
    right = survey.label[survey.pick_label[pick]]
    written = {
        "added": f"{right}0",
        "lost": right[:-1],
        "changed": f"{right[:-1]}x",
        "moved": right[::-1],
    }[how]
    (message,) = told(add_label(survey, 3, written, pick))

    assert (message.frames, message.labels) == ((survey.frame_id[3],), (written, right))
    assert message.mend is not None
    assert message.mend.words.startswith(f"Change {written} to {right} in")


def test_a_label_elsewhere_or_unlike_or_of_a_series_is_none_of_the_others(survey: Survey) -> None:
    pick = int(np.flatnonzero(survey.pick_frame == 3)[2])
    right = survey.label[survey.pick_label[pick]]

    assert not told(survey)
    assert not told(add_label(survey, 3, f"{right}0", pick, away_px=60.0))
    assert not told(add_label(survey, 3, "kerb", pick))
    assert not told(
        add_label(survey, 3, f"{right[0]}0{right[1:]}", pick)
    )  # it looks alike: reported
