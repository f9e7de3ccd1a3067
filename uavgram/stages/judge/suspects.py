"""Messages on suspected blunders, and the record of those that were removed.

Observations that a reported cause explains are not suspected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from uavgram.estimation.measuring.propagation import MeasuredValues, compute_values
from uavgram.estimation.reliability.data_snooping import MAX_SUSPECTS
from uavgram.estimation.survey.adjustment import LeftOutRows, Reading, Refined
from uavgram.estimation.survey.names import ObservationNames
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.known import describe_thing
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.estimation.survey.observations.observation import Member, Misfit, Suspicion
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.message import (
    Message,
    MessagePlural,
    Remedy,
    propose_length_removal,
    propose_pick_removal,
)
from uavgram.model.naming import join_names
from uavgram.model.observations import NO_KNOWN, KnownLines, KnownThings, MeasurementRequest
from uavgram.model.result.reliability import RemovalRecord
from uavgram.stages.judge.tested_survey import TestedSurvey, is_mount_open
from uavgram.stages.remedies import read_first, report_not_located

AGAIN = {
    "pixels": "click on {} again or in another photo (and look at a stated height)",
    "lengths": "tape {} again",
    "known": "measure {} again",
    "control": "look at the coordinates of {}",
}
"""Advice to check readings, by their kind."""


def list_contested(refined: Refined) -> tuple[Reading, ...]:
    """List the left-out readings in whose place others, or the camera's mount, may be wrong."""
    if not is_mount_open(refined.adjustment):
        return refined.contested
    by_mount = [one for one in refined.left_out if one.kind == "lengths"]
    return tuple(dict.fromkeys((*refined.contested, *by_mount)))


def judge_rivals(refined: Refined) -> Iterator[Message]:
    """Report left-out readings together with the others that may be wrong in their place."""
    settled = refined.settled
    left = tuple(one for one in list_contested(refined) if one.name not in settled)
    # Two clicks of one point in a photo have their own message.
    left = tuple(one for one in left if not _is_repeated(refined, one))
    if not left:
        return
    sets = [left, *(one.readings for one in refined.rivals if set(one.instead_of) & set(left))]
    every = tuple(dict.fromkeys(chain.from_iterable(sets)))
    if len(sets) == 1:  # another mistake, or the mount, explains as much
        sets = [(one,) for one in left]
    suspects = _name_suspects(sets)
    action = _advise(every)
    if is_mount_open(refined.adjustment):
        suspects.append("the camera's direction, straight down, which is only assumed")
        action = f"State the camera's direction in `mount`. {action}"
    clicks = [one for one in every if one.kind == "pixels"]
    others = refined.possible
    either = join_names(suspects, None, link="or")
    finding = f"One of these is wrong: {either}"
    if others:
        mistakes = (one.split_text(": ")[0].removesuffix(".") for one in others)
        finding = f"Either {either} is wrong, or {', or '.join(map(_lower_first, mistakes))}"
        action = f"{action}, or look whether the other mistake was made"
    were = "was" if len(left) == 1 else "were"
    # What a click spoils is at its point; what a reading between points spoils, at each of these.
    labels = [label for one in clicks or every for label in one.labels]
    lengths = [one.name for one in every if one.kind == "lengths"]
    plain = f"{lengths[0]} does not fit." if len(suspects) == len(lengths) == 1 else ""
    yield Message(
        "warning",
        "blunder-not-located",
        f"{finding}. All the rest fits without any one of them, and nothing shows which. Of these, "
        f"{join_names([one.words for one in left])} {were} left out. {action}.",
        frames=_merge([one.frames for one in every], [one.frames for one in others]),
        labels=_merge([labels], [one.labels for one in others]),
        lengths=_merge([lengths], [one.lengths for one in others]),
        plain=plain,
        instead=tuple(one for one in read_first(map(_remove, every)) if one is not None),
    )


def _is_repeated(refined: Refined, left: Reading) -> bool:
    """Return whether another click of the same point in a photo is the rival of a click."""
    return any(
        left.kind == one.kind == "pixels" and left.name == one.name
        for rival in refined.rivals
        for one in rival.readings
    )


