"""Points off the ground that nobody stated: found with their heights, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hostile_conditions import CONDITIONS
from hostile_project import write_project
from hostile_surveys import make_survey
from scenes import Scene, make_scene
from tied_flights import Conditions, tied_flight
from tied_surveys import TiedSurvey, tied_survey

from uavgram.estimation.survey.adjustment import Refined, compute_heights
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.result.result import Result
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.messages import order_messages
from uavgram.stages.refine import gross_errors, refine
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.off_ground import free_unchecked_heights, set_free_heights
from uavgram.stages.refine.tie_outliers import CheckedTies, remove_wrong_ties
from uavgram.stages.refine.tied_frames import add_tied_frames

SCENE: dict[str, Any] = {"frames": 6, "labels": 24, "lines": 6}
CAR = {2: 1.42, 5: 1.45, 9: 0.9, 14: 0.92, 17: 1.5, 20: 2.3}
Told = tuple[Refined, tuple[Message, ...]]


def unstated(scene: Scene) -> Survey:
    """As somebody gives it who does not know of heights and roughness."""
    survey = scene.survey
    grounds = tuple(replace(ground, roughness_sigma_m=0.0) for ground in survey.grounds)
    return replace(survey, height_above_m=np.zeros(len(survey.label)), grounds=grounds)


def refined_of(survey: Survey, outliers: Literal["report", "remove"] = "report") -> Told:
    return refine(survey, SolveOptions(outliers=outliers))


@cache
def with_cars(seed: int) -> Survey:
    return unstated(make_scene(seed, heights=CAR, **SCENE))


@cache
def with_cars_refined(seed: int, outliers: Literal["report", "remove"]) -> Told:
    return refined_of(with_cars(seed), outliers)


def names(labels: dict[int, float]) -> frozenset[str]:
    return frozenset(f"P{k}" for k in labels)


def errors(refined: Refined, true: dict[int, float]) -> np.ndarray:
    """Of the heights of labels, in their sigmas."""
    row = refined.adjustment.label_rows(f"P{k}" for k in true)
    height, sigma = compute_heights(refined.adjustment)
    return np.asarray((height[row] - list(true.values())) / sigma[row])


@pytest.mark.parametrize(("seed", "outliers"), [(0, "report"), (1, "remove")])
def test_roofs_are_found_with_their_heights_and_no_pick_is_blamed(
    seed: int, outliers: Literal["report", "remove"]
) -> None:
    refined, messages = with_cars_refined(seed, outliers)

    assert refined.off_ground == names(CAR)
    assert np.abs(errors(refined, CAR)).max() < 3.5
    assert {m.code for m in messages} == {"point-off-ground"}
    assert not refined.removals
    assert len(refined.pick_index) == len(with_cars(seed).pick_frame)


def test_on_flat_ground_nothing_is_found_and_nothing_is_searched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        pytest.fail("a search where all fits")

    monkeypatch.setattr(gross_errors, "_find_best_candidates", fail)
    for seed in range(3):
        assert not refined_of(make_scene(seed, **SCENE).survey)[0].off_ground


ONE_PICK = pytest.mark.xfail(reason="known fault: on relief of 6 cm one pick of a car is blamed")


@pytest.mark.parametrize("seed", [pytest.param(0, marks=ONE_PICK), 1])
def test_relief_is_no_car_and_cars_are_found_on_it(seed: int) -> None:
    bare = unstated(make_scene(seed, roughness=0.06, **SCENE))
    beset = unstated(make_scene(seed, roughness=0.06, heights=CAR, **SCENE))

    assert not refined_of(bare)[0].off_ground
    refined, _ = refined_of(beset)
    assert refined.off_ground == names(CAR)
    assert np.abs(errors(refined, CAR)).max() < 4.0


@pytest.mark.parametrize("height_m", [-2.5, 9.0])
def test_two_picks_that_meet_far_from_the_ground_contradict_each_other(height_m: float) -> None:
    """A wrong click meets the other photo's ray at some height; nobody picks points 2.5 m deep."""
    scene = make_scene(3, heights={7: height_m}, **(SCENE | {"frames": 2}))
    refined, messages = refined_of(unstated(scene))

    assert "P7" not in refined.off_ground
    (message,) = (one for one in messages if one.code == "picks-contradict")
    assert message.labels == ("P7",)


