"""Texts of messages are divided into sentences, names are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from uavgram.model.message import Correction, Message, Remedy
from uavgram.stages.judge.verdict import get_first_sentences, get_plain_sentence, make_reason


@pytest.mark.parametrize("label", ["P1", "St. 1", "Pl.", "St. 1. a", "(a. b"])
def test_a_label_with_a_full_stop_ends_no_sentence(label: str) -> None:
    text = f"The label '{label}' is wrong. Look there. Or elsewhere."
    message = Message("warning", "unknown-to-the-catalogue", text, labels=(label,))

    assert message.split_text() == [f"The label '{label}' is wrong", "Look there", "Or elsewhere."]
    assert get_first_sentences(message) == f"The label '{label}' is wrong. Look there."


def test_photos_are_named_with_and_without_their_ending() -> None:
    text = "St. 1.jpg and St. 2 are wrong. Look there."
    message = Message("warning", "misfit", text, frames=("St. 1.jpg", "St. 2.jpg"))

    assert message.split_text() == ["St. 1.jpg and St. 2 are wrong", "Look there."]


def test_names_of_another_cause_are_kept_whole_too() -> None:
    text = "One is wrong. Or, just as likely: St. 1 is wrong. Look there."
    message = Message("warning", "misfit", text, mentions=("St. 1",))

    assert make_reason(message).text == "One is wrong. Or, just as likely: St. 1 is wrong."


def test_labels_that_may_be_swapped_in_either_photo_are_no_finding_in_one() -> None:
    swaps = [
        Remedy(
            action="swap",
            words="",
            corrections=(Correction(action="swap", frame=frame, label="P", other="Q"),),
        )
        for frame in ("1.jpg", "2.jpg")
    ]
    message = Message(
        "warning", "labels-swapped", "x", frames=("1.jpg",), labels=("P", "Q"), mend=swaps[0]
    )

    assert get_plain_sentence(message) == "P and Q seem swapped in 1."
    either = replace(message, instead=(swaps[1],))
    assert get_plain_sentence(either) == "P and Q seem swapped in 1 or 2."


def test_the_plain_part_ends_at_a_colon_outside_of_names() -> None:
    message = Message(
        "warning", "photo-saved-anew", "'a: b' is wrong: w = 5. Look there.", labels=("a: b",)
    )

    assert get_plain_sentence(message) == "'a: b' is wrong."