def _name_suspects(sets: Sequence[tuple[Reading, ...]]) -> list[str]:
    """Name readings that are wrong together or alone; single clicks of a photo in one phrase."""
    clicks: dict[str, list[str]] = {}
    found: list[str] = []
    for some in dict.fromkeys(sets):
        if len(some) == 1 and some[0].kind == "pixels":
            clicks.setdefault(some[0].frames[0], []).append(repr(some[0].name))
        else:
            every = "both" if len(some) == 2 else "all of them"
            words = join_names((one.words for one in some), None)
            found.append(words if len(some) == 1 else f"{words} ({every})")
    for frame, names in clicks.items():
        found.append(f"the click on {join_names(names, None, link='or')} in {frame!r}")
    return found


def _advise(readings: Sequence[Reading]) -> str:
    """Return the advice how to check some readings, as a sentence."""
    names: dict[str, list[str]] = {}
    for one in readings:
        names.setdefault(one.kind, []).append(repr(one.name))
    parts = [AGAIN[kind].format(join_names(some, None)) for kind, some in names.items()]
    advice = ", and ".join(parts)
    return advice[:1].upper() + advice[1:]


def _remove(reading: Reading) -> Remedy | None:
    if reading.kind == "lengths":
        return propose_length_removal([reading.name])
    if reading.kind == "pixels":
        return propose_pick_removal([(reading.frames[0], reading.name)])
    return None


def _merge(*groups: Sequence[Sequence[str]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for names in group for name in names))


