"""A camera that stands the wrong way round in its mount is told before anything is accused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import INTRINSICS, Scene, cv_pixels, look_down
from scipy.spatial.transform import Rotation

from uavgram.model.survey import Survey
from uavgram.stages.seed.mount import find_turned_mount


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
        ("z", 180, "180 degrees about the optical axis (roll)."),
        ("z", 90, "-90 degrees about the optical axis"),
        ("z", -90, "+90 degrees about the optical axis"),
        ("x", 90, "-90 degrees up or down (pitch)."),
        ("x", -90, "+90 degrees up or down"),
    ],
)
def test_a_mount_that_is_turned_is_named_with_the_turn_that_mends_it(
    scene_factory: Callable[..., Scene], axis: str, degrees: float, said: str
) -> None:
    message = find_turned_mount(mounted(scene_factory(4, frames=5).survey, axis, degrees))
    assert message is not None
    assert message.code == "mount-turned"
    assert said in message.text


@pytest.mark.parametrize("seed", range(20))
def test_a_mount_that_is_right_up_to_its_errors_is_not_accused(
    scene_factory: Callable[..., Scene], seed: int
) -> None:
    assert find_turned_mount(scene_factory(seed, frames=1 + seed % 6).survey) is None


def test_repeated_clicks_in_one_photo_accuse_nobody(scene_factory: Callable[..., Scene]) -> None:
    survey = mounted(scene_factory(3, frames=1).survey, "x", 70)
    again = np.random.default_rng(3).normal(0.0, 1.0, survey.pixel_px.shape)
    twice = replace(
        survey,
        pick_frame=np.tile(survey.pick_frame, 2),
        pick_label=np.tile(survey.pick_label, 2),
        pixel_px=np.concatenate([survey.pixel_px, survey.pixel_px + again]),
        pick_sigma_px=np.tile(survey.pick_sigma_px, 2),
    )
    assert find_turned_mount(twice) is None


@pytest.mark.parametrize("tilt", [0.0, 0.8])
def test_photos_from_one_place_or_one_photo_alone_accuse_nobody(
    scene_factory: Callable[..., Scene], tilt: float
) -> None:
    survey = scene_factory(3, frames=4, tilt=tilt).survey
    assert survey.seeds is not None
    still = np.tile(survey.seeds.center_world_m[:1], (4, 1))
    turned = np.tile(survey.seeds.world_from_camera[:1], (4, 1, 1))
    seeds = replace(survey.seeds, center_world_m=still, world_from_camera=turned)
    assert find_turned_mount(replace(survey, seeds=seeds)) is None
    assert find_turned_mount(mounted(scene_factory(3, frames=1).survey, "z", 180)) is None
    assert find_turned_mount(scene_factory(3, telemetry=False, gauge="plane").survey) is None


def headed(survey: Survey, degrees: float) -> Survey:
    """The survey with seeds whose headings are all that many degrees too large, clockwise."""
    east, north = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    # where east and north come to lie
    wrong = np.array([[north, east, 0.0], [-east, north, 0.0], [0.0, 0.0, 1.0]])
    seeds = survey.seeds
    assert seeds is not None
    return replace(survey, seeds=replace(seeds, world_from_camera=wrong @ seeds.world_from_camera))


def straight_down(scene: Scene) -> Survey:
    """The survey of a scene as photos that look straight down show it, without any error."""
    survey = scene.survey
    assert survey.seeds is not None
    rotation = np.stack([look_down(0.7 * k, 0.0) for k in range(len(survey.frame_id))])
    pixel = np.empty_like(survey.pixel_px)
    for k, turn in enumerate(rotation):
        own = survey.pick_frame == k
        seen = scene.world[survey.pick_label[own]]
        pixel[own], _ = cv_pixels(INTRINSICS, scene.truth.center[k], turn, seen)
    seeds = replace(survey.seeds, center_world_m=scene.truth.center, world_from_camera=rotation)
    return replace(survey, pixel_px=pixel, seeds=seeds)


OBLIQUE, NADIR = {"frames": 5, "tilt": 0.7}, {"frames": 5, "tilt": 0.0}


@pytest.mark.parametrize(("degrees", "mending"), [(90, "-90"), (180, "+180"), (-90, "+90")])
@pytest.mark.parametrize("seed", [4, 5])
def test_headings_that_are_all_wrong_are_told_as_headings(
    scene_factory: Callable[..., Scene], seed: int, degrees: float, mending: str
) -> None:
    message = find_turned_mount(headed(scene_factory(seed, **OBLIQUE).survey, degrees))
    assert message is not None
    assert message.code == "mount-turned"
    assert message.text.startswith("All headings of the camera seem to be wrong by the same angle")
    assert message.text.endswith(f"with all headings turned by {mending} degrees.")


@pytest.mark.parametrize("degrees", [90, 180, -90])
def test_of_photos_straight_down_a_turned_mount_is_told_and_no_heading(
    scene_factory: Callable[..., Scene], degrees: float
) -> None:
    """Both are the same there."""
    survey = straight_down(scene_factory(4, **NADIR))
    assert find_turned_mount(survey) is None
    for wrong in (mounted(survey, "z", degrees), headed(survey, degrees)):
        message = find_turned_mount(wrong)
        assert message is not None
        assert message.text.startswith("The camera seems to be mounted in another direction")


@pytest.mark.parametrize("degrees", [90, 180, -90])
def test_a_turned_mount_of_oblique_photos_is_no_wrong_heading(
    scene_factory: Callable[..., Scene], degrees: float
) -> None:
    message = find_turned_mount(mounted(scene_factory(4, **OBLIQUE).survey, "z", degrees))
    assert message is not None
    assert "about the optical axis" in message.text


@pytest.mark.parametrize("shape", [OBLIQUE, NADIR])
@pytest.mark.parametrize("seed", range(6))
def test_headings_that_are_right_up_to_their_errors_are_believed(
    scene_factory: Callable[..., Scene], seed: int, shape: dict[str, float]
) -> None:
    survey = scene_factory(seed, **shape).survey
    for degrees in (0, -15, 15):
        assert find_turned_mount(headed(survey, degrees)) is None
