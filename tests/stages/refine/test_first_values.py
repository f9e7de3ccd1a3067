"""Where the adjustment starts, and what it leaves out so that the rest goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from random_scenes import MEASURED, Kind, random_scene
from scenes import Scene
from scipy.spatial.transform import Rotation

from uavgram.errors import GeometryError
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.flight_log import Track
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Sightings, Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.first_values import find_first_values

REPORT = SolveOptions()
NO_LOG = {"telemetry": False, "gauge": "plane"}
PAIRS = tuple((k, k + 6) for k in range(6))
TRIANGLE = ((0, 1), (1, 2), (2, 0))


def with_log(
    scene: Scene, rng: np.random.Generator, degrees: float, share: float, off: float = 1.0
) -> Survey:
    """A log whose sigmas are so many degrees of level and that share of the height.

    It is wrong by `off` of them in every frame, to any side.
    """
    survey, truth = scene.survey, scene.truth
    frames = len(survey.frame_id)
    side, sign = rng.uniform(0, 2 * np.pi, frames), rng.choice([-1, 1], frames)
    axis = np.stack([np.cos(side), np.sin(side), np.zeros(frames)], axis=1)
    turn = Rotation.from_rotvec(off * np.deg2rad(degrees) * axis)
    rise = off * share * sign * truth.center[:, 2]
    track, telemetry, seeds = survey.track, survey.telemetry, survey.seeds
    assert isinstance(track, Track)
    assert telemetry is not None
    assert seeds is not None
    times = len(track.position_time_s) // frames
    position = np.array(track.position_world_m)
    position[:, 2] += np.repeat(rise, times)
    body = Rotation.from_quat(track.world_from_body_xyzw)
    logged = Rotation.from_matrix(np.repeat(turn.as_matrix(), times, axis=0)) * body
    center = np.array(truth.center)
    center[:, 2] += rise
    sigma = [0.5, 0.5, share * truth.center[:, 2].mean(), *[np.deg2rad(degrees)] * 3]
    covariance = np.tile(np.diag(np.square(sigma)), (frames, 1, 1))
    return replace(
        survey,
        track=replace(track, position_world_m=position, world_from_body_xyzw=logged.as_quat()),
        telemetry=replace(telemetry, covariance=covariance),
        seeds=replace(
            seeds,
            center_world_m=center,
            world_from_camera=turn.as_matrix() @ truth.rotation,
            covariance=covariance,
        ),
    )


def started_at_truth(survey: Survey, truth: State) -> Survey:
    assert survey.seeds is not None
    seeds = replace(survey.seeds, center_world_m=truth.center, world_from_camera=truth.rotation)
    return replace(survey, seeds=seeds)


def found_from_first_frame(survey: Survey) -> Survey:
    """The survey with matches of the first frame's picks where other frames had picks of these."""
    by_hand = survey.pick_frame == 0
    first, label = np.flatnonzero(by_hand), survey.pick_label
    place = np.full(len(survey.label), -1)
    place[label[first]] = np.arange(len(first))
    rows = np.concatenate([first, np.flatnonzero(~by_hand & (place[label] >= 0))])
    matches = Sightings(
        frame=survey.pick_frame[rows],
        point=place[label[rows]],
        pixel_px=survey.pixel_px[rows],
        sigma_px=np.full(len(rows), 0.3),
        row=rows,
        pick=np.arange(len(first)),
    )
    alone = {
        name: getattr(survey, name)[by_hand]
        for name in ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
    }
    return replace(survey, matches=matches, **alone)


def test_matches_place_a_frame_without_a_log_as_picks_do(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2, frames=3, ends=PAIRS, noise=0.0, **NO_LOG)
    survey = found_from_first_frame(scene.survey)
    (begun, *_), (by_picks, *_) = map(find_first_values, (survey, scene.survey))
    refined, _ = refine(survey, REPORT)

    assert set(survey.pick_frame) == {0}
    np.testing.assert_allclose(begun.center, by_picks.center, atol=0.02)
    assert refined.adjustment.survey.frame_id == survey.frame_id
    np.testing.assert_allclose(refined.adjustment.state.center, scene.truth.center, atol=0.02)


@pytest.mark.statistical
@pytest.mark.parametrize(("frames", "number"), [(1, 16), (4, 8)])
@pytest.mark.parametrize("tilt", [0.0, 0.35])
def test_seeds_20_degrees_and_40_percent_wrong_lead_to_the_minimum_nearest_the_truth(
    scene_factory: Callable[..., Scene], frames: int, number: int, tilt: float
) -> None:
    rng = np.random.default_rng(frames)
    reached = 0
    for seed in range(number):
        scene = scene_factory(seed, frames=frames, ends=PAIRS, noise=0.0, tilt=tilt)
        survey = with_log(scene, rng, 20.0, 0.4)
        if len(find_first_values(survey)) == 0 or len(scene.survey.line_start) < 3:
            continue
        refined, _ = refine(survey, REPORT)
        best, _ = refine(started_at_truth(survey, scene.truth), REPORT)
        if len(best.adjustment.problem.line_index) < 3:
            continue  # its lines are not in view: nothing could correct such a log
        cost, least = refined.adjustment.minimum.cost, best.adjustment.minimum.cost
        assert cost <= least + 0.01, seed
        assert refined.adjustment.minimum.converged
        assert len(refined.pick_index) == len(survey.pick_frame)
        reached += 1
    assert reached >= 0.75 * number


