"""Photo poses in the local world: origin, attitudes stated and guessed, sigmas, seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypedDict, Unpack

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.errors import UavgramError
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.motion.camera_motion import exposures_by_time
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames, PhotoExposures, PhotoPoses
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed import seed
from uavgram.stages.seed.photo_exposures import find_photo_home, place_photos

ORIGIN = (46.84, -91.99, 160.0)
# out north along one line, over to the next, back south along it
ROUTE = np.array(
    [[0, 0], [0, 20], [0, 40], [0, 60], [30, 60], [30, 40], [30, 20], [30, 0]], dtype=float
)


class Changes(TypedDict, total=False):
    """What other photos say."""

    height_home_m: Floats
    time_utc_s: Floats
    sigma_horizontal_m: Floats
    sigma_vertical_m: Floats
    sigma_attitude_rad: Floats
    vehicle_ypr_rad: Floats
    height_m: Floats


@pytest.fixture
def make_poses() -> Callable[..., PhotoPoses]:
    def make(
        route: Floats = ROUTE,
        ypr_deg: tuple[float, float, float] = (np.nan,) * 3,
        **changes: Unpack[Changes],
    ) -> PhotoPoses:
        count = len(route)
        enu = np.column_stack([route, np.full(count, 40.0)])
        latitude, longitude, height = geodetic_from_enu(enu, ORIGIN)
        unknown = np.full(count, np.nan)
        poses = PhotoPoses(
            frame_id=tuple(f"p{k}.jpg" for k in range(count)),
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=height,
            height_home_m=np.full(count, 40.0),
            datum="msl",
            datum_guess="",
            time_utc_s=unknown,
            ypr_rad=np.radians(np.tile(ypr_deg, (count, 1))),
            vehicle_ypr_rad=np.full((count, 3), np.nan),
            sigma_horizontal_m=unknown,
            sigma_vertical_m=unknown,
            sigma_attitude_rad=unknown,
            source="test",
        )
        return replace(poses, **changes)

    return make


def place(
    poses: PhotoPoses,
    mount: MountOptions | None = None,
    telemetry: TelemetryOptions | None = None,
) -> tuple[PhotoExposures, tuple[Message, ...]]:
    return place_photos(poses, ORIGIN, mount or MountOptions(), telemetry or TelemetryOptions())


def headings_deg(exposures: PhotoExposures) -> Floats:
    """Where image up points, seen from above, for a camera that looks down."""
    up = -exposures.world_from_gimbal[:, :, 2]
    degrees: Floats = np.degrees(np.arctan2(up[:, 0], up[:, 1]))
    return np.round(degrees, 3) % 360


def test_home_is_below_the_first_photo_at_altitude_minus_relative_altitude(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    poses = make_poses()
    origin, messages = find_photo_home(poses)

    assert origin == pytest.approx((poses.latitude_deg[0], poses.longitude_deg[0], 160.0))
    assert "p0.jpg" in messages[0].text
    assert "msl" in messages[0].text


def test_without_relative_altitude_there_is_no_home_and_the_way_out_is_told(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    with pytest.raises(UavgramError, match=r"set world\.origin"):
        find_photo_home(make_poses(height_home_m=np.full(8, np.nan)))


def test_positions_are_those_of_the_world(make_poses: Callable[..., PhotoPoses]) -> None:
    exposures, _ = place(make_poses(ypr_deg=(0, -90, 0)))

    np.testing.assert_allclose(exposures.position_world_m[:, :2], ROUTE, atol=1e-6)
    np.testing.assert_allclose(exposures.position_world_m[:, 2], 40.0, atol=1e-6)


def test_the_gimbal_looks_where_its_angles_say(make_poses: Callable[..., PhotoPoses]) -> None:
    exposures, messages = place(make_poses(ypr_deg=(30, -20, 0)))
    axis = exposures.world_from_gimbal[0][:, 0]

    tilt, yaw = np.radians(20), np.radians(30)
    expected = [np.cos(tilt) * np.sin(yaw), np.cos(tilt) * np.cos(yaw), -np.sin(tilt)]
    np.testing.assert_allclose(axis, expected, atol=1e-12)
    assert messages == ()


def test_sigmas_default_to_three_metres_and_degrees_and_stated_ones_win(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    sigma = np.array([0.05, *[np.nan] * 7])
    poses = make_poses(ypr_deg=(0, -90, 0), sigma_horizontal_m=sigma, sigma_attitude_rad=sigma)
    exposures, _ = place(poses)

    np.testing.assert_allclose(exposures.sigma_position_m[:2], [[0.05, 3.0], [3.0, 3.0]])
    np.testing.assert_allclose(exposures.sigma_attitude_rad[0], 0.05)
    np.testing.assert_allclose(exposures.sigma_attitude_rad[1], np.radians([3.0, 3.0]))
    options = TelemetryOptions(position_sigma_m=(1.0, 2.0), attitude_sigma_deg=(4.0, 5.0))
    asked, _ = place(poses, telemetry=options)
    np.testing.assert_allclose(asked.sigma_position_m, np.tile([1.0, 2.0], (8, 1)))
    np.testing.assert_allclose(asked.sigma_attitude_rad[0], np.radians([4.0, 5.0]))


def test_a_bias_that_drowns_rtk_is_told(make_poses: Callable[..., PhotoPoses]) -> None:
    centimetres = np.full(8, 0.05)
    poses = make_poses(
        ypr_deg=(0, -90, 0), sigma_horizontal_m=centimetres, sigma_vertical_m=2 * centimetres
    )
    _, messages = place(poses)

    assert [m.code for m in messages] == ["position-bias-wide"]
    assert "to [0.05, 0.10]" in messages[0].text
    _, quiet = place(poses, telemetry=TelemetryOptions(position_bias_sigma_m=(0.05, 0.1)))
    assert quiet == ()


def test_the_course_is_no_heading_as_drones_fly_backwards_too(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    exposures, messages = place(make_poses(time_utc_s=np.arange(8.0)))

    assert exposures.by_mount.all()
    np.testing.assert_allclose(np.degrees(exposures.sigma_attitude_rad), [[6.0, 180.0]] * 8)
    assert [m.code for m in messages] == ["attitude-unknown"]
    assert "8 photos (the first is p0.jpg)" in messages[0].text


@pytest.mark.parametrize("nose_deg", [None, 70.0])
def test_angles_that_the_project_states_replace_those_of_the_tags(
    make_poses: Callable[..., PhotoPoses], nose_deg: float | None
) -> None:
    vehicle = np.full((8, 3), np.nan if nose_deg is None else np.radians(nose_deg))
    vehicle[:, 1:] *= 0.1  # a vehicle that leans: a gimbal does not
    poses = make_poses(ypr_deg=(50.0, -90.0, 0.0), vehicle_ypr_rad=vehicle)
    turned, messages = place(poses, mount=MountOptions(yaw_deg=180.0))
    raised, _ = place(poses, mount=MountOptions(pitch_deg=-30.0))

    np.testing.assert_allclose(headings_deg(turned), (nose_deg or 50.0) + 180.0, atol=1e-3)
    axis = raised.world_from_gimbal[:, :, 0]
    np.testing.assert_allclose(axis[:, 2], -0.5)
    np.testing.assert_allclose(np.degrees(np.arctan2(axis[:, 0], axis[:, 1])), 50.0)
    assert [(m.code, m.level) for m in messages] == [("mount-stated", "warning")]
    np.testing.assert_allclose(np.degrees(turned.sigma_attitude_rad), 3.0)


def test_without_a_gimbal_the_tags_of_the_drone_state_the_heading(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    vehicle = np.radians(np.tile([70.0, -12.0, 4.0], (8, 1)))
    exposures, messages = place(make_poses(vehicle_ypr_rad=vehicle))

    np.testing.assert_allclose(headings_deg(exposures), 70.0, atol=1e-3)
    np.testing.assert_allclose(exposures.world_from_gimbal[:, 2, 0], -1.0)  # level, straight down
    np.testing.assert_allclose(np.degrees(exposures.sigma_attitude_rad), [[6.0, 15.0]] * 8)
    assert [m.code for m in messages] == ["attitude-from-course"]


def test_a_photo_without_a_believed_altitude_is_placed_and_free_in_height(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    poses = make_poses(height_home_m=np.full(8, np.nan))
    height = np.array(poses.height_m)
    height[2] = np.nan
    stated = TelemetryOptions(position_sigma_m=(0.5, 0.5))
    exposures, _ = place(replace(poses, height_m=height))
    tight, _ = place(replace(poses, height_m=height), telemetry=stated)
    all_free, _ = place(replace(poses, height_m=np.full(8, np.nan)))

    np.testing.assert_allclose(exposures.position_world_m[:, :2], ROUTE, atol=1e-6)
    np.testing.assert_allclose(exposures.position_world_m[:, 2], 40.0, atol=1e-3)
    assert exposures.sigma_position_m[2].tolist() == [3.0, 1000.0]
    assert tight.sigma_position_m[1:3].tolist() == [[0.5, 0.5], [0.5, 1000.0]]
    np.testing.assert_allclose(all_free.position_world_m[:, 2], 60.0, atol=1e-3)


def test_an_oblique_camera_without_attitude_has_an_unknown_heading(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    exposures, _ = place(make_poses(), mount=MountOptions(pitch_deg=-20.0))

    down = exposures.world_from_gimbal[:, 2, 0]
    np.testing.assert_allclose(down, -np.sin(np.radians(20.0)))
    np.testing.assert_allclose(np.degrees(exposures.sigma_attitude_rad), [[6.0, 180.0]] * 8)


def test_photos_without_the_drones_heading_stay_in_and_are_told(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    vehicle = np.zeros((8, 3))
    vehicle[5:] = np.nan
    exposures, messages = place(make_poses(vehicle_ypr_rad=vehicle))

    assert len(exposures.frame_id) == 8
    yaw = np.degrees(exposures.sigma_attitude_rad[:, 1])
    np.testing.assert_allclose(yaw, [15] * 5 + [180] * 3)
    assert [m.code for m in messages] == ["attitude-from-course", "attitude-unknown"]


def test_stated_sigmas_hold_for_a_guessed_attitude_too_but_make_it_no_better(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    poses = make_poses(vehicle_ypr_rad=np.zeros((8, 3)))
    wide, _ = place(poses, telemetry=TelemetryOptions(attitude_sigma_deg=(4.0, 120.0)))
    sharp, _ = place(poses, telemetry=TelemetryOptions(attitude_sigma_deg=(4.0, 2.0)))

    np.testing.assert_allclose(np.degrees(wide.sigma_attitude_rad), [[4.0, 120.0]] * 8)
    np.testing.assert_allclose(np.degrees(sharp.sigma_attitude_rad[0]), [4.0, 15.0])


@pytest.mark.parametrize(("pitch_deg", "scatter"), [((-45.0, -45.0), 0.0), ((-35.0, -55.0), 10.0)])
def test_a_photo_without_attitude_is_as_steep_as_the_others_as_far_as_these_agree(
    make_poses: Callable[..., PhotoPoses], pitch_deg: tuple[float, float], scatter: float
) -> None:
    angles = [(20.0, pitch, 0.0) for pitch in 2 * pitch_deg] + [(np.nan,) * 3]
    poses = replace(make_poses(ROUTE[:5]), ypr_rad=np.radians(angles))
    exposures, messages = place(poses)
    stated, _ = place(poses, MountOptions(pitch_deg=-60.0))

    optical_axis = exposures.world_from_gimbal[4][:, 0]
    np.testing.assert_allclose(np.degrees(np.arcsin(optical_axis[2])), -45.0)
    np.testing.assert_allclose(stated.world_from_gimbal[4][2, 0], -np.sin(np.radians(60.0)))
    tilt, yaw = np.degrees(exposures.sigma_attitude_rad[4])
    assert (tilt, yaw) == (pytest.approx(np.hypot(6.0, scatter)), 180.0)
    np.testing.assert_allclose(np.degrees(stated.sigma_attitude_rad[4]), [6.0, 180.0])
    assert "by the other photos and `mount`" in messages[0].text


def test_exposures_of_photos_stand_still_and_go_by_name(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    exposures, _ = place(make_poses(ypr_deg=(0, -90, 0)))
    found = exposures_by_time(exposures, ("p5.jpg", "p1.jpg"))(np.array([1e9, np.nan]))

    np.testing.assert_allclose(found.position, exposures.position_world_m[[5, 1]])
    assert not found.velocity.any()
    assert not found.mount_rate.any()


def test_seeds_carry_the_stated_sigmas_and_what_is_shared(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    exposures, _ = place(make_poses(ypr_deg=(30, -60, 0)))
    frames = Frames(
        frame_id=(*exposures.frame_id, "lost.jpg"),
        time_utc_s=np.full(9, np.nan),
        sigma_time_s=np.full(9, np.nan),
        matched=np.array([True] * 8 + [False]),
        reason=("",) * 8 + ("no pose",),
        clock_offset_s=0.0,
        clock_offset_sigma_s=1.0,
    )
    mount = MountOptions(lever_arm_m=(0.5, 0.0, 0.0), boresight_sigma_deg=2.0)
    seeds = seed(frames, exposures, mount, TelemetryOptions())

    # the lever arm is forward in the vehicle, which is level and heads as the camera does
    yaw = np.radians(30)
    offset = 0.5 * np.array([np.sin(yaw), np.cos(yaw), 0.0])
    np.testing.assert_allclose(
        seeds.poses.center_world_m, exposures.position_world_m + offset, atol=1e-9
    )
    # yaw 30, pitch -60 by another library: camera axes of an intrinsic z-y-x gimbal
    ned = Rotation.from_euler("ZYX", [30, -60, 0], degrees=True).as_matrix()
    forward_enu = ned[:, 0][[1, 0, 2]] * [1, 1, -1]
    np.testing.assert_allclose(seeds.poses.world_from_camera[0][:, 2], forward_enu, atol=1e-12)
    own, marginal = seeds.prior.covariance[0], seeds.poses.covariance[0]
    # three degrees about any axis swing the camera across its lever arm
    swing = np.radians(3.0) ** 2 * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    np.testing.assert_allclose(own[:3, :3], 9.0 * np.eye(3) + swing, atol=1e-12)
    np.testing.assert_allclose(np.diag(own)[3:], np.radians(3.0) ** 2)
    assert marginal[2, 2] == pytest.approx(9.0 + 3.0**2 + 0.1**2 + swing[2, 2])
    # tilt about the camera's x: own 3 degrees, boresight 2; the heading bias turns about up
    assert marginal[3, 3] == pytest.approx(np.radians(3) ** 2 + np.radians(2) ** 2)


def test_without_a_believed_altitude_heights_count_from_take_off(
    make_poses: Callable[..., PhotoPoses],
) -> None:
    poses = replace(make_poses(), height_m=np.full(8, np.nan))
    origin, _ = find_photo_home(poses)
    exposures, _ = place_photos(poses, origin, MountOptions(), TelemetryOptions())

    low = (*ORIGIN[:2], ORIGIN[2] - 30.0)  # the scene, below take-off
    one = replace(make_poses(), height_m=np.array([np.nan, *make_poses().height_m[1:]]))
    by_others, _ = place_photos(one, low, MountOptions(), TelemetryOptions())

    np.testing.assert_allclose(by_others.position_world_m[:, 2], 70.0, atol=1e-3)
    assert origin[2] == 0.0
    np.testing.assert_allclose(exposures.position_world_m[:, 2], 40.0, atol=1e-3)
    np.testing.assert_allclose(exposures.sigma_position_m, 3.0)
