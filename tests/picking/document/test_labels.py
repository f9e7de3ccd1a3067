"""Labels exchanged, merged and split: what hangs on a name or a point goes along with it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.io.tables.measure import points_fault
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.history import Session, apply, apply_change
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


# Two labels taken for one point, or one for two: all that hangs on them goes along.


PHOTOS = ("1.jpg", "2.jpg", "3.jpg")


def pick(photo: int, label: str, u: float = 1.0, **more: Any) -> Pick:  # noqa: ANN401  (of each field its own)
    return replace(Pick(image=PHOTOS[photo - 1], label=label, u_px=u, v_px=2.0), **more)


def make_match(photo: int, label: str, of: Pick, u: float = 5.0) -> Pick:
    found: dict[str, Any] = {
        "source": "match",
        "from_image": of.image,
        "from_u_px": of.u_px,
        "from_v_px": of.v_px,
    }
    return pick(photo, label, u, sigma_px=0.1, **found)


def state(*picks: Pick, **more: Any) -> State:  # noqa: ANN401
    return replace(State(picks=picks), **more)


def line(start: str, end: str) -> Line:
    return Line(name="L1", start=start, end=end, length_m=3.0, sigma_m=0.01)


def request(name: str, kind: MeasurementKind, *points: str) -> MeasurementRequest:
    return MeasurementRequest(name=name, kind=kind, points=points)


def seen(found: State) -> set[tuple[str, str, float]]:
    return {(one.image[0], one.label, one.u_px) for one in found.picks}


def test_merged_labels_are_one_point_in_picks_lengths_and_measurements_and_undo_parts_them() -> (
    None
):
    before = state(
        pick(1, "A"),
        pick(2, "B"),
        pick(1, "C"),
        lines=(line("B", "C"),),
        requests=(request("D", "distance", "C", "B"),),
    )
    session = apply(Session(state=before), c.Merge(label="B", into="A"))
    after = session.state
    assert seen(after) == {("1", "A", 1.0), ("2", "A", 1.0), ("1", "C", 1.0)}
    assert (after.lines[0].start, after.requests[0].points) == ("A", ("C", "A"))
    assert apply(session, c.Undo()).state == before


def test_where_both_are_picked_in_a_photo_somebody_says_which_pick_stays() -> None:
    first = pick(1, "A", 1.0)
    before = state(first, make_match(2, "A", first, 6.0), pick(1, "B", 9.0), pick(3, "B", 4.0))
    with pytest.raises(RefusedError, match="are both picked in 1"):
        apply_change(before, c.Merge(label="B", into="A"))
    kept = apply_change(before, c.Merge(label="B", into="A", keep="A"))
    assert seen(kept) == {("1", "A", 1.0), ("2", "A", 6.0), ("3", "A", 4.0)}
    other = apply_change(before, c.Merge(label="B", into="A", keep="B"))
    assert seen(other) == {("1", "A", 9.0), ("3", "A", 4.0)}  # nor what was found from the other


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"lines": (line("A", "B"),)}, "L1"),
        ({"requests": (request("D", "distance", "A", "B"),)}, "D"),
        ({"requests": (request("W", "polyline", "C", "B", "A"),)}, "W"),
        ({"requests": (request("F", "area", "A", "C", "B"),)}, "F"),
    ],
)
def test_what_measures_between_two_labels_keeps_them_apart(
    more: dict[str, Any], named: str
) -> None:
    before = state(pick(1, "A"), pick(2, "B"), pick(1, "C"), **more)
    with pytest.raises(RefusedError, match=f"as two points in {named}"):
        apply_change(before, c.Merge(label="B", into="A"))


@pytest.mark.parametrize(("label", "into"), [("A", "A"), ("A", "X"), ("X", "A")])
def test_a_label_is_merged_into_another_one_that_is_there(label: str, into: str) -> None:
    with pytest.raises(RefusedError):
        apply_change(state(pick(1, "A")), c.Merge(label=label, into=into))


def test_a_height_or_area_of_one_label_is_that_of_the_point_and_two_must_agree() -> None:
    stated: dict[str, Any] = {"height_m": 0.4, "height_sigma_m": 0.02, "area": "verge"}
    nothing: dict[str, Any] = {}
    for one, other in ((stated, nothing), (nothing, stated), (stated, stated)):
        after = apply_change(
            state(pick(1, "A", **one), pick(2, "B", **other)), c.Merge(label="B", into="A")
        )
        assert [(p.height_m, p.height_sigma_m, p.area) for p in after.picks] == [
            (0.4, 0.02, "verge")
        ] * 2
    for two in ({"height_m": 0.5}, {"is_free": True}):
        with pytest.raises(RefusedError, match="not the same height"):
            apply_change(
                state(pick(1, "A", **stated), pick(2, "B", **two)), c.Merge(label="B", into="A")
            )
    with pytest.raises(RefusedError, match="not the same area"):
        apply_change(
            state(pick(1, "A", **stated), pick(2, "B", area="road")), c.Merge(label="B", into="A")
        )


def test_split_picks_are_another_point_which_lengths_do_not_follow() -> None:
    before = state(pick(1, "A"), pick(2, "A"), pick(3, "A"), lines=(line("A", "C"),))
    session = apply(Session(state=before), c.Split(label="A", new="B", images=("2.jpg", "3.jpg")))
    assert [(one.image, one.label) for one in session.state.picks] == [
        ("1.jpg", "A"),
        ("2.jpg", "B"),
        ("3.jpg", "B"),
    ]
    assert session.state.lines == before.lines
    assert apply(session, c.Undo()).state == before


def test_what_was_found_from_a_split_pick_goes_with_it_and_a_split_match_is_a_persons() -> None:
    first = pick(1, "A", 1.0)
    found = make_match(2, "A", first, 6.0)
    before = state(first, found, pick(3, "A", 9.0))
    with_it = apply_change(before, c.Split(label="A", new="B", images=("1.jpg",)))
    assert seen(with_it) == {("1", "B", 1.0), ("2", "B", 6.0), ("3", "A", 9.0)}
    assert with_it.picks[1] == replace(found, label="B")
    alone = apply_change(before, c.Split(label="A", new="B", images=("2.jpg",)))
    assert alone.picks[1] == pick(2, "B", 6.0)


def test_both_sides_of_a_split_keep_the_height_though_one_row_stated_it() -> None:
    before = state(pick(1, "A", height_m=0.4), pick(2, "A"), pick(3, "A", area="verge"))
    for images in (("1.jpg",), ("2.jpg", "3.jpg")):
        after = apply_change(before, c.Split(label="A", new="B", images=images))
        assert {(one.height_m, one.area) for one in after.picks} == {(0.4, "verge")}


@pytest.mark.parametrize(
    ("new", "images", "why"),
    [
        ("C", ("1.jpg",), "a label 'C' already"),
        ("B", ("3.jpg",), "not picked in these photos"),
        ("B", ("1.jpg", "2.jpg"), "no pick of 'A' would be left"),
    ],
)
def test_a_split_that_leaves_nothing_on_one_side_is_refused(
    new: str, images: tuple[str, ...], why: str
) -> None:
    before = state(pick(1, "A"), pick(2, "A"), pick(3, "C"))
    with pytest.raises(RefusedError, match=why):
        apply_change(before, c.Split(label="A", new=new, images=images))


PICKS = st.lists(
    st.tuples(st.integers(1, 3), st.sampled_from("ABC"), st.sampled_from([None, 0.4])),
    min_size=1,
    unique_by=lambda one: one[:2],
).map(lambda rows: tuple(pick(photo, label, height_m=height) for photo, label, height in rows))
REQUESTS = st.lists(
    st.builds(
        MeasurementRequest,
        name=st.just("M"),
        kind=st.sampled_from(("polyline", "skid_speed")),
        points=st.lists(st.sampled_from("ABC"), min_size=2, max_size=4).map(tuple),
    ).filter(lambda one: not points_fault(one)),
    max_size=1,
).map(tuple)


@settings(max_examples=60)
@given(PICKS, REQUESTS, st.sampled_from("ABC"), st.sampled_from("ABC"), st.sampled_from("ABC"))
def test_a_merge_is_done_whole_or_not_at_all(
    picks: tuple[Pick, ...],
    requests: tuple[MeasurementRequest, ...],
    one: str,
    into: str,
    keep: str,
) -> None:
    before = Session(state=State(picks=picks, requests=requests))
    try:
        after = apply(before, c.Merge(label=one, into=into, keep=keep)).state
    except RefusedError:
        return
    keys = [found.key for found in after.picks]
    assert len(keys) == len(set(keys))
    assert one not in {label for _, label in keys}
    assert len({found.height_m for found in after.picks if found.label == into}) <= 1
    assert not any(map(points_fault, after.requests))
