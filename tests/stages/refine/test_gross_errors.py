"""The robust adjustment: gross errors leave, all else is as an ordinary adjustment has it.

How many surveys each kind of gross error gets fits the time that every run of the tests may take;
the environment raises it:

    UAVGRAM_REPETITIONS=20 pytest tests/stages/refine/test_gross_errors.py
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gross_errors import (
    FAULTS,
    LOG,
    NO_LOG,
    WITH_LOG_ONLY,
    largest_error,
    left_out,
    survey_with,
)
from scenes import Scene, make_scene
from whole_surveys import all_of, with_all

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import FirstValues
from uavgram.estimation.reliability.redundancy import GROSS_SIGMAS
from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.survey import Survey
from uavgram.stages.refine import (
    cleaned_adjustment,
    exchanged_readings,
    first_values,
    gross_errors,
    minima,
    reduced_starts,
    robust_adjustment,
    robust_candidate,
)
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.minima import FULL, Participants, Patience, find_best_minima
from uavgram.stages.refine.rival_errors import MAX_RIVAL_INCREASE
from uavgram.stages.refine.robust_adjustment import ZERO_WEIGHT

AT_LEAST = int(os.environ.get("UAVGRAM_REPETITIONS", "0"))
SURVEYS, OF_PHOTOS = max(4, AT_LEAST), max(1, AT_LEAST)
MISSED = 0.05
FARTHEST = 5.0
"""Sigmas that a distance may be wrong after a gross error."""

BASES: Mapping[str, Mapping[str, Any]] = {"log": LOG, "no log": NO_LOG}
BOTH = pytest.mark.parametrize("base", BASES)


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_a_clean_survey_is_adjusted_as_ever_to_the_last_bit(base: str, seed: int) -> None:
    scene, wrong = survey_with("nothing", BASES[base], seed)
    taking = all_of(wrong.survey)
    ordinary, robust = find_best_minima(taking), adjust_robustly(taking)

    assert not any(left_out(robust))
    assert robust.survey is wrong.survey
    for name in ("point", "center", "rotation", "intrinsic", "plane"):
        one, other = (getattr(r.adjustment.state, name) for r in (ordinary, robust.refined))
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(
        ordinary.adjustment.points()[1], robust.refined.adjustment.points()[1]
    )
    assert largest_error(robust.refined.adjustment, scene) < FARTHEST


def test_a_misplaced_photo_without_picks_is_not_left_out_again_and_again() -> None:
    """Its matches make it take part: the adjustment without its picks is the same as before."""
    taking = all_of(survey_with("nothing", LOG, 0)[1].survey)
    name = taking.survey.frame_id[0]
    found: Any = [SimpleNamespace(misplaced=(name,))]

    rest = taking.leave_out_frames([name], robust_candidate.MISPLACED)
    assert not list(reduced_starts.try_without_suspects(rest, found))


# --- the standardised misfit --------------------------------------------------------------------


def dense(block: Block, unknowns: int) -> Floats:
    """The Jacobian (n, r, unknowns) of a block."""
    found = np.zeros((*block.residual.shape, unknowns))
    for row, (columns, jacobian) in enumerate(zip(block.columns, block.jacobian, strict=True)):
        for column, values in zip(columns, jacobian.T, strict=True):
            if column >= 0:
                found[row, :, column] += values
    return found


def information(blocks: Mapping[str, Block], unknowns: int) -> Floats:
    """Normal matrix (unknowns, unknowns) of all observations."""
    total = np.zeros((unknowns, unknowns))
    for block in blocks.values():
        rows = dense(block, unknowns).reshape(-1, unknowns)
        total += rows.T @ rows
    return total


@pytest.mark.parametrize("weight", [1.0, 0.3, ZERO_WEIGHT])
@pytest.mark.parametrize("kind", ["pixels", "lengths", "telemetry"])
def test_the_misfit_is_that_against_the_prediction_of_all_others(kind: str, weight: float) -> None:
    """Of any weight: the error of what the others predict, over its own covariance."""
    problem = with_all(make_scene(5, **LOG).survey).adjustment.problem
    start = with_all(make_scene(5, **LOG).survey).adjustment.state
    whole = problem.evaluate(start)
    assert whole is not None
    for row in (0, 2):
        own = np.ones(len(whole[kind].residual))
        own[row] = weight
        minimum = robust_adjustment.minimise_weighted_cost(problem, start, {kind: own})
        found = robust_adjustment.compute_squared_misfits(problem, minimum, {kind: own})[kind][row]

        unknowns = problem.layout.size
        full = problem.evaluate(minimum.state)
        assert full is not None
        jacobian, residual = dense(full[kind], unknowns)[row], full[kind].residual[row]
        others = information(full, unknowns) - jacobian.T @ jacobian
        weighted = others + weight * jacobian.T @ jacobian
        # A step from the weighted minimum to that without the observation changes its residual.
        step = np.linalg.solve(others, weight * jacobian.T @ residual)
        predicted = residual + jacobian @ step
        covariance = np.eye(len(residual)) + jacobian @ np.linalg.solve(others, jacobian.T)
        expected = float(predicted @ np.linalg.solve(covariance, predicted))
        assert found == pytest.approx(expected, rel=1e-3, abs=1e-6)
        if weight == 1.0:  # Baarda's statistic
            cofactor = np.eye(len(residual)) - jacobian @ np.linalg.solve(weighted, jacobian.T)
            baarda = float(residual @ np.linalg.solve(cofactor, residual))
            assert found == pytest.approx(baarda, rel=1e-3, abs=1e-6)


def test_noise_of_a_kind_does_not_excuse_what_the_others_predict_coarsely() -> None:
    """Two of four lengths contradict the log, which predicts each less exactly than it reads."""
    survey = make_scene(5, **{**LOG, "lines": 4}).survey
    wrong = replace(survey, length_m=survey.length_m * [1.0, 2.0, 1.0, 2.0])
    problem, start = (getattr(with_all(survey).adjustment, name) for name in ("problem", "state"))
    problem = SurveyProblem(wrong, problem.pivot_m, np.ones(4, dtype=np.bool_))
    weight = {"lengths": np.full(4, ZERO_WEIGHT)}
    minimum = robust_adjustment.minimise_weighted_cost(problem, start, weight)
    misfits, _ = robust_adjustment._compute_misfits(problem, minimum, weight)
    assert (misfits["lengths"] > GROSS_SIGMAS).tolist() == [False, True, False, True]


# --- one gross error ----------------------------------------------------------------------------


def outcomes(fault: str, base: str) -> list[tuple[int, bool, float]]:
    """Seed, whether just that is left out that is wrong, and the largest error in sigmas."""
    found = []
    for seed in range(OF_PHOTOS if fault.startswith("photo") else SURVEYS):
        scene, wrong = survey_with(fault, BASES[base], seed)
        try:
            robust = adjust_robustly(all_of(wrong.survey))
        except GeometryError:
            found.append((seed, False, np.inf))
            continue
        alone = left_out(robust) == wrong.what
        found.append((seed, alone, largest_error(robust.refined.adjustment, scene)))
    return found


CASES = [
    (fault, base)
    for base in BASES
    for fault in FAULTS
    if fault != "nothing" and (base == "log" or fault not in WITH_LOG_ONLY)
]


@pytest.mark.parametrize(("fault", "base"), CASES)
def test_a_gross_error_is_left_out_alone_and_bends_nothing(fault: str, base: str) -> None:
    found = outcomes(fault, base)
    most = MISSED * len(found)

    bent = [(seed, error) for seed, _, error in found if error > FARTHEST]
    assert len(bent) <= most, f"values are wrong by so many sigmas: {bent}"
    not_alone = [seed for seed, alone, _ in found if not alone]
    assert len(not_alone) <= most, f"wrong ones stay, or right ones leave: seeds {not_alone}"


# --- its work -----------------------------------------------------------------------------------


class Counted:
    """Calls of the two functions that adjust."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ordinary, self.weighted = 0, 0
        adjust, weigh = find_best_minima, robust_adjustment.minimise_weighted_cost

        def best(taking: Participants, most: Patience = FULL) -> Refined:
            self.ordinary += 1
            return adjust(taking, most)

        def weighted(
            problem: SurveyProblem,
            state: State,
            weight: Mapping[str, Floats],
            softness: Mapping[str, float] | None = None,
            goal: float = np.inf,
        ) -> Minimum[State]:
            self.weighted += 1
            return weigh(problem, state, weight, softness, goal)

        for module in (gross_errors, robust_candidate, cleaned_adjustment):
            monkeypatch.setattr(module, "find_best_minima", best)
        for module in (robust_adjustment, robust_candidate, cleaned_adjustment, reduced_starts):
            monkeypatch.setattr(module, "minimise_weighted_cost", weighted)


