"""Status of each measurement by what it rests on, and the verdict: green, amber or red."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from uavgram.estimation.reliability.redundancy import MIN_REDUNDANCY, TestedGroup
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Member
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import SUBJECTS, Message
from uavgram.model.message_catalogue import Effect, entry_of
from uavgram.model.naming import join_names, join_photo_names, photo_name
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict, VerdictLevel
from uavgram.model.result.tables import MeasurementResults
from uavgram.stages.judge.fit import CONTRADICTION_PROBABILITY, Fit
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.judge.unchecked import is_unchecked

RED_SIGMAS = 3.5
"""Error of a value, in its sigmas, that a red verdict predicts."""

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


def contradicts_result(
    table: MeasurementResults, here: Adjustment, value: Floats, there: Adjustment
) -> bool:
    """Return whether a solution without a mistake contradicts a value or a place of the result.

    Parameters
    ----------
    table, here
        The M measurements of the result, and its adjustment.
    value, there
        Their values (M,) in the other solution, NaN for none; and its adjustment.
    """
    away = np.abs(value - table.value)
    if (away > RED_SIGMAS * table.sigma).any():  # False for NaN
        return True
    if here.survey.gauge == "plane":
        return False  # places have no meaning
    (place_m, covariance), row = here.points(), there.label_rows(here.survey.label)
    off_m = np.abs(there.points()[0][row] - place_m)[row >= 0]
    sigma_m = np.sqrt(np.einsum("kii->ki", covariance))[row >= 0]
    return bool((off_m > RED_SIGMAS * sigma_m).any())


def is_displaced(examined: TestedSurvey) -> bool:
    """Return whether log and control or known lines are shifted against each other.

    Nothing shows which of the two is at the right place.
    """
    suspects = (member.kind for one in examined.suspicions for member in (one.suspect, *one.group))
    return "position_bias" in suspects


def find_unconfirmed_points(examined: TestedSurvey) -> set[str]:
    """Find labels of left-out lengths, known things and control that no other reading confirms.

    Where one does not fit, it may be right and the point clicked on another thing. A known thing or
    a control point that fits shows that the label is right, and so do two lengths: one alone shows
    it in its own direction.
    """
    adjustment, refined = examined.adjustment, examined.refined
    survey, used = adjustment.survey, adjustment.problem.line_index
    ends = np.concatenate([survey.line_start[used], survey.line_end[used]])
    lengths = np.bincount(ends, minlength=len(survey.label))
    confirmed = {*np.flatnonzero(lengths > 1).tolist(), *survey.control_label.tolist()}
    confirmed |= {label for thing in adjustment.problem.known for label in thing.label}
    is_out = ~np.isin(np.arange(len(survey.line_start)), used)
    is_out &= ~np.isin(survey.line_name or [""] * len(is_out), sorted(refined.settled))
    left_out = {
        *survey.line_start[is_out].tolist(),
        *survey.line_end[is_out].tolist(),
        *adjustment.label_rows(
            label
            for one in refined.left_out
            if one.kind in ("control", "known") and one.name not in refined.settled
            for label in one.labels
        ).tolist(),
    }
    return {survey.label[k] for k in left_out - confirmed if k >= 0}


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


_DOUBTS = (Effect.DOUBTFUL, Effect.DISPLACED)
"""Effects that put measurements at the named points in doubt."""

_STATISTICS = r": | \(|\. "
"""Ends of the plain part of a message; numbers of tests follow."""


def determine_verdict(
    messages: Sequence[Message],
    fit: Fit,
    examined: TestedSurvey,
    table: MeasurementResults,
    put_right: Collection[str] = (),
    harmless: Collection[str] = (),
) -> tuple[Verdict, tuple[MeasurementStatus, ...]]:
    """Determine the verdict, and the status of each measurement.

    Parameters
    ----------
    messages
        All messages of the run, in the order in which people read them.
    fit
        Quality of the fit, as numbers.
    examined
        The survey under test.
    table
        The measurements.
    put_right
        Codes of causes that no longer distort the result, as they were corrected.
    harmless
        Codes of causes whose correction contradicts no value, though it is not in the result.
    """
    codes = {m.code for m in messages}
    is_part = {m.code for m in messages if entry_of(m.code).part_of in codes}
    still = [m for m in messages if m.code not in put_right]
    bent = fit.core < CONTRADICTION_PROBABILITY or any(
        _effect(m) is Effect.RED and m.code not in harmless and not _is_left_out(m, examined)
        for m in still
    )
    status = determine_statuses(
        table,
        examined,
        is_contradicted=bent,
        contradicted=fit.check_labels,
        in_doubt=_find_doubtful_labels(still, examined, harmless),
        is_displaced=is_displaced(examined)
        or any(_effect(m) is Effect.DISPLACED and len(m.frames) > 1 for m in still),
    )
    is_ok = all(one == "ok" for one in status)
    without = {Effect.NONE, Effect.UNCHECKED} if is_ok else {Effect.NONE}
    # A message that a cause explains is a note, not a reason.
    # A note on another solution is a reason only where a value is another in it.
    noted = {Effect.UNCHECKED} if any(table.is_ambiguous) else set[Effect]()
    because = [
        m
        for m in messages
        if (m.level != "info" or _effect(m) in noted)
        and _effect(m) not in without
        and m.code not in is_part
    ]
    because.sort(key=lambda m: _effect(m) is Effect.UNCHECKED)  # misfits first
    reasons = tuple(map(make_reason, because))
    level: VerdictLevel | None = "amber" if reasons or not is_ok else "green"
    are_checks_off = fit.checks < CONTRADICTION_PROBABILITY
    if bent or (are_checks_off and not fit.is_check_alone):
        level = "red"
    if bent or are_checks_off:  # a single check may be wrong itself
        status = tuple("doubtful" if one == "ok" else one for one in status)
    if not status:
        level = None
    return Verdict(level=level, reasons=reasons), status


def _find_doubtful_labels(
    messages: Sequence[Message], examined: TestedSurvey, harmless: Collection[str]
) -> set[str]:
    """Find the labels at which measurements are doubtful by some messages."""
    if any(_effect(m) is Effect.ALL_DOUBTFUL or m.code in harmless for m in messages):
        return set(examined.adjustment.survey.label)
    named = {label for m in messages if _effect(m) in _DOUBTS for label in m.labels}
    return named | find_unconfirmed_points(examined)


def _list_used_lengths(adjustment: Adjustment) -> set[str]:
    """Return names of the lengths that take part in an adjustment."""
    names = adjustment.survey.line_name
    return {names[k] for k in adjustment.problem.line_index.tolist()} if names else set()


def _is_left_out(message: Message, examined: TestedSurvey) -> bool:
    """Return whether a message is about lengths alone, or about the log, and none takes part.

    What was left out does not bend the result, which rests on the other observations.
    """
    if examined.refined.is_log_left_out and entry_of(message.code).is_of_log:
        return True
    is_of_lengths = bool(message.lengths) and not message.frames
    return is_of_lengths and not set(message.lengths) & _list_used_lengths(examined.adjustment)


def _effect(message: Message) -> Effect:
    return entry_of(message.code).effect


def make_reason(message: Message) -> Reason:
    """Convert a message to a reason."""
    return Reason(
        cause=message.code,
        text=get_first_sentences(message),
        frames=message.frames,
        labels=message.labels,
        lengths=message.lengths,
        measurements=message.measurements,
        plain=get_plain_sentence(message),
        mend=message.mend,
        instead=message.instead,
        equals=message.equals,
    )


def get_first_sentences(message: Message, count: int = 2) -> str:
    """Return the first sentences of a message: the fault and the action."""
    parts = message.split_text()
    return message.text if len(parts) <= count else ". ".join(parts[:count]) + "."


def get_plain_sentence(message: Message) -> str:
    """Return one plain sentence of a message: the wrong objects, without numbers of tests.

    Without a sentence in the catalogue, the beginning of the message's text up to a colon or a
    bracket.
    """
    if message.plain:
        return message.plain
    entry = entry_of(message.code)
    size = {what: len(getattr(message, what)) for what in SUBJECTS if f"{{{what}}}" in entry.one}
    if not entry.one or not all(size.values()):
        return f"{message.split_text(_STATISTICS)[0].removesuffix('.')}."
    of_one = {"labels": entry.labels_of_one}
    is_several = any(count > of_one.get(what, 1) for what, count in size.items())
    form = entry.several if is_several and entry.several else entry.one
    names = {what: join_names(getattr(message, what)) for what in SUBJECTS}
    names["frames"] = join_photo_names(message.frames)
    if elsewhere := _list_swapped_elsewhere(message):
        names["frames"] = join_names(map(photo_name, (*message.frames, *elsewhere)), link="or")
    return form.format(count=len(message.labels), **names)


def _list_swapped_elsewhere(message: Message) -> list[str]:
    """List other photos in which the labels of a message may be swapped instead."""
    swaps = [one for other in message.instead for one in other.corrections if one.action == "swap"]
    same = [one.frame for one in swaps if {one.label, one.other} == set(message.labels)]
    return [frame for frame in dict.fromkeys(same) if frame and frame not in message.frames]
