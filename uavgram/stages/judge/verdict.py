"""The one verdict on a result: red, amber or green, and why; it follows the messages.

The colours predict. Green: everything fits, and a gross error in any single reading would have been
noticed. Red: readings contradict each other, and no single one of them explains it. Without a
measurement there is nothing to predict, and no verdict.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from uavgram.model.message import Message
from uavgram.model.result.tables import MeasurementResults
from uavgram.model.result.verdict import MeasurementStatus, Reason, Verdict, VerdictLevel
from uavgram.stages.judge.fit import CONTRADICTED, Fit
from uavgram.stages.judge.plain import plain_sentence
from uavgram.stages.judge.statuses import statuses
from uavgram.stages.judge.tested_survey import TestedSurvey

CONTRADICTING = frozenset(
    {
        *("not-converged", "many-suspects", "too-many-blunders", "lengths-contradict"),
        *("labels-swapped-everywhere", "mount-turned"),
        *("lengths-factor", "lengths-offset", "lengths-wrong-unit", "lengths-level"),
        *("control-shifted", "photos-mirrored"),
    }
)
"""Codes of what contradicts everything: nothing is to be used."""

TAKING_PART = frozenset(
    {
        *("pick-suspect", "line-suspect", "known-suspect", "control-suspect", "prior-strained"),
        *("telemetry-strained", "check-suspect", "blunder-not-located", "blunder-kept"),
        *("labels-swapped", "label-elsewhere", "line-wrong-unit", "line-wrong-digit"),
        *("line-other-ends", "lines-exchanged", "other-camera", "photo-mirrored", "photo-turned"),
        *("photo-elsewhere", "picks-contradict"),
        *("lengths-offset-possible", "lengths-level-possible"),
    }
)
"""Codes of what does not fit and still takes part: what is measured at its labels is in doubt."""

NOT_FITTING = frozenset(
    {
        *("line-left-out", "known-left-out", "control-left-out", "pick-left-out"),
        "height-left-out",
        *("frame-left-out", "line-removed", "known-removed", "pick-removed"),
        *("group-misfit", "checks-misfit", "misfit", "identification-less-exact"),
        *("camera-contradicted", "point-off-ground", "other-zoom", "readout-left-out"),
        *("clock-off", "gimbal-off", "heights-off", "clock-jumps", "log-of-another-day"),
        *("line-unseen", "known-unseen", "odd-height"),
        *("log-position-jump", "log-attitude-jump", "log-position-frozen", "log-attitude-frozen"),
    }
)
"""Codes of what does not fit, and was dealt with or is no single observation."""

UNCHECKED = frozenset(
    {
        *("nothing-checks", "ambiguous-pose", "three-lengths", "three-known"),
        *("measurement-null", "measurement-unknown"),
    }
)
"""Codes of what nothing decides or checks: reasons where a measurement is not in order."""


def pass_verdict(
    messages: Sequence[Message],
    fit: Fit,
    examined: TestedSurvey,
    table: MeasurementResults,
    put_right: Collection[str] = (),
) -> tuple[Verdict, tuple[MeasurementStatus, ...]]:
    """The verdict, and the status of each measurement.

    Parameters
    ----------
    messages
        All of the run, in the order in which people read them.
    fit
        How well everything fits, as numbers.
    examined
        The survey under test.
    table
        What was measured.
    put_right
        Codes of causes that bend the result, or measurements of it, no longer: it was mended.
    """
    still = [m for m in messages if m.code not in put_right]
    bent = fit.core < CONTRADICTED or any(m.code in CONTRADICTING for m in still)
    status = statuses(
        table,
        examined,
        is_contradicted=bent,
        contradicted=fit.check_labels,
        in_doubt={label for m in still if m.code in TAKING_PART for label in m.labels},
    )
    is_ok = all(one == "ok" for one in status)
    codes = CONTRADICTING | TAKING_PART | NOT_FITTING
    codes |= UNCHECKED if not is_ok else frozenset()
    if any(m.code == "misfit" for m in messages):
        codes -= {"group-misfit"}  # the same, of parts of it
    # What a cause explains is reported as information, and is no reason of its own.
    reasons = [reason_of(m) for m in messages if m.code in codes and m.level != "info"]
    reasons.sort(key=lambda one: one.cause in UNCHECKED)  # a misfit comes before what is unchecked
    level: VerdictLevel | None = "amber" if reasons or not is_ok else "green"
    if bent or fit.checks < CONTRADICTED:
        level = "red"
        status = tuple("doubtful" if one == "ok" else one for one in status)
    if not status:
        level = None
    return Verdict(level=level, reasons=tuple(reasons)), status


def reason_of(message: Message) -> Reason:
    """What a message gives as a reason."""
    return Reason(
        cause=message.code,
        text=first_sentences(message.text),
        frames=message.frames,
        labels=message.labels,
        lengths=message.lengths,
        measurements=message.measurements,
        plain=plain_sentence(message),
        mend=message.mend,
        instead=message.instead,
    )


def first_sentences(text: str, count: int = 2) -> str:
    """As much of a message as says what is wrong, and what to do."""
    parts = text.split(". ")
    return text if len(parts) <= count else ". ".join(parts[:count]) + "."
