"""Errors of the telemetry that go together in time: are the results still as good as stated?

No draws are needed: what an error of the telemetry does to an adjusted distance is linear to first
order, so its variance under correlated errors follows from the adjustment itself. With the whitened
rows J of the telemetry, N the normal matrix and Omega the true covariance of the whitened errors,
that of the estimates is N^-1 + N^-1 J^T (Omega - I) J N^-1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.telemetry import compute_trend_inflation
from uavgram.geometry.ground import measurements
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions, TelemetryOptions
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

TIMES_S = (2.0, 5.0, 10.0, 20.0, 60.0)
"""Of correlation."""
SCENES: dict[str, dict[str, Any]] = {
    "six frames over 60 m": {"frames": 6, "labels": 12, "along": 60.0},
    "twelve frames over 120 m": {"frames": 12, "labels": 20, "along": 120.0},
    "thirty frames over 300 m": {"frames": 30, "labels": 50, "along": 300.0},
}


def adjusted(options: dict[str, Any], *, lines: int, inflated: bool) -> tuple[Adjustment, float]:
    survey = make_scene(40, lines=lines, noise=0.0, **options).survey
    assert survey.telemetry is not None
    factor = 1.0
    if inflated:
        shortest, longest = TelemetryOptions().correlation_s
        factor = compute_trend_inflation(survey.telemetry.time_s, shortest, longest)
    prior = replace(survey.telemetry, covariance=factor * survey.telemetry.covariance)
    return refine(replace(survey, telemetry=prior), SolveOptions())[0].adjustment, factor


def variance_ratios(
    adjustment: Adjustment, factor: float, tau_s: float, gradients: Floats
) -> Floats:
    """(m,) true variances over stated ones of m functions with gradients (size, m)."""
    block = adjustment.minimum.blocks["telemetry"]
    solved = adjustment.minimum.factor.solve(gradients)
    by_error = np.einsum("nrk,nkm->nrm", block.jacobian, solved[block.columns])
    assert adjustment.survey.telemetry is not None
    time = adjustment.survey.telemetry.time_s
    together = np.exp(-np.abs(time[:, None] - time) / tau_s) / factor - np.eye(len(time))
    more = np.einsum("krm,kl,lrm->m", by_error, together, by_error)
    stated = np.einsum("um,um->m", gradients, solved)
    ratios: Floats = 1.0 + more / stated
    return ratios


def gradients_of(adjustment: Adjustment, *, distances: bool) -> Floats:
    """(size, m) of the distances of every point from the first and from the last, or of places."""
    problem, count = adjustment.problem, adjustment.problem.layout.points
    label = np.arange(count)
    world, d_point, d_plane = problem.world_points(adjustment.state, label)
    columns = np.concatenate([problem.layout.point_columns(label), problem.plane_columns(label)], 1)
    by_unknowns = np.zeros((count, 3, problem.layout.size))
    for k in label:
        by_unknowns[k][:, columns[k]] = np.concatenate([d_point[k], d_plane[k]], axis=1)
    if not distances:
        return by_unknowns[:, :2].reshape(2 * count, -1).T
    pairs = [(a, b) for a in (0, count - 1) for b in label if a != b]
    rows = []
    for pair in pairs:
        _, gradient = measurements.distance(world[np.array(pair)])
        rows.append(np.einsum("pi,piu->u", gradient, by_unknowns[np.array(pair)]))
    return np.array(rows).T


def worst(
    options: dict[str, Any], *, lines: int = 0, inflated: bool = True, distances: bool = True
) -> float:
    """Largest root mean square ratio of true to stated sigma over the times of correlation."""
    adjustment, factor = adjusted(options, lines=lines, inflated=inflated)
    gradients = gradients_of(adjustment, distances=distances)
    return max(
        float(np.sqrt(np.mean(variance_ratios(adjustment, factor, tau, gradients))))
        for tau in TIMES_S
    )


@pytest.mark.parametrize("lines", [0, 4])
@pytest.mark.parametrize("options", SCENES.values(), ids=SCENES)
def test_distances_are_as_good_as_stated_whatever_the_correlation(
    options: dict[str, Any], lines: int
) -> None:
    assert worst(options, lines=lines) < 1.1


@pytest.mark.parametrize("options", SCENES.values(), ids=SCENES)
def test_places_are_as_good_as_stated_whatever_the_correlation(options: dict[str, Any]) -> None:
    assert worst(options, distances=False) < 1.12


def test_taken_as_independent_they_would_be_overstated() -> None:
    long = SCENES["thirty frames over 300 m"]
    assert worst(long, inflated=False) > 1.4


def test_the_price_is_less_than_the_factor() -> None:
    # Where errors really are independent, the stated sigmas are too large: by how much.
    adjustment, factor = adjusted(SCENES["thirty frames over 300 m"], lines=0, inflated=True)
    gradients = gradients_of(adjustment, distances=True)
    ratio = np.sqrt(np.mean(variance_ratios(adjustment, factor, 1e-3, gradients)))
    assert 1 / np.sqrt(factor) < ratio < 1.0
