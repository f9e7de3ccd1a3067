"""Hypotheses on an error common to all lengths: a factor, as of a stretched tape, or an offset.

An offset, the same amount in each, is caused by a hook, or by a tape with another zero than
assumed. Either is found by a linear test only, without a readjustment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.measuring.scale import scale_derivatives
from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    ObservationChange,
    compare_hypotheses,
)
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.lengths import select_taped_lines
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.result.reliability import Noise
from uavgram.model.survey import Cause, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis
from uavgram.stages.refine.readjustment import readjust

MIN_LENGTHS = 2
"""Least number of lengths with a common error."""

MAX_FACTOR, MAX_OFFSET_M = 0.1, 0.3
"""Usual limits of the errors of tapes by a factor, and by a hook or another zero [m]."""

MIN_OFFSET_M = 0.02
"""Least offset that a hook or another zero explains [m]."""

CORRECTED_SIGMAS = 5.0
"""Least number of sigmas of a common error for a correction of all lengths."""

MIN_SHARE_IN_RESIDUALS = 1e-5
"""Least share of a common error that has to show in the residuals: that of a factor is small where
only a log determines the scale, since lengths are so much more precise."""

LEVEL_LOG_ODDS = float(np.log(20.0))
"""Logarithm of the odds that lengths were taped along a slope, without a statement."""

REPORTED_SIGMAS = 4.0
"""Sigmas above which a common error is reported, and needs a cause by itself: a person who is
informed that all lengths are wrong can use none of them."""


OFFSET_SIGNIFICANCE = 0.01
"""Significance level of the test whether an offset is possible."""

REMAINING_SIGMAS, MAX_LENGTHS_ASIDE = 3.0, 6
"""Sigmas above which a common error still shows without any single length; and number of lengths
that are left aside for that, worst first."""


class _Tape(NamedTuple):
    """Lengths of one tape, or of all: rows of the group of lengths, and a description."""

    rows: Ints
    words: str


class _Common(NamedTuple):
    """Possible common error of the lengths of a tape."""

    tape: _Tape
    moved: tuple[ObservationChange, ...]
    is_factor: bool


def propose_common_errors(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all lengths, or those of one tape, have a common factor or offset."""
    adjustment = diagnosis.adjustment
    if not adjustment.minimum.converged:
        return
    common = _list_common_errors(adjustment)
    tests = compare_hypotheses(adjustment, [one.moved for one in common], MIN_SHARE_IN_RESIDUALS)
    for one, found in zip(common, tests, strict=True):
        value, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
        if not np.isfinite(sigma) or abs(value) < REPORTED_SIGMAS * sigma:
            continue
        if not one.is_factor and abs(value) > MAX_OFFSET_M:
            continue
        if one.is_factor and value <= -1.0:
            continue  # no tape reads a negative length
        if not _is_common(adjustment, one):
            continue
        largest = MAX_FACTOR if one.is_factor else MAX_OFFSET_M
        tell = _factor_message if one.is_factor else _offset_message
        is_of_tape = not one.is_factor or abs(value) <= MAX_FACTOR
        yield Hypothesis(
            message=partial(tell, diagnosis, one.tape, found),
            mend=_mend(diagnosis, one, found),
            # Camera file or heights may give a wrong scale instead of a tape.
            remedy=None if is_of_tape else SurveyCorrection(),
            is_clear=is_of_tape,
            moved=one.moved,
            checked=MIN_SHARE_IN_RESIDUALS,
            price=float(
                np.log(len(common) / 2) + np.log(2.0 * largest / (sigma * np.sqrt(2.0 * np.pi)))
            ),
            settles=frozenset(_names(diagnosis, one.tape.rows)),
        )


