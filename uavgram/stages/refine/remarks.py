"""What the refinement has to say: left out, removed, ambiguous, not at rest."""

from __future__ import annotations

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Refined, Removal
from uavgram.model.message import Message
from uavgram.model.survey import Survey


def remarks(survey: Survey, refined: Refined) -> tuple[Message, ...]:
    """Everything that the result itself shows: picks left out, removals, ambiguity, no rest."""
    messages = []
    for index, why in sorted(refined.pick_reason.items()):
        label = survey.label[survey.pick_label[index]]
        frame = survey.frame_id[survey.pick_frame[index]]
        text = f"The pick of {label!r} in {frame!r} was left out: {why}."
        messages.append(Message("warning", "pick-left-out", text))
    messages += [
        Message("warning", f"{removal.kind}-removed", _removal(survey, removal))
        for removal in refined.removals
    ]
    if not refined.adjustment.minimum.converged:
        text = (
            "The adjustment did not come to rest: do not trust these numbers. Look for a swapped "
            "label or a wrong length."
        )
        messages.append(Message("error", "not-converged", text))
    return (*messages, *_ambiguity(refined))


def _removal(survey: Survey, removal: Removal) -> str:
    what = _observation(survey, removal)
    return f"{what} was removed as a blunder (w = {removal.w:.1f}); the rest was adjusted anew."


def _observation(survey: Survey, removal: Removal) -> str:
    if removal.kind == "pick":
        label = survey.label[survey.pick_label[removal.index]]
        frame = survey.frame_id[survey.pick_frame[removal.index]]
        return f"The pick of {label!r} in {frame!r}"
    start = survey.label[survey.line_start[removal.index]]
    end = survey.label[survey.line_end[removal.index]]
    return f"The length {start!r} to {end!r}"


def not_located(survey: Survey, blunders: list[Removal]) -> Message:
    """There is a blunder that no test can tell from its neighbours."""
    lines = [_observation(survey, b) for b in blunders if b.kind == "line"]
    named = ", ".join(lines or [_observation(survey, b) for b in blunders[:4]])
    text = (
        f"There is a blunder (w = {blunders[0].w:.1f}), but {len(blunders)} observations could be "
        f"the wrong one, so none was removed: {named}. Look at them, or tape another line."
    )
    return Message("warning", "blunder-not-located", text)


def indispensable(survey: Survey, removal: Removal, why: GeometryError) -> Message:
    """What looks like a blunder is needed: without it the survey is not determined."""
    text = (
        f"{_observation(survey, removal)} looks like a blunder (w = {removal.w:.1f}), but was "
        f"kept: without it, {why}"
    )
    return Message("warning", "blunder-kept", text)


def _ambiguity(refined: Refined) -> list[Message]:
    survey = refined.adjustment.survey
    if survey.telemetry is not None or survey.gauge == "world":
        return []
    messages = []
    if refined.alternatives:
        text = (
            f"The lengths fit {len(refined.alternatives) + 1} different poses equally well; the "
            "measured values of the others stand under alternatives. Tape another line that does "
            "not close a triangle, or give the flight log."
        )
        messages.append(Message("warning", "ambiguous-pose", text))
    if len(refined.adjustment.problem.line_index) == 3:
        text = (
            "Three lengths alone: nothing checks them, and they may have several solutions. Tape "
            "a fourth line that does not close a triangle."
        )
        messages.append(Message("warning", "three-lengths", text))
    return messages


def too_many(removed: int) -> Message:
    """The removal was stopped: what is wrong is no single observation."""
    text = (
        f"{removed} observations were removed and still others do not fit: the removal was "
        "stopped. Something common to them is wrong: labels, the camera file, the ground, times."
    )
    return Message("error", "too-many-blunders", text)
