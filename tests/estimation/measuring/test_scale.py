"""Sigmas of the scale against surveys that leave out the other observations of the scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rolling_scenes import read_in_rows
from scenes import Scene, make_scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.scale import (
    compute_scale_sigmas,
    describe_line_faults,
    find_next_line,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.measure import describe_scale_basis
from uavgram.stages.refine import refine

Make = Callable[..., Scene]
ALONE = {"telemetry": False, "gauge": "plane", "lines": 8}


def adjusted(scene: Scene) -> Adjustment:
    return refine(scene.survey, SolveOptions())[0].adjustment


@pytest.mark.parametrize("in_rows", [False, True])
@pytest.mark.parametrize("tapes", [(), ("",), ("a", "b")])
def test_the_rest_knows_the_scale_as_well_as_a_tape_that_nobody_knows(
    scene_factory: Make, tapes: tuple[str, ...], *, in_rows: bool
) -> None:
    """The readout time is an unknown behind those of the tapes, of whatever number."""
    scene = scene_factory(4, frames=6, lines=8, spread=20.0)
    scene = read_in_rows(scene, 0.03) if in_rows else scene
    of_known = read_on_tapes(scene, dict.fromkeys(tapes, 0.0), sigma=0.002) if tapes else scene
    of_unknown = read_on_tapes(scene, {"": 0.0}, sigma=1000.0)
    unknown = adjusted(of_unknown)
    at = unknown.problem.layout.first_tape
    # 1 / sigma^2 of the scale = what the rest knows, once the readings' own noise is taken away
    sigma = float(np.sqrt(unknown.shared_covariance(at, 1)[0, 0]))

    found = compute_scale_sigmas(adjusted(of_known))
    assert found.others == pytest.approx(sigma, rel=0.02)
    total = np.sum((scene.survey.length_m / scene.survey.length_sigma_m) ** 2)
    own = np.sqrt(1.0 / total + (0.002**2 / len(tapes) if tapes else 0.0))
    assert found.lengths == pytest.approx(own, rel=1e-3)


@pytest.mark.parametrize("roughness_m", [0.0, 0.08])
def test_nothing_else_bears_on_it_without_a_log(scene_factory: Make, roughness_m: float) -> None:
    """The ground is as uneven as the survey is large: that tells nothing of its size."""
    made = scene_factory(8, **ALONE, frames=5, labels=40, roughness=roughness_m)
    scene = read_on_tapes(made, {"": 0.0}, sigma=0.001)
    adjustment = adjusted(scene)

    assert np.isinf(compute_scale_sigmas(adjustment).others)
    (said,) = describe_scale_basis(adjustment)
    assert said.text.startswith("The scale rests on your lengths (± 0.1")
    assert "nothing else confirms it" in said.text


def test_the_sentence_names_what_bears_it(scene_factory: Make) -> None:
    log = describe_scale_basis(adjusted(scene_factory(4, frames=6, lines=8)))[0]
    assert "; the log confirms it to ± " in log.text
    alone = describe_scale_basis(adjusted(scene_factory(4, frames=6, lines=0)))[0]
    assert alone.text.startswith("The scale rests on the log alone: ± ")
    control = scene_factory(4, frames=6, lines=0, control=4, telemetry=False)
    assert (
        "rests on the control points alone: ± " in describe_scale_basis(adjusted(control))[0].text
    )
    both = replace(control, survey=scene_factory(4, frames=6, lines=8, control=4).survey)
    assert "the log and the control points" in describe_scale_basis(adjusted(both))[0].text
    assert {log.level, log.code} == {"info", "scale-basis"}


# Faults of a set of lines, and the next line to tape.


SCENE = np.array([[-20.0, -15.0], [20.0, -15.0], [20.0, 15.0], [-20.0, 15.0]])
NO_LOG: dict[str, Any] = {"telemetry": False, "gauge": "plane", "frames": 1}


def lines(*rows: tuple[float, ...]) -> tuple[Floats, Floats]:
    ends = np.array(rows, dtype=float)
    return ends[:, :2], ends[:, 2:]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([(-15, -10, 5, -9), (0, 0, 15, 1), (-10, 10, 12, 11), (3, 5, -9, 4)], "one direction"),
        ([(-15, 0, -5, 1), (0, 1, 9, 0), (10, 0, 18, 1.5), (-10, 0.5, -9, 1.5)], "narrow strip"),
        ([(-15, -15, -5, -5), (0, 0, 9, 9), (10, 10, 18, 18)], "are in one line"),
        ([(0, 0, 2, 1), (5, 5, 4, 8), (-9, -3, -7, -5), (-8, 9, -8, 7)], "short compared"),
        ([(1, 0, 15, 0.2), (0, 2, 0.1, 14), (-1, -1, -12, -12), (2, -2, 11, -11)], "one point"),
    ],
)
def test_degenerate_sets_are_named(rows: list[tuple[float, ...]], words: str) -> None:
    assert any(words in fault for fault in describe_line_faults(*lines(*rows), SCENE))


def test_a_spread_set_has_no_faults_and_a_turn_changes_nothing() -> None:
    start, end = lines((-15, -10, 5, -9), (9, -10, 15, 11), (-10, 10, 12, 3), (-3, 5, -19, -4))
    assert describe_line_faults(start, end, SCENE) == ()
    for angle in np.linspace(0, 3, 7):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        parallel = lines((-15, -10, 5, -9), (0, 0, 15, 1), (-10, 10, 12, 11))
        found = describe_line_faults(parallel[0] @ turn.T, parallel[1] @ turn.T, SCENE @ turn.T)
        assert "all lines run in nearly one direction" in found


def relative_sigma(adjustment: Adjustment) -> float:
    """Root mean square of sigma over length, over all pairs of labels, pair by pair."""
    squares = []
    for a in range(len(adjustment.survey.label)):
        for b in range(a):
            world, covariance = adjustment.joint_points(np.array([a, b]))
            unit = (world[0] - world[1]) / np.linalg.norm(world[0] - world[1])
            gradient = np.concatenate([unit, -unit])
            squares.append(gradient @ covariance @ gradient / np.sum((world[0] - world[1]) ** 2))
    result: float = np.sqrt(np.mean(squares))
    return result


def test_no_line_has_no_faults() -> None:
    """As where all lengths of a survey were left out."""
    assert describe_line_faults(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((4, 2))) == ()


def test_what_the_next_line_brings_is_what_it_brings() -> None:
    """The predicted sigmas are those of the survey with that line; no other line does better."""
    ends = ((0, 6), (1, 7), (2, 8), (3, 9))
    survey = make_scene(5, ends=ends, labels=10, noise=0.0, **NO_LOG).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    advice = find_next_line(adjustment)
    assert advice is not None
    sigma_m = advice.sigma_m
    assert advice.relative_sigma == pytest.approx(relative_sigma(adjustment), rel=1e-9)
    assert (advice.start, advice.end) not in ends

    def taped(a: int, b: int) -> Adjustment:
        length = np.linalg.norm(np.subtract(*adjustment.points()[0][[a, b]]))
        return refine(
            replace(
                survey,
                line_start=np.append(survey.line_start, a),
                line_end=np.append(survey.line_end, b),
                length_m=np.append(survey.length_m, length),
                length_sigma_m=np.append(survey.length_sigma_m, sigma_m),
            ),
            SolveOptions(),
        )[0].adjustment

    after = relative_sigma(taped(advice.start, advice.end))
    assert after == pytest.approx(advice.relative_sigma_after, rel=1e-4)
    others = [(0, 1), (4, 5), (2, 7), (8, 9)]
    assert all(relative_sigma(taped(*pair)) > after * (1 - 1e-4) for pair in others)
