"""Control points use their own heights, and are not pressed onto the ground's plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.assemble import free_control_heights
from uavgram.stages.refine import refine

OFF_M = {0: 0.9, 1: 0.1, 2: 1.4, 3: 0.6, 4: -0.4, 5: 0.3}


def on_a_facade() -> Scene:
    """One photo, with a log, of control points at heights that nobody stated."""
    scene = make_scene(6, frames=1, labels=6, lines=0, control=6, heights=OFF_M, roughness=0.02)
    return replace(scene, survey=replace(scene.survey, height_above_m=np.zeros(6)))


def worst_m(survey: Survey, scene: Scene) -> float:
    adjustment = refine(survey, SolveOptions())[0].adjustment
    world, _ = adjustment.points()
    there = [int(label[1:]) for label in adjustment.survey.label]
    return float(np.linalg.norm(world - scene.world[there], axis=1).max())


def test_control_points_off_the_plane_keep_their_own_heights() -> None:
    scene = on_a_facade()
    survey = free_control_heights(scene.survey)

    assert survey.is_free.all()
    assert worst_m(survey, scene) < 0.1


@pytest.mark.parametrize("slope", [0.0, 0.015])
def test_control_points_on_a_plane_say_where_it_is(slope: float) -> None:
    scene = make_scene(6, control=5, roughness=0.02)
    world = (
        scene.survey.control_world_m
        + np.outer(scene.survey.control_world_m[:, 0], [0, 0, 1]) * slope
    )
    survey = replace(scene.survey, control_world_m=world)

    assert not free_control_heights(survey).is_free.any()


def test_a_height_above_the_ground_that_is_stated_holds() -> None:
    scene = on_a_facade()
    above = np.array([0.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = free_control_heights(replace(scene.survey, height_above_m=above)).is_free

    np.testing.assert_array_equal(found, above == 0.0)


def test_without_a_log_they_place_photos_all_the_same() -> None:
    """Three points, one of them on a kerbstone, and lengths between other points."""
    ends = ((3, 5), (4, 7), (6, 9), (3, 8), (5, 9), (7, 8))
    heights = {1: 0.9}
    scene = make_scene(
        6, frames=2, labels=10, ends=ends, control=3, telemetry=False, heights=heights
    )
    survey = free_control_heights(replace(scene.survey, height_above_m=np.zeros(10)))

    assert survey.is_free[:3].all()
    assert worst_m(survey, scene) < 0.5  # heights of 5 cm over short bases tilt the plane
