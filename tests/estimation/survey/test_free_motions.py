"""Lengths alone know nothing of a shift and a turn of everything: no distance depends on them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scenes
from scenes import make_scene
from scipy.spatial.transform import Rotation

from uavgram.geometry.ground import measurements
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

SCENE: dict[str, Any] = {"frames": 2, "labels": 8, "lines": 9, "telemetry": False, "gauge": "plane"}


def motion(seed: int) -> tuple[Floats, Floats]:
    """A turn about the vertical and a shift along the plane."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix()
    return turn, np.append(rng.uniform(-500, 500, 2), 0.0)


def distances(survey: Survey) -> tuple[Floats, Floats, Floats]:
    """All distances between labels in the order of their names, and their sigmas."""
    adjustment = refine(survey, SolveOptions())[0].adjustment
    assert adjustment.minimum.converged
    order = [adjustment.label_index(name) for name in sorted(survey.label)]
    world, covariance = adjustment.joint_points(np.array(order))
    values, sigmas = [], []
    joint = covariance.reshape(len(order), 3, len(order), 3)
    for a in range(len(order)):
        for b in range(a):
            value, gradient = measurements.distance(world[[a, b]])
            ends = joint[[a, b]][:, :, [a, b]].reshape(6, 6)
            values.append(value)
            sigmas.append(np.sqrt(gradient.ravel() @ ends @ gradient.ravel()))
    return np.array(values), np.array(sigmas), world


@pytest.mark.parametrize("seed", range(3))
def test_a_scene_that_was_shifted_and_turned_has_the_same_distances(seed: int) -> None:
    scene = make_scene(20 + seed, **SCENE)
    turn, shift = motion(seed)
    survey, truth = scene.survey, scene.truth
    world = scene.world @ turn.T + shift
    pixel = np.array(survey.pixel_px)
    for f in range(2):
        rows = np.flatnonzero(survey.pick_frame == f)
        label = survey.pick_label[rows]
        intrinsics = survey.calibration.parameters
        before, _ = scenes.cv_pixels(
            intrinsics, truth.center[f], truth.rotation[f], scene.world[label]
        )
        after, _ = scenes.cv_pixels(
            intrinsics, turn @ truth.center[f] + shift, turn @ truth.rotation[f], world[label]
        )
        pixel[rows] += after - before
    length = np.linalg.norm(world[survey.line_start] - world[survey.line_end], axis=1)
    noise = survey.length_m - np.linalg.norm(
        scene.world[survey.line_start] - scene.world[survey.line_end], axis=1
    )
    moved = replace(survey, pixel_px=pixel, length_m=length + noise)
    here, there = distances(survey), distances(moved)
    np.testing.assert_allclose(there[0], here[0], rtol=1e-7)
    np.testing.assert_allclose(there[1], here[1], rtol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_another_frame_as_the_gauge_moves_the_points_but_no_distance(seed: int) -> None:
    survey = make_scene(20 + seed, **SCENE).survey
    other = replace(survey, frame_id=survey.frame_id[::-1], pick_frame=1 - survey.pick_frame)
    here, there = distances(survey), distances(other)
    np.testing.assert_allclose(there[0], here[0], rtol=1e-6)
    np.testing.assert_allclose(there[1], here[1], rtol=1e-4)
    assert np.abs(there[2] - here[2]).max() > 0.1  # the coordinates are those of the other frame


@pytest.mark.parametrize("seed", range(3))
def test_no_observation_notices_a_shift_and_a_turn_of_the_adjusted_state(seed: int) -> None:
    adjustment = refine(make_scene(20 + seed, **SCENE).survey, SolveOptions())[0].adjustment
    turn, shift = motion(seed)
    state = adjustment.state
    moved = replace(
        state,
        point=state.point @ turn[:2, :2].T + shift[:2],
        center=state.center @ turn.T + shift,
        rotation=turn @ state.rotation,
    )
    blocks, before = adjustment.problem.evaluate(moved), adjustment.minimum.blocks
    assert blocks is not None
    for name in ("pixels", "lengths", "calibration"):
        np.testing.assert_allclose(blocks[name].residual, before[name].residual, atol=1e-6)
    assert np.abs(blocks["gauge"].residual).max() > 1e3  # which is what the gauge is for


def test_known_coordinates_do_notice_it() -> None:
    scene = make_scene(20, frames=2, labels=8, lines=0, control=5, telemetry=False)
    turn, shift = motion(0)
    known = scene.survey.control_world_m
    moved = replace(scene.survey, control_world_m=known @ turn.T + shift)
    (distance, sigma, world), (other, other_sigma, carried) = (
        distances(survey) for survey in (scene.survey, moved)
    )
    np.testing.assert_allclose(carried, world @ turn.T + shift, atol=0.02)
    # Their sigmas differ from axis to axis, and those do not turn with the coordinates.
    np.testing.assert_allclose(other, distance, rtol=0.01)
    np.testing.assert_allclose(other_sigma, sigma, rtol=0.3)
