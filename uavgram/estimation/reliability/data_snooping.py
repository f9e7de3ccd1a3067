"""Data snooping: suspected observations, rivals and inseparable groups.

Data snooping after Baarda 1968, with the separability of two hypotheses judged by the correlation
of their test statistics (Foerstner 1983, "Reliability and discernability of extended Gauss-Markov
models"). After each suspected observation, the others are tested again as if it were not there (in
the linear model, without a new adjustment), so that its error does not raise suspicion of others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from uavgram.estimation.reliability.redundancy import (
    MIN_REDUNDANCY,
    MIN_SUSPECT_REDUNDANCY,
    TestedGroup,
    compute_cofactors,
    compute_critical_value,
)
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS, get_kind
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Bools, Floats, Ints

MAX_CORRELATION = 0.99
"""Correlation of two test statistics from which their observations count as inseparable: for a
blunder that the test finds with a probability of 80 %, it takes the wrong observation in 4 of 10
cases (statistics of mean 4.13 and 0.99 * 4.13, and a difference of sigma sqrt(2 * 0.01))."""

MAX_DIFFERENCE = 2.0 * float(np.log(20.0))
"""Difference of squared test statistics up to which the smaller has odds of more than 1 in 20 to be
the wrong observation (likelihood ratio of one blunder here or there)."""

MIN_REMAINING_SHARE = 0.1
"""Smallest remaining error of a suspect, as a share of the part that previous blunders explain:
large blunders leave the linear model, and smaller remainders may be their effect."""

MAX_SUSPECTS = 30
"""Largest number of suspicions; with more of them, the model is wrong and not the observations."""

MIN_AXIS_CORRELATION = 0.3
"""Correlation of a single axis from which all axes of an observation are tested together."""


def find_suspicions(
    adjustment: Adjustment,
    groups: dict[str, TestedGroup],
    significance: float,
    *,
    is_shared: bool = True,
) -> Iterator[Suspicion]:
    """Yield observations that do not fit, largest statistic first; at most `MAX_SUSPECTS`.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    groups
        Test statistics of its observations (see ``observed``).
    significance
        Significance of the test of each single axis.
    is_shared
        Whether many axes of one kind share it (see `compute_level`); not where another test has
        shown that something is wrong.
    """
    snooping = _Snooping(adjustment, groups, significance, is_shared)
    for _ in range(MAX_SUSPECTS):
        suspicion = snooping.next_one()
        if suspicion is None:
            return
        yield suspicion


@dataclass(frozen=True, eq=False)
class _Axes:
    """All axes of all groups in one vector: group, row, axis and observation number of each."""

    kinds: tuple[str, ...]
    kind: Ints
    row: Ints
    axis: Ints
    observation: Ints

    @classmethod
    def of(cls, groups: dict[str, TestedGroup]) -> _Axes:
        kind, row, axis, observation, first = [], [], [], [], 0
        for k, group in enumerate(groups.values()):
            n, a = group.w.shape
            kind.append(np.full(n * a, k))
            row.append(np.repeat(np.arange(n), a))
            axis.append(np.tile(np.arange(a), n))
            if group.thing is not None:
                observation.append(first + np.repeat(group.thing, a))
            else:
                whole = get_kind(group.kind).is_whole
                observation.append(first + (row[-1] if whole else np.arange(n * a)))
            first = int(observation[-1].max(initial=first - 1)) + 1
        parts = (np.concatenate(p).astype(np.int64) for p in (kind, row, axis, observation))
        return cls(tuple(groups), *parts)

    def member(self, at: int) -> Member:
        return Member(self.kinds[self.kind[at]], int(self.row[at]), int(self.axis[at]))


@dataclass(eq=False)
class _Snooping:
    """Test statistics of all axes, updated as suspects are set aside.

    `error` are the residuals along the axes, `variance` their variances, both given the suspects so
    far; `basis` holds the orthogonalised covariance columns of these suspects with every axis.
    """

    adjustment: Adjustment
    groups: dict[str, TestedGroup]
    significance: float
    is_shared: bool
    basis: list[Floats] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.axes = _Axes.of(self.groups)
        groups = self.groups.values()
        self.whole = np.concatenate([g.redundancy.ravel() for g in groups])
        readings = [_place(self.axes.kinds, kind) for kind in READINGS]
        is_prior = ~np.isin(self.axes.kind, readings)
        self.accusable = is_prior | (self.whole > MIN_SUSPECT_REDUNDANCY)
        self.variance = self.whole.copy()
        root = np.sqrt(self.whole)
        self.first_error = np.concatenate([g.w.ravel() for g in groups]) * root
        self.error = self.first_error.copy()
        alone = compute_critical_value(self.significance)
        self.limit = np.concatenate(
            [
                np.full(g.w.size, g.limit(self.significance) if self.is_shared else alone)
                for g in groups
            ]
        )

    def next_one(self) -> Suspicion | None:
        """Find the next suspicion and set its observation aside; None if all observations fit."""
        w = self._statistics()
        explained = np.abs(self.first_error - self.error)
        blamed = (np.abs(w) > self.limit) & (np.abs(self.error) > MIN_REMAINING_SHARE * explained)
        blamed &= self.accusable
        if not blamed.any():
            return None
        largest = np.abs(np.where(blamed, w, 0.0))
        at = self._likeliest(largest)
        group = self._inseparable(self._covariances(at), at)
        at = self._representative(group, largest)
        column = self._covariances(at)
        group = self._inseparable(column, at)
        # The smaller the redundancy, the larger the error has to be. Gross errors of all orders of
        # magnitude are equally likely, so one n times as large in its own sigmas is n times less
        # likely.
        ratio = self.whole[at] / np.maximum(self.whole, MIN_REDUNDANCY)
        is_likely = np.log(ratio) < MAX_DIFFERENCE
        group &= is_likely
        odds = (w[at] ** 2 - w**2 < MAX_DIFFERENCE) & (np.abs(w) > self.limit) & is_likely
        rivals = np.setdiff1d(self.axes.observation[odds], self.axes.observation[group])
        suspicion = Suspicion(
            self.axes.member(at),
            float(w[at]),
            self._members(group, self.axes.observation[at], w),
            self._members(np.isin(self.axes.observation, rivals), self.axes.observation[at], w),
        )
        self._set_aside(int(self.axes.observation[at]), at, column)
        return suspicion

    def _likeliest(self, largest: Floats) -> int:
        """Return the axis to suspect: one of a reading, unless a prior is far more likely."""
        prior = ~np.isin(self.axes.kind, [_place(self.axes.kinds, kind) for kind in READINGS])
        return int((largest**2 - np.where(prior & (largest > 0), MAX_DIFFERENCE, 0.0)).argmax())

    def _statistics(self) -> Floats:
        # An axis that is inseparable from the suspects so far is no longer tested.
        checked = self.variance > np.maximum(MIN_REDUNDANCY, (1 - MAX_CORRELATION**2) * self.whole)
        return np.where(checked, self.error / np.sqrt(np.where(checked, self.variance, 1)), 0.0)

    def _covariances(self, at: int) -> Floats:
        """Compute covariances of the error along one axis with all, given the suspects so far."""
        here = self.axes.member(at)
        group = self.groups[here.kind]
        weight = group.direction[here.row, :, here.axis]
        # Column of Q = I - A S A^T along the axis, projected on all axes.
        right = np.zeros(self.adjustment.problem.layout.size)
        np.add.at(right, group.block.columns[here.row], weight @ group.block.jacobian[here.row])
        step = self.adjustment.minimum.factor.solve(right)
        parts = []
        for kind, other in self.groups.items():
            along = -other.response(step)
            if kind == here.kind:
                along[here.row] += weight
            parts.append(np.einsum("nra,nr->na", other.direction, along).ravel())
        column = np.concatenate(parts)
        # Condition on the suspects so far (Gram-Schmidt).
        for known in self.basis:
            column -= known * known[at]
        return np.asarray(column)

    def _inseparable(self, column: Floats, at: int) -> Bools:
        """Mark the axes of the observations that could explain all of the error along one axis."""
        pivot = column[at]
        possible = self.variance > MIN_REDUNDANCY
        # Squared correlation of each axis with the suspected one; the largest for each observation.
        single = np.zeros(len(column))
        np.divide(column**2, self.variance * pivot, out=single, where=possible)
        count = int(self.axes.observation[-1]) + 1
        whole = np.zeros(count)
        np.maximum.at(whole, self.axes.observation, single)
        for k, group in enumerate(self.groups.values()):
            if get_kind(group.kind).is_joint:
                self._take_together(k, group, column, pivot, whole)
        whole[self.axes.observation[at]] = 1.0
        alike = (whole > MAX_CORRELATION**2)[self.axes.observation]
        return np.asarray(alike & possible)

    def _take_together(
        self, k: int, group: TestedGroup, column: Floats, pivot: float, whole: Floats
    ) -> None:
        """Update the squared multiple correlations with all axes of promising observations."""
        n, a = group.w.shape
        place = np.flatnonzero(self.axes.kind == k).reshape(n, a)
        mine = column[place]
        strong = mine**2 > MIN_AXIS_CORRELATION**2 * self.variance[place] * pivot
        rows = np.flatnonzero((strong & (self.variance[place] > MIN_REDUNDANCY)).any(axis=1))
        if not len(rows):
            return
        block = group.block
        part = Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
        own = compute_cofactors(part, self.adjustment.covariance)
        own = np.einsum("nra,nrs,nsb->nab", group.direction[rows], own, group.direction[rows])
        for known in self.basis:
            seen = known[place[rows]]
            own -= seen[:, :, None] * seen[:, None, :]
        # Squared multiple correlation: c^T Q^-1 c / q, Q of the observation's own axes.
        inverse = np.linalg.pinv(own, rcond=1e-6, hermitian=True)
        squared = np.einsum("na,nab,nb->n", mine[rows], inverse, mine[rows]) / pivot
        observation = self.axes.observation[place[rows, 0]]
        whole[observation] = np.maximum(whole[observation], squared)

    def _representative(self, group: Bools, largest: Floats) -> int:
        """Choose the axis that represents a group: of a length, else of a pick, else of a prior.

        Among priors, the one with the largest redundancy is taken: its error is the smallest that
        shows.
        """
        for kind in READINGS:
            of_kind = group & (self.axes.kind == _place(self.axes.kinds, kind)) & (largest > 0)
            if of_kind.any():
                return int(np.where(of_kind, largest, -1.0).argmax())
        return int(np.where(group & (largest > 0), self.whole, -1.0).argmax())

    def _members(self, chosen: Bools, but: int, w: Floats) -> tuple[Member, ...]:
        """Return each observation once, by its axis with the largest statistic."""
        places = np.flatnonzero(chosen & (self.axes.observation != but))
        places = places[np.argsort(-np.abs(w[places]), kind="stable")]
        _, once = np.unique(self.axes.observation[places], return_index=True)
        return tuple(self.axes.member(int(p)) for p in places[np.sort(once)])

    def _set_aside(self, observation: int, first: int, column: Floats) -> None:
        """Update all statistics as if this observation, with all of its axes, were not there."""
        places = np.flatnonzero(self.axes.observation == observation)
        for at in (first, *places[places != first].tolist()):
            if at != first:
                if self.variance[at] <= max(MIN_REDUNDANCY, 1e-3 * self.whole[at]):
                    continue
                column = self._covariances(at)
            # Condition all errors and variances on the axis: one step of a Cholesky decomposition.
            known = column / np.sqrt(column[at])
            self.error = self.error - known * (self.error[at] / np.sqrt(column[at]))
            self.variance = np.maximum(self.variance - known**2, 0.0)
            self.basis.append(known)


def _place(kinds: tuple[str, ...], kind: str) -> int:
    return kinds.index(kind) if kind in kinds else -1
