"""What is weak about a set of lines, in words, and which one to tape next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.measuring.scale import describe_line_faults, find_next_line
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

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
