"""Mends by name: which exchanges of labels put each pick right, and what the button says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.model.message import (
    Correction,
    Message,
    Remedy,
    merge_remedies,
    propose_free_heights,
    propose_length_removal,
    propose_pick_removal,
)
from uavgram.model.observations import Picks
from uavgram.model.survey import Ends, Survey, SurveyCorrection
from uavgram.stages.remedies import add_remedies, keep_first_clicks, make_remedy


@pytest.fixture(scope="module")
def survey() -> Survey:
    made = make_scene(2, frames=3, labels=6, lines=3).survey
    return replace(made, line_name=("L1", "L2", "L3"))


def pick(survey: Survey, frame: int, label: int) -> int:
    rows = np.flatnonzero((survey.pick_frame == frame) & (survey.pick_label == label))
    return int(rows[0])


def named(survey: Survey, mend: SurveyCorrection) -> Remedy:
    found = make_remedy(survey, mend)
    assert found is not None
    return found


def relabelled(survey: Survey, right: dict[int, int], frame: int = 1) -> SurveyCorrection:
    return SurveyCorrection(label_of_pick={pick(survey, frame, a): b for a, b in right.items()})


def after(labels: list[str], swaps: tuple[Correction, ...]) -> list[str]:
    """Labels of picks once they are exchanged, one exchange after another."""
    for one in swaps:
        other = {one.label: one.other, one.other: one.label}
        labels = [other.get(label, label) for label in labels]
    return labels


@pytest.mark.parametrize(
    "right",
    [{0: 1, 1: 0}, {0: 1, 1: 2, 2: 0}, {0: 2, 2: 4, 4: 1, 1: 0, 3: 5, 5: 3}, {3: 3, 1: 4, 4: 1}],
)
def test_exchanges_one_after_another_give_each_pick_its_label(
    survey: Survey, right: dict[int, int]
) -> None:
    found = named(survey, relabelled(survey, right))
    label = survey.label

    assert {one.frame for one in found.corrections} == {survey.frame_id[1]}
    before = [label[a] for a in right]
    assert after(before, found.corrections) == [label[b] for b in right.values()]


def test_a_chain_ends_at_a_label_that_is_not_picked_there(survey: Survey) -> None:
    kept = np.arange(len(survey.pick_label)) != pick(survey, 1, 2)
    fewer = replace(
        survey,
        pick_frame=survey.pick_frame[kept],
        pick_label=survey.pick_label[kept],
        pixel_px=survey.pixel_px[kept],
        pick_sigma_px=survey.pick_sigma_px[kept],
    )
    one = named(fewer, relabelled(fewer, {0: 2}))
    chain = named(fewer, relabelled(fewer, {0: 1, 1: 2}))

    assert one.words.startswith("Change P0 to P2 in ")
    assert after(["P0", "P1"], chain.corrections) == ["P1", "P2"]


def test_two_labels_exchanged_in_all_photos_are_one_exchange(survey: Survey) -> None:
    right = {int(k): 1 for k in np.flatnonzero(survey.pick_label == 0)}
    right |= {int(k): 0 for k in np.flatnonzero(survey.pick_label == 1)}
    found = named(survey, SurveyCorrection(label_of_pick=right))

    assert found.words == "Swap P0 and P1 in all photos"
    assert found.corrections == (Correction(action="swap", label="P0", other="P1"),)


def test_words_name_what_the_button_does(survey: Survey) -> None:
    first, second = survey.length_m[:2]
    photo = survey.frame_id[0].rpartition(".")[0] or survey.frame_id[0]
    words = {
        "Correct L1 to 3.25 m": SurveyCorrection(length_m={0: 3.25}),
        f"Take L1 as feet: {first * 0.3048:.2f} m": SurveyCorrection(
            length_m={0: float(first) * 0.3048}
        ),
        "Take these 2 lengths as inches": SurveyCorrection(
            length_m={0: float(first) * 0.0254, 1: float(second) * 0.0254}
        ),
        "Swap the readings of L1 and L2": SurveyCorrection(
            length_m={0: float(second), 1: float(first)}
        ),
        "Correct these 2 lengths": SurveyCorrection(length_m={0: 1.0, 1: 2.0}),
        "Take L2 from P0 to P4": SurveyCorrection(ends={1: Ends(0, 4)}),
        "Remove the length L3": SurveyCorrection(without_lines=frozenset([2])),
        "Free the height of P5": SurveyCorrection(free={5: True}),
        f"Remove the pick of P3 in {photo}": SurveyCorrection(
            without_picks=frozenset([pick(survey, 0, 3)])
        ),
        f"Put the picks of {photo} back": SurveyCorrection(
            pixel_of_pick={pick(survey, 0, 3): (1.0, 2.0)}
        ),
    }

    assert [named(survey, mend).words for mend in words.values()] == list(words)


def test_a_pick_is_taken_out_before_another_one_takes_its_label(survey: Survey) -> None:
    mend = SurveyCorrection(
        label_of_pick={pick(survey, 1, 0): 1}, without_picks=frozenset([pick(survey, 1, 1)])
    )
    found = named(survey, mend)

    assert [one.action for one in found.corrections] == ["unpick", "swap"]
    assert found.action == "swap"
    assert " and remove the pick of P1 in " in found.words


def test_what_was_never_written_is_not_mended(survey: Survey) -> None:
    """A height that the program freed, and a length without a name."""
    nameless = replace(survey, line_name=())

    assert make_remedy(survey, SurveyCorrection(free={0: False})) is None
    assert make_remedy(nameless, SurveyCorrection(without_lines=frozenset([0]))) is None
    assert make_remedy(nameless, SurveyCorrection(length_m={0: 2.0})) is None


def picks_of(pairs: list[tuple[str, str]]) -> Picks:
    none, images = np.full(len(pairs), np.nan), tuple(image for image, _ in pairs)
    return Picks(
        image=images,
        label=tuple(label for _, label in pairs),
        pixel_px=np.zeros((len(pairs), 2)),
        sigma_px=none,
        height_m=none,
        height_sigma_m=none,
        is_free=np.zeros(len(pairs), np.bool_),
        area=("",) * len(pairs),
    )


def test_of_two_clicks_the_first_is_kept() -> None:
    one, other = ("1.jpg", "A"), ("2.jpg", "A")
    removal = propose_pick_removal([one])
    assert removal is not None
    both = propose_pick_removal([one, other])
    assert both is not None
    message = Message("warning", "a", "It is wrong.", mend=removal, instead=(both,))

    (kept,) = keep_first_clicks([message], picks_of([one, one, other]))
    assert kept.mend is not None
    assert kept.mend.words == "Take back the second click of A in 1"
    assert [change.action for change in kept.mend.corrections] == ["take-back"]
    (left,) = kept.instead
    assert [change.action for change in left.corrections] == ["take-back", "unpick"]
    assert left.words == both.words

    (same,) = keep_first_clicks([message], picks_of([one, other, other]))
    assert same.mend == removal


def test_what_was_measured_is_read_again_before_it_is_removed(survey: Survey) -> None:
    mends = [SurveyCorrection(without_lines=frozenset([1, 2])), SurveyCorrection(free={1: True})]
    message = add_remedies(Message("warning", "a", "It is wrong."), survey, mends)
    told = [message.mend, *message.instead]

    assert [one.action for one in told if one is not None] == ["read", "remove-length", "free"]
    assert message.mend is not None
    assert message.mend.words == "Read L2 and L3 again"
    assert [one.length for one in message.mend.corrections] == ["L2", "L3"]


def test_rivals_are_told_beside_the_likeliest(survey: Survey) -> None:
    mends = [SurveyCorrection(length_m={0: 3.0}), None, SurveyCorrection(free={1: True})]
    message = add_remedies(Message("warning", "a", "It is wrong."), survey, mends)

    assert message.mend is not None
    assert message.mend.words == "Correct L1 to 3.00 m"
    assert [one.words for one in message.instead] == ["Free the height of P1"]


def test_several_are_done_together_only_where_that_is_safe() -> None:
    heights = merge_remedies(
        [propose_free_heights(["A"]), propose_free_heights(["B"]), propose_free_heights(["B"])]
    )
    assert heights is not None

    assert heights.words == "Free these 2 heights"
    assert [one.label for one in heights.corrections] == ["A", "B"]
    assert merge_remedies([propose_free_heights(["A"]), None]) is None
    assert merge_remedies([propose_free_heights(["A"]), propose_length_removal(["L1"])]) is None
    assert (
        merge_remedies(
            [propose_pick_removal([("1.jpg", "A")]), propose_pick_removal([("2.jpg", "A")])]
        )
        is None
    )
