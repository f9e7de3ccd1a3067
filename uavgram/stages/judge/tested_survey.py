"""Test statistics, suspicions and effects for all judgements, computed once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.measuring.scale import MAX_RELATIVE_SIGMA, compute_scale_sigmas
from uavgram.estimation.reliability.data_snooping import MAX_SUSPECTS, find_suspicions
from uavgram.estimation.reliability.external import (
    LargestEffects,
    WeakestObservations,
    compute_external_reliability,
)
from uavgram.estimation.reliability.hypotheses import adjust_without
from uavgram.estimation.reliability.redundancy import (
    TestedGroup,
    compute_cofactors,
    compute_critical_value,
    compute_test_statistics,
)
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.names import ObservationNames
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.reliability import Effects
from uavgram.stages.judge.checks import Withheld
from uavgram.stages.judge.fit import find_misfit_groups

MIN_MOUNT_REDUNDANCY = 0.5
"""Redundancy of the camera's assumed direction above which the photos determine it."""

POSSIBLY_GROSS = (*READINGS, "heights", "telemetry")
"""Kinds of observations that may have gross errors: readings, stated heights, poses of the log."""

CERTAIN_COFACTOR = 1e12
"""Cofactor of a reading without the possibility of a gross error."""


@dataclass(frozen=True, eq=False)
class TestedSurvey:
    """Observations of an adjusted survey under test.

    Attributes
    ----------
    refined
        The adjusted survey.
    groups
        Its observations and priors by group.
    suspicions
        Observations that do not fit, and those inseparable from them; none where the adjustment did
        not converge, since its residuals do not locate the fault.
    worst, weakest
        External reliability, by observation and by measurement.
    names
        Names of the observations.
    measured
        The values that undetected errors would move.
    significance
        Significance level of the test of each single axis of each observation.
    """

    refined: Refined
    groups: dict[str, TestedGroup]
    suspicions: tuple[Suspicion, ...]
    worst: dict[str, LargestEffects]
    weakest: tuple[WeakestObservations, ...]
    names: ObservationNames
    measured: MeasuredValues
    significance: float

    @property
    def adjustment(self) -> Adjustment:
        """The adjusted survey."""
        return self.refined.adjustment

    @cached_property
    def without_suspects(self) -> Adjustment:
        """Adjustment without the suspects: a misfit in it has another reason.

        The adjusted survey itself where nothing is suspected, or too much.
        """
        are_known = len(self.suspicions) < MAX_SUSPECTS
        accused = [one.suspect for one in self.suspicions] if are_known else []
        return adjust_without(self.adjustment, accused)

    def list_suspected_kinds(self) -> frozenset[str]:
        """List the groups of observations that are suspected, or may be wrong instead."""
        each = ((one.suspect, *one.group, *one.rivals) for one in self.suspicions)
        return frozenset(member.kind for members in each for member in members)

    def suspect(self, kind: str) -> Bools:
        """Mark observations (n,) of a group that are suspected, alone or with others."""
        group = self.groups[kind]
        if len(self.suspicions) >= MAX_SUSPECTS:  # the others were not tested separately
            return np.asarray((np.abs(group.w) > group.limit(self.significance)).any(axis=1))
        rows = [
            member.row
            for suspicion in self.suspicions
            for member in (suspicion.suspect, *suspicion.group)
            if member.kind == kind
        ]
        suspect = np.zeros(len(group.w), dtype=bool)
        suspect[np.array(rows, dtype=np.int64)] = True
        return suspect

    def residuals(self, kind: str) -> Floats:
        """Return adjusted minus stated (n, r), of independent numbers, in their unit.

        These are the residuals of the result; the tests use outliers at their full weight.
        """
        return self.adjustment.problem.observations[kind].residuals(self.adjustment.minimum)

    def significant(self, w: float) -> bool:
        """Return whether a test statistic is significant."""
        large = abs(w) > compute_critical_value(self.significance)
        return bool(large and self.adjustment.minimum.converged)

    def effects(self, kind: str, rows: Ints) -> Effects:
        """Return effects of undetected errors in observations of a group; none for rows < 0."""
        measured = self.measured
        change, on = np.full(len(rows), np.nan), np.full(len(rows), -1)
        there = rows >= 0
        if there.any():
            worst, at = self.worst[kind], rows[there]
            axis = worst.sigmas[at].argmax(axis=1)
            change[there], on[there] = worst.change[at, axis], worst.measurement[at, axis]
        return describe_effects(measured, on, change)

    def bias(self, member: Member) -> tuple[float, str]:
        """Return the minimal detectable bias of one axis of an observation, and its unit."""
        bias = self.groups[member.kind].bias(self.significance)[member.row, member.axis]
        unit, factor = self.names.unit(member)
        return float(bias) * factor, unit


