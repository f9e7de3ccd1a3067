"""The one judgement of a result that people act on: red, amber or green, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.message import Remedy

VerdictLevel = Literal["green", "amber", "red"]
"""Red: the observations contradict each other, do not use the numbers. Amber: something does not
fit, or nothing checks it. Green: everything fits, and a gross error in any single reading would
have been noticed. No level at all (None): nothing was measured."""

MeasurementStatus = Literal["ok", "not-checked", "doubtful", "contradicted"]
"""Of one measurement: in order; nothing would show an error in it; something that it rests on does
not fit; something contradicts it."""


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Why a result is not green.

    Attributes
    ----------
    cause
        Code of the message that explains it (`uavgram explain`).
    text
        One plain sentence, and what to do.
    frames, labels, lengths, measurements
        Names of what it speaks of.
    plain
        What is wrong, in one sentence without numbers of tests; may be empty.
    mend
        What would put it right; None where only a person can.
    instead
        What else could, where nothing tells which.
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
