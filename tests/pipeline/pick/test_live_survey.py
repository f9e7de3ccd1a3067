"""The adjustment while picks change: the same numbers as a run, and first-order ones in between."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from uavgram.errors import UavgramError
from uavgram.model.arrays import Bools, Ints
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations
from uavgram.pipeline.pick.places import project_ground


@pytest.fixture(scope="module")
def survey(data_dir: Path) -> tuple[LiveSurvey, Observations]:
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    inputs = live.inputs
    return live, Observations(picks=inputs.picks, lines=inputs.lines, requests=inputs.requests[:12])


@pytest.fixture(scope="module")
def adjusted(survey: tuple[LiveSurvey, Observations]) -> LiveAdjustment:
    live, observed = survey
    return live.adjust(observed)


def moved(observed: Observations, shift_px: ArrayLike, length_m: float = 0.0) -> Observations:
    pixel = observed.picks.pixel_px.copy()
    pixel[20] += shift_px
    length = observed.lines.length_m.copy()
    length[0] += length_m
    return replace(
        observed,
        picks=replace(observed.picks, pixel_px=pixel),
        lines=replace(observed.lines, length_m=length),
    )


def only(observed: Observations, rows: Ints | Bools) -> Observations:
    picks = observed.picks
    return replace(
        observed,
        picks=replace(
            picks,
            image=tuple(np.array(picks.image)[rows]),
            label=tuple(np.array(picks.label)[rows]),
            pixel_px=picks.pixel_px[rows],
            sigma_px=picks.sigma_px[rows],
            height_m=picks.height_m[rows],
            height_sigma_m=picks.height_sigma_m[rows],
            is_free=picks.is_free[rows],
            score=picks.score[rows],
            from_px=picks.from_px[rows],
            area=(),
            source=(),
            from_image=(),
            line=(),
        ),
    )


def test_live_numbers_are_those_of_a_run(adjusted: LiveAdjustment, data_dir: Path) -> None:
    inputs = read_inputs(data_dir / "calm_nadir" / "project.yaml")
    run = compute(replace(inputs, requests=inputs.requests[:12]), curved=False).result
    np.testing.assert_array_equal(adjusted.result.measurements.value, run.measurements.value)
    np.testing.assert_array_equal(adjusted.result.measurements.sigma, run.measurements.sigma)


def test_first_order_answers_are_exact_for_small_moves(
    survey: tuple[LiveSurvey, Observations],
) -> None:
    """With the sigmas as they were: as stated here, so that a run does not learn others."""
    live, observed = survey
    project = live.inputs.project
    stated = replace(project, solve=replace(project.solve, noise="stated"))
    live = LiveSurvey(replace(live.inputs, project=stated))
    adjusted, change = live.adjust(observed), moved(observed, [0.4, -0.3], 0.01)
    quick, full = live.update_linearly(adjusted, change), live.adjust(change)
    assert quick is not None
    before, after = adjusted.result.measurements, full.result.measurements
    step = np.abs(after.value - before.value).max()
    assert step > 1e-4
    np.testing.assert_allclose(quick.value, after.value, atol=0.01 * step)
    np.testing.assert_allclose(quick.length_m, full.result.lines.adjusted_m, atol=0.01 * step)
    np.testing.assert_allclose(quick.residual_px, full.result.picks.residual_px, atol=0.01)


def test_sigmas_that_a_run_learns_anew_move_little_beside_first_order_answers(
    survey: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = survey
    change = moved(observed, [0.4, -0.3], 0.01)
    quick, full = live.update_linearly(adjusted, change), live.adjust(change)
    assert quick is not None
    after = full.result.measurements
    assert np.abs((quick.value - after.value) / after.sigma).max() < 0.05


def test_a_length_that_stands_out_is_linearised_and_one_that_was_mended_is_not(
    survey: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = survey
    off = moved(observed, 0.0, 0.3)  # it takes part with less weight than was stated
    mended = replace(adjusted, observed=off)  # its reading is another than was typed

    assert live.update_linearly(live.adjust(off), moved(off, [0.4, -0.3])) is not None
    assert live.update_linearly(mended, off) is None


def test_a_new_pick_is_not_linearised(
    survey: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = survey
    fewer = only(observed, np.arange(len(observed.picks.image)) != 3)
    assert live.update_linearly(adjusted, fewer) is None


def test_without_picks_it_says_in_words_what_is_missing(
    survey: tuple[LiveSurvey, Observations],
) -> None:
    live, observed = survey
    with pytest.raises(UavgramError, match="Nothing is picked yet"):
        live.adjust(only(observed, np.zeros(0, dtype=int)))


def test_predictions_hold_the_picks_that_were_left_out(
    survey: tuple[LiveSurvey, Observations],
) -> None:
    """Squared Mahalanobis distances of held-out picks: mean 2, within four sigmas of the mean."""
    live, observed = survey
    rng = np.random.default_rng(3)
    out = np.zeros(len(observed.picks.image), dtype=bool)
    out[rng.choice(len(out), 30, replace=False)] = True
    found = live.adjust(only(observed, ~out))
    predicted = found.predicted
    at = {key: k for k, key in enumerate(zip(predicted.frame_id, predicted.label, strict=True))}
    squared = []
    for i in np.flatnonzero(out):
        k = at.get((observed.picks.image[i], observed.picks.label[i]))
        if k is not None:
            covariance = predicted.covariance_px2[k] + 0.8**2 * np.eye(2)
            away = observed.picks.pixel_px[i] - predicted.pixel_px[k]
            squared.append(away @ np.linalg.solve(covariance, away))
    assert len(squared) > 15
    assert abs(np.mean(squared) - 2.0) < 4.0 * 2.0 / np.sqrt(len(squared))


def test_a_photo_without_picks_is_predicted_as_if_its_picks_said_nothing(
    survey: tuple[LiveSurvey, Observations],
) -> None:
    """Picks of a thousand pixels' sigma bring a photo into the adjustment, and nothing else."""
    live, observed = survey
    image = np.array(observed.picks.image)
    own = image == "IMG_0047.jpg"
    without = live.adjust(only(observed, ~own))
    sigma = np.where(own, 1e4, observed.picks.sigma_px)
    within = live.adjust(replace(observed, picks=replace(observed.picks, sigma_px=sigma)))
    survey_in = within.adjustment.survey
    place = {
        survey_in.label[k]: n
        for n, (f, k) in enumerate(zip(survey_in.pick_frame, survey_in.pick_label, strict=True))
        if survey_in.frame_id[f] == "IMG_0047.jpg"
    }
    compared = 0
    for k, frame in enumerate(without.predicted.frame_id):
        name = without.predicted.label[k]
        if frame != "IMG_0047.jpg" or name not in place:
            continue
        n = place[name]
        sigma = np.sqrt(np.trace(within.picked_covariance_px2[n]))
        away = np.linalg.norm(without.predicted.pixel_px[k] - within.picked_px[n])
        assert away < 0.05 * sigma
        np.testing.assert_allclose(
            without.predicted.covariance_px2[k],
            within.picked_covariance_px2[n],
            rtol=0.15,
            atol=0.05 * sigma**2,
        )
        compared += 1
    assert compared > 10


def test_the_same_ground_is_where_a_label_is_picked_in_another_photo(
    survey: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = survey
    picks = observed.picks
    keys = zip(picks.image, picks.label, strict=True)
    pixel = {key: picks.pixel_px[i] for i, key in enumerate(keys)}
    here, there = "IMG_0045.jpg", "IMG_0046.jpg"
    both = [label for image, label in pixel if image == here and (there, label) in pixel]
    assert len(both) > 5
    for label in both:
        found = project_ground(live, adjusted, here, tuple(pixel[here, label]))
        u, v, scale = found[there]
        assert np.linalg.norm(np.array([u, v]) - pixel[there, label]) < 5.0
        assert 0.8 < scale < 1.25


def test_before_any_adjustment_the_telemetry_says_where_the_same_ground_is(
    survey: tuple[LiveSurvey, Observations],
) -> None:
    live, _ = survey
    places = project_ground(live, None, "IMG_0045.jpg", (1500.0, 1100.0))
    assert len(places) == len(live.inputs.photos.frame_id) - 1
