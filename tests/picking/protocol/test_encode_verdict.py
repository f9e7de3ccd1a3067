"""What the page is told of a verdict: all of its words, and nothing left to judge."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from standings import with_status

from uavgram.model.message import (
    Correction,
    Message,
    Remedy,
    propose_length_removal,
    propose_photo_removal,
    propose_taking_back,
)
from uavgram.model.message_catalogue import entry_of
from uavgram.model.result.reliability import Reason, Verdict, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.model.result.tables import LineStatus, PickStatus
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import Line, Pick, State, make_observations
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_verdict import (
    Remarks,
    describe_unchecked,
    encode_length_statuses,
    encode_measurement_statuses,
    encode_photo_statuses,
    encode_point_statuses,
    remedies_json,
    verdict_json,
)
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.stages.judge.verdict import make_reason
from uavgram.stages.remedies import make_tape_remedy
from uavgram.views.survey.verdict import describe_undetectable

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
    assert words == (
        "Check: of 10 measurements, 7 are ok, 2 are not checked (skid left and skid right) and 1 "
        "is not computed (to the tree)."
    )


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
    assert [one["show"] for one in every] == [[{"image": 1, "label": label}]] * 2 + [[]]
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

    (show,) = told.json(Reason(cause="line-suspect", text="A.", lengths=("L1",)))["show"]
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
    assert show == [{"image": made.frames.frame_id.index(image), "label": label}]


def test_each_of_two_points_in_doubt_has_its_own_place_to_look_at() -> None:
    made = survey.build()
    labels = tuple(dict.fromkeys(made.picks.label))[:2]
    reason = Reason(cause="control-exchanged", text="A.", labels=labels)

    found = told_of(replace(made, verdict=Verdict(level="amber", reasons=(reason,))))
    assert [one["label"] for one in found["first"]["show"]] == list(labels)


def test_a_sentence_that_names_a_setting_of_the_set_up_has_the_button_that_opens_it() -> None:
    made = survey.build()
    told = {
        "gimbal-off": "It hung otherwise: check how the camera hung (`mount` in the project).",
        "clock-off": "The clock is off: change `time.offset_s` in the project.",
    }
    reasons = tuple(Reason(cause=cause, text=text) for cause, text in told.items())

    found = told_of(replace(made, verdict=Verdict(level="amber", reasons=reasons), messages=()))
    ways = [[mend["way"]["to"] for mend in one["mends"]] for one in (found["first"], *found["why"])]
    assert ways == [["set-up"], []]


@pytest.mark.parametrize(
    "code", ["control-exchanged", "control-left-out", "photo-elsewhere", "telemetry-strained"]
)
def test_a_reason_that_nothing_corrects_says_what_to_do(code: str) -> None:
    made = survey.build()
    message = Message(
        "warning", code, "It does not fit.",
        labels=made.picks.label[:1], frames=made.frames.frame_id[:1],
    )  # fmt: skip
    reason = make_reason(message)

    found = told_of(replace(made, verdict=Verdict(level="amber", reasons=(reason,))))["first"]
    assert found["plain"] == f"{reason.plain} {entry_of(code).action}"
    assert found["show"]


def test_a_point_whose_picks_contradict_each_other_is_shown_in_each_photo() -> None:
    result = survey.build()
    label = max(set(result.picks.label), key=result.picks.label.count)
    seen = [
        one for one, own in zip(result.picks.image, result.picks.label, strict=True) if own == label
    ]
    reason = Reason(cause="pick-suspect", text="A.", labels=(label,), frames=tuple(seen[:2]))
    found = told_of(replace(result, verdict=Verdict(level="amber", reasons=(reason,))))
    assert [one["label"] for one in found["first"]["show"]] == [label, label]
    assert len({one["image"] for one in found["first"]["show"]}) == 2


def test_a_mount_that_does_not_fit_has_a_button_to_the_set_up() -> None:
    entry = entry_of("prior-strained")
    reason = Reason(cause="prior-strained", text="It is 18 times off.", plain=entry.one)
    found = told_of(replace(survey.build(), verdict=Verdict(level="amber", reasons=(reason,))))
    (mend,) = found["first"]["mends"]
    assert mend["way"] == {"to": "set-up", "names": ["mount"]}


def test_what_no_button_can_do_is_written_out() -> None:
    tape = make_tape_remedy("P1", "P2", 8.0)
    reason = Reason(cause="nothing-checks", text="A.", plain="L4 is not checked.", mend=tape)
    found = told_of(replace(survey.build(), verdict=Verdict(level="amber", reasons=(reason,))))
    assert found["first"]["plain"] == "L4 is not checked. Tape from P1 to P2, about 8.0 m."
    assert not found["first"]["mends"]


def test_a_reason_that_a_button_corrects_gets_no_general_advice() -> None:
    name = LINES.name[0]
    reason = Reason(
        cause="line-suspect",
        text="A.",
        plain="L does not fit.",
        mend=propose_length_removal([name]),
    )
    found = told_of(replace(survey.build(), verdict=Verdict(level="amber", reasons=(reason,))))
    assert found["first"]["plain"] == "L does not fit."


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


# Buttons that put a result right: changes as the page sends them, whole or not at all.


PHOTOS = (PhotoSize("1.jpg", 640, 480), PhotoSize("2.jpg", 640, 480))
INDEX = {photo.name: k for k, photo in enumerate(PHOTOS)}
STATE = State(
    picks=(
        Pick(image="1.jpg", label="A", u_px=1, v_px=2),
        Pick(image="1.jpg", label="B", u_px=3, v_px=4, is_free=True),
        Pick(image="2.jpg", label="C", u_px=5, v_px=6),
    ),
    lines=(
        Line(name="L1", start="A", end="B", length_m=2.0, sigma_m=0.01, tape="long"),
        Line(name="L2", start="A", end="C", length_m=3.0, sigma_m=0.02, adjust=False),
    ),
)
_, LINES = make_observations(STATE)


def remedy(*corrections: Correction) -> Remedy:
    return Remedy(action=corrections[0].action, words="Do it", corrections=corrections)


def pressed(*corrections: Correction) -> State:
    """The state after the page sent what a button stands for."""
    (mend,) = remedies_json([remedy(*corrections)], LINES, INDEX)
    text = json.dumps({"seq": 1, "t": "all", "changes": mend["changes"]})
    command = parse_message(text, PHOTOS).body
    return apply_change(STATE, command)  # type: ignore[arg-type]


def test_each_correction_is_a_change_that_the_document_takes() -> None:
    after = pressed(
        Correction(action="swap", frame="1.jpg", label="A", other="B"),
        Correction(action="move", frame="2.jpg", label="C", pixel_px=(50.0, 60.0)),
        Correction(action="length", length="L1", length_m=2.5),
        Correction(action="ends", length="L2", ends=("B", "C")),
        Correction(action="free", label="A"),
        Correction(action="on-ground", label="B"),
    )

    assert after.picks == (
        Pick(image="1.jpg", label="B", u_px=1, v_px=2),
        Pick(image="1.jpg", label="A", u_px=3, v_px=4, is_free=True),
        Pick(image="2.jpg", label="C", u_px=50, v_px=60),
    )
    assert after.lines == (
        Line(name="L1", start="A", end="B", length_m=2.5, sigma_m=0.01, tape="long"),
        Line(name="L2", start="B", end="C", length_m=3.0, sigma_m=0.02, adjust=False),
    )


def test_a_pick_and_a_length_are_removed() -> None:
    after = pressed(
        Correction(action="unpick", frame="2.jpg", label="C"),
        Correction(action="remove-length", length="L2"),
    )

    assert after == State(picks=STATE.picks[:2], lines=STATE.lines[:1])


def test_an_exchange_in_all_photos_names_none() -> None:
    (mend,) = remedies_json([remedy(Correction(action="swap", label="A", other="C"))], LINES, INDEX)

    assert mend["changes"] == [{"t": "swap", "image": None, "label": "A", "other": "C"}]


@pytest.mark.parametrize(
    "strange",
    [
        Correction(action="unpick", frame="9.jpg", label="A"),
        Correction(action="length", length="side of a plate", length_m=1.0),
        Correction(action="tape", ends=("A", "B"), length_m=4.0),
    ],
)
def test_a_remedy_that_the_page_cannot_do_entirely_has_no_button(strange: Correction) -> None:
    known = Correction(action="free", label="A")

    assert remedies_json([remedy(known, strange)], LINES, INDEX) == []
    assert len(remedies_json([None, remedy(known), remedy(strange)], LINES, INDEX)) == 1


def test_a_length_to_be_read_again_is_opened() -> None:
    again = Remedy(
        action="read",
        words="Read L2 again",
        corrections=(Correction(action="read", length="L2"),),
    )
    strange = replace(again, corrections=(Correction(action="read", length="of a plate"),))

    (mend,) = remedies_json([again, strange], LINES, INDEX)
    assert (mend["words"], mend["changes"]) == ("Read L2 again", [])
    assert mend["way"] == {"to": "length", "names": ["L2"]}


def test_a_photo_is_left_out_by_a_button_if_the_page_has_it() -> None:
    name = next(iter(INDEX))
    (mend,) = remedies_json(map(propose_photo_removal, (name, "other.jpg")), LINES, INDEX)
    assert (mend["changes"], mend["way"]) == ([], {"to": "leave-out", "names": [name]})


def test_of_two_clicks_only_the_second_is_taken_back() -> None:
    name = next(iter(INDEX))
    (mend,) = remedies_json([propose_taking_back([(name, "A")])], LINES, INDEX)
    change = {"t": "unpick", "image": INDEX[name], "label": "A", "is_repetition": True}
    assert mend["changes"] == [change]


def swap(*photos: str) -> Reason:
    """Two labels are swapped in one of some photos, or something else is wrong."""
    swaps = [
        Remedy(
            action="swap",
            words=f"Swap A and B in {photo}",
            corrections=(Correction(action="swap", frame=photo, label="A", other="B"),),
        )
        for photo in photos
    ]
    return Reason(
        cause="labels-swapped",
        text="A and B seem to be swapped.",
        plain="A and B.",
        mend=swaps[0],
        instead=tuple(swaps[1:]),
        equals=("The tape is wrong.",),
    )


def test_no_change_is_offered_where_another_cause_is_as_likely_and_no_photo_shows_which() -> None:
    photos = tuple(INDEX)
    remarks = Remarks(survey.build().picks, LINES, INDEX)
    one = remarks.json(swap(photos[0]))
    assert one["mends"] == []
    assert "Or, just as likely: The tape is wrong. Look at each" in one["plain"]
    two = remarks.json(swap(*photos[:2]))  # of which the page compares the places
    assert len(two["mends"]) == 2


def test_a_mount_that_contradicts_the_recorded_angles_is_replaced_by_one_button() -> None:
    remarks = Remarks(survey.build().picks, LINES, INDEX)
    text = "The mount contradicts the recorded angles: check `mount`."
    mends = remarks.json(Reason(cause="mount-stated", text=text))["mends"]
    assert [mend["way"]["to"] for mend in mends] == ["recorded", "set-up"]


def test_work_in_the_field_has_no_button() -> None:
    assert remedies_json([Remedy(action="tape", words="Tape more")], LINES, INDEX) == []


# Each row says how far it can be trusted, and the smallest error that would show in it.


@pytest.fixture
def clean() -> Result:
    """In order, with a last length in which any reading would show."""
    made = survey.build(clean=True)
    used: LineStatus = "used"
    lines = replace(made.lines, status=(used,) * len(made.lines.name))
    return replace(made, lines=replace(lines, mdb_m=np.full(len(lines.name), 0.05)))


WRONG = Reason(cause="misfit", text="Something is wrong.")


def test_what_the_verdict_names_is_doubtful_and_says_why(clean: Result) -> None:
    label, name = clean.points.label[0], clean.lines.name[0]
    image = clean.frames.frame_id[clean.frames.status.index("refined")]
    reason = replace(WRONG, labels=(label,), lengths=(name,), frames=(image,))
    made = replace(clean, verdict=Verdict(level="amber", reasons=(reason,)))
    photos = dict(zip(made.frames.frame_id, encode_photo_statuses(made), strict=True))

    told = (encode_point_statuses(made)[label], encode_length_statuses(made)[0], photos[image])
    for one in told:
        assert (one["status"], one["why"]) == ("doubtful", "Something is wrong.")
    assert encode_length_statuses(made)[1]["status"] == "ok"


def test_of_a_red_result_nothing_that_takes_part_is_in_order(clean: Result) -> None:
    label = clean.points.label[0]
    red = Verdict(level="red", reasons=(replace(WRONG, labels=(label,)),))
    made = with_status(replace(clean, verdict=red), "not-checked")
    points = encode_point_statuses(made)

    assert points[label]["status"] == "contradicted"
    others = [one["status"] for name, one in points.items() if name != label]
    others += [one["status"] for one in encode_length_statuses(made)]
    others += [one["status"] for one in encode_measurement_statuses(made) if one["words"]]
    assert set(others) == {"doubtful"}
    for status, one in zip(made.frames.status, encode_photo_statuses(made), strict=True):
        assert (one["status"] == "ok") == (status not in ("refined", "rejected"))


def test_a_point_that_nothing_checks_says_so(clean: Result) -> None:
    picks = clean.picks
    used: PickStatus = "used"
    count = len(picks.label)
    blind = replace(picks, redundancy=np.zeros(count), status=(used,) * count)

    for one in encode_point_statuses(replace(clean, picks=blind)).values():
        assert one["status"] == "not-checked"
        assert "a wrong click here would not show" in one["why"]


def test_a_length_says_from_what_error_on_it_would_tell(clean: Result) -> None:
    seen = encode_length_statuses(clean)[0]

    assert seen["status"] == "ok"
    assert seen["shows"].startswith("a tape misread by less than 5.0 cm would not be noticed")
    assert describe_undetectable(clean) == ""


@pytest.mark.parametrize("mdb_m", [0.21, float("nan")])
def test_a_length_in_which_a_decimetre_would_not_show_is_not_trusted(
    clean: Result, mdb_m: float
) -> None:
    mdb = np.append(mdb_m, clean.lines.mdb_m[1:])
    made = replace(clean, lines=replace(clean.lines, mdb_m=mdb))
    first = encode_length_statuses(made)[0]

    assert first["status"] == "not-checked"
    assert ("0.21 m" in first["shows"] or "21.0 cm" in first["shows"]) == np.isfinite(mdb_m)
    assert first["words"] == ("roughly checked" if np.isfinite(mdb_m) else "not checked")
    name = clean.lines.name[0]
    hidden = f"a tape misread by less than 0.21 m at {name} would not. "
    if not np.isfinite(mdb_m):
        hidden = "; a measurement that depends on it is shown as not checked."
    assert hidden in describe_undetectable(made)
    assert name in describe_undetectable(made)


def test_a_measurement_that_nothing_checks_says_what_would_not_show() -> None:
    rows = with_status(survey.build(), "not-checked", "ok").measurements
    count, label = len(rows.name), rows.points[0][0]
    links = WeakestLinks(
        what=("",) * count,
        bias=np.full(count, np.nan),
        unit=("",) * count,
        change=np.full(count, np.nan),
        unchecked=(("pick of 'other' in 'a.jpg'", f"pick of {label!r} in 'a.jpg'"),) * count,
    )

    shows = describe_unchecked(rows, links)
    told = describe_unchecked(
        rows, replace(links, unchecked=(("focal length of the camera",) * 2,) * count)
    )
    assert shows[0] == (
        f"an error in the click on {label!r} in 'a.jpg' would not be noticed, nor one in 1 other "
        "value"
    )
    assert told[0] == "an error in the focal length of the camera would not be noticed"
    assert not any(shows[1:])
