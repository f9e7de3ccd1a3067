"""What is wrong with all lengths, control points or photos alike is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scenes
from scenes import Scene, make_scene

from uavgram.model.message import Message
from uavgram.model.observations import Along
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.mirrored_photos import reflect, shows_mirrored_control

PAIRS = (*((k, k + 6) for k in range(6)), (0, 1), (2, 3), (4, 5))


def messages_of(survey: Survey) -> list[Message]:
    _, messages = refine(survey, SolveOptions())
    return list(messages)


def codes_of(survey: Survey) -> list[str]:
    return [message.code for message in messages_of(survey)]


def mirrored(survey: Survey) -> Survey:
    pixel = np.array(survey.pixel_px)
    pixel[:, 0] = survey.calibration.width_px - 1.0 - pixel[:, 0]
    return replace(survey, pixel_px=pixel)


@pytest.fixture
def hillside(monkeypatch: pytest.MonkeyPatch) -> Scene:
    """Points on a steep slope, with a log and well-known lengths along the slope."""
    monkeypatch.setattr(scenes, "PLANE_SIGMA", np.array([0.3, 0.3, 0.3]))
    scene = make_scene(2, frames=6, ends=PAIRS)
    assert np.hypot(*scene.truth.plane[1:]) > 0.09
    return scene


def test_lengths_that_were_taped_level_on_a_slope_are_named(hillside: Scene) -> None:
    survey = hillside.survey
    across = hillside.world[survey.line_start, :2] - hillside.world[survey.line_end, :2]
    error = survey.length_sigma_m * np.random.default_rng(0).normal(size=len(across))
    level = replace(survey, length_m=np.linalg.norm(across, axis=1) + error)
    found = [m for m in messages_of(level) if m.code == "lengths-level"]
    assert len(found) == 1
    assert "horizontal" in found[0].text
    along: Along = "horizontal"
    stated = replace(level, line_along=(along,) * len(across))
    assert "lengths-level" not in codes_of(stated)


def test_lengths_along_a_slope_are_not_called_level(hillside: Scene) -> None:
    assert "lengths-level" not in codes_of(hillside.survey)


@pytest.mark.parametrize("seed", [0, 3])
def test_control_points_that_are_all_shifted_are_named_with_their_shift(seed: int) -> None:
    survey = make_scene(seed, frames=6, labels=14, control=5).survey
    shift = np.array([8.0, -6.0, 0.0])
    shifted = replace(survey, control_world_m=survey.control_world_m + shift)
    (found,) = (m for m in messages_of(shifted) if m.code == "control-shifted")
    size = float(found.text.split("by ")[1].split(" ")[0])
    assert size == pytest.approx(10.0, abs=4.0)
    assert set(found.labels) == {survey.label[k] for k in survey.control_label}
    assert "control-shifted" not in codes_of(survey)


@pytest.mark.parametrize("seed", [0, 3])
def test_control_of_another_height_reference_is_not_shifted_in_plan(seed: int) -> None:
    """In plan the log is off by its stated bias, as any receiver is."""
    survey = make_scene(seed, frames=6, labels=14, control=5).survey
    assert survey.telemetry is not None
    east_m = float(survey.telemetry.position_bias_sigma_m[0])
    shift = np.array([east_m, -east_m, 25.0])
    shifted = replace(survey, control_world_m=survey.control_world_m + shift)
    named = codes_of(shifted)
    assert "heights-off" in named
    assert not {"control-shifted", "control-left-out"} & set(named)


def test_photos_that_were_all_mirrored_are_named_where_the_log_shows_it() -> None:
    survey = make_scene(4, frames=6, labels=14).survey
    wrong = messages_of(mirrored(survey))
    named = [m.code for m in wrong]
    assert "photos-mirrored" in named
    assert "mirrored-undecided" not in named  # it would say the opposite
    assert "photos-mirrored" not in codes_of(survey)
    assert "mirrored-undecided" not in codes_of(survey)


def test_the_mirror_image_of_a_state_shows_mirrored_pixels() -> None:
    scene = make_scene(5, frames=5, noise=0.0)
    parameters = np.array(scene.survey.calibration.parameters)
    parameters[2] = (scene.survey.calibration.width_px - 1.0) / 2.0  # no middle beside the middle
    parameters[4:] = 0.0
    image = reflect(scene.truth)
    places = []
    for state in (scene.truth, image):
        world = np.column_stack([state.point[:, :2], scene.world[:, 2]])
        seen = scenes.cv_pixels(parameters, state.center[2], state.rotation[2], world)[0]
        places.append(seen)
    u, v = places[0].T
    width = scene.survey.calibration.width_px
    np.testing.assert_allclose(places[1], np.column_stack([width - 1.0 - u, v]), atol=1e-6)
    assert np.linalg.det(image.rotation) == pytest.approx(np.ones(5))


def test_where_the_log_decides_nothing_the_mirror_image_is_compared() -> None:
    """One photo that looks straight down, with a log: its image fits as well."""
    scene = make_scene(6, frames=1, labels=10, tilt=0.0)
    refined, messages = refine(scene.survey, SolveOptions())
    assert [m.level for m in messages if m.code == "mirrored-undecided"] == ["info"]
    ((mirrored,),) = refined.explanations
    there, here = (one.state.point[:, :2] for one in (mirrored.adjustment, refined.adjustment))
    apart = np.linalg.norm(here[:, None] - here[None], axis=2)
    image = np.linalg.norm(there[:, None] - there[None], axis=2)
    np.testing.assert_allclose(image, apart, rtol=0.02)
    assert np.abs(there - here).max() > 3.0


def test_a_mount_that_is_not_exact_does_not_hide_mirrored_photos() -> None:
    """Two oblique photos: their mirror image strains the camera's direction at first only."""
    scene = make_scene(5, frames=2, labels=12, lines=4, tilt=0.8, spread=6.0)
    found = {"photos-mirrored", "mirrored-undecided"} & set(codes_of(mirrored(scene.survey)))
    assert found


