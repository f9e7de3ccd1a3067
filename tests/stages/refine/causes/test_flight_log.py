"""Clocks, cameras and places of a log that are wrong: named with their sizes, and given up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from uavgram.estimation.reliability.hypotheses import compare_hypotheses
from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.flight_log import Track
from uavgram.model.frames import TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.flight_log import (
    USUAL_RAD,
    USUAL_S,
    find_turn_by_places,
    prior_derivative,
    propose_position_step,
    propose_turned_camera,
    propose_wrong_clock,
)
from uavgram.stages.refine.causes.hypothesis import Diagnosis
from uavgram.stages.refine.minima import Participants, find_best_minima

FLIGHT = {"clock-off", "gimbal-off", "heights-off", "log-position-jump"}


def scene_of(seed: int) -> tuple[Scene, TelemetryPrior, Track]:
    """A scene, what its log says, and the log."""
    scene = make_scene(seed, frames=8, labels=20, lines=6)
    prior, track = scene.survey.telemetry, scene.survey.track
    assert prior is not None
    assert isinstance(track, Track)
    return scene, prior, track


def named(survey: Survey) -> tuple[Refined, list[Message]]:
    """The adjusted survey, and what is wrong with its flight."""
    refined, messages = refine(survey, SolveOptions())
    assert not [m for m in messages if m.level != "info" and m.code not in FLIGHT]
    return refined, [message for message in messages if message.code in FLIGHT]


def distances_are_honest(scene: Scene, refined: Refined) -> None:
    """Errors of distances over their sigmas, by the chi-square of a few of them."""
    adjustment = refined.adjustment
    start = adjustment.label_rows([f"P{k}" for k in range(0, 10, 2)])
    end = adjustment.label_rows([f"P{k}" for k in range(1, 11, 2)])
    length, gradient, unknowns = adjustment.problem.lengths_between(adjustment.state, start, end)
    sigma = np.sqrt(adjustment.minimum.factor.variances(unknowns, gradient))
    true = np.linalg.norm(scene.world[1:11:2] - scene.world[0:10:2], axis=1)
    assert np.sum(((length - true) / sigma) ** 2) < 25.7  # 1e-4 of 5 degrees of freedom


def test_a_clock_beyond_its_sigma_is_told_in_seconds() -> None:
    scene, prior, _ = scene_of(3)
    off_s = 0.5
    wrong = replace(
        prior, time_s=prior.time_s + off_s, middle_s=prior.middle_s + off_s, clock_sigma_s=0.02
    )

    refined, (message,) = named(replace(scene.survey, telemetry=wrong))

    assert message.code == "clock-off"
    clock = refined.adjustment.state.telemetry[10]
    assert f"is {clock:.1f} ±" in message.text
    assert clock - off_s == pytest.approx(scene.truth.telemetry[10], abs=0.2)
    distances_are_honest(scene, refined)


@pytest.mark.parametrize("turn_deg", [(20.0, -10.0, 5.0), (0.0, 0.0, 30.0)])
def test_a_turned_camera_is_told_and_given_up(turn_deg: tuple[float, float, float]) -> None:
    scene, prior, _ = scene_of(4)
    turned = prior.gimbal_from_camera @ exp_so3(np.radians(turn_deg))

    refined, (message,) = named(
        replace(scene.survey, telemetry=replace(prior, gimbal_from_camera=turned))
    )

    assert message.code == "gimbal-off"
    assert message.text.endswith("The results take it into account.")
    distances_are_honest(scene, refined)


@pytest.mark.parametrize("pitch_deg", [50.0, -40.0])
def test_a_mount_that_is_far_off_is_named_where_the_log_was_left_out(pitch_deg: float) -> None:
    """With two photos the log contradicts all the rest, and begins the search far from it."""
    scene = make_scene(4, frames=2, labels=14, lines=8)
    prior, seeds = scene.survey.telemetry, scene.survey.seeds
    assert prior is not None
    assert seeds is not None
    turn = exp_so3(np.radians([pitch_deg, 0.0, 0.0]))
    survey = replace(
        scene.survey,
        telemetry=replace(prior, gimbal_from_camera=prior.gimbal_from_camera @ turn),
        seeds=replace(seeds, world_from_camera=seeds.world_from_camera @ turn),
    )

    refined, (message, *_) = named(survey)

    assert message.code == "gimbal-off"
    off = float(message.text.split("turned by ")[1].split(" ")[0])
    assert off == pytest.approx(abs(pitch_deg), abs=10.0)
    assert not refined.pose_widened
    distances_are_honest(scene, refined)


def headed(survey: Survey, degrees: float) -> Survey:
    """The survey with all headings of the log too large by an angle, and places of metres."""
    track, prior, seeds = survey.track, survey.telemetry, survey.seeds
    assert isinstance(track, Track)
    assert prior is not None
    assert seeds is not None
    about_up = Rotation.from_euler("z", -degrees, degrees=True)
    attitude = (about_up * Rotation.from_quat(track.world_from_body_xyzw)).as_quat()
    covariance = np.array(prior.covariance)
    covariance[:, :3, :3] += 1.5**2 * np.eye(3)
    return replace(
        survey,
        track=replace(track, world_from_body_xyzw=attitude),
        telemetry=replace(prior, covariance=covariance),
        seeds=replace(seeds, world_from_camera=about_up.as_matrix() @ seeds.world_from_camera),
    )


@pytest.mark.parametrize("degrees", [90.0, 180.0, -90.0])
@pytest.mark.parametrize("seed", [4, 5])
def test_headings_that_are_all_wrong_are_told_and_given_up(seed: int, degrees: float) -> None:
    scene, *_ = scene_of(seed)

    refined, (message,) = named(headed(scene.survey, degrees))

    assert message.code == "gimbal-off"
    assert message.text.startswith("All headings of the log are off by ")
    off = float(message.text.split("off by ")[1].split(" ")[0])
    assert off == pytest.approx(abs(degrees), abs=30.0)
    adjustment = refined.adjustment
    labels = adjustment.label_rows(scene.survey.label)
    off_m = adjustment.state.point[labels, :2] - scene.world[:, :2]
    columns = adjustment.problem.layout.point_columns(labels)[:, :2].reshape(-1, 1)
    sigma_m = np.sqrt(adjustment.minimum.factor.variances(columns, np.ones(columns.shape)))
    assert (np.abs(off_m.ravel()) < 3.5 * sigma_m).all()
    distances_are_honest(scene, refined)


@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0])
def test_the_places_show_by_how_much_all_headings_are_off(degrees: float) -> None:
    """The linear model sees half of a quarter round, and nothing of half a round."""
    scene, *_ = scene_of(4)
    adjustment = diagnosis(headed(scene.survey, degrees)).adjustment
    turn = find_turn_by_places(adjustment)
    off = np.degrees(turn.angle_rad) - degrees
    assert (off + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=20.0)
    (linear,) = compare_hypotheses(
        adjustment, [[prior_derivative(adjustment, kind="heading_bias")]]
    )
    if degrees:
        assert turn.gain > max(1.5 * linear.gain, 11.0)
    else:
        assert turn.gain < 4.0


@pytest.mark.parametrize("up_m", [45.0, -30.0])
def test_heights_that_are_all_wrong_are_told_as_heights(up_m: float) -> None:
    scene, _, track = scene_of(5)
    seeds = scene.survey.seeds
    assert seeds is not None
    up = np.array([0.0, 0.0, up_m])
    wrong = replace(
        scene.survey,
        track=replace(track, position_world_m=track.position_world_m + up),
        seeds=replace(seeds, center_world_m=seeds.center_world_m + up),
    )

    refined, (message,) = named(wrong)

    assert message.code == "heights-off"
    side = "large" if up_m > 0 else "small"
    assert f"m too {side} for the height of the ground" in message.text
    told = float(message.text.split("log are ")[1].split(" ")[0])
    assert told == pytest.approx(abs(up_m), abs=5.0)
    distances_are_honest(scene, refined)


def test_a_step_of_the_log_is_told_with_the_photos_about_it() -> None:
    scene, prior, track = scene_of(5)
    step = np.array([6.0, -4.0, 2.0])
    place = np.array(track.position_world_m).reshape(len(prior.time_s), -1, 3)
    place[5:] += step  # the log of the fifth photo, and of those behind

    refined, (message,) = named(
        replace(scene.survey, track=replace(track, position_world_m=place.reshape(-1, 3)))
    )

    assert message.code == "log-position-jump"
    assert message.frames == ("f4", "f5")
    told = float(message.text.split("jump by ")[1].split(" ")[0])
    assert told == pytest.approx(np.linalg.norm(step), abs=2.0)
    distances_are_honest(scene, refined)


@pytest.mark.parametrize("seed", range(4))
def test_a_flight_that_fits_is_believed(seed: int) -> None:
    scene, *_ = scene_of(seed)
    refined, messages = named(scene.survey)
    assert not messages
    assert refined.adjustment.survey.telemetry is not None


def test_sigmas_that_are_to_stay_stay_and_the_cause_is_told() -> None:
    scene, prior, _ = scene_of(4)
    turned = prior.gimbal_from_camera @ exp_so3(np.radians([20.0, -10.0, 5.0]))
    survey = replace(scene.survey, telemetry=replace(prior, gimbal_from_camera=turned))

    refined, messages = refine(survey, SolveOptions(noise="stated"))

    told = [message for message in messages if message.code == "gimbal-off"]
    assert told
    assert "into account" not in told[0].text
    kept = refined.adjustment.survey.telemetry
    assert kept is not None
    assert kept.boresight_sigma_rad == prior.boresight_sigma_rad


def diagnosis(survey: Survey) -> Diagnosis:
    every = np.ones(len(survey.pick_frame), dtype=np.bool_)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, every, none, {})
    return Diagnosis(taking, find_best_minima(taking))


def test_the_linear_test_finds_what_an_adjustment_without_the_prior_finds() -> None:
    """What the mean is off by: its own variance comes on top of that of the value without it."""
    scene, prior, _ = scene_of(4)
    turned = prior.gimbal_from_camera @ exp_so3(np.radians([2.0, -1.0, 3.0]))
    stands = diagnosis(replace(scene.survey, telemetry=replace(prior, gimbal_from_camera=turned)))
    hypotheses = (*propose_turned_camera(stands), next(iter(propose_wrong_clock(stands))))
    own = prior.boresight_sigma_rad, prior.heading_bias_sigma_rad, prior.clock_sigma_s
    for one, of_mean in zip(hypotheses, own, strict=True):
        assert one.freed is not None
        assert one.settled is not None
        found = compare_hypotheses(stands.adjustment, [one.moved])[0]
        settled = one.settled(diagnosis(one.freed(stands.survey)).adjustment)
        assert settled is not None
        value, covariance = settled
        sigma = np.sqrt(covariance.diagonal() + of_mean**2)
        assert np.sqrt(found.covariance.diagonal()) == pytest.approx(sigma, rel=0.05)
        assert (np.abs(found.value - value) < 0.15 * sigma + 0.02 * np.abs(value)).all()


def test_giving_up_a_prior_costs_the_odds_of_its_mean() -> None:
    """A wide prior has less at any place than a narrow one: by the densities of both."""
    scene, prior, _ = scene_of(4)
    stands = diagnosis(scene.survey)
    camera, compass = propose_turned_camera(stands)
    clocks = list(propose_wrong_clock(stands))
    for one, count, usual, stated in (
        (camera, 3, USUAL_RAD, prior.boresight_sigma_rad),
        (compass, 1, USUAL_RAD, prior.heading_bias_sigma_rad),
        *((each, 1, USUAL_S, prior.clock_sigma_s) for each in clocks),
    ):
        odds = norm.logpdf(0.0, scale=stated) - norm.logpdf(0.0, scale=usual)
        assert one.price == pytest.approx(count * odds)


@pytest.mark.parametrize("first", [1, 6])
def test_the_likeliest_step_is_where_the_log_jumps(first: int) -> None:
    scene, prior, track = scene_of(5)
    place = np.array(track.position_world_m).reshape(len(prior.time_s), -1, 3)
    place[first:] += [9.0, -6.0, 3.0]
    survey = replace(scene.survey, track=replace(track, position_world_m=place.reshape(-1, 3)))
    stands = diagnosis(survey)
    steps = [one for one in propose_position_step(stands) if one.message is not None]
    found = compare_hypotheses(stands.adjustment, [one.moved for one in steps])
    best = int(np.argmax([one.gain for one in found]))
    assert best == 0  # the cheap bound has it first as well
    tell, freed = steps[best].message, steps[best].freed
    assert tell is not None
    assert freed is not None
    assert tell(found[best]).frames == (f"f{first - 1}", f"f{first}")
    assert found[best].value == pytest.approx([9.0, -6.0, 3.0], abs=3.0)
    known_less = freed(survey).telemetry
    assert known_less is not None
    wide = known_less.covariance[:, 0, 0] > 100.0
    behind = np.arange(len(wide)) >= first
    assert wide.tolist() == (behind if behind.sum() <= 4 else ~behind).tolist()
    assert len(steps) == len(wide) - 1
