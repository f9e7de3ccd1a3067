"""Are the uncertainties honest? Thousands of random scenes against the truth, one error at a time.

With every source on at once, a mistake in one hides behind the others; so each is switched on
alone as well (the others keep a twentieth of their size, in the model and in the data). Every
scene is drawn anew, over the whole range of use, and gives the distances between all its points,
which go together, so that scenes are what is counted; and one distance of which the share within
its sigmas is counted. Bounds hold at 99.9 % for the number of scenes: Student's of mean squares,
the binomial of shares. Planted bugs show that the bounds can be broken.

The environment raises the number of scenes of rows that have fewer, and to a tenth of it the number
of those that are judged by sampling:

    UAVGRAM_REPETITIONS=10000 pytest tests/statistical/test_coverage.py
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from adjusted_scenes import adjust_from_truth
from random_scenes import MEASURED, Kind, random_scene
from scenes import NO_TIMES, Scene
from scipy.stats import binom, norm, t

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.measuring.second_order import compute_curvature
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey import likelihood as survey_problem
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.lengths import Lengths
from uavgram.estimation.survey.observations.pixels import Pixels
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground import measurements
from uavgram.model.arrays import Bools, Floats
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.measure import MAX_BIAS_SIGMAS, MAX_SIGMA_DIFFERENCE, sample_observations
from uavgram.stages.refine import refine

Plant = Callable[[pytest.MonkeyPatch], None]

pytestmark = pytest.mark.statistical

AT_LEAST = int(os.environ.get("UAVGRAM_REPETITIONS", "0"))
MOST_APART = 0.105
"""By which a mean square may at most be off 1 within its bound: sigmas that are off by 5 % show.

