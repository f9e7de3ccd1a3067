"""Mission files: pymavlink loads the one, the documented format of the other is held to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planned_sample import HEIGHT_M, in_metres, sample_plan, world_from_camera
from pymavlink import mavutil, mavwp
from qgc_plan_format import PlacedItem, QgcPlan

from uavgram.errors import GeometryError
from uavgram.io.exports.missions import (
    FRAMES,
    Command,
    Frame,
    mission_items,
    qgc_plan_text,
    waypoints_text,
)
from uavgram.model.maps import Autopilot, HeightFrame, Mission
from uavgram.stages.products.planned_layers import flight_mission

MAV = mavutil.mavlink
AUTOPILOTS: tuple[Autopilot, ...] = ("ardupilot", "px4")
PHOTO = {"ardupilot": MAV.MAV_CMD_DO_DIGICAM_CONTROL, "px4": MAV.MAV_CMD_IMAGE_START_CAPTURE}


@pytest.fixture(params=AUTOPILOTS)
def mission(request: pytest.FixtureRequest) -> Mission:
    rng = np.random.default_rng(5)
    return Mission(
        name="crossing",
        autopilot=request.param,
        home=(-33.8567844, 151.2152967, 12.5),
        height_frame="relative",
        latitude_deg=-33.8567844 + rng.normal(0, 1e-4, 9),
        longitude_deg=151.2152967 + rng.normal(0, 1e-4, 9),
        height_m=rng.uniform(20, 60, 9),
        heading_deg=rng.uniform(0, 360, 9),
        gimbal_pitch_deg=np.array([-90.0, -90.0, -80.0, -80.0, -80.0, -60.0, -60.0, -90.0, -90.0]),
        speed_m_s=4.0,
        hold_s=2.0,
        no_go=(
            np.array([[-33.856, 151.215], [-33.856, 151.216], [-33.857, 151.216]]),
            np.array([[-33.859, 151.216], [-33.858, 151.216], [-33.858, 151.215]]),
        ),
    )


def _loaded(mission: Mission, folder: Path) -> list[Any]:
    path = folder / "flight.waypoints"
    path.write_text(waypoints_text(mission), encoding="utf-8")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == len(mission_items(mission)) + 1
    return [loader.wp(row) for row in range(loader.count())]


def _plan(mission: Mission) -> QgcPlan:
    return QgcPlan.model_validate_json(qgc_plan_text(mission))


def _stops(items: list[Any]) -> list[Any]:
    return [item for item in items[1:] if item.command == MAV.MAV_CMD_NAV_WAYPOINT]


def test_every_command_and_frame_has_the_number_of_the_mavlink_dialect() -> None:
    for command in Command:
        assert getattr(MAV, f"MAV_CMD_{command.name}") == command
    for frame in Frame:
        assert getattr(MAV, f"MAV_FRAME_{frame.name}") == frame


def test_pymavlink_reads_stops_as_planned(mission: Mission, tmp_path: Path) -> None:
    items = _loaded(mission, tmp_path)
    home, stops = items[0], _stops(items)
    assert (home.frame, home.current) == (MAV.MAV_FRAME_GLOBAL, 1)
    assert (home.x, home.y, home.z) == pytest.approx(mission.home, abs=1e-7)
    read = np.array([(item.x, item.y, item.z, item.param4, item.param1) for item in stops])
    np.testing.assert_allclose(read[:, 0], mission.latitude_deg, atol=1e-7, rtol=0)
    np.testing.assert_allclose(read[:, 1], mission.longitude_deg, atol=1e-7, rtol=0)
    np.testing.assert_allclose(read[:, 2], mission.height_m, atol=1e-3, rtol=0)
    np.testing.assert_allclose(read[:, 3], mission.heading_deg, atol=1e-5, rtol=0)
    assert set(read[:, 4]) == {mission.hold_s}
    assert {item.frame for item in stops} == {MAV.MAV_FRAME_GLOBAL_RELATIVE_ALT}
    assert [item.seq for item in items] == list(range(len(items)))
    assert sum(item.current for item in items) == 1


def test_each_stop_is_turned_to_before_and_photographed_after(
    mission: Mission, tmp_path: Path
) -> None:
    heading = pitch = np.nan
    taken: list[tuple[float, float]] = []
    before: Any = None
    for item in _loaded(mission, tmp_path)[1:]:
        if item.command == MAV.MAV_CMD_CONDITION_YAW:
            assert (item.param3, item.param4) == (0, 0)  # the short way, not relative
            heading = item.param1
        elif item.command == MAV.MAV_CMD_DO_MOUNT_CONTROL:
            assert item.z == MAV.MAV_MOUNT_MODE_MAVLINK_TARGETING
            pitch = item.param1
        elif item.command == MAV.MAV_CMD_NAV_WAYPOINT and mission.autopilot == "px4":
            heading = item.param4
        elif item.command == PHOTO[mission.autopilot]:
            assert before.command == MAV.MAV_CMD_NAV_WAYPOINT
            is_shot = item.x == 1 if mission.autopilot == "ardupilot" else item.param3 == 1
            assert is_shot
            taken.append((heading, pitch))
        before = item
    planned = np.column_stack([mission.heading_deg, mission.gimbal_pitch_deg])
    np.testing.assert_allclose(taken, planned, atol=1e-5, rtol=0)


def test_nothing_arms_takes_off_lands_or_flies_home(mission: Mission, tmp_path: Path) -> None:
    # and PX4 refuses missions with a command that it does not know (FeasibilityChecker.cpp)
    allowed = {
        *(MAV.MAV_CMD_NAV_WAYPOINT, MAV.MAV_CMD_DO_CHANGE_SPEED, MAV.MAV_CMD_DO_MOUNT_CONTROL),
        PHOTO[mission.autopilot],
    }
    if mission.autopilot == "ardupilot":
        allowed.add(MAV.MAV_CMD_CONDITION_YAW)
    assert {item.command for item in _loaded(mission, tmp_path)} == allowed
    assert {item.command for item in _plan(mission).mission.items} == allowed


def test_the_plan_of_qgroundcontrol_says_the_same(mission: Mission, tmp_path: Path) -> None:
    items, plan = _loaded(mission, tmp_path)[1:], _plan(mission)
    assert plan.mission.plannedHomePosition == mission.home
    assert [item.doJumpId for item in plan.mission.items] == [item.seq for item in items]
    for text, json_item in zip(items, plan.mission.items, strict=True):
        assert (text.command, text.frame) == (json_item.command, json_item.frame)
        read = (text.param1, text.param2, text.param3, text.param4, text.x, text.y, text.z)
        assert read == pytest.approx(json_item.params, abs=5e-4)
        assert isinstance(json_item, PlacedItem) == (text.command == MAV.MAV_CMD_NAV_WAYPOINT)
        if isinstance(json_item, PlacedItem):
            assert json_item.params[6] == json_item.Altitude
            assert json_item.AltitudeMode == plan.mission.globalPlanAltitudeMode == 1


def test_no_go_areas_are_fences_to_keep_out_of(mission: Mission) -> None:
    fences = _plan(mission).geoFence.polygons
    assert [fence.inclusion for fence in fences] == [False, False]
    for fence, ring in zip(fences, mission.no_go, strict=True):
        assert {tuple(corner) for corner in ring.tolist()} == set(fence.polygon)
        # clockwise on a map: each corner turns right
        north, east = np.array(fence.polygon).T
        side_n, side_e = np.roll(north, -1) - north, np.roll(east, -1) - east
        assert (side_e * np.roll(side_n, -1) - side_n * np.roll(side_e, -1) < 0).all()


@pytest.mark.parametrize("height_frame", ["relative", "terrain"])
def test_what_heights_are_above_is_said(
    mission: Mission, tmp_path: Path, height_frame: HeightFrame
) -> None:
    other = replace(mission, height_frame=height_frame)
    modes = {"relative": 1, "terrain": 4}  # QGroundControlQmlGlobal.h
    assert {item.frame for item in _stops(_loaded(other, tmp_path))} == {FRAMES[height_frame]}
    plan = _plan(other)
    assert plan.mission.globalPlanAltitudeMode == modes[height_frame]


def test_a_plan_is_written_where_its_photos_are(tmp_path: Path) -> None:
    planned = sample_plan()
    items = _loaded(flight_mission(planned), tmp_path)
    stops = _stops(items)
    place = in_metres([[stop.y, stop.x] for stop in stops])
    np.testing.assert_allclose(place, planned.frames.center_world_m[:, :2], atol=0.002, rtol=0)
    assert [stop.z for stop in stops] == pytest.approx([HEIGHT_M] * 6, abs=1e-3)
    site = planned.site
    assert items[0].z == pytest.approx(site.height_msl_m + site.ground_height_m, abs=1e-3)
    headed = [world_from_camera(s.param4, planned.flight.gimbal_pitch_deg) for s in stops]
    np.testing.assert_allclose(headed, planned.frames.world_from_camera, atol=1e-6)
    _plan(flight_mission(planned, "px4"))


def test_a_flight_higher_than_allowed_is_no_mission() -> None:
    planned = sample_plan()
    low = replace(planned, flight=replace(planned.flight, max_height_m=HEIGHT_M - 0.5))
    with pytest.raises(GeometryError, match=r"P1 would be taken 40.0 m above the ground.*39.5 m"):
        flight_mission(low)
