"""Measurements that nothing checks: an error of a reading that no test finds would move them far.

However small their sigmas are: these only say what errors of the stated size do.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.estimation.measuring.next_length import next_line
from uavgram.estimation.reliability.external import UNCHECKED, largest_unseen
from uavgram.estimation.survey.suspicion import Member
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.naming import listed
from uavgram.model.remedy import Remedy
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.remedies import to_tape

FAR = 5.0
"""Sigmas by which a reading may move a measurement unseen, beyond which nothing checks it. In clean
surveys of nine photos and six lengths, distances between points in one photo lie between 7.7 and 41
(37 of them), those between points in two photos at 3.4 (median; 1 in 20 beyond 5), in three at 2.5;
where one length and the log give the scale, at 5 to 7."""

MOST_NAMED = 5


def is_unchecked(examined: TestedSurvey) -> Bools:
    """(M,) which measurements an error in a single reading would move far, and nothing show it."""
    sigma, weakest = examined.measured.sigma, examined.weakest
    moved = np.array([abs(one.reading_change) for one in weakest])
    return np.asarray(moved > FAR * np.where(sigma > 0, sigma, np.inf), dtype=np.bool_)


def judge_unchecked(examined: TestedSurvey) -> Iterator[Message]:
    """What nothing checks, the worst of it in numbers, and what would check it.

    One message on what hangs on picks, one on what hangs on lengths and other things known.
    """
    rows = np.flatnonzero(is_unchecked(examined))
    weakest, sigma = examined.weakest, examined.measured.sigma
    rows = rows[np.argsort([-abs(weakest[i].reading_change) / sigma[i] for i in rows])]
    alike: dict[bool, list[int]] = {}
    for i in rows.tolist():
        alike.setdefault(_is_pick(weakest[i].reading), []).append(i)
    for own in alike.values():
        names = tuple(examined.measured.name[i] for i in own)
        text = (
            f"Nothing checks {listed(map(repr, names))}: {_why(examined, own[0])}. "
            f"{_what_to_do(examined, weakest[own[0]].reading)}"
        )
        mend = _to_tape(examined, weakest[own[0]].reading)
        yield Message("warning", "nothing-checks", text, measurements=names, mend=mend)


def _is_pick(member: Member | None) -> bool:
    return member is not None and member.kind == "pixels"


def _why(examined: TestedSurvey, row: int) -> str:
    """The smallest error that would show, and what it does to a measurement."""
    member, change = examined.weakest[row].reading, abs(examined.weakest[row].reading_change)
    assert member is not None  # noqa: S101  (it moves the measurement)
    measured = examined.measured
    what = examined.names.observation(member)
    unit = measured.unit[row]
    moves = f"would move {measured.name[row]!r} by {change:.2g} {unit}"
    size, own = _size(examined, member)
    if examined.groups[member.kind].redundancy[member.row, member.axis] > UNCHECKED:
        return f"an error in the {what} shows only from {size:.2g} {own} on, which {moves}"
    return f"no error in the {what} would show, and one of {size:.2g} {own} {moves}"


def _size(examined: TestedSurvey, member: Member) -> tuple[float, str]:
    """Of the error that was reckoned with, and its unit."""
    group = examined.groups[member.kind]
    at = member.row, member.axis
    if group.redundancy[at] > UNCHECKED:
        return examined.bias(member)
    unit, factor = examined.names.unit(member)
    return float(largest_unseen(group, examined.significance) * group.scale[at]) * factor, unit


def _to_tape(examined: TestedSurvey, member: Member | None) -> Remedy | None:
    """The length to tape next; None where that is not what would check it."""
    advice = next_line(examined.adjustment)
    if advice is None or (member is not None and member.kind in ("pixels", "control")):
        return None
    name = examined.adjustment.survey.label
    return to_tape(name[advice.start], name[advice.end], advice.length_m)


def _what_to_do(examined: TestedSurvey, member: Member | None) -> str:
    if member is not None and member.kind == "pixels":
        label = examined.names.pick(member.row)[1]
        return (
            f"Look at that pick once more, and pick {label!r} in another photo too or tape a line "
            "that ends there."
        )
    if member is not None and member.kind == "control":
        return "Look at its coordinates once more, or give another control point."
    advice = next_line(examined.adjustment)
    if advice is None:
        return "Tape another line, or give another thing that is known."
    name = examined.adjustment.survey.label
    return (
        f"Tape next from {name[advice.start]!r} to {name[advice.end]!r}, about "
        f"{advice.length_m:.1f} m."
    )