def propose_taped_level(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all lengths were taped level, as on a slope, without a statement."""
    adjustment = diagnosis.adjustment
    if "lengths" not in adjustment.minimum.blocks or not adjustment.minimum.converged:
        return
    line = adjustment.problem.line_index
    if select_taped_lines(adjustment.survey, line).level.all():
        return
    moved = _level(adjustment)
    if np.abs(moved.along).max(initial=0.0) < 1.0:
        return  # on ground so flat, no reading changes by its sigma
    rows = np.arange(len(line))
    lines = frozenset(_lines(diagnosis, rows).tolist())
    yield Hypothesis(
        message=partial(_taped_level_message, diagnosis, _names(diagnosis, rows)),
        mend=SurveyCorrection(level=lines),
        moved=(moved,),
        amount=1.0,
        checked=MIN_SHARE_IN_RESIDUALS,
        price=LEVEL_LOG_ODDS,
        settles=frozenset(_names(diagnosis, rows)),
    )


def _taped_level_message(
    diagnosis: Diagnosis, names: tuple[str, ...], _: HypothesisTest | None
) -> Message:
    """Report lengths that were taped level."""
    slope = _slope_deg(diagnosis.adjustment)
    text = (
        f"All lengths seem to have been taped level on a ground that slopes by {slope:.0f} "
        "degrees: they fit as horizontal distances, and not along the slope. Ask how the tape was "
        "held, and write 'horizontal' into the column `along` of lines.csv if it was level."
    )
    return Message("warning", "lengths-level", text, lengths=names)


def drop_insignificant_errors(
    causes: Sequence[Cause], adjustment: Adjustment, noise: Noise | None
) -> tuple[Cause, ...]:
    """Drop factors and offsets of lengths that are not significant at the learnt noise.

    Relief of the ground changes lengths alike, and is learnt after the causes were found. Lengths
    keep their stated sigmas: a common error enlarges those that are learnt.

    Parameters
    ----------
    causes
        Causes at the stated noise.
    adjustment, noise
        The adjustment at the learnt noise; None if no noise was learnt.
    """
    codes = {"lengths-factor", "lengths-offset", "scale-contradicted"}
    if noise is None or codes.isdisjoint(one.message.code for one in causes):
        return tuple(causes)
    survey = adjustment.survey
    factor = 1.0 if noise.lengths is None else noise.lengths.factor
    stated = readjust(adjustment, replace(survey, length_sigma_m=survey.length_sigma_m / factor))
    common = _list_common_errors(stated)
    tests = compare_hypotheses(stated, [one.moved for one in common], MIN_SHARE_IN_RESIDUALS)
    # Lengths that were all left out take no part in the test.
    if not common or any(one.gain > REPORTED_SIGMAS**2 for one in tests):
        return tuple(causes)
    return tuple(one for one in causes if one.message.code not in codes)


def report_possible_errors(adjustment: Adjustment) -> Iterator[Message]:
    """Report possible common errors of all lengths that the observations do not exclude.

    An offset that makes everything fit better, beyond chance at the level `OPEN`; or lengths taped
    level on a slope, where the file does not state how and that is likelier than not.
    """
    if "lengths" not in adjustment.minimum.blocks or not adjustment.minimum.converged:
        return
    labels, names = adjustment.survey.label, adjustment.survey.line_name
    offsets = [one for one in _list_common_errors(adjustment) if not one.is_factor]
    tests = compare_hypotheses(adjustment, [one.moved for one in offsets], MIN_SHARE_IN_RESIDUALS)
    level = OFFSET_SIGNIFICANCE / max(len(offsets), 1)
    for one, found in zip(offsets, tests, strict=True):
        value, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
        if found.gain > chdtri(1, level) and abs(value) <= MAX_OFFSET_M:
            how = "long" if value > 0 else "short"
            text = (
                f"Everything fits better if {one.tape.words[0].lower()}{one.tape.words[1:]} are "
                f"too {how} by the same amount, {abs(value):.2f} ± {sigma:.2f} m. Check where the "
                "tape begins (its hook, or a tape whose zero is not at its end), or measure one "
                "of the lines again with another tape."
            )
            own = adjustment.problem.line_index[one.tape.rows]
            of_tape = tuple(names[k] for k in own) if names else ()
            yield Message(
                "warning", "lengths-offset-possible", text, labels=labels, lengths=of_tape
            )
    if _may_be_level(adjustment):
        slope = _slope_deg(adjustment)
        text = (
            f"The ground slopes by {slope:.0f} degrees, the file of the lengths does not state how "
            "the tape was held, and everything fits better if it was held level. Then it reads "
            "less than along the slope, and the results are too small. Write 'slope' or "
            "'horizontal' into the column `along` of lines.csv."
        )
        yield Message("warning", "lengths-level-possible", text, labels=labels, lengths=names)


def _may_be_level(adjustment: Adjustment) -> bool:
    """Return whether lengths were probably taped level, where the file does not state how."""
    if adjustment.survey.line_along:
        return False
    (found,) = compare_hypotheses(adjustment, [[_level(adjustment)]], MIN_SHARE_IN_RESIDUALS)
    # Decrease of the sum of squares with an amount of 1 instead of 0, as a lower limit.
    gain = (2.0 * found.value[0] - 1.0) / found.covariance[0, 0]
    return bool(gain / 2.0 > LEVEL_LOG_ODDS)


def _level(adjustment: Adjustment) -> ObservationChange:
    """Return the decrease of the readings of level tapes, as a hypothesis."""
    survey, line = adjustment.survey, adjustment.problem.line_index
    taped = select_taped_lines(survey, line)
    level = taped._replace(level=np.ones_like(taped.level))
    reading, *_ = adjustment.problem.readings(adjustment.state, taped)
    shorter = adjustment.problem.readings(adjustment.state, level)[0] - reading
    along = (shorter / survey.length_sigma_m[line])[:, None, None]
    return ObservationChange("lengths", np.arange(len(line)), along)


def _slope_deg(adjustment: Adjustment) -> float:
    """Return the slope of the ground [degrees]."""
    return float(np.degrees(np.arctan(np.hypot(*adjustment.state.plane[1:3]))))


def _is_common(adjustment: Adjustment, one: _Common) -> bool:
    """Return whether a common error is still significant if any single length is wrong."""
    block = adjustment.minimum.blocks["lengths"]
    worst = np.argsort(-compute_reductions(block, adjustment.covariance), kind="stable")[
        :MAX_LENGTHS_ASIDE
    ]
    single = [ObservationChange("lengths", np.array([row]), np.ones((1, 1, 1))) for row in worst]
    # Joint hypotheses: the common error and one wrong length.
    (lengths, *rest) = one.moved
    rows, along = lengths.rows, lengths.along
    size = [replace(each, along=np.pad(each.along, ((0, 0), (0, 0), (0, 1)))) for each in rest]
    both = []
    for row in worst:
        every = np.union1d(rows, [row])
        own = np.zeros((len(every), 1, 2))
        own[np.isin(every, rows), :, :1], own[every == row, 0, 1] = along, 1.0
        both.append([ObservationChange("lengths", every, own), *size])
    alone = compare_hypotheses(adjustment, [[each] for each in single], MIN_SHARE_IN_RESIDUALS)
    joint = compare_hypotheses(adjustment, both, MIN_SHARE_IN_RESIDUALS)
    return all(b.gain - a.gain > REMAINING_SIGMAS**2 for a, b in zip(alone, joint, strict=True))


def has_common_misfit(adjustment: Adjustment) -> bool:
    """Return whether all lengths have a significant common error."""
    tests = compare_hypotheses(
        adjustment, [one.moved for one in _list_common_errors(adjustment)], MIN_SHARE_IN_RESIDUALS
    )
    return any(one.gain > REPORTED_SIGMAS**2 for one in tests)


def _list_common_errors(adjustment: Adjustment) -> list[_Common]:
    """List the possible common errors of lengths, of each tape and of all."""
    if "lengths" not in adjustment.minimum.blocks:
        return []
    survey, line = adjustment.survey, adjustment.problem.line_index
    taped = select_taped_lines(survey, line)
    reading, _, _ = adjustment.problem.readings(adjustment.state, taped)
    sigma = survey.length_sigma_m[line]
    size = [
        ObservationChange(kind, np.arange(len(change)), change[:, :, None])
        for kind, change in scale_derivatives(adjustment).items()
    ]
    found = []
    for tape in _tapes(taped.tape):
        for is_factor in (True, False):
            amount: Floats = reading[tape.rows] if is_factor else np.ones(len(tape.rows))
            along = (amount / sigma[tape.rows])[:, None, None]
            with_size = size if is_factor and len(tape.rows) == len(line) else []
            moved = ObservationChange("lengths", tape.rows, along), *with_size
            found.append(_Common(tape, moved, is_factor))
    return found


def _tapes(tape_of_line: tuple[str, ...]) -> list[_Tape]:
    tapes = dict.fromkeys(tape_of_line)
    only = f" of the tape {tape_of_line[0]!r}" if len(tapes) == 1 and tape_of_line[0] else ""
    found = [_Tape(np.arange(len(tape_of_line)), f"All lengths{only}")]
    if len(tapes) > 1:
        own = {tape: [k for k, one in enumerate(tape_of_line) if one == tape] for tape in tapes}
        found += [
            _Tape(
                np.array(rows),
                f"The lengths of the tape {tape!r}"
                if tape
                else "The lengths of the tape without a name",
            )
            for tape, rows in own.items()
        ]
    return [one for one in found if len(one.rows) >= MIN_LENGTHS]


def _mend(diagnosis: Diagnosis, common: _Common, found: HypothesisTest) -> SurveyCorrection | None:
    """Correct all readings by a common error, if it is significant and of an ordinary size."""
    value, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
    if abs(value) < CORRECTED_SIGMAS * sigma:
        return None
    lines = _lines(diagnosis, common.tape.rows)
    reading = diagnosis.survey.length_m[lines]
    if not common.is_factor and not MIN_OFFSET_M <= abs(value) <= MAX_OFFSET_M:
        return None
    right = reading / (1.0 + value) if common.is_factor else reading - value
    if (right <= 0.0).any():
        return None
    return SurveyCorrection(length_m=dict(zip(lines.tolist(), right.tolist(), strict=True)))


def _lines(diagnosis: Diagnosis, rows: Ints) -> Ints:
    """Return known lengths of the survey by row of their group."""
    return diagnosis.refined.line_index[diagnosis.adjustment.problem.line_index[rows]]


def _names(diagnosis: Diagnosis, rows: Ints) -> tuple[str, ...]:
    name = diagnosis.survey.line_name
    return tuple(name[i] for i in _lines(diagnosis, rows)) if name else ()


def _factor_message(
    diagnosis: Diagnosis, tape: _Tape, found: HypothesisTest, _: HypothesisTest | None
) -> Message:
    """Report lengths with a common factor."""
    value, sigma = 100.0 * float(found.value[0]), 100.0 * float(np.sqrt(found.covariance[0, 0]))
    how = "long" if value > 0 else "short"
    witness, heights = "photos", ""
    if diagnosis.survey.telemetry is not None:
        of_photos = isinstance(diagnosis.survey.track, PhotoExposures)
        witness = "the positions of the photos" if of_photos else "log and photos"
        heights = f"the heights of the {'photos' if of_photos else 'log'}, "
    text = (
        f"{tape.words} seem to be too {how} by one factor, {abs(value):.1f} ± {sigma:.1f} %: "
        "compare the tape with another one, and divide all its readings by the factor found. If "
        f"the tape is right, the scale from {witness} is wrong: check {heights}the camera "
        "file and the ground."
    )
    names = _names(diagnosis, tape.rows)
    if abs(value) > 100.0 * MAX_FACTOR:
        text = (
            f"{tape.words} are too {how} for the scale from {witness}, by {abs(value):.1f} ± "
            f"{sigma:.1f} %: that is more than the error of any tape. Check {heights}the camera "
            "file (another camera or zoom) and the ground, then the unit of the lengths."
        )
        return Message("warning", "scale-contradicted", text, lengths=names)
    return Message("warning", "lengths-factor", text, lengths=names)


def _offset_message(
    diagnosis: Diagnosis, tape: _Tape, found: HypothesisTest, _: HypothesisTest | None
) -> Message:
    """Report lengths with a common offset."""
    value, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
    how = "long" if value > 0 else "short"
    undo = "subtract it from" if value > 0 else "add it to"
    text = (
        f"{tape.words} seem to be too {how} by the same amount, {abs(value):.2f} ± {sigma:.2f} m, "
        f"as with a hook, or with a tape whose zero is not at its end: look at the tape, and "
        f"{undo} all its readings if that is so."
    )
    names = _names(diagnosis, tape.rows)
    return Message("warning", "lengths-offset", text, lengths=names)