@BOTH
def test_a_wrong_stated_height_is_left_out_and_reported(base: str) -> None:
    scene, clean = survey_with("nothing", BASES[base], 0)
    survey = clean.survey
    photos = np.bincount(survey.pick_label, minlength=len(survey.label))
    photos[np.append(survey.line_start, survey.line_end)] = 0
    row = int(np.argmax(photos))
    height, sigma = survey.height_above_m.copy(), survey.height_sigma_m.copy()
    height[row], sigma[row] = 0.8, 0.02
    stated = replace(survey, height_above_m=height, height_sigma_m=sigma)
    found = adjust_robustly(all_of(stated))

    assert found.heights == (survey.label[row],)
    assert not any(left_out(found))
    assert largest_error(found.refined.adjustment, scene) < FARTHEST
    (message,) = found.messages(stated)
    assert message.code == "height-left-out"
    assert "is stated at 0.80 m above the ground, and the photos show it at " in message.text


@BOTH
def test_a_clean_survey_costs_one_adjustment(monkeypatch: pytest.MonkeyPatch, base: str) -> None:
    taking = all_of(survey_with("nothing", BASES[base], 1)[1].survey)
    counted = Counted(monkeypatch)
    adjust_robustly(taking)
    assert (counted.ordinary, counted.weighted) == (1, 0)


