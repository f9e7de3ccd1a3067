"""Messages on misfits: each blunder once, with all observations inseparable from it.

Observations that a reported cause explains are not suspected.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.data_snooping import MOST_SUSPECTS
from uavgram.estimation.survey.observations.observation import Member, Misfit, Suspicion
from uavgram.model.message import Message, MessagePlural
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.remedies import read_first


def judge_suspects(examined: TestedSurvey) -> tuple[Message, ...]:
    """Report each suspicion; where there are too many, report a wrong model instead."""
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


def _meant(suspicion: Suspicion) -> set[tuple[str, int]]:
    """Return the suspected observation, and those inseparable from it."""
    return {(member.kind, member.row) for member in _members(suspicion)}


def _members(suspicion: Suspicion) -> tuple[Member, ...]:
    return (suspicion.accused, *suspicion.group, *suspicion.rivals)


def _message(examined: TestedSurvey, suspicion: Suspicion) -> Message:
    accused, names = suspicion.accused, examined.names
    observation, group = names.of(accused), examined.groups[accused.kind]
    own, thing = np.array([accused.row]), observation.things()
    if thing is not None:
        own = np.flatnonzero(thing == thing[accused.row])
    correlated = observation.whitening() is not None
    off = np.zeros(0) if correlated else examined.residuals(accused.kind)[own].ravel()
    redundancy = float(group.redundancy[accused.row, accused.axis])
    found = Misfit(accused, suspicion.w, redundancy, off)
    text, item = observation.misfit(found)
    others = []
    if suspicion.group:
        others.append(f"The {names.group(suspicion)}: {names.look(suspicion)}.")
        item += f", or the {' or the '.join(names.cause(m) for m in suspicion.group)}"
    if suspicion.rivals:
        others.append(names.rivals(suspicion))
    remedies = read_first(names.of(m).remedy(m.row) for m in _members(suspicion))
    return Message(
        "warning",
        observation.kind.misfit_code,
        " ".join([text, *others]),
        **names.subjects(accused),
        several=MessagePlural(observation.several(), item, ending=observation.kind.look),
        mend=remedies[0],
        instead=tuple(one for one in remedies[1:] if one is not None),
    )
