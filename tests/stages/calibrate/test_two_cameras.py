"""Photos of two cameras in one calibration: told, named, and never seen where there is one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import board_scenes as scenes
import numpy as np
import pytest

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import HeldOut
from uavgram.estimation.calibration.problem import State, make_lens, pad
from uavgram.estimation.calibration.reliability import (
    CleanedFit,
    adjust_scaled,
    compute_photo_tests,
    estimate_photo_effect,
)
from uavgram.estimation.calibration.two_cameras import find_best_split
from uavgram.model.arrays import Floats
from uavgram.model.board import BoardObservations, CalibrationOptions
from uavgram.stages.calibrate import two_cameras
from uavgram.stages.calibrate.assessment import AssessedCalibration
from uavgram.stages.calibrate.calibrate import calibrate
from uavgram.stages.calibrate.two_cameras import refuse_two_cameras


def judged(observations: BoardObservations, start: State) -> AssessedCalibration:
    """Adjusted from the truth, as one camera on a flat board."""
    options = CalibrationOptions()
    corners = pad(observations, options.bow)
    fit, scale = adjust_scaled(make_lens(options), corners, start, options)
    none = np.zeros(len(observations.photos))
    snooped = CleanedFit(fit, scale, np.zeros(corners.weight.shape, bool), none > 0, none)
    effect = estimate_photo_effect(fit, compute_photo_tests(fit, "residuals"), 1.0)
    held = HeldOut(none, none)
    return AssessedCalibration(observations, options, corners, snooped, fit, held, effect)


def joined(*parts: scenes.Scene) -> AssessedCalibration:
    """Scenes of one board as one set of photos, numbered through."""
    photos = [photo for scene in parts for photo in scene.observations.photos]
    named = tuple(replace(photo, file=f"p{i:02d}.jpg") for i, photo in enumerate(photos))
    states = [scenes.true_state(scene, scenes.BROWN5) for scene in parts]
    start = State(
        scenes.BROWN5,
        np.zeros(0),
        np.concatenate([state.camera_from_board for state in states]),
        np.concatenate([state.middle_camera_m for state in states]),
    )
    return judged(BoardObservations(board=parts[0].observations.board, photos=named), start)


def two(
    seed: int, change: tuple[float, ...], first: int = 8, second: int = 8
) -> AssessedCalibration:
    """Photos of a camera, and of another one that differs by so much."""
    other = scenes.BROWN5 + np.array(change)
    return joined(
        scenes.make_scene(seed, photos=first),
        scenes.make_scene(seed + 100, parameters=other, photos=second),
    )


ZOOM = (160.0, 160.0, 0, 0, 0, 0, 0, 0, 0)
SHIFT = (0.0, 0.0, 15.0, -10.0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("change", [ZOOM, SHIFT])
def test_each_photo_is_put_with_its_own_camera(change: tuple[float, ...]) -> None:
    split = find_best_split(two(1, change, 7, 9).fit)

    assert split is not None
    assert split.group.tolist() == [0] * 7 + [1] * 9
    assert split.distance > 3
    assert split.decision > 0.3


def test_the_message_says_which_photos_are_of_which_camera_and_what_to_do() -> None:
    with pytest.raises(GeometryError, match="of two cameras") as refused:
        refuse_two_cameras(two(2, ZOOM))

    text = str(refused.value)
    assert "p00.jpg to p07.jpg (8 photos) ask for a focal length of 8" in text
    assert "p08.jpg to p15.jpg (8 photos) for 9" in text
    assert "Calibrate each of the two by itself" in text


def test_photos_in_turn_are_named_one_by_one() -> None:
    parts = two(3, ZOOM, 6, 6)
    order = [0, 6, 1, 7, 2, 8, 3, 9, 4, 10, 5, 11]
    photos = tuple(parts.observations.photos[i] for i in order)
    observations = replace(parts.observations, photos=photos)
    with pytest.raises(GeometryError, match=r"p00\.jpg, p01\.jpg, p02\.jpg, p03\.jpg, p04\.jpg"):
        refuse_two_cameras(judged(observations, parts.fit.state.take(np.array(order))))


def test_three_photos_of_another_zoom_are_enough() -> None:
    with pytest.raises(GeometryError, match=r"p08\.jpg to p10\.jpg \(3 photos\)"):
        refuse_two_cameras(two(0, ZOOM, 8, 3))


def test_the_less_sure_is_a_warning_that_names_the_groups() -> None:
    (message,) = refuse_two_cameras(two(4, (5.0, 5.0, 2.0, 2.0, 0, 0, 0, 0, 0)))

    assert (message.level, message.code) == ("warning", "two-cameras")
    assert "p00.jpg to p07.jpg (8 photos)" in message.text
    assert "calibrate each of the two by itself" in message.text


def test_the_left_and_the_right_camera_of_a_pair_are_told_apart(data_dir: Path) -> None:
    left, right = (scenes.opencv_chess(data_dir, side) for side in ("left", "right"))
    both = BoardObservations(board=left.board, photos=left.photos + right.photos)
    with pytest.raises(GeometryError, match=r"left01\.jpg to left14\.jpg \(13 photos\)") as refused:
        calibrate(both, CalibrationOptions())

    assert "right01.jpg to right14.jpg (13 photos)" in str(refused.value)


def held_in_two_ways(seed: int, bow: Floats) -> AssessedCalibration:
    """A bent board, near and tilted in half of the photos, far and level in the others."""
    return joined(
        scenes.make_scene(seed, photos=8, bow=bow, distance=(6, 7), tilt_deg=45),
        scenes.make_scene(seed + 5000, photos=8, bow=bow, distance=(13, 15), tilt_deg=20),
    )


def test_a_bent_board_is_no_second_camera_however_it_was_held() -> None:
    found = held_in_two_ways(7, np.random.default_rng(7).normal(0, 0.1, 2))

    assert found.effect.probability < 0.01
    split = find_best_split(found.fit)
    assert split is not None
    assert split.distance > 0.8  # as a flat board it would seem one
    assert refuse_two_cameras(found) == ()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_rolling_shutter_is_no_second_camera(seed: int) -> None:
    scene = scenes.make_scene(seed, photos=14)
    drift = np.random.default_rng(seed).normal(0, 3, (14, 2))
    photos = tuple(
        scenes.replace_pixels(
            photo, photo.pixel_px + np.outer(photo.pixel_px[:, 1] / photo.height_px, drift[i])
        )
        for i, photo in enumerate(scene.observations.photos)
    )
    observations = replace(scene.observations, photos=photos)
    found = judged(observations, scenes.true_state(scene, scenes.BROWN5))

    assert found.effect.probability < 0.01
    assert refuse_two_cameras(found) == ()


def test_photos_that_agree_are_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    found = joined(scenes.make_scene(7, photos=10))
    monkeypatch.setattr(two_cameras, "find_best_split", None)

    assert refuse_two_cameras(found) == ()


def test_too_few_photos_are_not_split() -> None:
    assert find_best_split(joined(scenes.make_scene(8, photos=5)).fit) is None
