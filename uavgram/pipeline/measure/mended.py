"""The picks and lengths of a project as they are taken once they are mended."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from uavgram.model.survey.mend import Cause
from uavgram.model.survey.observations import KnownLines, Picks
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.stages.assemble import Assembled


def with_mends(inputs: Inputs, assembled: Assembled, causes: Iterable[Cause]) -> Inputs:
    """Inputs whose tables say what the adjustment took, mends included.

    Parameters
    ----------
    inputs
        The project.
    assembled
        Where its picks and lengths stand in the survey.
    causes
        Of misfits, those that were mended, in their order.
    """
    for cause in causes:
        mend = cause.mend
        if mend is None:
            continue
        label = assembled.survey.label
        pick = {int(k): i for i, k in enumerate(assembled.pick_index) if k >= 0}
        line = {int(k): i for i, k in enumerate(assembled.line_index) if k >= 0}
        inputs = replace(
            inputs,
            picks=_picks(
                inputs.picks,
                {pick[k]: label[at] for k, at in mend.label_of_pick.items()},
                {pick[k]: place for k, place in mend.pixel_of_pick.items()},
            ),
            lines=_lines(
                inputs.lines,
                {line[k]: value for k, value in mend.length_m.items()},
                {line[k]: (label[a], label[b]) for k, (a, b) in mend.ends.items()},
                {line[k] for k in mend.level},
            ),
        )
    return inputs


def _picks(picks: Picks, label: dict[int, str], pixel_px: dict[int, tuple[float, float]]) -> Picks:
    labels, pixels = list(picks.label), np.array(picks.pixel_px)
    for row, name in label.items():
        labels[row] = name
    for row, place in pixel_px.items():
        pixels[row] = place
    return replace(picks, label=tuple(labels), pixel_px=pixels)


def _lines(
    lines: KnownLines,
    length_m: dict[int, float],
    ends: dict[int, tuple[str, str]],
    level: set[int],
) -> KnownLines:
    length, start, end = np.array(lines.length_m), list(lines.start), list(lines.end)
    for row, value in length_m.items():
        length[row] = value
    for row, (first, last) in ends.items():
        start[row], end[row] = first, last
    along = lines.along
    if level:
        every = range(len(start))
        along = tuple("horizontal" if k in level else lines.along_of(k) for k in every)
    return replace(lines, length_m=length, start=tuple(start), end=tuple(end), along=along)