The mean squares of a scene's distances have a variance of 0.25 to 1.6, where that of one distance
has 2. So each row has as many scenes as it needs.
"""
JUDGED = max(12, AT_LEAST // 10)
"""Scenes that are judged by sampling, each of them adjusted anew some hundred times."""

TAIL = 0.001 / 2
WEAK = 0.05
"""Sigma over distance from which a scene's curvature is looked at; the few that the check would
find among the others stay in the count, which makes it stricter."""

DISTANCE = (
    MeasurementRequest(
        name="distance", kind="distance", points=tuple(f"P{label}" for label in MEASURED)
    ),
)
FLIGHT = ("good", "poor")
ROWS: dict[str, tuple[int, Kind]] = {
    "pixels": (1300, Kind(sources=("pixels",))),
    "lengths": (1450, Kind(sources=("lengths",))),
    "calibration": (1650, Kind(sources=("calibration",))),
    "telemetry of each frame": (2000, Kind(sources=("telemetry",), telemetry=FLIGHT, bare=0.5)),
    "biases": (2000, Kind(sources=("position_bias", "heading_bias"), telemetry=FLIGHT, bare=0.5)),
    "boresight": (1900, Kind(sources=("boresight",), telemetry=FLIGHT, bare=0.5)),
    "lever arm": (1400, Kind(sources=("lever_arm",), telemetry=FLIGHT, bare=0.5)),
    "clock": (1750, Kind(sources=("clock", "clock_drift"), telemetry=FLIGHT, bare=0.5, log=True)),
    "ground": (900, Kind(sources=("plane", "roughness"), telemetry=FLIGHT, bare=0.5, rough=True)),
    "two areas": (1300, Kind(sources=("plane",), telemetry=FLIGHT, bare=0.5, verge=True)),
    "control": (1300, Kind(sources=("control",), telemetry=("absent",), control=5)),
    "all together": (1700, Kind(sources=None, log=True, rough=True)),
}


@dataclass(frozen=True)
class Outcome:
    """Errors of many scenes.

    Attributes
    ----------
    distance
        (n,) errors of one distance of each scene, in sigmas.
    distances
        (m,) mean squares of the errors of all distances of a scene over their variances.
    points
        (k,) the same of places in plan, of scenes where the world is fixed.
    flagged
        Scenes left out, because the curvature check says that first order is not enough.
    unsettled
        Scenes left out, because the iterations did not come to rest.
    """

    distance: Floats
    distances: Floats
    points: Floats
    flagged: int
    unsettled: int


def curved(adjustment: Adjustment) -> bool:
    """Whether the program would say that the distance needs more than first order."""
    measured = propagate(adjustment, DISTANCE, NO_TIMES)
    terms = compute_curvature(adjustment, measured, NO_TIMES)
    within = abs(terms.sigma[0] / measured.sigma[0] - 1.0) <= MAX_SIGMA_DIFFERENCE
    return not (within and abs(terms.bias[0] / measured.sigma[0]) <= MAX_BIAS_SIGMAS)


def squared_distances(world: Floats, covariance: Floats, truth: Floats) -> Floats:
    """Squared errors over variances of the distances between (n, 3) points, but for weak ones.

    Parameters
    ----------
    world, covariance
        (n, 3) and (n, 3, n, 3), adjusted.
    truth
        (n, 3).
    """
    i, j = np.triu_indices(len(world), 1)
    apart = world[j] - world[i]
    value = np.linalg.norm(apart, axis=1)
    of_both = covariance[i, :, j] + covariance[j, :, i]
    of_apart = covariance[i, :, i] + covariance[j, :, j] - of_both
    variance = np.einsum("ki,kij,kj->k", apart, of_apart, apart) / value**2
    error = value - np.linalg.norm(truth[j] - truth[i], axis=1)
    squares: Floats = (error**2 / variance)[variance <= (WEAK * value) ** 2]
    return squares


def study(
    kind: Kind, trials: int, change: Callable[[Scene], Scene] | None = None, seed: int = 1
) -> Outcome:
    """Errors in `trials` scenes of a kind."""
    distance, distances, points, flagged, unsettled = [], [], [], 0, 0
    for trial in range(trials):
        scene = random_scene((seed, trial), kind)
        adjustment = adjust_from_truth(scene if change is None else change(scene))
        if adjustment is None:
            unsettled += 1
            continue
        count = len(scene.world)
        world, covariance = adjustment.joint_points(np.arange(count))
        covariance = covariance.reshape(count, 3, count, 3)
        ends = list(MEASURED)
        value, gradient = measurements.distance(world[ends])
        own = covariance[np.ix_(ends, range(3), ends, range(3))]
        sigma = np.sqrt(np.einsum("pi,piqj,qj", gradient, own, gradient))
        if sigma > WEAK * value and curved(adjustment):
            flagged += 1
            continue
        distance.append((value - np.linalg.norm(np.diff(scene.world[ends], axis=0))) / sigma)
        if len(squares := squared_distances(world, covariance, scene.world)):
            distances.append(np.mean(squares))
        if scene.survey.gauge == "world":
            error, each = (world - scene.world)[:, :2], np.arange(count)
            solved = np.linalg.solve(covariance[each, :2, each, :2], error[..., None])[..., 0]
            points.append(np.mean(error * solved))
    return Outcome(np.array(distance), np.array(distances), np.array(points), flagged, unsettled)


def apart_within_bounds(squares: Floats) -> float:
    """By how much the mean of so many may be off 1."""
    return float(t.isf(TAIL, len(squares) - 1) * squares.std(ddof=1) / np.sqrt(len(squares)))


def violations(outcome: Outcome) -> list[str]:
    """What is not as the covariances say, in words."""
    words = []
    n = len(outcome.distance)
    if outcome.unsettled > 0.005 * n:
        return [f"{outcome.unsettled} beside {n} did not come to rest"]
    for sigmas in (1, 2, 3):
        inside = int(np.sum(np.abs(outcome.distance) <= sigmas))
        low, high = binom.ppf(np.array([TAIL, 1 - TAIL]), n, 2 * norm.cdf(sigmas) - 1)
        if not low <= inside <= high:
            words.append(f"{inside} of {n} distances within {sigmas} sigma, not {low}..{high}")
    for name, square in (("distances", outcome.distances), ("points", outcome.points)):
        if len(square):
            most = apart_within_bounds(square)
            if abs(square.mean() - 1.0) > most:
                words.append(f"{name}: mean square {square.mean():.3f}, off 1 by over {most:.3f}")
    return words


@pytest.mark.parametrize("row", ROWS)
def test_errors_are_as_large_as_the_covariances_say(row: str) -> None:
    scenes, kind = ROWS[row]
    scenes = max(scenes, AT_LEAST)
    outcome = study(kind, scenes)

    assert violations(outcome) == []
    assert outcome.flagged < 0.01 * scenes  # counted apart: see below
    assert apart_within_bounds(outcome.distances) < MOST_APART  # else the bounds say nothing
    assert not len(outcome.points) or apart_within_bounds(outcome.points) < MOST_APART


def judged_by_sampling(adjustments: Iterable[Adjustment], truth: float, seed: int) -> bool:
    """Whether a true distance lies in the sampled 95 % interval of one of some adjustments."""
    for adjustment in adjustments:
        sampled, _ = sample_observations(adjustment, DISTANCE, NO_TIMES, 80, seed)
        low, high = sampled.interval_95[0]
        if low <= truth <= high:
            return True
    return False


def test_scenes_that_curvature_flags_are_honest_by_their_sampled_intervals() -> None:
    kind = Kind(sources=None, telemetry=("absent",), lines=(4, 4), frames=(1,), tape_m=(0.1, 0.4))
    inside = []
    for trial in range(20 * JUDGED):
        scene = random_scene((2, trial), kind)
        adjustment = adjust_from_truth(scene)
        if adjustment is not None and curved(adjustment):
            apart = float(np.linalg.norm(np.diff(scene.world[list(MEASURED)], axis=0)))
            inside.append(judged_by_sampling([adjustment], apart, trial))
        if len(inside) == JUDGED:
            break

    assert len(inside) == JUDGED
    assert sum(inside) >= binom.ppf(TAIL, len(inside), 0.95)


def test_ambiguous_scenes_of_three_lines_hold_the_truth_in_one_of_their_intervals() -> None:
    kind = Kind(sources=("pixels", "lengths"), telemetry=("absent",), lines=(3, 3), frames=(1,))
    inside, merged, alone = [], [], []
    for trial in range(20 * JUDGED):
        scene = random_scene((3, trial), kind)
        try:
            refined = refine(scene.survey, SolveOptions())[0]
        except GeometryError as why:  # no sigma would mean anything there
            merged.append(str(why))
            continue
        apart = float(np.linalg.norm(np.diff(scene.world[list(MEASURED)], axis=0)))
        if refined.alternatives:
            solutions = [refined.adjustment, *refined.alternatives]
            inside.append(judged_by_sampling(solutions, apart, trial))
        elif set(DISTANCE[0].points) <= set(refined.adjustment.survey.label):
            found = propagate(refined.adjustment, DISTANCE, NO_TIMES)
            alone.append(abs(found.value[0] - apart) / found.sigma[0])
        if len(inside) == JUDGED:
            break

    assert len(inside) == JUDGED
    assert sum(inside) >= binom.ppf(TAIL, len(inside), 0.95)
    # A pose reported alone is the right one: no rival was dropped on the way.
    assert max(alone) < 5.0
    assert sum(z > 3.0 for z in alone) <= binom.ppf(1.0 - TAIL, len(alone), 0.0027)
    assert all("poses that three lengths allow merge here" in why for why in merged)
    assert len(merged) <= 2 + 0.05 * trial


# Planted bugs: each must break the bounds.


def without_calibration_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    root = survey_problem.compute_covariance_root
    monkeypatch.setattr(survey_problem, "compute_covariance_root", lambda c: 1e-3 * root(c))


def rotation_on_the_wrong_side(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Pixels.rows

    def wrong(self: Pixels, state: State) -> Block | None:
        block = right(self, state)
        if block is None:
            return None
        first = self.problem.layout.point_size + 3
        jacobian = np.array(block.jacobian)
        back = np.swapaxes(state.rotation, 1, 2)[self.problem.survey.pick_frame]
        jacobian[:, :, first : first + 3] = jacobian[:, :, first : first + 3] @ back
        return replace(block, jacobian=jacobian)

    monkeypatch.setattr(Pixels, "rows", wrong)


def telemetry_sigma_for_variance(monkeypatch: pytest.MonkeyPatch) -> None:
    start = SurveyProblem.__init__

    def wrong(self: SurveyProblem, survey: Survey, pivot_m: Floats, lines: Bools) -> None:
        start(self, survey, pivot_m, lines)
        assert self.survey.telemetry is not None
        covariance = self.survey.telemetry.covariance
        sigma = np.sqrt(np.einsum("nii->ni", covariance))
        self.telemetry_whitening = np.eye(6) / np.sqrt(sigma)[:, None, :]

    monkeypatch.setattr(SurveyProblem, "__init__", wrong)


def length_variance_for_sigma(monkeypatch: pytest.MonkeyPatch) -> None:
    right = Lengths.rows

    def wrong(self: Lengths, state: State) -> Block | None:
        block = right(self, state)
        assert block is not None
        weight = 1 / self.problem.survey.length_sigma_m[self.problem.line_index]
        return replace(
            block,
            residual=block.residual * weight[:, None],
            jacobian=block.jacobian * weight[:, None, None],
        )

    monkeypatch.setattr(Lengths, "rows", wrong)


def twice(name: str) -> Plant:
    def plant(monkeypatch: pytest.MonkeyPatch) -> None:
        right = SurveyProblem.evaluate

        def wrong(self: SurveyProblem, state: State) -> dict[str, Block] | None:
            blocks = right(self, state)
            return None if blocks is None else blocks | {f"{name} of the same": blocks[name]}

        monkeypatch.setattr(SurveyProblem, "evaluate", wrong)

    return plant


ALONE: dict[str, Any] = {"bare": 1.0, "frames": (1,)}
"""One frame without known lengths, so that a prior decides and shows when it counts twice."""

BUGS: dict[str, tuple[Plant, str, dict[str, Any], int]] = {
    "calibration covariance dropped": (without_calibration_covariance, "calibration", {}, 60),
    "rotation error on the wrong side": (
        rotation_on_the_wrong_side,
        "telemetry of each frame",
        {},
        60,
    ),
    "telemetry sigma used for variance": (
        telemetry_sigma_for_variance,
        "telemetry of each frame",
        {},
        30,
    ),
    "length variance used for sigma": (length_variance_for_sigma, "lengths", {}, 60),
    "boresight counted twice": (twice("boresight"), "boresight", ALONE, 120),
    "telemetry counted twice": (twice("telemetry"), "telemetry of each frame", ALONE, 120),
    "plane counted twice": (twice("plane"), "ground", ALONE, 200),
}


@pytest.mark.parametrize(("plant", "row", "changes", "trials"), BUGS.values(), ids=BUGS.keys())
def test_a_planted_bug_breaks_the_bounds(
    monkeypatch: pytest.MonkeyPatch, plant: Plant, row: str, changes: dict[str, Any], trials: int
) -> None:
    kind = replace(ROWS[row][1], **changes)
    assert violations(study(kind, trials)) == []
    plant(monkeypatch)

    assert violations(study(kind, trials))


def ends_apart(scene: Scene) -> Scene:
    """Every line gets ends of its own, with copies of the picks: nothing is shared."""
    survey, truth = scene.survey, scene.truth
    ends = np.stack([survey.line_start, survey.line_end], axis=1)
    old = ends.ravel()
    new = len(survey.label) + np.arange(len(old))
    rows = [np.flatnonzero(survey.pick_label == label) for label in old]
    picks = np.concatenate([np.arange(len(survey.pick_label)), *rows])
    copies = np.repeat(new, [len(r) for r in rows])
    apart = replace(
        survey,
        label=(*survey.label, *(f"end {k}" for k in new)),
        height_above_m=np.append(survey.height_above_m, survey.height_above_m[old]),
        height_sigma_m=np.append(survey.height_sigma_m, survey.height_sigma_m[old]),
        is_free=np.append(survey.is_free, survey.is_free[old]),
        identification_sigma_m=np.zeros(0),
        area=np.append(survey.area, survey.area[old]),
        pick_frame=survey.pick_frame[picks],
        pick_label=np.append(survey.pick_label, copies),
        pixel_px=survey.pixel_px[picks],
        pick_sigma_px=survey.pick_sigma_px[picks],
        line_start=new.reshape(ends.shape)[:, 0],
        line_end=new.reshape(ends.shape)[:, 1],
    )
    point = np.concatenate([truth.point, truth.point[old]])
    return replace(scene, survey=apart, truth=replace(truth, point=point))


def net(scene: Scene, rng: np.random.Generator) -> Scene:
    """Five points, each taped to each: five labels decide the pose, and every one is shared."""
    ends = np.array(list(combinations(range(5), 2)))
    apart = scene.world[ends[:, 0]] - scene.world[ends[:, 1]]
    survey = replace(
        scene.survey,
        line_start=ends[:, 0],
        line_end=ends[:, 1],
        length_m=np.linalg.norm(apart, axis=1) + 1e-3 * rng.normal(size=len(ends)),
        length_sigma_m=np.full(len(ends), 1e-3),
    )
    return replace(scene, survey=survey)


def test_shared_ends_treated_as_two_points_break_the_bounds() -> None:
    kind = Kind(sources=("pixels",), telemetry=("absent",), frames=(1,))
    rng = np.random.default_rng(1)

    assert violations(study(kind, 300, lambda scene: net(scene, rng))) == []
    assert violations(study(kind, 300, lambda scene: ends_apart(net(scene, rng))))


def test_a_verge_taken_for_the_road_breaks_the_bounds() -> None:
    kind = replace(ROWS["two areas"][1], **ALONE)

    def on_the_road(scene: Scene) -> Scene:
        return replace(scene, survey=replace(scene.survey, area=0 * scene.survey.area))

    assert violations(study(kind, 60)) == []
    assert violations(study(kind, 60, on_the_road))
