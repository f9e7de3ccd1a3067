"""Monte Carlo: everything observed or assumed is sampled, adjusted anew and measured.

JCGM 101:2008 (GUM supplement 1): where first-order propagation is not good enough, the sampled
values show it, and their intervals are skewed where the truth is.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Adjustment
from uavgram.estimation.least_squares import minimise
from uavgram.estimation.measurands import (
    UnmeasurableError,
    measurands,
    require_picked,
    unmeasured,
)
from uavgram.estimation.normal_equations import Block, SingularError
from uavgram.estimation.survey_state import State, move
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result import MeasurementResults, MonteCarloResults

NOTICED = 0.05
"""Difference between sampled and first-order sigma, as a share, from which it is said."""


def sample(
    adjustment: Adjustment,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    count: int,
    seed: int,
) -> MonteCarloResults:
    """Repeat the adjustment with observations and priors drawn about their stated values.

    Parameters
    ----------
    adjustment
        The adjusted survey; where its iterations start.
    requests, frames
        What to measure, and the times of the exposures.
    count
        Number of repetitions, at least two that converge.
    seed
        Of the draws; friction and times are drawn too.

    Notes
    -----
    Every observation enters whitened, r = W (predicted - observed); drawing the observation from
    its own distribution makes it r - e with e of unit variance, whatever its covariance was.
    """
    rng = np.random.default_rng(seed)
    rows, failed = [], 0
    shape = {name: block.residual.shape for name, block in adjustment.minimum.blocks.items()}
    for _ in range(count):
        draws = {name: rng.standard_normal(size) for name, size in shape.items()}
        draws["gauge"] = np.zeros(shape.get("gauge", ()))  # a choice, not an observation
        state = _adjusted(adjustment, draws)
        if state is None:
            failed += 1
        else:
            rows.append(_values(adjustment, state, requests, frames, rng))
    if len(rows) < 2:
        raise GeometryError(
            f"{failed} of {count} Monte Carlo repetitions did not come to rest: the survey is too "
            "weak to be sampled; add known lengths or picks"
        )
    values = np.array(rows).reshape(len(rows), -1)
    return MonteCarloResults(
        mean=values.mean(axis=0),
        sigma=values.std(axis=0, ddof=1),
        interval_95=np.quantile(values, [0.025, 0.975], axis=0).T,
        samples=len(rows),
        failed=failed,
        seed=seed,
    )


def compare(first: MeasurementResults, sampled: MonteCarloResults) -> tuple[Message, ...]:
    """Say where first order is not good enough: sigmas that differ by more than 5 % and chance."""
    messages = []
    chance = 3.0 / np.sqrt(2.0 * sampled.samples)
    for i, name in enumerate(first.name):
        ratio = sampled.sigma[i] / first.sigma[i]
        if abs(ratio - 1.0) > NOTICED + chance:
            low, high = sampled.interval_95[i]
            text = (
                f"{name!r}: first-order sigma {first.sigma[i]:.3g}, sampled {sampled.sigma[i]:.3g} "
                f"{first.unit[i]}: use the sampled 95 % interval, {low:.6g} to {high:.6g} "
                f"{first.unit[i]}."
            )
            messages.append(Message("warning", "first-order-off", text))
    if sampled.failed:
        text = f"{sampled.failed} Monte Carlo repetitions did not come to rest and were left out."
        messages.append(Message("warning", "monte-carlo-failed", text))
    return tuple(messages)


def _adjusted(adjustment: Adjustment, draws: dict[str, Floats]) -> State | None:
    """The state that fits the drawn observations; None where the iterations do not come to rest."""
    problem = adjustment.problem

    def evaluate(state: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(state)
        if blocks is None:
            return None
        return {
            name: Block(block.residual - draws[name], block.columns, block.jacobian)
            for name, block in blocks.items()
        }

    layout = problem.layout
    try:
        minimum = minimise(
            adjustment.state,
            evaluate,
            lambda state, step: move(layout, state, step),
            layout.size,
            layout.structure,
        )
    except SingularError:
        return None
    return minimum.state if minimum.converged else None


def _values(
    adjustment: Adjustment,
    state: State,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    rng: np.random.Generator,
) -> list[float]:
    """Measured values of one sample, in the order of the requests."""
    survey = adjustment.survey
    world, _, _ = adjustment.problem.world_points(state, np.arange(len(survey.label)))
    place = {label: k for k, label in enumerate(survey.label)}
    values: list[float] = []
    drawn: dict[str, float] = defaultdict(rng.standard_normal)  # one draw for each source
    for request in requests:
        try:
            require_picked(request, survey.label)
            points = world[[place[p] for p in request.points]]
            found = measurands(request, points, survey, frames)
        except UnmeasurableError:
            found = unmeasured(request)
        values += [row.value + sum(s * drawn[k] for k, s in row.others.items()) for row in found]
    return values
