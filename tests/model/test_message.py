"""Texts of messages are divided into sentences, names are not."""

from __future__ import annotations

import pytest

from uavgram.model.message import Message
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


def test_the_plain_part_ends_at_a_colon_outside_of_names() -> None:
    message = Message(
        "warning", "photo-saved-anew", "'a: b' is wrong: w = 5. Look there.", labels=("a: b",)
    )

    assert get_plain_sentence(message) == "'a: b' is wrong."
