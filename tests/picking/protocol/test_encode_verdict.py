"""What the page is told of a verdict: all of its words, and nothing left to judge."""

from __future__ import annotations

from dataclasses import replace

import synthetic_survey as survey
from standings import with_status

from uavgram.model.message import Message
from uavgram.model.result.result import Result
from uavgram.model.result.verdict import Reason, Verdict
from uavgram.picking.document.state import State, observations_of
from uavgram.picking.protocol.encode_verdict import (
    Json,
    measurement_standings,
    verdict_json,
)

SWAPPED = Reason(
    cause="labels-swapped", text="P01 and P10 seem to be swapped: swap them.", labels=("P01", "P10")
)
OTHER = Reason(cause="misfit", text="Something else.", measurements=("road width",))
AT_LENGTH = Message("warning", "labels-swapped", f"{SWAPPED.text} Odds 300 to 1.")
ALSO = Message("warning", "no-home", "The log states no home.")


def told_of(result: Result) -> Json:
    """The verdict where no length is known, and every photo."""
    _, lines = observations_of(State())
    return verdict_json(result, lines, {name: k for k, name in enumerate(result.frames.frame_id)})


def test_the_first_reason_stands_alone_and_behind_it_what_says_more() -> None:
    verdict = Verdict(level="red", reasons=(SWAPPED, OTHER))
    messages = (Message("info", "chosen", "A choice."), ALSO, AT_LENGTH)
    told = told_of(replace(survey.build(), verdict=verdict, messages=messages))

    assert told["level"] == "red"
    assert told["words"].startswith("Do not use: ")
    assert (told["first"]["text"], told["first"]["code"]) == (SWAPPED.text, "labels-swapped")
    assert [one["text"] for one in told["why"]] == [AT_LENGTH.text, "Something else.", ALSO.text]


def test_what_the_first_reason_says_already_is_not_said_again() -> None:
    message = Message("warning", SWAPPED.cause, SWAPPED.text)
    verdict = Verdict(level="amber", reasons=(SWAPPED,))
    told = told_of(replace(survey.build(), verdict=verdict, messages=(message,)))

    assert told["why"] == []


def test_green_has_words_and_no_reason() -> None:
    told = told_of(replace(survey.build(clean=True), messages=()))

    assert told["words"] == "In order: everything fits"
    assert (told["first"]["text"], told["why"]) == ("", [])


def test_nothing_checked_is_said_of_what() -> None:
    made = with_status(survey.build(), "not-checked", "not-checked", "ok")
    verdict = Verdict(level="amber", reasons=(Reason(cause="nothing-checks", text="Tape more."),))

    words = told_of(replace(made, verdict=verdict))["words"]
    assert words == "Check: nothing would show an error in 'skid left' and 'skid right'"


def test_each_measurement_has_its_own_reason() -> None:
    made = with_status(survey.build(), "contradicted", "doubtful", "doubtful", "ok")
    standings = measurement_standings(
        replace(made, verdict=Verdict(level="red", reasons=(SWAPPED, OTHER)), evidence=None)
    )

    assert [one["words"] for one in standings[:4]] == ["contradicted", "doubtful", "doubtful", ""]
    assert standings[0]["why"] == SWAPPED.text  # one of its points is named
    assert standings[1]["why"] == SWAPPED.text  # nothing names it: the likeliest
    assert standings[2]["why"] == OTHER.text  # named itself
    assert standings[3]["why"] == ""
    assert standings[-1]["words"] == ""  # without a value, which says it all
