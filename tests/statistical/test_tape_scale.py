"""Tapes whose scales are drawn from their prior: lengths are as uncertain as they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene
from taped_scenes import read_on_tapes

from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

TRIALS = 90
SIGMA = 0.004
ENDS = tuple((i, i + 1) for i in range(8))


def z_of_lengths(scene_factory: Callable[..., Scene], trials: int, *, known: bool) -> float:
    """Pooled rms of error over sigma of lengths, the tape's scale an unknown or taken as exact."""
    squares = []
    for seed in range(trials):
        scene = scene_factory(
            900 + seed, frames=3, labels=9, lines=8, telemetry=False, gauge="plane", ends=ENDS
        )
        scale = SIGMA * np.random.default_rng(seed).standard_normal()
        scene = read_on_tapes(scene, {"": float(scale)}, sigma=SIGMA)
        survey = scene.survey if known else replace(scene.survey, tape_scale_sigma=0.0)
        adjustment = refine(survey, SolveOptions())[0].adjustment
        label = adjustment.label_rows([f"P{k}" for k in range(9)])
        start, end = label[:-2], label[2:]
        problem = adjustment.problem
        found, gradient, columns = problem.lengths_between(adjustment.state, start, end)
        true = np.linalg.norm(scene.world[2:] - scene.world[:-2], axis=1)
        variance = adjustment.minimum.factor.variances(columns, gradient)
        squares.append((found - true) ** 2 / variance)
    return float(np.sqrt(np.mean(squares)))


def test_lengths_are_as_uncertain_as_they_say(scene_factory: Callable[..., Scene]) -> None:
    assert 0.85 < z_of_lengths(scene_factory, TRIALS, known=True) < 1.15


def test_a_tape_taken_as_exact_breaks_the_bounds(scene_factory: Callable[..., Scene]) -> None:
    assert z_of_lengths(scene_factory, 12, known=False) > 1.5
