"""What all lengths have in common: told with its size, and not where it is chance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene
from scipy.stats import chi2

from uavgram.estimation.reliability.hypotheses import compare_hypotheses
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import EstimatedSigma, Noise
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.common_length_errors import (
    MIN_SHARE_IN_RESIDUALS,
    _list_common_errors,
    drop_insignificant_errors,
    has_common_misfit,
)
from uavgram.stages.refine.causes.hypothesis import Diagnosis
from uavgram.stages.refine.causes.identification import identify_causes
from uavgram.stages.refine.minima import Participants, find_best_minima

PAIRS = (*((k, k + 6) for k in range(6)), (0, 1), (2, 3), (4, 5))
LEVEL = 1e-4


def diagnosis(survey: Survey) -> Diagnosis:
    nothing = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, np.ones(len(survey.pick_frame), dtype=np.bool_), nothing, {})
    return Diagnosis(taking, find_best_minima(taking))


def off_by(survey: Survey, factor: float, offset_m: float) -> Survey:
    return replace(survey, length_m=survey.length_m * (1.0 + factor) + offset_m)


def test_a_factor_and_an_offset_are_found_within_their_sigmas(
    scene_factory: Callable[..., Scene],
) -> None:
    squares: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(10):
        survey = scene_factory(seed, frames=3, ends=PAIRS).survey
        for is_factor, truth in ((True, 0.01), (False, 0.05)):
            wrong = off_by(survey, truth * is_factor, truth * (not is_factor))
            adjustment = diagnosis(wrong).adjustment
            (one,) = (
                each for each in _list_common_errors(adjustment) if each.is_factor == is_factor
            )
            (found,) = compare_hypotheses(adjustment, [one.moved], MIN_SHARE_IN_RESIDUALS)
            off = float(found.value[0]) - truth
            squares[is_factor].append(off**2 / float(found.covariance[0, 0]))
    for square in squares.values():
        low, high = chi2.ppf(np.array([LEVEL / 2, 1 - LEVEL / 2]), len(square))
        assert low < np.sum(square) < high


@pytest.mark.parametrize("offset_m", [0.4, -0.4])
def test_a_hook_is_told_with_its_size_and_sigma(
    scene_factory: Callable[..., Scene], offset_m: float
) -> None:
    survey = scene_factory(3, frames=4, ends=PAIRS).survey
    survey = replace(survey, line_name=tuple(f"L{k}" for k in range(9)))
    cause = identify_causes(diagnosis(off_by(survey, 0.0, 0.5 * offset_m))).causes[0]
    assert cause.message.code == "lengths-offset"
    assert ("long" if offset_m > 0 else "short") in cause.message.text
    assert ("subtract it from" if offset_m > 0 else "add it to") in cause.message.text
    assert cause.settles == set(survey.line_name)
    if cause.mend is not None:
        right = [cause.mend.length_m[k] for k in range(9)]
        np.testing.assert_allclose(right, survey.length_m, atol=0.2 * abs(offset_m))


@pytest.mark.parametrize("is_of_lengths", [True, False])
def test_an_offset_that_the_noise_of_others_explains_is_dropped(
    scene_factory: Callable[..., Scene], *, is_of_lengths: bool
) -> None:
    """An offset enlarges the noise of the lengths themselves, which therefore is no explanation."""
    wrong = off_by(scene_factory(7, frames=4, ends=PAIRS).survey, 0.0, 0.2)
    causes = identify_causes(diagnosis(wrong)).causes
    assert causes[0].message.code == "lengths-offset"
    factor = 20.0
    if is_of_lengths:
        noisy = replace(wrong, length_sigma_m=factor * wrong.length_sigma_m)
        lengths = EstimatedSigma(stated_m=0.01, factor=factor, sigma=1.0)
        noise = Noise(picks=(), roughness=(), lengths=lengths)
    else:
        noisy = replace(wrong, pick_sigma_px=factor * wrong.pick_sigma_px)
        noise = Noise(picks=(), roughness=())
    kept = drop_insignificant_errors(causes, diagnosis(noisy).adjustment, noise)
    assert kept == (causes if is_of_lengths else causes[1:])
    assert drop_insignificant_errors(causes, diagnosis(noisy).adjustment, None) == causes
    without = scene_factory(7, frames=4, ends=()).survey
    assert drop_insignificant_errors(causes, diagnosis(without).adjustment, noise) == causes


def test_an_offset_below_four_sigmas_is_not_told(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(3, frames=4, ends=PAIRS).survey
    given = diagnosis(off_by(survey, 0.0, -0.125))
    (one,) = (each for each in _list_common_errors(given.adjustment) if not each.is_factor)
    (found,) = compare_hypotheses(given.adjustment, [one.moved], MIN_SHARE_IN_RESIDUALS)
    assert 3.0 < -found.value[0] / np.sqrt(found.covariance[0, 0]) < 4.0
    assert identify_causes(given).causes == ()


def test_nothing_common_is_told_of_right_lengths(scene_factory: Callable[..., Scene]) -> None:
    for seed in range(6):
        given = diagnosis(scene_factory(seed, frames=3, ends=PAIRS).survey)
        assert not has_common_misfit(given.adjustment)
        assert identify_causes(given).causes == ()


@pytest.mark.parametrize("roughness_m", [0.0, 0.08])
def test_without_a_log_a_factor_is_checked_by_nothing(
    scene_factory: Callable[..., Scene], roughness_m: float
) -> None:
    """Nor by how uneven the ground is, which the survey learns from itself."""
    alone = {"telemetry": False, "gauge": "plane", "roughness": roughness_m}
    survey = scene_factory(1, frames=5, labels=40, ends=PAIRS, **alone).survey
    given = diagnosis(replace(survey, length_sigma_m=np.full(len(PAIRS), 0.05)))
    (factor,) = (one for one in _list_common_errors(given.adjustment) if one.is_factor)
    (found,) = compare_hypotheses(given.adjustment, [factor.moved], MIN_SHARE_IN_RESIDUALS)
    assert np.isinf(found.covariance[0, 0])
    assert found.gain == 0.0
    assert not has_common_misfit(given.adjustment)


@pytest.mark.parametrize("seed", [3, 5])
def test_lengths_of_a_worn_tape_do_not_change_the_results_where_control_gives_the_scale(
    seed: int,
) -> None:
    """Leaving out a control point, or a length, explains less than the tape does."""
    scene = make_scene(seed, frames=4, labels=14, control=5, lines=7, telemetry=False)
    survey = off_by(scene.survey, 0.02, 0.0)
    survey = replace(survey, line_name=tuple(f"L{k}" for k in range(7)))

    refined, messages = refine(survey, SolveOptions(noise="stated"))

    assert [one.code for one in messages] == ["lengths-factor"]
    assert refined.line_removed.all()
    adjustment = refined.adjustment
    assert len(adjustment.survey.control_label) == 5
    place, covariance = adjustment.points()
    off = place - scene.world[adjustment.label_rows(scene.survey.label)]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
    assert squares.max() < chi2.ppf(1 - LEVEL, 3)


@pytest.mark.parametrize(("factor", "is_corrected"), [(0.05, True), (-0.05, True), (0.25, False)])
def test_a_factor_beyond_that_of_any_tape_is_not_corrected(
    factor: float, *, is_corrected: bool
) -> None:
    """The camera file or the heights of the log may give the wrong scale instead."""
    survey = make_scene(3, frames=4, labels=14, control=5, lines=7, telemetry=False).survey
    (cause, *_) = identify_causes(diagnosis(off_by(survey, factor, 0.0))).causes

    code = "lengths-factor" if is_corrected else "scale-contradicted"
    assert cause.message.code == code
    assert (cause.mend is not None) == is_corrected