@BOTH
@pytest.mark.parametrize("fault", ["pick", "length by 2 m", "known thing"])
def test_one_gross_error_costs_four_adjustments_and_those_of_two_starts(
    monkeypatch: pytest.MonkeyPatch, fault: str, base: str
) -> None:
    """As found, with hundredfold sigmas, with free heights, and without the error."""
    taking = all_of(survey_with(fault, BASES[base], 0)[1].survey)
    counted = Counted(monkeypatch)
    adjust_robustly(taking)
    assert counted.ordinary <= 4
    assert (
        counted.weighted <= len(robust_adjustment.SCHEDULE) + 1 + 2 * robust_adjustment.MOST_ROUNDS
    )


def test_one_photo_has_no_start_from_the_heights_that_photos_show(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taking = all_of(survey_with("length by 2 m", {**LOG, "frames": 1}, 0)[1].survey)
    begun: list[bool] = []
    anneal = robust_adjustment.anneal

    def record(*of: Any, on_ground: bool = True, limit: float = np.inf) -> Any:  # noqa: ANN401
        begun.append(on_ground)
        return anneal(*of, on_ground=on_ground, limit=limit)

    monkeypatch.setattr(robust_candidate, "anneal", record)
    list(robust_candidate.adjust_from_softened(taking))
    assert begun
    assert all(begun)


def test_an_explanation_that_remains_far_costlier_than_another_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(robust_adjustment, "SURE_ROUNDS", 1)
    taking = all_of(survey_with("pick", LOG, 0)[1].survey)
    candidate = next(robust_candidate.adjust_from_softened(taking))
    found, decide = candidate.annealed, robust_adjustment.decide
    begun = robust_adjustment.minimise_weighted_cost(found.problem, found.minimum.state, {})
    bound = robust_candidate.bound_cost(taking, [candidate])
    assert bound == candidate.cost(taking)
    assert decide(found.problem, begun, {}, bound).cost == decide(found.problem, begun, {}).cost
    with pytest.raises(ValueError, match="another explanation costs less"):
        decide(found.problem, begun, {}, bound - robust_adjustment.HOPELESS_COST - 1.0)


def test_explanations_without_a_photo_do_not_bound_the_cost_of_others() -> None:
    taking: Any = None
    without: Any = SimpleNamespace(
        misplaced=("photo 1",), gives_up_log=lambda: False, cost=lambda _: 7.0
    )
    whole: Any = SimpleNamespace(**{**vars(without), "misplaced": ()})
    logless: Any = SimpleNamespace(**{**vars(whole), "gives_up_log": lambda: True})
    bounds = [robust_candidate.bound_cost(taking, [one]) for one in (without, whole, logless)]
    assert bounds == [np.inf, 7.0, np.inf]


def test_parts_are_skipped_that_explain_less_than_an_earlier_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[object, ...]] = []
    given: list[object] = []

    def choose(_: object, found: list[object]) -> int:
        asked.append(tuple(found))
        return len(found)

    def adjust(part: str, _: object, __: object, patience: int) -> Iterator[str]:
        given.append(patience)
        yield part

    monkeypatch.setattr(reduced_starts, "_choose_patience", choose)
    monkeypatch.setattr(reduced_starts, "adjust_from_reduced", adjust)
    monkeypatch.setattr(reduced_starts, "sort_by_cost", lambda _, found: sorted(found))
    whole: Any = None
    parts: Any = ["c", "a"]
    known: Any = ["b"]
    found: list[Any] = [*reduced_starts._adjust_from_parts(parts, whole, whole, known)]
    assert found == ["c", "a"]
    assert asked == [("b",), ("b", "c")]
    assert given == [1, 2]


