"""What does not fit, in words: each blunder once, with all that no test can part from it.

What a cause explains that is told anyway is not blamed.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.data_snooping import MOST_SUSPECTS
from uavgram.estimation.survey.names import POSE_AXES, STEADY_CHANGE
from uavgram.estimation.survey.suspicion import Member, Suspicion
from uavgram.model.arrays import Floats
from uavgram.model.message import Message, Several
from uavgram.model.naming import figures
from uavgram.model.remedy import Remedy
from uavgram.model.survey.known import KnownThing
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.remedies import read_first, unpicked, without_lengths

CODES = {
    "pixels": "pick-suspect",
    "lengths": "line-suspect",
    "known": "known-suspect",
    "control": "control-suspect",
    "telemetry": "telemetry-strained",
}


READINGS_TOGETHER = {
    "pixels": ("{count} picks do not fit", "Look at their places and at their labels."),
    "lengths": (
        "{count} known lengths do not fit",
        "Look at the readings, at their ends and at their picks.",
    ),
    "known": (
        "{count} known things do not fit",
        "Look at their values, at their points and at their picks.",
    ),
    "control": (
        "{count} control points do not fit",
        "Look at their coordinates, their labels and their picks.",
    ),
    "telemetry": (
        "{count} photos do not stand where the log has them",
        "Look at their picks, their times and the gimbal.",
    ),
}
PRIORS_TOGETHER = (
    "{count} things that were assumed do not fit the picks, lengths and log",
    "Check their values and sigmas in the project.",
)


def judge_suspects(examined: TestedSurvey) -> tuple[Message, ...]:
    """One message for each suspicion; where there are too many, the model is named instead."""
    blameless = _blameless(examined)
    messages = [
        _message(examined, suspicion)
        for suspicion in examined.suspicions
        if blameless.isdisjoint(_meant(suspicion))
    ]
    if len(examined.suspicions) >= MOST_SUSPECTS:
        text = (
            f"{MOST_SUSPECTS} picks and lengths or more do not fit; the first {MOST_SUSPECTS} are "
            "named. Something common to them is wrong: look at labels, the camera file, the "
            "ground, times."
        )
        messages.append(Message("warning", "many-suspects", text))
    return tuple(messages)


def _blameless(examined: TestedSurvey) -> set[tuple[str, int]]:
    """Picks and lengths, by group and row, of which a cause explains that they do not fit."""
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


def _meant(suspicion: Suspicion) -> set[tuple[str, int]]:
    """The observation that is accused, and those that no test parts from it."""
    return {(member.kind, member.row) for member in _members(suspicion)}


def _members(suspicion: Suspicion) -> tuple[Member, ...]:
    return (suspicion.accused, *suspicion.group, *suspicion.rivals)


def _message(examined: TestedSurvey, suspicion: Suspicion) -> Message:
    kind, names = suspicion.accused.kind, examined.names
    words = {
        "pixels": _pick,
        "lengths": _length,
        "known": _known,
        "control": _control,
        "telemetry": _pose,
        "tape": _tape,
    }
    text, item = words.get(kind, _prior)(examined, suspicion)
    opening, ending = READINGS_TOGETHER.get(kind, PRIORS_TOGETHER)
    others = []
    if suspicion.group:
        others.append(f"The {names.group(suspicion)}: {names.look(suspicion)}.")
        item += f", or the {' or the '.join(names.cause(m) for m in suspicion.group)}"
    if suspicion.rivals:
        others.append(names.rivals(suspicion))
    remedies = read_first(_remedy(examined, m) for m in _members(suspicion))
    return Message(
        "warning",
        CODES.get(kind, "prior-strained"),
        " ".join([text, *others]),
        **names.subjects(suspicion.accused),
        several=Several(opening, item, ending=ending),
        mend=remedies[0],
        instead=tuple(one for one in remedies[1:] if one is not None),
    )


def _remedy(examined: TestedSurvey, member: Member) -> Remedy | None:
    """A pick removed, or a length removed; None where only a person can put it right."""
    if member.kind == "pixels":
        return unpicked([examined.names.pick(member.row)])
    if member.kind == "lengths":
        survey = examined.adjustment.survey
        line = examined.adjustment.problem.line_index[member.row]
        return without_lengths([survey.line_name[line] if survey.line_name else ""])
    return None


def _pick(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    """What does not fit and where to look, as a sentence; and in a few words."""
    row = suspicion.accused.row
    u, v = examined.residuals("pixels")[row]
    frame, label = examined.names.pick(row)
    how = f"(w = {suspicion.w:.1f}, residual {u:+.1f}, {v:+.1f} px)"
    what = f"{label!r} in {frame!r}"
    return (
        f"The pick of {what} does not fit: look at the place and at the label {how}.",
        f"{what} {how}",
    )


def _length(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    line = examined.adjustment.problem.line_index[row]
    taped = survey.length_m[line]
    adjusted = taped + examined.residuals("lengths")[row, 0]
    what = examined.names.length(row)
    how = f"taped {taped:.3f} m, adjusted {adjusted:.3f} m (w = {suspicion.w:.1f})"
    return (
        f"The length {what} does not fit: {how}. Look at the reading, at its ends and at their "
        f"picks.",
        f"{what} {how}",
    )


def _known(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    problem, row = examined.refined.adjustment.problem, suspicion.accused.row
    thing = problem.known[problem.known_thing[row]]
    own = np.flatnonzero(problem.known_thing == problem.known_thing[row])
    off = examined.residuals("known")[own, 0]
    what = examined.names.known(row)
    how = f"{departure(thing, off)} (w = {suspicion.w:.1f})"
    given = "value" if thing.position is None else "coordinates"
    return (
        f"The known {what} does not fit: {how}. Look at its {given}, at its points and at their "
        f"picks.",
        f"{what} {how}",
    )


def departure(thing: KnownThing, off: Floats) -> str:
    """``given 3.500 m, adjusted 3.612 m``, or of a condition ``off by 0.112 m``.

    Parameters
    ----------
    thing
        What is known.
    off
        (r,) its residuals, in its unit.
    """
    size, unit = float(np.linalg.norm(off)), thing.unit
    if thing.is_condition:
        return f"off by {size:.3f} {unit}"
    adjusted = thing.value + (float(off[0]) if len(off) == 1 else size)
    return f"given {thing.value:.3f} {unit}, adjusted {adjusted:.3f} {unit}"


def _control(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    residual = examined.residuals("control")[row]
    label = survey.label[survey.control_label[row]]
    how = f"(w = {suspicion.w:.1f}, found minus known {', '.join(f'{r:+.3f}' for r in residual)} m)"
    return (
        f"The control point {label!r} does not fit: look at its coordinates, its label and its "
        f"picks {how}.",
        f"{label!r} {how}",
    )


def _pose(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    frame = examined.names.frame(suspicion.accused.row)
    how = f"{POSE_AXES[suspicion.accused.axis]}, w = {suspicion.w:.1f}"
    return (
        f"Photo {frame!r} does not stand where the log has it: {how}. Look at its picks, its time "
        "and the gimbal.",
        f"{frame!r} ({how})",
    )


def _tape(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    adjustment, row = examined.refined.adjustment, suspicion.accused.row
    # Without its prior the scale would be the estimate over the prior's redundancy.
    free = adjustment.state.tape[row] / examined.groups["tape"].redundancy[row, 0]
    what = examined.names.tape(row)
    size, side = f"{figures(100.0 * abs(free))} %", "long" if free > 0 else "short"
    return (
        f"By all that does not rest on it, {what} seems to be {size} too {side}: compare it with "
        f"another one, or state how good it is (tape: scale_sigma; w = {suspicion.w:.1f}).",
        f"{what} seems to be {size} too {side} (w = {suspicion.w:.1f})",
    )


def _prior(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    if suspicion.accused.kind == "clock_drift":
        return (
            "Something that changes steadily from the first photo to the last does not fit "
            f"(w = {suspicion.w:.1f}). It may be positions of the log that jump or wander, a wrong "
            "scale of the lengths, ground that is no plane, or the times of the photos: look at "
            "these, and at the other messages.",
            f"{STEADY_CHANGE} (w = {suspicion.w:.1f})",
        )
    what = examined.names.prior(suspicion.accused)
    return (
        f"What was assumed of the {what} does not fit the picks, lengths and log: check its value "
        f"and sigma in the project (w = {suspicion.w:.1f}).",
        f"{what} (w = {suspicion.w:.1f})",
    )
