"""Photos on the flight's clock: against simulated flights with truth, and what is refused."""

from __future__ import annotations

import json
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
from uavgram.io.photos.catalogue import read_photos
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    ClockSamples,
    FlightLog,
    PositionSamples,
)
from uavgram.model.frames import Photos, TimeSource
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise import synchronise
from uavgram.stages.synchronise.event_times import usable_boots
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import simulate

EPOCH = 1.7e9
CUAV = TimeOptions(
    source="filename", filename_format="%Y%m%d%H%M%S%fZ", offset_s=0.0, offset_sigma_s=0.5
)


def flight(
    event_s: Floats | None = None,
    confirmed: Floats | None = None,
    start: float = 10.0,
    end: float = 400.0,
    gap: tuple[float, float] | None = None,
) -> Boot:
    """A flight with 10 Hz tables on the boot clock, UTC = EPOCH + boot."""
    time = np.arange(start, end, 0.1)
    if gap is not None:
        time = time[(time < gap[0]) | (time > gap[1])]
    n = len(time)
    events = None
    if event_s is not None:
        events = CameraEvents(
            time_boot_s=event_s,
            image_number=np.arange(len(event_s)),
            confirmed=np.ones(len(event_s)) if confirmed is None else confirmed,
            source="TRIG+CAM",
        )
    return Boot(
        positions=PositionSamples(
            time_boot_s=time,
            latitude_deg=np.full(n, -35.0),
            longitude_deg=np.full(n, 149.0),
            height_m=np.full(n, 600.0),
            height_home_m=np.full(n, 60.0),
            datum="msl",
            source="POS",
        ),
        attitudes=AttitudeSamples(
            time_boot_s=time, ned_from_body_xyzw=np.tile([0, 0, 0, 1.0], (n, 1)), source="ATT"
        ),
        gimbal=None,
        sigmas=None,
        events=events,
        home=None,
        clocks=(ClockSamples(time_boot_s=time, utc_s=EPOCH + time, source="gps"),),
    )


def log_of(*boots: Boot) -> FlightLog:
    return FlightLog(
        path="flight.BIN",
        kind="dataflash",
        vehicle="",
        firmware="",
        boots=boots,
        messages=(),
        undulation_m=float("nan"),
        notes=(),
    )


def photos_at(time_s: Floats, resolution: float = 0.001, source: TimeSource = "exif") -> Photos:
    n = len(time_s)
    return Photos(
        frame_id=tuple(f"{k:03d}.jpg" for k in range(n)),
        path=tuple(f"{k:03d}.jpg" for k in range(n)),
        width_px=np.full(n, 10),
        height_px=np.full(n, 10),
        file_time_s=time_s,
        file_time_resolution_s=np.full(n, resolution),
        time_source=source,
    )


def uneven(count: int, seed: int = 1, start: float = 50.0, least: float = 1.2) -> Floats:
    return start + np.cumsum(np.random.default_rng(seed).uniform(least, least + 1.6, count))


@pytest.mark.parametrize("kind", ["BIN", "tlog"])
def test_the_twins_unknown_clock_offset_is_found_from_its_events(data_dir: Path, kind: str) -> None:
    folder = data_dir / "wind_oblique"
    options = TimeOptions(source="exif", offset_sigma_s=0.05)
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), options)
    result = synchronise(photos, read_flight_log(folder / f"flight.{kind}"), options)
    truth = json.loads((data_dir / "truth" / "wind_oblique.json").read_text())
    frames = result.frames
    assert frames.clock_offset_s == pytest.approx(truth["exif_offset_s"], abs=0.005)
    assert frames.clock_offset_sigma_s <= 0.05
    expected = [truth["frames"][name]["time_utc_s"] for name in frames.frame_id]
    assert np.abs(frames.time_utc_s - expected).max() < 0.002
    assert frames.matched.all()


@pytest.mark.parametrize("kind", ["BIN", "tlog"])
def test_the_calm_twins_instants_are_right(data_dir: Path, kind: str) -> None:
    folder = data_dir / "calm_nadir"
    options = TimeOptions(source="exif", offset_s=0.0, offset_sigma_s=0.05)
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), options)
    frames = synchronise(photos, read_flight_log(folder / f"flight.{kind}"), options).frames
    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())
    expected = [truth["frames"][name]["time_utc_s"] for name in frames.frame_id]
    assert np.abs(frames.time_utc_s - expected).max() < 0.002


