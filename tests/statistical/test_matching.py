"""Photos and camera events of random flights: right pairs or a refusal, never a guess."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shutters

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.alignment import align
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.photos.catalogue import read_photos
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise import synchronise
from uavgram.stages.synchronise.event_times import usable_boots

FLIGHTS = 1000


@pytest.mark.statistical
def test_no_wrong_pair_is_certain_and_uneven_spacing_gives_the_right_ones() -> None:
    certain = wrong = 0
    found, there, z = {0.001: 0, 1.0: 0}, {0.001: 0, 1.0: 0}, []
    for seed in range(FLIGHTS):
        case = shutters.make_case(seed)
        result = align(case.photo_s, case.resolution_s, case.event_s)
        has_event = case.truth >= 0
        if result.unique:
            certain += result.certain.sum()
            wrong += (result.certain & (result.event_index != case.truth)).sum()
            moved = case.drift * (result.clock.reference_s - case.middle_s)
            error = result.clock.offset_s - case.offset_s - moved
            z.append(error / result.clock.offset_sigma_s)
        if case.uneven:
            there[case.resolution_s] += has_event.sum()
            right = (result.event_index == case.truth) & has_event
            found[case.resolution_s] += right.sum() if result.unique else 0
    assert wrong == 0
    assert certain > 40_000
    for resolution, count in there.items():
        assert count > 5_000
        assert found[resolution] >= 0.99 * count
    assert np.sqrt(np.mean(np.square(z))) < 1.2


@pytest.mark.statistical
def test_an_even_interval_is_never_guessed() -> None:
    refused = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        exposure = 1.7e9 + np.arange(rng.integers(12, 120), dtype=float) * rng.uniform(0.8, 4.0)
        has_photo, has_event = rng.random((2, len(exposure))) >= 0.1
        event = np.sort(exposure + rng.uniform(0.001, 0.02) * rng.standard_t(3, len(exposure)))
        resolution = rng.choice([0.001, 1.0])
        photo = np.floor((exposure + 3600.3) / resolution) * resolution
        result = align(photo[has_photo], resolution, event[has_event])
        refused += not result.unique
        if not result.unique:
            assert len(result.candidates) > 1
    assert refused == 150
    assert shutters.looks_like_itself(exposure, 0.03) > 0.9


@pytest.mark.statistical
@pytest.mark.parametrize("resolution", [0.001, 1.0])
@pytest.mark.parametrize("kind", ["BIN", "tlog"])
@pytest.mark.parametrize("flight", ["calm_nadir", "wind_oblique"])
def test_photos_dropped_from_a_real_log_are_paired_rightly_or_refused(
    data_dir: Path, flight: str, kind: str, resolution: float
) -> None:
    log = read_flight_log(data_dir / flight / f"flight.{kind}")
    event = usable_boots(log)[0].event_utc_s()
    accepted = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        has_photo = rng.random(len(event)) >= rng.uniform(0, 0.4)
        has_event = rng.random(len(event)) >= rng.uniform(0, 0.15)
        reading = event + rng.normal(0, 0.004, len(event)) + rng.uniform(-14, 14) * 3600
        reading = np.floor(reading / resolution) * resolution
        truth = np.where(has_event, np.cumsum(has_event) - 1, -1)[has_photo]
        result = align(reading[has_photo], resolution, event[has_event])
        accepted += result.unique
        if result.unique:
            assert not (result.certain & (result.event_index != truth)).any()
    if flight == "wind_oblique":  # legs with and against the wind: spacing 1.5 and 4 s
        assert accepted >= 57


@pytest.mark.statistical
@pytest.mark.parametrize("resolution", [0.001, 1.0])
@pytest.mark.parametrize("kind", ["BIN", "tlog"])
@pytest.mark.parametrize("flight", ["calm_nadir", "wind_oblique"])
def test_the_twins_own_photos_thinned_out_and_hours_off_are_right_or_refused(
    data_dir: Path, flight: str, kind: str, resolution: float
) -> None:
    folder = data_dir / flight
    photos, _ = read_photos((str(folder / "photos" / "*.jpg"),), TimeOptions(source="exif"))
    log = read_flight_log(folder / f"flight.{kind}")
    frames = json.loads((data_dir / "truth" / f"{flight}.json").read_text())["frames"]
    truth = np.array([frames[name]["time_utc_s"] for name in photos.frame_id])
    refused = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        kept = np.sort(rng.permutation(len(truth))[: rng.integers(6, len(truth) + 1)])
        reading = photos.file_time_s[kept] + rng.uniform(-14, 14) * 3600
        thinned = replace(
            photos,
            frame_id=tuple(photos.frame_id[k] for k in kept),
            path=tuple(photos.path[k] for k in kept),
            width_px=photos.width_px[kept],
            height_px=photos.height_px[kept],
            file_time_s=np.floor(reading / resolution) * resolution,
            file_time_resolution_s=np.full(len(kept), resolution),
        )
        try:
            result = synchronise(thinned, log, TimeOptions()).frames
        except UavgramError as error:
            if "Set time.offset_s" not in str(error):
                raise
            refused += 1
            continue
        apart = np.abs(result.time_utc_s - truth[kept])
        assert (apart <= 4 * np.hypot(result.sigma_time_s, 0.002)).all()
    if flight == "wind_oblique" and resolution < 0.1:
        assert refused <= 3
