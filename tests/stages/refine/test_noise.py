"""Sigmas of picks, roughness and relief, learnt from surveys with known truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from scenes import PIXEL_SIGMA, Scene, make_scene, picked_beside

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import (
    AreaNoise,
    EstimatedSigma,
    Noise,
    PickNoise,
    SurfaceShape,
)
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.noise import STATED_ROUGHNESS_WEIGHT, report_noise

SCENE: dict[str, Any] = {"frames": 6, "labels": 24, "lines": 6}


def refined_of(survey: Survey, noise: Literal["estimate", "stated"] = "estimate") -> Refined:
    return refine(survey, SolveOptions(noise=noise))[0]


def learnt(refined: Refined) -> tuple[PickNoise, AreaNoise]:
    assert refined.noise is not None
    return refined.noise.picks[0], refined.noise.roughness[0]


def stated_smooth(scene: Scene) -> Survey:
    """The survey as somebody gives it who does not know that its ground is rough."""
    grounds = tuple(replace(ground, roughness_sigma_m=0.0) for ground in scene.survey.grounds)
    return replace(scene.survey, grounds=grounds)


def distance_errors(refined: Refined, world: Floats) -> Floats:
    """All distances between points: adjusted less true, in sigmas."""
    start, end = np.triu_indices(len(world), 1)
    there = refined.adjustment.label_rows(f"P{k}" for k in range(len(world)))
    assert (there >= 0).all()
    adjustment = refined.adjustment
    found, gradient, unknowns = adjustment.problem.lengths_between(
        adjustment.state, there[start], there[end]
    )
    sigma = np.sqrt(adjustment.minimum.factor.variances(unknowns, gradient))
    error: Floats = found - np.linalg.norm(world[start] - world[end], axis=1)
    return error / sigma


@pytest.mark.parametrize("seed", range(4))
def test_clean_ground_stays_a_plane_and_picks_keep_their_sigma(seed: int) -> None:
    picks, ground = learnt(refined_of(make_scene(seed, **SCENE).survey))

    assert (ground.shape, ground.estimated_m, ground.relief_m) == ("plane", 0.0, 0.0)
    assert abs(picks.factor - 1.0) < 3.5 * picks.sigma


@pytest.mark.parametrize("seed", range(3))
def test_rough_ground_that_nobody_stated_is_found(seed: int) -> None:
    scene = make_scene(seed, roughness=0.15, **SCENE)
    survey = stated_smooth(scene)
    as_stated, refined = refined_of(survey, noise="stated"), refined_of(survey)
    picks, ground = learnt(refined)

    assert abs(ground.estimated_m - 0.15) < 3.5 * ground.sigma_m
    assert abs(picks.factor - 1.0) < 3.5 * picks.sigma
    before, after = distance_errors(as_stated, scene.world), distance_errors(refined, scene.world)
    assert np.sqrt(np.mean(after**2)) < 1.6 < np.sqrt(np.mean(before**2))


def test_a_crown_is_found_and_distances_are_right_then() -> None:
    labels = np.arange(24)
    plain = make_scene(5, **SCENE)
    across = plain.world[:, 0] - plain.world[:, 0].mean()
    rise = dict(zip(labels.tolist(), (-0.01 * across**2).tolist(), strict=True))
    scene = make_scene(5, heights=rise, **SCENE)
    survey = replace(scene.survey, height_above_m=np.zeros(24))
    refined = refined_of(survey)
    _, ground = learnt(refined)

    assert ground.shape != "plane"
    assert ground.relief_m == pytest.approx(float(np.std(0.01 * across**2)), rel=0.5)
    before = distance_errors(refined_of(survey, noise="stated"), scene.world)
    after = distance_errors(refined, scene.world)
    assert np.sqrt(np.mean(after**2)) < 1.6 < np.sqrt(np.mean(before**2))


def test_picks_twice_as_bad_as_stated_are_found() -> None:
    scene = make_scene(2, **SCENE)
    survey = replace(scene.survey, pick_sigma_px=np.full(len(scene.survey.pick_frame), 0.35))
    refined = refined_of(survey)
    picks, ground = learnt(refined)

    assert picks.stated_px * picks.factor == pytest.approx(PIXEL_SIGMA, rel=0.2)
    assert ground.shape == "plane"
    assert refined.stated is not None
    np.testing.assert_allclose(
        refined.adjustment.survey.pick_sigma_px, picks.factor * 0.35, rtol=0.03
    )


def test_sigmas_of_a_single_photo_never_shrink() -> None:
    scene = make_scene(3, frames=1, labels=24, lines=8)
    survey = replace(scene.survey, pick_sigma_px=np.full(len(scene.survey.pick_frame), 3.0))
    picks, ground = learnt(refined_of(survey))

    assert picks.factor == 1.0
    assert ground.shape == "plane"


def test_roughness_that_a_single_photo_hardly_shows_counts_as_its_mean_variance() -> None:
    few = make_scene(1, frames=1, roughness=0.02, lines=6).survey
    _, ground = learnt(refined_of(few))
    log_sigma = 1.0 / np.sqrt(2.0 * STATED_ROUGHNESS_WEIGHT)
    drawn_m = 0.02 * np.exp(np.random.default_rng(1).normal(0.0, log_sigma, 200_000))

    assert ground.estimated_m == pytest.approx(np.sqrt(np.mean(drawn_m**2)), rel=0.15)


def test_one_wrong_pick_is_no_noise() -> None:
    scene = make_scene(4, **SCENE)
    pixel = np.array(scene.survey.pixel_px)
    pixel[10] += (15.0, -9.0)
    picks, ground = learnt(refined_of(replace(scene.survey, pixel_px=pixel)))

    assert picks.factor < 1.0 + 3.0 * picks.sigma
    assert ground.estimated_m == 0.0


def test_stated_sigmas_are_kept_where_that_is_asked_for() -> None:
    scene = make_scene(2, **SCENE)
    survey = replace(scene.survey, pick_sigma_px=np.full(len(scene.survey.pick_frame), 0.35))
    refined = refined_of(survey, noise="stated")

    assert refined.noise is None
    assert refined.stated is None
    assert (refined.adjustment.survey.pick_sigma_px == 0.35).all()


def test_what_was_learnt_is_told_though_a_blunder_was_taken_out() -> None:
    scene = make_scene(2, frames=6)
    pixel = np.array(scene.survey.pixel_px)
    pixel[17, 0] += 15.0
    refined, _ = refine(replace(scene.survey, pixel_px=pixel), SolveOptions(outliers="remove"))

    assert list(refined.pick_reason) == [17]
    assert refined.noise is not None


MANY = tuple((k, other) for k in range(12) for other in range(k + 1, min(k + 3, 12)))
"""Lengths of twelve labels that share their ends."""


def lengths_and_identification(
    scene: Scene, stated_m: float
) -> tuple[EstimatedSigma, EstimatedSigma]:
    sigma = np.full(len(scene.survey.label), stated_m)
    refined = refined_of(replace(scene.survey, identification_sigma_m=sigma))
    assert refined.noise is not None
    assert refined.noise.lengths is not None
    assert refined.noise.identification is not None
    used = refined.adjustment.survey
    found = refined.noise.identification
    np.testing.assert_allclose(used.identification_sigma_m, stated_m * found.factor, rtol=0.03)
    # One length that stands out may have a sigma of its own.
    scaled = np.median(used.length_sigma_m / scene.survey.length_sigma_m)
    assert scaled == pytest.approx(refined.noise.lengths.factor, rel=0.03)
    return refined.noise.lengths, found


def test_labels_picked_farther_beside_than_stated_are_found_by_lengths() -> None:
    made = [make_scene(seed, frames=6, roughness=0.02, ends=MANY) for seed in range(4)]
    far = [lengths_and_identification(picked_beside(scene, 0.03, 7), 0.01) for scene in made]
    near = [lengths_and_identification(scene, 0.01) for scene in made]

    shown, none = (np.mean([found.factor for _, found in each]) for each in (far, near))
    assert none < 0.95
    assert 1.2 < shown < 3.0  # its prior holds it back


def test_lengths_that_scatter_more_than_stated_are_found_and_few_never_shrink() -> None:
    """Where picks are exact: the ends of a length that misfits may be elsewhere as well."""
    coarse = make_scene(3, frames=6, roughness=0.02, ends=MANY, tape_sigma=0.03)
    survey = replace(coarse.survey, length_sigma_m=np.full(len(MANY), 0.01))
    lengths, _ = lengths_and_identification(replace(coarse, survey=survey), 0.003)
    few = make_scene(3, frames=6, roughness=0.02, lines=5, tape_sigma=0.003)
    survey = replace(few.survey, length_sigma_m=np.full(5, 0.02))
    wide, _ = lengths_and_identification(replace(few, survey=survey), 0.003)

    assert 1.7 < lengths.factor < 3.5
    assert wide.factor == 1.0


def noise(
    rough_m: float, relief_m: float = 0.0, shape: SurfaceShape = "plane", factor: float = 1.0
) -> Noise:
    area = AreaNoise(
        area="default",
        stated_m=0.0,
        estimated_m=rough_m,
        sigma_m=0.01,
        shape=shape,
        relief_m=relief_m,
    )
    picks = PickNoise(source="hand", stated_px=0.8, factor=factor, sigma=0.05)
    return Noise(picks=(picks,), roughness=(area,))


@pytest.mark.parametrize(
    ("rough_m", "relief_m", "shape", "said"),
    [
        (0.05, 0.0, "plane", "about 5 cm off it, each point by itself"),
        (0.03, 0.04, "quadratic", "about 5 cm off it, as a crown or a hollow does"),
        (1.122, 1.05, "correlated", "about 1.5 m off it, in smooth rises and hollows"),
    ],
)
def test_ground_that_is_no_plane_is_reported(
    rough_m: float, relief_m: float, shape: SurfaceShape, said: str
) -> None:
    (message,) = report_noise(noise(rough_m, relief_m, shape))

    assert (message.level, message.code) == ("warning", "ground-not-plane")
    assert message.text.startswith(f"This ground is not a plane: its points are {said}. The ")


def test_what_chance_makes_of_a_plane_is_not_told() -> None:
    (told,) = noise(0.05).roughness
    (picks,) = noise(0.05).picks
    for probability, messages in ((0.0005, 1), (0.01, 0)):
        area = replace(told, probability=probability)
        assert len(list(report_noise(Noise(picks=(picks,), roughness=(area,))))) == messages


def test_a_plane_and_picks_as_stated_are_no_news() -> None:
    assert not list(report_noise(noise(0.0)))
    assert not list(report_noise(None))
    (message,) = report_noise(noise(0.0, factor=1.6))
    assert "± 0.8 px stated, ± 1.3 px found" in message.text


@pytest.mark.parametrize(
    ("source", "code", "said"),
    [
        ("hand", "picks-less-exact", "The picks made by hand are less exact than stated: ± 0.2 "),
        ("target", "picks-less-exact", "The targets are less exact than stated: ± 0.2 px stated, "),
        ("match", "found-less-exact", "The matches are less exact than stated: ± 0.2 px stated, "),
        ("tie", "found-less-exact", "The tie points are less exact than stated: ± 0.2 px "),
    ],
)
def test_each_source_of_picks_is_told_by_its_name(source: str, code: str, said: str) -> None:
    picks = tuple(
        PickNoise(source=one, stated_px=0.2, factor=1.6 if one == source else 1.0, sigma=0.05)
        for one in ("hand", "target", "match", "tie")
    )
    (message,) = report_noise(Noise(picks=picks, roughness=()))

    assert message.code == code
    assert message.text.startswith(said)
    assert message.level == ("info" if source in ("match", "tie") else "warning")


@pytest.mark.parametrize(("source", "count"), [("hand", 1), ("target", 1), ("match", 0)])
def test_likeness_that_is_more_exact_than_stated_is_no_news(source: str, count: int) -> None:
    picks = PickNoise(source=source, stated_px=0.2, factor=0.5, sigma=0.05)

    assert len(list(report_noise(Noise(picks=(picks,), roughness=())))) == count


@pytest.mark.parametrize(("factor", "is_reported"), [(3.4, True), (2.0, False), (0.5, False)])
def test_marks_far_beside_what_was_taped_are_reported(factor: float, *, is_reported: bool) -> None:
    beside = EstimatedSigma(stated_m=0.01, factor=factor, sigma=0.6)
    messages = list(report_noise(replace(noise(0.0), identification=beside)))

    assert [one.code for one in messages] == ["identification-less-exact"] * is_reported
    if is_reported:
        assert (
            "within 1 cm of the meant points as stated, within 3.4 cm as found" in messages[0].text
        )


@pytest.mark.parametrize(("factor", "said"), [(2.1, True), (1.35, False), (0.5, False)])
def test_lengths_that_scatter_more_than_stated_are_told(factor: float, *, said: bool) -> None:
    lengths = EstimatedSigma(stated_m=0.01, factor=factor, sigma=0.4)
    messages = list(report_noise(replace(noise(0.0), lengths=lengths)))

    assert [one.code for one in messages] == ["lengths-less-exact"] * said
    if said:
        assert "± 0.01 m is stated, ± 0.021 m was found" in messages[0].text