@pytest.mark.parametrize("kind", ["control", "lengths"])
def test_other_exchanges_have_to_be_as_good_as_one_that_explains_all(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    survey = survey_with("length by 2 m", {**NO_LOG, "lines": 4}, 0)[1].survey
    goals: list[float] = []

    class Explains(SimpleNamespace):
        def leaves_out_nothing(self) -> bool:
            return True

        def cost(self, _: Participants) -> float:
            return 7.0

    def adjust(*of: Any, again: bool = False) -> Iterator[object]:  # noqa: ANN401
        assert again
        goals.append(of[3].goal)
        yield Explains()

    pairs = [[0, 1], [0, 2], [1, 2]]
    listed = {"control": "_list_control_to_exchange", "lengths": "_list_lengths_to_exchange"}
    for one, name in listed.items():
        monkeypatch.setattr(exchanged_readings, name, lambda *_, one=one: pairs * (one == kind))
    control = np.zeros((3, 3))
    survey = replace(
        survey, control_label=np.arange(3), control_world_m=control, control_sigma_m=control + 1.0
    )
    monkeypatch.setattr(exchanged_readings, "adjust_from_reduced", adjust)
    monkeypatch.setattr(exchanged_readings, "adjust_without_candidate", lambda _: True)
    monkeypatch.setattr(exchanged_readings, "replace", lambda one, **_: one)
    taking: Any = SimpleNamespace(survey=survey, leave_out_lines=lambda _: None)
    monkeypatch.setattr(exchanged_readings, "add_small_roughness", lambda one: one)
    list(exchanged_readings.try_exchanged_readings(set(), taking, []))
    assert goals == [np.inf, *[7.0 + MAX_RIVAL_INCREASE] * 2]


def test_no_two_readings_are_exchanged_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    _, wrong = survey_with("length by 2 m", {**NO_LOG, "lines": 4}, 0)
    tried: list[bytes] = []

    def adjust(reduced: Participants, *_: object, again: bool = False) -> Iterator[object]:
        if again:
            tried.append(reduced.survey.length_m.tobytes())
        return iter(())

    monkeypatch.setattr(gross_errors, "adjust_from_softened", lambda _: iter(()))
    for module in (reduced_starts, exchanged_readings):
        monkeypatch.setattr(module, "adjust_from_reduced", adjust)
    adjust_robustly(all_of(wrong.survey))
    assert len(tried) == len(set(tried)) > 0


@pytest.mark.parametrize("seed", range(3))
def test_first_values_are_adjusted_once_also_where_frames_in_doubt_begin_again(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    survey, _ = swapped_in_one_photo(make_scene(seed, **NO_LOG))
    tried: list[tuple[bytes, ...]] = []
    begun: list[int] = []
    minimise, other = minima._minimise, first_values.find_other_first_values

    def record(survey: Survey, values: FirstValues, *rest: Any) -> Any:  # noqa: ANN401
        tried.append((survey.pixel_px.tobytes(), *(np.asarray(one).tobytes() for one in values)))
        return minimise(survey, values, *rest)

    def begin(*of: Any) -> list[FirstValues]:  # noqa: ANN401
        found = other(*of)
        begun.append(len(found))
        return found

    monkeypatch.setattr(minima, "_minimise", record)
    monkeypatch.setattr(minima, "find_other_first_values", begin)
    find_best_minima(all_of(survey))
    assert begun
    assert len(tried) == len(set(tried))


def test_further_first_values_are_given_up_where_they_lead_to_no_better_minimum(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    survey, _ = swapped_in_one_photo(make_scene(0, **NO_LOG))
    found: list[tuple[float, float]] = []
    minimise = minima._minimise

    def record(*of: Any) -> Any:  # noqa: ANN401
        result = minimise(*of)
        found.append((of[4], result[1].cost))
        return result

    monkeypatch.setattr(minima, "_minimise", record)
    find_best_minima(all_of(survey))
    goal, cost = np.array(found).T
    least = np.minimum.accumulate(cost)[:-1]
    assert len(least)
    assert (goal[1:] <= least + minima.MAX_RIVAL_COST).all()


# --- more than first values can bear ------------------------------------------------------------


@pytest.mark.parametrize("factor", [1000.0, 0.1])
def test_first_values_that_hang_on_the_wrong_length_are_not_the_only_ones(
    scene_factory: Callable[..., Scene], factor: float
) -> None:
    pairs = tuple((k, k + 6) for k in range(6))
    scene = scene_factory(2, frames=4, ends=pairs, telemetry=False, gauge="plane")
    length = np.array(scene.survey.length_m)
    length[4] *= factor
    robust = adjust_robustly(all_of(replace(scene.survey, length_m=length)))

    assert np.flatnonzero(robust.refined.line_removed).tolist() == [4]
    assert robust.refined.pick_reason == {}
    assert largest_error(robust.refined.adjustment, scene) < FARTHEST


def swapped_in_one_photo(scene: Scene) -> tuple[Survey, frozenset[int]]:
    """Two labels far apart exchanged in the second photo; and which picks are theirs."""
    survey = scene.survey
    own = np.flatnonzero(survey.pick_frame == 1)
    pixel = np.array(survey.pixel_px)
    two = own[[np.argmin(pixel[own, 0]), np.argmax(pixel[own, 0])]]
    pixel[two] = pixel[two[::-1]]
    return replace(survey, pixel_px=pixel), frozenset(two.tolist())


@BOTH
def test_labels_swapped_in_a_photo_that_misleads_all_first_values_leave_alone(
    monkeypatch: pytest.MonkeyPatch, base: str
) -> None:
    """The photo returns by those of its picks that agree on a pose."""
    scene = make_scene(3, **BASES[base])
    survey, wrong = swapped_in_one_photo(scene)
    monkeypatch.setattr(gross_errors, "adjust_from_softened", lambda _: iter(()))
    monkeypatch.setattr(gross_errors, "try_without_references", lambda *_: iter(()))
    found = adjust_robustly(all_of(survey))

    assert frozenset(found.refined.pick_reason) == wrong
    assert not found.refined.line_removed.any()
    assert not found.labels
    assert largest_error(found.refined.adjustment, scene) < FARTHEST


def mirrored(survey: Survey, frame: int) -> tuple[Survey, frozenset[int]]:
    """Exchange left and right in a photo, and return its picks."""
    own = np.flatnonzero(survey.pick_frame == frame)
    pixel = np.array(survey.pixel_px)
    pixel[own, 0] = survey.calibration.width_px - 1.0 - pixel[own, 0]
    return replace(survey, pixel_px=pixel), frozenset(own.tolist())


@pytest.mark.parametrize("frames", [3, 5])
@BOTH
def test_a_mirrored_photo_is_left_out_and_bends_nothing(base: str, frames: int) -> None:
    scene = make_scene(4, **{**BASES[base], "frames": frames})
    survey, wrong = mirrored(scene.survey, 1)
    found = adjust_robustly(all_of(survey))

    assert frozenset(found.refined.pick_reason) == wrong
    assert not found.refined.line_removed.any()
    assert largest_error(found.refined.adjustment, scene) < FARTHEST


@pytest.mark.parametrize("seed", range(4))
def test_a_log_whose_poses_are_all_of_other_photos_bends_nothing(seed: int) -> None:
    """Each photo has the row of its neighbour, tens of sigmas away."""
    scene = make_scene(seed, frames=5, lines=8, along=40.0)
    survey = scene.survey
    assert survey.seeds is not None
    assert survey.telemetry is not None
    row = np.roll(np.arange(5), 1)
    seeds = replace(
        survey.seeds,
        center_world_m=survey.seeds.center_world_m[row],
        world_from_camera=survey.seeds.world_from_camera[row],
    )
    prior = replace(survey.telemetry, time_s=survey.telemetry.time_s[row])
    found = adjust_robustly(all_of(replace(survey, seeds=seeds, telemetry=prior))).refined

    assert found.pose_widened.keys() == set(survey.frame_id)
    assert not found.pick_reason
    assert not found.line_removed.any()
    assert largest_error(found.adjustment, scene) < FARTHEST


@BOTH
@pytest.mark.parametrize("seed", [1, 2, 4])
def test_of_two_photos_that_fit_alone_neither_is_accused(base: str, seed: int) -> None:
    """Whichever of them happens to fit its lengths better."""
    survey, _ = mirrored(make_scene(seed, **{**BASES[base], "frames": 2}).survey, 1)
    found = adjust_robustly(all_of(survey))

    left = list(found.refined.pick_reason)
    assert len(np.unique(survey.pick_frame[left])) == 1
    assert set(found.refined.pick_reason.values()) == {reduced_starts.EITHER}
    assert not found.refined.line_removed.any()


def test_a_scene_without_a_scale_explains_nothing() -> None:
    """Without lengths a scene of no size would fit every height of its points."""
    scene = make_scene(3, **NO_LOG)
    exchanged = {0: 1, 1: 0}
    label = [exchanged.get(k, k) for k in scene.survey.pick_label.tolist()]
    found = adjust_robustly(all_of(replace(scene.survey, pick_label=np.array(label))))

    assert not found.refined.line_removed.all()
    assert found.refined.adjustment.state.center[:, 2].min() > 1.0


def test_where_no_explanation_keeps_a_scale_the_ordinary_adjustment_remains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As where the readings of two lengths were exchanged, and all others seem wrong with them."""
    monkeypatch.setattr(robust_candidate.Candidate, "has_scale", lambda _: False)
    taking = all_of(survey_with("length by 2 m", NO_LOG, 1)[1].survey)
    found = adjust_robustly(taking)

    assert not any(left_out(found))


def test_what_takes_no_part_is_no_cheaper_because_it_agrees(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Neighbours of a gross error that are not given time to come back have their price."""
    adjusted = with_all(survey_with("length by 2 m", LOG, 1)[1].survey).adjustment
    monkeypatch.setattr(robust_adjustment, "MOST_ROUNDS", 1)
    found = robust_adjustment.decide(adjusted.problem, adjusted.minimum, {})
    left = sum(len(found.gross(name)) for name in found.misfit)

    assert left > 1
    assert found.cost > GROSS_SIGMAS**2 * left


# --- clicks that contradict each other ------------------------------------------------------------


def clicked_twice(scene: Scene, off_px: float, label: int) -> Survey:
    """A survey of two clicks on each point, the second one on a point off."""
    survey, rng = scene.survey, np.random.default_rng(5)
    again = survey.pixel_px + rng.normal(size=survey.pixel_px.shape)
    again[survey.pick_label == label] += off_px * np.array([0.8, -0.6])
    return replace(
        survey,
        pick_frame=np.tile(survey.pick_frame, 2),
        pick_label=np.tile(survey.pick_label, 2),
        pixel_px=np.concatenate([survey.pixel_px, again]),
        pick_sigma_px=np.tile(survey.pick_sigma_px, 2),
        target_pick=np.tile(survey.target_pick, 2),
    )


TAPED = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3), (0, 4))


@pytest.mark.parametrize("off_px", [40.0, 400.0])
@pytest.mark.parametrize("seed", range(3))
def test_of_two_clicks_that_nothing_else_checks_neither_is_taken_for_right(
    seed: int, off_px: float
) -> None:
    scene = make_scene(seed, **{**NO_LOG, "frames": 1, "labels": 8, "ends": TAPED, "tilt": 0.7})
    own = 7  # no length ends there
    survey = clicked_twice(scene, off_px, own)
    found = adjust_robustly(all_of(survey))

    assert found.contradicting == (survey.label[own],)
    assert found.refined.pick_reason == {}
    assert not found.refined.line_removed.any()
    assert largest_error(found.refined.adjustment, scene) < FARTHEST


def test_of_two_clicks_the_one_that_lengths_contradict_leaves() -> None:
    scene = make_scene(1, **{**NO_LOG, "frames": 1, "labels": 8, "ends": TAPED, "tilt": 0.7})
    survey = clicked_twice(scene, 60.0, 0)
    found = adjust_robustly(all_of(survey))

    wrong = np.flatnonzero(survey.pick_label == 0)[-1]
    assert found.contradicting == ()
    assert list(found.refined.pick_reason) == [wrong]
    assert not found.refined.line_removed.any()
    assert largest_error(found.refined.adjustment, scene) < FARTHEST


@pytest.mark.parametrize("is_end", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_two_clicks_on_a_wrong_thing_do_not_outvote_another_photo(
    seed: int, *, is_end: bool
) -> None:
    """One photo of two has two clicks of a point; a length may end there and decide."""
    scene = make_scene(seed, **{**NO_LOG, "frames": 2, "labels": 12, "ends": TAPED, "tilt": 0.5})
    label = 0 if is_end else 11
    survey, (wrong, right) = scene.survey, np.flatnonzero(scene.survey.pick_label == label)
    pixel = np.array(survey.pixel_px)
    pixel[wrong] += [300.0, -200.0]
    survey = replace(
        survey,
        pick_frame=np.append(survey.pick_frame, survey.pick_frame[wrong]),
        pick_label=np.append(survey.pick_label, label),
        pixel_px=np.vstack([pixel, pixel[wrong] + [1.0, -1.0]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, survey.pick_sigma_px[wrong]),
    )
    found = adjust_robustly(all_of(survey))

    assert not found.refined.line_removed.any()
    if is_end:
        assert found.refined.pick_reason.keys() == {wrong, len(survey.pick_label) - 1}
        assert largest_error(found.refined.adjustment, scene) < FARTHEST
    else:  # its height would explain both, or nothing shows which is wrong
        assert right not in found.refined.pick_reason
        assert {*found.contradicting, *found.labels} == {survey.label[label]}


def test_a_photo_that_one_wrong_pick_spoilt_comes_back_without_that_pick() -> None:
    """It is left out, and the rest fits; but all of its other picks agree with the rest."""
    survey = make_scene(5, frames=3, labels=14, lines=5).survey
    wrong = int(np.flatnonzero(survey.pick_frame == 2)[3])
    pixel = survey.pixel_px.copy()
    pixel[wrong] += [310.0, -240.0]
    taking = all_of(replace(survey, pixel_px=pixel))
    found = list(robust_candidate.adjust_from_softened(taking))[:1]
    doubted = replace(found[0], annealed=replace(found[0].annealed, frames=("f2",)))

    tried = list(reduced_starts.try_without_suspects(taking, [doubted]))

    best = min(tried, key=lambda one: one.cost(taking))
    assert best.taking.keep.all()
    assert best.first.pick_index[best.annealed.gross("pixels")].tolist() == [wrong]
