"""Control and check points where they should appear, before anybody has picked them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from flight_projects import copy_project
from picking_projects import write_project
from planned_sample import sample_plan, sample_plates
from scipy.stats import chi2

from uavgram.errors import InputError
from uavgram.estimation.measuring.predicted_pixels import PredictedPixels
from uavgram.io.results.command_json import write_plan
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownPoints
from uavgram.model.planned import FlightPlanned, PlannedSite
from uavgram.picking.document.state import Line, Pick, State
from uavgram.picking.session.workers import collect_observations
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.pick.live_survey import LiveSurvey, Observations
from uavgram.pipeline.pick.places import (
    predict_known_places,
    predict_places,
    predict_planned_places,
)
from uavgram.stages.match import CONTRADICTED, Found


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


def standardised(survey: LiveSurvey, places: PredictedPixels) -> Floats:
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


# Planned lines and plates where they should appear in photos, before anybody has marked them.


HIGHER_M = 300.0
"""Who plans at home knows the height of the ground badly, if at all."""


@pytest.fixture(scope="module")
def laid(data_dir: Path) -> tuple[FlightPlanned, dict[str, str]]:
    """A plan of lines between points of a flight, and plates on some; which points these are."""
    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())
    names, places = list(truth["points"]), np.array(list(truth["points"].values()))
    plan, world = sample_plan(), truth["world"]
    count, plan_of_plates = len(plan.lines.name), sample_plates()
    higher = np.array([0.0, 0.0, HIGHER_M])
    lines = replace(
        plan.lines,
        start_world_m=places[:count] + higher,
        end_world_m=places[count : 2 * count] + higher,
    )
    last = places[-2:] + higher - plan_of_plates.center_world_m
    plates = replace(plan_of_plates, corner_world_m=plan_of_plates.corner_world_m + last[:, None])
    labels = dict(zip((*lines.start_label, *lines.end_label), names, strict=False))
    labels |= dict(zip(plates.name, names[-2:], strict=True))
    site = PlannedSite(
        latitude_deg=world["latitude_deg"], longitude_deg=world["longitude_deg"], height_msl_m=0.0
    )
    return replace(plan, lines=lines, plates=plates, site=site), labels


def test_they_are_expected_where_the_points_are(
    data_dir: Path, laid: tuple[FlightPlanned, dict[str, str]]
) -> None:
    plan, point = laid
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    survey = LiveSurvey(replace(live.inputs, planned=plan))
    picks = survey.inputs.picks
    pixel = dict(zip(zip(picks.image, picks.label, strict=True), picks.pixel_px, strict=True))
    known = predict_known_places(survey, None)
    squared = []
    for k, (image, label) in enumerate(zip(known.frame_id, known.label, strict=True)):
        if label in point and (image, point[label]) in pixel:
            off = pixel[image, point[label]] - known.pixel_px[k]
            squared.append(off @ np.linalg.solve(known.covariance_px2[k], off))
    assert len(squared) > 20
    assert set(plan.plates.name) <= set(known.label)
    # one flight's errors are in all of them, so it is no chi-square of as many: none lies outside
    assert max(squared) < chi2.ppf(0.9999, 2)
    assert survey.posed is not None
    found = predict_planned_places(survey.inputs, survey.posed.world)
    assert set(found.world_m[:, 2]) == {survey.inputs.project.ground.height_m}


def test_without_a_plan_nothing_is_expected(data_dir: Path) -> None:
    survey = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    assert survey.posed is not None
    assert predict_planned_places(survey.inputs, survey.posed.world).label == ()


def test_a_plan_that_is_none_is_named_with_the_way_out(planned_project: Path) -> None:
    plan = planned_project.with_name("plan.json")
    plan.write_text('{"type": "FeatureCollection"}\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"plan\.json: is no plan: name the plan\.json"):
        read_inputs(planned_project, unfinished=True)
    plan.unlink()
    with pytest.raises(InputError, match=r"project\.yaml:\d+: plan.*plan\.json"):
        read_inputs(planned_project, unfinished=True)


def test_the_plan_is_among_the_inputs_that_results_name(planned_project: Path) -> None:
    inputs = read_inputs(planned_project, unfinished=True)
    assert inputs.planned is not None
    assert inputs.planned.lines.name == ("L1", "L2", "L3", "L4", "L5")
    assert "plan.json" in {digest.path for digest in inputs.digests}


@pytest.fixture
def planned_project(tmp_path: Path) -> Path:
    project = write_project(tmp_path).path
    write_plan(sample_plan(), tmp_path / "plan.json")
    with project.open("a", encoding="utf-8") as file:
        file.write("plan: plan.json\n")
    return project


# Finds that nobody has accepted give their photos a pose, and contradict a wrong one.


PHOTO, OTHER = "IMG_0027.jpg", "IMG_0028.jpg"


@pytest.mark.parametrize("log", [None, "turned"])
def test_a_photo_with_finds_alone_is_placed_and_a_wrong_find_is_named(
    data_dir: Path, tmp_path: Path, log: str | None
) -> None:
    """Also beside a log whose photos are turned by 180 degrees: it takes no part."""
    street = data_dir / "street_oblique"
    truth = json.loads((data_dir / "truth" / "street_oblique.json").read_text())
    here, there = (truth["pixels"][photo] for photo in (PHOTO, OTHER))
    labels = [
        label
        for label in sorted(here)
        if label[0] in "RP"
        and here[label][2]
        and there.get(label, (0, 0, False))[2]
        and abs(truth["height_above_ground_m"][label]) < 0.02
    ][::3]
    picks = tuple(
        Pick(image=PHOTO, label=one, u_px=here[one][0], v_px=here[one][1], sigma_px=0.5)
        for one in labels
    )
    lines = tuple(
        Line(
            name=f"L{k}",
            start=a,
            end=b,
            length_m=math.dist(truth["points"][a], truth["points"][b]),
            sigma_m=0.01,
        )
        for k, (a, b) in enumerate(pairwise(labels))
    )
    changes = {"mount": {"gimbal": "none", "yaw_deg": 180.0, "pitch_deg": -45.0}} if log else {}
    without = {"log": None, "time": None} if log is None else {}
    files = dict.fromkeys(("picks", "lines", "measure", "control", "check"))
    survey = LiveSurvey.open(
        copy_project(street, tmp_path, **files | changes | without | {"picks": "picks.csv"})
    )
    observed = collect_observations(State(picks=picks, lines=lines))
    last = survey.adjust(observed)
    found = {
        (OTHER, one): Found(k, (there[one][0], there[one][1]), 0.1, 0.95, 5.0)
        for k, one in enumerate(labels[:-1])
    }
    wrong = OTHER, labels[2]
    u, v = found[wrong].pixel_px
    adjusted, contradicted = survey.adjust_with_finds(last, found)
    _, misled = survey.adjust_with_finds(
        last, found | {wrong: Found(2, (u + 12.0, v), 0.1, 0.95, 5.0)}
    )

    assert contradicted == {}
    assert misled[wrong] == CONTRADICTED
    places = predict_places(survey, adjusted, observed.picks)
    assert places is not None
    row = places.pair.index((OTHER, labels[-1]))
    off = places.places.pixel_px[row] - there[labels[-1]][:2]
    assert np.linalg.norm(off) < min(places.radius_px[row], 5.0)
