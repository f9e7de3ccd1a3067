"""Two labels taken for one point, or one for two: all that hangs on them goes along."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.io.tables.measure import REPEATED_POINT_KINDS, points_fault
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.errors import RefusedError
from uavgram.picking.document.history import Session, apply, apply_change
from uavgram.picking.document.state import Line, Pick, State

PHOTOS = ("1.jpg", "2.jpg", "3.jpg")


def pick(photo: int, label: str, u: float = 1.0, **more: Any) -> Pick:  # noqa: ANN401  (of each field its own)
    return replace(Pick(image=PHOTOS[photo - 1], label=label, u_px=u, v_px=2.0), **more)


def match(photo: int, label: str, of: Pick, u: float = 5.0) -> Pick:
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
    before = state(first, match(2, "A", first, 6.0), pick(1, "B", 9.0), pick(3, "B", 4.0))
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
    found = match(2, "A", first, 6.0)
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
        kind=st.sampled_from(sorted(REPEATED_POINT_KINDS)),
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
