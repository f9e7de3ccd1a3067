"""A camera from photos of a board, as a whole: real sets, bad sets, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import board_scenes as scenes
import cv2
import numpy as np
import pytest

from uavgram.errors import GeometryError
from uavgram.estimation.calibration import reliability
from uavgram.estimation.calibration.adjustment import HeldOut, UndeterminedError
from uavgram.estimation.calibration.problem import Corners, Lens, State, make_lens, pad
from uavgram.estimation.calibration.projection import compute_length_sigmas
from uavgram.estimation.calibration.reliability import (
    CleanedFit,
    adjust_scaled,
    compute_photo_tests,
    estimate_photo_effect,
)
from uavgram.estimation.calibration.two_cameras import find_best_split
from uavgram.model.arrays import Floats
from uavgram.model.board import (
    BoardObservations,
    CalibrationOptions,
    CalibrationResult,
    IntrinsicsPrior,
    LensSetting,
    flat_board,
)
from uavgram.stages.calibrate import calibration
from uavgram.stages.calibrate.assessment import AssessedCalibration
from uavgram.stages.calibrate.calibration import calibrate, refuse_two_cameras

Phantom = tuple[BoardObservations, dict[str, Any], CalibrationResult]
REMOVE = CalibrationOptions(outliers="remove")


def codes(result: CalibrationResult) -> set[str]:
    return {message.code for message in result.messages}


def some(observations: BoardObservations, index: Iterable[int]) -> BoardObservations:
    photos = tuple(observations.photos[i] for i in index)
    return BoardObservations(board=observations.board, photos=photos)


@pytest.fixture(scope="module")
def phantom(data_dir: Path) -> Phantom:
    observations, published = scenes.phantom3(data_dir)
    return observations, published, calibrate(observations, CalibrationOptions())


def test_a_clean_set_gives_the_truth_within_its_covariance() -> None:
    scene = scenes.make_scene(0, photos=20, whole=False, distance=(5, 14))
    result = calibrate(scene.observations, CalibrationOptions(), "mine")
    miss = result.calibration.parameters - scene.parameters
    assert miss @ np.linalg.solve(result.calibration.covariance, miss) < 27.9  # chi2(9), 0.1 %
    assert result.calibration.name == "mine"
    assert result.quality.variance_factor == pytest.approx(1, abs=0.1)
    assert result.quality.photo_probability > 0.01
    np.testing.assert_array_equal(result.calibration.covariance, result.covariance_corners)
    assert codes(result) <= {"correlated-parameters"}
    assert set(result.corners.status) == {"used"}
    assert len(result.corners.status) == sum(len(p.corner) for p in scene.observations.photos)


def test_camera_poses_are_those_in_the_boards_frame_within_their_covariance() -> None:
    scene = scenes.make_scene(1, photos=15)
    result = calibrate(scene.observations, CalibrationOptions())
    poses = result.photos.poses
    expected = -np.einsum("mji,mj->mi", scene.rotation, scene.translation)
    miss = poses.center_world_m - expected
    turn = [
        cv2.Rodrigues(r.T @ t.T)[0].ravel()
        for r, t in zip(poses.world_from_camera, scene.rotation, strict=True)
    ]
    error = np.concatenate([-miss, np.array(turn)], axis=1)  # true minus estimated
    squared = np.einsum("mi,mij,mj->m", error, np.linalg.inv(poses.covariance), error)
    # they share the camera's errors, so they are no independent draws: three of six degrees' sigmas
    assert 1 < squared.mean() < 16
    assert np.sqrt(poses.covariance[:, :3, :3].trace(axis1=1, axis2=2)).max() < 0.2


def test_lens_models_are_compared_and_the_choice_is_said_in_words() -> None:
    scene = scenes.make_scene(2, scenes.BROWN3, photos=10)
    result = calibrate(scene.observations, CalibrationOptions(coefficients=0))
    assert result.options.coefficients == 3
    assert [score.coefficients for score in result.models if score.is_chosen] == [3]
    assert not result.calibration.covariance[6:8].any()  # p1 and p2 are exactly zero
    assert not result.calibration.parameters[6:8].any()
    text = next(m.text for m in result.messages if m.code == "lens-model")
    assert text.startswith("3 distortion coefficients were chosen: the fewest that predict")


WIDE = np.array([380.0, 379, 512, 380, 0.06, 0.02, 0.0, 0.0])
"""A fisheye lens, which a rational one follows far better than a polynomial."""


def wide_scene(seed: int) -> BoardObservations:
    return scenes.make_scene(
        seed, WIDE, "fisheye", photos=6, whole=False, distance=(3, 6)
    ).observations


def test_a_model_whose_coefficients_trade_places_is_no_choice_and_the_choice_says_so() -> None:
    observations = wide_scene(1)
    rational = calibrate(observations, CalibrationOptions(coefficients=8))
    assert compute_length_sigmas(rational.calibration, tilt_rad=0.0).medians[0] > 1  # 170 %
    result = calibrate(observations, CalibrationOptions(coefficients=0))
    assert result.options.coefficients < 8
    assert compute_length_sigmas(result.calibration, tilt_rad=0.0).medians[0] < 0.01
    text = next(m.text for m in result.messages if m.code == "lens-model")
    assert "8 coefficients were no choice: the photos do not determine its coefficients" in text
    assert [bool(score.dropped) for score in result.models] == [False, False, True]


def test_a_rational_lens_that_the_photos_determine_stays_the_choice() -> None:
    result = calibrate(wide_scene(0), CalibrationOptions(coefficients=0))
    assert result.options.coefficients == 8
    assert not any(score.dropped for score in result.models)


@pytest.mark.parametrize("lost", [{8}, {5, 8}])
def test_candidates_that_the_photos_leave_undetermined_drop_out(
    monkeypatch: pytest.MonkeyPatch, lost: set[int]
) -> None:
    """Whether 8 are regular is decided by rounding on some machines: any step may find it out."""
    scene = scenes.make_scene(2, scenes.BROWN3, photos=6)

    def snoop(lens: Lens, *arguments: *tuple[Corners, State, CalibrationOptions]) -> CleanedFit:
        count = np.count_nonzero(np.abs(lens.basis).sum(axis=1)) - 4
        if count in lost:
            raise UndeterminedError(f"the photos do not determine k{count}")
        return reliability.remove_outliers(lens, *arguments)

    monkeypatch.setattr(calibration, "remove_outliers", snoop)
    monkeypatch.setattr(calibration, "choose_simplest", lambda held: len(held) - 1)
    result = calibrate(scene.observations, CalibrationOptions(coefficients=0))
    assert {score.coefficients for score in result.models if score.dropped} == lost
    text = next(m.text for m in result.messages if m.code == "lens-model")
    assert "8 coefficients were no choice: the photos do not determine k8" in text


def test_photos_that_determine_no_model_at_all_are_refused_in_words() -> None:
    scene = scenes.make_scene(0, scenes.BROWN3, photos=3, tilt_deg=1e-6)
    with pytest.raises(GeometryError, match="the photos do not determine"):
        calibrate(scene.observations, CalibrationOptions(coefficients=0))


def test_a_rational_lens_is_a_camera_of_twelve_parameters() -> None:
    scene = scenes.make_scene(3, scenes.BROWN8, photos=14, noise=0.02, whole=False, distance=(4, 9))
    result = calibrate(scene.observations, CalibrationOptions(coefficients=8))
    assert result.calibration.parameter_names[-3:] == ("k4", "k5", "k6")
    assert result.covariance_given_sigma.shape == (12, 12)
    assert result.quality.variance_factor == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_real_set_tells_the_photo_that_does_not_fit_and_true_sigmas(
    data_dir: Path, side: str
) -> None:
    observations = scenes.opencv_chess(data_dir, side)
    result = calibrate(observations, REMOVE)
    reported = calibrate(observations, CalibrationOptions())
    assert reported.corners.status.count("removed") == 0
    assert result.quality.held_out_px is not None
    assert result.quality.held_out_px < 0.3
    assert {"photos-disagree", "image-not-covered", "correlated-parameters"} <= codes(result)
    assert "one-roll" not in codes(result)
    text = next(m.text for m in result.messages if m.code == "correlated-parameters")
    assert "fx and fy 0.9" in text
    assert "k1 and k2 -0.9" in text
    factor = result.quality.photo_factor
    assert factor is not None
    np.testing.assert_allclose(result.calibration.covariance, factor * result.covariance_corners)
    np.testing.assert_allclose(
        result.covariance_corners, result.quality.sigma_scale**2 * result.covariance_given_sigma
    )


def test_six_photos_give_the_published_camera_of_thirty_within_three_sigma(
    phantom: Phantom,
) -> None:
    _, published, result = phantom
    camera = result.calibration
    expected = np.array(
        [published["fx"], published["fy"], published["cx"], published["cy"], *published["dist"]]
    )
    theirs = np.array(
        [*published["fc_3sigma"], *published["cc_3sigma"], *published["kc_3sigma"]]
    ) / 3  # fmt: skip
    for ours in (camera.covariance, result.covariance_corners):
        combined = np.sqrt(np.diag(ours) + theirs**2)
        assert (np.abs(camera.parameters - expected) < 3 * combined).all()


def test_photos_of_one_roll_are_told_and_cy_gets_its_large_sigma(phantom: Phantom) -> None:
    *_, result = phantom
    assert {"one-roll", "pixels-not-square", "few-photos", "photos-disagree"} <= codes(result)
    sigma = np.sqrt(np.diag(result.covariance_corners))
    assert sigma[3] > 30  # pixels; the published one, of 30 photos, is 32
    assert sigma[3] > 10 * sigma[2]
    text = next(m.text for m in result.messages if m.code == "one-roll")
    assert "cy is known to 1" in text
    assert "quarter turn" in text


def test_lengths_on_a_photo_left_out_are_right_to_six_per_mille(phantom: Phantom) -> None:
    observations, *_ = phantom
    board = observations.board.corner_board_m
    square = CalibrationOptions(aspect=1.0, coefficients=3)
    rng = np.random.default_rng(0)
    means = []
    for out in range(6):
        rest = [i for i in range(6) if i != out]
        camera = calibrate(some(observations, rest), square).calibration
        fx, fy, cx, cy = camera.parameters[:4]
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        photo = observations.photos[out]
        place = board[photo.corner, :2]
        ends = [np.argmin(place @ d) for d in ([1, 1], [1, -1], [-1, 1], [-1, -1])]
        _, turn, shift = cv2.solvePnP(
            board[photo.corner][ends], photo.pixel_px[ends], matrix, camera.parameters[4:]
        )
        rotation = cv2.Rodrigues(turn)[0]
        ray = cv2.undistortPoints(photo.pixel_px[:, None], matrix, camera.parameters[4:])[:, 0]
        ray = np.column_stack([ray, np.ones(len(ray))]) @ rotation
        center = -rotation.T @ shift[:, 0]
        ground = (center - ray * (center[2] / ray[:, 2:]))[:, :2]
        others = np.setdiff1d(np.arange(len(place)), ends)
        first, second = rng.choice(others, (2, 600))
        length = np.linalg.norm(place[first] - place[second], axis=1)
        long = length >= 0.18
        have = np.linalg.norm(ground[first] - ground[second], axis=1)
        means.append(np.mean(np.abs(have / np.where(long, length, 1) - 1)[long]))
    assert np.mean(means) <= 0.006


def test_a_bent_board_is_advised_and_then_estimated() -> None:
    scene = scenes.make_scene(4, photos=15, bow=(0.06, -0.04))
    flat = calibrate(scene.observations, CalibrationOptions())
    text = next(m.text for m in flat.messages if m.code == "photos-disagree")
    assert "Try --bow paraboloid" in text
    bent = calibrate(scene.observations, CalibrationOptions(bow="paraboloid", bow_sigma_m=0.5))
    assert "photos-disagree" not in codes(bent)
    sigma = np.sqrt(np.diag(bent.bow_covariance_m2))
    assert (np.abs(bent.bow_m - [0.06, -0.04]) < 3.5 * sigma).all()


def test_a_prior_says_what_was_learnt(data_dir: Path) -> None:
    observations, _ = scenes.phantom3(data_dir)
    table = IntrinsicsPrior(
        source="a table of drone cameras",
        parameters=np.array([2300.0, 2300, 1999.5, 1124.5, 0, 0, 0, 0, 0]),
        information=np.diag(np.array([46.0, 46, 40, 40, 0.03, 0.1, 2e-3, 2e-3, 0.2]) ** -2.0),
    )
    options = CalibrationOptions(prior=table)
    result = calibrate(observations, options)
    with_prior = result.calibration
    without = calibrate(observations, CalibrationOptions()).calibration
    assert with_prior.covariance[3, 3] < 0.1 * without.covariance[3, 3]
    assert abs(with_prior.parameters[0] / with_prior.parameters[1] - 1) < 0.02
    text = next(m.text for m in result.messages if m.code == "intrinsics-prior")
    assert text.startswith(
        "Known beforehand (a table of drone cameras); sigma before and after: fx"
    )


def test_exif_is_compared_with_what_was_found() -> None:
    scene = scenes.make_scene(5)

    def codes_with(**changes: Sequence[object]) -> set[str]:
        setting: dict[str, Any] = {
            "camera": "DJI FC330",
            "focal_length_mm": 3.6,
            "focal_length_px": 800.0,
        }
        photos = [
            replace(
                photo,
                setting=LensSetting(**setting | {k: v[i % len(v)] for k, v in changes.items()}),
            )
            for i, photo in enumerate(scene.observations.photos)
        ]
        observations = BoardObservations(board=scene.observations.board, photos=tuple(photos))
        return codes(calibrate(observations, CalibrationOptions()))

    assert not {"exif-focal", "two-cameras", "zoom-changed", "focus-changed"} & codes_with()
    assert "exif-focal" in codes_with(focal_length_px=[500.0])
    # 820 px of a diagonal of 1280: 27.7 mm of one of 43.3
    assert "exif-focal" not in codes_with(focal_length_px=[None], focal_length_35mm=[27.5])
    assert "exif-focal" in codes_with(focal_length_px=[None], focal_length_35mm=[20.0])
    assert "two-cameras" in codes_with(camera=["DJI FC330", "DJI FC220"])
    assert "zoom-changed" in codes_with(focal_length_mm=[3.6, 4.4])
    assert "focus-changed" in codes_with(focus_distance_m=[1.0, 3.0])


def test_a_removed_photo_keeps_its_place_and_reason() -> None:
    observations = scenes.make_scene(6).observations
    photos = list(observations.photos)
    pixel = photos[2].pixel_px
    photos[2] = scenes.replace_pixels(photos[2], pixel + 3 * np.sin(pixel[:, ::-1] / 20))
    result = calibrate(replace(observations, photos=tuple(photos)), REMOVE)
    assert result.photos.status[2] == "removed"
    assert result.photos.status.count("used") == 11
    assert "times as far off as in the median photo" in result.photos.reason[2] or (
        "of its corners do not fit" in result.photos.reason[2]
    )
    assert result.photos.rms_px[2] > 10 * np.median(result.photos.rms_px)
    assert np.isnan(result.photos.held_out_px[2])
    assert "photo-removed" in codes(result)
    assert np.array(result.corners.status)[result.corners.photo == 2].tolist() == ["removed"] * 54


def test_what_cannot_be_used_is_said() -> None:
    observations = scenes.make_scene(7, photos=8).observations
    photos = list(observations.photos)
    first = photos[0]
    few = replace(
        photos[1],
        corner=first.corner[:5],
        pixel_px=photos[1].pixel_px[:5],
        sigma_px=first.sigma_px[:5],
    )
    line = replace(
        photos[2],
        corner=first.corner[:9],
        pixel_px=photos[2].pixel_px[:9],
        sigma_px=first.sigma_px[:9],
    )
    twin = replace(first, file="again.jpg")
    result = calibrate(replace(observations, photos=(first, few, line, *photos[3:], twin)), REMOVE)
    assert len(result.photos.file) == 6
    reasons = dict(result.photos.unusable)
    assert reasons["again.jpg"] == "the same picture as photo00.jpg"
    assert "only 5 corners" in reasons["photo01.jpg"]
    assert "in one line" in reasons["photo02.jpg"]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_photos_are_one_clear_message(count: int) -> None:
    observations = some(scenes.make_scene(8, photos=3).observations, range(count))
    with pytest.raises(GeometryError, match=f"^{count} usable photo.* do not determine a camera"):
        calibrate(observations, REMOVE)


def test_the_same_picture_many_times_is_one_clear_message() -> None:
    photo = scenes.make_scene(8, photos=1).observations.photos[0]
    photos = tuple(replace(photo, file=f"{i}.jpg") for i in range(5))
    with pytest.raises(GeometryError, match=r"1 usable photo.*the same picture as 0\.jpg"):
        calibrate(BoardObservations(board=flat_board(9, 6, 1.0), photos=photos), REMOVE)


def test_boards_all_level_are_told() -> None:
    pinhole = np.array([820.0, 815, 511.5, 383.5, 0, 0, 0, 0, 0])
    scene = scenes.make_scene(9, pinhole, photos=12, tilt_deg=3)
    try:
        result = calibrate(scene.observations, CalibrationOptions(coefficients=3))
    except GeometryError as error:
        assert "tilted" in str(error)  # noqa: PT017
    else:
        assert "few-tilts" in codes(result)
        assert result.calibration.covariance[0, 0] > 20**2


def test_photos_of_two_sizes_are_refused() -> None:
    photos = scenes.make_scene(10, photos=3).observations.photos
    with pytest.raises(ValueError, match="one size"):
        BoardObservations(
            board=flat_board(9, 6, 1.0), photos=(*photos, replace(photos[0], width_px=4000))
        )


# Photos of two cameras in one calibration: told, named, and never seen where there is one.


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
    monkeypatch.setattr(calibration, "find_best_split", None)

    assert refuse_two_cameras(found) == ()


def test_too_few_photos_are_not_split() -> None:
    assert find_best_split(joined(scenes.make_scene(8, photos=5)).fit) is None
