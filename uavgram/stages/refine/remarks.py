"""What the refinement has to say: left out, removed, ambiguous, not at rest."""

from __future__ import annotations

from typing import Literal

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Refined, Removal
from uavgram.estimation.line_advice import distance_changes, line_faults, next_line
from uavgram.estimation.observation_names import Names
from uavgram.estimation.suspicion import Suspicion
from uavgram.model.message import Message
from uavgram.model.survey import Survey

WEAK = 0.01
"""Relative sigma of the scene's distances (root mean square) from which the lengths are weak."""


def remarks(survey: Survey, refined: Refined) -> tuple[Message, ...]:
    """Everything that the result itself shows: picks left out, removals, ambiguity, no rest."""
    messages = _left_out(survey, refined)
    messages += [
        Message("warning", f"{removal.kind}-removed", _removal(removal))
        for removal in refined.removals
    ]
    if not refined.adjustment.minimum.converged:
        text = (
            "The adjustment did not come to rest: do not trust these numbers. Look for a swapped "
            "label or a wrong length."
        )
        messages.append(Message("error", "not-converged", text))
    return (*messages, *_ambiguity(refined), *_weak_lengths(refined))


def _left_out(survey: Survey, refined: Refined) -> list[Message]:
    """Frames of which nothing is left, each once; and picks of frames that stayed."""
    frames: dict[int, dict[str, int]] = {}
    messages = []
    stayed = set(refined.adjustment.survey.frame_id)
    for index, why in sorted(refined.pick_reason.items()):
        label = survey.label[survey.pick_label[index]]
        frame = int(survey.pick_frame[index])
        name = survey.frame_id[frame]
        if name in stayed:
            text = f"The pick of {label!r} in {name!r} was left out: {why}."
            messages.append(Message("warning", "pick-left-out", text))
        else:
            number = frames.setdefault(frame, {})
            number[why] = number.get(why, 0) + 1
    for frame, reasons in frames.items():
        why = "; ".join(
            text if len(reasons) == 1 else f"{text} ({_picks(number)})"
            for text, number in reasons.items()
        )
        text = f"The frame {survey.frame_id[frame]!r} was left out, with all of its picks: {why}."
        messages.append(Message("warning", "frame-left-out", text))
    return messages


def _picks(number: int) -> str:
    return "1 pick" if number == 1 else f"{number} picks"


def _removal(removal: Removal) -> str:
    names = Names(removal.before.adjustment)
    what = names.observation(removal.suspicion.accused)
    text = f"The {what} was removed as a blunder (w = {removal.w:.1f}); the rest was adjusted anew."
    if removal.suspicion.group:
        text += f" It may be the {names.group(removal.suspicion)}: {names.look(removal.suspicion)}."
    if removal.suspicion.rivals:
        text += f" {names.rivals(removal.suspicion)}"
    return text


def not_located(refined: Refined, suspicion: Suspicion) -> Message:
    """There is a blunder that no test can tell from its neighbours."""
    names = Names(refined.adjustment)
    text = (
        f"There is a blunder (w = {abs(suspicion.w):.1f}), but none was removed: the "
        f"{names.group(suspicion)}: {names.look(suspicion)}, or tape another line."
    )
    return Message("warning", "blunder-not-located", text)


def indispensable(removal: Removal, why: GeometryError) -> Message:
    """What looks like a blunder is needed: without it the survey is not determined."""
    what = Names(removal.before.adjustment).observation(removal.suspicion.accused)
    text = f"The {what} looks like a blunder (w = {removal.w:.1f}), but was kept: without it, {why}"
    return Message("warning", "blunder-kept", text)


def _ambiguity(refined: Refined) -> list[Message]:
    survey = refined.adjustment.survey
    if survey.telemetry is None and survey.gauge == "world":
        return _ambiguous_control(refined)
    messages = []
    if refined.alternatives:
        within = "" if survey.telemetry is None else " within what the telemetry allows"
        how_else = "" if survey.telemetry is not None else ", or give the flight log"
        text = (
            f"The lengths fit {len(refined.alternatives) + 1} different poses about equally well"
            f"{within}: {_differences(refined)}. The measured values of the others stand under "
            f"alternatives. Tape another line that does not close a triangle{how_else}."
        )
        messages.append(Message("warning", "ambiguous-pose", text))
    if survey.telemetry is None and len(refined.adjustment.problem.line_index) == 3:
        text = (
            "Three lengths alone: nothing checks them, and they may have several solutions. Tape "
            f"a fourth line that does not close a triangle{_suggestion(refined)}."
        )
        messages.append(Message("warning", "three-lengths", text))
    return messages


def _differences(refined: Refined) -> str:
    """By how much the alternatives change the distances between the points, in words."""
    words = []
    for other in refined.alternatives:
        median, largest = distance_changes(refined.adjustment, other)
        words.append(f"{100 * median:.2g} % at the median and up to {100 * largest:.2g} %")
    one_each = "; ".join(words)
    return f"distances between the points change by {one_each}"


def _weak_lengths(refined: Refined) -> list[Message]:
    """Lengths that leave the scene's distances poorly known, and what to tape next."""
    adjustment = refined.adjustment
    survey, used = adjustment.survey, adjustment.problem.line_index
    if survey.telemetry is not None or survey.gauge == "world":
        return []
    point = adjustment.state.point[:, :2]
    faults = line_faults(point[survey.line_start[used]], point[survey.line_end[used]], point)
    advice = next_line(adjustment)
    if advice is None or (advice.relative_sigma < WEAK and not faults):
        return []
    what = "; ".join(faults) or "the lengths say little of the scene's shape"
    text = (
        f"The known lengths are weak as a set: {what}. Distances between the points are known to "
        f"{100 * advice.relative_sigma:.2g} %{_suggestion(refined)}."
    )
    level: Literal["info", "warning"] = "warning" if advice.relative_sigma >= WEAK else "info"
    return [Message(level, "weak-lengths", text)]


def _suggestion(refined: Refined) -> str:
    """The line to tape next and what it would bring, as the end of a sentence."""
    advice = next_line(refined.adjustment)
    if advice is None or not advice.relative_sigma_after < advice.relative_sigma:
        return ""
    label = refined.adjustment.survey.label
    return (
        f"; best from {label[advice.start]!r} to {label[advice.end]!r}, about "
        f"{advice.length_m:.1f} m long: it would bring the sigma of distances from "
        f"{100 * advice.relative_sigma:.2g} % to {100 * advice.relative_sigma_after:.2g} %"
    )


def _ambiguous_control(refined: Refined) -> list[Message]:
    if not refined.alternatives:
        return []
    text = (
        f"The control points fit {len(refined.alternatives) + 1} different poses equally well; the "
        "measured values of the others stand under alternatives. Pick more control points, wider "
        "apart or of other heights, or give the flight log."
    )
    return [Message("warning", "ambiguous-pose", text)]


def too_many(removed: int) -> Message:
    """The removal was stopped: what is wrong is no single observation."""
    text = (
        f"{removed} observations were removed and still others do not fit: the removal was "
        "stopped. Something common to them is wrong: labels, the camera file, the ground, times."
    )
    return Message("error", "too-many-blunders", text)
