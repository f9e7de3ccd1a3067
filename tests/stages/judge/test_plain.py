"""One plain sentence for each reason: who is wrong, and no number of a test."""

from __future__ import annotations

import pytest

from uavgram.model.message import Message
from uavgram.model.message_catalogue import Effect, entries_by_code
from uavgram.stages.judge.verdict import get_plain_sentence

REASONS = [one.code for one in entries_by_code().values() if one.effect is not Effect.NONE]
STATISTICS = ("w =", "sigma", "chi-square", "probability", "variance", "±", "(")


@pytest.mark.parametrize("code", REASONS)
@pytest.mark.parametrize("count", [1, 9])
def test_every_reason_is_one_sentence_without_statistics(code: str, count: int) -> None:
    """Where nothing is written for a code, the message's own words before its numbers."""
    names = tuple(f"X{k}" for k in range(count))
    text = "The 12 rows do not fit (w = 3.1): look at them. Probability 0.1."
    said = get_plain_sentence(
        Message("warning", code, text, (f"{names[0]}.jpg",), names, names, names)
    )

    assert said.endswith(".")
    assert said.count(". ") == 0
    assert not [one for one in STATISTICS if one in said]
    assert "{" not in said


def test_names_stand_without_quotation_marks_and_endings() -> None:
    swapped = Message(
        "warning", "labels-swapped", "x", frames=("IMG_0046.jpg",), labels=("R1", "R2")
    )

    assert get_plain_sentence(swapped) == "R1 and R2 seem swapped in IMG_0046."


def test_of_many_names_five_are_told() -> None:
    names = tuple("ABCDEFGHIJKL")
    said = get_plain_sentence(Message("warning", "line-suspect", "x", lengths=names))

    assert said == "A, B, C, D, E and 7 more do not fit the rest."


def test_what_names_nothing_is_told_by_its_own_words() -> None:
    assert (
        get_plain_sentence(Message("warning", "line-suspect", "One is off (w = 4)."))
        == "One is off."
    )
    assert get_plain_sentence(Message("warning", "new", "It is so: look there.")) == "It is so."
    assert get_plain_sentence(Message("warning", "misfit", "x", plain="As it was said.")) == (
        "As it was said."
    )


def test_no_sentence_is_of_a_code_that_is_no_reason() -> None:
    worded = {one.code for one in entries_by_code().values() if one.one}
    assert worded - set(REASONS) == {
        "ground-not-plane",
        "picks-less-exact",
        "lengths-less-exact",
        "line-duplicate",
    }
