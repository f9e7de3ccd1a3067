"""Buttons that put a result right: changes as the page sends them, whole or not at all."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from uavgram.model.message import Correction, Remedy
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import Line, Pick, State, make_observations
from uavgram.picking.protocol.encode_remedies import remedies_json
from uavgram.picking.protocol.parse import PhotoSize, parse_message

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
    assert (mend["words"], mend["changes"], mend["opens"]) == ("Read L2 again", [], "L2")


def test_work_in_the_field_has_no_button() -> None:
    assert remedies_json([Remedy(action="tape", words="Tape more")], LINES, INDEX) == []
