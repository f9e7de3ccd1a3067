"""Check points: result minus known coordinates."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.coordinate_faults import displaced, likely_fault
from uavgram.estimation.reliability.redundancy import upper_tail
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, Several
from uavgram.model.result.tables import PointChecks
from uavgram.model.survey.observations import KnownWorldPoints

FEW = 3
"""Check points from which on most of them being off is one fault and not several."""


def judge_points(
    adjustment: Adjustment, known: KnownWorldPoints, significance: float
) -> tuple[PointChecks, tuple[Message, ...]]:
    """Result minus known coordinates of check points; those far off, or never picked, are named.

    Nothing is judged with gauge ``plane``: coordinates mean nothing there.
    """
    index = np.array([adjustment.label_index(p) for p in known.label], dtype=np.int64)
    if adjustment.survey.gauge == "plane":
        index = index[:0]
    seen = np.flatnonzero(index >= 0)
    position, covariance = adjustment.points()
    error = position[index[seen]] - known.world_m[seen]
    joint = covariance[index[seen]] + known.sigma_m[seen][:, :, None] ** 2 * np.eye(3)
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(joint, error[..., None])[..., 0])
    checks = PointChecks(
        label=tuple(known.label[i] for i in seen),
        error_m=error,
        sigma_m=np.sqrt(np.einsum("nii->ni", joint)),
        mahalanobis=np.sqrt(squared),
    )
    messages = [
        Message(
            "warning",
            "check-unseen",
            f"The check point {known.label[i]!r} has no usable pick.",
            labels=(known.label[i],),
            several=Several("{count} check points have no usable pick", repr(known.label[i])),
        )
        for i in np.flatnonzero(index < 0)
    ]
    if adjustment.minimum.converged:
        off = [upper_tail(float(each), 3) < significance for each in squared]
        messages += _suspects(checks, np.flatnonzero(off))
    return checks, tuple(messages)


def _suspects(checks: PointChecks, off: Ints) -> list[Message]:
    """A message on each check point that is off; one on all, where most of several are."""
    if len(off) < FEW or 2 * len(off) <= len(checks.label):
        return [_off(checks, int(i)) for i in off]
    middle, sigma = (np.median(each[off], axis=0) for each in (-checks.error_m, checks.sigma_m))
    text = (
        f"{len(off)} of {len(checks.label)} check points are off, the median "
        f"{displaced(middle, sigma)}: look at what they have in common, the datum of their "
        f"heights, their coordinate system{likely_fault(middle)} and the origin."
    )
    labels = tuple(checks.label[i] for i in off)
    return [Message("warning", "check-suspect", text, labels=labels)]


def _off(checks: PointChecks, i: int) -> Message:
    off = -checks.error_m[i]
    label, where = checks.label[i], displaced(off, checks.sigma_m[i])
    several = Several(
        "{count} check points are off",
        f"{label!r} is {where}{likely_fault(off)}",
        ending="Look at their coordinates and their picks.",
    )
    text = (
        f"The check point {label!r} is {where}: look at its coordinates{likely_fault(off)} and its "
        "picks."
    )
    return Message("warning", "check-suspect", text, labels=(label,), several=several)
