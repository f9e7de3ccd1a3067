"""Unchecked measurements: a gross error of a reading would move them far without being detected.

This does not depend on their sigmas, which only include errors of the stated size. A click is
checked by a click in another photo, by a second one in the same photo, and by lengths, known
things, control and checks at its point; a match repeats its source's click and checks nothing.

Also the priors with their tests, and for each measurement the undetected error that would move it
most.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.measuring.scale import find_next_line
from uavgram.estimation.reliability.external import MAX_ERROR_SIGMAS, UndetectedError
from uavgram.estimation.reliability.redundancy import TestedGroup
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.observation import Member
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message, Remedy
from uavgram.model.naming import format_digits, join_names
from uavgram.model.result.reliability import PriorResults, WeakestLinks
from uavgram.stages.judge.tested_survey import TestedSurvey, describe_effects
from uavgram.stages.remedies import make_tape_remedy


def judge_priors(examined: TestedSurvey) -> PriorResults:
    """Compute residual, w, redundancy, detectable bias and its effect for each axis of each prior.

    Telemetry by frame and axis, mount, biases, clock, ground, calibration and control points.
    """
    parts = [
        _group(examined, kind, group)
        for kind, group in examined.groups.items()
        if not get_kind(kind).has_table
    ]
    members = [m for part in parts for m in part[0]]
    residual, w, redundancy, bias, change, on = (
        np.concatenate([part[k] for part in parts]) for k in range(1, 7)
    )
    units = [examined.names.unit(m) for m in members]
    names = examined.names
    return PriorResults(
        kind=tuple(m.kind for m in members),
        name=tuple(names.axis(m) for m in members),
        frame_id=tuple("".join(names.subjects(m).get("frames", ())) for m in members),
        unit=tuple(unit for unit, _ in units),
        residual=residual,
        w=w,
        redundancy=redundancy,
        bias=bias * np.array([factor for _, factor in units]),
        effects=describe_effects(examined.measured, on.astype(np.int64), change),
    )


def _group(
    examined: TestedSurvey, kind: str, group: TestedGroup
) -> tuple[list[Member], *tuple[Floats, ...]]:
    """Return members, then residual, w, redundancy, bias, change and measurement of each axis."""
    n, a = group.w.shape
    members = [Member(kind, row, axis) for row in range(n) for axis in range(a)]
    worst = examined.worst[kind]
    columns = (
        compute_prior_residuals(group),
        group.w,
        group.redundancy,
        group.bias(examined.significance),
        worst.change,
        worst.measurement,
    )
    return members, *(np.asarray(column, dtype=np.float64).ravel() for column in columns)


def compute_prior_residuals(group: TestedGroup) -> Floats:
    """Compute adjusted minus stated (n, a), in stated sigmas; 0 for exactly known numbers."""
    scale = np.where(np.isfinite(group.scale), group.scale, np.inf)
    whitening = group.direction / scale[:, None, :]
    root = np.linalg.pinv(whitening)  # (n, a, r): root root^T is the stated covariance
    sigma = np.linalg.norm(root, axis=2)
    residual = np.einsum("nar,nr->na", root, group.block.residual)
    return np.asarray(np.where(sigma > 0, residual / np.where(sigma > 0, sigma, 1.0), 0.0))


def judge_weakest(examined: TestedSurvey) -> WeakestLinks:
    """Return the weakest link of each of M measurements, and its unchecked observations."""
    names, what, units = examined.names, [], []
    bias = np.full(len(examined.weakest), np.nan)
    for i, weakest in enumerate(examined.weakest):
        if weakest.member is None:
            what.append("")
            units.append("")
        else:
            what.append(names.observation(weakest.member))
            bias[i], unit = examined.bias(weakest.member)
            units.append(unit)
    return WeakestLinks(
        what=tuple(what),
        bias=bias,
        unit=tuple(units),
        change=np.array([weakest.change for weakest in examined.weakest]),
        unchecked=tuple(
            tuple(names.observation(m) for m in weakest.unchecked) for weakest in examined.weakest
        ),
    )


MAX_NAMED = 5

UNDETECTABLE_SIGMAS = MAX_ERROR_SIGMAS / 10
"""Sigmas of a reading above which an error counts as completely undetectable."""


KINDS_NEAR_ZERO = frozenset(
    {
        *("coordinate", "height", "vertical_distance", "plane_distance", "line_distance"),
        *("slope", "angle", "volume", "speed"),
    }
)
"""Kinds of measurements with a possible value of zero."""

OWN_MESSAGE = ("boresight", "pixels", "heights")
"""Kinds of observations with a message of their own where nothing checks them."""

INTERVAL_95 = 1.96
"""Half width of an interval of 95 %, in sigmas."""


def is_unchecked(examined: TestedSurvey) -> Bools:
    """Mark measurements (M,) that an undetectable error in a single reading would move far.

    Undetermined measurements are marked, too.
    """
    unseen = np.array([bool(one.unseen) for one in examined.weakest], dtype=np.bool_)
    return np.asarray(unseen | _is_unknown(examined.measured))


def _is_unknown(measured: MeasuredValues) -> Bools:
    """Mark measurements (M,) whose intervals reach zero: any size would fit."""
    small = np.abs(measured.value) < INTERVAL_95 * measured.sigma
    has_size = [row.request.kind not in KINDS_NEAR_ZERO for row in measured.rows]
    return np.asarray(small & np.array(has_size, dtype=np.bool_))


def _report_unknown(measured: MeasuredValues, moved: Collection[str]) -> Iterator[Message]:
    """Report undetermined measurements that no other solution moves."""
    unknown = np.flatnonzero(_is_unknown(measured)).tolist()
    rows = [i for i in unknown if measured.name[i] not in moved]
    if not rows:
        return
    values = (
        f"{measured.name[i]!r} ({format_digits(measured.value[i])} ± "
        f"{format_digits(measured.sigma[i])} "
        f"{measured.unit[i]})"
        for i in rows
    )
    text = (
        f"Nothing is known of {join_names(values, MAX_NAMED)}: any value down to zero would fit as "
        "well. Check the stated errors of picks and lengths; if they are right, "
        "pick in more photos or tape more lengths."
    )
    names = tuple(measured.name[i] for i in rows)
    yield Message("warning", "measurement-unknown", text, measurements=names)


def judge_unchecked(examined: TestedSurvey, moved: Collection[str] = ()) -> Iterator[Message]:
    """Report unchecked measurements, and the readings that would check them.

    One message on those that depend on the camera's assumed direction, one each on those that
    depend on clicks, on stated heights, and on lengths, known things and control points; the worst
    measurement gives the numbers. Another one on undetermined measurements.

    Parameters
    ----------
    examined
        The survey under test.
    moved
        Names of measurements that other solutions move beyond their intervals.
    """
    yield from _report_unknown(examined.measured, moved)
    for kind in (*OWN_MESSAGE, ""):
        found = {
            i: [one for one in weakest.unseen if _family(one) == kind]
            for i, weakest in enumerate(examined.weakest)
        }
        sigma = examined.measured.sigma
        rows = [i for i in found if found[i]]
        rows.sort(key=lambda i: -abs(found[i][0].change) / sigma[i])
        if rows:
            yield _message(examined, rows, found, kind)


def _family(unseen: UndetectedError) -> str:
    """Return the kind of readings with a message of its own; empty for all others."""
    return unseen.member.kind if unseen.member.kind in OWN_MESSAGE else ""


def _message(
    examined: TestedSurvey, rows: list[int], found: dict[int, list[UndetectedError]], kind: str
) -> Message:
    names = tuple(examined.measured.name[i] for i in rows)
    are = "are" if len(rows) > 1 else "is"
    worst = found[rows[0]][0]
    numbers = f" ({_numbers(examined, rows[0], worst)})"
    labels: tuple[str, ...] = ()
    mend = None
    if kind == "boresight":
        what = "a camera that did not look straight down"
        action = (
            "Neither the log nor the photos contain its direction: state the direction in `mount`"
        )
        numbers = ""  # an error of an unstated direction may have any size
    elif kind in ("pixels", "heights"):
        labels = examined.names.subjects(*(one.member for i in rows for one in found[i]))["labels"]
        what = f"a wrong {'click on' if kind == 'pixels' else 'height of'} {_name_any(labels)}"
        it = "them" if len(labels) > 1 else "it"
        action = f"Mark {it} in one more photo, from another side"
        if kind == "pixels":
            ways = ["yourself in one more photo", "again"]
            if len(examined.adjustment.survey.frame_id) == 1:
                ways.reverse()
            action = (
                f"Click {it} {ways[0]}, or {ways[1]}; a place that the program found from your "
                "click does not count"
            )
    else:
        what = f"an error in the {examined.names.observation(worst.member)}"
        action, mend = _second_reading(examined, worst)
    finding = f"{what} would not be noticed"
    plain = f"{finding[0].upper()}{finding[1:]}."
    if mend is None:
        plain = f"{plain} {action}."
    named = join_names(map(repr, names), MAX_NAMED)
    text = f"{named} {are} not checked: {finding}{numbers}. {action}."
    return Message(
        "warning",
        "nothing-checks",
        text,
        measurements=names,
        labels=labels,
        plain=plain,
        mend=mend,
    )


def _name_any(labels: Sequence[str]) -> str:
    """Return ``P1 or P2``; of many labels ``any of 5 points (P1, P2, P3 and 2 more)``."""
    if len(labels) <= MAX_NAMED:
        return join_names(labels, None, link="or")
    return f"any of {len(labels)} points ({join_names(labels, MAX_NAMED)})"


def _numbers(examined: TestedSurvey, row: int, worst: UndetectedError) -> str:
    """Describe the largest error that stays undetected, and its effect on a measurement."""
    measured, member = examined.measured, worst.member
    what = f"the {examined.names.observation(member)}"
    if worst.sigmas > UNDETECTABLE_SIGMAS:
        return f"however large an error in {what} is, no test shows it"
    unit, factor = examined.names.unit(member)
    size = worst.sigmas * float(examined.groups[member.kind].scale[member.row, member.axis])
    return (
        f"an error in {what} stays hidden up to {format_digits(size * factor)} {unit}, and then "
        f"moves "
        f"{measured.name[row]!r} by {format_digits(worst.change)} {measured.unit[row]}"
    )


def _second_reading(examined: TestedSurvey, worst: UndetectedError) -> tuple[str, Remedy | None]:
    """Suggest a reading that would check another one."""
    if worst.member.kind == "control":
        return "Look at its coordinates once more, or give another control point", None
    advice = find_next_line(examined.adjustment)
    if advice is None:
        return "Tape another line, or give another thing that is known", None
    name = examined.adjustment.survey.label
    ends = name[advice.start], name[advice.end]
    words = f"Tape next from {ends[0]!r} to {ends[1]!r}, about {advice.length_m:.1f} m"
    return words, make_tape_remedy(*ends, advice.length_m)
