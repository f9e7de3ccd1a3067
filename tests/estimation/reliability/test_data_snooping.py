"""Suspected observations, and those that no test separates from them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import make_scene
from scipy.spatial.transform import Rotation
from whole_surveys import with_all

from uavgram.estimation.reliability.data_snooping import find_suspicions
from uavgram.estimation.reliability.redundancy import (
    MIN_REDUNDANCY,
    MIN_SUSPECT_REDUNDANCY,
    compute_critical_value,
    compute_test_statistics,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.names import ObservationNames
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.survey import Survey
from uavgram.stages.refine.minima import Participants, find_best_minima

ALPHA = 0.001
PAIRS = ((0, 6), (1, 7), (2, 8), (3, 9), (4, 10), (5, 11))
ALONE: dict[str, Any] = {
    "frames": 1,
    "telemetry": False,
    "gauge": "plane",
    "tilt": 0.4,
    "ends": PAIRS,
}


def suspected(survey: Survey) -> tuple[Adjustment, list[Suspicion]]:
    """The adjustment of every observation, gross errors among them, and what it suspects."""
    adjustment = with_all(survey).adjustment
    return adjustment, list(find_suspicions(adjustment, compute_test_statistics(adjustment), ALPHA))


def changed(survey: Survey, name: str, index: int, by: Floats | float) -> Survey:
    values = np.array(getattr(survey, name))
    values[index] += by
    change: dict[str, Any] = {name: values}
    return replace(survey, **change)


def test_in_one_frame_a_length_and_the_picks_of_its_ends_are_one_group() -> None:
    survey = make_scene(3, sources=("pixels", "lengths"), **ALONE).survey
    survey = replace(survey, line_name=("a", "b", "c", "d", "e", "f"))
    adjustment, (found, *_) = suspected(changed(survey, "length_m", 1, 0.5))
    assert found.suspect == Member("lengths", 1, 0)
    assert {(m.kind, m.row) for m in found.group} == {("pixels", 1), ("pixels", 7)}
    names = ObservationNames(adjustment)
    assert names.group(found) == "length 'b' ('P1' to 'P7') or the picks of 'P1' and 'P7' in 'f0'"
    assert names.advice(found) == (
        f"The fault may be in the {names.group(found)}; the numbers cannot show in which. "
        "Check all three."
    )


def test_a_wrong_pick_of_an_end_is_in_the_group_that_is_named() -> None:
    survey = make_scene(3, sources=("pixels", "lengths"), **ALONE).survey
    along = survey.pixel_px[8] - survey.pixel_px[2]
    _, (found, *_) = suspected(changed(survey, "pixel_px", 8, 40.0 * along / np.linalg.norm(along)))
    assert ("pixels", 8) in {(m.kind, m.row) for m in (found.suspect, *found.group)}


def test_in_several_frames_a_length_stands_alone() -> None:
    survey = make_scene(6, frames=6, lines=8).survey
    _, (found, *_) = suspected(changed(survey, "length_m", 2, 0.5))
    assert found.suspect == Member("lengths", 2, 0)
    assert found.group == ()


def test_with_one_redundancy_all_lengths_that_anything_checks_are_one_group() -> None:
    options = {**ALONE, "labels": 8, "ends": ((0, 4), (1, 5), (2, 6), (3, 7))}
    survey = make_scene(5, sources=("pixels", "lengths"), **options).survey
    adjustment, (found, *_) = suspected(changed(survey, "length_m", 3, 1.0))
    lengths = {m.row for m in (found.suspect, *found.group) if m.kind == "lengths"}
    redundancy = compute_test_statistics(adjustment)["lengths"].redundancy[:, 0]
    # A length that hardly anything checks is no suspect of its own, but may be the wrong one.
    assert redundancy[found.suspect.row] > MIN_SUSPECT_REDUNDANCY > redundancy[1] > MIN_REDUNDANCY
    assert lengths == {0, 1, 2, 3}


def test_once_one_is_suspected_the_rest_is_tested_without_it() -> None:
    # The statistics given the first suspicion are those of an adjustment without it.
    survey = make_scene(6, frames=3, lines=8).survey
    wrong = changed(changed(survey, "length_m", 2, 0.3), "length_m", 5, -0.2)
    adjustment, found = suspected(wrong)
    w = np.abs(compute_test_statistics(adjustment)["lengths"].w[:, 0])
    assert [s.suspect for s in found[:2]] == [Member("lengths", 2, 0), Member("lengths", 5, 0)]
    without = replace(
        wrong,
        line_start=np.delete(wrong.line_start, 2),
        line_end=np.delete(wrong.line_end, 2),
        length_m=np.delete(wrong.length_m, 2),
        length_sigma_m=np.delete(wrong.length_sigma_m, 2),
    )
    again = with_all(without).adjustment
    assert found[1].w == pytest.approx(compute_test_statistics(again)["lengths"].w[4, 0], rel=0.02)
    assert w[2] == pytest.approx(abs(found[0].w))


def test_a_gimbal_six_sigma_off_in_one_frame_is_flagged_not_absorbed() -> None:
    flagged, above = 0, 0
    for seed in range(10):
        survey = make_scene(20 + seed, frames=6, labels=14, spread=7.0, control=3).survey
        track = survey.track
        assert isinstance(track, Track)
        attitude = np.array(track.world_from_body_xyzw)
        # Frame 2 is logged by samples 8 to 11; pitch is about the body's y axis, sigma 0.012 rad.
        pitched = Rotation.from_quat(attitude[8:12]) * Rotation.from_rotvec([0, 6 * 0.012, 0])
        attitude[8:12] = pitched.as_quat()
        wrong = replace(survey, track=replace(track, world_from_body_xyzw=attitude))
        adjustment, found = suspected(wrong)
        group = compute_test_statistics(adjustment)["telemetry"]
        above += bool(np.abs(group.w[2, 3:]).max() > compute_critical_value(ALPHA))
        flagged += bool(found) and (found[0].suspect.kind, found[0].suspect.row) == ("telemetry", 2)
    assert flagged >= 8
    assert above >= 9


def test_a_clean_survey_is_not_suspected() -> None:
    assert suspected(make_scene(9, frames=6, noise=0.5).survey)[1] == []


# Readings of almost no redundancy: no suspects of their own, however large their test statistic.


@pytest.mark.parametrize("seed", [5, 16, 24])
def test_lengths_that_nothing_checks_are_not_blamed_for_relief(seed: int) -> None:
    """One oblique photo of which all picks are a little off, as over uneven ground."""
    scene = make_scene(seed, frames=1, labels=10, lines=7, gauge="plane", telemetry=False, tilt=1.0)
    pixel = scene.survey.pixel_px
    off = 4.0 * np.random.default_rng(seed).normal(size=pixel.shape)
    survey = replace(scene.survey, pixel_px=pixel + off)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, np.ones(len(pixel), dtype=np.bool_), none, {})
    adjustment = find_best_minima(taking).adjustment
    groups = compute_test_statistics(adjustment)
    found = list(find_suspicions(adjustment, groups, 0.001))
    assert found
    for one in (suspicion.suspect for suspicion in found):
        if one.kind in READINGS:
            assert groups[one.kind].redundancy[one.row].max() > 0.02


@pytest.mark.parametrize("frames", [1, 3])
def test_a_point_that_may_stand_above_the_ground_can_be_freed_if_two_photos_show_it(
    frames: int,
) -> None:
    scene = make_scene(6, frames=frames, lines=8, roughness=0.02)
    names = ObservationNames(with_all(scene.survey).adjustment)
    member = Member("roughness", 0, 0)
    (label,) = names.find_kind(member).subjects(0)["labels"]
    assert names.cause(member) == f"height of {label!r} (it may stand above the ground)"
    remedy = names.find_kind(member).remedy(0)
    assert (remedy is None) == (frames == 1)
    if remedy is not None:
        assert remedy.words == f"Free the height of {label}"
