"""A height of the ground above the sea, where one above the world's origin is expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.errors import GeometryError
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.ground_height import lower_ground
from uavgram.stages.refine import refine


def above_the_sea(survey: Survey, up_m: float) -> Survey:
    grounds = tuple(replace(one, height_m=one.height_m + up_m) for one in survey.grounds)
    return replace(survey, grounds=grounds)


def test_a_ground_above_all_cameras_counts_from_the_origin() -> None:
    scene = make_scene(4, frames=4, labels=16, lines=6)
    wrong = above_the_sea(scene.survey, 612.3)
    with pytest.raises(GeometryError):
        refine(wrong, SolveOptions())
    survey, (message,) = lower_ground(wrong, 611.8)
    assert message.code == "ground-above-cameras"
    assert "612.3 m above the world's origin, at 611.8 m" in message.text
    assert "0.5 m for the ground, uncertain by 3 m" in message.text
    refined, messages = refine(survey, SolveOptions())
    assert not [one for one in messages if one.level == "warning"]
    assert len(refined.pick_index) == len(survey.pick_frame)


@pytest.mark.parametrize("origin_m", [None, 100.0])
def test_without_a_likely_origin_the_ground_is_at_the_origin(origin_m: float | None) -> None:
    scene = make_scene(4, frames=4, labels=16, lines=6)
    survey, _ = lower_ground(above_the_sea(scene.survey, 612.3), origin_m)
    assert survey.ground.height_m == 0.0


def test_control_points_show_the_height() -> None:
    scene = make_scene(4, frames=4, labels=16, lines=6, control=3)
    survey, _ = lower_ground(above_the_sea(scene.survey, 612.3), 500.0)
    up_m = survey.control_world_m[:, 2]
    assert np.abs(up_m - survey.ground.height_m).max() < 2.0


def test_below_cameras_of_unknown_height_the_ground_is_at_an_ordinary_distance() -> None:
    """The photos' altitudes are 80 m too low; the lengths decide, as the ground is uncertain."""
    survey = make_scene(4, frames=4, labels=16, lines=6).survey
    seeds = survey.seeds
    assert seeds is not None
    low = replace(seeds, center_world_m=seeds.center_world_m - [0.0, 0.0, 80.0])
    lowered, (message,) = lower_ground(replace(survey, seeds=low), 20.0)
    assert message.code == "ground-above-cameras"
    distance = low.center_world_m[:, 2].min() - lowered.ground.height_m
    assert 10.0 < distance < 60.0
    assert lowered.ground.height_sigma_m > distance / 2.0


def test_a_ground_below_a_camera_and_a_survey_without_a_log_stay() -> None:
    scene = make_scene(4, frames=4)
    assert lower_ground(scene.survey, 611.8) == (scene.survey, ())
    bare = make_scene(4, telemetry=False, gauge="plane").survey
    assert lower_ground(above_the_sea(bare, 612.3), 611.8)[1] == ()