def test_two_picks_that_meet_on_a_car_show_its_height() -> None:
    refined, _ = refined_of(unstated(make_scene(3, heights={7: 1.5}, **(SCENE | {"frames": 2}))))
    assert refined.off_ground == {"P7"}


@pytest.mark.parametrize("beset", [False, True])
def test_a_wrong_pick_is_no_height(beset: bool) -> None:  # noqa: FBT001
    survey = with_cars(1) if beset else make_scene(1, **SCENE).survey
    wrong = int(np.flatnonzero(survey.pick_label == 7)[2])
    pixel = np.array(survey.pixel_px)
    pixel[wrong] += [25.0, -18.0]

    refined, _ = refined_of(replace(survey, pixel_px=pixel), "remove")

    assert refined.off_ground == (names(CAR) if beset else frozenset())
    assert list(refined.pick_reason) == [wrong]


def test_cars_are_found_beside_swapped_labels() -> None:
    survey = with_cars(1)
    label = np.array(survey.pick_label)
    first, second = (
        int(np.flatnonzero((survey.pick_frame == 3) & (label == k))[0]) for k in (7, 2)
    )
    label[[first, second]] = label[[second, first]]

    refined, _ = refined_of(replace(survey, pick_label=label))

    assert refined.off_ground == names(CAR)
    assert np.abs(errors(refined, CAR)).max() < 3.5


def test_a_wrong_length_is_no_height() -> None:
    survey = with_cars(0)
    length = np.array(survey.length_m)
    length[0] += 0.5

    assert refined_of(replace(survey, length_m=length))[0].off_ground == names(CAR)
    flat = make_scene(0, **SCENE).survey
    length = np.array(flat.length_m)
    length[0] += 0.5
    assert not refined_of(replace(flat, length_m=length))[0].off_ground


def test_without_a_log_and_without_a_plane_of_the_world() -> None:
    scene = make_scene(4, telemetry=False, gauge="plane", heights=CAR, **SCENE)

    refined, _ = refined_of(unstated(scene))

    assert refined.off_ground == names(CAR)
    assert np.abs(errors(refined, CAR)).max() < 3.5


@pytest.mark.parametrize("seed", [2, 3])
def test_two_photos_at_a_base_to_height_of_a_fifth_are_enough(seed: int) -> None:
    scene = make_scene(seed, frames=2, labels=24, lines=6, heights=CAR)
    refined, _ = refined_of(unstated(scene))

    assert refined.off_ground == names(CAR)
    assert np.abs(errors(refined, CAR)).max() < 3.5


def test_a_kerb_of_its_own_area_is_ground_and_a_car_on_it_is_not() -> None:
    verge = tuple(range(12, 24))
    scene = make_scene(2, verge=verge, heights={3: 1.4, 15: 1.5}, **SCENE)

    refined, _ = refined_of(unstated(scene))

    assert refined.off_ground == {"P3", "P15"}


def test_where_most_points_are_on_a_roof_the_others_are_as_far_below_it() -> None:
    most = dict.fromkeys(range(14), 1.4)
    rest = dict.fromkeys(range(14, 24), -1.4)

    refined, _ = refined_of(unstated(make_scene(1, heights=most, **SCENE)))

    assert refined.off_ground == names(rest)
    assert np.abs(errors(refined, rest)).max() < 3.5


def test_what_was_stated_is_neither_found_nor_told() -> None:
    scene = make_scene(1, heights=CAR, **SCENE)
    free = np.isin(np.arange(24), list(CAR))
    said = replace(unstated(scene), is_free=free)

    for survey in (scene.survey, said):
        refined, messages = refined_of(survey)
        assert not refined.off_ground
        assert not messages


