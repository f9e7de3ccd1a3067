"""Tests of the fit: picks, lengths, ground and camera; variance factors; majority of known things.

Priors of the telemetry are meant to be generous: they are left out, as they would weaken the test.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from uavgram.estimation.reliability.redundancy import (
    GROSS_SIGMAS,
    compute_core_fit,
    compute_group_fit,
    compute_upper_tail,
    limit_gross_errors,
)
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Kind
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_digits, format_odds, join_names
from uavgram.model.result.reliability import ChecksOverall
from uavgram.model.result.result import GroupFactor
from uavgram.model.result.tables import KnownResults, LineResults, PointChecks
from uavgram.model.survey import Survey
from uavgram.stages.judge.length_faults import find_length_faults

MISFIT_PROBABILITY = 0.001
"""Probability by chance below which observations do not fit."""

CONTRADICTION_PROBABILITY = 1e-5
"""Probability by chance below which the observations contradict each other: of 500 surveys without
errors, at most one in 200 such sets should have one."""

MAX_SINGLE_CHECKS = 2
"""Number of withheld things up to which one that does not fit is no less reliable than the
others."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Quality of the fit, as probabilities by chance of misfits as large.

    Attributes
    ----------
    core
        Probability for picks, lengths, ground and camera, with the learnt sigmas; with the stated
        ones where the learnt noise of the picks is as large as gross errors.
    stated
        The same with sigmas and ground as they were stated.
    checks
        Smallest probability of each withheld thing by itself and of all together; 1 without any.
        One that alone does not fit beside others that do is wrong itself, and does not count.
    is_check_alone
        Whether all but one of them fit: that one may be wrong itself.
    check_labels
        Labels of the withheld things that are contradicted.
    """

    core: float = 1.0
    stated: float = 1.0
    checks: float = 1.0
    is_check_alone: bool = False
    check_labels: frozenset[str] = frozenset()


def compute_fit(
    refined: Refined,
    lines: LineResults,
    known: KnownResults,
    points: PointChecks,
    overall: ChecksOverall | None,
    *,
    given: Survey,
) -> Fit:
    """Compute the fit of the core, and of withheld things.

    Parameters
    ----------
    refined
        The adjusted survey. Its result gives little weight to an observation that is a located
        outlier; left-out observations take no part.
    lines, known, points
        Tables, of which the withheld rows are judged.
    overall
        Withheld lengths and points together; None where there are none.
    given
        The survey with all observations. Withheld things do not count where all others of their
        kind were left out: they share the fault that is reported of those.
    """
    is_without_lengths = "removed" in lines.status and "used" not in lines.status
    is_without_control = (
        len(given.control_label) > 0 == len(refined.adjustment.survey.control_label)
    )
    checks = [
        (2.0 * float(ndtr(-abs(w))), ends)
        for w, status, *ends in zip(lines.w, lines.status, lines.start, lines.end, strict=True)
        if status == "checked" and not is_without_lengths
    ]
    checks += [
        (2.0 * float(ndtr(-abs(w))), list(labels))
        for w, status, labels in zip(known.w, known.status, known.points, strict=True)
        if status == "checked"
    ]
    checks += [
        (compute_upper_tail(float(size) ** 2, 3), [label])
        for size, label in zip(points.mahalanobis, points.label, strict=True)
        if not is_without_control
    ]
    has_all = not (is_without_lengths or is_without_control)
    together = [overall.probability] if overall is not None and has_all else []
    each = sorted(probability for probability, _ in checks)
    if len(each) > MAX_SINGLE_CHECKS and each[0] < MISFIT_PROBABILITY <= each[1]:
        together, each = [], each[1:]
    is_alone = len(each) > 0 and all(one >= MISFIT_PROBABILITY for one in each[1:])
    contradicted = [
        labels for probability, labels in checks if probability < CONTRADICTION_PROBABILITY
    ]
    core, stated = (
        compute_core_fit(one or refined.adjustment).probability
        for one in (refined.adjustment, refined.stated)
    )
    noise = () if refined.noise is None else refined.noise.picks
    is_gross = any(one.factor > GROSS_SIGMAS for one in noise if one.source in ("hand", "target"))
    return Fit(
        core=min(core, stated) if is_gross else core,
        stated=stated,
        checks=min([1.0, *together, *each]),
        is_check_alone=is_alone,
        check_labels=frozenset(label for labels in contradicted for label in labels),
    )


def judge_fit(fit: Fit, rest: Adjustment) -> tuple[Message, ...]:
    """Report a misfit of the core, for adjustments that converged.

    Parameters
    ----------
    fit
        Quality of the fit.
    rest
        The survey adjusted without its suspects, which explain their own misfit.
    """
    core = max(fit.core, compute_core_fit(rest).probability)
    if core >= MISFIT_PROBABILITY or not rest.minimum.converged:
        return ()
    contradicted = core < CONTRADICTION_PROBABILITY
    what = "contradict each other" if contradicted else "do not fit together as they should"
    verb = "use" if contradicted else "rely on"
    why = ", and no single cause explains it all"
    look = (
        "check the observations that the other messages name, the labels, the unit of the lengths, "
        "the camera and whether the ground is plane"
    )
    text = (
        f"Picks, lengths and ground {what}{why}. Do not {verb} the numbers before it is cleared "
        f"up: {look} (chance alone does this {format_odds(core)} times)."
    )
    return (Message("warning", "misfit", text),)


MIN_VARIANCE_FACTOR = 0.4
"""Variance factor below which stated sigmas are far too wide; those of priors are meant to be
generous, and surveys without errors are above it."""


def judge_groups(
    adjustment: Adjustment, significance: float, suspected: Collection[str] = ()
) -> tuple[tuple[GroupFactor, ...], tuple[Message, ...]]:
    """Compute the variance factor of each group of observations, and report misfits.

    A message on each factor that is too large, and one where that of the whole survey is far too
    small. No message where the adjustment did not converge.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    significance
        Probability of a false suspicion in a survey without errors.
    suspected
        Groups with an observation that another message names.
    """
    groups = _compute_factors(adjustment)
    messages: list[Message] = []
    if adjustment.minimum.converged:
        misfits = _select_misfits(groups, significance)
        messages += [
            _report_misfit(
                get_kind(one.name),
                adjustment.problem.observations[one.name].check(),
                one.variance_factor,
                one.probability,
            )
            for one in misfits
            if one.name not in suspected
        ]
        messages += _report_wide_sigmas(adjustment, groups, significance)
    return tuple(groups), tuple(messages)


def find_misfit_groups(adjustment: Adjustment, significance: float) -> list[GroupFactor]:
    """Find the groups of observations whose variance factor is too large."""
    return _select_misfits(_compute_factors(adjustment), significance)


def _select_misfits(groups: Sequence[GroupFactor], significance: float) -> list[GroupFactor]:
    """Select the groups whose variance factor is too large, and that a message can advise on."""
    return [one for one in groups if one.probability < significance and get_kind(one.name).check]


def _compute_factors(adjustment: Adjustment) -> list[GroupFactor]:
    """Compute the variance factor of each group of observations that is judged."""
    groups = []
    for name, block in adjustment.minimum.blocks.items():
        kind = get_kind(name)
        if kind.role != "construction" or kind.is_judged:
            fit = compute_group_fit(block, adjustment.minimum.factor, adjustment.covariance)
            groups.append(GroupFactor(name=name, observations=block.residual.size, **fit._asdict()))
    return groups


def _report_misfit(kind: Kind, cause: str, factor: float, probability: float) -> Message:
    what = kind.plural
    how = (
        f"their errors are {format_digits(factor**0.5)} times as large as stated; chance alone "
        f"does this {format_odds(probability)} times"
    )
    until = "Until this is cleared up, the uncertainties of the results are too small"
    return Message(
        "warning",
        "group-misfit",
        f"The {what} do not fit as well as their stated errors promise: look at {cause}. {until} "
        f"({how}).",
        several=MessagePlural(
            "{count} kinds of observations do not fit as well as their stated errors promise",
            f"{what}: look at {cause} ({how})",
            ending=f"{until}.",
        ),
    )


def _report_wide_sigmas(
    adjustment: Adjustment, groups: list[GroupFactor], significance: float
) -> Iterator[Message]:
    """Report a fit that is far better than the stated sigmas."""
    cost = adjustment.minimum.cost
    degrees = adjustment.degrees_of_freedom
    if degrees <= 0 or cost > MIN_VARIANCE_FACTOR * degrees:
        return
    if compute_upper_tail(cost, degrees) < 1.0 - significance:
        return
    wide = [
        g
        for g in groups
        if g.variance_factor < MIN_VARIANCE_FACTOR and g.probability > 1.0 - significance
    ]
    named = sorted(wide, key=lambda g: -g.redundancy)
    which = ", ".join(
        f"{get_kind(g.name).plural or g.name.replace('_', ' ')} "
        f"{format_digits(g.variance_factor**0.5)}"
        for g in named
    )
    text = (
        "Everything fits far better than the stated errors promise, so the stated errors may be "
        "too large, and the uncertainties of the results rather too large than too small. No "
        "action is needed. The errors are "
        f"{format_digits((cost / degrees) ** 0.5)} "
        "times the stated ones" + (f" ({which})." if which else ".")
    )
    yield Message("info", "sigmas-too-wide", text)


def judge_majority(
    refined: Refined, line_index: Ints, lines: LineResults, known: KnownResults
) -> tuple[Message, ...]:
    """Report lengths and known things where those that fit may be the wrong ones.

    Parameters
    ----------
    refined
        The adjusted survey, its removals, and the causes of its misfits.
    line_index
        (L,) row of each length in the survey given to refine; -1 where it is not in it.
    lines, known
        Tables with their statuses.
    """
    out = {(one.kind, one.index) for one in refined.removals}
    line_out = [("line", int(k)) in out for k in line_index]
    known_out = [("known", i) in out for i in range(len(known.name))]
    faults = _faults(refined, lines, line_out)
    for i, name in enumerate(known.name):
        if known_out[i] or known.status[i] == "suspect":
            faults[name] = ("known", i)
    used = (*lines.status, *known.status).count("used")
    count = len(faults) + used
    if len(set(faults.values())) <= limit_gross_errors(count):
        return ()
    text = (
        f"{len(faults)} of {count} known lengths and things do not fit the others. These are too "
        "many to be the exception: those that do fit may be the wrong ones, so do not use these "
        "numbers. Look for a common cause, such as a tape, a unit or a label: "
        f"{join_names(map(repr, faults))}."
    )
    return (Message("warning", "many-suspects", text),)


def _faults(refined: Refined, lines: LineResults, out: Sequence[bool]) -> dict[str, object]:
    """Return the fault of each length that does not fit: a cause, or one of its own.

    Several lengths in another unit, or that end at one wrong point, have one fault.
    """
    causes = {name: ("cause", k) for k, one in enumerate(refined.causes) for name in one.settles}
    wrong = [i for i, status in enumerate(lines.status) if out[i] or status == "suspect"]
    seen = {i: (lines.adjusted_m[i], lines.adjusted_sigma_m[i]) for i in wrong}
    fitting = np.flatnonzero([status == "used" for status in lines.status])
    faults = find_length_faults(lines, seen, fitting)
    return {lines.name[i]: causes.get(lines.name[i]) or fault for i, fault in faults.items()}
