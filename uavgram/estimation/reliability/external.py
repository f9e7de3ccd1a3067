"""External reliability: effects of undetected errors on the measured values.

Baarda 1968, "A testing procedure for use in geodetic networks"; Foerstner & Wrobel 2016,
"Photogrammetric computer vision", ch. 4.6.4: an observation that is wrong by its minimal detectable
bias moves the estimates by S A^T of its whitened error. A pick has two coordinates, and may be
wrong in any direction: the largest effect of an error at the bound of detection is delta0 sqrt(g^T
Q^-1 g), with g the effects of its coordinates and Q their cofactors.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.reliability.redundancy import (
    GROSS_SIGMAS,
    MIN_SUSPECT_REDUNDANCY,
    TestedGroup,
    compute_critical_value,
    compute_level,
    compute_noncentrality,
)
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Member
from uavgram.model.arrays import Floats, Ints

MAX_UNCHECKED_REDUNDANCY = 0.01
"""Redundancy up to which an observation counts as unchecked: an error in it shows only from 41 of
its sigmas (significance 0.001, power 80 %)."""

MIN_EFFECT_SIGMAS = 0.01
"""Share of a measurement's sigma from which the effect of one sigma of an unchecked observation
makes the measurement dependent on it."""

UNDETECTED_SIGMAS = 10.0
"""Undetected change of a measurement by an error of a reading, in sigmas, beyond which the
measurement counts as unchecked."""

MAX_ERROR_SIGMAS = 1e4
"""Largest possible error of a reading, in sigmas: that of a click anywhere in the photo."""

ENTRIES_AT_ONCE = 2_000_000
"""Largest number of array entries in memory at a time."""


class LargestEffects(NamedTuple):
    """Largest effects of the minimal detectable biases of one group of observations.

    Attributes
    ----------
    measurement
        (n, a) index of the measurement that each axis moves most, in that measurement's sigmas; -1:
        none.
    change
        (n, a) change of that measurement, in its own unit; NaN if there is none.
    sigmas
        (n, a) size of the change in that measurement's sigmas; 0 if there is none.
    """

    measurement: Ints
    change: Floats
    sigmas: Floats


class UndetectedError(NamedTuple):
    """Reading whose error may move a measurement far before any test detects it.

    Attributes
    ----------
    member
        Reading, with the axis that moves the measurement most.
    sigmas
        Size of that error, in sigmas of the reading; about `MAX_ERROR_SIGMAS` if it shows in no
        test.
    change
        Change of the measurement, in its unit.
    """

    member: Member
    sigmas: float
    change: float


class WeakestObservations(NamedTuple):
    """Observations with the largest effects on one measurement.

    Attributes
    ----------
    member
        Observation with the largest effect; None if no checked one has an effect.
    change
        Change of the measurement by the observation's minimal detectable bias.
    unchecked
        Observations that move it and are not checked.
    unseen
        Readings that may move it far undetected, the worst first; empty if each is checked.
    """

    member: Member | None
    change: float
    unchecked: tuple[Member, ...]
    unseen: tuple[UndetectedError, ...] = ()


def compute_external_reliability(
    groups: dict[str, TestedGroup],
    measured: MeasuredValues,
    significance: float,
    shown: Mapping[str, Floats] = MappingProxyType({}),
) -> tuple[dict[str, LargestEffects], tuple[WeakestObservations, ...]]:
    """Compute effects of undetected errors, by observation and by measurement.

    Parameters
    ----------
    groups
        Observations of the adjustment.
    measured
        Measured values.
    significance
        Significance of the test that should have found the error.
    shown
        For each group of readings (n, a, a) cofactor matrices: the part of their errors that shows
        in any test.
    """
    worst: dict[str, LargestEffects] = {}
    count = len(measured.rows)
    best = np.full(count, -1.0)
    weakest = [WeakestObservations(None, np.nan, ()) for _ in range(count)]
    sigma = np.nan_to_num(measured.sigma, nan=np.inf)  # no effect on missing values
    sigma = np.where(sigma > 0, sigma, np.inf)
    for kind, group in groups.items():
        parts = []
        for rows in _split_rows(group, max(count, 1)):
            change, unchecked = _compute_changes(group, rows, measured, significance)
            parts.append(_find_largest(change / sigma, change))
            _find_weakest(kind, rows.start, change, unchecked / sigma, best, weakest)
            for axes, largest in _list_parts(kind, group) if kind in shown else []:
                unseen = _find_undetected(
                    group, rows, axes, largest, measured, shown[kind][rows], significance
                )
                _add_undetected(kind, rows.start, axes, *unseen, sigma, weakest)
        worst[kind] = LargestEffects(
            *(np.concatenate(column) for column in zip(*parts, strict=True))
        )
    by_size = (sorted(one.unseen, key=lambda each: -abs(each.change)) for one in weakest)
    ordered = zip(weakest, by_size, strict=True)
    return worst, tuple(one._replace(unseen=tuple(unseen)) for one, unseen in ordered)


def _split_rows(group: TestedGroup, count: int) -> list[slice]:
    n, _, k = group.block.jacobian.shape
    step = max(1, ENTRIES_AT_ONCE // (count * max(k, 1)))
    return [slice(first, min(first + step, n)) for first in range(0, max(n, 1), step)]


def _compute_changes(
    group: TestedGroup, rows: slice, measured: MeasuredValues, significance: float
) -> tuple[Floats, Floats]:
    """Compute (n, a, M) changes by the biases of checked axes, and by one sigma of unchecked ones.

    Each is 0 for the axes of the other.
    """
    response = group.block.times(rows, measured.solved)
    # Effect of one whitened sigma along each axis: d^T A S g.
    by_unit = group.direction[rows].swapaxes(1, 2) @ response
    checked = group.redundancy[rows] > MAX_UNCHECKED_REDUNDANCY
    whitened = group.bias(significance)[rows] / group.scale[rows]
    by_bias = by_unit * np.where(checked, np.nan_to_num(whitened), 0.0)[..., None]
    known = np.isfinite(group.scale[rows])
    return by_bias, by_unit * (~checked & known)[..., None]


def _find_largest(in_sigmas: Floats, change: Floats) -> LargestEffects:
    n, a, m = in_sigmas.shape
    if not m:
        return LargestEffects(np.full((n, a), -1), np.full((n, a), np.nan), np.zeros((n, a)))
    at = np.abs(in_sigmas).argmax(axis=2)
    sigmas = np.abs(np.take_along_axis(in_sigmas, at[..., None], axis=2)[..., 0])
    value = np.take_along_axis(change, at[..., None], axis=2)[..., 0]
    felt = sigmas > 0
    return LargestEffects(np.where(felt, at, -1), np.where(felt, value, np.nan), sigmas)


def _find_weakest(
    kind: str,
    first: int,
    change: Floats,
    unchecked: Floats,
    best: Floats,
    weakest: list[WeakestObservations],
) -> None:
    n, a, m = change.shape
    if not n:
        return
    at = np.abs(change).reshape(n * a, m).argmax(axis=0)
    value = change.reshape(n * a, m)[at, np.arange(m)]
    for i in np.flatnonzero((np.abs(value) > best) & (value != 0.0)):
        best[i] = abs(value[i])
        member = Member(kind, first + int(at[i]) // a, int(at[i]) % a)
        weakest[i] = weakest[i]._replace(member=member, change=float(value[i]))
    largest = np.abs(unchecked).max(axis=1)
    for row, i in np.argwhere(largest > MIN_EFFECT_SIGMAS):
        member = Member(kind, first + int(row), int(np.abs(unchecked[row, :, i]).argmax()))
        weakest[i] = weakest[i]._replace(unchecked=(*weakest[i].unchecked, member))


def _list_parts(kind: str, group: TestedGroup) -> list[tuple[Ints, float]]:
    """List the axes that one mistake may change, such as a position, and its largest size."""
    axes, units = group.direction.shape[2], get_kind(kind).units
    unit = np.array(units if len(units) == axes else units[:1] * axes)
    return [
        (np.flatnonzero(unit == one), np.pi if one == "deg" else np.inf)
        for one in dict.fromkeys(unit.tolist())
    ]


def _find_undetected(
    group: TestedGroup,
    rows: slice,
    axes: Ints,
    largest: float,
    measured: MeasuredValues,
    shown: Floats,
    significance: float,
) -> tuple[Floats, Floats]:
    """Compute (n, p, M) undetected errors in sigmas, and (n, M) changes of measurements by them.

    Each is in the direction that moves the measurement most, among those of some axes (p,), and no
    larger than `largest`.
    """
    # Largest effect at the bound of detection: delta0 sqrt(g^T Q^-1 g), by the error delta0 Q^-1 g
    # / sqrt(g^T Q^-1 g), with effects g and cofactors Q of the axes.
    level = compute_level(significance, group.tests)
    bound = compute_noncentrality(level)
    along = group.direction[rows][:, :, axes].swapaxes(1, 2)
    response = along @ group.block.times(rows, measured.solved)
    # The largest possible error bounds it where it shows in no test at all.
    most = np.minimum(largest / group.scale[rows][:, axes], MAX_ERROR_SIGMAS)
    limited = _limit_checks(along @ shown @ along.swapaxes(1, 2), bound, level)
    limited = limited + (bound / most)[:, :, None] ** 2 * np.eye(len(axes))
    error = np.linalg.solve(limited, response)
    size = np.sqrt(np.maximum(np.sum(response * error, axis=1), 0.0))
    return bound * error / np.where(size > 0, size, 1.0)[:, None], bound * size


def _limit_checks(cofactors: Floats, bound: float, level: float) -> Floats:
    """Reduce the cofactors (n, p, p) along axes with so little redundancy that no test is made.

    Below `MIN_SUSPECT_REDUNDANCY` no reading is suspected: its error shows only as a gross error,
    or in the test of the whole survey, from `GROSS_SIGMAS` on.

    Parameters
    ----------
    cofactors
        Cofactor matrices of readings.
    bound, level
        Noncentrality of errors at the bound of detection by a test, and the level of that test.
    """
    share, axes = np.linalg.eigh(cofactors)
    gross = GROSS_SIGMAS + bound - compute_critical_value(level)
    found = np.where(share > MIN_SUSPECT_REDUNDANCY, share, (bound / gross) ** 2 * share)
    return np.asarray(axes * found[:, None, :] @ axes.swapaxes(1, 2))


def _add_undetected(
    kind: str,
    first: int,
    axes: Ints,
    error: Floats,
    change: Floats,
    sigma: Floats,
    weakest: list[WeakestObservations],
) -> None:
    for row, i in np.argwhere(change > UNDETECTED_SIGMAS * sigma).tolist():
        own = error[row, :, i]
        member = Member(kind, first + row, int(axes[np.abs(own).argmax()]))
        found = UndetectedError(member, float(np.linalg.norm(own)), float(change[row, i]))
        weakest[i] = weakest[i]._replace(unseen=(*weakest[i].unseen, found))
