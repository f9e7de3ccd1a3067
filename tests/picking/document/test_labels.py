"""Labels exchanged: picks change hands, what was written of a name stays with the name."""

from __future__ import annotations

from typing import Any

import pytest

from uavgram.picking.document import commands as c
from uavgram.picking.document.errors import RefusedError
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import Line, Pick, State

HIGH: dict[str, Any] = {"height_m": 1.4, "area": "kerb"}
STATE = State(
    picks=(
        Pick(image="1.jpg", label="A", u_px=1, v_px=2, **HIGH),
        Pick(image="1.jpg", label="B", u_px=3, v_px=4),
        Pick(image="2.jpg", label="A", u_px=5, v_px=6, **HIGH),
        Pick(image="2.jpg", label="B", u_px=7, v_px=8),
        Pick(image="3.jpg", label="A", u_px=9, v_px=9, **HIGH),
    ),
    lines=(Line(name="L1", start="A", end="C", length_m=2, sigma_m=0.01),),
)


def swapped(state: State, image: str, label: str = "A", other: str = "B") -> State:
    return apply_change(state, c.Swap(image=image, label=label, other=other))


def places(state: State, label: str) -> list[tuple[str, float]]:
    return [(pick.image, pick.u_px) for pick in state.picks if pick.label == label]


def test_labels_are_exchanged_in_one_photo_and_twice_is_as_before() -> None:
    after = swapped(STATE, "2.jpg")

    assert sorted(places(after, "A")) == [("1.jpg", 1), ("2.jpg", 7), ("3.jpg", 9)]
    assert sorted(places(after, "B")) == [("1.jpg", 3), ("2.jpg", 5)]
    assert after.lines == STATE.lines
    assert swapped(after, "2.jpg") == STATE


def test_labels_are_exchanged_in_all_photos_while_lengths_stay() -> None:
    after = swapped(STATE, "")

    assert sorted(places(after, "B")) == [("1.jpg", 1), ("2.jpg", 5), ("3.jpg", 9)]
    assert after.lines == STATE.lines
    assert swapped(after, "") == STATE


@pytest.mark.parametrize("image", ["", "1.jpg"])
def test_what_is_stated_of_a_height_stays_with_its_label(image: str) -> None:
    after = swapped(STATE, image)

    assert {(pick.height_m, pick.area) for pick in after.picks if pick.label == "A"} == {
        (1.4, "kerb")
    }
    assert {(pick.height_m, pick.area) for pick in after.picks if pick.label == "B"} == {(None, "")}


def test_where_one_of_two_labels_is_picked_it_becomes_the_other() -> None:
    after = swapped(STATE, "3.jpg")

    assert places(after, "B")[-1] == ("3.jpg", 9)
    assert after.pick("3.jpg", "A") is None


def test_a_height_goes_with_a_pick_to_a_label_that_is_picked_nowhere() -> None:
    after = swapped(STATE, "", "A", "C")

    assert {pick.height_m for pick in after.picks if pick.label == "C"} == {1.4}


def match(image: str, label: str, u: float, of: tuple[str, float, float]) -> Pick:
    where = dict(zip(("from_image", "from_u_px", "from_v_px"), of, strict=True))
    made: dict[str, Any] = {"source": "match", "sigma_px": 0.06, "score": 0.9, **where}
    return Pick(image=image, label=label, u_px=u, v_px=0, **made)


def test_what_was_found_from_a_pick_of_another_label_goes_and_a_match_becomes_a_persons() -> None:
    found = (match("4.jpg", "A", 11, ("1.jpg", 1, 2)), match("5.jpg", "A", 12, ("2.jpg", 5, 6)))
    state = State(picks=(*STATE.picks, *found))

    assert places(swapped(state, "1.jpg"), "A")[-1] == ("5.jpg", 12)
    assert swapped(state, "4.jpg").pick("4.jpg", "B") == Pick(
        image="4.jpg", label="B", u_px=11, v_px=0
    )
    in_all = swapped(state, "")
    assert [pick.source for pick in in_all.picks if pick.label == "B"][-2:] == ["match", "match"]


@pytest.mark.parametrize(
    ("image", "label", "other", "why"),
    [
        ("1.jpg", "A", "A", "with itself"),
        ("1.jpg", "A", "X", "no label 'X'"),
        ("3.jpg", "B", "C", "neither 'B' nor 'C' is picked in '3.jpg'"),
    ],
)
def test_an_exchange_that_means_nothing_is_refused(
    image: str, label: str, other: str, why: str
) -> None:
    with pytest.raises(RefusedError, match=why):
        swapped(STATE, image, label, other)