@pytest.mark.parametrize("kind", ["BIN", "tlog"])
def test_the_calm_twins_even_events_leave_its_offset_open(data_dir: Path, kind: str) -> None:
    # Ten photos, all but two of them 1.52 s apart to the simulator's step of 20 ms.
    folder = data_dir / "calm_nadir"
    options = TimeOptions(source="exif")
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), options)
    with pytest.raises(
        UavgramError, match=r"-0\.00\d s \(10 of 10 photos\).*1\.520 s.*Set time\.offset_s"
    ):
        synchronise(photos, read_flight_log(folder / f"flight.{kind}"), options)


def test_a_stated_offset_leaves_cuavs_late_clock_to_the_adjustment(data_dir: Path) -> None:
    folder = data_dir / "cuav"
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), CUAV)
    result = synchronise(photos, read_flight_log(folder / "flight.tlog"), CUAV)
    frames = result.frames
    assert frames.matched.all()
    np.testing.assert_array_equal(frames.time_utc_s, photos.file_time_s)
    assert frames.clock_offset_s == 0.0
    assert frames.clock_offset_sigma_s == pytest.approx(0.51, abs=0.01)
    assert "clock-receive" in {m.code for m in result.messages}


def test_no_offset_and_no_events_asks_for_an_offset(data_dir: Path) -> None:
    options = TimeOptions(source="filename", filename_format=CUAV.filename_format)
    folder = data_dir / "cuav"
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), options)
    with pytest.raises(UavgramError, match=r"set time\.offset_s"):
        synchronise(photos, read_flight_log(folder / "flight.tlog"), options)


def test_photos_without_times_are_paired_in_order_only_where_counts_agree() -> None:
    events = uneven(20)
    confirmed = np.ones(20)
    confirmed[[3, 9]] = 0
    log = log_of(flight(events, confirmed))
    nothing = np.full(18, np.nan)
    result = synchronise(photos_at(nothing, source="none"), log, TimeOptions())
    np.testing.assert_allclose(result.frames.time_utc_s, EPOCH + events[confirmed > 0], atol=1e-5)
    for count in (17, 19, 20):
        with pytest.raises(UavgramError, match=f"{count} photos and 18 confirmed"):
            synchronise(photos_at(np.full(count, np.nan), source="none"), log, TimeOptions())


def test_evenly_spaced_events_are_refused_with_the_candidates() -> None:
    events = 50 + 2.0 * np.arange(40.0)
    photos = photos_at(EPOCH + events[5:20] + 0.5)
    with pytest.raises(UavgramError, match=r"clearly best: \+0\.500 s \(15 of 15 photos\)"):
        synchronise(photos, log_of(flight(events)), TimeOptions())


def test_three_photos_that_only_one_offset_fits_are_enough() -> None:
    """Any offset fits one photo; of two photos it could be chance."""
    events = 50 + np.array([0.0, 11.7, 33.1])
    photos = photos_at(EPOCH + events + 0.3)
    result = synchronise(photos, log_of(flight(events)), TimeOptions())
    assert result.frames.clock_offset_s == pytest.approx(0.3, abs=0.05)
    with pytest.raises(UavgramError, match=r"clearly best: \+0\.300 s \(2 of 2 photos\)"):
        synchronise(photos_at(EPOCH + events[:2] + 0.3), log_of(flight(events)), TimeOptions())


def test_a_coarse_file_time_takes_the_time_of_its_event() -> None:
    events = uneven(40, least=2.2)
    photos = photos_at(np.floor(EPOCH + events + 0.3), resolution=1.0)
    options = TimeOptions(offset_s=0.0, offset_sigma_s=0.3)
    result = synchronise(photos, log_of(flight(events)), options)
    error = result.frames.time_utc_s - EPOCH - events
    snapped = np.abs(error) < 1e-5
    assert snapped.mean() > 0.9
    assert result.frames.sigma_time_s[snapped].max() < 0.02
    assert "time-aligned" in {m.code for m in result.messages}


