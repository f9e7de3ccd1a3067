"""Monte Carlo: sample all observations and priors, readjust, and measure.

JCGM 101:2008 (GUM supplement 1): the sampled values show where first-order propagation is
insufficient, and their intervals are skewed as the true distribution is.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.propagation import compute_values, propagate
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.readjustment import refit
from uavgram.model.arrays import Bools
from uavgram.model.frames import Frames
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_digits
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.tables import MeasurementResults, MonteCarloResults

REPORTED_DIFFERENCE = 0.05
"""Relative difference between sampled and first-order sigma, or of an end of the interval as a
share of its width, above which it is reported."""

WIDTH = 2.0 * float(ndtri(0.975))
"""Width of a 95 % interval, in sigmas."""

QUANTILE_SIGMA = float(np.sqrt(0.025 * 0.975 * 2.0 * np.pi) * np.exp(0.5 * ndtri(0.025) ** 2))
"""Standard deviation of a sampled 2.5 % quantile, in sigmas over the root of the sample's size."""


def sample_observations(
    adjustment: Adjustment,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    count: int,
    seed: int,
) -> tuple[MonteCarloResults, tuple[Message, ...]]:
    """Repeat the adjustment with observations and priors drawn about their stated values.

    Parameters
    ----------
    adjustment
        The adjusted survey, from which the iterations start.
    requests, frames
        Measurements, and the times of the exposures.
    count
        Number of repetitions, at least two that converge.
    seed
        Seed of the draws; friction and times are drawn too.

    Returns
    -------
    MonteCarloResults
        Statistics of the repetitions in which a measurement had a value.
    messages
        Numbers of repetitions without a value (such as an outline that crosses itself), or without
        convergence.

    Notes
    -----
    Every observation enters whitened, r = W (predicted - observed); drawing the observation from
    its own distribution makes it r - e with e of unit variance, for any covariance.
    """
    rng = np.random.default_rng(seed)
    rows, failed = [], 0
    shape = {name: block.residual.shape for name, block in adjustment.minimum.blocks.items()}
    for _ in range(count):
        draws = {name: rng.standard_normal(size) for name, size in shape.items()}
        draws["gauge"] = np.zeros(shape.get("gauge", ()))  # a choice, not an observation
        state = refit(adjustment, draws)
        if state is None:
            failed += 1
        else:
            drawn: dict[str, float] = defaultdict(rng.standard_normal)  # one draw for each source
            rows.append(
                compute_values(adjustment.problem, state, requests, frames, drawn.__getitem__)
            )
    if len(rows) < 2:
        raise GeometryError(
            f"{failed} of {count} Monte Carlo repetitions did not converge: the survey is too "
            "weak to be sampled; add known lengths or picks"
        )
    values = np.array(rows).reshape(len(rows), -1)
    known = np.isfinite(values)
    mean, sigma = (np.full(values.shape[1], np.nan) for _ in range(2))
    interval = np.full((values.shape[1], 2), np.nan)
    for i in np.flatnonzero(known.sum(axis=0) >= 2):
        drawn_values = values[known[:, i], i]
        mean[i], sigma[i] = drawn_values.mean(), drawn_values.std(ddof=1)
        interval[i] = np.quantile(drawn_values, [0.025, 0.975])
    results = MonteCarloResults(
        mean=mean,
        sigma=sigma,
        interval_95=interval,
        samples=len(rows),
        failed=failed,
        seed=seed,
    )
    return results, tuple(_left_out(adjustment, requests, frames, known, failed))


def _left_out(
    adjustment: Adjustment,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    known: Bools,
    failed: int,
) -> Iterator[Message]:
    """Report repetitions without a solution, and without a value that the survey has."""
    if failed:
        text = (
            f"{failed} Monte Carlo repetitions found no solution and were left out: the sampled "
            "intervals may be too narrow. Add known lengths or picks."
        )
        yield Message("warning", "monte-carlo-failed", text)
    rows = propagate(adjustment, requests, frames).rows
    for row, missing in zip(rows, (~known).sum(axis=0), strict=True):
        if missing and row.gradient is not None:
            text = (
                f"{row.name!r} has no value in {missing} of {len(known)} Monte Carlo repetitions: "
                "its sampled interval leaves them out."
            )
            several = MessagePlural(
                "{count} measurements have no value in some of the Monte Carlo repetitions, which "
                "their sampled intervals leave out",
                f"{row.name!r} in {missing} of {len(known)}",
            )
            yield Message(
                "warning",
                "monte-carlo-null",
                text,
                measurements=(row.name,),
                several=several,
            )


def compare(first: MeasurementResults, sampled: MonteCarloResults) -> Iterator[Message]:
    """Report insufficient first order: differences of more than 5 % and beyond chance.

    Compared are the sigmas, and both ends of the 95 % intervals (JCGM 101:2008, clause 8).
    """
    chance = 3.0 / np.sqrt(sampled.samples)
    for i, name in enumerate(first.name):
        if first.is_ambiguous[i]:  # its interval has more explanations than the sampled one
            continue
        sigma_off = abs(sampled.sigma[i] / first.sigma[i] - 1.0) - chance / np.sqrt(2.0)
        ends = np.abs(sampled.interval_95[i] - first.interval_95[i]) / first.sigma[i]
        end_off = ends.max() / WIDTH - chance * QUANTILE_SIGMA / WIDTH
        if max(sigma_off, end_off) > REPORTED_DIFFERENCE:
            low, high = sampled.interval_95[i]
            unit = first.unit[i]
            sigmas = (
                f"± {format_digits(sampled.sigma[i], 3)} {unit} instead of "
                f"± {format_digits(first.sigma[i], 3)} {unit}"
            )
            ends_text = f"{format_digits(low, 6)} to {format_digits(high, 6)} {unit}"
            several = MessagePlural(
                "Use the sampled 95 % intervals of {count} measurements, the ordinary ones are off",
                f"{name!r} {ends_text} ({sigmas})",
            )
            yield Message(
                "warning",
                "first-order-off",
                f"Use the sampled 95 % interval of {name!r}, {ends_text}: the ordinary one is off "
                f"({sigmas}).",
                measurements=(name,),
                several=several,
            )
