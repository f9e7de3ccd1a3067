"""The adjustment as a stage: blunders, little data, no log, many frames, and clear words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gross_errors import largest_error
from scenes import Scene

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause
from uavgram.geometry.ground import measurements
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

REPORT, REMOVE = SolveOptions(), SolveOptions(outliers="remove")
AS_STATED = SolveOptions(noise="stated")
"""For exact data, several blunders, a wrong lens: noise learnt from them has its own message."""
NO_LOG = {"telemetry": False, "gauge": "plane"}
# Six unconnected lines of twelve points.
PAIRS = tuple((k, k + 6) for k in range(6))


def codes(messages: tuple[Message, ...]) -> list[str]:
    return [m.code for m in messages]


def changed(
    survey: Survey, name: str, index: int | tuple[int, int], by: float | list[float]
) -> Survey:
    values = np.array(getattr(survey, name))
    values[index] += by
    changes: dict[str, Any] = {name: values}
    return replace(survey, **changes)


def without_picks(survey: Survey, drop: Ints) -> Survey:
    keep = np.setdiff1d(np.arange(len(survey.pick_frame)), drop)
    names = ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
    return replace(survey, **{n: getattr(survey, n)[keep] for n in names})


def only_lines(survey: Survey, count: int) -> Survey:
    names = ("line_start", "line_end", "length_m", "length_sigma_m")
    return replace(survey, **{n: getattr(survey, n)[:count] for n in names})


def distances(adjustment: Adjustment) -> Floats:
    world, _ = adjustment.points()
    length: Floats = np.linalg.norm(world[:, None] - world[None], axis=2)
    return length


def true_distances(scene: Scene) -> Floats:
    length: Floats = np.linalg.norm(scene.world[:, None] - scene.world[None], axis=2)
    return length


@pytest.mark.parametrize("options", [{}, NO_LOG], ids=["log", "no log"])
def test_a_wrong_tape_reading_takes_no_part_and_is_recorded(
    scene_factory: Callable[..., Scene], options: dict[str, object]
) -> None:
    scene = scene_factory(2, frames=6, ends=PAIRS, **options)
    survey = changed(scene.survey, "length_m", 4, 0.5)
    refined, messages = refine(survey, REMOVE)

    assert refined.line_removed.tolist() == [False] * 4 + [True, False]
    assert not refined.pick_removed.any()
    assert [(r.kind, r.index) for r in refined.removals] == [("line", 4)]
    assert codes(messages) == []  # the judge names what took no part
    clean, _ = refine(scene.survey, REPORT)
    shift = np.abs(distances(refined.adjustment) - distances(clean.adjustment))
    assert shift.max() < 0.1


@pytest.mark.parametrize("options", [REPORT, REMOVE], ids=["report", "remove"])
def test_a_wrong_pick_takes_no_part_and_is_named(
    scene_factory: Callable[..., Scene], options: SolveOptions
) -> None:
    scene = scene_factory(2, frames=6)
    survey = changed(scene.survey, "pixel_px", (17, 0), 15.0)
    refined, messages = refine(survey, options)

    assert list(refined.pick_reason) == [17]
    assert not refined.line_removed.any()
    assert 17 not in refined.pick_index
    assert codes(messages) == ["pick-left-out"]
    label = survey.label[survey.pick_label[17]]
    frame = survey.frame_id[survey.pick_frame[17]]
    assert repr(label) in messages[0].text
    assert repr(frame) in messages[0].text


def test_report_keeps_what_is_suspected_and_no_gross_error(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2, frames=6)
    survey = changed(changed(scene.survey, "pixel_px", (17, 0), 3.0), "length_m", 4, 0.05)
    for options in (REPORT, AS_STATED):
        refined, _ = refine(survey, options)
        assert refined.removals == ()
        assert refined.pick_reason == {}
        assert not refined.pick_removed.any()
        assert not refined.line_removed.any()
        assert len(refined.pick_index) == len(survey.pick_frame)


@pytest.mark.parametrize("options", [REPORT, REMOVE], ids=["report", "remove"])
def test_a_wrong_pick_and_a_wrong_length_both_take_no_part(
    scene_factory: Callable[..., Scene], options: SolveOptions
) -> None:
    scene = scene_factory(2, frames=6, lines=8)
    survey = changed(changed(scene.survey, "pixel_px", (17, 0), 15.0), "length_m", 4, 0.5)
    refined, _ = refine(survey, options)

    assert list(refined.pick_reason) == [17]
    assert np.flatnonzero(refined.line_removed).tolist() == [4]


def test_a_blunder_that_cannot_be_located_is_reported_with_all_that_may_be_wrong(
    scene_factory: Callable[..., Scene],
) -> None:
    # Four lines seen by one frame: one redundancy, every standardised residual is the same.
    scene = scene_factory(5, labels=8, frames=1, ends=((0, 4), (1, 5), (2, 6), (3, 7)), **NO_LOG)
    given = replace(scene.survey, line_name=("a", "b", "c", "d"))
    for options in (REPORT, REMOVE):
        refined, _ = refine(changed(given, "length_m", 1, 1.0), options)
        out = {given.line_name[k] for k in np.flatnonzero(refined.line_removed)}
        assert len(out) == 1
        # Without the first, two poses merge and nothing determines the photo.
        rivals = {one for rival in refined.rivals for one in rival.readings}
        assert out | {one.name for one in rivals if one.kind == "lengths"} == {"b", "c", "d"}
        # Of the clicks, those at the ends of these lengths.
        clicks = {one.name for one in rivals if one.kind == "pixels"}
        assert clicks == {given.label[k] for k in (1, 2, 3, 5, 6, 7)}
        assert refined.pick_reason == {}
        refined, _ = refine(given, options)
        assert not refined.line_removed.any()
        assert refined.rivals == ()


def test_telemetry_alone_without_any_line(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(3, lines=0)
    refined, messages = refine(scene.survey, REPORT)

    assert messages == ()
    assert "lengths" not in refined.adjustment.minimum.blocks
    world, covariance = refined.adjustment.joint_points(np.array([0, 9]))
    value, gradient = measurements.distance(world)
    sigma = np.sqrt(gradient.ravel() @ covariance @ gradient.ravel())
    assert abs(value - true_distances(scene)[0, 9]) < 4 * sigma < 0.3 * value


def test_one_frame_with_telemetry(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(3, frames=1, lines=2)
    refined, _ = refine(scene.survey, REPORT)
    assert refined.adjustment.minimum.converged


@pytest.mark.parametrize("frames", [1, 4])
@pytest.mark.parametrize("lines", [4, 6])
def test_lengths_alone_give_the_truth_of_exact_data(
    scene_factory: Callable[..., Scene], frames: int, lines: int
) -> None:
    scene = scene_factory(4, frames=frames, ends=PAIRS[:lines], noise=0.0, **NO_LOG)
    refined, messages = refine(scene.survey, AS_STATED)

    assert codes(messages) == []
    assert refined.alternatives == ()
    np.testing.assert_allclose(distances(refined.adjustment), true_distances(scene), atol=1e-5)
    np.testing.assert_allclose(refined.adjustment.state.center[0], scene.truth.center[0], atol=1e-5)


def test_three_lengths_warn_that_nothing_checks_them(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(4, frames=1, ends=PAIRS[:3], **NO_LOG)
    _, messages = refine(scene.survey, REPORT)
    assert "three-lengths" in codes(messages)


def test_a_triangle_reports_its_other_solutions(scene_factory: Callable[..., Scene]) -> None:
    several = 0
    for seed in range(8):
        scene = scene_factory(
            seed, frames=1, labels=6, ends=((0, 1), (1, 2), (2, 0)), noise=0.0, **NO_LOG
        )
        refined, messages = refine(scene.survey, REPORT)
        found = [refined.adjustment, *refined.alternatives]
        wrong = [np.abs(distances(a) - true_distances(scene)).max() for a in found]
        assert min(wrong) < 1e-4, seed
        assert ("ambiguous-pose" in codes(messages)) == bool(refined.alternatives)
        for i, one in enumerate(found):
            assert one.minimum.cost < 1e-6
            assert all(np.abs(distances(one) - distances(o)).max() > 1e-3 for o in found[:i]), seed
        several += bool(refined.alternatives)
    assert several >= 5


def test_other_solutions_keep_their_odds_when_the_noise_is_learnt(
    scene_factory: Callable[..., Scene],
) -> None:
    """All of them fit three lengths alike: with the noise that is learnt as well as without."""
    scene = scene_factory(7, frames=1, labels=6, ends=((0, 1), (1, 2), (2, 0)), noise=0.0, **NO_LOG)
    exact, rng, clicks = scene.survey, np.random.default_rng(2), 8
    pixel = np.tile(exact.pixel_px, (clicks, 1))
    survey = replace(
        exact,
        pick_frame=np.tile(exact.pick_frame, clicks),
        pick_label=np.tile(exact.pick_label, clicks),
        pixel_px=pixel + 2.5 * rng.normal(size=pixel.shape),
        pick_sigma_px=np.ones(len(pixel)),
        target_pick=np.tile(exact.target_pick, clicks),
    )
    refined, _ = refine(survey, SolveOptions())
    assert refined.alternatives
    assert refined.stated is not None
    assert refined.stated.minimum.cost > 4.0 * refined.adjustment.minimum.cost
    assert sum(probability for _, probability in refined.list_explanations()) > 0.3


def test_three_lines_left_after_a_removal_warn_too(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(2, frames=6, ends=PAIRS[:4], **NO_LOG)
    survey = changed(scene.survey, "length_m", 1, 0.3)
    refined, messages = refine(survey, REMOVE)
    assert [(r.kind, r.index) for r in refined.removals] == [("line", 1)]
    assert "three-lengths" in codes(messages)


def test_a_removed_length_no_longer_leads_the_first_values(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2, frames=6, ends=PAIRS, **NO_LOG)
    survey = changed(scene.survey, "length_m", 1, 5.0)
    refined, _ = refine(survey, REMOVE)
    assert [(r.kind, r.index) for r in refined.removals] == [("line", 1)]
    assert np.abs(distances(refined.adjustment) - true_distances(scene)).max() < 0.15


def test_frames_are_joined_over_shared_points_without_log(
    scene_factory: Callable[..., Scene],
) -> None:
    # Only the first frame sees all lines; the others hang on it by their points.
    scene = scene_factory(6, frames=5, labels=14, ends=PAIRS[:5], noise=0.0, along=25.0, **NO_LOG)
    refined, messages = refine(scene.survey, AS_STATED)
    survey = refined.adjustment.survey

    assert codes(messages) == []
    assert len(survey.frame_id) == 5
    index = [scene.survey.label.index(name) for name in survey.label]
    expected = true_distances(scene)[np.ix_(index, index)]
    np.testing.assert_allclose(distances(refined.adjustment), expected, atol=1e-4)


def test_a_frame_that_shares_too_little_is_left_out_with_a_reason(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(6, frames=4, ends=PAIRS, **NO_LOG)
    last = np.flatnonzero(scene.survey.pick_frame == 3)
    survey = without_picks(scene.survey, last[3:])
    refined, messages = refine(survey, REPORT)

    assert refined.adjustment.survey.frame_id == ("f0", "f1", "f2")
    assert codes(messages) == ["frame-left-out"]
    assert "'f3'" in messages[0].text
    assert "four points" in messages[0].text


def test_distances_and_their_sigmas_do_not_depend_on_the_gauge(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(6, frames=4, ends=PAIRS, **NO_LOG)
    survey = scene.survey
    order = np.array([2, 0, 3, 1])  # new number of each frame: another one comes first
    names = [survey.frame_id[k] for k in np.argsort(order)]
    other = replace(survey, frame_id=tuple(names), pick_frame=order[survey.pick_frame])
    found = []
    for each in (survey, other):
        adjustment = refine(each, REPORT)[0].adjustment
        world, covariance = adjustment.joint_points(np.array([0, 9]))
        value, gradient = measurements.distance(world)
        found.append((value, float(np.sqrt(gradient.ravel() @ covariance @ gradient.ravel()))))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-4 * found[0][1])
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-4)


def test_a_pick_that_the_lens_cannot_invert_is_left_out(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2)
    survey = scene.survey
    parameters = np.array(survey.calibration.parameters)
    parameters[4:9] = [-0.3, 0, 0, 0, 0]  # folds at r = 1 / sqrt(0.9)
    survey = replace(survey, calibration=replace(survey.calibration, parameters=parameters))
    survey = changed(survey, "pixel_px", 3, [9000.0, 9000.0])
    refined, messages = refine(survey, AS_STATED)

    assert 3 not in refined.pick_index
    assert refined.pick_reason[3].cause is LeftOutCause.BEYOND_LENS
    assert (
        refined.pick_reason[3].text == "the lens is not calibrated there, at the rim of the photo"
    )
    # The picks are of another lens than the camera file now has, and that is said first.
    first, second = codes(messages)[:2]
    assert (first, second) == ("camera-contradicted", "pick-left-out")


@pytest.mark.parametrize("options", [{}, NO_LOG], ids=["log", "no log"])
def test_a_pick_above_the_horizon_is_left_out_and_the_rest_solved(
    scene_factory: Callable[..., Scene], options: dict[str, object]
) -> None:
    scene = scene_factory(5, frames=3, tilt=0.5, ends=PAIRS, **options)
    survey = scene.survey
    assert refine(survey, REPORT)[0].pick_reason == {}
    # A point of its own, in the first frame, far above the image: its ray goes up.
    survey = replace(
        survey,
        label=(*survey.label, "sky"),
        height_above_m=np.append(survey.height_above_m, 0.0),
        height_sigma_m=np.append(survey.height_sigma_m, 0.0),
        is_free=np.append(survey.is_free, False),
        identification_sigma_m=np.zeros(0),
        area=np.append(survey.area, 0),
        pick_frame=np.append(survey.pick_frame, 0),
        pick_label=np.append(survey.pick_label, len(survey.label)),
        pixel_px=np.vstack([survey.pixel_px, [1000.0, -6000.0]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, 0.7),
    )
    refined, messages = refine(survey, REPORT)

    last = len(survey.pick_frame) - 1
    assert list(refined.pick_reason) == [last]
    assert "does not meet the ground" in refined.pick_reason[last].text
    assert "sky" not in refined.adjustment.survey.label
    assert codes(messages) == ["pick-left-out"]


def test_a_sky_pick_and_a_lost_frame_each_get_their_own_reason(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2, frames=4, tilt=0.6, ends=PAIRS, **NO_LOG)
    last = np.flatnonzero(scene.survey.pick_frame == 3)
    survey = without_picks(scene.survey, last[3:])
    survey = replace(
        survey,
        label=(*survey.label, "sky"),
        height_above_m=np.append(survey.height_above_m, 0.0),
        height_sigma_m=np.append(survey.height_sigma_m, 0.0),
        is_free=np.append(survey.is_free, False),
        identification_sigma_m=np.zeros(0),
        area=np.append(survey.area, 0),
        pick_frame=np.append(survey.pick_frame, 0),
        pick_label=np.append(survey.pick_label, len(survey.label)),
        pixel_px=np.vstack([survey.pixel_px, [1000.0, -6000.0]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, 0.7),
    )
    refined, _ = refine(survey, REPORT)
    sky = len(survey.pick_frame) - 1
    assert "does not meet the ground" in refined.pick_reason[sky].text
    lost = [k for k in refined.pick_reason if k != sky]
    assert len(lost) == 3
    assert all("nothing places its photo" in refined.pick_reason[k].text for k in lost)


@pytest.mark.parametrize("options", [{}, NO_LOG], ids=["log", "no log"])
def test_labels_with_known_height_stand_above_the_plane(
    scene_factory: Callable[..., Scene], options: dict[str, object]
) -> None:
    heights = {3: 1.2, 7: -0.3, 8: 2.0}
    scene = scene_factory(2, frames=5, heights=heights, ends=PAIRS, noise=0.0, **options)
    refined, messages = refine(scene.survey, AS_STATED)
    assert codes(messages) == []
    np.testing.assert_allclose(distances(refined.adjustment), true_distances(scene), atol=1e-4)


def test_two_control_points_and_three_lines_place_a_world_without_log(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(4, frames=2, ends=PAIRS, control=2, telemetry=False, noise=0.0)
    refined, _ = refine(scene.survey, REPORT)
    world, _ = refined.adjustment.points()
    np.testing.assert_allclose(world, scene.world, atol=1e-3)


def test_poor_seeds_lead_to_the_same_solution(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(2, frames=6)
    first = refine(scene.survey, REPORT)[0].adjustment
    turn = np.array([[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]])
    seeds = scene.survey.seeds
    assert seeds is not None
    seeds = replace(
        seeds,
        world_from_camera=seeds.world_from_camera @ turn,
        center_world_m=seeds.center_world_m + np.array([5.0, -4.0, 3.0]),
    )
    second = refine(replace(scene.survey, seeds=seeds), REPORT)[0].adjustment
    # The slopes turn about the mean of the first values: a few metres apart, that moves the
    # prior of the height by a small part of its sigma, and nothing else.
    assert second.minimum.cost == pytest.approx(first.minimum.cost, abs=0.1)
    world, covariance = first.points()
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    assert (np.abs(second.points()[0] - world) < 0.1 * sigma).all()


def test_hundreds_of_frames_come_to_rest_and_are_honest(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(1, frames=300, labels=1200, lines=0, along=3000.0)
    ends = np.arange(0, 1190, 100)
    world = scene.world
    survey = replace(
        scene.survey,
        line_start=ends,
        line_end=ends + 1,
        length_m=np.linalg.norm(world[ends] - world[ends + 1], axis=1),
        length_sigma_m=np.full(len(ends), 0.01),
    )
    adjustment = refine(survey, REPORT)[0].adjustment

    assert adjustment.minimum.factor.sparse
    assert adjustment.minimum.converged
    world, covariance = adjustment.points()
    index = [scene.survey.label.index(name) for name in adjustment.survey.label]
    error = world - scene.world[index]
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
    assert np.median(squared) < 8
    joint = adjustment.joint_points(np.array([0, 700]))[1]
    np.testing.assert_allclose(joint[:3, :3], covariance[0], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(joint[3:, 3:], covariance[700], rtol=1e-6, atol=1e-9)


# What is missing is named.


def test_two_lengths_without_log_say_how_many_are_needed(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = only_lines(scene_factory(4, ends=PAIRS, **NO_LOG | {"frames": 1}).survey, 2)
    with pytest.raises(GeometryError, match=r"three known lengths.*most so far: 2 in 'f0'"):
        refine(survey, REPORT)


def test_two_control_points_in_one_photo_say_what_is_needed(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(4, frames=1, telemetry=False, control=2, lines=0).survey
    with pytest.raises(GeometryError, match="three control points in it"):
        refine(survey, REPORT)


def test_two_control_points_are_the_scale_of_several_photos(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(4, telemetry=False, control=2, lines=0)
    refined, _ = refine(scene.survey, REPORT)
    assert refined.adjustment.minimum.converged
    assert largest_error(refined.adjustment, scene) < 4.0


def test_three_control_points_place_a_photo(scene_factory: Callable[..., Scene]) -> None:
    """Each of the poses that three points allow is reported, the true one among them."""
    scene = scene_factory(4, frames=1, telemetry=False, control=3, lines=0)
    refined, _ = refine(scene.survey, REPORT)
    poses = (refined.adjustment, *refined.alternatives)
    assert min(largest_error(one, scene) for one in poses) < 4.0


@pytest.mark.parametrize("seed", range(6))
def test_control_points_decide_between_the_poses_of_three_lengths(
    scene_factory: Callable[..., Scene], seed: int
) -> None:
    """Three lengths allow several poses of one photo, and the first is not always the true one."""
    scene = scene_factory(
        seed, frames=1, labels=8, telemetry=False, control=3, ends=((0, 4), (1, 5), (2, 6))
    )
    refined, _ = refine(scene.survey, REPORT)
    assert not refined.left_out
    poses = (refined.adjustment, *refined.alternatives)
    assert min(largest_error(one, scene) for one in poses) < 4.0


def test_no_pick_that_meets_the_ground_says_so(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(4, tilt=0.6)
    pixel = np.tile([1000.0, -30000.0], (len(scene.survey.pick_frame), 1))
    with pytest.raises(GeometryError, match="no pick can be used"):
        refine(replace(scene.survey, pixel_px=pixel), REPORT)


def test_lines_that_share_one_end_pose_no_riddle(scene_factory: Callable[..., Scene]) -> None:
    # A star: three lengths from one point. Whatever comes of it, it is no crash.
    scene = scene_factory(4, frames=1, labels=5, ends=((0, 1), (0, 2), (0, 3)), **NO_LOG)
    refined, messages = refine(scene.survey, REPORT)
    assert "three-lengths" in codes(messages)
    assert refined.adjustment.minimum.converged


def test_one_line_taped_three_times_is_one_line(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(4, frames=1, labels=5, ends=((0, 1), (0, 1), (0, 1)), **NO_LOG)
    with pytest.raises(GeometryError, match=r"three known lengths .*\(most so far: 1 in 'f0'\)"):
        refine(scene.survey, REPORT)


def test_the_same_survey_twice_gives_the_same_bits(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(9).survey
    one, two = (refine(survey, REMOVE)[0].adjustment for _ in range(2))
    assert (one.state.point == two.state.point).all()
    assert (one.frame_covariance() == two.frame_covariance()).all()
