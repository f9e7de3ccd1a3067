"""Shifts by relief and tape against adjustments of the survey with other heights and readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import NO_TIMES, Scene
from taped_scenes import read_on_tapes

from uavgram.estimation.measuring.error_budget import (
    ASSUMED_RELIEF_M,
    ASSUMED_TAPE_ERROR,
    compute_height_derivatives,
    compute_shifts,
)
from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

Make = Callable[..., Scene]

REQUESTS = (
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
    return adjustment, propagate(adjustment, REQUESTS, NO_TIMES)


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
        total += np.abs(change) * [k < len(request.points) for request in REQUESTS[:3]]
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
