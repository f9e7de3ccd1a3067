"""The budget against a dense partition, against the whole, and against data without one source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import NO_TIMES, Scene, make_scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.error_budget import (
    ASSUMED_RELIEF_M,
    ASSUMED_TAPE_ERROR,
    SOURCES,
    compute_error_budget,
    compute_height_derivatives,
    compute_shares,
    compute_shifts,
)
from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
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
    parts = compute_error_budget(adjustment.minimum.blocks, measured, measured.sigma)
    total = np.sum(list(parts.values()), axis=0)

    known = np.isfinite(measured.sigma)
    assert known.sum() == len(known) - 1
    np.testing.assert_allclose(total[known], measured.sigma[known] ** 2, rtol=1e-7)
    assert np.isnan(total[~known]).all()


def test_each_part_is_that_of_the_dense_partition(case: tuple[Adjustment, MeasuredValues]) -> None:
    adjustment, measured = case
    size = adjustment.problem.layout.size
    inverse = adjustment.minimum.factor.joint(np.arange(size))
    parts = compute_error_budget(adjustment.minimum.blocks, measured, measured.sigma)
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
    budget = compute_shares(
        compute_error_budget(adjustment.minimum.blocks, measured, measured.sigma)
    )
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
    budget = compute_shares(
        compute_error_budget(adjustment.minimum.blocks, measured, measured.sigma)
    )

    assert ("flight log" in budget.source) == (adjustment.survey.gauge == "world")
    assert "control points" not in budget.source


def test_other_explanations_are_a_source_of_their_own(
    case: tuple[Adjustment, MeasuredValues],
) -> None:
    adjustment, measured = case
    parts = compute_error_budget(adjustment.minimum.blocks, measured, 2.0 * measured.sigma)
    budget = compute_shares(parts)

    known = np.isfinite(measured.sigma)
    share = budget.share[known, budget.source.index("other explanations")]
    np.testing.assert_allclose(share, 0.75, rtol=1e-9)
    assert "other explanations" in SOURCES


def test_what_is_rough_below_a_point_counts_as_ground() -> None:
    scene = make_scene(8, roughness=0.05, heights={2: 1.5})
    scene = with_third_coordinates(scene, free=(2,))
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    height = MeasurementRequest(name="height", kind="height", points=("P2",))
    measured = propagate(adjustment, (height,), NO_TIMES)
    parts = compute_error_budget(adjustment.minimum.blocks, measured, measured.sigma)
    assert parts["roughness"] > adjustment.survey.ground.roughness_sigma_m**2
    assert parts["other"] == pytest.approx([0.0], abs=1e-9)
    assert sum(part[0] for part in parts.values()) == pytest.approx(measured.sigma[0] ** 2)
    assert "friction and times" not in compute_shares(parts).source


# Shifts by relief and tape against adjustments of the survey with other heights and readings.


Make = Callable[..., Scene]

REQUESTS_SHIFTS = (
    MeasurementRequest(name="length", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="field", kind="area", points=("P0", "P1", "P2")),
    MeasurementRequest(name="corner", kind="angle", points=("P0", "P1", "P2")),
    MeasurementRequest(name="nowhere", kind="distance", points=("P0", "absent")),
)
CASES = {
    "several photos": {"frames": 4},
    "one photo": {"frames": 1},
    "control and heights": {"frames": 2, "control": 3, "heights": {1: 0.8, 5: 1.2}},
    "lengths alone": {"frames": 3, "telemetry": False, "gauge": "plane", "lines": 8},
}


def measured(survey: Survey) -> tuple[Adjustment, MeasuredValues]:
    adjustment = refine(survey, SolveOptions())[0].adjustment
    return adjustment, propagate(adjustment, REQUESTS_SHIFTS, NO_TIMES)


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_shifts_are_those_of_adjustments_anew(
    scene_factory: Make, options: dict[str, object]
) -> None:
    # Exact data: with errors the minimum moves as the curvature of the residuals has it, too.
    scene = scene_factory(8, labels=8, noise=0.0, **options)
    scene = read_on_tapes(scene, {"": 0.0}, sigma=0.001, along=("slope", "horizontal"))
    survey = scene.survey
    adjustment, values = measured(survey)
    found = compute_shifts(adjustment, values)
    assert np.isnan(found.relief[3])
    assert np.isnan(found.tape[3])

    one_sided = compute_height_derivatives(adjustment, values, np.arange(len(survey.label)))
    step = 0.5 * ASSUMED_RELIEF_M  # iterations end a hundredth of a sigma from the minimum
    total = np.zeros(3)
    for k in range(3):
        above = np.array(survey.height_above_m)
        above[k] += step
        _, up = measured(replace(survey, height_above_m=above))
        above[k] -= 2 * step
        _, down = measured(replace(survey, height_above_m=above))
        change = (up.value - down.value)[:3] / (2 * step)
        np.testing.assert_allclose(one_sided[k, :3], change, rtol=0.02, atol=2e-3)
        total += np.abs(change) * [k < len(request.points) for request in REQUESTS_SHIFTS[:3]]
    np.testing.assert_allclose(found.relief[:3], ASSUMED_RELIEF_M * total, rtol=0.02, atol=1e-3)

    longer = 1.0 + ASSUMED_TAPE_ERROR
    _, more = measured(replace(survey, length_m=longer * survey.length_m))
    _, less = measured(replace(survey, length_m=survey.length_m / longer))
    change = (more.value - less.value)[:3] / 2.0
    np.testing.assert_allclose(found.tape[:3], change, rtol=0.02, atol=1e-3)


def test_in_a_single_photo_a_point_moves_along_its_ray(scene_factory: Make) -> None:
    scene = scene_factory(3, frames=1, lines=0, noise=0.0, sources=("pixels",))
    adjustment, values = measured(scene.survey)
    world, center = scene.world, scene.truth.center[0]
    ray = (world - center)[:, :2] / (world - center)[:, 2:]  # ground run for one metre up
    along = world[1, :2] - world[0, :2]
    along = along / np.linalg.norm(along)

    expected = ASSUMED_RELIEF_M * (abs(along @ ray[0]) + abs(along @ ray[1]))
    assert compute_shifts(adjustment, values).relief[0] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("lines", [0, 6])
def test_nothing_measured_has_no_shifts(scene_factory: Make, lines: int) -> None:
    adjustment, _ = measured(scene_factory(8, frames=3, lines=lines).survey)
    found = compute_shifts(adjustment, propagate(adjustment, (), NO_TIMES))

    assert found.relief.shape == found.tape.shape == (0,)


def test_without_lengths_no_tape_shifts_anything(scene_factory: Make) -> None:
    scene = scene_factory(8, frames=3, lines=0)
    adjustment, values = measured(scene.survey)

    assert np.isnan(compute_shifts(adjustment, values).tape).all()
