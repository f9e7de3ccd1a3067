"""Check a project: read and validate every input and match the photos; compute nothing."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from uavgram.config.project import PROJECT_FILE
from uavgram.errors import suggest_spelling
from uavgram.estimation.survey.known_kinds import determine_scale
from uavgram.model.message import Message, MessagePlural
from uavgram.pipeline.measure.inputs import Inputs, find_project_duplicates, read_inputs
from uavgram.pipeline.measure.observations import append_plate_sides, append_position_lines
from uavgram.pipeline.measure.pose import PosedFrames, has_place, pose_frames, transform_known
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.messages import order_messages

_MAX_COMPARED = 1_000_000
"""Largest number of pairs of names that are compared for typing errors, 2 microseconds each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedProject:
    """Content of a project, and its anomalies."""

    inputs: Inputs
    posed: PosedFrames
    messages: tuple[Message, ...]


@limit_blas_threads
def check(project: str | os.PathLike[str]) -> CheckedProject:
    """Read and validate every input of a project.

    Raises
    ------
    UavgramError
        The first problem that would stop a run.
    """
    inputs = read_inputs(Path(project), unpicked=True)
    posed = pose_frames(inputs)
    twice = find_project_duplicates(inputs).messages
    _, unplaced = append_position_lines(inputs, posed.world)
    for points in (inputs.control, inputs.check):
        unplaced += transform_known(inputs, points, posed.world)[1]
    messages = order_messages(
        *inputs.messages,
        *twice,
        *posed.messages,
        *unplaced,
        *find_missing_inputs(inputs),
        *_find_unpicked(inputs),
    )
    return CheckedProject(inputs=inputs, posed=posed, messages=messages)


def format_argument(project: Path) -> str:
    """Return a project as it is typed in a terminal: its folder, or another file than usual."""
    path = str(project.parent if project.name == PROJECT_FILE else project)
    return f'"{path}"' if " " in path else path


def find_missing_inputs(inputs: Inputs) -> Iterator[Message]:
    """Report inputs that a project lacks for measurements, or for good ones."""
    project = inputs.project
    if not inputs.picks.image:
        text = (
            "No point is picked yet, so there is nothing to compute: pick some with `uavgram pick "
            f"{format_argument(Path(inputs.project_path))}`."
        )
        yield Message("warning", "nothing-picked", text)
    if not inputs.requests:
        text = "No measurement is asked for yet: add some on the picking page, or in `measure`."
        yield Message("info", "nothing-to-measure", text)
    lines = append_plate_sides(inputs.lines, inputs.picks, project.targets)
    known = len(lines.name) or len(inputs.control.label) or determine_scale(inputs.known)
    known = known or len(inputs.control_lines.name)
    if not known and project.log is None and project.poses is None:
        poses = (
            "poses (though the photos state where they were taken: `poses: exif`, and world.origin)"
            if has_place(inputs.photos)
            else "poses"
        )
        text = (
            f"The project names neither a flight log, nor {poses}, nor a known length: without one "
            "of them the scale is unknown. Tape at least four lengths on the ground."
        )
        yield Message("warning", "no-scale", text)
    elif not known:
        text = (
            "No length on the ground is known: the positions of log or photos alone decide the "
            "scale. A few taped lengths make the measurements far better."
        )
        yield Message("info", "no-known-length", text)


def _find_unpicked(inputs: Inputs) -> list[Message]:
    """Report labels in lengths, measurements or known points without a pick."""
    picked = set(inputs.picks.label)
    named = [
        (f"line {name!r}", label)
        for name, *ends in zip(inputs.lines.name, inputs.lines.start, inputs.lines.end, strict=True)
        for label in ends
    ]
    of_known = zip(inputs.known.name, inputs.known.points, strict=True)
    named += [(f"known thing {name!r}", label) for name, points in of_known for label in points]
    on_lines = zip(inputs.control_lines.name, inputs.control_lines.points, strict=True)
    named += [(f"line {name!r}", label) for name, points in on_lines for label in points]
    named += [(f"measurement {r.name!r}", p) for r in inputs.requests for p in r.points]
    named += [("the control points", label) for label in inputs.control.label]
    named += [("the check points", label) for label in inputs.check.label]
    missing = [(what, label) for what, label in named if label not in picked]
    few = len({label for _, label in missing}) * len(picked) <= _MAX_COMPARED
    known = sorted(picked) if few else []
    hints = {
        label: suggest_spelling(label, known)
        for label in dict.fromkeys(label for _, label in missing)
    }
    return [_report_unpicked(what, label, hints[label]) for what, label in missing]


def _report_unpicked(what: str, label: str, near: str) -> Message:
    hint = f" ({near})" if near else ""
    several = MessagePlural(
        "{count} points are never picked",
        f"{label!r} of {what}{hint}",
        ending="Pick them, or correct their names.",
    )
    text = f"Point {label!r} of {what} is never picked{hint}: pick it, or correct its name."
    return Message("warning", "label-unseen", text, labels=(label,), several=several)
