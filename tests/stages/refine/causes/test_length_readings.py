"""Wrong lengths: each slip is named with the length that it struck, and its mend is the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.survey import Cause, Ends, Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis
from uavgram.stages.refine.causes.identification import identify_causes
from uavgram.stages.refine.causes.length_ends import propose_other_ends
from uavgram.stages.refine.causes.length_readings import list_slips, propose_slips
from uavgram.stages.refine.causes.suspect_lengths import find_suspect_lengths
from uavgram.stages.refine.left_out import predict_readings
from uavgram.stages.refine.minima import Participants, find_best_minima

PAIRS = tuple((k, k + 6) for k in range(6))


@pytest.fixture
def survey(scene_factory: Callable[..., Scene]) -> Survey:
    """Six named lengths; all is checked by several photos."""
    found = scene_factory(2, frames=4, ends=PAIRS).survey
    written = np.round(found.length_m, 2)
    return replace(found, length_m=written, line_name=tuple(f"L{k}" for k in range(6)))


def diagnosis(survey: Survey, without: tuple[int, ...] = ()) -> Diagnosis:
    removed: Bools = np.isin(np.arange(len(survey.line_start)), without)
    taking = Participants(survey, np.ones(len(survey.pick_frame), dtype=np.bool_), removed, {})
    refined: Refined = find_best_minima(taking)
    return Diagnosis(taking, refined)


def reading(survey: Survey, values: dict[int, float]) -> Survey:
    length = np.array(survey.length_m)
    for line, value in values.items():
        length[line] = value
    return replace(survey, length_m=length)


def likeliest(hypotheses: list[Hypothesis]) -> tuple[Message, SurveyCorrection]:
    best = max(hypotheses, key=lambda one: one.promise / 2.0 - one.price)
    assert best.message is not None
    assert best.mend is not None
    return best.message(None), best.mend


@pytest.mark.parametrize(
    ("slip", "code"),
    [
        (lambda right: right / 0.3048, "line-wrong-unit"),
        (lambda right: 0.3048 * right, "line-wrong-unit"),
        (lambda right: 10.0 * right, "line-wrong-digit"),
        (lambda right: right + 1.0, "line-wrong-digit"),
    ],
)
def test_a_slip_is_named_and_its_mend_is_what_was_read(
    survey: Survey, slip: Callable[[float], float], code: str
) -> None:
    right = float(survey.length_m[3])
    wrong = reading(survey, {3: slip(right)})
    gross = abs(np.log(slip(right) / right)) > 0.4  # such a one is left out beforehand
    (cause,) = identify_causes(diagnosis(wrong, (3,) if gross else ())).causes
    assert cause.message.code == code
    assert cause.message.lengths == ("L3",)
    assert cause.settles == {"L3"}
    assert f"write {right:.10g}" in cause.message.text
    assert cause.mend is not None
    assert cause.mend.length_m == {3: pytest.approx(right, abs=1e-9)}
    assert not cause.mend.ends


def test_transposed_digits_are_undone() -> None:
    slips = {round(one.right_m, 6): one.words for one in list_slips(13.2)}
    assert slips[12.3] == "two digits are transposed, 13.20 for 12.30"
    assert 31.2 in slips
    assert {12.2, 14.2, 13.1, 13.3, 3.2, 23.2, 1.32, 132.0} <= set(slips)
    assert all(one.right_m > 0 for one in list_slips(0.5))
    assert 9.02 in {round(one.right_m, 6) for one in list_slips(9.2)}  # 9.20 for 9.02


def test_an_error_of_any_amount_is_no_slip(survey: Survey) -> None:
    # The rest knows the length to 2 cm; no unit, digit or transposition makes it of what is read.
    for amount in (0.31, -2.41):
        wrong = reading(survey, {3: float(survey.length_m[3]) + amount})
        assert list(propose_slips(diagnosis(wrong, (3,)))) == []
        if abs(amount) < 2.0:
            assert identify_causes(diagnosis(wrong)).causes == ()


def test_exchanged_readings_are_swapped_back(survey: Survey) -> None:
    first, second = (float(survey.length_m[k]) for k in (0, 4))
    assert abs(first - second) > 0.2
    (cause,) = identify_causes(diagnosis(reading(survey, {0: second, 4: first}))).causes
    assert cause.message.code == "lines-exchanged"
    assert cause.settles == {"L0", "L4"}
    assert cause.mend is not None
    assert cause.mend.length_m == {0: first, 4: second}


def test_a_length_between_other_labels_is_found_left_out_or_not(survey: Survey) -> None:
    end = np.array(survey.line_end)
    end[3] = 11  # the true end is 9
    wrong = replace(survey, line_end=end)
    for without in ((), (3,)):
        (cause,) = identify_causes(diagnosis(wrong, without)).causes
        assert cause.message.code == "line-other-ends"
        assert "('P3' to 'P11') seems to be from 'P3' to 'P9'" in cause.message.text
        assert cause.mend is not None
        assert cause.mend.ends == {3: Ends(3, 9)}


def test_where_two_labels_may_be_swapped_instead_of_an_end_both_are_in_doubt(
    scene_factory: Callable[..., Scene],
) -> None:
    found = scene_factory(2, frames=4, labels=14, ends=PAIRS).survey
    end = np.array(found.line_end)
    end[3] = 12  # the true end is 9; no other length ends at either
    wrong = replace(found, line_end=end, line_name=tuple(f"L{k}" for k in range(6)))
    (cause,) = identify_causes(diagnosis(wrong, (3,))).causes

    assert cause.message.code == "line-other-ends"
    assert "Or the labels 'P9' and 'P12' are swapped in all photos" in cause.message.text
    assert {"P9", "P12"} <= set(cause.message.labels)


def test_exchanged_ends_of_two_lengths_are_found(survey: Survey) -> None:
    end = np.array(survey.line_end)
    end[[0, 5]] = end[[5, 0]]
    message, mend = likeliest(
        list(propose_other_ends(diagnosis(replace(survey, line_end=end), (0, 5))))
    )
    assert message.code == "line-other-ends"
    assert "the first is from 'P0' to 'P6' and the second from 'P5' to 'P11'" in message.text
    assert mend.ends == {0: Ends(0, 6), 5: Ends(5, 11)}


def test_what_the_rest_says_of_a_length_is_as_if_adjusted_without_it(survey: Survey) -> None:
    right = np.array(survey.length_m)
    wrong = reading(survey, {2: float(right[2]) + 0.15, 4: float(right[4]) - 0.1})
    found = find_suspect_lengths(diagnosis(wrong))
    k, both = found.line.tolist().index(2), [found.line.tolist().index(i) for i in (2, 4)]
    without = diagnosis(wrong, (2,))
    seen, sigma = predict_readings(wrong, without.refined, np.array([2]))
    assert found.right_m[k] == pytest.approx(seen[0], abs=0.005)
    assert found.right_sigma_m[k] == pytest.approx(sigma[0], rel=0.05)
    fall = diagnosis(wrong).adjustment.minimum.cost - without.adjustment.minimum.cost
    assert found.fall_without([k]) == pytest.approx(fall, rel=0.05)
    # Both taken out at once: the other end of L2 is seen as it is without either.
    neither = diagnosis(wrong, (2, 4))
    fall = diagnosis(wrong).adjustment.minimum.cost - neither.adjustment.minimum.cost
    assert found.fall_without(both) == pytest.approx(fall, rel=0.05)
    length, spread = found.between((np.array([2]), np.array([9])), k, both)
    moved = replace(wrong, line_end=np.where(np.arange(6) == 2, 9, wrong.line_end))
    truth, truth_sigma = predict_readings(moved, neither.refined, np.array([2]))
    assert length[0] == pytest.approx(truth[0], abs=0.01)
    assert spread[0] == pytest.approx(truth_sigma[0], rel=0.03)


def test_all_lengths_in_feet_are_one_cause(survey: Survey) -> None:
    wrong = replace(survey, length_m=survey.length_m / 0.3048)
    causes: tuple[Cause, ...] = identify_causes(diagnosis(wrong, tuple(range(6)))).causes
    assert [cause.message.code for cause in causes] == ["lengths-wrong-unit"]
    assert causes[0].message.text.startswith("All lengths seem to be in feet, not in metres: ")
    mend = causes[0].mend
    assert mend is not None
    np.testing.assert_allclose([mend.length_m[k] for k in range(6)], survey.length_m, atol=1e-9)
