"""A wrong pick on the ground, and a point off it: which of the two explains a label's picks."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.stages.refine.begin.softened import iterate
from uavgram.stages.refine.off_ground.rivals import one_wrong_pick_explains

LABEL, HEIGHT_M = 4, 1.4


def explained(*, stands: bool, wrong_px: float, photos: int) -> bool:
    """Of a label that a search has off the ground; the wrong pick has lost its weight."""
    scene = make_scene(3, frames=6, labels=16, heights={LABEL: HEIGHT_M} if stands else {})
    picks = np.flatnonzero(scene.survey.pick_label == LABEL)
    pixel, weight = np.array(scene.survey.pixel_px), np.ones(len(scene.survey.pick_label))
    pixel[picks[1], 0] += wrong_px
    weight[picks[1]] = max(1.0, wrong_px / 2)
    keep = ~np.isin(np.arange(len(pixel)), picks[photos:])
    sigma = scene.survey.pick_sigma_px
    survey = replace(
        scene.survey,
        height_above_m=np.zeros(16),
        height_sigma_m=np.where(np.arange(16) == LABEL, 3.0, 0.01),
        pixel_px=pixel[keep],
        pick_sigma_px=(sigma * weight)[keep],
        pick_frame=scene.survey.pick_frame[keep],
        pick_label=scene.survey.pick_label[keep],
    )
    problem = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool))
    point = np.column_stack([scene.truth.point, np.zeros(16)])
    minimum = iterate(problem, replace(scene.truth, point=point), 20)
    adjustment = Adjustment(problem, minimum, minimum.factor.covariance())
    return bool(one_wrong_pick_explains(adjustment, np.arange(16) == LABEL, sigma[keep])[LABEL])


@pytest.mark.parametrize(
    ("stands", "wrong_px", "photos", "wrong"),
    [
        (True, 0.0, 6, False),
        (False, 40.0, 6, True),
        (True, 40.0, 6, False),
        (False, 40.0, 3, True),
        (True, 0.0, 2, False),
        (False, 40.0, 2, True),
    ],
)
def test_what_explains_the_picks_best(
    *, stands: bool, wrong_px: float, photos: int, wrong: bool
) -> None:
    assert explained(stands=stands, wrong_px=wrong_px, photos=photos) == wrong
