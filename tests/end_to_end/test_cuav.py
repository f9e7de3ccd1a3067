"""A real flight: hand-laid barrels under a plane, photos named by a wrong clock, a real tlog."""

from __future__ import annotations

import numpy as np
import pytest
from flight_projects import RunFlight

from uavgram.model.result.result import Result

# Barrel spacings from hand positions, good to some 0.3 m (data/README.md).
TRUE_M = {"south": 20.26, "whole": 40.14}
TRUE_SIGMA_M = 0.3


@pytest.fixture(scope="module")
def result(run_flight: RunFlight) -> Result:
    return run_flight("cuav")


def values(result: Result) -> dict[str, tuple[float, float]]:
    rows = result.measurements
    return {n: (rows.value[i], rows.sigma[i]) for i, n in enumerate(rows.name)}


def test_every_frame_is_refined(result: Result) -> None:
    assert result.frames.status == ("refined",) * 9
    assert result.solution.converged
    assert np.isfinite(result.frames.refined.covariance).all()


def test_the_clock_offset_is_found(result: Result) -> None:
    offset = result.shared.clock_offset_s
    assert offset is not None
    assert offset.value[0] == pytest.approx(0.30, abs=0.15)
    assert 0 < offset.sigma[0] < 0.15


def test_one_taped_length_and_the_log_check_each_other(result: Result) -> None:
    assert result.verdict.level == "green"
    assert set(result.measurements.status) == {"ok"}


@pytest.mark.parametrize("name", TRUE_M)
def test_lengths_agree_with_the_hand_positions(result: Result, name: str) -> None:
    value, sigma = values(result)[name]
    assert value == pytest.approx(TRUE_M[name], rel=0.025)
    assert abs(value - TRUE_M[name]) <= 3 * np.hypot(sigma, TRUE_SIGMA_M)


@pytest.mark.parametrize("name", TRUE_M)
def test_telemetry_alone_is_good_to_four_percent(run_flight: RunFlight, name: str) -> None:
    alone = run_flight("cuav", lines=None)
    assert alone.lines.name == ()
    value, sigma = values(alone)[name]
    assert value == pytest.approx(TRUE_M[name], rel=0.04)
    assert abs(value - TRUE_M[name]) <= 3 * np.hypot(sigma, TRUE_SIGMA_M)


def test_the_nonsense_clock_of_the_log_is_told(result: Result) -> None:
    assert any("SYSTEM_TIME" in message.text for message in result.messages)


def test_a_taped_length_makes_the_others_more_certain(
    result: Result, run_flight: RunFlight
) -> None:
    alone = values(run_flight("cuav", lines=None))
    for name, (_, sigma) in values(result).items():
        assert sigma < alone[name][1]
