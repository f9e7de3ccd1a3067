"""What does not fit, in words: each blunder once, with all that no test can part from it."""

from __future__ import annotations

from uavgram.estimation.observation_names import POSE_AXES
from uavgram.estimation.snooping import MOST_SUSPECTS
from uavgram.estimation.suspicion import Suspicion
from uavgram.model.message import Message
from uavgram.stages.judge.examine import Examined

CODES = {
    "pixels": "pick-suspect",
    "lengths": "line-suspect",
    "control": "control-suspect",
    "telemetry": "telemetry-strained",
}


def judge_suspects(examined: Examined) -> tuple[Message, ...]:
    """One message for each suspicion; where there are too many, the model is named instead."""
    messages = [
        Message("warning", CODES.get(s.accused.kind, "prior-strained"), _text(examined, s))
        for s in examined.suspicions
    ]
    if len(messages) >= MOST_SUSPECTS:
        text = (
            f"{MOST_SUSPECTS} observations or more do not fit; the first {MOST_SUSPECTS} are "
            "named. Something common to them is wrong: labels, the camera file, the ground, times."
        )
        messages.append(Message("warning", "many-suspects", text))
    return tuple(messages)


def _text(examined: Examined, suspicion: Suspicion) -> str:
    words = {
        "pixels": _pick,
        "lengths": _length,
        "control": _control,
        "telemetry": _pose,
    }.get(suspicion.accused.kind, _prior)
    names, sentences = examined.names, [words(examined, suspicion)]
    if suspicion.group:
        sentences.append(f"The {names.group(suspicion)}: {names.look(suspicion)}.")
    if suspicion.rivals:
        sentences.append(names.rivals(suspicion))
    return " ".join(sentences)


def _pick(examined: Examined, suspicion: Suspicion) -> str:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    block = examined.groups["pixels"].block
    u, v = block.residual[row] * survey.pick_sigma_px[row]
    what = examined.names.observation(suspicion.accused)
    return (
        f"The {what} does not fit (w = {suspicion.w:.1f}, residual {u:+.1f}, {v:+.1f} px): look at "
        "the place and at the label."
    )


def _length(examined: Examined, suspicion: Suspicion) -> str:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    line = examined.adjustment.problem.line_index[row]
    taped, sigma = survey.length_m[line], survey.length_sigma_m[line]
    adjusted = taped + examined.groups["lengths"].block.residual[row, 0] * sigma
    what = examined.names.observation(suspicion.accused)
    return (
        f"The {what} does not fit: taped {taped:.3f} m, adjusted {adjusted:.3f} m "
        f"(w = {suspicion.w:.1f}). Look at the reading, at its ends and at their picks."
        f"{' Without it, everything else fits.' if examined.refined.accused_alone else ''}"
    )


def _control(examined: Examined, suspicion: Suspicion) -> str:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    residual = examined.groups["control"].block.residual[row] * survey.control_sigma_m[row]
    what = examined.names.observation(suspicion.accused)
    return (
        f"The {what} does not fit (w = {suspicion.w:.1f}, found minus known "
        f"{', '.join(f'{r:+.3f}' for r in residual)} m): look at its coordinates, its label and "
        "its picks."
    )


def _pose(examined: Examined, suspicion: Suspicion) -> str:
    row, axis = suspicion.accused.row, suspicion.accused.axis
    return strained_frame(examined.names.frame(row), axis, suspicion.w)


def strained_frame(frame_id: str, axis: int, w: float) -> str:
    """A frame whose logged pose the observations contradict along one axis."""
    return (
        f"Frame {frame_id!r} does not stand where the log has it: {POSE_AXES[axis]}, w = "
        f"{w:.1f}. Look at its picks, its time and the gimbal."
    )


def _prior(examined: Examined, suspicion: Suspicion) -> str:
    return (
        "The observations contradict what was assumed of the "
        f"{examined.names.prior(suspicion.accused)} (w = {suspicion.w:.1f}): check its value and "
        "sigma in the project."
    )