def test_a_point_in_two_photos_may_be_a_wrong_pick_and_the_message_says_so() -> None:
    survey = with_cars(1)
    of_label = np.flatnonzero(survey.pick_label == 2)
    keep = ~np.isin(np.arange(len(survey.pick_label)), of_label[2:])
    names_and_frames = {
        name: getattr(survey, name)[keep]
        for name in ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
    }

    refined, messages = refined_of(replace(survey, **names_and_frames))

    assert refined.off_ground == names(CAR)
    (text,) = (m.text for m in messages if m.labels == ("P2",))
    assert "or one of its two picks is on another thing" in text


def test_the_message_carries_each_label_with_height_and_sigma() -> None:
    refined, messages = with_cars_refined(0, "report")
    (told,) = order_messages(*messages)
    height, sigma = compute_heights(refined.adjustment)
    row = refined.adjustment.label_rows(told.labels)

    assert told.level == "warning"
    assert set(told.labels) == names(CAR)
    np.testing.assert_array_equal(told.heights_m, height[row])
    np.testing.assert_array_equal(told.heights_sigma_m, sigma[row])
    assert "`free` in the column height_m" in told.text
    assert told.record()["heights_m"] == list(told.heights_m)


RAISED_M, ROUGH_M = 1.5, 0.04


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    condition = replace(CONDITIONS["matched"], raised=((3, RAISED_M),), relief_m=ROUGH_M)
    folder: Path = tmp_path_factory.mktemp("raised")
    project = write_project(make_survey(condition, 5), folder)
    return compute(read_inputs(project), curved=False).result


def test_a_label_that_stands_off_the_ground_is_told_with_its_height(result: Result) -> None:
    told = [message for message in result.messages if message.code == "point-off-ground"]

    assert [message.labels for message in told] == [("P3",)]
    (height,), (sigma,) = told[0].heights_m, told[0].heights_sigma_m
    assert sigma < 0.1
    assert abs(height - RAISED_M) < 4 * sigma


def test_uneven_ground_costs_no_match_and_is_told_as_such(result: Result) -> None:
    codes = {message.code for message in result.messages if message.level != "info"}

    assert "removed" not in result.picks.status
    assert codes <= {"point-off-ground", "ground-not-plane", "nothing-checks"}
    assert result.noise is not None
    (ground,) = result.noise.roughness
    assert ground.stated_m == 0.02
    assert abs(ground.estimated_m - ROUGH_M) < 4 * ground.sigma_m
    assert ground.sigma_m < 0.5 * ROUGH_M
    match = next(one for one in result.noise.picks if one.source == "match")
    assert np.isclose(match.factor, 1.0, atol=5 * match.sigma)


RELIEF_M = 0.05
"""Of the points of made-up flights."""


@pytest.fixture(scope="module")
def flat() -> TiedSurvey:
    """A flight over uneven ground that was said to be smooth, and houses."""
    flight = tied_flight(Conditions(photos=6, seed=4, density=120.0, houses=True))
    return tied_survey(flight)


def sound(survey: TiedSurvey, roughness_m: float) -> CheckedTies:
    """With some roughness stated."""
    grounds = tuple(replace(one, roughness_sigma_m=roughness_m) for one in survey.survey.grounds)
    begun, _ = add_tied_frames(replace(survey.survey, grounds=grounds))
    return remove_wrong_ties(begun)


def test_the_ground_gets_the_roughness_that_ties_show(flat: TiedSurvey) -> None:
    found = sound(flat, 0.0)

    (ground,) = found.survey.grounds
    assert np.isclose(ground.roughness_sigma_m, RELIEF_M, rtol=0.2)  # some 100 points
    assert found.shown.probability[0] < 1e-6
    assert not found.shown.off_ground


