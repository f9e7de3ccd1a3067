"""What a run has to say, in order: one message for each kind, the likeliest cause first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from uavgram.model.message import Correction, Message, MessagePlural, Remedy
from uavgram.model.message_catalogue import entries_by_code
from uavgram.model.survey import Cause
from uavgram.stages.messages import MAX_LISTED, downgrade_explained, order_messages

OUT = "{count} frames were left out"


def left_out(name: str, why: str = "too few picks") -> Message:
    return Message(
        "warning",
        "frame-left-out",
        f"The frame {name!r} was left out: {why}.",
        frames=(name,),
        several=MessagePlural(OUT, repr(name), why, "Look at them."),
    )


def test_one_of_a_kind_keeps_its_own_sentence() -> None:
    assert order_messages(left_out("a.jpg")) == (left_out("a.jpg"),)


def test_several_of_a_kind_are_one_message_with_a_list_by_reason() -> None:
    (message,) = order_messages(
        left_out("a.jpg"), left_out("b.jpg", "it shows sky"), left_out("c.jpg")
    )
    assert message.text == (
        "3 frames were left out: 'a.jpg', 'c.jpg' (too few picks); 'b.jpg' (it shows sky). "
        "Look at them."
    )
    assert message.frames == ("a.jpg", "b.jpg", "c.jpg")
    assert (message.level, message.code) == ("warning", "frame-left-out")


def test_several_lengths_are_read_again_together_and_removed_together() -> None:
    def off(name: str) -> Message:
        read, out = (
            Remedy(action=act, words=name, corrections=(Correction(action=act, length=name),))
            for act in ("read", "remove-length")
        )
        several = MessagePlural("{count} lengths do not fit", name)
        message = Message("warning", "line-suspect", "off", several=several, lengths=(name,))
        return replace(message, mend=read, instead=(out,))

    (told,) = order_messages(off("L1"), off("L2"))

    assert told.mend is not None
    assert told.mend.words == "Read these 2 lengths again"
    assert [one.words for one in told.instead] == ["Remove these 2 lengths"]
    rival = replace(off("L3"), instead=(*off("L3").instead, *off("P1").instead))
    (unclear,) = order_messages(off("L1"), rival)  # it may be another thing than the length
    assert unclear.mend is None
    assert unclear.instead == ()


def test_heights_stay_with_their_labels() -> None:
    several = MessagePlural("{count} points fit off the ground", "a point")
    one, other = (
        Message(
            "warning",
            "point-off-ground",
            "off",
            labels=(label,),
            heights_m=(height,),
            heights_sigma_m=(0.01 * height,),
            several=several,
        )
        for label, height in (("A", 1.5), ("B", 1.5))
    )

    (told,) = order_messages(one, other)

    assert (told.labels, told.heights_m) == (("A", "B"), (1.5, 1.5))
    assert told.record()["heights_sigma_m"] == [0.015, 0.015]
    assert "heights_m" not in Message("info", "a", "b").record()


def test_a_long_list_is_cut_in_the_sentence_and_whole_in_the_data() -> None:
    names = tuple(f"{k}.jpg" for k in range(29))
    (message,) = order_messages(*map(left_out, names))
    assert message.frames == names
    assert message.text.startswith("29 frames were left out: '0.jpg', ")
    assert f"'{MAX_LISTED - 1}.jpg' (too few picks); and {29 - MAX_LISTED} more." in message.text
    assert f"'{MAX_LISTED}.jpg'" not in message.text


def test_a_cause_that_was_found_comes_first_then_errors_and_consequences_last() -> None:
    codes = ("frame-left-out", "group-misfit", "log-note", "pick-suspect", "labels-swapped")
    given = [Message("warning", code, code) for code in codes]
    messages = order_messages(
        Message("info", "own-columns", "x"), *given, Message("error", "not-converged", "x")
    )
    assert [m.code for m in messages] == [
        "labels-swapped",
        "not-converged",
        "frame-left-out",
        "pick-suspect",
        "log-note",
        "group-misfit",
        "own-columns",
    ]


def test_identified_causes_come_before_what_they_explain() -> None:
    """What spoils everything, what spoils one thing, the log, the accused, what is left open."""
    codes = (
        *("lengths-wrong-unit", "label-elsewhere", "log-position-jump", "line-left-out"),
        *("pick-suspect", "misfit", "ground-not-plane", "nothing-checks", "line-unseen"),
    )
    messages = order_messages(*(Message("warning", code, code) for code in reversed(codes)))

    assert tuple(m.code for m in messages) == codes
    assert order_messages(*messages) == messages


def test_the_same_message_is_told_once_and_telling_twice_changes_nothing() -> None:
    messages = order_messages(left_out("a.jpg"), left_out("a.jpg"), left_out("b.jpg"))
    assert len(messages) == 1
    assert order_messages(*messages) == messages


def accused(code: str, **subjects: tuple[str, ...]) -> Message:
    return Message("warning", code, f"{code}: look there.", **subjects)  # type: ignore[arg-type]


def cause_of(message: Message, *settles: str) -> Cause:
    return Cause(message=message, mend=None, gain=99.0, settles=frozenset(settles))


FEET = cause_of(accused("line-wrong-unit", lengths=("north",)), "south")
SWAPPED = cause_of(accused("labels-swapped", frames=("a.jpg",), labels=("P1", "P2")))


@pytest.mark.parametrize(
    ("message", "innocent"),
    [
        (accused("line-suspect", lengths=("north",)), True),
        (accused("line-left-out", lengths=("south",)), True),
        (accused("lengths-contradict", lengths=("north", "south")), True),
        (accused("lengths-contradict", lengths=("north", "west")), False),
        (accused("line-suspect", lengths=("west",)), False),
        (accused("line-unseen", lengths=("north",)), False),  # accuses nothing
        (accused("pick-suspect", frames=("a.jpg",), labels=("P1",)), True),
        (accused("pick-suspect", frames=("a.jpg",), labels=("P3",)), False),
        (accused("pick-suspect", frames=("b.jpg",), labels=("P1",)), False),
        (accused("pick-suspect", frames=("a.jpg", "b.jpg"), labels=("P1",)), False),
        (accused("line-suspect"), False),
    ],
)
def test_what_a_cause_explains_is_accused_no_longer(message: Message, innocent: bool) -> None:  # noqa: FBT001
    (told,) = downgrade_explained([message], [FEET, SWAPPED])
    assert told == (replace(message, level="info") if innocent else message)
    assert list(downgrade_explained([message], [])) == [message]


def test_a_photo_that_a_cause_settles_is_innocent_and_the_cause_itself_is_told() -> None:
    found = cause_of(accused("frame-left-out", frames=("c.jpg",)), "c.jpg")
    again = accused("frame-left-out", frames=("c.jpg",))
    messages = list(downgrade_explained([found.message, again], [found]))
    assert [one.level for one in messages] == ["warning", "info"]


def test_no_error_comes_before_a_cause_that_was_found() -> None:
    error = Message("error", "not-converged", "x")
    causes = [one.code for one in entries_by_code().values() if one.order.is_found_cause]
    assert len(causes) == 31
    for code in causes:
        found = Message("warning", code, "y")
        assert order_messages(error, found) == (found, error)
    assert order_messages(accused("pick-suspect"), error)[0] == error
    assert order_messages(Message("info", "labels-swapped", "y"), error)[0] == error
