"""What became of each frame."""

from __future__ import annotations

from dataclasses import replace

import synthetic_survey as survey

from uavgram.model.message import Message
from uavgram.views.survey.key_facts import frame_counts, frame_states


def strained(frame_id: str) -> Message:
    """What it says in words is nobody's business: the frame is in its data."""
    return Message("warning", "telemetry-strained", "Look at it.", frames=(frame_id,))


def test_a_suspect_pick_makes_a_frame_one_to_check() -> None:
    states = frame_states(survey.build())

    assert states[0] == "check"
    assert states[1] == "refined"
    assert (states[5], states[11], states[14]) == ("unmatched", "rejected", "seeded")


def test_strained_telemetry_makes_a_frame_one_to_check() -> None:
    result = survey.build(clean=True)
    name = result.frames.frame_id[3]
    states = frame_states(replace(result, messages=(strained(name),)))

    assert set(frame_states(result)) == {"refined"}
    assert [i for i, state in enumerate(states) if state == "check"] == [3]


def test_a_frame_that_is_not_refined_keeps_its_status_whatever_its_picks() -> None:
    result = survey.build()
    messages = tuple(strained(result.frames.frame_id[i]) for i in (5, 11, 14))

    assert frame_states(replace(result, messages=messages)) == frame_states(result)


def test_the_counts_say_how_many_and_whether_any_was_rejected() -> None:
    assert frame_counts(survey.build()) == (
        "20 photos: 17 refined (1 to check), 1 no picks, 1 not in the log, 1 rejected"
    )
    assert frame_counts(survey.build(clean=True)) == "20 photos: 20 refined, none rejected"
    assert frame_counts(survey.build(frame_count=1)).startswith("1 photo: 1 refined")
