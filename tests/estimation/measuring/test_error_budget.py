"""The budget against a dense partition, against the whole, and against data without one source."""

from __future__ import annotations

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import NO_TIMES, make_scene

from uavgram.estimation.measuring.error_budget import compute_error_budget, compute_shares
from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

REQUESTS = (
    MeasurementRequest(name="whole", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="field", kind="area", points=("P0", "P1", "P2")),
    MeasurementRequest(name="place", kind="coordinate", points=("P3",)),
    MeasurementRequest(name="nowhere", kind="distance", points=("P0", "absent")),
    MeasurementRequest(
        name="skid",
        kind="skid_speed",
        points=("P0", "P1"),
        parameters=(("mu", 0.7), ("mu_sigma", 0.1)),
    ),
)


@pytest.fixture(scope="module", params=["world", "plane"])
def case(request: pytest.FixtureRequest) -> tuple[Adjustment, MeasuredValues]:
    free = request.param == "plane"
    scene = make_scene(8, frames=4, telemetry=not free, gauge=request.param)
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    return adjustment, propagate(adjustment, REQUESTS, NO_TIMES)


def test_the_parts_add_up_to_the_variance(case: tuple[Adjustment, MeasuredValues]) -> None:
    adjustment, measured = case
    parts = compute_error_budget(adjustment.minimum.blocks, measured)
    total = np.sum(list(parts.values()), axis=0)

    known = np.isfinite(measured.sigma)
    assert known.sum() == len(known) - 1
    np.testing.assert_allclose(total[known], measured.sigma[known] ** 2, rtol=1e-7)
    assert np.isnan(total[~known]).all()


def test_each_part_is_that_of_the_dense_partition(case: tuple[Adjustment, MeasuredValues]) -> None:
    adjustment, measured = case
    size = adjustment.problem.layout.size
    inverse = adjustment.minimum.factor.joint(np.arange(size))
    parts = compute_error_budget(adjustment.minimum.blocks, measured)
    for name, block in adjustment.minimum.blocks.items():
        n, r, _ = block.jacobian.shape
        rows = np.zeros((n, r, size))
        for i in range(n):
            np.add.at(rows[i].T, block.columns[i], block.jacobian[i].T)
        moved = rows.reshape(n * r, size) @ inverse @ measured.gradient
        expected = (moved**2).sum(axis=0)
        known = np.isfinite(parts[name])
        np.testing.assert_allclose(
            parts[name][known],
            expected[known],
            rtol=1e-6,
            atol=1e-9 * measured.sigma[known].min() ** 2,
        )


def test_friction_shows_as_its_own_source_and_shares_add_up_to_one(
    case: tuple[Adjustment, MeasuredValues],
) -> None:
    adjustment, measured = case
    budget = compute_shares(compute_error_budget(adjustment.minimum.blocks, measured))
    at = measured.name.index("skid")

    known = np.isfinite(measured.sigma)
    np.testing.assert_allclose(budget.share[known].sum(axis=1), 1.0, rtol=1e-9)
    friction = budget.share[at, budget.source.index("friction and times")]
    # v = sqrt(2 mu g d): a relative sigma of mu gives half of it in v
    value, sigma = measured.value[at], measured.sigma[at]
    assert friction == pytest.approx((0.5 * 0.1 / 0.7 * value / sigma) ** 2, rel=1e-6)
    assert "gauge" not in budget.source


def test_sources_without_any_part_are_left_out(case: tuple[Adjustment, MeasuredValues]) -> None:
    adjustment, measured = case
    budget = compute_shares(compute_error_budget(adjustment.minimum.blocks, measured))

    assert ("flight log" in budget.source) == (adjustment.survey.gauge == "world")
    assert "control points" not in budget.source


def test_what_is_rough_below_a_point_counts_as_ground() -> None:
    scene = make_scene(8, roughness=0.05, heights={2: 1.5})
    scene = with_third_coordinates(scene, free=(2,))
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    height = MeasurementRequest(name="height", kind="height", points=("P2",))
    measured = propagate(adjustment, (height,), NO_TIMES)
    parts = compute_error_budget(adjustment.minimum.blocks, measured)
    assert parts["roughness"] > adjustment.survey.ground.roughness_sigma_m**2
    assert parts["other"] == pytest.approx([0.0], abs=1e-9)
    assert sum(part[0] for part in parts.values()) == pytest.approx(measured.sigma[0] ** 2)
    assert "friction and times" not in compute_shares(parts).source
