"""Lengths that do not fit, or were left out for that reason, and their readings as predicted.

For a length that takes part, the adjustment without it follows in the linear model from its
residual and cofactor (Baarda 1968), without a readjustment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.reliability.redundancy import compute_core_fit, compute_reductions
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.lengths import (
    TapedLengths,
    describe_ends,
    select_taped_lines,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.stages.refine.causes.hypothesis import GROSS_ERROR_LOG_ODDS, Diagnosis
from uavgram.stages.refine.left_out import predict_readings

STRAY_DECREASE = 9.0
"""Decrease of the sum of squares without a length, above which it is examined."""

MAX_LENGTHS = 8
"""Largest number of lengths that are examined: left-out ones, and those of largest misfit."""

MIN_REDUNDANCY = 0.05
"""Redundancy number above which the other observations determine the reading of a length."""

TOO_GOOD_PROBABILITY = 0.01
"""Probability of a smaller sum of squares, below which a survey fits too well."""

MAX_SLIP_SIGMAS = 4.0
"""Largest difference from the prediction, in sigmas, for a slip to explain a reading."""

NONLINEAR_SHARE = 0.04
"""Share of an error that the linear model may miss where the length is removed."""

MIN_SLIP_LOG_ODDS = float(np.log(10.0))
"""Logarithm of the odds of a slip against an error of any amount, above which it is reported."""

LOG_ERROR_RANGE = float(np.log(1e3))
"""Logarithm of the range of errors, from some centimetres to tens of metres, with equal probability
in each decade."""


@dataclass(frozen=True, eq=False)
class SuspectLengths:
    """Set of n lengths that do not fit.

    Attributes
    ----------
    diagnosis
        The survey under diagnosis.
    line
        (n,) rows of the lengths in the survey.
    takes_part
        (n,) whether they take part, or were left out.
    cofactor
        (n, n) inverse covariance of their errors, in their own sigmas.
    error
        (n,) errors of the readings, each predicted without itself, in their own sigmas.
    residual
        (n,) predicted less observed, in their own sigmas; for left-out lengths times `cofactor`.
    pull
        (size, n) changes of the unknowns by each that takes part; 0 for left-out lengths.
    """

    diagnosis: Diagnosis
    line: Ints
    takes_part: Bools
    cofactor: Floats
    error: Floats
    residual: Floats
    pull: Floats

    @property
    def reading_m(self) -> Floats:
        """Readings (n,) of the lengths [m]."""
        return np.asarray(self.diagnosis.survey.length_m[self.line])

    @property
    def own_sigma_m(self) -> Floats:
        """Sigmas (n,) of the readings [m]."""
        return np.asarray(self.diagnosis.survey.length_sigma_m[self.line])

    @property
    def sigma_m(self) -> Floats:
        """Sigmas (n,) of reading less prediction [m]."""
        return np.asarray(self.own_sigma_m / np.sqrt(self.cofactor.diagonal()))

    @property
    def right_m(self) -> Floats:
        """Readings (n,) as predicted by all other observations [m]."""
        return np.asarray(self.reading_m - self.error * self.own_sigma_m)

    @property
    def right_sigma_m(self) -> Floats:
        """Sigmas (n,) of the predictions [m]."""
        variance = self.sigma_m**2 - self.own_sigma_m**2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    @property
    def name(self) -> tuple[str, ...]:
        """Names (n,) of the lengths; empty without names."""
        return tuple(self.diagnosis.survey.line_name[i] for i in self.line if self._named)

    @property
    def _named(self) -> bool:
        return bool(self.diagnosis.survey.line_name)

    def describe_length(self, k: int) -> str:
        """Describe a length: ``'L2' ('R3' to 'R4')``."""
        survey, i = self.diagnosis.survey, int(self.line[k])
        start, end = survey.label[survey.line_start[i]], survey.label[survey.line_end[i]]
        return describe_ends(survey.line_name[i] if self._named else "", start, end)

    def fall(self, rows: Sequence[int], error: Floats) -> float:
        """Compute the decrease of the sum of squares if some lengths have known errors.

        Parameters
        ----------
        rows
            (m,) lengths.
        error
            (m,) errors [m].
        """
        return self.fall_without(rows) - self.off(rows, error)

    def fall_without(self, rows: Sequence[int]) -> float:
        """Compute the decrease of the sum of squares if some lengths may err by any amount."""
        used = np.array([k for k in rows if self.takes_part[k]], dtype=np.int64)
        cofactor, residual = self.cofactor[np.ix_(used, used)], self.residual[used]
        return float(residual @ np.linalg.solve(cofactor, residual))

    def off(self, rows: Sequence[int], error: Floats) -> float:
        """Compute the squared distance, in sigmas, of errors from the predicted ones.

        The prediction is by all observations but these lengths.

        Parameters
        ----------
        rows
            (m,) lengths.
        error
            (m,) errors [m].
        """
        at = np.array(rows)
        covariance = np.linalg.inv(self.cofactor[np.ix_(at, at)])
        found = -covariance @ self.residual[at]
        missed = NONLINEAR_SHARE * np.where(self.takes_part[at], np.abs(found), 0.0)
        away = error / self.own_sigma_m[at] - found
        return float(away @ np.linalg.solve(covariance + np.diag(missed**2), away))

    def price(self, rows: Sequence[int], alternatives: float, off: float) -> float | None:
        """Compute the price of a slip; None if chance may explain the readings as well.

        Parameters
        ----------
        rows
            (m,) lengths whose readings the slip explains.
        alternatives
            Number of slips of that kind for these lengths.
        off
            Squared distance, in sigmas, of the slip's error from the predicted one.

        Notes
        -----
        An error of unknown reason costs `GROSS_ERROR_LOG_ODDS`; but the larger it is, the less
        probable is such an error at just this value, and the more probable is a slip of that size.
        """
        at = np.array(rows)
        size = np.abs(self.error[at]) * self.own_sigma_m[at] / self.sigma_m[at]
        aimless = rate_aimless(size)
        better = float(np.sum(aimless) - np.log(alternatives))
        if better - off / 2.0 < MIN_SLIP_LOG_ODDS:
            return None
        if not self.takes_part[at].any():  # known to be wrong; only the reason is open
            return len(at) * GROSS_ERROR_LOG_ODDS - better - MIN_SLIP_LOG_ODDS
        which = np.log(len(self.diagnosis.survey.line_start)) * self.takes_part[at]
        return float(np.sum(GROSS_ERROR_LOG_ODDS + which) - better)

    def between(
        self, ends: tuple[Ints, Ints], k: int, without: Sequence[int]
    ) -> tuple[Floats, Floats]:
        """Predict the readings (m,) of a tape between labels of the adjustment, and the sigmas.

        Parameters
        ----------
        ends
            (m,) and (m,) labels.
        k
            The length whose tape and way of measuring apply.
        without
            Lengths whose influence is removed.
        """
        found, moved, weight = self._readings(ends, k, without)
        variance = self.diagnosis.adjustment.readings(self._select_taped(ends, k))[1] ** 2
        return found, np.sqrt(variance + np.einsum("mi,ij,mj->m", moved, weight, moved))

    def lengths_between(self, ends: tuple[Ints, Ints], k: int) -> Floats:
        """Predict readings (m,) between labels without the influence of the length itself."""
        return self._readings(ends, k, [k])[0]

    def _readings(
        self, ends: tuple[Ints, Ints], k: int, without: Sequence[int]
    ) -> tuple[Floats, Floats, Floats]:
        """Return readings (m,), their derivatives (m, n) by removed lengths, and weights (n, n)."""
        adjustment = self.diagnosis.adjustment
        taped = self._select_taped(ends, k)
        found, gradient, columns = adjustment.problem.readings(adjustment.state, taped)
        used = np.array([j for j in without if self.takes_part[j]], dtype=np.int64)
        moved = np.einsum("mk,mkn->mn", gradient, self.pull[:, used][columns])
        weight: Floats = np.asarray(np.linalg.inv(self.cofactor[np.ix_(used, used)]), np.float64)
        return found + moved @ weight @ self.residual[used], moved, weight

    def _select_taped(self, ends: tuple[Ints, Ints], k: int) -> TapedLengths:
        like = select_taped_lines(self.diagnosis.survey, np.full(len(ends[0]), self.line[k]))
        return TapedLengths(ends[0], ends[1], like.tape, like.level)

    def make_message(self, code: str, rows: Sequence[int], words: MessageWords) -> Message:
        """Make the message on a slip.

        Parameters
        ----------
        code, rows
            Code of the message; and the lengths.
        words
            Its words.
        """
        survey = self.diagnosis.survey
        lines = [int(self.line[k]) for k in rows]
        ends = [k for i in lines for k in (survey.line_start[i], survey.line_end[i])]
        opening, item, ending = words.several
        return Message(
            "warning",
            code,
            words.text,
            lengths=tuple(survey.line_name[i] for i in lines) if self._named else (),
            labels=tuple(dict.fromkeys(survey.label[k] for k in ends)),
            several=MessagePlural(opening, item, ending=ending),
            plain=words.plain,
        )

    def short(self, k: int) -> str:
        """Return ``L2``, or ``the length from R3 to R4`` without a name."""
        survey, i = self.diagnosis.survey, int(self.line[k])
        ends = survey.label[survey.line_start[i]], survey.label[survey.line_end[i]]
        return self.name[k] if self._named else f"The length from {ends[0]} to {ends[1]}"

    def describe_difference(self, k: int) -> str:
        """Return ``reads 12.34 m, and should read about 11.34 ± 0.02 m: 1.00 m less``."""
        off = float(self.right_m[k] - self.reading_m[k])
        sigma, way = max(float(self.right_sigma_m[k]), 0.01), "more" if off > 0 else "less"
        return (
            f"reads {self.reading_m[k]:.10g} m, and by all the rest should read about "
            f"{self.right_m[k]:.2f} ± {sigma:.2f} m: {abs(off):.2f} m {way}"
        )

    def list_names(self, rows: Sequence[int]) -> frozenset[str]:
        """Return the names of some of the lengths."""
        return frozenset(self.diagnosis.survey.line_name[self.line[k]] for k in rows if self._named)


def rate_aimless(size: Floats) -> Floats:
    """Compute the log odds (m,) against errors of unknown reason at just their values, in sigmas.

    The larger an error is, the less probable is it at just this value.
    """
    return np.asarray(np.log(np.maximum(2.0 * LOG_ERROR_RANGE * size / np.sqrt(2.0 * np.pi), 1.0)))


@dataclass(frozen=True)
class MessageWords:
    """Words of a message: its text; opening, item and ending among others; one plain sentence."""

    text: str
    several: tuple[str, str, str]
    plain: str = ""


def find_suspect_lengths(diagnosis: Diagnosis) -> SuspectLengths:
    """Collect the lengths that were left out, and those that do not fit, worst first."""
    survey, refined, adjustment = diagnosis.survey, diagnosis.refined, diagnosis.adjustment
    left_out = np.flatnonzero(refined.line_removed)
    seen, seen_sigma = predict_readings(survey, refined, left_out)
    there = np.isfinite(seen)
    left_out, seen, seen_sigma = left_out[there], seen[there], seen_sigma[there]
    own = survey.length_sigma_m[left_out]
    # Prediction errors of left-out lengths, and weights from both variances.
    error, weight = (survey.length_m[left_out] - seen) / own, own**2 / (own**2 + seen_sigma**2)
    rows = _find_stray_rows(adjustment)[: max(0, MAX_LENGTHS - len(left_out))]
    pull, cofactor, residual = _compute_pulls(adjustment, rows)
    n, size = len(left_out), adjustment.problem.layout.size
    joint = np.zeros((n + len(rows), n + len(rows)))
    joint[np.arange(n), np.arange(n)] = weight
    joint[n:, n:] = cofactor
    line = refined.line_index[adjustment.problem.line_index[rows]]
    return SuspectLengths(
        diagnosis=diagnosis,
        line=np.concatenate([left_out, line]),
        takes_part=np.arange(n + len(rows)) >= n,
        cofactor=joint,
        error=np.concatenate([error, -residual / cofactor.diagonal()]),
        residual=np.concatenate([-weight * error, residual]),
        pull=np.concatenate([np.zeros((size, n)), pull], axis=1),
    )


def _find_stray_rows(adjustment: Adjustment) -> Ints:
    """Return rows of lengths that take part and do not fit, worst first."""
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return np.zeros(0, dtype=np.int64)
    fall = compute_reductions(block, adjustment.covariance)
    checked = 1.0 - adjustment.covariance.leverage(block)[:, 0] > MIN_REDUNDANCY
    rows = np.flatnonzero((fall > STRAY_DECREASE) & checked)
    return rows[np.argsort(-fall[rows], kind="stable")]


def find_unchecked_lengths(adjustment: Adjustment) -> Ints:
    """Find lengths (n,), by row of their block, that nothing else checks, and that may be wrong.

    Such a length draws the whole survey to its reading, and has no residual; its error shows only
    in what it bends. None is found where the squares are so small that a gross error among them
    would leave the rest a fit too good to be true.
    """
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return np.zeros(0, dtype=np.int64)
    checked = 1.0 - adjustment.covariance.leverage(block)[:, 0] > MIN_REDUNDANCY
    fit = compute_core_fit(adjustment)
    least = fit.squares - 2.0 * (GROSS_ERROR_LOG_ODDS + np.log(len(checked)))
    fits_too_well = chdtri(max(fit.degrees - 1.0, 1.0), 1.0 - TOO_GOOD_PROBABILITY)
    return np.flatnonzero(~checked & (least > fits_too_well))


def _compute_pulls(adjustment: Adjustment, rows: Ints) -> tuple[Floats, Floats, Floats]:
    """Return pulls (size, n), cofactors (n, n) and residuals (n,) of lengths that take part."""
    right = np.zeros((adjustment.problem.layout.size, len(rows)))
    if not len(rows):
        return right, np.zeros((0, 0)), np.zeros(0)
    block = adjustment.minimum.blocks["lengths"]
    at = (block.columns[rows], np.arange(len(rows))[:, None])
    np.add.at(right, at, block.jacobian[rows, 0])  # ends may share an unknown
    pull = adjustment.minimum.factor.solve(right)
    return pull, np.eye(len(rows)) - right.T @ pull, block.residual[rows, 0]
