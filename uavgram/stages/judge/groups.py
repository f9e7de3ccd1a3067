"""Variance factors of the groups of observations."""

from __future__ import annotations

from uavgram.estimation.adjustment import Adjustment
from uavgram.estimation.reliability import group_fit
from uavgram.model.message import Message
from uavgram.model.result import GroupFactor

GROUP_WORDS = {
    "pixels": "picks (their sigmas, or a wrong label)",
    "lengths": "known lengths (their sigmas, or a wrong reading)",
    "control": "control points (their sigmas, or a wrong label)",
    "telemetry": "telemetry (its sigmas, the gimbal or the times)",
    "calibration": "calibration of the camera (its sigmas, or another focus or resolution)",
}


def judge_groups(
    adjustment: Adjustment, significance: float, *, explained: bool = False
) -> tuple[tuple[GroupFactor, ...], tuple[Message, ...]]:
    """Variance factor of each group of observations; a message on each that is too large.

    No message where one observation explains them all (`explained`), which is named as such, nor
    where the adjustment did not come to rest.
    """
    silent = explained or not adjustment.minimum.converged
    groups, messages = [], []
    for name, block in adjustment.minimum.blocks.items():
        if name == "gauge":
            continue
        fit = group_fit(block, adjustment.minimum.factor, adjustment.covariance)
        groups.append(GroupFactor(name=name, observations=block.residual.size, **fit._asdict()))
        if fit.probability < significance and name in GROUP_WORDS and not silent:
            text = (
                f"The {GROUP_WORDS[name]} fit worse than stated: variance factor "
                f"{fit.variance_factor:.1f}, probability {fit.probability:.1g}. The uncertainties "
                "of the results are too small until this is cleared up."
            )
            messages.append(Message("warning", "group-misfit", text))
    return tuple(groups), tuple(messages)
