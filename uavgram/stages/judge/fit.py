"""Test whether picks, lengths, ground and camera fit together.

Priors of the telemetry are meant to be generous: they are left out, as they would weaken the test.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import ndtr

from uavgram.estimation.reliability.redundancy import core_fit, upper_tail
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.message import Message
from uavgram.model.result.known import KnownResults
from uavgram.model.result.reliability import ChecksOverall
from uavgram.model.result.tables import LineResults, PointChecks

RARE = 0.001
"""Probability by chance below which observations do not fit."""

CONTRADICTED = 1e-5
"""Probability by chance below which the observations contradict each other: of 500 surveys without
errors, at most one in 200 such sets should have one."""

MOST_ALONE = 2
"""Number of withheld things up to which one that does not fit is no less reliable than the
others."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Quality of the fit, as probabilities by chance of misfits as large.

    Attributes
    ----------
    core
        Probability for picks, lengths, ground and camera, with the learnt sigmas.
    stated
        The same with sigmas and ground as they were stated.
    checks
        Smallest probability of each withheld thing by itself and of all together; 1 without any.
        One that alone does not fit beside others that do is wrong itself, and does not count.
    check_labels
        Labels of the withheld things that are contradicted.
    """

    core: float = 1.0
    stated: float = 1.0
    checks: float = 1.0
    check_labels: frozenset[str] = frozenset()


def fit_of(
    refined: Refined,
    lines: LineResults,
    known: KnownResults,
    points: PointChecks,
    overall: ChecksOverall | None,
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
    """
    checks = [
        (2.0 * float(ndtr(-abs(w))), ends)
        for w, status, *ends in zip(lines.w, lines.status, lines.start, lines.end, strict=True)
        if status == "checked"
    ]
    checks += [
        (2.0 * float(ndtr(-abs(w))), list(labels))
        for w, status, labels in zip(known.w, known.status, known.points, strict=True)
        if status == "checked"
    ]
    checks += [
        (upper_tail(float(size) ** 2, 3), [label])
        for size, label in zip(points.mahalanobis, points.label, strict=True)
    ]
    together = [] if overall is None else [overall.probability]
    each = sorted(probability for probability, _ in checks)
    if len(each) > MOST_ALONE and each[0] < RARE <= each[1]:
        together, each = [], each[1:]
    contradicted = [labels for probability, labels in checks if probability < CONTRADICTED]
    return Fit(
        core=core_fit(refined.adjustment).probability,
        stated=core_fit(refined.stated or refined.adjustment).probability,
        checks=min([1.0, *together, *each]),
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
    core = max(fit.core, core_fit(rest).probability)
    if core >= RARE or not rest.minimum.converged:
        return ()
    contradicted = core < CONTRADICTED
    what = "contradict each other" if contradicted else "do not fit together as they should"
    verb = "use" if contradicted else "rely on"
    why = ", and no single cause explains it all"
    look = (
        "look at what the other messages name, at the labels, the unit of the lengths, the camera "
        "file and whether the ground is plane"
    )
    text = (
        f"Picks, lengths and ground {what}{why}. Do not {verb} the numbers before it is cleared "
        f"up: {look} (probability by chance {core:.1g})."
    )
    return (Message("warning", "misfit", text),)
