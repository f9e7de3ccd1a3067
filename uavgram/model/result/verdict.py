"""Verdict on a result: red, amber or green, with its reasons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.message import Remedy

VerdictLevel = Literal["green", "amber", "red"]
"""Level of a verdict.

Red: the observations contradict each other, do not use the numbers. Amber: something does not fit,
or nothing checks it. Green: everything fits, and a gross error in any single reading would have
been noticed. No level at all (None): nothing was measured.
"""

MeasurementStatus = Literal["ok", "not-checked", "doubtful", "contradicted"]
"""Status of one measurement.

In order; no observation would show an error in it; an observation on which it depends does not fit;
an observation contradicts it.
"""


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Reason why a result is not green.

    Attributes
    ----------
    cause
        Code of the message that explains it (`uavgram explain`).
    text
        One plain sentence, and the action.
    frames, labels, lengths, measurements
        Names of its subjects.
    plain
        Finding in one sentence without numbers of tests; may be empty.
    mend
        Proposed correction; None where only a person can.
    instead
        Alternatives, where the observations cannot decide.
    """

    cause: str
    text: str
    frames: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()
    measurements: tuple[str, ...] = ()
    plain: str = ""
    mend: Remedy | None = None
    instead: tuple[Remedy, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Level of a whole result, and its reasons, the likeliest cause first; none where green.

    The level is None where nothing was measured: there is no verdict without a measurement.
    """

    level: VerdictLevel | None
    reasons: tuple[Reason, ...] = ()
