"""Which labels are taken for points of the ground after all."""

from __future__ import annotations

from uavgram.imaging.matching.matched import REASON, Refused
from uavgram.pipeline.match.asked import rather_on_ground
from uavgram.stages.match.found import CONTRADICTED, Found, Missed, Record

FOUND = Found(0, (10.0, 20.0), 0.1, 0.9, 8.0)


def missed(why: str) -> tuple[Missed, ...]:
    return (Missed(0, 8.0, why),)


def test_of_two_photos_the_one_that_shows_a_point_on_the_ground_counts() -> None:
    on_ground = Record({("b", "CAR"): FOUND}, {("c", "CAR"): missed(CONTRADICTED)})
    nowhere = Record({}, {(name, "CAR"): missed(REASON[Refused.NOT_LIKE]) for name in "bc"})

    assert rather_on_ground(on_ground, nowhere) == {"CAR"}
    assert nowhere.with_labels_of(on_ground, {"CAR"}) == on_ground


def test_what_a_photo_shows_above_the_ground_is_not_on_it() -> None:
    on_ground = Record({("b", "ROOF"): FOUND}, {("c", "ROOF"): missed(CONTRADICTED)})

    assert rather_on_ground(on_ground, Record({("c", "ROOF"): FOUND})) == set()


def test_what_most_photos_do_not_show_on_the_ground_is_not_on_it() -> None:
    others = {(name, "ROOF"): missed(REASON[Refused.NOT_LIKE]) for name in "cd"}
    outside = {(name, "ROOF"): missed(REASON[Refused.OUTSIDE]) for name in "ef"}

    assert rather_on_ground(Record({("b", "ROOF"): FOUND}, others), Record()) == set()
    assert rather_on_ground(Record({("b", "ROOF"): FOUND}, outside), Record()) == {"ROOF"}
    assert rather_on_ground(Record({}, others), Record()) == set()
