"""Points off the ground do not mislead what places photos without a log: poses stay the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import Scene, make_scene

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import find_seen_lines
from uavgram.estimation.survey.selection import select_picks
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.first_values import find_first_values

STATED = SolveOptions(noise="stated")
ENDS = ((0, 2), (4, 6), (2, 4), (0, 4), (6, 8))
CARS = {1: 1.4, 3: 1.5, 5: 0.9, 7: 1.5, 9: 3.0, 11: 8.0}
"""Roofs of cars, a van, and a lamp post."""


def no_log(seed: int, *, tilt: float, heights: Mapping[int, float] | None = None) -> Scene:
    return make_scene(
        seed,
        frames=5,
        labels=16,
        ends=ENDS,
        telemetry=False,
        gauge="plane",
        heights=dict(CARS if heights is None else heights),
        along=12.0,
        tilt=tilt,
    )


def stands_right(survey: Survey, scene: Scene) -> bool:
    """Whether all photos end at their true heights and tilts."""
    try:
        adjustment = refine(survey, STATED)[0].adjustment
    except GeometryError:
        return False
    names = adjustment.survey.frame_id
    if len(names) < len(scene.survey.frame_id):
        return False
    state, truth = adjustment.state, scene.truth
    tilt = np.arccos(np.clip(np.sum(state.rotation[:, 2] * truth.rotation[:, 2], axis=1), -1, 1))
    rise = np.abs(state.center[:, 2] - truth.center[:, 2])
    return bool((tilt < 0.07).all() and (rise < 2.0).all())


@pytest.mark.parametrize("tilt", [0.0, 0.35])
def test_free_points_cost_no_photo_its_pose(tilt: float) -> None:
    without, free, stated = [], [], []
    for seed in range(6):
        scene = no_log(seed, tilt=tilt)
        on_ground = np.isin(scene.survey.pick_label, list(CARS), invert=True)
        without.append(stands_right(select_picks(scene.survey, on_ground).survey, scene))
        found = with_third_coordinates(scene, free=CARS).survey
        free.append(stands_right(found, scene))
        rough = with_third_coordinates(scene, stated=dict.fromkeys(CARS, 2.0)).survey
        wrong = replace(rough, height_above_m=0.3 * rough.height_above_m)
        stated.append(stands_right(wrong, scene))
    assert sum(without) >= 4
    assert all(np.array(free) >= np.array(without))
    assert all(np.array(stated) >= np.array(without))


def test_first_poses_are_the_same_with_free_points_as_without() -> None:
    scene = no_log(3, tilt=0.35)
    survey = with_third_coordinates(scene, free=CARS).survey
    on_ground = np.isin(survey.pick_label, list(CARS), invert=True)
    without = find_first_values(select_picks(survey, on_ground).survey)
    free = find_first_values(survey)
    assert len(free) == len(without)
    for one, other in zip(free, without, strict=True):
        np.testing.assert_array_equal(one.center, other.center)
        np.testing.assert_array_equal(one.rotation, other.rotation)


def test_lengths_to_points_off_the_ground_begin_no_pose() -> None:
    scene = no_log(3, tilt=0.35)
    ends = np.array([*ENDS, (0, 11), (1, 3)])
    survey = replace(
        scene.survey,
        line_start=ends[:, 0],
        line_end=ends[:, 1],
        length_m=np.linalg.norm(scene.world[ends[:, 0]] - scene.world[ends[:, 1]], axis=1),
        length_sigma_m=np.full(len(ends), 0.01),
    )
    for each in (
        with_third_coordinates(replace(scene, survey=survey), free=CARS).survey,
        with_third_coordinates(replace(scene, survey=survey), stated={1: 1.0, 11: 1.0}).survey,
    ):
        assert set(find_seen_lines(each).line.tolist()) == set(range(len(ENDS)))
    assert stands_right(
        with_third_coordinates(replace(scene, survey=survey), free=CARS).survey, scene
    )


def test_tall_points_of_known_height_do_not_bend_the_plane_that_places_a_photo() -> None:
    tall = {1: 12.0, 3: 10.0, 5: 9.0, 7: 11.0, 9: 8.0, 11: 12.0}
    right = [
        stands_right(scene.survey, scene)
        for scene in (no_log(seed, tilt=0.2, heights=tall) for seed in range(6))
    ]
    assert sum(right) >= 5


def test_control_points_whose_height_is_free_do_not_lift_the_ground() -> None:
    scene = make_scene(11, telemetry=False, control=7, heights={5: 2.5, 6: 6.0}, noise=0.0)
    survey = with_third_coordinates(scene, free=(5, 6)).survey
    assert find_first_values(survey)[0].height_m == pytest.approx(scene.truth.plane[0], abs=0.5)
    assert stands_right(survey, scene)