def test_a_doubtful_pair_keeps_its_file_time_with_a_sigma_that_covers_it() -> None:
    events = uneven(60, least=2.2)
    events[30] = events[29] + 0.6  # which of the two, a clock of 1 s cannot tell
    photos = photos_at(np.floor(EPOCH + events + 0.3), resolution=1.0)
    result = synchronise(photos, log_of(flight(events)), TimeOptions())
    frames, doubtful = result.frames, [29, 30]
    assert result.pairing is not None
    assert {result.pairing.status[k] for k in doubtful} == {"crowded"}
    assert (frames.sigma_time_s[doubtful] > 0.28).all()
    error = np.abs(frames.time_utc_s - EPOCH - events)
    assert (error[doubtful] < 2 * frames.sigma_time_s[doubtful]).all()
    assert "photo-event-uncertain" in {m.code for m in result.messages}


def test_every_pair_has_its_residual_and_what_stays_alone_is_told_on_both_sides() -> None:
    events = uneven(40, least=2.2)
    confirmed = np.ones(40)
    confirmed[5] = 0  # a trigger without feedback is no event to pair with
    taken = np.delete(np.arange(40), [0, 5, 17, 39])
    photo = np.append(EPOCH + events[taken] + 3.0, EPOCH + 45.0)
    photo[10] += 0.004
    result = synchronise(photos_at(photo), log_of(flight(events, confirmed)), TimeOptions())
    pairing = result.pairing
    assert pairing is not None
    assert pairing.event_index.tolist() == [*taken, -1]
    assert pairing.residual_s[10] == pytest.approx(0.004, abs=2e-4)
    assert np.abs(np.delete(pairing.residual_s[:-1], 10)).max() < 5e-4
    assert np.isnan(pairing.residual_s[-1])
    assert "before the first camera event" in pairing.reason[-1]
    assert pairing.unused_event.tolist() == [0, 17, 39]
    texts = {m.code: m.text for m in result.messages}
    assert "3 camera events have no photo" in texts["event-without-photo"]
    assert "036.jpg" in texts["photo-without-event"]


def test_a_drifting_camera_clock_is_told_and_followed_off_the_events() -> None:
    events = uneven(150, least=2.0)
    drift = 90e-6
    reading = EPOCH + events + 7200.0 + drift * (events - events.mean())
    held = np.delete(events, [2, 147])
    result = synchronise(photos_at(reading), log_of(flight(held, end=600.0)), TimeOptions())
    assert np.abs(result.frames.time_utc_s - EPOCH - events).max() < 1e-3
    assert result.pairing is not None
    assert result.pairing.drift == pytest.approx(drift, abs=3 * result.pairing.drift_sigma)
    assert result.pairing.drift_sigma < 2e-5
    assert "drifting by +" in next(m.text for m in result.messages if m.code == "time-aligned")


def test_the_log_of_another_flight_is_refused_without_a_guess() -> None:
    photos = photos_at(EPOCH + uneven(30, seed=5))
    with pytest.raises(UavgramError, match=r"log of another flight.*Set time\.offset_s"):
        synchronise(photos, log_of(flight(uneven(30, seed=6))), TimeOptions())


@pytest.mark.parametrize("seed", [13, 16])
def test_the_demos_photos_all_find_their_events(seed: int) -> None:
    survey = simulate(Scenario().replace_seed(seed))
    event = survey.log.event_time_s
    photos = photos_at(survey.file_time_utc_s - survey.log.boot_utc_s + EPOCH)
    result = synchronise(photos, log_of(flight(event)), TimeOptions())
    assert result.pairing is not None
    assert set(result.pairing.status) == {"certain"}
    assert np.array_equal(result.pairing.event_index, np.flatnonzero(survey.event_has_photo))
    assert "photo-without-event" not in {m.code for m in result.messages}


def test_a_coarse_file_time_without_events_keeps_its_own_sigma() -> None:
    photos = photos_at(EPOCH + np.array([100.0, 102.0, 105.0]), resolution=1.0)
    options = TimeOptions(offset_s=0.0, offset_sigma_s=0.3)
    frames = synchronise(photos, log_of(flight()), options).frames
    np.testing.assert_allclose(frames.sigma_time_s, 1 / np.sqrt(12))


def test_a_log_of_another_day_names_both_spans_and_the_difference() -> None:
    photos = photos_at(EPOCH + 36000.0 + np.array([100.0, 110.0]))
    with pytest.raises(
        UavgramError, match=r"no photo is from this flight.*wrong by about \+36"
    ) as e:
        synchronise(photos, log_of(flight()), TimeOptions(offset_s=0.0))
    assert "2023-11-15" in str(e.value)  # of the photos
    assert "2023-11-14 22:13:30 UTC" in str(e.value)  # where the log begins


