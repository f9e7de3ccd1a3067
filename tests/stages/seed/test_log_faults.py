"""Faults planted into clean tracks are found with their size; clean tracks never alarm."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import fit_boot_clock
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import Boot, FlightEvidence, LogFault, Track
from uavgram.model.frames import Frames
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed import seed
from uavgram.stages.seed.log_faults import find_faults, free_priors, report_faults
from uavgram.stages.seed.track import build_track, gather_evidence

RATE_HZ, SPAN_S = 10.0, 60.0
TIME = np.arange(0.0, SPAN_S, 1 / RATE_HZ)
EXPOSURES = np.linspace(10.0, 50.0, 9)
NAMES = tuple(f"{k}.jpg" for k in range(9))
SURE = np.zeros(9)
FRAMES = Frames(
    frame_id=NAMES,
    time_utc_s=EXPOSURES,
    sigma_time_s=SURE,
    matched=np.ones(9, dtype=bool),
    reason=("",) * 9,
    clock_offset_s=0.0,
    clock_offset_sigma_s=0.0,
)


def flown(draw: int = 0, *, wobble_m_s: float = 3.0) -> tuple[Track, FlightEvidence]:
    """A clean flight: smooth ways with noise of centimetres, its velocity and its receiver."""
    rng = np.random.default_rng(draw)
    period, phase = rng.uniform(8, 30, 3), rng.uniform(0, 6, 3)
    pulse = 2 * np.pi / period
    amplitude = wobble_m_s * np.array([1.0, 1.0, 0.2])
    steady = [rng.uniform(-8, 8), rng.uniform(-8, 8), 0.0]

    def place(time: Floats) -> Floats:
        way = amplitude / pulse * np.sin(pulse * time[:, None] + phase)
        return np.asarray(way + np.outer(time, steady) + [0.0, 0.0, 40.0])

    velocity = amplitude * np.cos(pulse * TIME[:, None] + phase) + steady
    angles = 10 * np.sin(0.3 * TIME[:, None] + phase) + rng.normal(0, 0.05, (len(TIME), 3))
    receiver = np.arange(1.0, 59.0, 0.2)
    track = Track(
        position_time_s=TIME,
        position_world_m=place(TIME) + rng.normal(0, 0.02, (len(TIME), 3)),
        attitude_time_s=TIME,
        world_from_body_xyzw=Rotation.from_euler("ZYX", angles, degrees=True).as_quat(),
        gimbal_time_s=np.zeros(0),
        world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=np.zeros(1),
        sigma_position_m=np.full((1, 2), 0.5),
        sigma_attitude_rad=np.radians([[1.0, 2.0]]),
        source="test",
    )
    evidence = FlightEvidence(
        velocity_time_s=TIME,
        velocity_world_m_s=velocity + rng.normal(0, 0.05, velocity.shape),
        receiver_time_s=receiver,
        receiver_world_m=place(receiver - 0.2) + rng.normal(0, 0.4, (len(receiver), 3)),
        turn_time_s=np.zeros(0),
        turn_body_rad_s=np.zeros((0, 3)),
        resets=(),
    )
    return track, evidence


def silent(evidence: FlightEvidence) -> FlightEvidence:
    """Without velocity and receiver."""
    none, rows = np.zeros(0), np.zeros((0, 3))
    return replace(
        evidence,
        velocity_time_s=none,
        velocity_world_m_s=rows,
        receiver_time_s=none,
        receiver_world_m=rows,
    )


def shifted(track: Track, behind: Bools, by: Floats) -> Track:
    return replace(track, position_world_m=track.position_world_m + np.outer(behind, by))


@settings(max_examples=40)
@given(draw=st.integers(0, 10**6), wobble=st.floats(0, 6), blind=st.booleans())
def test_a_clean_flight_never_alarms(draw: int, wobble: float, *, blind: bool) -> None:
    track, evidence = flown(draw, wobble_m_s=wobble)
    assert find_faults(track, silent(evidence) if blind else evidence, EXPOSURES) == ()


@pytest.mark.parametrize("draw", range(4))
def test_noisy_positions_are_no_jumps(draw: int) -> None:
    """A receiver's own, whose noise from row to row exceeds the stated sigma again and again."""
    track, evidence = flown(draw)
    noise = np.random.default_rng(draw).normal(0, 0.4, (len(TIME), 3))
    noisy = replace(track, position_world_m=track.position_world_m + noise)
    assert find_faults(noisy, evidence, EXPOSURES) == ()