@pytest.mark.parametrize("telemetry", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_photos_that_are_mirrored_against_control_are_named_first(
    seed: int, *, telemetry: bool
) -> None:
    """Two photos and six control points, one of which a wrong click spoils."""
    survey = make_scene(seed, frames=2, control=6, telemetry=telemetry, tilt=0.6).survey
    assert not shows_mirrored_control(survey)
    (first, *_), message = messages_of(mirrored(survey)), "control points fit only then"
    assert first.code == "photos-mirrored"
    assert message in first.text
    assert first.plain.startswith("East and north of all control") == (not telemetry)
    wrong = np.array(survey.pixel_px)
    wrong[np.flatnonzero(np.isin(survey.pick_label, survey.control_label))[0]] += [400.0, -300.0]
    assert not shows_mirrored_control(replace(survey, pixel_px=wrong))


@pytest.mark.parametrize("origin_m", [0.0, 60.0])
@pytest.mark.parametrize("seed", range(3))
def test_exchanged_axes_of_control_are_named_and_spoil_nothing(seed: int, origin_m: float) -> None:
    """East and north of control are exchanged, about the origin or about another place."""
    scene = make_scene(seed, frames=3, control=5, tilt=0.6)
    exchanged = scene.survey.control_world_m[:, [1, 0, 2]] + [origin_m, -origin_m, 0.0]
    refined, messages = refine(
        replace(scene.survey, control_world_m=exchanged), SolveOptions(outliers="report")
    )
    assert messages[0].code == "control-axes-exchanged"
    assert not refined.pick_reason
    assert not refined.line_removed.any()
    adjusted = [scene.survey.label.index(name) for name in refined.adjustment.survey.label]
    here, there = refined.adjustment.state.point[:, :2], scene.world[adjusted, :2]
    apart, true = (np.linalg.norm(one[:, None] - one[None], axis=2) for one in (here, there))
    np.testing.assert_allclose(apart, true, atol=0.15)
