"""Flights: what they show, how long they take, and what is said where none will do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plan_scenes import camera

from uavgram.errors import GeometryError
from uavgram.model.planned import FlightPattern, PlanRequest
from uavgram.synthetic.plan.cameras import find_visible
from uavgram.synthetic.plan.flights import USABLE_BATTERY_SHARE, find_covering_flights, make_flight
from uavgram.synthetic.plan.scene import PlanScene
from uavgram.synthetic.plan.wanted import WantedValues

AREA = np.array([[-20.0, -15], [20, -15], [20, 15], [-20, 15]])
SCENE = PlanScene(calibration=camera(), area_m=AREA)
NOTHING = WantedValues((), (), np.zeros((0, 2)))


@pytest.mark.parametrize("pattern", ["single", "strip", "grid", "orbit"])
@pytest.mark.parametrize("pitch", [-90.0, -70.0])
def test_each_photo_looks_at_the_area(pattern: FlightPattern, pitch: float) -> None:
    one = make_flight(SCENE, PlanRequest(area=()), (pattern, 60.0, pitch), 4)
    assert one is not None
    rotation = one.cameras.world_from_camera
    down = rotation[:, :, 2] / -rotation[:, 2:, 2]
    hit = one.cameras.center_m + 60.0 * down
    assert (np.abs(hit[:, :2]) <= [20.01, 15.01]).all()
    np.testing.assert_allclose(one.cameras.center_m[:, 2], 60.0)


def test_a_strip_looks_along_the_long_side_of_a_photo_as_the_area_lies() -> None:
    turn = np.deg2rad(35.0)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    scene = replace(SCENE, area_m=AREA @ axes)
    one = make_flight(scene, PlanRequest(area=()), ("strip", 40.0, -90.0), 3)
    assert one is not None
    way = one.cameras.center_m[-1] - one.cameras.center_m[0]
    image_right = one.cameras.world_from_camera[0, :, 0]
    assert abs(way @ image_right) == pytest.approx(np.linalg.norm(way))
    assert abs(way[:2] @ axes[0]) == pytest.approx(np.linalg.norm(way))


def test_flights_that_cover_show_every_corner_within_the_battery() -> None:
    request = PlanRequest(area=(), patterns=("single", "strip", "grid", "orbit"))
    found = find_covering_flights(SCENE, request, NOTHING)
    assert {one.pattern for one in found} == {"single", "strip", "grid", "orbit"}
    for one in found:
        shown = find_visible(SCENE.calibration, one.cameras, SCENE.on_ground(AREA), SCENE.deviation)
        assert shown.certain.any(axis=0).all()
        assert one.duration_s <= USABLE_BATTERY_SHARE * 60 * request.battery_min
        assert one.height_m <= request.max_height_m


LARGE = 40.0 * AREA


@pytest.mark.parametrize(
    ("area", "changes", "said"),
    [
        (LARGE, {"patterns": ("grid",), "battery_min": 5.0}, "battery's 5 minutes"),
        (10.0 * AREA, {}, "allow the pattern grid"),
        (10.0 * AREA, {"heights_m": (40.0,)}, r"fly higher \(heights_m\), allow the pattern grid"),
        (AREA, {"max_height_m": 8.0}, "exclude each other"),
        (AREA, {"patterns": ("single",), "pitches_deg": (-20.0,)}, "horizon"),
    ],
)
def test_why_no_flight_will_do(area: np.ndarray, changes: dict[str, object], said: str) -> None:
    request = replace(PlanRequest(area=()), **changes)  # type: ignore[arg-type]
    with pytest.raises(GeometryError, match=said):
        find_covering_flights(replace(SCENE, area_m=area), request, NOTHING)


def test_the_drone_keeps_out_of_no_go_polygons() -> None:
    scene = replace(SCENE, no_go_m=(0.2 * AREA,))
    with pytest.raises(GeometryError, match=r"out of bounds .*no_go"):
        find_covering_flights(scene, PlanRequest(area=(), pitches_deg=(-90.0,)), NOTHING)
    for one in find_covering_flights(scene, PlanRequest(area=()), NOTHING):  # from the side
        x, y = one.cameras.center_m[:, :2].T
        assert (np.abs(x) > 4.0).all() or (np.abs(y) > 3.0).all()


def test_steep_ground_is_told_before_a_drone_flies_into_it() -> None:
    scene = replace(SCENE, slope=np.array([0.0, -1.2]))
    request = PlanRequest(area=(), patterns=("strip",), pitches_deg=(-45.0,))
    with pytest.raises(GeometryError, match="steep"):
        find_covering_flights(scene, request, NOTHING)