def test_a_late_receiver_of_a_fast_aircraft_does_not_lie_apart() -> None:
    track, evidence = flown(wobble_m_s=25.0)
    late = np.clip(evidence.receiver_time_s - 0.4, 0.0, None)
    columns = track.position_world_m.T
    place = np.stack([np.interp(late, TIME, column) for column in columns], axis=1)
    assert find_faults(track, replace(evidence, receiver_world_m=place), EXPOSURES) == ()


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize("by", [(0.7, -0.8, 0.0), (2.0, 2.2, 0.0), (0.0, 0.0, 3.0), (8, 6, 1)])
def test_a_jump_of_place_is_found_with_its_size(by: tuple[float, ...], *, blind: bool) -> None:
    track, evidence = flown()
    jumped = shifted(track, TIME > 31.02, np.array(by))
    (fault,) = find_faults(jumped, silent(evidence) if blind else evidence, EXPOSURES)
    assert fault.kind == "position-jump"
    assert fault.start_s < 31.02 < fault.end_s
    np.testing.assert_allclose(fault.change, by, atol=0.15)


def test_jumps_before_the_first_and_after_the_last_photo_part_none() -> None:
    track, evidence = flown()
    early = shifted(track, TIME > 8.0, np.array([5.0, 0.0, 0.0]))
    late = shifted(track, TIME > 52.0, np.array([5.0, 0.0, 0.0]))
    quiet = replace(evidence, receiver_time_s=np.zeros(0), receiver_world_m=np.zeros((0, 3)))
    assert find_faults(early, quiet, EXPOSURES) == ()
    assert find_faults(late, quiet, EXPOSURES) == ()


def test_a_jump_of_heading_is_found_with_its_size() -> None:
    track, evidence = flown()
    turn = Rotation.from_rotvec(np.outer(TIME > 31.02, [0.0, 0.0, np.radians(12.0)]))
    xyzw = (turn * Rotation.from_quat(track.world_from_body_xyzw)).as_quat()
    evidence = replace(evidence, resets=((31.3, "reset of the heading"),))
    (fault,) = find_faults(replace(track, world_from_body_xyzw=xyzw), evidence, EXPOSURES)
    assert fault.kind == "attitude-jump"
    assert np.degrees(fault.change[2]) == pytest.approx(12.0, abs=0.5)
    assert fault.resets == ("reset of the heading",)
    (message,) = report_faults([fault], evidence, FRAMES)
    assert message.text.startswith("The log's attitude jumps by 12 degrees of heading between")
    assert "reset of the heading" in message.text


def gyroscopes(track: Track, evidence: FlightEvidence) -> FlightEvidence:
    """The evidence with the rates that a track's attitudes have."""
    attitude = Rotation.from_quat(track.world_from_body_xyzw)
    turn = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * RATE_HZ
    body = np.vstack([turn[:1], (turn[1:] + turn[:-1]) / 2, turn[-1:]])
    return replace(evidence, turn_time_s=TIME, turn_body_rad_s=body)