def test_a_step_that_brings_a_picked_point_behind_its_camera_is_refused(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2)
    used = np.ones(len(scene.survey.line_start), dtype=bool)
    problem = SurveyProblem(scene.survey, scene.pivot, used)
    assert problem.evaluate(scene.truth) is not None
    turned = np.array(scene.truth.rotation)
    turned[1] = turned[1] @ np.diag([1.0, -1.0, -1.0])
    assert problem.evaluate(replace(scene.truth, rotation=turned)) is None


def test_a_log_keeps_those_other_solutions_that_it_allows_and_says_so(
    scene_factory: Callable[..., Scene],
) -> None:
    kept, allowed = 0, 0
    for seed in range(4):
        scene = scene_factory(seed, frames=1, labels=6, ends=TRIANGLE, noise=0.0)
        wide = refine(with_log(scene, np.random.default_rng(0), 30.0, 0.5, off=0.0), REPORT)
        tight = refine(with_log(scene, np.random.default_rng(0), 0.5, 0.01, off=0.0), REPORT)
        assert tight[0].alternatives == ()
        # Of one photo, the log's pose fits the mirrored picks too: that alone remains open.
        assert [m.code for m in tight[1]] == ["mirrored-undecided"]
        for other in wide[0].alternatives:
            kept += 1
            # Both explain the lengths; what the log says of the other pose is in its cost.
            apart = other.minimum.cost - wide[0].adjustment.minimum.cost
            allowed += 0 <= apart < 10.9
        told = [m for m in wide[1] if m.code == "ambiguous-pose"]
        assert len(told) == (1 if wide[0].alternatives else 0)
        assert all("within the uncertainty of the log" in m.text for m in told)
        assert all("%" in m.text for m in told)
    assert kept == allowed
    assert kept >= 2


def nonsense(
    survey: Survey, frame: int, rng: np.random.Generator, spread: float = 1400.0
) -> Survey:
    """The survey with one frame's picks anywhere in the image."""
    pixel = np.array(survey.pixel_px)
    picks = survey.pick_frame == frame
    pixel[picks] = rng.uniform([50, 50], [1950, spread], (picks.sum(), 2))
    return replace(survey, pixel_px=pixel)


@pytest.mark.parametrize("options", [{}, NO_LOG], ids=["log", "no log"])
@pytest.mark.parametrize(("frame", "seed"), [(0, 2), (3, 0)])
def test_a_frame_of_nonsense_is_left_out_by_name_and_the_rest_goes_on(
    scene_factory: Callable[..., Scene], options: dict[str, object], frame: int, seed: int
) -> None:
    scene = scene_factory(seed, frames=6, ends=PAIRS, **options)
    survey = nonsense(scene.survey, frame, np.random.default_rng(seed))
    refined, messages = refine(survey, REPORT)
    left = [f for f in survey.frame_id if f not in refined.adjustment.survey.frame_id]
    assert left == [f"f{frame}"]
    told = [m for m in messages if m.code == "frame-left-out"]
    assert len(told) == 1
    assert f"'f{frame}'" in told[0].text
    picks = np.flatnonzero(survey.pick_frame == frame)
    assert set(picks.tolist()) <= set(refined.pick_reason)
    if not options:  # the world is that of the log: points lie where they do
        world, covariance = refined.adjustment.points()
        index = [survey.label.index(name) for name in refined.adjustment.survey.label]
        error = world - scene.world[index]
        squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
        assert np.median(squared) < 12


def test_lengths_that_leave_the_plane_open_leave_it_to_the_log(
    scene_factory: Callable[..., Scene],
) -> None:
    ends = ((0, 1), (1, 0), (0, 1), (2, 3))
    scene = scene_factory(4, frames=2, labels=6, ends=ends)
    assert len(find_first_values(scene.survey)) == 1
    refined, _ = refine(scene.survey, REPORT)
    assert refined.adjustment.minimum.converged


@pytest.mark.parametrize("options", [{}, NO_LOG], ids=["log", "no log"])
def test_two_frames_of_nonsense_do_not_hide_each_other(
    scene_factory: Callable[..., Scene], options: dict[str, object]
) -> None:
    rng = np.random.default_rng(1)
    scene = scene_factory(2, frames=5, ends=PAIRS, **options)
    survey = nonsense(nonsense(scene.survey, 1, rng), 4, rng)
    refined, messages = refine(survey, REPORT)
    left = [f for f in survey.frame_id if f not in refined.adjustment.survey.frame_id]
    assert left == ["f1", "f4"]
    assert len([m for m in messages if m.code == "frame-left-out"]) == 2
    assert refined.adjustment.minimum.converged


