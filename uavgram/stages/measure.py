"""Measure values between ground points with their joint covariance, and their basis.

Monte Carlo check: JCGM 101:2008 (GUM supplement 1): the sampled values show where first-order
propagation is insufficient, and their intervals are skewed as the true distribution is.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.error_budget import Shifts
from uavgram.estimation.measuring.propagation import MeasuredValues, compute_values, propagate
from uavgram.estimation.measuring.scale import MAX_RELATIVE_SIGMA, compute_scale_sigmas
from uavgram.estimation.measuring.second_order import compute_curvature
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.ground_planes import find_ground_below
from uavgram.estimation.survey.readjustment import refit
from uavgram.geometry.ground.measurements import profile
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_digits
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.reliability import SecondOrder
from uavgram.model.result.tables import (
    COLUMNS,
    MeasurementResults,
    MonteCarloResults,
    ProfileResults,
)


def measure(
    adjustment: Adjustment, requests: tuple[MeasurementRequest, ...], frames: Frames
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    """Compute the requested measurements.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    requests
        Measurements. A ``coordinate`` gives two rows, its east and north.
    frames
        Times of the exposures, for ``speed``.

    Returns
    -------
    MeasurementResults
        In the order of the requests; NaN where a value cannot be computed.
    messages
        Reasons for missing values.
    """
    return measurement_results(propagate(adjustment, requests, frames))


def measurement_results(
    measured: MeasuredValues, shifted: Shifts | None = None
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    """Return the measurements as a table, and the reasons for missing values.

    Parameters
    ----------
    measured
        The values.
    shifted
        Effects of relief and of a wrong tape; None where not requested.
    """
    sigma, value = measured.sigma, measured.value
    reach = float(ndtri(0.975)) * sigma
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = measured.covariance / np.outer(sigma, sigma)
    correlation[~np.isfinite(correlation)] = np.nan
    results = MeasurementResults(
        name=measured.name,
        kind=tuple(row.request.kind for row in measured.rows),
        points=tuple(row.request.points for row in measured.rows),
        value=value,
        sigma=sigma,
        unit=measured.unit,
        interval_95=np.column_stack([value - reach, value + reach]),
        correlation=correlation,
        shift_relief_10cm=np.zeros(0) if shifted is None else shifted.relief,
        shift_tape_1pct=np.zeros(0) if shifted is None else shifted.tape,
        parameters=tuple(row.request.parameters_text for row in measured.rows),
    )
    messages = tuple(
        Message(
            "warning",
            "measurement-null",
            f"{name!r} cannot be measured: {why}.",
            measurements=(name,),
            several=MessagePlural("{count} measurements have no value", repr(name), why),
        )
        for name, why in measured.why_not
    )
    return results, messages


def compute_profiles(
    adjustment: Adjustment, requests: tuple[MeasurementRequest, ...]
) -> ProfileResults:
    """Compute all requested profiles, except those without a direction or with a point unseen."""
    names: list[str] = []
    labels: list[str] = []
    tables = [np.zeros((0, 2, len(COLUMNS)))]
    for request in requests:
        label = adjustment.label_rows(request.points)
        if request.kind != "profile" or label.min() < 0:
            continue
        table = _profile(adjustment, label)
        if np.isfinite(table).all():
            names += [request.name] * len(label)
            labels += request.points
            tables.append(table)
    rows = np.concatenate(tables)
    return ProfileResults(
        profile=tuple(names), label=tuple(labels), place_m=rows[:, 0], sigma_m=rows[:, 1]
    )


def _profile(adjustment: Adjustment, label: Ints) -> Floats:
    """Compute places (n, 2, 4) along a profile, and their sigmas; NaN without a direction."""
    world, jacobian, columns = adjustment.points_with_jacobian(label)
    feet, of_feet, foot_columns = adjustment.ground_with_jacobian(label)
    below = find_ground_below(adjustment.survey, label, world, feet)
    of_feet = np.where(below.is_determined[:, None, None], jacobian, of_feet)
    foot_columns = np.where(below.is_determined[:, None], columns, foot_columns)
    along = profile(world)
    n = len(label)
    # Ground height relative to the first point.
    ground = below.feet[:, 2] - world[0, 2]
    by_points = np.zeros((n, 4, n, 3))
    by_points[:, :3] = along.gradient
    by_points[:, 3, 0, 2] = -1.0
    by_feet = np.zeros((n, 4, n, 3))
    by_feet[np.arange(n), 3, np.arange(n), 2] = 1.0
    # Gradients by all unknowns, through the points and through the ground below them.
    unknowns = np.unique(np.concatenate([columns, foot_columns]))
    gradient = np.einsum("apni,niu->apu", by_points, _dense(jacobian, columns, unknowns))
    gradient += np.einsum("apni,niu->apu", by_feet, _dense(of_feet, foot_columns, unknowns))
    joint = adjustment.minimum.factor.joint(unknowns)
    variance = np.einsum("apu,uv,apv->ap", gradient, joint, gradient, optimize=True)
    variance[:, 3] += below.sigma_m**2
    value = np.column_stack([along.value, ground])
    return np.stack([value, np.sqrt(np.maximum(variance, 0.0))], axis=1)


def _dense(jacobian: Floats, columns: Ints, unknowns: Ints) -> Floats:
    """Expand Jacobians to all of the unknowns (u,), (n, 3, u)."""
    dense = np.zeros((*jacobian.shape[:2], len(unknowns)))
    place = np.searchsorted(unknowns, columns)
    rows = np.arange(len(jacobian))[:, None, None]
    np.add.at(dense, (rows, np.arange(3)[:, None], place[:, None, :]), jacobian)
    return dense


MAX_SIGMA_DIFFERENCE = 0.1
"""Relative difference of second- and first-order sigma above which first order is insufficient."""

MAX_BIAS_SIGMAS = 0.5
"""Second-order bias, in sigmas, above which first order is insufficient: a 95 % interval about the
value then holds the truth in 92 % of cases."""


def check_second_order(
    adjustment: Adjustment,
    measured: MeasuredValues,
    results: MeasurementResults,
    frames: Frames,
) -> tuple[SecondOrder | None, tuple[Message, ...]]:
    """Compare second-order with first-order bias and sigma; None where nothing was measured.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    measured, results
        The measurements, and their first-order results.
    frames
        Frames as for the measurements.
    """
    if not measured.rows:
        return None, ()
    terms = compute_curvature(adjustment, measured, frames)
    computed = np.isfinite(results.value) & (results.sigma > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = terms.sigma / results.sigma
        shift = terms.bias / results.sigma
    within = (np.abs(ratio - 1.0) <= MAX_SIGMA_DIFFERENCE) & (np.abs(shift) <= MAX_BIAS_SIGMAS)
    off = computed & ~within
    found = SecondOrder(bias=terms.bias, sigma=terms.sigma, curvature=terms.curvature, off=off)
    where = np.flatnonzero(off).tolist()
    return found, tuple(_message(results, terms.bias[i], terms.sigma[i], i) for i in where)


def describe_approximation(stated: float, sigma: float, bias: float, unit: str) -> str:
    """Describe how far a sigma and a value are off, as the adjustment is not linear.

    Parameters
    ----------
    stated
        Sigma of the linear model.
    sigma, bias
        Sigma and mean error to second order.
    unit
        Unit of all three.
    """
    if not np.isfinite(sigma):
        return "with readings that are slightly different there is no solution"
    side = "large" if bias > 0 else "small"
    value = f"the value tends to be {format_digits(abs(bias))} {unit} too {side}"
    better, ordinary = format_digits(sigma), format_digits(stated)
    if better == ordinary:
        return value
    return f"± {better} {unit} is more realistic than ± {ordinary} {unit}, and {value}"


def _message(results: MeasurementResults, bias: float, sigma: float, i: int) -> Message:
    unit = results.unit[i]
    why = describe_approximation(results.sigma[i], sigma, bias, unit)
    text = (
        f"The ± of {results.name[i]!r} is approximate, as the survey is weak: {why}. Tape more "
        "lengths."
    )
    several = MessagePlural(
        "The ± of {count} measurements are approximate, as the survey is weak",
        repr(results.name[i]),
        why,
        "Tape more lengths.",
    )
    return Message(
        "warning",
        "first-order-doubtful",
        text,
        measurements=(results.name[i],),
        several=several,
    )


CONFIRMED_SIGMAS = 1.96
"""Difference of two scales, in sigmas, up to which they confirm each other (95 %)."""

SAME_SIGMAS = 1.0
"""Difference, in sigmas, up to which values of two other solutions count as one value."""


LEAST_PROBABILITY = 0.025
"""Probability of another explanation below which a 95 % interval need not contain its value."""


def add_alternatives(
    measurements: MeasurementResults,
    values: Sequence[Sequence[float]],
    probability: Sequence[float],
) -> MeasurementResults:
    """Include other explanations of the observations in values, sigmas and intervals.

    Parameters
    ----------
    measurements
        M measurements of the result.
    values
        The M values under each of K other explanations; NaN where it has none.
    probability
        (K,) their probabilities; those of explanations that exclude each other add up to less than
        one, the rest is that of the result.

    Returns
    -------
    MeasurementResults
        With `alternative_values` outside the intervals, ascending, those within `SAME_SIGMAS` of
        each other once. Sigmas, correlations and intervals contain the explanations that have at
        least `LEAST_PROBABILITY`.

    Notes
    -----
    Model averaging about the value of the result: with probabilities p_k and differences d_k, the
    covariance is C + sum p_k d_k d_k^T (law of total variance; Hoeting, Madigan, Raftery, Volinsky
    1999, "Bayesian model averaging").
    """
    table = np.array([list(other) for other in values], dtype=np.float64)
    table = table.reshape(len(values), len(measurements.name))
    low, high = measurements.interval_95.T
    outside = (table < low) | (table > high)  # False for NaN, without an interval
    alternative_values = tuple(
        _distinct(np.sort(column[there]), SAME_SIGMAS * sigma)
        for column, there, sigma in zip(table.T, outside.T, measurements.sigma, strict=True)
    )
    likely = outside & (np.asarray(probability) >= LEAST_PROBABILITY)[:, None]
    if not likely.any():
        return replace(measurements, alternative_values=alternative_values)
    away = np.where(likely, table - measurements.value, 0.0)
    covariance = measurements.correlation * np.outer(measurements.sigma, measurements.sigma)
    spread = np.einsum("k,ki,kj->ij", probability, away, away)
    covariance += spread
    sigma = np.sqrt(measurements.sigma**2 + np.diag(spread))
    with np.errstate(divide="ignore", invalid="ignore"):  # of values that are exact
        correlation = covariance / np.outer(sigma, sigma)
    return replace(
        measurements,
        alternative_values=alternative_values,
        sigma=sigma,
        sigma_stated=np.sqrt(measurements.sigma_stated**2 + np.diag(spread)),
        correlation=correlation,
        # Each explanation has an interval of the same width about its value.
        interval_95=np.column_stack(
            [low + np.minimum(away.min(axis=0), 0.0), high + np.maximum(away.max(axis=0), 0.0)]
        ),
    )


def _distinct(ascending: Floats, reach: float) -> tuple[float, ...]:
    """Keep values farther than `reach` from the last kept one before them."""
    kept: list[float] = []
    for value in ascending.tolist():
        if not kept or value - kept[-1] > reach:
            kept.append(value)
    return tuple(kept)


def describe_scale_basis(adjustment: Adjustment) -> tuple[Message, ...]:
    """Report the source of the scale, and its confirmation by other observations."""
    found = compute_scale_sigmas(adjustment)
    witnesses = _witnesses(adjustment)
    rest = " and ".join([", ".join(witnesses[:-1])] * (len(witnesses) > 1) + witnesses[-1:])
    verb = "confirm" if len(witnesses) > 1 or rest.endswith("s") else "confirms"
    if not np.isfinite(found.lengths):
        alone = "alone" if len(witnesses) == 1 else "together, without a length"
        text = f"The scale rests on {rest} {alone}: ± {_percent(found.all)} %."
        return (Message("info", "scale-basis", text),)
    own = f"your lengths (± {_percent(found.lengths)} %)"
    if not found.others < MAX_RELATIVE_SIGMA:
        text = (
            f"The scale rests on {own}; nothing else confirms it: a tape that is 1 % wrong makes "
            "every result 1 % wrong, and nothing shows it."
        )
    elif abs(found.excess) > CONFIRMED_SIGMAS * np.hypot(found.others, found.lengths):
        than = "less" if found.excess > 0 else "more"
        text = (
            f"The scale rests on {own}; {rest} {'show' if verb == 'confirm' else 'shows'} "
            f"{_percent(abs(found.excess))} ± {_percent(found.others)} % {than} for all lengths. "
            "Compare the tape with another one."
        )
    elif found.others < found.lengths:
        text = f"The scale rests on {rest} (± {_percent(found.others)} %) more than on {own}."
    else:
        text = f"The scale rests on {own}; {rest} {verb} it to ± {_percent(found.others)} %."
    return (Message("info", "scale-basis", text),)


def _witnesses(adjustment: Adjustment) -> list[str]:
    """Name the other observations that may confirm the scale."""
    observations = reversed(adjustment.problem.observations.values())
    names = [name for observation in observations for name in observation.witness()]
    return names or ["the stated heights"]


def _percent(share: float) -> str:
    """Format a share in per cent, with two digits."""
    return f"{format_digits(100.0 * share)}" if share < 1.0 else "100 or more"


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
