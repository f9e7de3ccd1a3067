"""Flights: what they show, how long they take, and what is said where none will do."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from plan_scenes import camera
from scipy.spatial.transform import Rotation

from uavgram.errors import GeometryError
from uavgram.model.arrays import Floats
from uavgram.model.planned import FlightPattern, PlanRequest
from uavgram.synthetic.observations import EDGE_PX
from uavgram.synthetic.plan.flights import (
    USABLE_BATTERY_SHARE,
    PlannedCameras,
    compute_footprints,
    find_covering_flights,
    find_visible,
    make_flight,
)
from uavgram.synthetic.plan.scene import Deviation, PlanScene, WantedValues

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


# Photos to be taken: where points appear, what drifts out of them, what they show.


LENS = np.array([2250.0, 2250, 1490, 1120, -0.05, 0.02, 2e-4, -1e-4, 0])
CAMERA = replace(camera(), parameters=LENS)
LOOKING = PlannedCameras(
    np.array([[0.0, -10, 40], [5, 2, 35]]),
    np.array([0.0, 130]),
    np.array([-70.0, -88]),
    np.arange(2.0),
)


def by_opencv(
    cameras: PlannedCameras, frame: int, point: Floats, turn: Floats | None = None
) -> Floats:
    """Pixels by OpenCV: the camera looks north and down, then is turned about up."""
    pitch, heading = np.deg2rad([cameras.pitch_deg[frame], cameras.heading_deg[frame]])
    forward = np.array([0, np.cos(pitch), np.sin(pitch)])
    right = np.array([1.0, 0, 0])
    axes = Rotation.from_euler("z", -heading).as_matrix() @ np.column_stack(
        [right, np.cross(forward, right), forward]
    )
    if turn is not None:
        axes = axes @ Rotation.from_rotvec(turn).as_matrix()
    matrix = np.array([[LENS[0], 0, LENS[2]], [0, LENS[1], LENS[3]], [0, 0, 1]])
    in_camera = (point - cameras.center_m[frame]) @ axes
    pixel, _ = cv2.projectPoints(in_camera, np.zeros(3), np.zeros(3), matrix, LENS[4:])
    return np.asarray(pixel[:, 0], np.float64)


def test_pixels_are_those_of_opencv() -> None:
    point = np.random.default_rng(0).uniform([-15, -12, -1], [15, 12, 1], (30, 3))
    found = find_visible(CAMERA, LOOKING, point, None)
    for frame in range(2):
        np.testing.assert_allclose(
            found.pixel_px[frame], by_opencv(LOOKING, frame, point), atol=1e-6
        )


def test_what_is_certain_stays_in_the_photo_in_95_of_100_flights() -> None:
    """At each edge; a point right at the limit leaves the photo in a twentieth of the flights."""
    rng = np.random.default_rng(1)
    deviation = Deviation(position_m=2.0, attitude_deg=1.8)
    row = np.column_stack([np.linspace(0, 40, 4001), np.zeros(4001), np.zeros(4001)])
    certain = find_visible(CAMERA, LOOKING, row, deviation).certain[0]
    edge = row[certain][[-1]]
    flown, out = 3000, 0
    for _ in range(flown):
        moved = LOOKING._replace(center_m=LOOKING.center_m + 2.0 * rng.standard_normal(3))
        pixel = by_opencv(moved, 0, edge, np.deg2rad(1.8) * rng.standard_normal(3))
        out += int(pixel[0, 0] > CAMERA.width_px - 1 - EDGE_PX)
    assert out / flown == pytest.approx(0.05, abs=0.02)


def test_footprints_end_where_photos_do() -> None:
    scene = PlanScene(calibration=CAMERA, area_m=AREA, slope=np.array([0.02, -0.03]))
    whole, certain = compute_footprints(scene, LOOKING)
    right, bottom = CAMERA.width_px - 1, CAMERA.height_px - 1
    for frame in range(2):
        np.testing.assert_allclose(
            whole[frame][:, 2], scene.on_ground(whole[frame][:, :2])[:, 2], atol=1e-9
        )
        pixel = by_opencv(LOOKING, frame, whole[frame])
        off = np.minimum(np.abs(pixel), np.abs(pixel - [right, bottom])).min(axis=1)
        assert off.max() < 1e-5
        for outline in (whole[frame], certain[frame]):
            x, y = outline[:, :2].T
            assert x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0  # counterclockwise from above
        inside = find_visible(CAMERA, LOOKING, certain[frame], None).certain[frame]
        assert inside.all()
