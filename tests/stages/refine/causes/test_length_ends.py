"""Where another end of a length and two labels swapped everywhere are the same, both are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.model.survey import Ends, Survey, SurveyCorrection
from uavgram.stages.refine.causes.length_ends import find_label_exchange_instead


@pytest.fixture(scope="module")
def survey() -> Survey:
    """Lengths from 0 to 1, 2 to 3 and 0 to 2; nothing ends at 4 and 5."""
    made = make_scene(2, frames=3, labels=6, lines=3).survey
    return replace(made, line_start=np.array([0, 2, 0]), line_end=np.array([1, 3, 2]))


def test_labels_at_which_no_other_length_ends_may_be_swapped(survey: Survey) -> None:
    found = find_label_exchange_instead(survey, SurveyCorrection(ends={0: Ends(0, 4)}))
    assert found is not None

    swapped = survey.pick_label.copy()
    swapped[survey.pick_label == 1], swapped[survey.pick_label == 4] = 4, 1
    after = survey.pick_label.copy()
    after[list(found.label_of_pick)] = list(found.label_of_pick.values())
    np.testing.assert_array_equal(after, swapped)


@pytest.mark.parametrize(
    "mend",
    [
        SurveyCorrection(ends={0: Ends(4, 1)}),  # 0 is an end of another length, which fits
        SurveyCorrection(ends={0: Ends(0, 3)}),  # so is 3
        SurveyCorrection(ends={0: Ends(4, 5)}),
        SurveyCorrection(ends={0: Ends(0, 4), 1: Ends(2, 5)}),
        SurveyCorrection(length_m={0: 3.0}),
    ],
)
def test_elsewhere_the_other_lengths_tell(survey: Survey, mend: SurveyCorrection) -> None:
    assert find_label_exchange_instead(survey, mend) is None
