"""Other directions of the camera than stated are found before anything is accused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import INTRINSICS, Scene, cv_pixels, look_down, make_scene
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.compute import adjust_survey
from uavgram.stages.seed.common_errors import find_common_error


def find_other_directions(survey: Survey) -> Message | None:
    """The message on other directions of the camera; None where there are none."""
    found = find_common_error(survey)
    return None if found is None else found.message


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
        ("z", 180, "180 degrees about the optical axis (roll). "),
        ("z", 90, "-90 degrees about the optical axis"),
        ("z", -90, "+90 degrees about the optical axis"),
        ("x", 90, "-90 degrees up or down (pitch). "),
        ("x", -90, "+90 degrees up or down"),
    ],
)
def test_a_mount_that_is_turned_is_named_with_the_turn_that_mends_it(
    scene_factory: Callable[..., Scene], axis: str, degrees: float, said: str
) -> None:
    message = find_other_directions(mounted(scene_factory(4, frames=5).survey, axis, degrees))
    assert message is not None
    assert message.code == "mount-turned"
    assert said in message.text


@pytest.mark.parametrize("seed", range(20))
def test_a_mount_that_is_right_up_to_its_errors_is_not_accused(
    scene_factory: Callable[..., Scene], seed: int
) -> None:
    assert find_other_directions(scene_factory(seed, frames=1 + seed % 6).survey) is None


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
    assert find_other_directions(twice) is None


@pytest.mark.parametrize("tilt", [0.0, 0.8])
def test_photos_from_one_place_or_one_photo_alone_accuse_nobody(
    scene_factory: Callable[..., Scene], tilt: float
) -> None:
    survey = scene_factory(3, frames=4, tilt=tilt).survey
    assert survey.seeds is not None
    still = np.tile(survey.seeds.center_world_m[:1], (4, 1))
    turned = np.tile(survey.seeds.world_from_camera[:1], (4, 1, 1))
    seeds = replace(survey.seeds, center_world_m=still, world_from_camera=turned)
    assert find_other_directions(replace(survey, seeds=seeds)) is None
    assert find_other_directions(mounted(scene_factory(3, frames=1).survey, "z", 180)) is None
    assert find_other_directions(scene_factory(3, telemetry=False, gauge="plane").survey) is None


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
    message = find_other_directions(headed(scene_factory(seed, **OBLIQUE).survey, degrees))
    assert message is not None
    assert message.code == "mount-turned"
    assert message.text.startswith("All headings of the camera seem to be wrong by the same angle")
    assert f"with all headings turned by {mending} degrees. " in message.text


@pytest.mark.parametrize("degrees", [90, 180, -90])
def test_of_photos_straight_down_a_turned_mount_is_told_and_no_heading(
    scene_factory: Callable[..., Scene], degrees: float
) -> None:
    """Both are the same there."""
    survey = straight_down(scene_factory(4, **NADIR))
    assert find_other_directions(survey) is None
    for wrong in (mounted(survey, "z", degrees), headed(survey, degrees)):
        message = find_other_directions(wrong)
        assert message is not None
        assert message.text.startswith("The camera seems to be mounted in another direction")


@pytest.mark.parametrize("degrees", [90, 180, -90])
def test_a_turned_mount_of_oblique_photos_is_no_wrong_heading(
    scene_factory: Callable[..., Scene], degrees: float
) -> None:
    message = find_other_directions(mounted(scene_factory(4, **OBLIQUE).survey, "z", degrees))
    assert message is not None
    assert "about the optical axis" in message.text


@pytest.mark.parametrize("shape", [OBLIQUE, NADIR])
@pytest.mark.parametrize("seed", range(6))
def test_headings_that_are_right_up_to_their_errors_are_believed(
    scene_factory: Callable[..., Scene], seed: int, shape: dict[str, float]
) -> None:
    survey = scene_factory(seed, **shape).survey
    for degrees in (0, -15, 15):
        assert find_other_directions(headed(survey, degrees)) is None


@pytest.mark.parametrize("tilt_deg", [45, -50])
def test_the_results_take_another_mount_into_account(tilt_deg: float) -> None:
    """As of a camera that looks ahead, where the project states straight down."""
    scene = make_scene(4, frames=5, labels=16, tilt=0.2)
    wrong = mounted(scene.survey, "x", tilt_deg)
    assert wrong.telemetry is not None
    turn = Rotation.from_euler("x", tilt_deg, degrees=True).as_matrix()
    prior = replace(wrong.telemetry, gimbal_from_camera=wrong.telemetry.gimbal_from_camera @ turn)
    refined, messages = adjust_survey(replace(wrong, telemetry=prior), SolveOptions())
    assert [one.code for one in messages if one.level != "info"] == ["mount-turned"]
    assert f"all photos turned by {-tilt_deg:+d} degrees up or down (pitch)" in messages[0].text
    assert_points_are_right(refined.adjustment, scene)


def assert_points_are_right(adjustment: Adjustment, scene: Scene) -> None:
    """Compare the adjusted points with the truth."""
    place, covariance = adjustment.points()
    row = adjustment.label_rows(scene.survey.label)  # -1 where no photo shows the point
    off = place - scene.world[np.argsort(row)[-len(place) :]]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
    assert squares.max() < chi2.ppf(1.0 - 1e-5, 3)


NORTH_EAST_DOWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""World (east, north, up) from north, east, down."""

