"""Hypotheses in the linear model: against adjustments with their unknowns, by numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import make_scene
from scipy.stats import chi2

from uavgram.estimation.reliability.hypotheses import (
    ObservationChange,
    compare_hypotheses,
    compute_log_probability,
)
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.stages.refine.minima import Participants, find_best_minima


@pytest.fixture(scope="module")
def adjustment() -> Adjustment:
    survey = make_scene(5, frames=4, labels=12, lines=6).survey
    every = np.ones(len(survey.pick_frame), dtype=np.bool_)
    taking = Participants(survey, every, np.zeros(len(survey.line_start), dtype=np.bool_), {})
    return find_best_minima(taking).adjustment


def dense(adjustment: Adjustment, extra: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Jacobian with the columns of further unknowns (n, r, q) by group, and the residuals."""
    size = adjustment.problem.layout.size
    count = next(iter(extra.values())).shape[2]
    rows, residuals = [], []
    for kind, block in adjustment.minimum.blocks.items():
        n, r, _ = block.jacobian.shape
        own = np.zeros((n, r, size + count))
        for k in range(n):
            np.add.at(own[k].T, block.columns[k], block.jacobian[k].T)
        own[:, :, size:] = extra.get(kind, np.zeros((n, r, count)))
        rows.append(own.reshape(n * r, -1))
        residuals.append(block.residual.ravel())
    return np.concatenate(rows), np.concatenate(residuals)


def test_all_lengths_and_picks_moved_together_are_what_least_squares_says(
    adjustment: Adjustment,
) -> None:
    rng = np.random.default_rng(2)
    blocks = adjustment.minimum.blocks
    sizes = {kind: blocks[kind].residual.shape for kind in ("lengths", "pixels")}
    extra = {kind: rng.normal(size=(*shape, 2)) for kind, shape in sizes.items()}
    moved = [ObservationChange(kind, np.arange(len(own)), own) for kind, own in extra.items()]
    (found,) = compare_hypotheses(adjustment, [moved])
    jacobian, residual = dense(adjustment, extra)
    step = np.linalg.lstsq(jacobian, -residual)[0]
    inverse = np.linalg.inv(jacobian.T @ jacobian)[-2:, -2:]
    before = float(residual @ residual)
    after = float(np.sum((residual + jacobian @ step) ** 2))
    assert found.unknowns == 2
    assert found.value == pytest.approx(step[-2:], rel=1e-5)
    assert found.covariance == pytest.approx(inverse, rel=1e-5)
    assert found.gain == pytest.approx(before - after, rel=1e-3)


def test_a_pick_that_may_be_anywhere_explains_what_it_falls_without_it(
    adjustment: Adjustment,
) -> None:
    block = adjustment.minimum.blocks["pixels"]
    each = [
        [ObservationChange("pixels", np.array([k]), np.eye(2)[None])]
        for k in range(len(block.residual))
    ]
    gain = np.array([one.gain for one in compare_hypotheses(adjustment, each)])
    fall = compute_reductions(block, adjustment.covariance)
    checked = np.array([one.unknowns for one in compare_hypotheses(adjustment, each)]) == 2
    assert checked.sum() > 10
    assert gain[checked] == pytest.approx(fall[checked], rel=1e-6, abs=1e-9)


def test_what_nothing_checks_is_not_found(adjustment: Adjustment) -> None:
    column = int(adjustment.minimum.blocks["pixels"].columns[0, 0])
    moved = [
        ObservationChange(kind, np.arange(len(block.residual)), along[..., None])
        for kind, block in adjustment.minimum.blocks.items()
        for along in [np.where(block.columns[:, None] == column, block.jacobian, 0.0).sum(axis=2)]
    ]
    (found,) = compare_hypotheses(adjustment, [moved])
    assert (found.unknowns, found.gain) == (0, 0.0)  # an unknown that the survey has already
    assert np.isinf(found.covariance).all()


@pytest.mark.parametrize("unknowns", [1, 2, 3, 7])
@pytest.mark.parametrize("gain", [0.5, 12.0, 400.0, 1300.0])
def test_the_probability_is_that_of_chi_square(unknowns: int, gain: float) -> None:
    expected = float(chi2.logsf(gain, unknowns))
    assert compute_log_probability(gain, unknowns) == pytest.approx(expected, rel=1e-6)
    several = min(0.0, expected + float(np.log(30)))
    assert compute_log_probability(gain, unknowns, 30) == pytest.approx(several, rel=1e-6)


def test_far_out_in_the_tail_it_keeps_falling() -> None:
    far = [compute_log_probability(gain, 2) for gain in (1400.0, 5000.0, 1e6)]
    assert far == [-700.0, -2500.0, -5e5]  # exactly exp(-gain / 2) for two unknowns
    assert compute_log_probability(0.0, 2) == 0.0