def test_a_ground_stated_to_be_rougher_stays_so(flat: TiedSurvey) -> None:
    found = sound(flat, 2.0 * RELIEF_M)

    assert not found.shown.roughness_m
    assert found.survey.grounds[0].roughness_sigma_m == 2.0 * RELIEF_M


HEIGHTS = {0: 1.0, 1: 2.0, 2: 1.5, 3: 0.8}
ONCE, TWICE = ("P10", "P11"), "P9"
FOUND = tuple(f"P{k}" for k in HEIGHTS)


def survey_with(found: tuple[str, ...], once: tuple[str, ...]) -> tuple[Survey, Refined]:
    """Points off the ground, some freed; some are in the first photo only, one in two."""
    full = make_scene(4, frames=6, heights=HEIGHTS).survey
    survey = replace(full, height_above_m=np.zeros(len(full.label)))
    left = {survey.label.index(name): 1 for name in once} | {survey.label.index(TWICE): 2}
    keep = np.ones(len(survey.pick_label), dtype=np.bool_)
    for k, label in enumerate(survey.pick_label.tolist()):
        keep[k] = left.get(label, 1) > 0
        left[label] = left.get(label, 99) - 1
    survey = set_free_heights(survey, list(found))
    lines = np.zeros(len(survey.line_start), dtype=np.bool_)
    return survey, find_best_minima(Participants(survey, keep, lines, {}))


@cache
def treated(
    found: tuple[str, ...] = FOUND, once: tuple[str, ...] = ONCE
) -> tuple[Survey, Survey, Refined, tuple[Message, ...]]:
    """The survey before, then what it became."""
    survey, refined = survey_with(found, once)
    assert set(np.unique(survey.pick_label).tolist()) == set(range(len(survey.label)))
    return (survey, *free_unchecked_heights(survey, refined, found))


def test_the_sigma_is_that_of_points_of_which_a_share_stands_so_high() -> None:
    before, survey, refined, _ = treated()
    points = len(before.label) - len(ONCE)  # all others are in two photos or more
    share = len(FOUND) / points
    sigma = np.sqrt(share * np.mean(np.square(list(HEIGHTS.values()))))
    once = np.isin(survey.label, ONCE)
    assert survey.height_sigma_m[once] == pytest.approx(sigma, rel=0.05)
    own = refined.adjustment.survey
    taken = own.height_sigma_m[np.isin(own.label, ONCE)]
    assert taken == pytest.approx(survey.height_sigma_m[once])


def test_points_in_two_photos_keep_what_they_had() -> None:
    before, survey, *_ = treated()
    others = ~np.isin(survey.label, ONCE)
    assert survey.height_sigma_m[others].tolist() == before.height_sigma_m[others].tolist()


def test_the_height_of_a_point_is_known_no_better_than_said() -> None:
    _, survey, refined, _ = treated()
    adjustment = refined.adjustment
    height = adjustment.state.point[adjustment.label_rows(ONCE), 2]
    assert np.abs(height).max() < float(survey.height_sigma_m.max())
    assert adjustment.minimum.converged


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_are_exceptions(count: int) -> None:
    before, survey, _, messages = treated(FOUND[:count])
    assert survey is before
    assert messages == ()


def test_where_every_point_is_in_two_photos_nothing_is_done() -> None:
    before, survey, _, messages = treated(once=())
    assert survey is before
    assert messages == ()


@pytest.mark.parametrize("once", [ONCE, ONCE[:1]])
def test_the_message_names_them_and_says_what_to_do(once: tuple[str, ...]) -> None:
    _, survey, _, (message,) = treated(once=once)
    sigma_m = survey.height_sigma_m[survey.label.index(once[0])]
    assert (message.code, message.labels) == ("heights-unseen", once)
    several = len(once) > 1
    assert message.text.startswith("2 points may" if several else "The point 'P10' may")
    assert f"Pick {'them' if several else 'it'} in a photo from further aside" in message.text
    assert f"as {len(FOUND)} others are" in message.text
    assert f"taken as uncertain by up to {sigma_m:.2f} m." in message.text
