"""Trust in each measurement: contradicted, affected by a fault, or not checked."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from uavgram.estimation.reliability.redundancy import MIN_REDUNDANCY, TestedGroup
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Member
from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.reliability import MeasurementStatus
from uavgram.model.result.tables import MeasurementResults
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.judge.unchecked import is_unchecked

DOUBTFUL_SIGMAS = 1.0
"""Change of a measurement by a possible error, in its sigmas, above which it is doubtful."""


def is_moved(examined: TestedSurvey) -> Bools:
    """Mark measurements (M,) that a suspected observation, or its rivals, would move if wrong.

    The change is that of the result, in which outliers have little weight.
    """
    measured = examined.measured
    sigma = np.where(measured.sigma > 0, measured.sigma, np.inf)
    moved = np.zeros(len(sigma), dtype=np.bool_)
    members = [
        member for one in examined.suspicions for member in (one.suspect, *one.group, *one.rivals)
    ]
    if not members or not len(sigma):
        return moved
    for member in members:
        change = _change_without(examined.groups[member.kind], member, measured.solved)
        moved |= np.abs(change) > DOUBTFUL_SIGMAS * sigma
    return moved


def is_displaced(examined: TestedSurvey) -> bool:
    """Return whether log and control or known lines are shifted against each other.

    Nothing shows which of the two is at the right place.
    """
    suspects = (member.kind for one in examined.suspicions for member in (one.suspect, *one.group))
    return "position_bias" in suspects


def find_unconfirmed_ends(examined: TestedSurvey) -> set[str]:
    """Find labels at the ends of left-out lengths that no other reading confirms.

    Where a length does not fit, its reading may be right and the label of an end wrong. Another
    length, a known thing or a control point that fits shows that the label is right.
    """
    adjusted, settled = examined.adjustment.survey, examined.refined.settled
    used = np.zeros(len(adjusted.line_start), dtype=np.bool_)
    used[examined.adjustment.problem.line_index] = True
    explained = np.isin(adjusted.line_name or [""] * len(used), sorted(settled))
    ends = np.stack([adjusted.line_start, adjusted.line_end])
    confirmed = {*ends[:, used].ravel().tolist(), *adjusted.control_label.tolist()}
    confirmed |= {label for thing in examined.adjustment.problem.known for label in thing.label}
    unconfirmed = {*ends[:, ~used & ~explained].ravel().tolist()} - confirmed
    return {adjusted.label[k] for k in unconfirmed}


def _change_without(group: TestedGroup, member: Member, solved: Floats) -> Floats:
    """Compute changes (M,) of the values if the estimated error of an observation is removed.

    The likeliest error of an axis is w / sqrt(r) of its sigmas (Baarda 1968).
    """
    row = member.row
    axes = slice(None) if get_kind(member.kind).is_joint else slice(member.axis, member.axis + 1)
    redundancy = group.redundancy[row, axes]
    root = np.sqrt(np.where(redundancy > MIN_REDUNDANCY, redundancy, np.inf))
    response = np.einsum("rk,km->rm", group.block.jacobian[row], solved[group.block.columns[row]])
    by_unit = np.einsum("ra,rm->am", group.direction[row][:, axes], response)
    return np.asarray((group.w[row, axes] / root) @ by_unit)


def determine_statuses(
    table: MeasurementResults,
    examined: TestedSurvey,
    *,
    is_contradicted: bool,
    contradicted: Collection[str],
    in_doubt: Collection[str],
    is_displaced: bool,
) -> tuple[MeasurementStatus, ...]:
    """Determine the status of each measurement.

    Parameters
    ----------
    table
        The M measurements.
    examined
        The survey under test.
    is_contradicted
        Whether the whole result is contradicted, so that no measurement is in order.
    contradicted, in_doubt
        Labels whose measurements are contradicted, or depend on observations that do not fit.
    is_displaced
        Whether it is in doubt where the whole survey is, so that coordinates are doubtful.
    """
    displaced = [is_displaced and kind == "coordinate" for kind in table.kind]
    unchecked, moved = is_unchecked(examined), is_moved(examined) | np.array(displaced, np.bool_)
    found: list[MeasurementStatus] = []
    for i, points in enumerate(table.points):
        if not np.isfinite(table.value[i]):
            found.append("not-checked")
        elif is_contradicted or any(label in contradicted for label in points):
            found.append("contradicted")
        elif moved[i] or table.is_ambiguous[i] or any(label in in_doubt for label in points):
            found.append("doubtful")
        else:
            found.append("not-checked" if unchecked[i] else "ok")
    return tuple(found)
