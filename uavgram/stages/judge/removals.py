"""The record of what was taken out as a blunder, and what that did to the measurements."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.adjustment import Adjustment, Refined
from uavgram.estimation.measured import values_at
from uavgram.model.arrays import Ints
from uavgram.model.evidence import RemovalRecord
from uavgram.model.frames import Frames
from uavgram.model.observations import KnownLines, MeasurementRequest
from uavgram.stages.judge.examine import named


def judge_removals(
    refined: Refined,
    lines: KnownLines,
    line_index: Ints,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
) -> tuple[RemovalRecord, ...]:
    """What was taken out, step by step.

    Parameters
    ----------
    refined
        The adjusted survey, with its removals.
    lines, line_index
        All known lengths, and where each stands in the survey handed to refine.
    requests, frames
        What is measured, before and after each step.
    """
    steps = [removal.before for removal in refined.removals] + [refined]
    values = [values_at(r.adjustment, r.adjustment.state, requests, frames) for r in steps]
    records = []
    for k, removal in enumerate(refined.removals):
        suspicion = removal.suspicion
        names = named(removal.before, lines, line_index)
        records.append(
            RemovalRecord(
                what=names.observation(suspicion.accused),
                w=suspicion.w,
                group=tuple(names.observation(m) for m in suspicion.group),
                rivals=tuple(names.observation(m) for m in suspicion.rivals),
                variance_factor_before=_variance_factor(steps[k].adjustment),
                variance_factor_after=_variance_factor(steps[k + 1].adjustment),
                change=tuple((values[k + 1] - values[k]).tolist()),
            )
        )
    return tuple(records)


def _variance_factor(adjustment: Adjustment) -> float:
    minimum = adjustment.minimum
    observations = sum(block.residual.size for block in minimum.blocks.values())
    degrees = observations - adjustment.problem.layout.size
    return minimum.cost / degrees if degrees > 0 else float(np.nan)
