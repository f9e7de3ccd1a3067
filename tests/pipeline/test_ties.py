"""Tie points of small photos with known poses: near their lines, with sigmas that say how near."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tied_photos import CAMERA, epipolar, flight, write_photos

from uavgram.model.frames import Poses
from uavgram.pipeline.ties import Scene, TieSearch, find_ties


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    poses = flight()
    path = write_photos(tmp_path_factory.mktemp("tied"), poses)
    return Scene(
        frame_id=poses.frame_id, path=path, calibration=CAMERA, poses=poses, ground_sigma_m=0.3
    )


@pytest.fixture(scope="module")
def guided(scene: Scene) -> TieSearch:
    return find_ties(scene)


def check(found: TieSearch) -> None:
    off, z = epipolar(flight(), found.ties)
    assert np.median(np.abs(off)) < 0.2
    assert (np.abs(off) < 3.0).all()
    # some 300 points: 4 % of sigma, and the bar
    assert 0.85 < np.sqrt((z**2).mean()) < 1.2


def test_ties_lie_on_their_true_lines_as_well_as_they_say(guided: TieSearch) -> None:
    check(guided)


def test_every_photo_is_tied_and_long_ties_are_there(guided: TieSearch) -> None:
    sightings = Counter(guided.ties.image)
    length = Counter(Counter(guided.ties.tie).values())

    assert set(sightings) == set(flight().frame_id)
    assert min(sightings.values()) >= 40
    assert max(sightings.values()) <= 160
    assert length[4] + length[5] >= 10
    assert len(guided.matched) >= 8


def test_seeds_that_are_wrong_cost_time_and_no_ties(scene: Scene) -> None:
    poses = flight()
    shifted = poses.center_world_m + np.array([[0.0, 0.0, 0.0], [6.0, 5.0, 0.0]] * 2 + [[0.0] * 3])
    wrong = Poses(
        frame_id=poses.frame_id,
        center_world_m=shifted,
        world_from_camera=poses.world_from_camera,
        covariance=poses.covariance * 0.01,
    )

    found = find_ties(replace(scene, poses=wrong))

    check(found)
    assert len(set(found.ties.image)) == 5


def test_photos_that_nothing_is_known_of_are_tied_and_one_of_another_place_stays_alone(
    scene: Scene, tmp_path: Path
) -> None:
    poses = flight()
    far = np.diag([0.0, 0.0, 0.0, 0.0, 1.0])[:, 4:] * [300.0, 0.0, 0.0]
    blank = write_photos(tmp_path, replace(poses, center_world_m=poses.center_world_m + far))[4]
    # beyond the picture of the ground: nothing but noise
    names = *scene.frame_id, "elsewhere.png"

    found = find_ties(replace(scene, frame_id=names, path=(*scene.path, blank), poses=None))

    check(found)
    assert set(found.ties.image) == set(poses.frame_id)