@pytest.mark.parametrize("degrees", [5.0, 10.0, 30.0])
@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.8, 0.0)])
def test_jumps_that_gyroscopes_do_not_feel_are_found(
    degrees: float, axis: tuple[float, ...]
) -> None:
    track, evidence = flown()
    evidence = gyroscopes(track, evidence)
    turn = Rotation.from_rotvec(np.outer(TIME > 31.02, np.radians(degrees) * np.array(axis)))
    xyzw = (turn * Rotation.from_quat(track.world_from_body_xyzw)).as_quat()
    (fault,) = find_faults(replace(track, world_from_body_xyzw=xyzw), evidence, EXPOSURES)
    assert fault.kind == "attitude-jump"
    np.testing.assert_allclose(np.degrees(fault.change), degrees * np.array(axis), atol=0.5)


def test_a_hard_turn_that_the_gyroscopes_tell_is_no_jump() -> None:
    """An aircraft that flips from one lean to the other between two samples."""
    track, evidence = flown()
    roll = np.where(TIME > 31.02, 31.0, 0.0) + 0.3 * TIME
    banked = Rotation.from_euler("x", roll[:, None], degrees=True).as_quat()
    track = replace(track, world_from_body_xyzw=banked)
    assert [f.kind for f in find_faults(track, evidence, EXPOSURES)] == ["attitude-jump"]
    assert find_faults(track, gyroscopes(track, evidence), EXPOSURES) == ()


@pytest.mark.parametrize("blind", [False, True])
def test_a_place_that_stands_still_is_found_and_its_end_is_no_jump(*, blind: bool) -> None:
    track, evidence = flown()
    row = np.arange(len(TIME))
    held = np.where((TIME > 29.0) & (TIME < 32.0), row[TIME > 29.0][0], row)
    frozen = replace(track, position_world_m=track.position_world_m[held])
    (fault,) = find_faults(frozen, silent(evidence) if blind else evidence, EXPOSURES)
    assert fault.kind == "position-frozen"
    assert fault.end_s - fault.start_s == pytest.approx(2.9, abs=0.15)
    way = track.position_world_m[row[TIME < 32.0][-1]] - track.position_world_m[held[310]]
    np.testing.assert_allclose(fault.change, way, atol=3.0 if blind else 0.2)


def test_a_place_that_hardly_moves_while_the_vehicle_flies_is_found() -> None:
    """An estimator that coasts on nothing: centimetres to and fro, 3 s long."""
    track, evidence = flown()
    row = np.arange(len(TIME))
    held = np.where((TIME > 29.0) & (TIME < 32.0), row[TIME > 29.0][0], row)
    noise = np.random.default_rng(0).normal(0, 0.01, (len(TIME), 3))
    frozen = replace(track, position_world_m=track.position_world_m[held] + noise)
    (fault,) = find_faults(frozen, evidence, EXPOSURES)
    assert fault.kind == "position-frozen"
    assert fault.end_s - fault.start_s == pytest.approx(2.9, abs=0.15)


def test_an_attitude_that_hardly_turns_while_the_gyroscopes_do_is_found() -> None:
    track, evidence = flown()
    tilt = 10 * np.sin(TIME)
    rate = np.radians(10 * np.cos(TIME))
    evidence = replace(
        evidence, turn_time_s=TIME, turn_body_rad_s=np.stack([rate, 0 * rate, 0 * rate], axis=1)
    )
    held = np.where((TIME > 30.6) & (TIME < 32.2), 10 * np.sin(30.6), tilt)
    noisy = held + np.random.default_rng(0).normal(0, 0.005, len(TIME))
    stuck, clean = (
        replace(
            track, world_from_body_xyzw=Rotation.from_euler("x", a[:, None], degrees=True).as_quat()
        )
        for a in (noisy, tilt)
    )
    assert find_faults(clean, evidence, EXPOSURES) == ()
    assert [f.kind for f in find_faults(stuck, evidence, EXPOSURES)] == ["attitude-frozen"]


