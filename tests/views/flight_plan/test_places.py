"""Where an end of a line lies, as people walk there from a corner of the area."""

from __future__ import annotations

import re

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.views.flight_plan import place_in_area

WAY = re.compile(
    r"([\d.]+) m from corner (\d+) (towards|away from) corner (\d+)"
    r"(?:, then ([\d.]+) m (inwards|outwards))?"
)
ROUNDING_M = 0.05 * np.sqrt(2) + 0.05  # each number to 0.1 m; less than 0.05 m aside is not said


def walked(area_m: Floats, words: str) -> Floats:
    """(2,) where one gets to; inwards is to the left of who goes round against the clock."""
    match = WAY.fullmatch(words)
    assert match, words
    start, towards = area_m[int(match[2]) - 1, :2], area_m[int(match[4]) - 1, :2]
    ahead = (towards - start) / np.linalg.norm(towards - start)
    sign = 1 if match[3] == "towards" else -1
    place = start + sign * float(match[1]) * ahead
    if match[5]:
        is_next = (int(match[4]) - int(match[2])) % len(area_m) == 1
        left = np.array([-ahead[1], ahead[0]]) * (1 if is_next else -1)
        place = place + left * float(match[5]) * (1 if match[6] == "inwards" else -1)
    return np.asarray(place)


SHAPES: dict[str, list[tuple[float, float]]] = {
    "turned rectangle": [(-21.0, -7.0), (16.0, -21.0), (26.0, 7.0), (-11.0, 21.0)],
    "triangle": [(0.0, 0.0), (30.0, 0.0), (4.0, 18.0)],
    "corner house": [(0, 0), (30, 0), (30, 12), (14, 12), (14, 30), (0, 30)],
}


@pytest.mark.parametrize("name", SHAPES)
def test_who_walks_as_told_arrives(name: str) -> None:
    area = np.column_stack([np.array(SHAPES[name], dtype=np.float64), np.zeros(len(SHAPES[name]))])
    rng = np.random.default_rng(7)
    low, high = area.min(axis=0) - 4, area.max(axis=0) + 4
    places = np.concatenate([rng.uniform(low, high, (60, 3)), area, (area[1:] + area[:-1]) / 2])
    for place in places:
        arrived = walked(area, place_in_area(area, place))
        assert np.linalg.norm(arrived - place[:2]) < ROUNDING_M


def test_the_way_along_a_side_is_short() -> None:
    area = np.array([[0, 0, 0], [40, 0, 0], [40, 30, 0], [0, 30, 0]], dtype=np.float64)

    told = place_in_area(area, np.array([38.8, 1.2, 0.0]))
    assert told.startswith("1.2 m from corner 2 towards corner ")
    assert told.endswith("then 1.2 m inwards")
    assert place_in_area(area, np.array([12.0, 30.0, 0.0])) == "12 m from corner 4 towards corner 3"
