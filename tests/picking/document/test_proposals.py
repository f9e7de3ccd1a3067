"""What the program found: it holds while its pick is there, and is a pick once it is accepted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.proposals import (
    BY_HAND,
    MIN_LIKE_PHOTOS,
    Outcome,
    make_accept_command,
    refuse,
    select_certain,
    select_valid,
)
from uavgram.picking.document.state import Pick, State

HAND = Pick(image="1.jpg", label="A", u_px=1.0, v_px=2.0, height_m=0.5)
STATE = State(picks=(HAND,))
SOURCE = ("1.jpg", 1.0, 2.0)


def found(image: str) -> Outcome:
    place = c.Place(
        image=image,
        label="A",
        u_px=7.0,
        v_px=8.0,
        sigma_px=0.06,
        source="match",
        score=0.9,
        from_image="1.jpg",
        from_u_px=1.0,
        from_v_px=2.0,
    )
    return Outcome(source=SOURCE, radius_px=20.0, found=place)


OUTCOMES = {
    ("2.jpg", "A"): found("2.jpg"),
    ("3.jpg", "A"): found("3.jpg"),
    ("4.jpg", "A"): Outcome(source=SOURCE, radius_px=90.0, why="several places look like it"),
}


def test_accepted_ones_are_picks_of_one_step_with_what_they_were_found_from() -> None:
    before = Session(state=STATE)
    after = apply(before, make_accept_command(OUTCOMES, STATE, [("2.jpg", "A"), ("3.jpg", "A")]))
    new = after.state.pick("3.jpg", "A")
    assert new is not None
    assert (new.source, new.sigma_px, new.score, new.from_image) == ("match", 0.06, 0.9, "1.jpg")
    assert new.is_match_of(HAND)
    assert new.height_m == 0.5  # one point has one height
    assert len(after.state.picks) == 3
    assert apply(after, c.Undo()).state == STATE


def test_what_is_picked_meanwhile_stays_as_it_is() -> None:
    own = Pick(image="2.jpg", label="A", u_px=5.0, v_px=5.0)
    state = State(picks=(HAND, own))
    do = make_accept_command(OUTCOMES, state, [("2.jpg", "A"), ("3.jpg", "A")])
    assert [place.image for place in do.places] == ["3.jpg"]
    # Also where it is picked between the command and its doing, as when a journal is played.
    everything = c.PlaceAll(places=tuple(one.found for one in OUTCOMES.values() if one.found))
    assert apply(Session(state=state), everything).state.pick("2.jpg", "A") == own


@pytest.mark.parametrize("pair", [("4.jpg", "A"), ("5.jpg", "A"), ("2.jpg", "B")])
def test_what_was_not_found_cannot_be_accepted(pair: tuple[str, str]) -> None:
    with pytest.raises(RefusedError, match="not proposed"):
        make_accept_command(OUTCOMES, STATE, [pair])


def test_it_holds_only_while_its_pick_is_where_it_was() -> None:
    moved = State(picks=(Pick(image="1.jpg", label="A", u_px=1.5, v_px=2.0),))
    assert select_valid(OUTCOMES, STATE) == OUTCOMES
    assert not select_valid(OUTCOMES, moved)
    with pytest.raises(RefusedError):
        make_accept_command(OUTCOMES, moved, [("2.jpg", "A")])


def test_what_is_refused_is_asked_for_and_once_more_is_not() -> None:
    once = refuse(OUTCOMES, [("2.jpg", "A"), ("4.jpg", "A"), ("9.jpg", "Z")])
    asked = once["2.jpg", "A"]
    assert (asked.found, asked.why, asked.is_asked, asked.is_over) == (None, BY_HAND, True, True)
    assert not once["4.jpg", "A"].is_asked
    assert once["3.jpg", "A"] == OUTCOMES["3.jpg", "A"]
    assert not refuse(once, [("2.jpg", "A")])["2.jpg", "A"].is_asked


def test_a_match_is_sure_where_enough_photos_show_its_surroundings_alike() -> None:
    images = [f"{k}.jpg" for k in range(2, 3 + MIN_LIKE_PHOTOS)]
    alike = {
        (image, "A"): replace(found(image), is_alike=True) for image in images[:MIN_LIKE_PHOTOS]
    }
    rest = {(image, "A"): found(image) for image in images[MIN_LIKE_PHOTOS:]}

    assert select_certain(alike | rest) == set(alike)
    alike.pop((images[0], "A"))
    assert select_certain(alike | rest) == set()  # what is left agrees with too few


def test_a_target_is_sure_by_itself() -> None:
    match = found("2.jpg")
    assert match.found is not None
    target = replace(match, found=replace(match.found, source="target"))

    assert select_certain({("2.jpg", "A"): target, ("3.jpg", "A"): match}) == {("2.jpg", "A")}
