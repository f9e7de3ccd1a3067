"""A photo of another zoom is named with its factor, and taken out on request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.at_stated_noise import adjust_at_stated_noise
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis, correct_survey
from uavgram.stages.refine.causes.other_camera import MIN_DIFFERENCE, propose_other_zoom
from uavgram.stages.refine.first_values import find_picks_in_lens
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.robust_candidate import MISPLACED

OPTIONS: dict[str, Any] = {"frames": 6, "labels": 10, "lines": 4, "spread": 6.0, "tilt": 0.2}
EXACT: dict[str, Any] = OPTIONS | {"noise": 0.1}


def zoomed(survey: Survey, factor: float, frame: int = 2) -> Survey:
    """The survey with a photo by a focal length of that many times the stated one.

    Both focal lengths of a pinhole camera with Brown's distortion are factors of what is shown
    about the principal point.
    """
    middle = survey.calibration.parameters[2:4]
    pixel = np.array(survey.pixel_px)
    own = survey.pick_frame == frame
    pixel[own] = middle + factor * (pixel[own] - middle)
    return replace(survey, pixel_px=pixel)


def diagnosis(survey: Survey, *, misplaced: bool) -> Diagnosis:
    """The survey adjusted, with or without the picks of f2 as they contradict the rest."""
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, np.ones(len(survey.pick_frame), dtype=np.bool_), none, {})
    taking = taking.leave_out_frame(2, MISPLACED) if misplaced else taking
    return Diagnosis(taking, find_best_minima(taking))


def factor_told(hypothesis: Hypothesis) -> tuple[str, float]:
    """The photo, and the factor that its message tells."""
    assert hypothesis.message is not None
    message = hypothesis.message(None)
    (frame,) = message.frames
    return frame, float(message.text.split("focal length is ")[1].split(" ")[0])


@pytest.mark.parametrize(("factor", "log"), [(1.3, True), (0.8, True), (1.8, True), (1.4, False)])
def test_a_photo_of_another_zoom_is_found_with_its_factor(
    scene_factory: Callable[..., Scene], factor: float, *, log: bool
) -> None:
    gauge = {} if log else {"telemetry": False, "gauge": "plane"}
    survey = scene_factory(3001, **EXACT, **gauge).survey
    wrong = zoomed(survey, factor)
    found = list(propose_other_zoom(diagnosis(wrong, misplaced=True)))
    by_photo = dict(map(factor_told, found))
    assert by_photo == {"f2": pytest.approx(factor, rel=0.02)}
    (hypothesis,) = found
    own = np.flatnonzero(survey.pick_frame == 2)
    assert hypothesis.mend is not None
    assert hypothesis.mend.pixel_of_pick.keys() == set(own.tolist())
    assert hypothesis.remedy is not None
    assert hypothesis.remedy.without_picks == frozenset(own.tolist())
    middle = survey.calibration.parameters[2:4]
    for k, place in hypothesis.mend.pixel_of_pick.items():
        away = 0.02 * np.abs(survey.pixel_px[k] - middle)
        assert (np.abs(survey.pixel_px[k] - place) <= away).all()


def test_it_is_the_cause_that_is_told_and_no_other_photo_is(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = zoomed(scene_factory(3003, **OPTIONS).survey, 0.6)
    _, (message, *rest) = refine(survey, SolveOptions(noise="stated"))
    assert (message.code, message.frames) == ("other-camera", ("f2",))
    assert not [one for one in rest if one.frames and one.frames != ("f2",)]


def test_a_zoom_within_what_cameras_differ_by_is_not_told(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = zoomed(scene_factory(3001, **EXACT).survey, 1.0 + MIN_DIFFERENCE / 2)
    assert list(propose_other_zoom(diagnosis(survey, misplaced=True))) == []


def test_on_request_its_picks_are_taken_out_and_the_rest_stays(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = zoomed(scene_factory(3001, **OPTIONS).survey, 1.8)
    refined, _ = refine(survey, SolveOptions(outliers="remove", noise="stated"))
    own = survey.pick_frame == 2
    assert refined.pick_removed.tolist() == own.tolist()
    (removal,) = refined.removals
    assert removal.cause is not None
    assert removal.cause.message.code == "other-camera"
    assert "f2" not in refined.adjustment.survey.frame_id


def stated_zoom(scene: Scene, factor: float) -> Survey:
    """The survey with a camera file of another zoom."""
    parameters: Floats = scene.survey.calibration.parameters * np.array([factor] * 2 + [1.0] * 7)
    return replace(
        scene.survey, calibration=replace(scene.survey.calibration, parameters=parameters)
    )


@pytest.mark.parametrize("factor", [0.75, 1.1, 1.3])
def test_another_zoom_is_said_and_distances_are_right(factor: float) -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    refined, messages = refine(stated_zoom(scene, factor), SolveOptions())
    assert "other-zoom" in [message.code for message in messages]
    adjustment = refined.adjustment
    problem, layout = adjustment.problem, adjustment.problem.layout
    focal = problem.intrinsics(adjustment.state)[0]
    basis = problem.intrinsic_basis[0]
    variance = (
        basis @ adjustment.shared_covariance(layout.first_intrinsic, layout.intrinsics) @ basis
    )
    true = scene.survey.calibration.parameters[0]
    assert abs(focal - true) < 3.0 * np.sqrt(variance)
    check_distance(scene, refined)


@pytest.mark.parametrize("seed", range(4))
def test_a_camera_that_fits_is_believed(seed: int) -> None:
    scene = make_scene(seed, frames=8, labels=24, lines=8)
    refined, messages = refine(scene.survey, SolveOptions())
    assert "other-zoom" not in [message.code for message in messages]
    given = refined.adjustment.survey.calibration.covariance
    assert (given == scene.survey.calibration.covariance).all()


def test_labels_in_disorder_are_no_other_zoom() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    label = scene.survey.pick_label.copy()
    rows = np.flatnonzero(scene.survey.pick_frame == 2)
    label[rows] = np.roll(label[rows], 1)
    _, messages = refine(replace(scene.survey, pick_label=label), SolveOptions())
    assert "other-zoom" not in [message.code for message in messages]


def test_stated_sigmas_stay_stated() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    refined, messages = refine(stated_zoom(scene, 1.3), SolveOptions(noise="stated"))
    (message,) = [message for message in messages if message.code == "other-zoom"]
    assert "into account" not in message.text
    given = refined.adjustment.survey.calibration.covariance
    assert (given == scene.survey.calibration.covariance).all()


def test_a_file_with_another_middle_is_told_with_what_it_should_say() -> None:
    scene = make_scene(3, frames=8, labels=24, lines=8)
    stated = scene.survey.calibration
    moved: Floats = stated.parameters + np.array([0.0, 0.0, 200.0, -150.0] + [0.0] * 5)
    survey = replace(scene.survey, calibration=replace(stated, parameters=moved))
    refined, messages = refine(survey, SolveOptions())
    (message,) = [message for message in messages if message.level != "info"]
    assert message.code == "camera-contradicted"
    adjustment = refined.adjustment
    found = adjustment.problem.intrinsics(adjustment.state)[2:4]
    assert np.abs(found - stated.parameters[2:4]).max() < 60.0
    assert f"cx {found[0]:.0f} ±" in message.text


@pytest.mark.parametrize("size", [0.7, 0.5])
@pytest.mark.parametrize("log", [True, False])
def test_photos_picked_in_smaller_copies_are_named_by_their_size(size: float, *, log: bool) -> None:
    gauge: dict[str, Any] = {} if log else {"telemetry": False, "gauge": "plane"}
    scene = make_scene(3, frames=4, labels=14, lines=6, **gauge)
    smaller = replace(scene.survey, pixel_px=size * scene.survey.pixel_px)
    refined, messages = refine(smaller, SolveOptions())
    (message,) = [one for one in messages if one.code == "camera-contradicted"]
    named = float(message.text.split("copies of ")[1].split(" ")[0])
    assert named == pytest.approx(size, rel=0.02)
    check_distance(scene, refined)


@pytest.mark.parametrize("distortion", [-0.2, 0.2])
def test_the_distortion_of_another_lens_is_named_and_distances_are_right(distortion: float) -> None:
    scene = make_scene(3, frames=6, labels=18, lines=6)
    stated = scene.survey.calibration
    other: Floats = stated.parameters + np.array([0.0] * 4 + [distortion] + [0.0] * 4)
    survey = replace(scene.survey, calibration=replace(stated, parameters=other))
    refined, messages = refine(survey, SolveOptions())
    (message,) = [one for one in messages if one.code == "camera-contradicted"]
    assert "the distortion of another lens" in message.text
    assert not refined.line_removed.any()
    check_distance(scene, refined)


def test_at_the_stated_noise_another_lens_is_named_but_bends_no_result() -> None:
    """No prior is given up there, so the result is that without the gross errors."""
    scene = make_scene(3, frames=4, labels=14, lines=6, telemetry=False, gauge="plane")
    smaller = replace(scene.survey, pixel_px=0.7 * scene.survey.pixel_px)
    used = find_picks_in_lens(smaller)[0]
    robust = adjust_robustly(Participants(smaller, used, np.zeros(6, dtype=np.bool_), {}))
    none = np.zeros(len(used), dtype=np.bool_)
    found = adjust_at_stated_noise(smaller, none, SolveOptions(noise="stated"))
    assert [one.message.code for one in found.causes] == ["camera-contradicted"]
    assert not found.causes[0].is_accounted
    cost = found.refined.adjustment.minimum.cost
    assert cost == pytest.approx(robust.refined.adjustment.minimum.cost)


def test_picks_that_nothing_places_support_no_camera() -> None:
    """The two picks of the last photo take no part, whatever else is wrong."""
    scene = make_scene(6, frames=5, labels=16, lines=8, telemetry=False, gauge="plane")
    survey = scene.survey
    keep = np.ones(len(survey.pick_frame), dtype=np.bool_)
    keep[np.flatnonzero(survey.pick_frame == 4)[2:]] = False
    length = survey.length_m.copy()
    length[[1, 4]] *= 0.9144
    wrong = replace(
        survey,
        length_m=length,
        pick_frame=survey.pick_frame[keep],
        pick_label=survey.pick_label[keep],
        pixel_px=survey.pixel_px[keep],
        pick_sigma_px=survey.pick_sigma_px[keep],
    )
    _, messages = refine(wrong, SolveOptions())
    codes = [one.code for one in messages]
    assert "frame-left-out" in codes
    assert not {"camera-contradicted", "other-zoom"} & set(codes)


def check_distance(scene: Scene, refined: Refined) -> None:
    """Compare a distance that was not taped with the truth."""
    adjustment = refined.adjustment
    start, end = (adjustment.label_rows([label]) for label in ("P0", "P7"))
    length, gradient, unknowns = adjustment.problem.lengths_between(adjustment.state, start, end)
    sigma = np.sqrt(adjustment.minimum.factor.variances(unknowns, gradient))
    error = length - np.linalg.norm(scene.world[0] - scene.world[7])
    assert np.abs(error / sigma).max() < 3.5


@pytest.mark.parametrize("size", [0.5, 0.6])
def test_picks_in_a_small_copy_are_errors_of_pixels_of_the_copy(
    scene_factory: Callable[..., Scene], size: float
) -> None:
    """Enlarged, they are less exact by as much: without it the right cause would not fit."""
    survey = scene_factory(3003, **OPTIONS).survey
    own = np.flatnonzero(survey.pick_frame == 2)
    pixel = np.array(survey.pixel_px)
    exact = scene_factory(3003, **EXACT | {"noise": 0.0}).survey.pixel_px[own]
    noise = np.random.default_rng(1).normal(size=exact.shape) * survey.pick_sigma_px[own, None]
    pixel[own] = (exact + 0.5) * size - 0.5 + noise
    copied = replace(survey, pixel_px=pixel)
    (hypothesis,) = [
        one
        for one in propose_other_zoom(diagnosis(copied, misplaced=True))
        if one.message is not None and one.message(None).code == "photo-picked-in-copy"
    ]
    assert hypothesis.mend is not None
    mended = correct_survey(copied, hypothesis.mend)
    enlarged = mended.pick_sigma_px[own] / survey.pick_sigma_px[own]
    np.testing.assert_allclose(enlarged, 1.0 / size, rtol=0.05)
    _, (message, *_) = refine(copied, SolveOptions(noise="stated"))
    assert (message.code, message.frames) == ("photo-picked-in-copy", ("f2",))
