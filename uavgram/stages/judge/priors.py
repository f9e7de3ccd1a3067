"""Fit of every prior, and the effect of an undetected error in it.

Also, for each measurement, the undetected error that would move it most.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.redundancy import TestedGroup
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Member
from uavgram.model.arrays import Floats
from uavgram.model.result.reliability import PriorResults, WeakestLinks
from uavgram.stages.judge.tested_survey import TestedSurvey, describe_effects


def judge_priors(examined: TestedSurvey) -> PriorResults:
    """Compute residual, w, redundancy, detectable bias and its effect for each axis of each prior.

    Telemetry by frame and axis, mount, biases, clock, ground, calibration and control points.
    """
    parts = [
        _group(examined, kind, group)
        for kind, group in examined.groups.items()
        if not get_kind(kind).has_table
    ]
    members = [m for part in parts for m in part[0]]
    residual, w, redundancy, bias, change, on = (
        np.concatenate([part[k] for part in parts]) for k in range(1, 7)
    )
    units = [examined.names.unit(m) for m in members]
    names = examined.names
    return PriorResults(
        kind=tuple(m.kind for m in members),
        name=tuple(names.axis(m) for m in members),
        frame_id=tuple("".join(names.subjects(m).get("frames", ())) for m in members),
        unit=tuple(unit for unit, _ in units),
        residual=residual,
        w=w,
        redundancy=redundancy,
        bias=bias * np.array([factor for _, factor in units]),
        effects=describe_effects(examined.measured, on.astype(np.int64), change),
    )


def _group(
    examined: TestedSurvey, kind: str, group: TestedGroup
) -> tuple[list[Member], *tuple[Floats, ...]]:
    """Return members, then residual, w, redundancy, bias, change and measurement of each axis."""
    n, a = group.w.shape
    members = [Member(kind, row, axis) for row in range(n) for axis in range(a)]
    worst = examined.worst[kind]
    columns = (
        compute_prior_residuals(group),
        group.w,
        group.redundancy,
        group.bias(examined.significance),
        worst.change,
        worst.measurement,
    )
    return members, *(np.asarray(column, dtype=np.float64).ravel() for column in columns)


def compute_prior_residuals(group: TestedGroup) -> Floats:
    """Compute adjusted minus stated (n, a), in stated sigmas; 0 for exactly known numbers."""
    scale = np.where(np.isfinite(group.scale), group.scale, np.inf)
    whitening = group.direction / scale[:, None, :]
    root = np.linalg.pinv(whitening)  # (n, a, r): root root^T is the stated covariance
    sigma = np.linalg.norm(root, axis=2)
    residual = np.einsum("nar,nr->na", root, group.block.residual)
    return np.asarray(np.where(sigma > 0, residual / np.where(sigma > 0, sigma, 1.0), 0.0))


def judge_weakest(examined: TestedSurvey) -> WeakestLinks:
    """Return the weakest link of each of M measurements, and its unchecked observations."""
    names, what, units = examined.names, [], []
    bias = np.full(len(examined.weakest), np.nan)
    for i, weakest in enumerate(examined.weakest):
        if weakest.member is None:
            what.append("")
            units.append("")
        else:
            what.append(names.observation(weakest.member))
            bias[i], unit = examined.bias(weakest.member)
            units.append(unit)
    return WeakestLinks(
        what=tuple(what),
        bias=bias,
        unit=tuple(units),
        change=np.array([weakest.change for weakest in examined.weakest]),
        unchecked=tuple(
            tuple(names.observation(m) for m in weakest.unchecked) for weakest in examined.weakest
        ),
    )
