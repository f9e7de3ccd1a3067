"""What is said of each pick, length, check and prior."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from scenes import Scene, make_scene, show_moved
from scipy.stats import chi2
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.board import OutlierRule
from uavgram.model.flight_log import Track
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import KnownLines, KnownWorldPoints, MeasurementRequest, Picks
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import ChecksOverall
from uavgram.model.survey import Survey
from uavgram.stages.judge import (
    compare_withheld,
    judge_groups,
    judge_lines,
    judge_overall,
    judge_picks,
    judge_points,
    judge_priors,
    judge_removals,
    judge_suspects,
    judge_weakest,
    run_tests,
    tested_survey,  # its class itself would be taken for tests
)
from uavgram.stages.judge.verdict import find_unconfirmed_points
from uavgram.stages.refine import refine
from uavgram.stages.refine.readjustment import convert_state
from uavgram.stages.refine.staged_sigmas import iterate

ALPHA = 0.001


def changed(survey: Survey, name: str, index: int | tuple[int, int], by: float) -> Survey:
    values = np.array(getattr(survey, name))
    values[index] += by
    changes: dict[str, Any] = {name: values}
    return replace(survey, **changes)


def table(survey: Survey, index: Ints | None = None) -> tuple[Picks, Floats, Ints]:
    index = np.arange(len(survey.pick_frame)) if index is None else index
    sigma = survey.pick_sigma_px
    picks = Picks(
        image=tuple(survey.frame_id[f] for f in survey.pick_frame),
        label=tuple(survey.label[k] for k in survey.pick_label),
        pixel_px=survey.pixel_px,
        sigma_px=sigma,
        height_m=np.full(len(sigma), np.nan),
    )
    return picks, sigma, index


def lines_of(survey: Survey, adjust: Bools | None = None) -> KnownLines:
    n = len(survey.line_start)
    return KnownLines(
        name=tuple(f"L{i}" for i in range(n)),
        start=tuple(survey.label[k] for k in survey.line_start),
        end=tuple(survey.label[k] for k in survey.line_end),
        length_m=survey.length_m,
        sigma_m=survey.length_sigma_m,
        adjust=np.ones(n, dtype=bool) if adjust is None else adjust,
    )


def solve(
    survey: Survey,
    outliers: OutlierRule = "report",
    noise: Literal["estimate", "stated"] = "estimate",
) -> Refined:
    if not survey.line_name:
        survey = replace(survey, line_name=lines_of(survey).name)
    return refine(survey, SolveOptions(outliers=outliers, noise=noise))[0]


def named(lines: KnownLines, i: int) -> str:
    return f"length {lines.name[i]!r} ({lines.start[i]!r} to {lines.end[i]!r})"


NO_TIMES = Frames(
    frame_id=(),
    time_utc_s=np.zeros(0),
    sigma_time_s=np.zeros(0),
    matched=np.zeros(0, dtype=bool),
    reason=(),
    clock_offset_s=0.0,
    clock_offset_sigma_s=0.0,
)
"""A distance asks for none."""

WHOLE = (MeasurementRequest(name="whole", kind="distance", points=("P0", "P1")),)


def examined(
    refined: Refined, requests: tuple[MeasurementRequest, ...] = WHOLE
) -> tested_survey.TestedSurvey:
    measured = propagate(refined.adjustment, requests, NO_TIMES)
    return run_tests(refined, measured, ALPHA)


def test_a_clean_survey_has_nothing_to_say(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(9, frames=6).survey
    refined = solve(survey)
    given = examined(refined)
    picks, _ = judge_picks(given, *table(survey))
    lines, checks, _, line_messages = judge_lines(given, lines_of(survey), np.arange(6))
    groups, group_messages = judge_groups(refined.adjustment, ALPHA)
    assert set(picks.status) == {"used"}
    assert set(lines.status) == {"used"}
    assert checks.name == ()
    assert (*judge_suspects(given), *line_messages, *group_messages) == ()
    total = sum(group.redundancy for group in groups)
    observations = sum(group.observations for group in groups)
    layout = refined.adjustment.problem.layout
    assert total == pytest.approx(observations - layout.size, abs=1e-5)


def test_the_only_tape_is_not_suspected_by_how_uneven_the_ground_is(
    scene_factory: Callable[..., Scene],
) -> None:
    """Without a log nothing else bears on it; smaller ground would only be more even."""
    alone = {"telemetry": False, "gauge": "plane", "roughness": 0.08}
    made = scene_factory(8, frames=5, labels=60, lines=8, **alone)
    given = examined(solve(read_on_tapes(made, {"": 0.0}, sigma=0.001).survey))
    assert judge_suspects(given) == ()


@pytest.mark.parametrize(("outliers", "status"), [("report", "suspect"), ("remove", "removed")])
def test_a_wrong_pick_and_a_wrong_length_are_named(
    scene_factory: Callable[..., Scene], outliers: OutlierRule, status: str
) -> None:
    survey = scene_factory(6, frames=6, lines=8).survey
    survey = changed(changed(survey, "pixel_px", (17, 0), 8.0), "length_m", 2, 0.13)
    refined = solve(survey, outliers)
    given = examined(refined)
    picks, _ = judge_picks(given, *table(survey))
    lines, _, _, _ = judge_lines(given, lines_of(survey), np.arange(8))
    messages = judge_suspects(given)
    assert picks.status[17] == status
    assert lines.status[2] == status
    assert -0.18 < lines.residual_m[2] < -0.026  # adjusted minus taped
    if outliers == "report":
        assert picks.residual_px[17, 0] < -1  # adjusted minus pick
        assert any(m.code == "pick-suspect" and "does not fit" in m.text for m in messages)
        assert np.nanargmax(np.abs(lines.w)) == 2
        assert any(m.code == "line-suspect" and "'L2'" in m.text for m in messages)
    else:
        assert np.isnan(picks.residual_px[17]).all()
        assert np.isnan([lines.w[2], lines.redundancy[2], lines.mdb_m[2]]).all()
        assert np.isfinite(lines.adjusted_sigma_m[2])


@pytest.mark.parametrize("outliers", ["report", "remove"])
def test_a_gross_pick_and_a_gross_length_are_removed_and_nothing_else_is_accused(
    scene_factory: Callable[..., Scene], outliers: OutlierRule
) -> None:
    survey = scene_factory(6, frames=6, lines=8).survey
    survey = changed(changed(survey, "pixel_px", (17, 0), 15.0), "length_m", 2, 0.5)
    refined = solve(survey, outliers)
    given = examined(refined)
    picks, _ = judge_picks(given, *table(survey))
    lines, _, _, messages = judge_lines(given, lines_of(survey), np.arange(8))
    assert picks.status == ("used",) * 17 + ("removed",) + ("used",) * (len(picks.status) - 18)
    assert lines.status == ("used",) * 2 + ("removed",) + ("used",) * 5
    assert -0.7 < lines.residual_m[2] < -0.1  # adjusted minus taped
    assert np.isnan(picks.residual_px[17]).all()
    assert np.isnan([lines.w[2], lines.redundancy[2], lines.mdb_m[2]]).all()
    assert np.isfinite(lines.adjusted_sigma_m[2])
    assert [(m.code, m.lengths) for m in messages] == [("line-left-out", ("L2",))]
    assert judge_suspects(given) == ()


def test_two_lengths_at_a_point_that_was_clicked_elsewhere_name_the_point() -> None:
    ends = ((0, 5), (5, 9), (0, 9), (1, 7), (2, 8), (3, 10), (4, 11))
    scene = make_scene(6, frames=6, ends=ends)
    survey = show_moved(scene, (5,), tuple(range(6)), (0.6, 0.5, 0.0))
    given = examined(solve(survey, "report"))
    _, _, _, messages = judge_lines(given, lines_of(survey), np.arange(len(ends)))
    (named,) = messages
    assert (named.code, named.labels, set(named.lengths)) == (
        "point-not-taped",
        ("P5",),
        {"L0", "L1"},
    )
    # Nothing confirms where it was clicked; each other end has one more length.
    assert "P5" in find_unconfirmed_points(given)
    for reading, is_off in ((0, "L0"), (1, "L1")):  # a single length leaves the reading in doubt
        alone = changed(scene.survey, "length_m", reading, 0.5)
        given = examined(solve(alone, "report"))
        _, _, _, messages = judge_lines(given, lines_of(alone), np.arange(len(ends)))
        assert [(one.code, one.lengths) for one in messages] == [("line-left-out", (is_off,))]


def test_a_left_out_control_point_is_in_doubt_until_two_lengths_confirm_it() -> None:
    for ends, is_in_doubt in (((1, 7), (2, 8)), True), (((3, 7), (3, 8), (2, 9)), False):
        scene = make_scene(3, frames=5, control=6, ends=ends)
        survey = changed(scene.survey, "control_world_m", (3, 0), 2.0)
        given = examined(solve(survey, "report"))
        assert ("P3" in find_unconfirmed_points(given)) == is_in_doubt


def test_residuals_and_redundancies_stand_with_their_own_picks(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=3).survey
    refined = solve(survey)
    count = len(survey.pick_frame)
    shuffled = np.random.default_rng(0).permutation(count)
    index = np.append(shuffled, -1)
    whole, sigma, every = table(survey)
    given = Picks(
        image=(*(whole.image[k] for k in shuffled), "lost"),
        label=(*(whole.label[k] for k in shuffled), "A"),
        pixel_px=np.vstack([whole.pixel_px[shuffled], [0, 0]]),
        sigma_px=np.append(sigma[shuffled], 1.0),
        height_m=np.full(count + 1, np.nan),
    )
    under_test = examined(refined)
    plain, plain_effects = judge_picks(under_test, whole, sigma, every)
    found, effects = judge_picks(under_test, given, given.sigma_px, index)
    np.testing.assert_array_equal(effects.change[:-1], plain_effects.change[shuffled])
    assert effects.on[-1] == ""
    np.testing.assert_array_equal(found.residual_px[:-1], plain.residual_px[shuffled])
    np.testing.assert_array_equal(found.w[:-1], plain.w[shuffled])
    assert found.status[-1] == "unused"
    assert np.isnan(found.w[-1])


def test_residuals_are_those_of_the_result_whatever_was_learnt(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(6, frames=6, lines=8)
    survey = replace(scene.survey, pick_sigma_px=scene.survey.pick_sigma_px / 3)
    survey = changed(changed(survey, "pixel_px", (17, 0), 8.0), "length_m", 2, 0.13)
    refined = solve(survey)
    adjustment = refined.adjustment
    assert refined.noise is not None
    assert refined.noise.picks[0].factor > 2  # learnt
    given = examined(refined)
    picks, _ = judge_picks(given, *table(survey))
    _lines, _, _, _ = judge_lines(given, lines_of(survey), np.arange(8))
    there = adjustment.pixels(survey.pick_frame, survey.pick_label)
    np.testing.assert_allclose(picks.residual_px, there - survey.pixel_px, atol=1e-6)
    said = {message.code: message.text for message in judge_suspects(given)}
    u, v = picks.residual_px[17]
    assert f"{np.hypot(u, v):.1f} px off" in said["pick-suspect"]
    (shown,) = re.findall(r"the rest shows ([0-9.]+) m", said["line-suspect"])
    assert float(shown) == pytest.approx(scene.survey.length_m[2], abs=0.05)  # before the error


def test_a_withheld_length_is_judged_by_its_error_over_the_joint_sigma(
    scene_factory: Callable[..., Scene],
) -> None:
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
    known = lines_of(survey, adjust)
    lines, checks, effects, messages = judge_lines(examined(solve(reduced)), known, index)
    assert effects.on[4] == ""
    assert lines.status == ("used",) * 4 + ("checked", "used")
    assert checks.name == ("L4",)
    sigma = np.hypot(lines.adjusted_sigma_m[4], survey.length_sigma_m[4])
    assert checks.sigma_m[0] == pytest.approx(sigma)
    assert checks.z[0] == pytest.approx(lines.residual_m[4] / sigma) == lines.w[4]
    assert np.isnan(lines.redundancy[4])
    assert messages == ()

    wrong = changed(survey, "length_m", 4, 1.0)
    known = lines_of(wrong, adjust)
    _, _, _, messages = judge_lines(examined(solve(reduced)), known, index)
    assert [m.code for m in messages] == ["line-suspect"]


def test_a_length_to_a_label_never_picked_is_unseen_with_the_nearest_spelling(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6).survey
    lines = lines_of(survey)
    lines = replace(lines, end=("P33", *lines.end[1:]))
    without = replace(
        survey,
        **{
            name: getattr(survey, name)[1:]
            for name in ("line_start", "line_end", "length_m", "length_sigma_m")
        },
    )
    index = np.array([-1, 0, 1, 2, 3, 4])
    found, _, _, messages = judge_lines(examined(solve(without)), lines, index)
    assert found.status[0] == "unseen"
    assert np.isnan(found.adjusted_m[0])
    assert [m.code for m in messages] == ["line-unseen"]
    assert "'P33' (did you mean 'P3'?)" in messages[0].text


def test_check_points_are_judged_with_both_covariances(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(6)
    adjustment = solve(scene.survey).adjustment
    known = KnownWorldPoints(
        label=("P2", "P7", "gone"),
        world_m=np.vstack([scene.world[[2, 7]], [0, 0, 0]]),
        sigma_m=np.array([[0.1, 0.2, 0.3], [0.01, 0.01, 0.01], [1, 1, 1]]),
    )
    checks, messages = judge_points(adjustment, known, ALPHA)
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


def test_a_group_whose_sigmas_are_far_too_small_is_named(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=6).survey
    survey = replace(survey, pick_sigma_px=survey.pick_sigma_px / 4)
    groups, messages = judge_groups(solve(survey, noise="stated").adjustment, ALPHA)
    factor = {g.name: g.variance_factor for g in groups}
    assert 10 < factor["pixels"] < 24
    assert any("picks" in m.text for m in messages)


def test_a_boresight_and_a_frame_far_from_their_priors_are_named(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=6, control=6).survey
    prior = survey.telemetry
    assert prior is not None

    def turned_by(angle: float, sigma: float) -> Refined:
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
        turned = prior.gimbal_from_camera @ turn
        sure = replace(prior, boresight_sigma_rad=sigma, gimbal_from_camera=turned)
        return solve(replace(survey, telemetry=sure))

    messages = judge_suspects(examined(turned_by(0.05, 1e-5)))
    assert any("direction of the camera in its mount (x)" in m.text for m in messages)
    (cause,) = turned_by(0.2, 1e-3).causes  # 11 degrees, far beyond the sigma: the mount is wrong
    assert cause.message.code == "gimbal-off"
    assert "turned by 11 degrees" in cause.message.text

    late = np.array(prior.time_s)
    late[2] += 0.9
    tight = replace(prior, time_s=late, clock_sigma_s=0.01)
    refined, warnings = refine(replace(survey, telemetry=tight), SolveOptions())
    assert [(m.code, m.frames) for m in warnings if m.level == "warning"] == [
        ("telemetry-strained", ("f2",))
    ]
    assert not judge_suspects(examined(refined))


def test_what_grows_steadily_over_the_flight_is_not_blamed_on_the_clock(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=4, control=2).survey
    steady = Suspicion(Member("clock_drift", 0, 0), 5.0, (), (Member("boresight", 0, 0),))
    boresight = Suspicion(Member("boresight", 0, 0), 5.0, (), (Member("clock_drift", 0, 0),))
    given = replace(examined(solve(survey)), suspicions=(steady, boresight))
    messages = judge_suspects(given)
    told = [m.text for m in messages if "that changes steadily from the first photo" in m.text]
    assert told
    assert "positions of the log that jump or wander" in told[0]
    assert not any("clock drift" in m.text for m in messages)


def test_every_prior_has_a_row_with_its_name_unit_and_effect(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=4, control=2, roughness=0.05, verge=(4, 5, 9)).survey
    refined = solve(survey)
    priors = judge_priors(examined(refined))
    rows = dict(zip(zip(priors.name, priors.frame_id, strict=True), priors.unit, strict=True))
    assert rows["image x axis", "f2"] == "deg"
    assert rows["north", "f0"] == "m"
    assert rows["boresight y", ""] == rows["ground slope east", ""] == "deg"
    assert rows["fx", ""] == "px"
    assert rows["k1", ""] == "1"
    assert rows["clock offset", ""] == "s"
    assert rows["clock drift", ""] == "ppm"
    assert rows["ground slope north of 'verge'", ""] == "deg"
    assert rows["control 'P1' up", ""] == rows["departure of 'P3' from the plane", ""] == "m"
    assert len(rows) == len(priors.name)
    blocks = refined.adjustment.minimum.blocks
    telemetry = [i for i, kind in enumerate(priors.kind) if kind == "telemetry"]
    prior = survey.telemetry
    assert prior is not None
    white = np.linalg.inv(np.linalg.cholesky(prior.covariance))
    physical = np.einsum("nij,nj->ni", np.linalg.inv(white), blocks["telemetry"].residual)
    sigma = np.sqrt(np.einsum("nii->ni", prior.covariance))
    np.testing.assert_allclose(priors.residual[telemetry], (physical / sigma).ravel(), rtol=1e-6)
    assert (priors.bias[telemetry] > 0).all()
    assert set(priors.effects.on) <= {"", "whole"}


def test_a_suspect_in_one_frame_names_its_group_and_blames_nobody_else(
    scene_factory: Callable[..., Scene],
) -> None:
    pairs = ((0, 6), (1, 7), (2, 8), (3, 9), (4, 10), (5, 11))
    scene = scene_factory(
        3, frames=1, telemetry=False, gauge="plane", tilt=0.4, ends=pairs,
        sources=("pixels", "lengths"),
    )  # fmt: skip
    survey = changed(scene.survey, "length_m", 1, 0.2)
    given = examined(solve(survey))
    (message,) = judge_suspects(given)
    assert message.code == "blunder-not-located"  # nothing but its own ends checks it
    picks_of_ends = "the picks of 'P1' and 'P7' in 'f0'"
    group = f"no test shows which: the {named(lines_of(survey), 1)} or {picks_of_ends}."
    assert group in message.text
    assert (message.labels, message.lengths) == (("P1", "P7"), ("L1",))
    lines, _, _, _ = judge_lines(given, lines_of(survey), np.arange(6))
    picks, _ = judge_picks(given, *table(survey))
    assert [i for i, s in enumerate(lines.status) if s == "suspect"] == [1]
    assert [i for i, s in enumerate(picks.status) if s == "suspect"] == [1, 7]


def test_the_record_of_a_removal_tells_what_it_did(scene_factory: Callable[..., Scene]) -> None:
    survey = changed(scene_factory(6, frames=6, lines=8).survey, "length_m", 2, 0.12)
    before, after = solve(survey), solve(survey, "remove")
    lines = lines_of(survey)
    measured = examined(after).measured
    record, *_ = judge_removals(after, lines, np.arange(8), WHOLE, NO_TIMES, measured)
    assert record.what == named(lines, 2)
    (said,) = [m for m in judge_suspects(examined(before)) if m.lengths == ("L2",)]
    assert said.text.startswith(f"The {named(lines, 2)} does not fit")  # one name in both modes
    assert abs(record.w) == pytest.approx(abs(after.removals[0].suspicion.w))
    assert record.variance_factor_before > record.variance_factor_after
    steps = [before, *(r.before for r in after.removals[1:]), after]
    values = [propagate(r.adjustment, WHOLE, NO_TIMES).value for r in steps[:2] if r is not None]
    np.testing.assert_allclose(record.change, values[1] - values[0], atol=1e-9)


def test_the_weakest_link_is_named_with_its_size(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(6, frames=6, lines=8).survey
    given = examined(solve(survey))
    links = judge_weakest(given)
    lines, _, effects, _ = judge_lines(given, lines_of(survey), np.arange(8))
    largest = int(np.argmax(np.abs(effects.change)))
    assert links.what == (named(lines_of(survey), largest),)
    assert links.bias[0] == pytest.approx(lines.mdb_m[largest])
    assert links.unit == ("m",)
    assert links.change[0] == pytest.approx(effects.change[largest])
    assert effects.sigmas[largest] == pytest.approx(
        abs(effects.change[largest]) / given.measured.sigma[0]
    )


def judged_together(
    adjustment: Adjustment, lines: KnownLines, known: KnownWorldPoints
) -> tuple[ChecksOverall, tuple[Message, ...]]:
    overall, messages = judge_overall(adjustment, compare_withheld(adjustment, lines, known), ALPHA)
    assert overall is not None
    return overall, messages


def test_checks_are_judged_together_with_their_joint_covariance(
    scene_factory: Callable[..., Scene],
) -> None:
    squared = []
    for seed in range(30):
        scene = scene_factory(100 + seed, frames=3, lines=2)
        survey = scene.survey
        rng = np.random.default_rng(seed)
        ends = np.array([[0, 1], [1, 2], [2, 3]])
        truth = np.linalg.norm(scene.world[ends[:, 0]] - scene.world[ends[:, 1]], axis=1)
        lines = KnownLines(
            name=("a", "b", "c"),
            start=tuple(f"P{k}" for k in ends[:, 0]),
            end=tuple(f"P{k}" for k in ends[:, 1]),
            length_m=truth + 0.01 * rng.normal(size=3),
            sigma_m=np.full(3, 0.01),
            adjust=np.zeros(3, dtype=bool),
        )
        known = KnownWorldPoints(
            label=("P4", "P5"),
            world_m=scene.world[[4, 5]] + 0.02 * rng.normal(size=(2, 3)),
            sigma_m=np.full((2, 3), 0.02),
        )
        adjustment = solve(survey).adjustment
        if not {f"P{k}" for k in range(6)} <= set(adjustment.survey.label):
            continue
        overall, _ = judged_together(adjustment, lines, known)
        assert overall.count == 9
        squared.append(overall.chi2)
    low, high = chi2.ppf(np.array([5e-6, 1 - 5e-6]), 9 * len(squared))
    assert low < np.sum(squared) < high

    assert judged_together(adjustment, lines, NO_POINTS)[0].count == 3
    points_alone = replace(lines, adjust=~lines.adjust)
    assert judged_together(adjustment, points_alone, known)[0].count == 6
    far = replace(known, world_m=known.world_m + np.array([0.0, 0.0, 9.0]))
    overall, messages = judged_together(adjustment, lines, far)
    assert overall.rms_error_m == pytest.approx(np.sqrt(2 * 81 / 9), rel=0.2)
    assert [m.code for m in messages] == ["checks-misfit"]
    nothing = compare_withheld(adjustment, replace(lines, adjust=~lines.adjust), NO_POINTS)
    assert judge_overall(adjustment, nothing, ALPHA) == (None, ())


def test_lengths_left_out_beforehand_are_named_with_both_values_and_their_unit(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=6, ends=tuple((k, k + 6) for k in range(6))).survey
    assert survey.seeds is not None
    covariance = np.tile(np.diag([1.0, 1, 1.5, 0.03, 0.03, 0.04]) ** 2, (6, 1, 1))
    survey = replace(survey, seeds=replace(survey.seeds, covariance=covariance))
    factors = {1: 3.2808, 2: 3.2808}
    length = np.array(survey.length_m)
    for line, factor in factors.items():
        length[line] *= factor
    wrong = replace(survey, length_m=length)
    refined = solve(wrong)
    lines = lines_of(wrong)
    given = examined(refined)
    found, _, _, messages = judge_lines(given, lines, np.arange(6))
    assert messages == ()  # the cause tells
    ((message, mend),) = [(cause.message, cause.mend) for cause in refined.causes]
    assert message.code == "line-wrong-unit"
    for line in factors:
        right = survey.length_m[line]
        assert found.status[line] == "removed"
        assert f"'L{line}'" in message.text
        assert f"{right:.2f} m" in message.text
        assert mend is not None
        assert mend.length_m[line] == pytest.approx(right, rel=1e-4)
        assert found.adjusted_m[line] == pytest.approx(right, abs=0.1)
    assert "in feet, not in metres" in message.text
    assert judge_suspects(given) == ()
    records = judge_removals(refined, lines, np.arange(6), WHOLE, NO_TIMES, given.measured)
    assert [r.what for r in records] == [named(lines, line) for line in factors]
    assert message.lengths == tuple(f"L{line}" for line in factors)
    assert all(np.isnan(r.variance_factor_before) for r in records)
    assert all(np.isfinite(r.change).any() for r in records)
    assert 0.3 < records[0].variance_factor_after < 2.0


def _is_the_change_by_an_adjustment(
    change: tuple[float, ...], refined: Refined, value: np.ndarray
) -> None:
    """Compare what a length would have changed with an adjustment that has it, but hardly wrong.

    The linear model holds for a small error: of one a thousandth as large, a thousandth remains.
    """
    adjustment, line = refined.adjustment, 2
    survey = adjustment.survey
    start, end = survey.line_start[[line]], survey.line_end[[line]]
    seen = adjustment.problem.lengths_between(adjustment.state, start, end)[0][0]
    small = seen + 1e-3 * (survey.length_m[line] - seen)
    other = changed(survey, "length_m", line, small - survey.length_m[line])
    after = propagate(continued_with(adjustment, other), WHOLE, NO_TIMES).value
    np.testing.assert_allclose(value - after, 1e-3 * np.array(change), rtol=0.02, atol=1e-7)


def continued_with(adjustment: Adjustment, survey: Survey) -> Adjustment:
    """Adjust all lengths of a survey, from where another adjustment ended."""
    every = np.ones(len(survey.line_start), dtype=np.bool_)
    problem = SurveyProblem(survey, adjustment.problem.pivot_m, every)
    minimum = iterate(problem, convert_state(adjustment, problem), 30)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def test_a_length_without_which_all_fits_is_the_only_one_named(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=6, ends=tuple((k, k + 6) for k in range(6))).survey
    wrong = changed(survey, "length_m", 2, 0.25 * survey.length_m[2])
    refined = solve(wrong)
    given = examined(refined)
    assert judge_suspects(given) == ()
    (record,) = judge_removals(
        refined, lines_of(wrong), np.arange(6), WHOLE, NO_TIMES, given.measured
    )
    assert record.what == named(lines_of(wrong), 2)
    _is_the_change_by_an_adjustment(record.change, refined, given.measured.value)
    assert judge_groups(refined.adjustment, ALPHA)[1] == ()


def test_tests_of_an_adjustment_not_at_rest_accuse_nobody(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = changed(scene_factory(6, frames=2, lines=1).survey, "length_m", 0, 1.5)
    assert judge_suspects(examined(solve(survey)))  # at rest
    refined = solve(survey)
    adjusted = refined.adjustment
    unfinished = replace(adjusted.minimum, converged=False)
    refined = replace(
        refined, adjustment=Adjustment(adjusted.problem, unfinished, adjusted.covariance)
    )
    withheld = lines_of(survey, np.zeros(1, dtype=bool))
    for lines, index, status in ((lines_of(survey), 0, "used"), (withheld, -1, "checked")):
        given = examined(refined)
        found, _, _, messages = judge_lines(given, lines, np.array([index]))
        assert (*messages, *judge_suspects(given)) == ()
        assert found.status == (status,)
    assert judge_groups(refined.adjustment, ALPHA)[1] == ()


def test_a_check_point_that_is_wrong_is_named_before_the_checks_as_a_whole(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(6)
    adjustment = solve(scene.survey).adjustment
    truth = scene.world[[2, 7, 8]]
    known = KnownWorldPoints(label=("P2", "P7", "P8"), world_m=truth, sigma_m=np.full((3, 3), 0.02))
    assert judge_points(adjustment, known, ALPHA)[1] == ()
    for off, side in (([0.0, 26.0, 0.0], "north"), ([0.0, -5e6, 3e6], "south")):
        wrong = replace(known, world_m=truth + np.array([[0.0] * 3, off, [0.0] * 3]))
        _, (message,) = judge_points(adjustment, wrong, ALPHA)
        assert message.code == "check-suspect"
        assert "'P7'" in message.text
        assert f"mostly to the {side}" in message.text
        assert ("swapped" in message.text) == (side == "south")
        none = KnownLines(
            name=(), start=(), end=(), length_m=np.zeros(0), sigma_m=np.zeros(0),
            adjust=np.zeros(0, dtype=bool),
        )  # fmt: skip
        _, (message,) = judge_overall(adjustment, compare_withheld(adjustment, none, wrong), ALPHA)
        assert "that is 'P7' alone; the other 2 fit" in message.text


def test_check_points_that_are_all_off_are_told_in_one_message(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(6)
    adjustment = solve(scene.survey).adjustment
    known = KnownWorldPoints(
        label=("P2", "P7", "P8"),
        world_m=scene.world[[2, 7, 8]] + np.array([0.0, 0.0, 20.0]),
        sigma_m=np.full((3, 3), 0.02),
    )
    _, (message,) = judge_points(adjustment, known, ALPHA)
    assert message.text.startswith("3 of 3 check points are off, the median ")
    assert "mostly above" in message.text
    assert "datum of their heights" in message.text
    none = lines_of(replace(scene.survey, **{
        name: getattr(scene.survey, name)[:0]
        for name in ("line_start", "line_end", "length_m", "length_sigma_m")
    }))  # fmt: skip
    _, (message,) = judge_overall(adjustment, compare_withheld(adjustment, none, known), ALPHA)
    assert "something common to all is wrong" in message.text


NO_POINTS = KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


@pytest.mark.parametrize("outliers", ["report", "remove"])
def test_swapped_labels_are_told_as_such_and_their_picks_are_not_blamed(
    scene_factory: Callable[..., Scene], outliers: OutlierRule
) -> None:
    survey = scene_factory(6, frames=6).survey
    one, other = np.flatnonzero(survey.pick_frame == 2)[[1, 4]]
    label = np.array(survey.pick_label)
    label[[one, other]] = label[[other, one]]
    swapped = replace(survey, pick_label=label)
    given = examined(solve(swapped, outliers))
    (cause,) = given.refined.causes
    assert cause.message.code == "labels-swapped"
    assert cause.message.frames == ("f2",)
    assert set(cause.message.labels) == {survey.label[label[one]], survey.label[label[other]]}
    assert "seem to be swapped in 'f2'" in cause.message.text
    assert not [m.code for m in judge_suspects(given) if "f2" in m.frames]


def test_two_wrong_picks_of_one_photo_are_no_swapped_labels(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(6, frames=6).survey
    one, other = np.flatnonzero(survey.pick_frame == 2)[[1, 4]]
    for u_px, v_px, status in ((6.0, 5.0, "suspect"), (60.0, 60.0, "removed")):
        wrong = changed(survey, "pixel_px", (one, 0), u_px)
        wrong = changed(wrong, "pixel_px", (other, 1), v_px)
        given = examined(solve(wrong))
        picks, _ = judge_picks(given, *table(wrong))
        assert {picks.status[one], picks.status[other]} == {status}
        assert not given.refined.causes


def test_of_priors_that_nothing_parts_the_one_that_shows_is_named(
    scene_factory: Callable[..., Scene],
) -> None:
    """Of an error up, a shift east shows next to nothing: it would have to be kilometres."""
    survey = scene_factory(5, frames=6, labels=14, lines=6).survey
    track, seeds = survey.track, survey.seeds
    assert isinstance(track, Track)
    assert seeds is not None
    up = np.array([0.0, 0.0, 45.0])
    wrong = replace(
        survey,
        track=replace(track, position_world_m=track.position_world_m + up),
        seeds=replace(seeds, center_world_m=seeds.center_world_m + up),
    )
    found = examined(solve(wrong, noise="stated"))
    (one,) = [each for each in found.suspicions if each.suspect.kind == "position_bias"]
    assert (one.suspect.row, one.suspect.axis) == (2, 0)
    others = {(each.kind, each.row) for each in (*one.group, *one.rivals)}
    assert not others & {("position_bias", 0), ("position_bias", 1), ("lever_arm", 2)}
    assert "offset of the log's positions (up)" in " ".join(m.text for m in judge_suspects(found))


SYMBOLS = re.compile(r"\b([fc][xy]|[kp]\d|boresight|lever arm|bias|departure)\b")


def test_a_sentence_names_every_prior_without_a_symbol_or_a_term_of_the_field(
    scene_factory: Callable[..., Scene],
) -> None:
    found = examined(solve(scene_factory(6, frames=6, control=6).survey))
    titles = {
        (kind, axis): found.names.observation(Member(kind, 0, axis))
        for kind, group in found.groups.items()
        for axis in range(group.w.shape[1])
    }
    assert titles["calibration", 0] == "focal length of the camera"
    assert not [title for title in titles.values() if SYMBOLS.search(title)]
