"""What does not fit, in words: each blunder once, with all that no test can part from it.

Two picks of one photo of which each lies where the other belongs are told first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from uavgram.estimation.reliability.data_snooping import MOST_SUSPECTS
from uavgram.estimation.survey.names import POSE_AXES, STEADY_CHANGE
from uavgram.estimation.survey.suspicion import Suspicion
from uavgram.model.arrays import Floats
from uavgram.model.message import Message, Several
from uavgram.model.result.tables import PickResults
from uavgram.model.survey.known import KnownThing
from uavgram.stages.judge.tested_survey import TestedSurvey

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


def judge_suspects(examined: TestedSurvey, swaps: Sequence[Swap] = ()) -> tuple[Message, ...]:
    """One message for each suspicion; where there are too many, the model is named instead.

    Parameters
    ----------
    examined
        The adjusted survey under test.
    swaps
        Labels that seem to be swapped: said first, and their picks then not blamed.
    """
    blameless = {(swap.frame, label) for swap in swaps for label in swap.labels}
    messages = [swap.message() for swap in swaps]
    messages += [
        _message(examined, s)
        for s in examined.suspicions
        if s.accused.kind != "pixels" or examined.names.pick(s.accused.row) not in blameless
    ]
    if len(examined.suspicions) >= MOST_SUSPECTS:
        text = (
            f"{MOST_SUSPECTS} picks and lengths or more do not fit; the first {MOST_SUSPECTS} are "
            "named. Something common to them is wrong: look at labels, the camera file, the "
            "ground, times."
        )
        messages.append(Message("warning", "many-suspects", text))
    return tuple(messages)


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
    return Message(
        "warning",
        CODES.get(kind, "prior-strained"),
        " ".join([text, *others]),
        **names.subjects(suspicion.accused),
        several=Several(opening, item, ending=ending),
    )


def _pick(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    """What does not fit and where to look, as a sentence; and in a few words."""
    row = suspicion.accused.row
    u, v = examined.residuals("pixels")[row]
    frame, label = examined.names.pick(row)
    how = f"(w = {suspicion.w:.1f}, residual {u:+.1f}, {v:+.1f} px)"
    what = f"{label!r} in {frame!r}"
    return (
        f"The pick of {what} does not fit {how}: look at the place and at the label.",
        f"{what} {how}",
    )


def _length(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    survey, row = examined.adjustment.survey, suspicion.accused.row
    line = examined.adjustment.problem.line_index[row]
    taped = survey.length_m[line]
    adjusted = taped + examined.residuals("lengths")[row, 0]
    what = examined.names.length(row)
    how = f"taped {taped:.3f} m, adjusted {adjusted:.3f} m (w = {suspicion.w:.1f})"
    alone = " Without it, everything else fits." if examined.refined.accused_alone else ""
    return (
        f"The length {what} does not fit: {how}. Look at the reading, at its ends and at their "
        f"picks.{alone}",
        f"{what} {how}",
    )


def _known(examined: TestedSurvey, suspicion: Suspicion) -> tuple[str, str]:
    problem, row = examined.refined.tested.problem, suspicion.accused.row
    thing = problem.known[problem.known_thing[row]]
    own = np.flatnonzero(problem.known_thing == problem.known_thing[row])
    off = examined.residuals("known")[own, 0]
    what = examined.names.known(row)
    how = f"{departure(thing, off)} (w = {suspicion.w:.1f})"
    alone = " Without it, everything else fits." if examined.refined.accused_alone else ""
    return (
        f"The known {what} does not fit: {how}. Look at its value, at its points and at their "
        f"picks.{alone}",
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
        f"The control point {label!r} does not fit {how}: look at its coordinates, its label and "
        "its picks.",
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
    adjustment, row = examined.refined.tested, suspicion.accused.row
    # Without its prior the scale would be the estimate over the prior's redundancy.
    free = adjustment.state.tape[row] / examined.groups["tape"].redundancy[row, 0]
    what = examined.names.tape(row)
    size, side = f"{100.0 * abs(free):.2g} %", "long" if free > 0 else "short"
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


MUCH_BETTER = 0.25
"""Distance of a pick from the other's place over that from its own, up to which it belongs there.
A pick that takes part pulls its own place along, so that the other's is not met in full."""


@dataclass(frozen=True)
class Swap:
    """Two labels of one photo that seem to be swapped.

    Attributes
    ----------
    frame, labels
        The photo, and the labels of the two picks.
    own_px, other_px
        How far each pick lies from where its label belongs, and from where the other one does.
    """

    frame: str
    labels: tuple[str, str]
    own_px: tuple[float, float]
    other_px: tuple[float, float]

    def message(self) -> Message:
        """What to do about it."""
        (a, b), (own_a, own_b), (other_a, other_b) = self.labels, self.own_px, self.other_px
        how = (
            f"each pick lies where the other belongs, {other_a:.1f} and {other_b:.1f} px away "
            f"instead of {own_a:.0f} and {own_b:.0f} px from its own place"
        )
        several = Several(
            "Labels seem to be swapped in {count} photos or pairs of picks",
            f"{a!r} and {b!r} in {self.frame!r}",
            ending="Each pick lies where the other belongs: look, and swap the labels there.",
        )
        return Message(
            "warning",
            "labels-swapped",
            f"The labels {a!r} and {b!r} seem to be swapped in {self.frame!r}: {how}. Look at "
            "both, and swap the labels in this photo.",
            frames=(self.frame,),
            labels=self.labels,
            several=several,
        )


def swapped_labels(examined: TestedSurvey, picks: PickResults) -> tuple[Swap, ...]:
    """Pairs of picks that are suspect or were taken out, and fit each other's place; best first."""
    odd: dict[str, list[int]] = {}
    known_label = {label: k for k, label in enumerate(examined.adjustment.survey.label)}
    known_frame = {name: k for k, name in enumerate(examined.adjustment.survey.frame_id)}
    for row, status in enumerate(picks.status):
        image = picks.image[row]
        if status != "used" and image in known_frame and picks.label[row] in known_label:
            odd.setdefault(image, []).append(row)
    found: list[Swap] = []
    for image, rows in odd.items():
        if len(rows) > 1:
            label = np.array([known_label[picks.label[row]] for row in rows])
            frame = np.full(len(label), known_frame[image])
            places = examined.adjustment.pixels(frame, label)
            found += _pairs(image, [picks.label[r] for r in rows], picks.pixel_px[rows], places)
    return tuple(found)


def _pairs(image: str, label: list[str], pixel: Floats, place: Floats) -> Iterator[Swap]:
    """Pairs of which each fits the other's place far better than its own, each pick once."""
    away = np.linalg.norm(pixel[:, None] - place[None], axis=2)  # of pick i from the place of j
    pairs = [
        (max(away[i, j] / away[i, i], away[j, i] / away[j, j]), i, j)
        for i, j in combinations(range(len(label)), 2)
        if label[i] != label[j] and away[i, i] > 0 and away[j, j] > 0
    ]
    taken: set[int] = set()
    for ratio, i, j in sorted(pairs):
        if ratio < MUCH_BETTER and not taken & {i, j}:
            taken |= {i, j}
            own, other = (away[i, i], away[j, j]), (away[i, j], away[j, i])
            yield Swap(
                image,
                (label[i], label[j]),
                (float(own[0]), float(own[1])),
                (float(other[0]), float(other[1])),
            )
