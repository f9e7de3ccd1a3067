"""Photos with places and no heading: ties between them tell how each was turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import LENS, PlaceOnly, place_only
from scenes import cv_pixels

from uavgram.geometry.motion.rotation import GIMBAL_FROM_CAMERA
from uavgram.model.arrays import Floats
from uavgram.model.frames import PhotoExposures
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Sightings
from uavgram.stages.refine.refine import refine
from uavgram.stages.seed.headings import (
    find_attitudes_by_ties,
    find_headings,
    measure_tilts,
    measure_turns,
)

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
        ties=ties.without(np.zeros(len(frame), np.bool_))[0],
    )
    return replace(scene, survey=few)


def off_deg(scene: PlaceOnly, rotation: Floats) -> Floats:
    """(F,) by how much attitudes are turned about up from the true ones."""
    return np.asarray(np.abs(np.degrees(measure_turns(rotation, scene.rotation))))


@pytest.mark.parametrize("pitch_deg", [-90.0, -60.0])
def test_ties_turn_photos_to_their_headings(pitch_deg: float) -> None:
    """The places are three metres off, 40 m up: headings to some degrees."""
    scene = with_ties(place_only(3, frames=6, labels=11, pitch_deg=pitch_deg))
    assert scene.survey.seeds is not None
    assert off_deg(scene, scene.survey.seeds.world_from_camera).max() > 60.0
    turned, _ = find_headings(scene.survey)
    assert turned.seeds is not None
    assert off_deg(scene, turned.seeds.world_from_camera).max() < 25.0
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
    assert off_deg(scene, seeds.world_from_camera).max() < 25.0
    # What the adjustment holds them to is the same, and says next to nothing.
    row = [track.frame_id.index(name) for name in turned.frame_id]
    held = track.world_from_gimbal[row] @ GIMBAL_FROM_CAMERA
    np.testing.assert_allclose(held, seeds.world_from_camera, atol=1e-9)
    assert (np.linalg.eigvalsh(prior.covariance[:, 3:, 3:]) > 1.0).all()
    refined, _ = refine(turned, SolveOptions())
    assert refined.adjustment.minimum.converged
    assert np.abs(scene.pose_errors(refined.adjustment)).max() < 4.0


def test_ties_that_agree_with_the_mount_tilt_nothing() -> None:
    scene = with_ties(place_only(4, frames=6, labels=11, pitch_deg=-60.0))
    turned, messages = find_headings(scene.survey)
    assert turned.seeds is not None
    assert scene.survey.seeds is not None
    assert messages == ()
    before, after = scene.survey.seeds.world_from_camera, turned.seeds.world_from_camera
    np.testing.assert_allclose(after[:, 2], before[:, 2], atol=1e-12)
