"""Known lengths and control points that are wrong beyond doubt: named, alone, and left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene

from uavgram.errors import GeometryError
from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import minima, readjustment, refine
from uavgram.stages.refine.staged_sigmas import iterate

REPORT, REMOVE = SolveOptions(), SolveOptions(outliers="remove")
NO_LOG = {"telemetry": False, "gauge": "plane"}
PAIRS = tuple((k, k + 6) for k in range(6))
SEED_SIGMA = np.array([1.0, 1.0, 1.5, 0.03, 0.03, 0.04])


def logged(scene: Scene, pose_sigma: Floats = SEED_SIGMA) -> Survey:
    """The survey with seeds that know how well they are known."""
    survey = scene.survey
    covariance = np.tile(np.diag(pose_sigma**2), (len(survey.frame_id), 1, 1))
    assert survey.seeds is not None
    return replace(survey, seeds=replace(survey.seeds, covariance=covariance))


def times(survey: Survey, factors: dict[int, float]) -> Survey:
    length = np.array(survey.length_m)
    for line, factor in factors.items():
        length[line] *= factor
    return replace(survey, length_m=length)


def left_out(refined: Refined) -> dict[int, Refined | None]:
    return {r.index: r.before for r in refined.removals}


@pytest.mark.parametrize(
    ("factor", "options", "cause"),
    [
        (1000.0, REPORT, ("line-wrong-unit",)),
        (1 / 0.3048, REPORT, ("line-wrong-unit",)),
        (0.1, REPORT, ("line-wrong-digit",)),
        (2.3, REPORT, ()),
    ],
)
def test_a_length_in_another_unit_is_left_out_alone_and_the_rest_is_as_without_it(
    scene_factory: Callable[..., Scene],
    factor: float,
    options: SolveOptions,
    cause: tuple[str, ...],
) -> None:
    scene = scene_factory(2, frames=6, ends=PAIRS)
    survey = logged(scene)
    refined, messages = refine(times(survey, {1: factor}), options)
    assert refined.line_removed.tolist() == [False, True, False, False, False, False]
    assert left_out(refined) == {1: None}
    assert tuple(m.code for m in messages) == cause
    assert refined.adjustment.minimum.converged
    fewer = np.arange(6) != 1
    columns = ("line_start", "line_end", "length_m", "length_sigma_m")
    without = replace(survey, **{name: getattr(survey, name)[fewer] for name in columns})
    other, _ = refine(without, REPORT)
    np.testing.assert_array_equal(other.adjustment.state.point, refined.adjustment.state.point)


def test_a_length_in_another_unit_is_put_right_on_request(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = logged(scene_factory(2, frames=6, ends=PAIRS))
    refined, messages = refine(times(survey, {1: 1000.0}), REMOVE)
    assert not refined.line_removed.any()
    (removal,) = refined.removals
    assert removal.kind == "mend"
    assert removal.before is not None
    assert removal.before.line_removed.tolist() == [False, True, False, False, False, False]
    (message,) = messages
    assert message.code == "line-wrong-unit"
    before, right = 1000.0 * survey.length_m[1], survey.length_m[1]
    done = f"length 'P1' to 'P7' {before:.3f} m; now length 'P1' to 'P7' {right:.3f} m."
    assert f"The program corrected it, check this: {done}" in message.text
    given, _ = refine(survey, REMOVE)
    np.testing.assert_allclose(
        refined.adjustment.state.point, given.adjustment.state.point, atol=1e-6
    )


def test_two_of_six_in_another_unit_do_not_hide_each_other(
    scene_factory: Callable[..., Scene],
) -> None:
    for options in ({}, NO_LOG):
        scene = scene_factory(2, frames=4, ends=PAIRS, **options)
        survey = logged(scene) if scene.survey.seeds is not None else scene.survey
        refined, _ = refine(times(survey, {0: 100.0, 4: 1000.0}), REPORT)
        assert left_out(refined) == {0: None, 4: None}


def test_two_of_five_in_feet_are_left_out_and_not_the_innocent_third(
    scene_factory: Callable[..., Scene],
) -> None:
    # Without the third, the others agree in a pose that the camera and the picks contradict.
    scene = scene_factory(2, frames=3, ends=PAIRS[:5], **NO_LOG)
    refined, messages = refine(times(scene.survey, {0: 1 / 0.3048, 4: 1 / 0.3048}), REPORT)
    assert left_out(refined) == {0: None, 4: None}
    assert refined.pick_reason == {}
    assert {"line-wrong-unit", "three-lengths"} <= {m.code for m in messages}
    right, _ = refine(scene.survey, REPORT)
    found, given = (one.adjustment.points()[0] for one in (refined, right))
    ours, true = (np.linalg.norm(one[:, None] - one[None], axis=2) for one in (found, given))
    np.testing.assert_allclose(ours, true, rtol=0.02, atol=0.05)


def misled(scene: Scene, shift: list[float]) -> Survey:
    """A survey whose log is right, but whose seeds stand elsewhere and are sure of it."""
    survey = logged(scene, np.full(6, 0.01))
    assert survey.seeds is not None
    seeds = replace(survey.seeds, center_world_m=survey.seeds.center_world_m + shift)
    return replace(survey, seeds=seeds)


def test_a_length_that_only_seems_wrong_to_the_seeds_comes_back(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = misled(scene_factory(2, frames=6, ends=PAIRS[:1]), [0.0, 0.0, 50.0])
    refined, _ = refine(survey, REPORT)
    assert not refined.line_removed.any()
    assert left_out(refined) == {}


def test_a_control_point_that_only_seems_wrong_to_the_seeds_comes_back(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = misled(scene_factory(3, frames=4, control=2), [30.0, 0.0, 0.0])
    refined, messages = refine(survey, REPORT)
    assert "control-left-out" not in {m.code for m in messages}
    assert len(refined.adjustment.survey.control_label) == 2


def test_a_length_a_fifth_off_is_left_out_alone(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = logged(scene_factory(2, frames=6, ends=PAIRS))
    refined, _ = refine(times(survey, {1: 1.2}), REPORT)
    assert left_out(refined) == {1: None}
    assert refined.pick_reason == {}


def test_a_length_that_its_sigma_allows_for_stays(scene_factory: Callable[..., Scene]) -> None:
    survey = logged(scene_factory(2, frames=6, ends=PAIRS))
    sigma = np.array(survey.length_sigma_m)
    sigma[1] = 0.1 * survey.length_m[1]
    refined, _ = refine(replace(times(survey, {1: 1.2}), length_sigma_m=sigma), REPORT)
    assert not refined.line_removed.any()


def test_a_step_to_a_lens_without_focal_length_is_refused(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    assert problem.evaluate(scene.truth) is not None
    basis = problem.intrinsic_basis
    wanted = np.zeros(len(basis))
    wanted[1] = -1.001 * scene.survey.calibration.parameters[1]
    state = replace(scene.truth, intrinsic=np.linalg.pinv(basis) @ wanted)
    assert problem.intrinsics(state)[1] < 0
    assert problem.evaluate(state) is None


def test_no_step_leads_to_an_unknown_lens_without_focal_length(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(2)
    camera = replace(scene.survey.calibration, is_unknown=True)
    survey = replace(scene.survey, calibration=camera)
    problem = SurveyProblem(survey, scene.pivot, np.ones(6, dtype=bool))
    basis, stated = problem.intrinsic_basis, camera.parameters
    for factor in (-50.0, -1.001, 0.2):
        wanted = np.zeros(len(basis))
        wanted[1] = factor * stated[1]
        state = replace(scene.truth, intrinsic=np.linalg.pinv(basis) @ wanted)
        assert problem.intrinsics(state)[1] == pytest.approx(stated[1] * np.exp(factor))


def test_lengths_that_nothing_can_part_are_told_with_their_ratios(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(4, frames=1, ends=PAIRS[:3], **NO_LOG)
    survey = times(scene.survey, {1: 1000.0})
    try:
        _, messages = refine(survey, REPORT)
        said = " ".join(m.text for m in messages)
    except GeometryError as error:
        said = str(error)
    assert "contradict each other" in said
    assert "'P1' to 'P7' " in said


@pytest.mark.parametrize(
    ("factor", "code"),
    [
        (1.0, ""),
        (0.07, "unusual-height"),  # a photo from the hand
        (7.0, "unusual-height"),
        (0.001, "odd-height"),  # kilometres
        (1000.0, "odd-height"),  # millimetres
    ],
)
def test_cameras_at_an_unusual_height_are_a_remark_and_at_an_absurd_one_a_warning(
    scene_factory: Callable[..., Scene], factor: float, code: str
) -> None:
    survey = scene_factory(2, frames=3, ends=PAIRS, **NO_LOG).survey
    survey = replace(
        survey,
        length_m=survey.length_m * factor,
        length_sigma_m=survey.length_sigma_m * factor,
        line_name=tuple(f"L{k}" for k in range(len(survey.length_m))),
    )
    _, messages = refine(survey, REPORT)
    levels = {m.code: m.level for m in messages}

    assert "lengths-wrong-unit" not in levels
    assert {one for one in levels if one.endswith("-height")} == {code} - {""}
    assert levels.get("unusual-height", "info") == "info"
    unit = {0.001: "kilometres", 1000.0: "millimetres"}.get(factor)
    if unit is not None:
        assert levels["odd-height"] == "warning"
        (odd,) = (m for m in messages if m.code == "odd-height")
        assert f"as with lengths in {unit}: in metres that would be " in odd.text
        offered = [one.words for one in (odd.mend, *odd.instead) if one is not None]
        assert any(f"as {unit}" in words for words in offered) == (unit != "kilometres")


def test_a_run_that_does_not_come_to_rest_names_no_reading(
    scene_factory: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = iterate

    def unfinished(
        problem: SurveyProblem, state: State, most: int, slack: float = 0.0, goal: float = np.inf
    ) -> Minimum[State]:
        return replace(found(problem, state, most, slack, goal=goal), converged=False)

    monkeypatch.setattr(minima, "iterate", unfinished)
    monkeypatch.setattr(readjustment, "iterate", unfinished)
    survey = logged(scene_factory(2, frames=2, ends=PAIRS))
    pixel = np.array(survey.pixel_px)
    pixel[7, 0] += 5.0  # more, and it leaves as a gross error
    _, messages = refine(replace(survey, pixel_px=pixel), REPORT)
    (told,) = [m for m in messages if m.code == "not-converged"]
    assert not any((told.frames, told.labels, told.lengths))
    assert not any(repr(label) in told.text for label in survey.label)


@pytest.mark.parametrize("off", [[40.0, 0.0, 0.0], [0.0, -9e6, 0.0]])
def test_a_control_point_of_another_place_is_left_out_by_name(
    scene_factory: Callable[..., Scene], off: list[float]
) -> None:
    scene = scene_factory(3, frames=4, control=4)
    survey = logged(scene)
    world = np.array(survey.control_world_m)
    world[2] += off
    refined, messages = refine(replace(survey, control_world_m=world), REPORT)
    assert [m.code for m in messages] == ["control-left-out"]
    assert "'P2'" in messages[0].text
    assert ("mostly to the east" if off[0] else "mostly to the south") in messages[0].text
    assert ("swapped" in messages[0].text) == (off[1] != 0)
    assert refined.adjustment.minimum.converged
    assert refined.adjustment.survey.control_label.tolist() == [0, 1, 3]


def test_control_points_that_all_lie_elsewhere_together_bend_nothing(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = logged(scene_factory(3, frames=4, control=4))
    world = survey.control_world_m + np.array([60.0, 0.0, 0.0])
    refined, messages = refine(replace(survey, control_world_m=world), REPORT)
    assert len(refined.adjustment.survey.control_label) == 0
    assert [m.code for m in messages] == ["control-shifted", *["control-left-out"] * 4]
    assert not refined.line_removed.any()
    assert refined.pick_reason == {}
    assert refined.off_ground == frozenset()
    none = np.zeros(0, dtype=np.int64)
    without = replace(
        survey,
        control_label=none,
        control_world_m=world[none],
        control_sigma_m=survey.control_sigma_m[none],
    )
    expected, _ = refine(without, REPORT)
    np.testing.assert_allclose(
        refined.adjustment.state.point, expected.adjustment.state.point, atol=1e-6
    )


CROSSED = ((0, 5), (1, 6), (2, 7), (3, 8), (4, 9), (0, 6), (1, 7), (2, 8), (3, 5))


@pytest.mark.parametrize("wrong", ["length", "click"])
def test_a_click_that_nothing_but_a_wrong_length_checks_may_be_wrong_instead(
    scene_factory: Callable[..., Scene], wrong: str
) -> None:
    # Of all lengths, one alone ends at P4 and P9.
    given = scene_factory(7, labels=10, frames=1, ends=CROSSED).survey
    length, pixel = np.array(given.length_m), np.array(given.pixel_px)
    if wrong == "length":
        length[4] += 0.6
    else:
        pixel[given.pick_label == given.label.index("P4")] += 25.0
    refined, _ = refine(replace(given, length_m=length, pixel_px=pixel), REPORT)

    assert np.flatnonzero(refined.line_removed).tolist() == [4]
    clicks = {one.name: rival.explanation for rival in refined.rivals for one in rival.readings}
    assert clicks.keys() == {"P4", "P9"}
    assert clicks["P4"] is not None
    assert "P4" not in clicks["P4"].adjustment.survey.label


def test_a_length_in_another_unit_has_no_click_that_may_be_wrong_instead(
    scene_factory: Callable[..., Scene],
) -> None:
    given = scene_factory(7, labels=10, frames=1, ends=CROSSED).survey
    refined, _ = refine(times(given, {4: 1 / 0.3048}), REPORT)

    assert np.flatnonzero(refined.line_removed).tolist() == [4]
    assert not refined.rivals


def test_a_click_that_other_photos_check_is_no_rival(scene_factory: Callable[..., Scene]) -> None:
    given = scene_factory(2, frames=6, ends=PAIRS).survey
    refined, _ = refine(times(given, {1: 1.2}), REPORT)

    assert np.flatnonzero(refined.line_removed).tolist() == [1]
    assert not refined.rivals


def test_a_wrong_pose_of_the_log_takes_no_part(scene_factory: Callable[..., Scene]) -> None:
    """In one photo of four, as with a jump of the receiver: the rest is as if it were unknown."""
    given = scene_factory(6, frames=4, labels=12, lines=6).survey
    track = given.track
    assert isinstance(track, Track)
    position = np.array(track.position_world_m)
    position[8:12] += (0.0, 0.0, 30.0)  # four samples for each photo
    jumped = replace(given, track=replace(track, position_world_m=position))
    refined, messages = refine(jumped, REPORT)

    (found,) = (message for message in messages if message.code == "telemetry-strained")
    assert found.frames == ("f2",)
    assert [one.words for one in found.instead] == ["Leave f2 out"]
    assert "30" in found.text.split(" m away")[0]
    assert not refined.line_removed.any()
    expected, _ = refine(given, REPORT)
    assert misfit(refined, expected) < 0.3
    assert not any("lengths" in message.code for message in messages)


def misfit(refined: Refined, expected: Refined) -> float:
    """Largest difference of the points' places from one another, in sigmas."""
    one, other = (np.array(each.adjustment.state.point[:, :2]) for each in (refined, expected))
    apart = (one - one.mean(axis=0)) - (other - other.mean(axis=0))
    _, covariance = expected.adjustment.points()
    sigma = np.sqrt(np.einsum("kii->ki", covariance)[:, :2])
    return float(np.abs(apart / sigma).max())
