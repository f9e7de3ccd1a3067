"""Tracks in the local world: against simulated flights with truth, and conventions by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypedDict, Unpack

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import fit_boot_clock
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.motion.interpolation import SmoothPositions, SmoothRotations
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    BootClock,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
    Track,
)
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed.track import build_track, find_home

CLOCK = BootClock(offset_s=1.7e9, rate=1.0, sigma_s=0.1, source="gps")
ORIGIN = (-35.0, 149.0, 540.0)
TIME = np.arange(10.0, 20.0, 0.5)
N = len(TIME)


class Tables(TypedDict, total=False):
    """Tables that stand in a log instead of the usual ones."""

    positions: PositionSamples | None
    attitudes: AttitudeSamples | None


def boot(
    yaw_deg: float = 0.0,
    gimbal: GimbalSamples | None = None,
    home: HomeSamples | None = None,
    sigmas: EstimatorSigmas | None = None,
    **replaced: Unpack[Tables],
) -> Boot:
    quaternion = Rotation.from_euler("ZYX", [yaw_deg, 0, 0], degrees=True).as_quat()
    usual = Boot(
        positions=PositionSamples(
            time_boot_s=TIME,
            latitude_deg=np.full(N, -35.0),
            longitude_deg=np.full(N, 149.0),
            height_m=np.full(N, 600.0),
            height_home_m=np.full(N, 60.0),
            datum="msl",
            source="POS",
        ),
        attitudes=AttitudeSamples(
            time_boot_s=TIME, ned_from_body_xyzw=np.tile(quaternion, (N, 1)), source="ATT"
        ),
        gimbal=gimbal,
        sigmas=sigmas,
        events=None,
        home=home,
        clocks=(),
    )
    return replace(usual, **replaced)


def gimbal_of(
    frame: Literal["earth", "vehicle"], yaw_deg: float, pitch_deg: float = 0.0, time: Floats = TIME
) -> GimbalSamples:
    n = len(time)
    return GimbalSamples(
        time_boot_s=time,
        roll_rad=np.zeros(n),
        pitch_rad=np.full(n, np.radians(pitch_deg)),
        yaw_rad=np.full(n, np.radians(yaw_deg)),
        yaw_frame=frame,
        source="MNT",
    )


def track_of(
    tables: Boot, mount: MountOptions | None = None, telemetry: TelemetryOptions | None = None
) -> tuple[Track, tuple[Message, ...]]:
    return build_track(
        tables, CLOCK, ORIGIN, mount or MountOptions(), telemetry or TelemetryOptions()
    )


@pytest.mark.parametrize("kind", ["BIN", "tlog"])
@pytest.mark.parametrize(
    ("flight", "rms_m", "most_m", "yaw_deg"),
    [("calm_nadir", 0.21, 0.25, 1.0), ("wind_oblique", 1.0, 1.8, 3.0)],
)
def test_the_twins_tracks_are_as_good_as_the_estimator(
    data_dir: Path, flight: str, kind: str, rms_m: float, most_m: float, yaw_deg: float
) -> None:
    truth = json.loads((data_dir / "truth" / f"{flight}.json").read_text())
    tables = read_flight_log(data_dir / flight / f"flight.{kind}").boots[0]
    clock, _ = fit_boot_clock(tables)
    at = np.array([frame["time_utc_s"] for frame in truth["frames"].values()])
    home, datum, messages = find_home(tables, clock, at.min())
    assert datum == "msl"
    assert messages == ()
    track, _ = build_track(tables, clock, home, MountOptions(), TelemetryOptions())
    world = truth["world"]
    shift = enu_from_geodetic(
        world["latitude_deg"], world["longitude_deg"], world["height_amsl_m"], home
    )
    position, _ = SmoothPositions(track.position_time_s, track.position_world_m).at(at)
    body, _ = SmoothRotations(track.attitude_time_s, track.world_from_body_xyzw).at(at)
    center = position + body @ np.array([0.12, 0.0, 0.08])  # the twins' lever arm
    expected = shift + [frame["center_world_m"] for frame in truth["frames"].values()]
    across = np.linalg.norm((center - expected)[:, :2], axis=1)
    assert np.sqrt(np.mean(across**2)) < rms_m
    assert across.max() < most_m
    assert np.abs(center - expected)[:, 2].max() < 0.5

    camera = np.array([frame["world_from_camera"] for frame in truth["frames"].values()])
    boresight = Rotation.from_rotvec(truth["boresight_rad"]).as_matrix()
    nominal = camera @ boresight.T
    if len(track.gimbal_time_s):
        mount, _ = SmoothRotations(track.gimbal_time_s, track.world_from_gimbal_xyzw).at(at)
    else:
        tilt = Rotation.from_euler("ZYX", [0, -70, 0], degrees=True).as_matrix()
        mount = body @ tilt
    axes = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # camera z forward, x right, y down
    error = Rotation.from_matrix((mount @ axes).transpose(0, 2, 1) @ nominal).magnitude()
    assert np.degrees(error).max() < yaw_deg


def test_yaw_of_90_degrees_points_east() -> None:
    track, _ = track_of(boot(yaw_deg=90))
    nose = Rotation.from_quat(track.world_from_body_xyzw).apply([1, 0, 0])
    np.testing.assert_allclose(nose, np.tile([1, 0, 0], (N, 1)), atol=1e-12)
    down = Rotation.from_quat(track.world_from_body_xyzw).apply([0, 0, 1])
    np.testing.assert_allclose(down, np.tile([0, 0, -1], (N, 1)), atol=1e-12)


def test_positions_are_metres_above_the_origin() -> None:
    track, _ = track_of(boot())
    np.testing.assert_allclose(track.position_world_m, np.tile([0, 0, 60.0], (N, 1)), atol=1e-6)
    assert track.position_time_s[0] == 1.7e9 + 10


@pytest.mark.parametrize(("frame", "axis_deg"), [("earth", 30.0), ("vehicle", 120.0)])
def test_the_gimbals_yaw_is_turned_by_the_vehicles_only_where_it_is_the_vehicles(
    frame: Literal["earth", "vehicle"], axis_deg: float
) -> None:
    track, _ = track_of(boot(yaw_deg=90, gimbal=gimbal_of(frame, 30.0)))
    axis = Rotation.from_quat(track.world_from_gimbal_xyzw).apply([1, 0, 0])[0]
    assert np.degrees(np.arctan2(axis[0], axis[1])) == pytest.approx(axis_deg)


def test_only_the_vehicles_yaw_turns_the_gimbal() -> None:
    tilted = Rotation.from_euler("ZYX", [90, 10, -20], degrees=True).as_quat()
    attitudes = AttitudeSamples(
        time_boot_s=TIME, ned_from_body_xyzw=np.tile(tilted, (N, 1)), source="ATT"
    )
    track, _ = track_of(boot(gimbal=gimbal_of("vehicle", 0.0, -45.0), attitudes=attitudes))
    axis = Rotation.from_quat(track.world_from_gimbal_xyzw).apply([1, 0, 0])[0]
    np.testing.assert_allclose(axis, [np.sqrt(0.5), 0, -np.sqrt(0.5)], atol=1e-12)


def test_a_gimbal_straight_down_has_its_image_up_along_its_yaw() -> None:
    track, _ = track_of(boot(gimbal=gimbal_of("earth", 90.0, -90.0)))
    gimbal = Rotation.from_quat(track.world_from_gimbal_xyzw[0])
    np.testing.assert_allclose(gimbal.apply([1, 0, 0]), [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(gimbal.apply([0, 0, -1]), [1, 0, 0], atol=1e-9)


def test_the_vehicles_yaw_is_that_of_the_gimbals_instant() -> None:
    yaw = np.linspace(0, 90, N)
    attitudes = AttitudeSamples(
        time_boot_s=TIME,
        ned_from_body_xyzw=Rotation.from_euler("Z", yaw[:, None], degrees=True).as_quat(),
        source="ATT",
    )
    at = TIME[:-1] + 0.17
    track, _ = track_of(boot(gimbal=gimbal_of("vehicle", 0, time=at), attitudes=attitudes))
    slerp = Slerp(TIME, Rotation.from_euler("Z", yaw[:, None], degrees=True))
    expected = slerp(at).as_euler("ZYX")[:, 0]
    middle = slice(1, -1)  # the ends are held to the vehicle's span
    axis = Rotation.from_quat(track.world_from_gimbal_xyzw[middle]).apply([1, 0, 0])
    np.testing.assert_allclose(np.arctan2(axis[:, 0], axis[:, 1]), expected, atol=1e-9)


def test_gimbal_none_leaves_the_gimbal_out() -> None:
    tables = boot(gimbal=gimbal_of("earth", 30.0))
    track, _ = track_of(tables, mount=MountOptions(gimbal="none"))
    assert len(track.gimbal_time_s) == 0
    assert "MNT" not in track.source


@pytest.mark.parametrize("frame", ["earth", "vehicle"])
@pytest.mark.parametrize(
    ("mount", "expected_deg"),
    [
        (MountOptions(), (30.0, -60.0, 0.0)),
        (MountOptions(pitch_deg=-45.0), (30.0, -45.0, 0.0)),
        (MountOptions(yaw_deg=90.0), (110.0, -60.0, 0.0)),  # from the nose, which heads to 20
        (MountOptions(yaw_deg=0.0, pitch_deg=-80.0, roll_deg=5.0), (20.0, -80.0, 5.0)),
    ],
)
def test_angles_that_the_project_states_replace_those_of_the_logs_gimbal(
    frame: Literal["earth", "vehicle"],
    mount: MountOptions,
    expected_deg: tuple[float, float, float],
) -> None:
    gimbal = gimbal_of(frame, 30.0 if frame == "earth" else 10.0, -60.0)
    track, messages = track_of(boot(yaw_deg=20.0, gimbal=gimbal), mount=mount)
    found = Rotation.from_quat(track.world_from_gimbal_xyzw)
    from_ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    expected = from_ned * Rotation.from_euler("ZYX", expected_deg, degrees=True)

    assert (found * expected.inv()).magnitude().max() < 1e-9
    stated = [m for m in messages if m.code == "mount-stated"]
    assert len(stated) == (mount != MountOptions())
    if mount == MountOptions(pitch_deg=-45.0):
        assert stated[0].level == "warning"
        assert "own angles (MNT) are up to 15.0 degrees apart" in stated[0].text


@pytest.mark.parametrize(
    ("fixed_deg", "level"), [(-45.0, "warning"), (-58.0, "info")], ids=["contradicts", "agrees"]
)
def test_a_fixed_mount_is_compared_with_the_gimbal_of_the_log(fixed_deg: float, level: str) -> None:
    gimbal = gimbal_of("vehicle", 0.0, -60.0)
    mount = MountOptions(gimbal="none", pitch_deg=fixed_deg)
    track, messages = track_of(boot(yaw_deg=20.0, gimbal=gimbal), mount=mount)
    assert not len(track.gimbal_time_s)
    (stated,) = (m for m in messages if m.code == "mount-stated")
    assert stated.level == level
    assert f"up to {fixed_deg + 60.0:.1f} degrees apart" in stated.text


def test_a_gimbal_that_ends_early_is_held_with_a_warning() -> None:
    track, messages = track_of(boot(gimbal=gimbal_of("earth", 30.0, time=TIME[:8])))
    assert track.gimbal_time_s[-1] == track.attitude_time_s[-1]
    assert [m.code for m in messages] == ["pose-source", "gimbal-held"]


def test_sigmas_have_floors_and_follow_the_log_above_them() -> None:
    stated = EstimatorSigmas(
        time_boot_s=np.array([10.0, 15.0]),
        horizontal_m=np.array([0.2, 1.4]),
        vertical_m=np.array([np.nan, 2.0]),
        tilt_rad=np.radians([0.1, 3.0]),
        yaw_rad=np.array([np.nan, np.nan]),
        source="XKV1",
    )
    track, _ = track_of(boot(sigmas=stated))
    np.testing.assert_allclose(track.sigma_position_m, [[0.5, 0.5], [1.4, 2.0]])
    np.testing.assert_allclose(np.degrees(track.sigma_attitude_rad), [[1, 2], [3, 2]])
    assert track.sigma_time_s.tolist() == [1.7e9 + 10, 1.7e9 + 15]
    silent, _ = track_of(boot())
    np.testing.assert_allclose(silent.sigma_position_m, [[0.5, 0.5]])


def test_sigmas_of_a_fixed_rtk_solution_hold_nearly_as_stated() -> None:
    stated = EstimatorSigmas(
        time_boot_s=np.array([10.0, 13.0, 16.0, 17.0]),
        horizontal_m=np.array([0.07, 0.01, 0.07, 0.2]),  # the last as of a simulator
        vertical_m=np.array([0.12, np.nan, 0.12, 0.3]),
        tilt_rad=np.full(4, np.nan),
        yaw_rad=np.full(4, np.nan),
        is_fixed=np.array([True, True, False, True]),
        source="GPS_RAW_INT",
    )
    track, _ = track_of(boot(sigmas=stated))
    np.testing.assert_allclose(
        track.sigma_position_m, [[0.07, 0.12], [0.03, 0.5], [0.5, 0.5], [0.5, 0.5]]
    )


def test_the_sources_of_the_seeds_are_said() -> None:
    _, messages = track_of(boot(gimbal=gimbal_of("earth", 30.0)))
    text = next(m.text for m in messages if m.code == "pose-source")
    assert "from its records POS, its turns from ATT" in text
    assert "from MNT. Their uncertainties are from the program" in text
    _, messages = track_of(boot(gimbal=gimbal_of("earth", 30.0)), mount=MountOptions(gimbal="none"))
    assert "the mount in the project" in messages[0].text


def test_stated_sigmas_override_the_log() -> None:
    options = TelemetryOptions(position_sigma_m=(0.1, 0.3), attitude_sigma_deg=(0.5, 5.0))
    track, _ = track_of(boot(), telemetry=options)
    np.testing.assert_allclose(track.sigma_position_m, [[0.1, 0.3]])
    np.testing.assert_allclose(np.degrees(track.sigma_attitude_rad), [[0.5, 5.0]])


def test_home_is_the_one_in_force_at_the_first_exposure() -> None:
    home = HomeSamples(
        time_boot_s=np.array([5.0, 12.0, 18.0]),
        latitude_deg=np.array([-35.0, -35.1, -35.2]),
        longitude_deg=np.array([149.0, 149.1, 149.2]),
        height_m=np.array([500.0, 510.0, 520.0]),
        datum="msl",
        source="ORGN",
    )
    place, datum, messages = find_home(boot(home=home), CLOCK, 1.7e9 + 15)
    assert place == (-35.1, 149.1, 510.0)
    assert (datum, messages) == ("msl", ())
    place, _, messages = find_home(boot(home=home), CLOCK, 1.7e9 + 1)
    assert place == (-35.0, 149.0, 500.0)
    assert [m.code for m in messages] == ["home-late"]


def test_without_a_stated_home_the_first_position_lends_its_ground() -> None:
    place, datum, messages = find_home(boot(), CLOCK, 1.7e9 + 15)
    assert place == (-35.0, 149.0, 540.0)
    assert datum == "msl"
    assert [(m.level, m.code) for m in messages] == [("warning", "home-missing")]


def test_the_real_cuav_home_is_the_ground_below_its_first_position(data_dir: Path) -> None:
    tables = read_flight_log(data_dir / "cuav" / "flight.tlog").boots[0]
    clock, _ = fit_boot_clock(tables)
    place, _, messages = find_home(tables, clock, 1533430850.0)
    assert place[2] == pytest.approx(666.910 - 76.231, abs=1e-6)
    assert [m.code for m in messages] == ["home-missing"]


def test_a_log_without_attitude_or_positions_is_refused() -> None:
    with pytest.raises(UavgramError, match="no attitude"):
        track_of(boot(attitudes=None))
    with pytest.raises(UavgramError, match="positions"):
        track_of(boot(positions=None))
    with pytest.raises(UavgramError, match="no positions"):
        find_home(boot(positions=None), CLOCK, 1.7e9)


def test_a_gimbal_of_a_single_row_is_not_left_out_silently() -> None:
    _, messages = track_of(boot(gimbal=gimbal_of("earth", 30.0, time=TIME[:1])))
    assert "gimbal-unused" in [m.code for m in messages]
