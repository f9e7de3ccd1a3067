"""Variance factors of the groups of observations."""

from __future__ import annotations

from collections.abc import Iterator

from uavgram.estimation.reliability.redundancy import group_fit, upper_tail
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import kind_of
from uavgram.estimation.survey.observations.observation import Kind
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import figures
from uavgram.model.result.result import GroupFactor

WIDE = 0.4
"""Variance factor below which stated sigmas are far too wide; those of priors are meant to be
generous, and surveys without errors are above it."""


def judge_groups(
    adjustment: Adjustment, significance: float
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
    """
    silent = not adjustment.minimum.converged
    groups, messages = [], []
    for name, block in adjustment.minimum.blocks.items():
        kind = kind_of(name)
        if kind.role == "construction" and not kind.is_judged:
            continue
        fit = group_fit(block, adjustment.minimum.factor, adjustment.covariance)
        groups.append(GroupFactor(name=name, observations=block.residual.size, **fit._asdict()))
        if fit.probability < significance and kind.check and not silent:
            messages.append(_misfit(kind, fit.variance_factor, fit.probability))
    if adjustment.minimum.converged:
        messages += _too_wide(adjustment, groups, significance)
    return tuple(groups), tuple(messages)


def _misfit(kind: Kind, factor: float, probability: float) -> Message:
    what, cause = kind.plural, kind.check
    how = f"variance factor {factor:.1f}, probability {probability:.1g}"
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


def _too_wide(
    adjustment: Adjustment, groups: list[GroupFactor], significance: float
) -> Iterator[Message]:
    """Report a fit that is far better than the stated sigmas."""
    cost = adjustment.minimum.cost
    degrees = adjustment.degrees_of_freedom
    if degrees <= 0 or cost > WIDE * degrees:
        return
    probability = upper_tail(cost, degrees)
    if probability < 1.0 - significance:
        return
    wide = [g for g in groups if g.variance_factor < WIDE and g.probability > 1.0 - significance]
    named = sorted(wide, key=lambda g: -g.redundancy)
    which = ", ".join(
        f"{kind_of(g.name).plural or g.name.replace('_', ' ')} ({figures(g.variance_factor)})"
        for g in named
    )
    text = (
        "Everything fits far better than stated: the stated errors are far too wide, and so are "
        "the uncertainties of the results. State them as they are: picks_sigma_px, sigma_m of the "
        f"lengths, ground, telemetry (variance factor {figures(cost / degrees)}, probability "
        f"{probability:.7g}" + (f"; by group: {which})." if which else ").")
    )
    yield Message("info", "sigmas-too-wide", text)
