"""Photos with a place and no attitude: minutes apart, turned as they like, nothing left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import LENS, PlaceOnly, place_only
from scenes import cv_pixels, make_scene
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from whole_surveys import with_all

from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.motion.rotation import GIMBAL_FROM_CAMERA
from uavgram.model.arrays import Floats
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.options import GroundOptions, SolveOptions
from uavgram.model.survey import Sightings, Survey
from uavgram.stages.refine import refine
from uavgram.stages.seed.headings import (
    find_attitudes_by_ties,
    find_headings,
    measure_tilts,
    measure_turns,
)


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
    # On ground that is known to be level and even, by exact tapes: iterations from these headings
    # end nowhere. The stated sigmas of yaw allow them, so there is nothing to report.
    scene = place_only(
        3, frames=5, labels=11, ground=GroundOptions(slope_sigma_deg=0.5, roughness_sigma_m=0.0)
    )
    refined, messages = refine(replace(scene.survey, tape_scale_sigma=0.0), SolveOptions())

    assert refined.adjustment.minimum.converged
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 3.0
    assert not messages


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


# Photos with places and no heading: ties between them tell how each was turned.


TIES = 600


def with_ties(scene: PlaceOnly) -> PlaceOnly:
    """The scene with ties, and with so few picks that they tell no heading."""
    rng = np.random.default_rng(5)
    world = np.column_stack([rng.uniform(-45, 45, (TIES, 2)), rng.normal(0, 0.05, TIES)])
    frame, point, pixel = [], [], []
    for k in range(len(scene.center)):
        seen, depth = cv_pixels(LENS, scene.center[k], scene.rotation[k], world)
        seen = seen + rng.normal(0, 0.15, seen.shape)
        inside = (depth > 1) & (seen > 5).all(axis=1) & (seen < [2395, 1795]).all(axis=1)
        rows = np.flatnonzero(inside)
        frame += [k] * len(rows)
        point += rows.tolist()
        pixel += seen[rows].tolist()
    ties = Sightings(
        frame=np.array(frame),
        point=np.array(point),
        pixel_px=np.array(pixel),
        sigma_px=np.full(len(frame), 0.15),
        row=np.arange(len(frame)),
        pick=np.full(TIES, -1),
    )
    survey = scene.survey
    first = np.unique(survey.pick_frame, return_index=True)[1]
    few = replace(
        survey,
        pick_frame=survey.pick_frame[first],
        pick_label=survey.pick_label[first],
        pixel_px=survey.pixel_px[first],
        pick_sigma_px=survey.pick_sigma_px[first],
        ties=ties.remove(np.zeros(len(frame), np.bool_))[0],
    )
    return replace(scene, survey=few)


def yaw_errors_deg(scene: PlaceOnly, rotation: Floats) -> Floats:
    """(F,) by how much attitudes are turned about up from the true ones."""
    return np.asarray(np.abs(np.degrees(measure_turns(rotation, scene.rotation))))


@pytest.mark.parametrize("pitch_deg", [-90.0, -60.0])
def test_ties_turn_photos_to_their_headings(pitch_deg: float) -> None:
    """The places are three metres off, 40 m up: headings to some degrees."""
    scene = with_ties(place_only(3, frames=6, labels=11, pitch_deg=pitch_deg))
    assert scene.survey.seeds is not None
    assert yaw_errors_deg(scene, scene.survey.seeds.world_from_camera).max() > 60.0
    turned, _ = find_headings(scene.survey)
    assert turned.seeds is not None
    assert yaw_errors_deg(scene, turned.seeds.world_from_camera).max() < 25.0
    found = find_attitudes_by_ties(scene.survey)
    assert found is not None
    differences = found @ scene.rotation.transpose(0, 2, 1)
    np.testing.assert_allclose(differences, np.tile(differences[0], (6, 1, 1)), atol=0.02)


def test_places_that_contradict_the_ties_turn_nothing() -> None:
    scene = with_ties(place_only(3, frames=6, labels=11))
    seeds = scene.survey.seeds
    assert seeds is not None
    mixed = seeds.center_world_m[[3, 0, 5, 1, 4, 2]] * [20.0, 20.0, 1.0]
    survey = replace(scene.survey, seeds=replace(seeds, center_world_m=mixed))
    assert find_attitudes_by_ties(survey) is None


def test_ties_tilt_photos_that_do_not_look_where_the_mount_says() -> None:
    """The project says straight down; they look 50 degrees below the horizon."""
    scene = with_ties(place_only(3, frames=6, labels=11, pitch_deg=-50.0, mount_pitch_deg=-90.0))
    assert scene.survey.seeds is not None
    turned, messages = find_headings(scene.survey)
    seeds, prior, track = turned.seeds, turned.telemetry, turned.track
    assert seeds is not None
    assert prior is not None
    assert isinstance(track, PhotoExposures)
    assert [one.code for one in messages] == ["attitude-by-ties"]
    assert len(messages[0].frames) == 6
    assert measure_tilts(scene.survey.seeds.world_from_camera, scene.rotation).min() > 0.5
    assert measure_tilts(seeds.world_from_camera, scene.rotation).max() < 0.25
    assert yaw_errors_deg(scene, seeds.world_from_camera).max() < 25.0
    # What the adjustment holds them to is the same, and says next to nothing.
    row = [track.frame_id.index(name) for name in turned.frame_id]
    held = track.world_from_gimbal[row] @ GIMBAL_FROM_CAMERA
    np.testing.assert_allclose(held, seeds.world_from_camera, atol=1e-9)
    assert (np.linalg.eigvalsh(prior.covariance[:, 3:, 3:]) > 1.0).all()
    adjustment = with_all(turned).adjustment
    assert adjustment.minimum.converged
    assert np.abs(scene.pose_errors(adjustment)).max() < 4.0


def test_ties_that_agree_with_the_mount_tilt_nothing() -> None:
    scene = with_ties(place_only(4, frames=6, labels=11, pitch_deg=-60.0))
    turned, messages = find_headings(scene.survey)
    assert turned.seeds is not None
    assert scene.survey.seeds is not None
    assert messages == ()
    before, after = scene.survey.seeds.world_from_camera, turned.seeds.world_from_camera
    np.testing.assert_allclose(after[:, 2], before[:, 2], atol=1e-12)
