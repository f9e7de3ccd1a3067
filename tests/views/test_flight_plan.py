"""Where an end of a line lies, as people walk there from a corner of the area."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from planned_sample import bare_plan, sample_plan

from uavgram.model.arrays import Floats
from uavgram.model.planned import ChosenBy, Gain
from uavgram.views.flight_plan import place_in_area
from uavgram.views.flight_plan_text import plan_lines

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


# A plan on the terminal: what other choices would bring, and what of.


PLAN = sample_plan()


def told(gain: Gain, worst: float) -> list[str]:
    without = np.full(len(PLAN.lines.name), 0.02)
    without[1] = worst
    lines = replace(PLAN.lines, mean_sigma_without=without)
    return plan_lines(replace(PLAN, lines=lines, mean_sigma=0.02, gains=(gain,)))


def test_a_layout_that_bears_a_loss_tells_what_it_bears() -> None:
    gain = Gain(what="5 lines laid to bear a loss best", mean_sigma=0.021, worst_without=0.03)
    assert (
        "  5 lines laid to bear a loss best: ± 2.1 cm, 5 % worse; with its most important line "
        "lost ± 3.0 cm, where in this plan ± 4.3 cm"
    ) in told(gain, 0.043)
    held = [line for line in told(gain, np.nan) if "bear a loss" in line]
    assert held[0].endswith("± 3.0 cm, where in this plan there would be no scale")


def test_the_mean_says_what_it_is_of() -> None:
    """The sample measures an area too, which no mean of metres holds."""
    assert "On average of the lengths expect ± 2.0 cm. Other choices:" in told(
        Gain(what="one more line", mean_sigma=0.02), 0.03
    )
    kinds = replace(PLAN.measurements, unit=("m",) * 4)
    shown = plan_lines(replace(PLAN, measurements=kinds))
    assert any(line.startswith("On average expect") for line in shown)


def test_what_the_lines_were_chosen_for_is_told() -> None:
    def shown(by: ChosenBy, *, wished: bool = True) -> str:
        wanted = PLAN.measurements.wanted_sigma if wished else np.full(4, np.nan)
        measured = replace(PLAN.measurements, wanted_sigma=wanted)
        return "\n".join(plan_lines(replace(PLAN, chosen_by=by, measurements=measured)))

    assert "The lines lie where the average ± is smallest." in shown("mean")
    assert "each is compared with the ± you wish" in shown("shares")
    assert "plain one of the lengths" in shown("shares")
    assert "each is compared with its usual ±" in shown("shares", wished=False)
    assert "lie where" not in "\n".join(plan_lines(bare_plan()))
