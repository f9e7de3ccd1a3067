"""What commands make of a session: exact undo, one name for one point, refusals in words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.model.observations import MeasurementKind
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import Command, RefusedError
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import Pick, State, make_observations, make_state

LABELS = st.sampled_from(["A", "B", "C", "D"])
IMAGES = st.sampled_from(["1.jpg", "2.jpg"])
NAMES = st.sampled_from(["L1", "L2"])
PIXELS = st.floats(0, 100)
CHANGES = st.one_of(
    st.builds(c.Place, image=IMAGES, label=LABELS, u_px=PIXELS, v_px=PIXELS),
    st.builds(c.Repeat, image=IMAGES, label=LABELS, u_px=PIXELS, v_px=PIXELS),
    st.builds(c.Unpick, image=IMAGES, label=LABELS, is_repetition=st.booleans()),
    st.builds(c.Forget, label=LABELS),
    st.builds(c.Rename, label=LABELS, new=LABELS),
    st.builds(c.Merge, label=LABELS, into=LABELS, keep=st.just("") | LABELS),
    st.builds(c.Split, label=LABELS, new=LABELS, images=st.lists(IMAGES).map(tuple)),
    st.builds(c.Swap, image=st.just("") | IMAGES, label=LABELS, other=LABELS),
    st.builds(
        c.SetHeight,
        label=LABELS,
        height_m=st.none() | PIXELS,
        height_sigma_m=st.none() | st.just(0.02),
        is_free=st.booleans(),
    ),
    st.builds(c.SetSigma, image=IMAGES, label=LABELS, sigma_px=st.none() | st.just(0.5)),
    st.builds(
        c.SetLine,
        was=st.just("") | NAMES,
        name=NAMES,
        start=LABELS,
        end=LABELS,
        length_m=st.just(2.0),
        sigma_m=st.just(0.01),
        adjust=st.booleans(),
    ),
    st.builds(c.RemoveLine, name=NAMES),
    st.builds(
        c.SetMeasurement,
        was=st.just("") | NAMES,
        name=NAMES,
        kind=st.just("distance"),
        points=st.tuples(LABELS, LABELS),
    ),
    st.builds(c.RemoveMeasurement, name=NAMES),
)


def place(
    session: Session,
    label: str,
    u: float = 1.0,
    v: float = 2.0,
    image: str = "1.jpg",
    step: int = 0,
) -> Session:
    return apply(session, c.Place(image=image, label=label, u_px=u, v_px=v), step)


def line(
    session: Session, name: str = "L1", was: str = "", start: str = "A", end: str = "B"
) -> Session:
    command = c.SetLine(
        was=was, name=name, start=start, end=end, length_m=3.0, sigma_m=0.01, adjust=True
    )
    return apply(session, command)


@settings(max_examples=60)
@given(st.lists(CHANGES, max_size=25))
def test_undo_goes_back_through_every_state_and_redo_forward_again(changes: list[Command]) -> None:
    session = Session(state=State())
    seen = [session.state]
    for change in changes:
        try:
            session = apply(session, change)
        except RefusedError:
            continue
        if session.state != seen[-1]:
            seen.append(session.state)
    for state in reversed(seen[:-1]):
        session = apply(session, c.Undo())
        assert session.state == state
    with pytest.raises(RefusedError, match="nothing to undo"):
        apply(session, c.Undo())
    for state in seen[1:]:
        session = apply(session, c.Redo())
        assert session.state == state


def test_a_drag_is_one_step() -> None:
    session = place(Session(state=State()), "A")
    for k in range(20):
        session = place(session, "A", u=float(k), step=7)
    assert len(session.past) == 2
    assert apply(session, c.Undo()).state.picks[0].u_px == 1.0


def test_two_drags_are_two_steps_and_undo_ends_a_step() -> None:
    session = place(Session(state=State()), "A")
    session = place(session, "A", u=5.0, step=7)
    session = apply(session, c.Undo())
    session = place(session, "A", u=6.0, step=7)
    assert apply(session, c.Undo()).state.picks[0].u_px == 1.0


def test_a_change_after_undo_forgets_what_was_undone() -> None:
    session = apply(place(place(Session(state=State()), "A"), "B"), c.Undo())
    session = place(session, "C")
    with pytest.raises(RefusedError, match="nothing to do again"):
        apply(session, c.Redo())


def test_a_rename_goes_everywhere() -> None:
    session = line(place(place(Session(state=State()), "A"), "B"))
    session = apply(session, c.SetMeasurement(was="", name="D", kind="distance", points=("A", "B")))
    state = apply(session, c.Rename(label="A", new="kerb")).state
    assert state.labels == ("kerb", "B")
    assert state.lines[0].start == "kerb"
    assert state.requests[0].points == ("kerb", "B")


def test_a_rename_to_a_label_that_is_there_is_refused() -> None:
    session = place(place(Session(state=State()), "A"), "B")
    with pytest.raises(RefusedError, match="already"):
        apply(session, c.Rename(label="A", new="B"))


def test_a_further_pick_of_a_label_takes_over_its_height() -> None:
    session = apply(place(Session(state=State()), "A"), c.SetHeight(label="A", height_m=0.4))
    session = place(session, "A", image="2.jpg")
    assert [pick.height_m for pick in session.state.picks] == [0.4, 0.4]


def heights(session: Session) -> list[tuple[float | None, float | None, bool]]:
    return [(p.height_m, p.height_sigma_m, p.is_free) for p in session.state.picks]


def test_a_height_is_on_the_ground_or_stated_or_free_and_each_replaces_the_others() -> None:
    session = place(place(Session(state=State()), "A"), "A", image="2.jpg")
    stated = apply(session, c.SetHeight(label="A", height_m=1.4, height_sigma_m=0.02))
    free = apply(stated, c.SetHeight(label="A", height_m=None, is_free=True))
    ground = apply(free, c.SetHeight(label="A", height_m=None))
    assert heights(stated) == [(1.4, 0.02, False)] * 2
    assert heights(free) == [(None, None, True)] * 2
    assert heights(ground) == [(None, None, False)] * 2
    back = apply(apply(ground, c.Undo()), c.Undo())
    assert back.state == stated.state
    assert apply(back, c.Redo()).state == free.state
    assert heights(place(free, "A", image="3.jpg")) == [(None, None, True)] * 3


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (c.SetHeight(label="A", height_m=1.0, is_free=True), "either stated or free"),
        (c.SetHeight(label="A", height_m=None, height_sigma_m=0.1), "sigma of no height"),
        (c.SetHeight(label="A", height_m=None, height_sigma_m=0.1, is_free=True), "of no height"),
        (c.SetHeight(label="B", height_m=1.0), "not picked"),
    ],
)
def test_a_height_that_no_table_could_hold_is_refused(command: c.SetHeight, why: str) -> None:
    with pytest.raises(RefusedError, match=why):
        apply(place(Session(state=State()), "A"), command)


def test_moving_a_pick_keeps_its_sigma_and_height() -> None:
    session = place(Session(state=State()), "A")
    session = apply(session, c.SetSigma(image="1.jpg", label="A", sigma_px=0.3))
    session = apply(session, c.SetHeight(label="A", height_m=1.0))
    moved = place(session, "A", u=9.0).state.picks[0]
    assert (moved.u_px, moved.sigma_px, moved.height_m) == (9.0, 0.3, 1.0)


def with_matches() -> Session:
    """A is picked in 1.jpg and was found from there in 2.jpg and 3.jpg; B is in 1.jpg, too."""
    session = place(place(Session(state=State()), "A"), "B", u=1.0, v=2.0)
    for image in ("2.jpg", "3.jpg"):
        found = c.Place(image=image, label="A", u_px=7.0, v_px=8.0, sigma_px=0.06, source="match")
        found = replace(found, from_image="1.jpg", from_u_px=1.0, from_v_px=2.004, score=0.9)
        session = apply(session, found)
    return session


def photos_of(session: Session, label: str) -> list[str]:
    return [pick.image for pick in session.state.picks if pick.label == label]


@pytest.mark.parametrize(
    "change",
    [
        c.Place(image="1.jpg", label="A", u_px=1.02, v_px=2.0),
        c.Unpick(image="1.jpg", label="A"),
    ],
)
def test_what_was_found_from_a_pick_goes_with_it_and_undo_brings_all_back(change: Command) -> None:
    before = with_matches()
    after = apply(before, change)
    assert photos_of(after, "A") == ([] if isinstance(change, c.Unpick) else ["1.jpg"])
    assert photos_of(after, "B") == ["1.jpg"]
    assert apply(after, c.Undo()).state == before.state


def test_what_was_found_from_another_pick_at_the_same_place_stays() -> None:
    gone = apply(with_matches(), c.Unpick(image="1.jpg", label="B"))
    assert photos_of(gone, "A") == ["1.jpg", "2.jpg", "3.jpg"]


def test_a_whole_drag_of_a_pick_is_undone_with_its_matches() -> None:
    before = with_matches()
    after = place(place(before, "A", u=1.5, step=7), "A", u=1.0, step=7)
    assert photos_of(after, "A") == ["1.jpg"]
    assert apply(after, c.Undo()).state == before.state


def test_another_sigma_of_a_pick_leaves_its_matches() -> None:
    before = with_matches()
    session = apply(before, c.SetSigma(image="1.jpg", label="A", sigma_px=0.3))
    session = apply(session, c.Place(image="1.jpg", label="A", u_px=1.0, v_px=2.0, sigma_px=0.4))
    assert photos_of(session, "A") == ["1.jpg", "2.jpg", "3.jpg"]


def test_a_match_that_is_moved_is_a_persons_pick() -> None:
    moved = place(with_matches(), "A", u=7.5, v=8.0, image="2.jpg").state.pick("2.jpg", "A")
    assert moved == Pick(image="2.jpg", label="A", u_px=7.5, v_px=8.0)  # nor the matching's sigma
    one_gone = apply(with_matches(), c.Unpick(image="2.jpg", label="A"))
    assert photos_of(one_gone, "A") == ["1.jpg", "3.jpg"]


def test_the_program_never_changes_a_persons_pick() -> None:
    found = c.Place(image="1.jpg", label="A", u_px=7.0, v_px=8.0, source="match")
    with pytest.raises(RefusedError, match="a person picked"):
        apply(with_matches(), found)


def test_who_made_a_pick_goes_to_the_adjustment_and_back() -> None:
    state = with_matches().state
    picks, lines = make_observations(state)
    assert picks.source == ("hand", "hand", "match", "match")
    assert make_state(picks, lines, ()) == state


def test_forgetting_a_label_takes_its_lengths_and_measurements_along() -> None:
    session = line(place(place(Session(state=State()), "A"), "B"))
    state = apply(session, c.Forget(label="A")).state
    assert state.labels == ("B",)
    assert not state.lines


@pytest.mark.parametrize(
    ("kind", "points"),
    [
        ("distance", ("A",)),
        ("distance", ("A", "A")),
        ("area", ("A", "B")),
        ("angle", ("A", "B", "A")),
        ("polyline", ("A", "A", "B")),
    ],
)
def test_measurements_that_mean_nothing_are_refused(
    kind: MeasurementKind, points: tuple[str, ...]
) -> None:
    command = c.SetMeasurement(was="", name="M", kind=kind, points=points)
    with pytest.raises(RefusedError, match="labels"):
        apply(Session(state=State()), command)


def test_two_lengths_of_one_name_are_refused_and_a_change_by_name_is_not() -> None:
    session = line(Session(state=State()))
    with pytest.raises(RefusedError, match="already"):
        line(session)
    assert line(session, name="L2", was="L1").state.lines[0].name == "L2"


def test_several_changes_are_one_step_and_where_one_does_not_fit_none_is_made() -> None:
    before = place(place(Session(state=State()), "A"), "B")
    moves = (c.Rename(label="A", new="C"), c.Unpick(image="1.jpg", label="B"))
    after = apply(before, c.All(changes=moves))
    assert after.state.labels == ("C",)
    assert apply(after, c.Undo()).state == before.state
    with pytest.raises(RefusedError, match="not picked"):
        apply(before, c.All(changes=(*moves, c.Unpick(image="1.jpg", label="B"))))


def test_a_click_that_is_made_again_stands_beside_the_first_and_goes_with_it() -> None:
    session = place(place(Session(state=State()), "A", 10.0), "B", 30.0)
    session = apply(session, c.SetHeight(label="A", height_m=0.5))
    session = apply(session, c.Repeat(image="1.jpg", label="A", u_px=11.0, v_px=12.0))
    first, _, again = session.state.picks
    assert (again.key, again.u_px, again.height_m, again.again) == (first.key, 11.0, 0.5, 1)
    assert session.state.pick("1.jpg", "A") is first
    assert make_state(*make_observations(session.state), ()).picks == session.state.picks

    swapped = apply(session, c.Swap(image="1.jpg", label="A", other="B")).state.picks
    assert [(pick.label, pick.u_px) for pick in swapped] == [("B", 10.0), ("A", 30.0), ("B", 11.0)]
    assert [
        pick.label for pick in apply(session, c.Unpick(image="1.jpg", label="A")).state.picks
    ] == ["B"]
    back = apply(session, c.Unpick(image="1.jpg", label="A", is_repetition=True))
    assert [(pick.label, pick.u_px) for pick in back.state.picks] == [("A", 10.0), ("B", 30.0)]
    with pytest.raises(RefusedError, match="'A' was clicked once"):
        apply(back, c.Unpick(image="1.jpg", label="A", is_repetition=True))
    assert len(apply(session, c.Undo()).state.picks) == 2
    with pytest.raises(RefusedError, match="'C' is not picked in"):
        apply(session, c.Repeat(image="1.jpg", label="C", u_px=1.0, v_px=1.0))