@pytest.mark.parametrize("options", [TimeOptions(), TimeOptions(offset_s=2.0)])
@pytest.mark.parametrize("events", [None, uneven(30, seed=6)])
def test_a_log_of_another_year_is_told_by_both_dates_and_no_seconds(
    options: TimeOptions, events: Floats | None
) -> None:
    photos = photos_at(EPOCH - 3030 * 86400.0 + uneven(30, seed=5))
    with pytest.raises(UavgramError, match="no photo is from this flight") as caught:
        synchronise(photos, log_of(flight(events)), options)

    assert "2015-07-29" in str(caught.value)
    assert "2023-11-14" in str(caught.value)
    assert "wrong by about -3030 days" in str(caught.value)
    assert "26179" not in str(caught.value)  # the seconds between them


def test_photos_of_another_year_that_fit_the_events_are_a_warning_unless_it_is_stated() -> None:
    events = uneven(30, seed=6)
    photos, log = photos_at(EPOCH - 3030 * 86400.0 + events), log_of(flight(events))
    found = {m.code: m.text for m in synchronise(photos, log, TimeOptions()).messages}
    stated = synchronise(photos, log, TimeOptions(offset_s=-3030 * 86400.0))

    assert "2015-07-29" in found["log-of-another-day"]
    assert "2023-11-14" in found["log-of-another-day"]
    assert "log-of-another-day" not in {m.code for m in stated.messages}


def test_a_photo_of_another_year_is_left_out_with_both_dates() -> None:
    photos = photos_at(EPOCH + np.array([100.0, 110.0, -3030 * 86400.0]))
    result = synchronise(photos, log_of(flight()), TimeOptions(source="exif", offset_s=0.0))

    assert result.frames.reason[2] == (
        "taken 3030 days before the log begins "
        "(2015-07-29 22:13:20 UTC, the log 2023-11-14 22:13:30 UTC)"
    )


def test_frames_outside_the_log_or_in_its_gaps_are_unmatched_with_a_reason() -> None:
    photos = photos_at(EPOCH + np.array([5.0, 100.0, 205.0, 210.5, 500.0, np.nan]))
    boot = flight(gap=(200.0, 210.0))
    result = synchronise(photos, log_of(boot), TimeOptions(source="exif", offset_s=0.0))
    frames = result.frames
    assert frames.matched.tolist() == [False, True, False, True, False, False]
    assert frames.reason[1] == ""
    for k, words in ((0, "before the log"), (2, "gap"), (4, "after the log"), (5, "no capture")):
        assert words in frames.reason[k]
    assert np.isnan(frames.time_utc_s[5])
    unmatched = [m for m in result.messages if m.code == "frame-unmatched"]
    assert len(unmatched) == 4


def test_of_several_boots_the_one_with_the_photos_is_taken() -> None:
    first, second = flight(end=100.0), flight(start=200.0, end=400.0)
    photos = photos_at(EPOCH + np.array([250.0, 260.0]))
    result = synchronise(photos, log_of(first, second), TimeOptions(offset_s=0.0))
    assert result.boot is second
    events = uneven(15, start=220.0)
    aligned = synchronise(
        photos_at(EPOCH + events + 3.0), log_of(first, flight(events, start=200.0)), TimeOptions()
    )
    assert aligned.frames.clock_offset_s == pytest.approx(3.0, abs=1e-3)


def test_a_lost_event_leaves_its_photo_with_its_file_time() -> None:
    events = uneven(30)
    photos = photos_at(EPOCH + events + 3.0)
    result = synchronise(photos, log_of(flight(np.delete(events, 12))), TimeOptions())
    np.testing.assert_allclose(result.frames.time_utc_s, EPOCH + events, atol=1e-3)
    assert "photo-without-event" in {m.code for m in result.messages}


def test_a_file_time_was_really_that_much_earlier_than_the_camera_said() -> None:
    photos = photos_at(EPOCH + np.array([100.0, 110.0]) + 3600.0)
    frames = synchronise(photos, log_of(flight()), TimeOptions(offset_s=3600.0)).frames
    np.testing.assert_allclose(frames.time_utc_s, EPOCH + np.array([100.0, 110.0]))
    assert frames.clock_offset_s == 3600.0


# Photos on the clock of a log without camera events, by what their ties say.


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
