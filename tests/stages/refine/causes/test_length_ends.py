"""Where another end of a length and two labels swapped everywhere are the same, both are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Explanation
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Ends, Survey, SurveyCorrection
from uavgram.stages.refine.causes.length_ends import find_label_exchange_instead
from uavgram.stages.refine.refine import refine


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


def test_two_lengths_with_exchanged_ends_may_be_swapped_labels(survey: Survey) -> None:
    """Only these two lengths end at the labels 1 and 3, each at one of them."""
    found = find_label_exchange_instead(
        survey, SurveyCorrection(ends={0: Ends(0, 3), 1: Ends(2, 1)})
    )
    assert found is not None
    assert set(found.label_of_pick.values()) == {1, 3}
    one = SurveyCorrection(ends={0: Ends(0, 3)})
    assert find_label_exchange_instead(survey, one) is None


def test_swapped_labels_explain_the_survey_as_well_as_another_end() -> None:
    """Only one length ends at either label, so it may be from the other one."""
    ends = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4))
    scene = make_scene(7, frames=4, labels=8, ends=ends)
    label = scene.survey.pick_label
    swapped = np.where(label == 4, 5, np.where(label == 5, 4, label))
    refined, messages = refine(replace(scene.survey, pick_label=swapped), SolveOptions())

    assert "line-other-ends" in {message.code for message in messages}
    found = refined.list_explanations()
    places = [one.state.point[:, :2] for one, _ in found]
    distance = [np.linalg.norm(place[4] - place[6]) for place in places]
    true = np.linalg.norm(scene.world[4, :2] - scene.world[6, :2])
    assert np.abs(np.array(distance) - true).min() < 0.1
    assert sum(probability for _, probability in found) > 0.95
    here = refined.adjustment.state.point[:, :2]
    assert abs(np.linalg.norm(here[4] - here[6]) - true) > 0.5


def test_the_odds_of_a_cause_do_not_exclude_other_poses(survey: Survey) -> None:
    refined, _ = refine(survey, SolveOptions())
    other = refined.adjustment
    both = replace(
        refined, alternatives=(other,), explanations=((Explanation(other, 50.0),),)
    ).list_explanations()

    assert [probability for _, probability in both] == pytest.approx([0.5, 1.0])