CAMERA_FROM_GIMBAL = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""The gimbal's x axis is the optical axis, and its -z axis is image up."""


def with_poses_of_photos(survey: Survey) -> Survey:
    """The survey with a table of poses in place of its track."""
    prior, seeds = survey.telemetry, survey.seeds
    assert prior is not None
    assert seeds is not None
    count = len(survey.frame_id)
    gimbal = seeds.world_from_camera @ CAMERA_FROM_GIMBAL
    track = PhotoExposures(
        frame_id=survey.frame_id,
        position_world_m=seeds.center_world_m,
        world_from_body=gimbal,
        world_from_gimbal=gimbal,
        sigma_position_m=np.full((count, 2), 2.0),
        sigma_attitude_rad=np.full((count, 2), 0.03),
        by_mount=np.zeros(count, dtype=np.bool_),
        source="poses.csv",
    )
    prior = replace(
        prior, gimbal_from_camera=CAMERA_FROM_GIMBAL.T, lever_arm_m=np.zeros(3), clock_sigma_s=1e-3
    )
    return replace(survey, track=track, telemetry=prior)


def with_opposite_headings(survey: Survey) -> Survey:
    """The survey with headings that count counterclockwise, by scipy's angles."""
    track, seeds = survey.track, survey.seeds
    assert isinstance(track, PhotoExposures)
    assert seeds is not None
    angles = Rotation.from_matrix(NORTH_EAST_DOWN.T @ track.world_from_gimbal).as_euler("ZYX")
    angles[:, 0] *= -1.0
    gimbal = NORTH_EAST_DOWN @ Rotation.from_euler("ZYX", angles).as_matrix()
    return replace(
        survey,
        track=replace(track, world_from_body=gimbal, world_from_gimbal=gimbal),
        seeds=replace(seeds, world_from_camera=gimbal @ CAMERA_FROM_GIMBAL.T),
    )


@pytest.mark.parametrize(("seed", "tilt"), [(3, 0.2), (5, 0.7)])
def test_headings_that_count_counterclockwise_are_named_and_corrected(
    seed: int, tilt: float
) -> None:
    scene = make_scene(seed, frames=5, labels=16, tilt=tilt)
    right = with_poses_of_photos(scene.survey)
    assert find_common_error(right) is None
    refined, messages = adjust_survey(with_opposite_headings(right), SolveOptions())
    assert [one.code for one in messages if one.level != "info"] == ["mount-turned"]
    assert "seem to be counted counterclockwise" in messages[0].text
    assert_points_are_right(refined.adjustment, scene)


@pytest.mark.parametrize("up_m", [290.0, 40.0, -12.0])
@pytest.mark.parametrize("seed", [4, 5, 6])
def test_heights_that_are_all_wrong_are_no_other_direction(
    scene_factory: Callable[..., Scene], seed: int, up_m: float
) -> None:
    survey = scene_factory(seed, **OBLIQUE).survey
    seeds = survey.seeds
    assert seeds is not None
    center = seeds.center_world_m + np.array([0.0, 0.0, up_m])
    assert find_common_error(replace(survey, seeds=replace(seeds, center_world_m=center))) is None
