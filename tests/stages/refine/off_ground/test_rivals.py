"""A wrong pick on the ground, and a point off it: which of the two explains a label's picks."""

from dataclasses import replace

import numpy as np
import pytest
from gross_errors import largest_error, left_out
from scenes import Scene, make_scene
from whole_surveys import all_of

from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.robust import adjust_robustly

LABEL, HEIGHT_M = 4, 1.4


def survey_of(*, stands: bool, wrong_px: float, photos: int) -> tuple[Scene, Survey, int]:
    """A survey in which so many photos show a label; its second pick, which may be wrong."""
    scene = make_scene(3, frames=6, labels=16, heights={LABEL: HEIGHT_M} if stands else {})
    picks = np.flatnonzero(scene.survey.pick_label == LABEL)
    pixel = np.array(scene.survey.pixel_px)
    pixel[picks[1], 0] += wrong_px
    keep = ~np.isin(np.arange(len(pixel)), picks[photos:])
    survey = replace(
        scene.survey,
        height_above_m=np.zeros(16),
        pixel_px=pixel[keep],
        pick_sigma_px=scene.survey.pick_sigma_px[keep],
        pick_frame=scene.survey.pick_frame[keep],
        pick_label=scene.survey.pick_label[keep],
    )
    return scene, survey, int(picks[1])


@pytest.mark.parametrize(
    ("stands", "wrong_px", "photos"),
    [(True, 0.0, 6), (False, 40.0, 6), (True, 40.0, 6), (False, 40.0, 3), (True, 0.0, 3)],
)
def test_what_explains_the_picks_best(*, stands: bool, wrong_px: float, photos: int) -> None:
    scene, survey, pick = survey_of(stands=stands, wrong_px=wrong_px, photos=photos)
    robust = adjust_robustly(all_of(survey))

    picks, *others, labels = left_out(robust)
    assert picks == ({pick} if wrong_px else set())
    assert labels == ({f"P{LABEL}"} if stands else set())
    assert not any(others)
    assert largest_error(robust.refined.adjustment, scene) < 5.0


@pytest.mark.parametrize("wrong_px", [40.0, 400.0])
def test_of_two_picks_that_contradict_each_other_neither_bends_other_values(
    wrong_px: float,
) -> None:
    scene, survey, _ = survey_of(stands=False, wrong_px=wrong_px, photos=2)
    refined = adjust_robustly(all_of(survey)).refined

    others = [name for name in scene.survey.label if name != f"P{LABEL}"]
    assert set(others) <= set(refined.adjustment.survey.label)
    assert largest_error(refined.adjustment, scene, without=(f"P{LABEL}",)) < 5.0
