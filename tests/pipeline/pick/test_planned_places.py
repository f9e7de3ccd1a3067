"""Planned lines and plates where they should appear in photos, before anybody has marked them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from picking_projects import write_project
from planned_sample import sample_plan, sample_plates
from scipy.stats import chi2

from uavgram.errors import InputError
from uavgram.io.results.command_json import write_plan
from uavgram.model.planned import FlightPlanned, PlannedSite
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.pick.places import predict_known_places, predict_planned_places

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
