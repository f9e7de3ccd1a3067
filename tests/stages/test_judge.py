"""What is said of each pick, length, check and prior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.observations import KnownLines, KnownWorldPoints
from uavgram.model.options import SolveOptions
from uavgram.stages.judge import (
    PickTable,
    judge_groups,
    judge_lines,
    judge_picks,
    judge_points,
    judge_priors,
)
from uavgram.stages.refine import refine

ALPHA = 0.001


def changed(survey, name, index, by):
    values = np.array(getattr(survey, name))
    values[index] += by
    return replace(survey, **{name: values})


def table(survey, index=None):
    index = np.arange(len(survey.pick_frame)) if index is None else index
    return PickTable(
        image=tuple(survey.frame_id[f] for f in survey.pick_frame),
        label=tuple(survey.label[k] for k in survey.pick_label),
        pixel_px=survey.pixel_px,
        sigma_px=survey.pick_sigma_px,
        survey_index=index,
    )


def lines_of(survey, adjust=None):
    n = len(survey.line_start)
    return KnownLines(
        name=tuple(f"L{i}" for i in range(n)),
        start=tuple(survey.label[k] for k in survey.line_start),
        end=tuple(survey.label[k] for k in survey.line_end),
        length_m=survey.length_m,
        sigma_m=survey.length_sigma_m,
        adjust=np.ones(n, dtype=bool) if adjust is None else adjust,
    )


def solve(survey, outliers="report"):
    return refine(survey, SolveOptions(outliers=outliers))[0]


def test_a_clean_survey_has_nothing_to_say(scene_factory):
    survey = scene_factory(9, frames=6).survey
    refined = solve(survey)
    picks, pick_messages = judge_picks(refined, table(survey), ALPHA)
    lines, checks, line_messages = judge_lines(refined, lines_of(survey), np.arange(6), ALPHA)
    groups, group_messages = judge_groups(refined.adjustment, ALPHA)
    assert set(picks.status) == {"used"}
    assert set(lines.status) == {"used"}
    assert checks.name == ()
    assert (*pick_messages, *line_messages, *group_messages) == ()
    assert judge_priors(refined.adjustment, ALPHA) == ()
    total = sum(group.redundancy for group in groups)
    observations = sum(group.observations for group in groups)
    layout = refined.adjustment.problem.layout
    assert total == pytest.approx(observations - layout.size, abs=1e-5)


@pytest.mark.parametrize(("outliers", "status"), [("report", "suspect"), ("remove", "removed")])
def test_a_wrong_pick_and_a_wrong_length_are_named(scene_factory, outliers, status):
    survey = scene_factory(6, frames=6, lines=8).survey
    survey = changed(changed(survey, "pixel_px", (17, 0), 15.0), "length_m", 2, 0.5)
    refined = solve(survey, outliers)
    picks, pick_messages = judge_picks(refined, table(survey), ALPHA)
    lines, _, line_messages = judge_lines(refined, lines_of(survey), np.arange(8), ALPHA)
    assert picks.status[17] == status
    assert lines.status[2] == status
    assert -0.7 < lines.residual_m[2] < -0.1  # adjusted minus taped
    if outliers == "report":
        assert picks.residual_px[17, 0] < -1  # adjusted minus pick
        assert any("15" not in m.text and "does not fit" in m.text for m in pick_messages)
        assert np.nanargmax(np.abs(lines.w)) == 2
        assert any(m.code == "line-suspect" and "'L2'" in m.text for m in line_messages)
    else:
        assert np.isnan(picks.residual_px[17]).all()
        assert np.isnan([lines.w[2], lines.redundancy[2], lines.mdb_m[2]]).all()
        assert np.isfinite(lines.adjusted_sigma_m[2])


def test_residuals_and_redundancies_stand_with_their_own_picks(scene_factory):
    survey = scene_factory(6, frames=3).survey
    refined = solve(survey)
    count = len(survey.pick_frame)
    shuffled = np.random.default_rng(0).permutation(count)
    index = np.append(shuffled, -1)
    whole = table(survey)
    given = PickTable(
        image=(*(whole.image[k] for k in shuffled), "lost"),
        label=(*(whole.label[k] for k in shuffled), "A"),
        pixel_px=np.vstack([whole.pixel_px[shuffled], [0, 0]]),
        sigma_px=np.append(whole.sigma_px[shuffled], 1.0),
        survey_index=index,
    )
    plain, _ = judge_picks(refined, whole, ALPHA)
    found, _ = judge_picks(refined, given, ALPHA)
    np.testing.assert_array_equal(found.residual_px[:-1], plain.residual_px[shuffled])
    np.testing.assert_array_equal(found.w[:-1], plain.w[shuffled])
    assert found.status[-1] == "unused"
    assert np.isnan(found.w[-1])


def test_a_withheld_length_is_judged_by_its_error_over_the_joint_sigma(scene_factory):
    scene = scene_factory(6, frames=6)
    survey = scene.survey
    adjust = np.ones(6, dtype=bool)
    adjust[4] = False
    kept = np.flatnonzero(adjust)
    reduced = replace(
        survey,
        line_start=survey.line_start[kept],
        line_end=survey.line_end[kept],
        length_m=survey.length_m[kept],
        length_sigma_m=survey.length_sigma_m[kept],
    )
    index = np.array([0, 1, 2, 3, -1, 4])
    lines, checks, messages = judge_lines(solve(reduced), lines_of(survey, adjust), index, ALPHA)
    assert lines.status == ("used",) * 4 + ("checked", "used")
    assert checks.name == ("L4",)
    sigma = np.hypot(lines.adjusted_sigma_m[4], survey.length_sigma_m[4])
    assert checks.sigma_m[0] == pytest.approx(sigma)
    assert checks.z[0] == pytest.approx(lines.residual_m[4] / sigma) == lines.w[4]
    assert np.isnan(lines.redundancy[4])
    assert messages == ()

    wrong = changed(survey, "length_m", 4, 1.0)
    _, _, messages = judge_lines(solve(reduced), lines_of(wrong, adjust), index, ALPHA)
    assert [m.code for m in messages] == ["line-suspect"]


def test_a_length_to_a_label_never_picked_is_unseen_with_the_nearest_spelling(scene_factory):
    survey = scene_factory(6).survey
    lines = lines_of(survey)
    lines = replace(lines, end=("P33", *lines.end[1:]))
    index = np.array([-1, 1, 2, 3, 4, 5])
    found, _, messages = judge_lines(solve(survey), lines, index, ALPHA)
    assert found.status[0] == "unseen"
    assert np.isnan(found.adjusted_m[0])
    assert [m.code for m in messages] == ["line-unseen"]
    assert "'P33' (did you mean 'P3'?)" in messages[0].text


def test_check_points_are_judged_with_both_covariances(scene_factory):
    scene = scene_factory(6)
    adjustment = solve(scene.survey).adjustment
    known = KnownWorldPoints(
        label=("P2", "P7", "gone"),
        world_m=np.vstack([scene.world[[2, 7]], [0, 0, 0]]),
        sigma_m=np.array([[0.1, 0.2, 0.3], [0.01, 0.01, 0.01], [1, 1, 1]]),
    )
    checks, messages = judge_points(adjustment, known)
    position, covariance = adjustment.points()
    for row, k in enumerate((2, 7)):
        joint = covariance[k] + np.diag(known.sigma_m[row] ** 2)
        error = position[k] - scene.world[k]
        np.testing.assert_allclose(checks.error_m[row], error)
        np.testing.assert_allclose(checks.sigma_m[row], np.sqrt(np.diag(joint)))
        assert checks.mahalanobis[row] == pytest.approx(
            np.sqrt(error @ np.linalg.inv(joint) @ error)
        )
    assert checks.label == ("P2", "P7")
    assert [m.code for m in messages] == ["check-unseen"]


def test_a_group_whose_sigmas_are_far_too_small_is_named(scene_factory):
    survey = scene_factory(6, frames=6).survey
    survey = replace(survey, pick_sigma_px=survey.pick_sigma_px / 4)
    groups, messages = judge_groups(solve(survey).adjustment, ALPHA)
    factor = {g.name: g.variance_factor for g in groups}
    assert 10 < factor["pixels"] < 24
    assert any("picks" in m.text for m in messages)


def test_a_boresight_and_a_frame_far_from_their_priors_are_named(scene_factory):
    survey = scene_factory(6, frames=6, control=6).survey
    prior = survey.telemetry
    strained = replace(survey, telemetry=replace(prior, boresight_sigma_rad=1e-5))
    turned = prior.gimbal_from_camera @ np.array(
        [[1, 0, 0], [0, 0.9801, -0.1987], [0, 0.1987, 0.9801]]
    )
    strained = replace(strained, telemetry=replace(strained.telemetry, gimbal_from_camera=turned))
    messages = judge_priors(solve(strained).adjustment, ALPHA)
    assert any("boresight x" in m.text for m in messages)

    late = np.array(prior.time_s)
    late[2] += 0.4
    tight = replace(prior, time_s=late, covariance=prior.covariance * 0.01, clock_sigma_s=0.01)
    messages = judge_priors(solve(replace(survey, telemetry=tight)).adjustment, ALPHA)
    assert any("'f2'" in m.text for m in messages if m.code == "telemetry-strained")