def describe_effects(measured: MeasuredValues, on: Ints, change: Floats) -> Effects:
    """Describe changes (n,) of the measurements `on` (n,), -1 where there is none.

    Parameters
    ----------
    measured
        All M measurements.
    on
        (n,) rows of measurements; -1 for none.
    change
        (n,) change of each, in its unit.
    """
    sigma = np.append(measured.sigma, np.nan)  # the last one for -1
    name = (*measured.name, "")
    return Effects(
        on=tuple(name[i] for i in on),
        change=change,
        sigmas=np.abs(change) / np.where(sigma > 0, sigma, np.nan)[on],
    )


def run_tests(
    refined: Refined,
    measured: MeasuredValues,
    significance: float,
    withheld: Withheld | None = None,
) -> TestedSurvey:
    """Test every observation and prior, and propagate errors that would stay undetected.

    Parameters
    ----------
    refined
        The adjusted survey.
    measured
        The measured values.
    significance
        Significance level of the test for blunders.
    withheld
        Values that take no part; those that fit test the readings, too.
    """
    groups = compute_test_statistics(refined.adjustment)
    shown = _compute_cofactors(
        refined.adjustment, groups, withheld, compute_critical_value(significance)
    )
    worst, weakest = compute_external_reliability(groups, measured, significance, shown)
    return TestedSurvey(
        refined=refined,
        groups=groups,
        suspicions=_suspicions(refined, groups, significance),
        worst=worst,
        weakest=weakest,
        names=ObservationNames(refined.adjustment),
        measured=measured,
        significance=significance,
    )


def _compute_cofactors(
    adjustment: Adjustment, groups: dict[str, TestedGroup], withheld: Withheld | None, limit: float
) -> dict[str, Floats]:
    """Compute cofactor matrices (n, a, a) of observations: the visible share of gross errors.

    With withheld values they are those that readings would have if these took part. An assumed
    direction of the camera may be as wrong as a reading.
    """
    kinds = (*POSSIBLY_GROSS, *(("boresight",) if _is_mount_assumed(adjustment) else ()))
    blocks = {kind: groups[kind].block for kind in kinds if kind in groups}
    shown = {
        kind: compute_cofactors(block, adjustment.covariance) for kind, block in blocks.items()
    }
    if withheld is not None and (fits := withheld.fits(limit)).any():
        # Q += B W^-1 B^T: B covariance of readings and withheld values, W of the latter's errors.
        weight = np.linalg.inv(withheld.joint[np.ix_(fits, fits)])
        for kind, block in blocks.items():
            response = block.times(slice(None), withheld.solved[:, fits])
            shown[kind] += response @ weight @ response.swapaxes(1, 2)
    # The code of a target identifies its point: no pick of it can be of another place.
    shown["pixels"][adjustment.survey.target_pick] += CERTAIN_COFACTOR * np.eye(2)
    return shown


def _is_mount_assumed(adjustment: Adjustment) -> bool:
    telemetry = adjustment.survey.telemetry
    return telemetry is not None and telemetry.mount_is_assumed


def is_mount_open(adjustment: Adjustment) -> bool:
    """Return whether the camera's direction is neither stated nor visible in the photos."""
    if not _is_mount_assumed(adjustment):
        return False
    share = compute_cofactors(adjustment.minimum.blocks["boresight"], adjustment.covariance)
    tilts = share[0][:2, :2] if len(share) == 1 else np.diag(share[:2, 0, 0])  # of the optical axis
    return bool(np.linalg.eigvalsh(tilts)[0] < MIN_MOUNT_REDUNDANCY)


def _suspicions(
    refined: Refined, groups: dict[str, TestedGroup], significance: float
) -> tuple[Suspicion, ...]:
    adjustment = refined.adjustment
    if not adjustment.minimum.converged:
        return ()
    each = find_suspicions(adjustment, groups, significance)
    found = tuple(one for one in each if not _is_lone_tape(adjustment, one))
    if not found and find_misfit_groups(adjustment, significance):
        # A single observation may spoil a whole group, such as the camera.
        found = tuple(islice(find_suspicions(adjustment, groups, significance, is_shared=False), 1))
    return found


def _is_lone_tape(adjustment: Adjustment, suspicion: Suspicion) -> bool:
    """Return whether the only tape is suspected, without any other observation of the scale."""
    is_tape = suspicion.suspect.kind == "tape" and len(adjustment.problem.tapes) == 1
    return is_tape and not compute_scale_sigmas(adjustment).others < MAX_RELATIVE_SIGMA
