"""Photos on the clock of a log without camera events, by what their ties say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import UavgramError
from uavgram.estimation.first_poses.tied.bundle import TiedPoses
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import ENU_FROM_NED, exp_so3
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.flight_log import FlightLog
from uavgram.model.frames import Photos
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise import synchronise
from uavgram.stages.synchronise.boots import usable_boots

OFFSET_S = 4.37
AUTO = TimeOptions(source="exif", offset_s="auto")


@pytest.fixture(scope="module")
def whole(data_dir: Path) -> FlightLog:
    """The log of a copter in wind."""
    return read_flight_log(data_dir / "wind_oblique" / "flight.BIN")


@pytest.fixture(scope="module")
def log(whole: FlightLog) -> FlightLog:
    """The same without its camera events."""
    return replace(whole, boots=tuple(replace(boot, events=None) for boot in whole.boots))


def photographed(log: FlightLog, photos: int) -> tuple[Photos, TiedPoses]:
    """Photos at the first camera events, and what exact ties say of them."""
    (clocked,) = usable_boots(log)
    positions, attitudes, events = (
        clocked.boot.positions,
        clocked.boot.attitudes,
        clocked.boot.events,
    )
    assert positions is not None
    assert attitudes is not None
    assert events is not None
    boot_s = events.time_boot_s[clocked.event_rows()][:photos]
    way = enu_from_geodetic(
        positions.latitude_deg,
        positions.longitude_deg,
        positions.height_m,
        (positions.latitude_deg[0], positions.longitude_deg[0], positions.height_m.min()),
    )
    center = np.stack([np.interp(boot_s, positions.time_boot_s, axis) for axis in way.T], axis=1)
    body, _ = interpolate_rotation(attitudes.time_boot_s, attitudes.ned_from_body_xyzw, boot_s)
    rng = np.random.default_rng(2)
    ground = np.column_stack(
        [rng.uniform(-50, 50, (60, 2)) + center[:, :2].mean(axis=0), 0.0 * np.arange(60)]
    )
    names = tuple(f"p{k}.jpg" for k in range(len(boot_s)))
    taken = Photos(
        frame_id=names,
        path=names,
        width_px=np.full(len(names), 4000.0),
        height_px=np.full(len(names), 3000.0),
        file_time_s=clocked.event_utc_s()[:photos] + OFFSET_S,
        file_time_resolution_s=np.full(len(names), 0.001),
        time_source="exif",
    )
    tied = TiedPoses(
        center=center,
        rotation=ENU_FROM_NED @ body @ exp_so3(np.array([2.9, 0.1, 0.2])),
        point=ground,
        agrees=np.ones(60, dtype=bool),
        spread_rad=1e-4,
    )
    return taken, tied


def test_ties_tell_a_clock_that_no_event_tells(whole: FlightLog, log: FlightLog) -> None:
    photos, tied = photographed(whole, 11)

    placed = synchronise(photos, log, AUTO, lambda: tied)

    frames = placed.frames
    assert frames.matched.all()
    assert abs(frames.clock_offset_s - OFFSET_S) < 0.05  # the ties are exact
    assert frames.clock_offset_sigma_s < 0.2
    ahead = photos.file_time_s - frames.time_utc_s
    np.testing.assert_allclose(ahead, OFFSET_S, atol=0.05)
    assert "time-by-ties" in [message.code for message in placed.messages]


def test_few_photos_are_refused_with_what_to_do(whole: FlightLog, log: FlightLog) -> None:
    photos, tied = photographed(whole, 5)

    with pytest.raises(UavgramError, match=r"join only 5 photos.*Set time\.offset_s"):
        synchronise(photos, log, AUTO, lambda: tied)


def test_photos_that_nothing_joins_are_refused(whole: FlightLog, log: FlightLog) -> None:
    photos, _ = photographed(whole, 8)

    with pytest.raises(UavgramError, match="join only 0 photos"):
        synchronise(photos, log, AUTO, lambda: None)


def test_poses_of_another_flight_are_refused(whole: FlightLog, log: FlightLog) -> None:
    photos, tied = photographed(whole, 11)
    rng = np.random.default_rng(4)
    other = replace(tied, center=tied.center + rng.normal(0.0, 20.0, tied.center.shape) * [1, 1, 0])

    with pytest.raises(UavgramError, match=r"another flight|several offsets"):
        synchronise(photos, log, AUTO, lambda: other)


def test_camera_events_come_first(whole: FlightLog) -> None:
    photos, tied = photographed(whole, 11)

    placed = synchronise(photos, whole, AUTO, lambda: tied)

    assert "time-by-ties" not in [message.code for message in placed.messages]
