"""Verdict on a result: red, amber or green, with reasons from the messages.

The colours predict. Green: everything fits, and an error in any single reading would have been
detected before it moves a value by ten of its sigmas. Red: readings that take part contradict each
other, and no single one of them explains it.
Without a measurement there is nothing to predict, and no verdict.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.message import SUBJECTS, Message
from uavgram.model.message_catalogue import Effect, entry_of
from uavgram.model.naming import join_names, join_photo_names
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict, VerdictLevel
from uavgram.model.result.tables import MeasurementResults
from uavgram.stages.judge.fit import CONTRADICTION_PROBABILITY, Fit
from uavgram.stages.judge.statuses import determine_statuses, find_unconfirmed_ends, is_displaced
from uavgram.stages.judge.tested_survey import TestedSurvey

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
    """
    codes = {m.code for m in messages}
    is_part = {m.code for m in messages if entry_of(m.code).part_of in codes}
    accounted = {one.message.code for one in examined.refined.causes if one.is_accounted}
    settled = accounted | {*put_right}
    gone = {*put_right} | {m.code for m in messages if entry_of(m.code).part_of in settled}
    still = [m for m in messages if m.code not in gone]
    bent = fit.core < CONTRADICTION_PROBABILITY or any(
        _effect(m) is Effect.RED and not _is_left_out(m, examined) for m in still
    )
    status = determine_statuses(
        table,
        examined,
        is_contradicted=bent,
        contradicted=fit.check_labels,
        in_doubt=_find_doubtful_labels(still, examined),
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


def _find_doubtful_labels(messages: Sequence[Message], examined: TestedSurvey) -> set[str]:
    """Find the labels at which measurements are doubtful by some messages."""
    if any(_effect(m) is Effect.ALL_DOUBTFUL for m in messages):
        return set(examined.adjustment.survey.label)
    named = {label for m in messages if _effect(m) in _DOUBTS for label in m.labels}
    return named | find_unconfirmed_ends(examined)


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
    return form.format(count=len(message.labels), **names)
