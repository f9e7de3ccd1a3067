"""Clocks, cameras and places of a log that are wrong: named with their sizes, and given up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.flight.log import Track
from uavgram.model.flight.pose import TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine import refine

FLIGHT = {"clock-off", "gimbal-off", "log-position-jump"}


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
