"""Control and check points where they should appear, before anybody has picked them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownPoints
from uavgram.pipeline.pick.live_survey import LiveSurvey, Observations
from uavgram.pipeline.pick.places import KnownPlaces, predict_known_places


@pytest.fixture(scope="module")
def survey(data_dir: Path) -> LiveSurvey:
    """A flight whose points are known as surveyed, in latitude, longitude and height."""
    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    world = truth["world"]
    enu = np.array(list(truth["points"].values()))
    radius_m = 6_371_000.0  # good to 0.3 % of 150 m
    latitude = world["latitude_deg"] + np.degrees(enu[:, 1] / radius_m)
    east_radius_m = radius_m * np.cos(np.radians(world["latitude_deg"]))
    longitude = world["longitude_deg"] + np.degrees(enu[:, 0] / east_radius_m)
    known = KnownPoints(
        label=tuple(truth["points"]),
        kind="geodetic",
        coordinates=np.column_stack([latitude, longitude, world["height_amsl_m"] + enu[:, 2]]),
        sigma_m=np.full((len(enu), 3), 0.5),
    )
    return LiveSurvey(replace(live.inputs, check=known))


def standardised(survey: LiveSurvey, places: KnownPlaces) -> Floats:
    """Squared distances of picks from where they were expected, in their covariances."""
    picks = survey.inputs.picks
    row = {key: k for k, key in enumerate(zip(picks.image, picks.label, strict=True))}
    keys = zip(places.frame_id, places.label, strict=True)
    pairs = [(k, row[key]) for k, key in enumerate(keys) if key in row]
    mine, theirs = np.array(pairs).T
    off = picks.pixel_px[theirs] - places.pixel_px[mine]
    covariance = places.covariance_px2[mine] + np.eye(2) * 0.8**2
    squared: Floats = np.einsum(
        "ni,ni->n", off, np.linalg.solve(covariance, off[..., None])[..., 0]
    )
    return squared


def test_before_any_pick_the_telemetry_says_where_they_are(survey: LiveSurvey) -> None:
    places = predict_known_places(survey, None)
    distance = standardised(survey, places)
    assert len(distance) > 100
    # All photos share the flight's errors, so it is no chi-square of as many: none lies outside.
    assert distance.max() < chi2.ppf(0.9999, 2)


def test_after_an_adjustment_they_are_known_far_better(survey: LiveSurvey) -> None:
    inputs = survey.inputs
    last = survey.adjust(Observations(picks=inputs.picks, lines=inputs.lines, requests=()))
    before, after = predict_known_places(survey, None), predict_known_places(survey, last)
    assert standardised(survey, after).max() < chi2.ppf(0.9999, 2)
    area = [np.median(np.linalg.det(one.covariance_px2)) for one in (before, after)]
    assert area[1] < area[0]


def test_a_wrong_height_falls_out(survey: LiveSurvey) -> None:
    check = survey.inputs.check
    higher = replace(check, coordinates=check.coordinates + np.array([0.0, 5e-4, 0.0]))
    moved = LiveSurvey(replace(survey.inputs, check=higher))
    assert standardised(moved, predict_known_places(moved, None)).max() > chi2.ppf(0.9999, 2)


def test_without_known_points_or_poses_there_is_nothing_to_expect(
    survey: LiveSurvey, data_dir: Path
) -> None:
    plain = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    assert predict_known_places(plain, None).frame_id == ()
    unposed = LiveSurvey(replace(survey.inputs, log=None))
    assert predict_known_places(unposed, None).frame_id == ()
