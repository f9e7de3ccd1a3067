"""Heights typed in centimetres put points above the cameras, which look down on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import INTRINSICS, Scene, cv_pixels, make_scene

from uavgram.estimation.survey.adjustment import Refined, compute_heights
from uavgram.estimation.survey.likelihood import compute_covariance_root
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

ROOF_M = 0.70


def on_roof(survey: Survey) -> Ints:
    """The last three labels that are no ends of lengths."""
    ends = np.append(survey.line_start, survey.line_end)
    return np.setdiff1d(survey.pick_label, ends)[-3:]


def with_roof(scene: Scene, stated_m: float, true_m: float = ROOF_M) -> Survey:
    """The survey with three points above the ground, no ends of lengths, of stated heights."""
    survey, truth = scene.survey, scene.truth
    up_m, raised = np.zeros(len(survey.label)), on_roof(survey)
    up_m[raised] = true_m
    rng, camera = np.random.default_rng(1), survey.calibration
    lens = INTRINSICS + compute_covariance_root(camera.covariance) @ truth.intrinsic
    world = scene.world + up_m[:, None] * [0.0, 0.0, 1.0]
    pixel = survey.pixel_px.copy()
    for k in np.flatnonzero(up_m[survey.pick_label] > 0.0).tolist():
        frame, label = survey.pick_frame[k], survey.pick_label[k]
        (place,), _ = cv_pixels(lens, truth.center[frame], truth.rotation[frame], world[[label]])
        pixel[k] = place + survey.pick_sigma_px[k] * rng.normal(size=2)
    height, sigma = survey.height_above_m.copy(), survey.height_sigma_m.copy()
    height[raised], sigma[raised] = stated_m, 0.03
    return replace(survey, pixel_px=pixel, height_above_m=height, height_sigma_m=sigma)


def heights(refined: Refined, survey: Survey) -> Floats:
    found, _ = compute_heights(refined.adjustment)
    return found[refined.adjustment.label_rows(survey.label[k] for k in on_roof(survey))]


def warnings(messages: tuple[Message, ...]) -> list[Message]:
    return [one for one in messages if one.level == "warning"]


@pytest.mark.parametrize("frames", [1, 5])
def test_heights_in_centimetres_are_divided_by_100(frames: int) -> None:
    scene = make_scene(6, frames=frames, labels=24, lines=10)
    survey = with_roof(scene, 100.0 * ROOF_M)
    refined, messages = refine(survey, SolveOptions())
    assert len(refined.pick_index) == len(survey.pick_frame)  # no pick is left out
    assert heights(refined, survey) == pytest.approx(ROOF_M, abs=0.09)
    found = warnings(messages)
    assert {one.code for one in found} == {"height-above-camera"}
    assert sorted(one.labels[0] for one in found) == sorted(
        survey.label[k] for k in on_roof(survey)
    )
    assert all("typed in centimetres? The results use 0.70 m" in one.text for one in found)
    assert all((one.mend is not None) == (frames > 1) for one in found)


def test_without_a_log_too() -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10, telemetry=False, gauge="plane")
    survey = with_roof(scene, 100.0 * ROOF_M)
    refined, messages = refine(survey, SolveOptions())
    assert len(refined.pick_index) == len(survey.pick_frame)
    assert heights(refined, survey) == pytest.approx(ROOF_M, abs=0.09)
    assert {one.code for one in warnings(messages)} == {"height-above-camera"}


def test_what_the_photos_show_counts_where_a_hundredth_is_wrong_too() -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10)
    survey = with_roof(scene, 310.0, true_m=1.5)
    refined, messages = refine(survey, SolveOptions())
    assert heights(refined, survey) == pytest.approx(1.5, abs=0.15)
    found = warnings(messages)
    assert {one.code for one in found} == {"height-above-camera"}
    assert all("The photos show it at 1." in one.text for one in found)


def test_right_heights_stay() -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10)
    survey = with_roof(scene, ROOF_M)
    _, messages = refine(survey, SolveOptions())
    assert not warnings(messages)


def test_heights_in_millimetres_too() -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10)
    survey = with_roof(scene, 1000.0 * ROOF_M)
    refined, messages = refine(survey, SolveOptions())
    assert heights(refined, survey) == pytest.approx(ROOF_M, abs=0.09)
    assert all("typed in millimetres?" in one.text for one in warnings(messages))


def test_several_heights_in_feet_are_one_mistake() -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10)
    survey = with_roof(scene, ROOF_M / 0.3048)
    refined, messages = refine(survey, SolveOptions())
    assert heights(refined, survey) == pytest.approx(ROOF_M, abs=0.09)
    (found,) = warnings(messages)
    assert found.code == "heights-wrong-unit"
    assert "seem to be in feet" in found.text
    assert len(refined.pick_index) == len(survey.pick_frame)


def test_a_wrong_height_is_blamed_in_place_of_a_right_pick() -> None:
    """Of two picks of a point, leaving out either explains as much as another height."""
    survey = with_roof(make_scene(6, frames=2, labels=24, lines=10), ROOF_M)
    wrong = survey.height_above_m.copy()
    wrong[on_roof(survey)[-1]] = 1.9
    refined, messages = refine(replace(survey, height_above_m=wrong), SolveOptions())
    (found,) = warnings(messages)
    assert found.code == "height-left-out"
    assert found.labels == (survey.label[on_roof(survey)[-1]],)
    assert len(refined.pick_index) == len(survey.pick_frame)


@pytest.mark.parametrize(("stated_m", "how"), [(7.0, "the decimal point"), (2.3, "in feet")])
def test_a_left_out_height_names_the_probable_mistake(stated_m: float, how: str) -> None:
    scene = make_scene(6, frames=5, labels=24, lines=10)
    survey = with_roof(scene, ROOF_M)
    wrong = survey.height_above_m.copy()
    wrong[on_roof(survey)[-1]] = stated_m
    _, messages = refine(replace(survey, height_above_m=wrong), SolveOptions())
    (found,) = warnings(messages)
    assert found.code == "height-left-out"
    assert f"({how}" in found.text