def test_a_length_that_only_one_frame_shows_is_suspected_before_the_frame(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(2, frames=6, ends=PAIRS).survey
    # The ends of the first line stay in one frame alone, and its tape is metres off.
    ends = survey.line_start[0], survey.line_end[0]
    keep = ~np.isin(survey.pick_label, ends) | (survey.pick_frame == 3)
    length = np.array(survey.length_m)
    length[0] += 8.0
    survey = replace(
        survey,
        length_m=length,
        **{
            name: getattr(survey, name)[keep]
            for name in ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
        },
    )
    refined, _ = refine(survey, SolveOptions(outliers="remove"))
    assert [(r.kind, r.index) for r in refined.removals] == [("line", 0)]
    assert "f3" in refined.adjustment.survey.frame_id


def test_one_wrong_pick_is_no_reason_to_leave_a_frame_out(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(2, frames=6, ends=PAIRS).survey
    pixel = np.array(survey.pixel_px)
    pixel[17, 0] += 60.0
    refined, messages = refine(replace(survey, pixel_px=pixel), REPORT)
    assert list(refined.pick_reason) == [17]
    assert [message.code for message in messages] == ["pick-left-out"]
    assert len(refined.adjustment.survey.frame_id) == 6


def test_lines_that_run_one_way_are_named_with_the_line_to_tape_next(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(4, frames=1, labels=12, noise=0.0, **NO_LOG)
    # Five lines of one direction, at both sides of the scene.
    world = scene.world
    order = np.argsort(np.arctan2(*(world[:, None, :2] - world[None, :, :2]).T) % np.pi, axis=None)
    first, second = np.unravel_index(order, (12, 12))
    chosen = [(a, b) for a, b in zip(first, second, strict=True) if a < b][:5]
    start, end = np.array(chosen).T
    length = np.linalg.norm(world[start] - world[end], axis=1)
    survey = replace(
        scene.survey,
        line_start=start,
        line_end=end,
        length_m=length,
        length_sigma_m=np.full(5, 0.01),
    )
    refined, messages = refine(survey, REPORT)
    (told,) = [m for m in messages if m.code == "weak-lengths"]
    assert "nearly one direction" in told.text
    assert "best from" in told.text
    assert "distances would then be known to" in told.text
    assert refined.adjustment.minimum.converged


def test_well_spread_lines_need_no_word(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(4, frames=1, ends=PAIRS, **NO_LOG)
    _, messages = refine(scene.survey, REPORT)
    assert [m.code for m in messages] == []


THREE = Kind(sources=("pixels", "lengths"), telemetry=("absent",), lines=(3, 3), frames=(1,))


def test_a_pose_that_nothing_determines_gives_way_to_one_that_sees_sky_at_a_pick() -> None:
    # Three lengths allow two poses in which one pick lies above the horizon, and nearly allow a
    # third that has all picks on the ground, but two of whose solutions merge.
    refined, messages = refine(random_scene((3, 379), THREE).survey, REPORT)
    assert refined.adjustment.minimum.converged
    assert len(refined.pick_reason) == 1
    assert "pick-left-out" in {m.code for m in messages}


def test_three_lengths_at_which_two_poses_merge_are_told_with_the_way_out() -> None:
    with pytest.raises(GeometryError, match="poses that three lengths allow merge here: tape"):
        refine(random_scene((3, 264), THREE).survey, REPORT)


@pytest.mark.parametrize("number", [76, 133, 198])
def test_a_pose_that_nothing_determines_is_still_told_beside_the_one_that_is_found(
    number: int,
) -> None:
    """The true one, in these scenes; alone, the other is 10 to 77 sigmas off."""
    kind = Kind(sources=("pixels", "lengths"), telemetry=("absent",), lines=(3, 3), frames=(1,))
    scene = random_scene((3, number), kind)
    refined, messages = refine(scene.survey, REPORT)
    assert "ambiguous-pose" in [message.code for message in messages]
    true = np.linalg.norm(np.diff(scene.world[list(MEASURED)], axis=0))
    off = []
    for one in (refined.adjustment, *refined.alternatives):
        start, end = ([one.label_index(f"P{k}")] for k in MEASURED)
        found, _, _ = one.problem.lengths_between(one.state, np.array(start), np.array(end))
        off.append(abs(found[0] / true - 1.0))
    assert min(off) < 0.02 < max(off), off


@pytest.mark.parametrize("number", [76, 28, 52])
def test_a_rival_that_nothing_determines_does_not_stop_a_survey_with_an_unknown_camera(
    number: int,
) -> None:
    kind = Kind(sources=("pixels", "lengths"), telemetry=("absent",), lines=(3, 3), frames=(1,))
    survey = random_scene((3, number), kind).survey
    covariance = np.array(survey.calibration.covariance)
    covariance[:2], covariance[:, :2] = 0.0, 0.0
    focal = 0.2 * survey.calibration.parameters[0]
    covariance[:2, :2] = focal**2 * np.array([[1.0, 0.999], [0.999, 1.0]])
    calibration = replace(survey.calibration, covariance=covariance)
    _, messages = refine(replace(survey, calibration=calibration), REPORT)
    assert "ambiguous-pose" in [message.code for message in messages]
