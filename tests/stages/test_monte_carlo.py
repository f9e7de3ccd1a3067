"""Sampling agrees with first-order propagation where that holds, and shows where it does not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scenes import Scene
from scipy.stats import chi2

from uavgram.model.frames import Frames
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.measure import measure, sample_observations
from uavgram.stages.refine import refine

COUNT = 400
REQUESTS = (
    MeasurementRequest(name="d", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="a", kind="area", points=("P0", "P1", "P2")),
    MeasurementRequest(
        name="v", kind="skid_speed", points=("P0", "P1"),
        parameters=(("mu", 0.7), ("mu_sigma", 0.05)),
    ),
    MeasurementRequest(name="none", kind="distance", points=("P0", "nowhere")),
)  # fmt: skip


def frames_of(survey: Survey) -> Frames:
    n = len(survey.frame_id)
    return Frames(
        frame_id=survey.frame_id, time_utc_s=np.arange(float(n)), sigma_time_s=np.full(n, 0.01),
        matched=np.ones(n, dtype=bool), reason=("",) * n,
        clock_offset_s=0.0, clock_offset_sigma_s=1.0,
    )  # fmt: skip


@pytest.mark.parametrize("options", [{}, {"telemetry": False, "gauge": "plane", "lines": 8}])
def test_sampled_sigmas_equal_first_order_ones_within_their_own_chance(
    scene_factory: Callable[..., Scene], options: dict[str, object]
) -> None:
    survey = scene_factory(4, **options).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    first, _ = measure(adjustment, REQUESTS, frames_of(survey))
    sampled, _ = sample_observations(adjustment, REQUESTS, frames_of(survey), COUNT, 1)

    assert (sampled.samples, sampled.failed) == (COUNT, 0)
    low, high = np.sqrt(chi2.ppf([1e-6, 1 - 1e-6], COUNT - 1) / (COUNT - 1))
    ratio = sampled.sigma[:3] / first.sigma[:3]
    assert (ratio > low).all(), ratio
    assert (ratio < high).all(), ratio
    offset = (sampled.mean - first.value)[:3] / first.sigma[:3]
    assert np.abs(offset).max() < 5 / np.sqrt(COUNT) + 0.1
    assert np.isnan(sampled.mean[3])


def test_the_same_seed_gives_the_same_samples(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(4).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    one, other = (
        sample_observations(adjustment, REQUESTS, frames_of(survey), 5, 7)[0] for _ in range(2)
    )

    np.testing.assert_array_equal(one.interval_95, other.interval_95)