def _lower_first(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def judge_suspects(examined: TestedSurvey) -> tuple[Message, ...]:
    """Report each suspicion; where there are too many, report a wrong model instead."""
    blameless = _find_explained(examined)
    messages = [
        _suspect_message(examined, suspicion)
        for suspicion in examined.suspicions
        if blameless.isdisjoint(_inseparable(suspicion))
    ]
    if len(examined.suspicions) >= MAX_SUSPECTS:
        text = (
            f"{MAX_SUSPECTS} picks and lengths or more do not fit; the first {MAX_SUSPECTS} are "
            "named. Something common to them is wrong: look at labels, the camera, the "
            "ground, times."
        )
        messages.append(Message("warning", "many-suspects", text))
    return tuple(messages)


def _find_explained(examined: TestedSurvey) -> set[tuple[str, int]]:
    """Return picks and lengths, by group and row, whose misfit a cause explains."""
    refined = examined.refined
    mends = [cause.mend for cause in refined.causes if cause.mend is not None]
    picks = {pick for mend in mends for pick in mend.picks | mend.without_picks}
    lines = {line for mend in mends for line in mend.lines | mend.without_lines}
    settled = refined.settled
    names = examined.adjustment.survey.line_name
    taking = examined.adjustment.problem.line_index
    return {
        ("pixels", row) for row, pick in enumerate(refined.pick_index.tolist()) if pick in picks
    } | {
        ("lengths", row)
        for row, line in enumerate(taking.tolist())
        if int(refined.line_index[line]) in lines or (names and names[line] in settled)
    }


def _inseparable(suspicion: Suspicion) -> set[tuple[str, int]]:
    """Return the suspected observation, and those inseparable from it."""
    return {(member.kind, member.row) for member in _members(suspicion)}


def _members(suspicion: Suspicion) -> tuple[Member, ...]:
    return (suspicion.suspect, *suspicion.group, *suspicion.rivals)


def _suspect_message(examined: TestedSurvey, suspicion: Suspicion) -> Message:
    accused, names = suspicion.suspect, examined.names
    observation, group = names.find_kind(accused), examined.groups[accused.kind]
    own, thing = np.array([accused.row]), observation.things()
    if thing is not None:
        own = np.flatnonzero(thing == thing[accused.row])
    correlated = observation.whitening() is not None
    off = np.zeros(0) if correlated else examined.residuals(accused.kind)[own].ravel()
    redundancy = float(group.redundancy[accused.row, accused.axis])
    found = Misfit(accused, suspicion.w, redundancy, off)
    text, item = observation.misfit(found)
    # A reading that others can be wrong instead of is not accused.
    if accused.kind in READINGS and len(_members(suspicion)) > 1:
        return report_not_located(names, suspicion, f"For example, {item}.")
    others = []
    if suspicion.group:
        others.append(names.advice(suspicion))
        item += f", or the {' or the '.join(names.cause(m) for m in suspicion.group)}"
    if suspicion.rivals:
        others.append(names.rivals(suspicion))
    remedies = read_first(names.find_kind(m).remedy(m.row) for m in _members(suspicion))
    return Message(
        "warning",
        observation.kind.misfit_code,
        " ".join([text, *others]),
        **names.subjects(accused),
        several=MessagePlural(observation.several(), item, ending=observation.advice()),
        mend=remedies[0],
        instead=tuple(one for one in remedies[1:] if one is not None),
    )


def judge_removals(
    refined: Refined,
    lines: KnownLines,
    line_index: Ints,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
    measured: MeasuredValues,
    known: KnownThings = NO_KNOWN,
) -> tuple[RemovalRecord, ...]:
    """Describe the removals, step by step.

    Parameters
    ----------
    refined
        The adjusted survey, with its removals.
    lines, line_index
        All known lengths, and their rows in the survey given to refine.
    requests, frames
        The measurements, computed before and after each step.
    measured
        The final measurements.
    known
        All known things.
    """
    at = {int(index): i for i, index in enumerate(line_index) if index >= 0}
    steps = [removal.before for removal in refined.removals] + [refined]
    values = [
        None
        if r is None
        else compute_values(r.adjustment.problem, r.adjustment.state, requests, frames)
        for r in steps
    ]
    records = []
    for k, removal in enumerate(refined.removals):
        suspicion, before = removal.suspicion, values[k]
        later = next(j for j in range(k + 1, len(steps)) if steps[j] is not None)
        after = values[later]
        assert after is not None  # noqa: S101  (that step is there)
        change = np.full(len(after), np.nan)
        if before is not None:
            change = after - before
        elif removal.rows is not None:
            change = _linear_change(refined, measured, removal.rows)
        group: tuple[str, ...] = ()
        rivals: tuple[str, ...] = ()
        if removal.cause is not None:
            what = removal.cause.message.text
        elif removal.before is None and removal.kind == "known":
            i = removal.index
            what = f"known {describe_thing(known.kind[i], known.name[i], known.points[i])}"
        elif removal.before is None:
            i = at[removal.index]
            what = f"length {describe_ends(lines.name[i], lines.start[i], lines.end[i])}"
        else:
            names = ObservationNames(removal.before.adjustment)
            what = names.observation(suspicion.suspect)
            group = tuple(names.observation(m) for m in suspicion.group)
            rivals = tuple(names.observation(m) for m in suspicion.rivals)
        records.append(
            RemovalRecord(
                what=what,
                w=suspicion.w,
                group=group,
                rivals=rivals,
                variance_factor_before=_factor(steps[k]),
                variance_factor_after=_factor(steps[later]),
                change=tuple(change.tolist()),
                cause="" if removal.cause is None else removal.cause.message.code,
                mended=removal.mended,
            )
        )
    return tuple(records)


def _linear_change(refined: Refined, measured: MeasuredValues, rows: LeftOutRows) -> Floats:
    """Predict the change of the values (M,) when an observation is left out.

    Notes
    -----
    With it, the values f would move by Cov(f, l) (Cov(l, l) + R)^-1 (l - p), where l is observed, R
    is its covariance, and p its prediction: the update of a Kalman filter, in the linear model.
    """
    jacobian = np.zeros((len(rows.error), len(measured.solved)))
    for row, (columns, gradient) in enumerate(zip(rows.columns, rows.gradient, strict=True)):
        np.add.at(jacobian[row], columns, gradient)  # an unknown may occur twice
    solved = refined.adjustment.minimum.factor.solve(jacobian.T)
    covariance = jacobian @ solved + np.diag(rows.sigma**2)
    return np.asarray((jacobian @ measured.solved).T @ np.linalg.solve(covariance, rows.error))


def _factor(refined: Refined | None) -> float:
    """Return the variance factor of an adjustment; NaN where there is none."""
    return np.nan if refined is None else refined.adjustment.variance_factor
