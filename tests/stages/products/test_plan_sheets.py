"""A plan on paper: the largest scale that fits, and sheets that show everything."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_survey

from uavgram.errors import GeometryError
from uavgram.model.arrays import Floats
from uavgram.model.maps import PAPER_MM, Plan
from uavgram.stages.products.plan_sheets import FOOT_STEPS, find_surveyed_extent, lay_plan


def ground(east_m: float, north_m: float) -> tuple[Floats, Floats]:
    corner = np.array([12.5, -3.25])
    return corner, corner + np.array([east_m, north_m])


def size_of(plan: Plan) -> Floats:
    """Width and height of the frame, on the ground [m]."""
    return np.array(plan.frame_mm[2:]) * plan.scale / 1000


@pytest.mark.parametrize(
    ("east_m", "north_m", "scale"),
    [(18.9, 22.0, 100), (19.1, 22.0, 200), (20.0, 18.9, 100), (1.8, 1.0, 10), (900.0, 40.0, 5000)],
)
def test_it_takes_the_largest_usual_scale_at_which_one_sheet_is_enough(
    east_m: float, north_m: float, scale: int
) -> None:
    plan = lay_plan(ground(east_m, north_m), "a4")

    assert plan.scale == scale
    assert len(plan.sheets) == 1
    assert (size_of(plan) >= [east_m, north_m]).all()


def test_in_feet_an_inch_is_a_round_number_of_feet() -> None:
    plan = lay_plan(ground(36.0, 30.0), "letter", steps=FOOT_STEPS)

    assert plan.scale == 240  # an inch is 20 ft
    assert sorted(plan.paper_mm) == sorted(PAPER_MM["letter"])


def test_sheets_together_show_all_of_it_and_overlap() -> None:
    low, high = ground(50.0, 70.0)
    plan = lay_plan((low, high), "a4", 100)
    first, last = plan.sheets[0], plan.sheets[-1]
    beside, below = plan.sheets[1], plan.sheets[plan.columns]

    assert [sheet.number for sheet in plan.sheets] == list(range(1, plan.columns * plan.rows + 1))
    assert first.west_m <= low[0]
    assert first.north_m >= high[1]
    assert last.east_m >= high[0]
    assert last.south_m <= low[1]
    assert first.east_m - beside.west_m == pytest.approx(plan.overlap_mm * 0.1)
    assert below.north_m - first.south_m == pytest.approx(plan.overlap_mm * 0.1)


def test_too_many_sheets_are_refused_with_the_scale_that_fits() -> None:
    with pytest.raises(GeometryError, match=r"1:10 takes \d+ sheets.*at 1:1000 it fits"):
        lay_plan(ground(150.0, 150.0), "a4", 10)


def test_what_was_measured_lies_in_the_extent_too() -> None:
    result = synthetic_survey.build()
    low, high = find_surveyed_extent(result)
    place = result.points.position_world_m[:, :2]

    assert (low < place.min(axis=0)).all()
    assert (high > place.max(axis=0)).all()
