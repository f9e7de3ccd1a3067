"""What the page is told of a verdict: all of its words, and nothing left to judge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey as survey
from standings import with_status

from uavgram.model.message import Correction, Message, Remedy
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import Result
from uavgram.picking.document.state import Line, State, make_observations
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_remarks import Remarks
from uavgram.picking.protocol.encode_verdict import (
    encode_measurement_statuses,
    verdict_json,
)

SWAPPED = Reason(
    cause="labels-swapped", text="P01 and P10 seem to be swapped: swap them.", labels=("P01", "P10")
)
OTHER = Reason(cause="misfit", text="Something else.", measurements=("road width",))
AT_LENGTH = Message("warning", "labels-swapped", f"{SWAPPED.text} Odds 300 to 1.")
ALSO = Message("warning", "no-home", "The log states no home.")

ENDS = ("P01", "P02")


def told_of(result: Result) -> m.Verdict:
    """The verdict where no length is known, and every photo."""
    _, lines = make_observations(State())
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

    assert told["words"] == "In order: all 9 measurements fit and are checked."
    assert (told["first"]["text"], told["why"]) == ("", [])


def test_what_is_known_stands_beside_an_amber_light() -> None:
    made = with_status(survey.build(), "not-checked", "not-checked", "ok")
    verdict = Verdict(level="amber", reasons=(Reason(cause="nothing-checks", text="Tape more."),))

    words = told_of(replace(made, verdict=verdict))["words"]
    assert words == "Check: 8 of 10 measurements are in order."


def test_each_measurement_has_its_own_reason() -> None:
    made = with_status(survey.build(), "contradicted", "doubtful", "doubtful", "ok")
    standings = encode_measurement_statuses(
        replace(made, verdict=Verdict(level="red", reasons=(SWAPPED, OTHER)), evidence=None)
    )

    assert [one["words"] for one in standings[:4]] == ["contradicted", "doubtful", "doubtful", ""]
    assert standings[0]["why"] == SWAPPED.text  # one of its points is named
    assert standings[1]["why"] == SWAPPED.text  # nothing names it: the likeliest
    assert standings[2]["why"] == OTHER.text  # named itself
    assert standings[3]["why"] == ""
    assert standings[-1]["words"] == ""  # without a value, which says it all


def test_a_reason_names_its_photos_by_number_and_the_pick_to_look_at() -> None:
    made = survey.build()
    picks = made.picks
    names = made.frames.frame_id
    off = np.where(np.isfinite(picks.residual_px), picks.residual_px, 0.0)
    off[:] = np.minimum(off, 1.0)
    worst = next(k for k, image in enumerate(picks.image) if image == names[1])
    off[worst] = 70.0
    label = picks.label[worst]
    told = {
        "photo": Reason(cause="photo-turned", text="A.", frames=(names[1],)),
        "label": Reason(cause="point-off-ground", text="B.", labels=(label,)),
        "nothing": Reason(cause="nothing-checks", text="C.", measurements=("road width",)),
    }
    verdict = Verdict(level="amber", reasons=tuple(told.values()))
    residuals = replace(made, picks=replace(picks, residual_px=off), verdict=verdict, messages=())
    said = told_of(residuals)
    every = [said["first"], *said["why"]]

    assert [one["frames"] for one in every] == [[1], [], []]
    assert [one["show"] for one in every] == [{"image": 1, "label": label}] * 2 + [None]
    assert every[2]["measurements"] == ["road width"]


def test_a_length_is_shown_in_a_photo_of_both_its_ends() -> None:
    made = survey.build()
    picks, names = made.picks, made.frames.frame_id
    both = [
        {i for i, one in zip(picks.image, picks.label, strict=True) if one == end} for end in ENDS
    ]
    alone = names.index(min(both[0] & both[1]))
    label = tuple(
        "other" if (image, one) == (names[alone], ENDS[1]) else one
        for image, one in zip(picks.image, picks.label, strict=True)
    )
    off = np.zeros_like(picks.residual_px)
    off[[*zip(picks.image, picks.label, strict=True)].index((names[alone], ENDS[0]))] = 70.0
    line = Line(name="L1", start=ENDS[0], end=ENDS[1], length_m=1.0, sigma_m=0.01)
    _, lines = make_observations(State(lines=(line,)))
    told = Remarks(
        replace(picks, label=label, residual_px=off),
        lines,
        {name: k for k, name in enumerate(names)},
    )

    show = told.json(Reason(cause="line-suspect", text="A.", lengths=("L1",)))["show"]
    assert show is not None
    assert show["label"] in ENDS
    assert names[show["image"]] in (both[0] & both[1]) - {names[alone]}


def test_a_pick_that_was_left_out_is_the_one_to_look_at() -> None:
    made = survey.build()
    off = np.array(made.picks.residual_px)
    off[3] = np.nan
    image, label = made.picks.image[3], made.picks.label[3]
    reason = Reason(cause="frame-left-out", text="A.", frames=(image,))
    verdict = Verdict(level="amber", reasons=(reason,))
    picks = replace(made.picks, residual_px=off)

    show = told_of(replace(made, picks=picks, verdict=verdict))["first"]["show"]
    assert show == {"image": made.frames.frame_id.index(image), "label": label}


def test_a_reason_has_its_plain_sentence_and_a_button_for_each_remedy() -> None:
    free, other = (
        Remedy(action="free", words=words, corrections=(Correction(action="free", label=label),))
        for words, label in (("Free the height of P01", "P01"), ("Free the height of P10", "P10"))
    )
    reason = replace(SWAPPED, plain="P01 seems high.", mend=free, instead=(other,))
    first = told_of(replace(survey.build(), verdict=Verdict(level="amber", reasons=(reason,))))[
        "first"
    ]

    assert first["plain"] == "P01 seems high."
    assert [mend["words"] for mend in first["mends"]] == [free.words, other.words]
    assert first["mends"][0]["changes"] == [
        {"t": "height", "label": "P01", "height_m": None, "is_free": True}
    ]


def test_a_warning_that_is_no_reason_is_plain_too() -> None:
    told = told_of(replace(survey.build(clean=True), messages=(ALSO,)))

    assert [(one["plain"], one["level"]) for one in told["why"]] == [(ALSO.text, "warning")]
