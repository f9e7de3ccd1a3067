"""What a run has to say, in order: one message for each kind, the likeliest cause first."""

from __future__ import annotations

from uavgram.model.message import Message, Several
from uavgram.stages.tell import MOST_LISTED, told

OUT = "{count} frames were left out"


def left_out(name: str, why: str = "too few picks") -> Message:
    return Message(
        "warning",
        "frame-left-out",
        f"The frame {name!r} was left out: {why}.",
        frames=(name,),
        several=Several(OUT, repr(name), why, "Look at them."),
    )


def test_one_of_a_kind_keeps_its_own_sentence() -> None:
    assert told(left_out("a.jpg")) == (left_out("a.jpg"),)


def test_several_of_a_kind_are_one_message_with_a_list_by_reason() -> None:
    (message,) = told(left_out("a.jpg"), left_out("b.jpg", "it shows sky"), left_out("c.jpg"))
    assert message.text == (
        "3 frames were left out: 'a.jpg', 'c.jpg' (too few picks); 'b.jpg' (it shows sky). "
        "Look at them."
    )
    assert message.frames == ("a.jpg", "b.jpg", "c.jpg")
    assert (message.level, message.code) == ("warning", "frame-left-out")


def test_a_long_list_is_cut_in_the_sentence_and_whole_in_the_data() -> None:
    names = tuple(f"{k}.jpg" for k in range(29))
    (message,) = told(*map(left_out, names))
    assert message.frames == names
    assert message.text.startswith("29 frames were left out: '0.jpg', ")
    assert f"'{MOST_LISTED - 1}.jpg' (too few picks); and {29 - MOST_LISTED} more." in message.text
    assert f"'{MOST_LISTED}.jpg'" not in message.text


def test_the_cause_comes_first_its_consequences_last_and_errors_before_all() -> None:
    codes = ("frame-left-out", "group-misfit", "log-note", "pick-suspect", "labels-swapped")
    given = [Message("warning", code, code) for code in codes]
    said = told(Message("info", "own-columns", "x"), *given, Message("error", "not-converged", "x"))
    assert [m.code for m in said] == [
        "not-converged",
        "labels-swapped",
        "pick-suspect",
        "log-note",
        "frame-left-out",
        "group-misfit",
        "own-columns",
    ]


def test_the_same_message_is_told_once_and_telling_twice_changes_nothing() -> None:
    said = told(left_out("a.jpg"), left_out("a.jpg"), left_out("b.jpg"))
    assert len(said) == 1
    assert told(*said) == said
