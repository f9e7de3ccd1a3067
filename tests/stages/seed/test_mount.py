"""A camera that stands the wrong way round in its mount is told before anything is accused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene
from scipy.spatial.transform import Rotation

from uavgram.model.survey.survey import Survey
from uavgram.stages.seed.mount import turned_mount


def mounted(survey: Survey, axis: str, degrees: float) -> Survey:
    """The survey with seeds of a mount that is wrong by that."""
    wrong = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    seeds = survey.seeds
    assert seeds is not None
    return replace(
        survey,
        seeds=replace(seeds, world_from_camera=seeds.world_from_camera @ wrong),
    )


@pytest.mark.parametrize(
    ("axis", "degrees", "said"),
    [
        ("z", 180, "180 degrees about the optical axis"),
        ("z", 90, "-90 degrees about the optical axis"),
        ("z", -90, "+90 degrees about the optical axis"),
        ("x", 90, "-90 degrees up or down"),
        ("x", -90, "+90 degrees up or down"),
    ],
)
def test_a_mount_that_is_turned_is_named_with_the_turn_that_mends_it(
    scene_factory: Callable[..., Scene], axis: str, degrees: float, said: str
) -> None:
    message = turned_mount(mounted(scene_factory(4, frames=5).survey, axis, degrees))
    assert message is not None
    assert message.code == "mount-turned"
    assert said in message.text


@pytest.mark.parametrize("seed", range(20))
def test_a_mount_that_is_right_up_to_its_errors_is_not_accused(
    scene_factory: Callable[..., Scene], seed: int
) -> None:
    assert turned_mount(scene_factory(seed, frames=1 + seed % 6).survey) is None


@pytest.mark.parametrize("tilt", [0.0, 0.8])
def test_photos_from_one_place_or_one_photo_alone_accuse_nobody(
    scene_factory: Callable[..., Scene], tilt: float
) -> None:
    survey = scene_factory(3, frames=4, tilt=tilt).survey
    assert survey.seeds is not None
    still = np.tile(survey.seeds.center_world_m[:1], (4, 1))
    turned = np.tile(survey.seeds.world_from_camera[:1], (4, 1, 1))
    seeds = replace(survey.seeds, center_world_m=still, world_from_camera=turned)
    assert turned_mount(replace(survey, seeds=seeds)) is None
    assert turned_mount(mounted(scene_factory(3, frames=1).survey, "z", 180)) is None
    assert turned_mount(scene_factory(3, telemetry=False, gauge="plane").survey) is None
