"""Photos with a place and no attitude: minutes apart, turned as they like, nothing left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import PlaceOnly, place_only
from scenes import make_scene
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Floats
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.options import GroundOptions, SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.seed.headings import find_headings


def adjusted(scene: PlaceOnly) -> tuple[Refined, tuple[Message, ...]]:
    survey, _ = find_headings(scene.survey)
    refined, messages = refine(survey, SolveOptions())
    return refined, messages


@pytest.mark.parametrize(("seed", "pitch_deg"), [(3, -90.0), (4, -90.0), (2, -45.0), (4, -45.0)])
def test_every_photo_stays_in_and_finds_its_heading(seed: int, pitch_deg: float) -> None:
    scene = place_only(seed, frames=5, labels=11, pitch_deg=pitch_deg)
    refined, messages = adjusted(scene)

    assert refined.pick_reason == {}
    assert len(refined.adjustment.survey.frame_id) == 5
    assert refined.adjustment.minimum.converged
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 3.0
    assert not [m for m in messages if m.level == "warning"]


def test_places_turn_headings_back_that_are_wrong_by_half_a_turn() -> None:
    # On ground that is known to be level and even, by exact tapes: iterations alone end nowhere.
    scene = place_only(
        3, frames=5, labels=11, ground=GroundOptions(slope_sigma_deg=0.5, roughness_sigma_m=0.0)
    )
    refined, messages = refine(replace(scene.survey, tape_scale_sigma=0.0), SolveOptions())

    assert refined.adjustment.minimum.converged
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 3.0
    assert [message.code for message in messages] == ["gimbal-off"]


def test_stated_yaw_sigmas_of_120_degrees_have_their_effect() -> None:
    scene = place_only(1, frames=5, labels=11, attitude_sigma_deg=(6.0, 120.0))
    refined, _ = adjusted(scene)

    assert refined.pick_reason == {}
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 3.0


def test_a_wrong_label_does_not_turn_a_photo() -> None:
    scene = place_only(2, frames=5, labels=11)
    survey = scene.survey
    mine = np.flatnonzero(survey.pick_frame == 2)[:2]
    pixel = survey.pixel_px.copy()
    pixel[mine] = pixel[mine[::-1]]  # two labels swapped
    turned, _ = find_headings(replace(survey, pixel_px=pixel))

    assert off_deg(turned, scene).max() < 30.0


def test_a_heading_that_the_picks_contradict_counts_as_unknown() -> None:
    scene = place_only(0, frames=5, labels=11)
    survey = scene.survey
    seeds, track = survey.seeds, survey.track
    assert seeds is not None
    assert isinstance(track, PhotoExposures)
    heading = np.where(np.arange(5) == 3, 177.0, 0.0)
    wrong = Rotation.from_euler("z", heading[:, None], degrees=True).as_matrix()
    stated = replace(
        survey,
        seeds=replace(seeds, world_from_camera=wrong @ scene.rotation),
        track=replace(
            track,
            world_from_gimbal=wrong
            @ scene.rotation
            @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]]).T,
            sigma_attitude_rad=np.tile(np.radians([6.0, 15.0]), (5, 1)),
        ),
    )
    turned, messages = find_headings(stated)

    assert off_deg(turned, scene).max() < 30.0
    assert [m.code for m in messages] == ["course-contradicted"]
    assert "in the tags of 1 photo: p3.jpg (1" in messages[0].text
    refined, _ = refine(turned, SolveOptions())
    assert refined.pick_reason == {}
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 3.0


def test_a_photo_without_neighbour_or_attitude_is_placed_by_its_picks() -> None:
    scene = place_only(1, frames=5, labels=11)
    survey = scene.survey
    seeds, track = survey.seeds, survey.track
    assert seeds is not None
    assert isinstance(track, PhotoExposures)
    known = np.arange(5) != 4
    from_gimbal = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])
    rotation = np.where(known[:, None, None], scene.rotation, seeds.world_from_camera)
    stated = replace(
        survey,
        seeds=replace(seeds, world_from_camera=rotation),
        track=replace(
            track,
            world_from_gimbal=rotation @ from_gimbal.T,
            sigma_attitude_rad=np.radians(np.where(known[:, None], [3.0, 3.0], [6.0, 180.0])),
            by_mount=~known,
        ),
    )
    turned, _ = find_headings(stated)

    assert turned.seeds is not None
    np.testing.assert_array_equal(turned.seeds.world_from_camera[:4], rotation[:4])
    assert off_deg(turned, scene)[4] < 30.0


def test_a_flight_log_is_left_as_it_is() -> None:
    survey = make_scene(3, frames=2).survey

    assert find_headings(survey) == (survey, ())


def test_pose_errors_follow_their_sigmas() -> None:
    # heights and tilts: positions in the plane and the heading hang on biases common to a survey
    errors = np.array([tilts(place_only(k, frames=4, labels=9)) for k in range(10, 13)])

    assert np.sum(errors**2) < chi2.isf(0.001, errors.size)


def tilts(scene: PlaceOnly) -> Floats:
    return scene.pose_errors(adjusted(scene)[0].adjustment)[:, 3:5]


def off_deg(survey: Survey, scene: PlaceOnly) -> Floats:
    """(F,) angle between seeds and truth."""
    assert survey.seeds is not None
    between = np.swapaxes(survey.seeds.world_from_camera, 1, 2) @ scene.rotation
    angle: Floats = np.degrees(np.linalg.norm(Rotation.from_matrix(between).as_rotvec(), axis=1))
    return angle
