"""A made-up result with everything a report can show; each number different from its neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.result.reliability import ChecksOverall, ErrorBudget, SecondOrder
from uavgram.model.result.result import Alternative, AreaPlane, Estimate, Result
from uavgram.model.result.tables import MonteCarloResults

SOURCES = ("lens", "picks", "friction and times", "known lengths", "flight log")


def full(result: Result) -> Result:
    """The result with budget, sampling, second order, areas, alternatives, and overall checks."""
    rng = np.random.default_rng(3)
    rows = result.measurements
    count, known = len(rows.name), np.isfinite(rows.value)
    none = np.where(known, 1.0, np.nan)
    share = rng.dirichlet(np.ones(len(SOURCES)), count) * none[:, None]
    area = AreaPlane(
        name="road",
        height_m=Estimate(value=np.array([0.123]), sigma=np.array([0.0456])),
        slope_deg=Estimate(value=np.array([0.31, -0.22]), sigma=np.array([0.011, 0.012])),
        pivot_m=np.array([12.5, -7.25]),
    )
    bank = replace(
        area,
        name="bank <of the river>",
        height_m=Estimate(value=np.array([-1.789]), sigma=np.array([0.0123])),
    )
    return replace(
        result,
        error_budget=ErrorBudget(source=SOURCES, share=share),
        monte_carlo=MonteCarloResults(
            mean=rows.value + 0.1 * rows.sigma,
            sigma=1.07 * rows.sigma,
            interval_95=rows.interval_95 + rows.sigma[:, None] * [-0.3, 0.2],
            samples=487,
            failed=13,
            seed=42,
        ),
        second_order=SecondOrder(
            bias=0.03 * rows.sigma,
            sigma=1.021 * rows.sigma,
            curvature=0.02 * none,
            off=np.zeros(count, dtype=bool),
        ),
        areas=(area, bank),
        checks_overall=ChecksOverall(
            count=7, chi2=8.25, probability=0.31, rms_error_m=0.0567, mean_error_percent=0.42
        ),
        solution=replace(
            result.solution,
            alternatives=(
                Alternative(
                    frame_id=result.frames.frame_id[0],
                    cost=12.53,
                    height_m=43.21,
                    tilt_deg=9.4,
                    values=tuple(rows.value + rng.normal(0, 20, count) * rows.sigma),
                ),
            ),
        ),
    )