def test_a_repeated_attitude_is_found_once() -> None:
    track, evidence = flown()
    row = np.arange(len(TIME))
    held = np.where((TIME > 29.0) & (TIME < 32.0), row[TIME > 29.0][0], row)
    frozen = replace(track, world_from_body_xyzw=track.world_from_body_xyzw[held])
    (fault,) = find_faults(frozen, evidence, EXPOSURES)
    assert fault.kind == "attitude-frozen"


def test_a_photo_in_a_gap_of_positions_is_found() -> None:
    track, evidence = flown()
    keep = (TIME < 29.0) | (TIME > 32.0)
    cut = replace(
        track,
        position_time_s=TIME[keep],
        position_world_m=track.position_world_m[keep],
    )
    (fault,) = find_faults(cut, evidence, EXPOSURES)
    assert fault.kind == "position-gap"
    assert find_faults(cut, evidence, np.array([10.0, 28.0, 33.0, 50.0])) == ()


@pytest.mark.parametrize(("pause_s", "told"), [(0.0, 0), (0.5, 0), (2.5, 1)])
def test_a_photo_in_a_gap_of_the_gimbal_is_found(pause_s: float, told: int) -> None:
    track, evidence = flown()
    keep = (TIME < 29.0) | (29.0 + pause_s <= TIME)
    cut = replace(
        track,
        gimbal_time_s=TIME[keep],
        world_from_gimbal_xyzw=track.world_from_body_xyzw[keep],
    )
    faults = find_faults(cut, evidence, EXPOSURES)
    assert [fault.kind for fault in faults] == ["gimbal-gap"] * told
    for message in report_faults(faults, evidence, FRAMES):
        assert message.text.startswith("The log states no gimbal direction for 2.6 s")
        assert message.frames == ("4.jpg",)


def test_a_silence_of_vehicle_and_gimbal_is_told_once() -> None:
    track, evidence = flown()
    keep = (TIME < 29.0) | (TIME > 32.0)
    time, xyzw = TIME[keep], track.world_from_body_xyzw[keep]
    cut = replace(
        track,
        attitude_time_s=time,
        world_from_body_xyzw=xyzw,
        gimbal_time_s=time,
        world_from_gimbal_xyzw=xyzw,
    )
    (fault,) = find_faults(cut, evidence, EXPOSURES)
    assert fault.kind == "attitude-gap"
    (message,) = report_faults([fault], evidence, FRAMES)
    assert message.frames == ("4.jpg",)


def test_a_slow_divergence_from_the_receiver_is_found() -> None:
    track, evidence = flown()
    away = np.clip(TIME - 30.0, 0.0, 15.0)[:, None] * [0.6, 0.0, 0.0]
    velocity = evidence.velocity_world_m_s + np.gradient(away, TIME, axis=0)
    drifted = replace(track, position_world_m=track.position_world_m + away)
    (fault,) = find_faults(drifted, replace(evidence, velocity_world_m_s=velocity), EXPOSURES)
    assert fault.kind == "receiver-apart"
    assert fault.start_s > 32.0
    assert fault.horizontal == pytest.approx(9.0, abs=1.5)


def jump(at_s: float, east_m: float) -> LogFault:
    return LogFault(kind="position-jump", start_s=at_s, end_s=at_s + 0.1, change=(east_m, 0.0, 0.0))


def test_the_smaller_side_of_a_jump_is_freed_by_its_size() -> None:
    freed = free_priors([jump(27.0, 3.0)], EXPOSURES, SURE)  # four photos before, five behind
    assert freed.frames.tolist() == [True] * 4 + [False] * 5
    np.testing.assert_allclose(freed.position[0], [9.0, 9.0, 0.0])
    np.testing.assert_allclose(freed.position_bias, [9.0, 9.0, 0.0])


def test_after_a_jump_and_back_only_the_photos_between_are_freed() -> None:
    freed = free_priors([jump(22.0, 3.0), jump(33.0, -3.0)], EXPOSURES, SURE)
    assert np.flatnonzero(freed.frames).tolist() == [3, 4]


def test_a_photo_whose_time_is_too_unsure_to_tell_the_side_is_freed() -> None:
    freed = free_priors([jump(33.0, 3.0)], EXPOSURES, np.full(9, 4.0))
    assert np.flatnonzero(freed.frames).tolist() == [4, 5, 6, 7, 8]


def test_the_seed_and_its_prior_are_wider_by_the_jump() -> None:
    track, _ = flown()
    options = MountOptions(), TelemetryOptions()
    plain = seed(FRAMES, track, *options).prior
    wide = seed(FRAMES, track, *options, [jump(33.0, 3.0)]).prior
    grown = (wide.covariance - plain.covariance)[:, [0, 1, 2], [0, 1, 2]]
    np.testing.assert_allclose(grown[:5], 0.0, atol=1e-12)
    np.testing.assert_allclose(grown[5:], np.tile([9.0, 9.0, 0.0], (4, 1)), atol=1e-9)
    np.testing.assert_allclose(
        wide.position_bias_sigma_m, np.sqrt(plain.position_bias_sigma_m**2 + [9.0, 9.0, 0.0])
    )


def test_the_message_says_how_much_when_and_between_which_photos() -> None:
    evidence = flown()[1]
    (message,) = report_faults([jump(33.0, 3.0)], evidence, FRAMES)
    first = "The log's position jumps by 3.0 m between photo 4.jpg and 5.jpg (00:00:33 UTC)."
    assert message.text.startswith(first)
    assert message.frames == NAMES[5:]
    assert message.level == "warning"
    assert message.code == "log-position-jump"


def test_a_fault_around_all_photos_is_told() -> None:
    away = LogFault(kind="receiver-apart", start_s=1.0, end_s=59.0, change=(9.0, 0.0, 0.0))
    (message,) = report_faults([away], flown()[1], FRAMES)
    first = "The log's position differs by up to 9.0 m from the GPS receiver's own around all "
    assert message.text.startswith(first)
    assert message.frames == NAMES


def test_a_stated_reset_without_a_trace_is_told_and_frees_nothing() -> None:
    evidence = replace(flown()[1], resets=((33.0, "change to another estimator"),))
    (message,) = report_faults([], evidence, FRAMES)
    assert message.level == "info"
    assert "between photo 4.jpg and 5.jpg" in message.text


def real_logs(folder: Path) -> list[Path]:
    kinds = {".tlog", ".bin", ".BIN", ".ulg"}
    return sorted(path for path in folder.rglob("*") if path.suffix in kinds)


def usable(boot: Boot) -> tuple[Track, FlightEvidence, Floats] | None:
    """The track of a boot, what it is held against, and its camera's (else all) instants."""
    if boot.positions is None:
        return None
    place = boot.positions
    origin = float(place.latitude_deg[0]), float(place.longitude_deg[0]), float(place.height_m[0])
    try:
        clock, _ = fit_boot_clock(boot)
        track, _ = build_track(boot, clock, origin, MountOptions(), TelemetryOptions())
    except UavgramError:
        return None
    at = track.position_time_s[[0, -1]]
    if boot.events is not None:
        at = clock.offset_s + clock.rate * boot.events.time_boot_s
    return track, gather_evidence(boot, clock, origin), at


@pytest.mark.parametrize("folder", ["cuav", "calm_nadir", "wind_oblique", "logs"])
def test_undamaged_logs_raise_no_alarm(data_dir: Path, folder: str) -> None:
    """The two boots of one log begin before it knew its height: there it does jump by 590 m."""
    read, found = 0, []
    for path in real_logs(data_dir / folder):
        try:
            boots = read_flight_log(path).boots
        except UavgramError:
            continue
        for boot in boots:
            if (parts := usable(boot)) is not None:
                read += 1
                found += [f for f in find_faults(*parts) if abs(f.change[2]) < 500]
    assert read
    assert not found
