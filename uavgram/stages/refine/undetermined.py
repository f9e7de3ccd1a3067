"""Unknowns that the observations do not determine: their picks, and a possible remedy."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.network import FirstValues
from uavgram.estimation.measuring.scale import line_faults
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Bools
from uavgram.model.survey.survey import Survey


class UndeterminedError(GeometryError):
    """Undetermined unknown; `picks` (P,) are the picks that depend on it alone."""

    def __init__(self, message: str, picks: Bools) -> None:
        self.picks = picks
        super().__init__(message)


def hanging_on(index: int, layout: Layout, survey: Survey) -> Bools:
    """Mark the picks (P,) of the point, or of the frame, that an unknown belongs to.

    Parameters
    ----------
    index
        Column of the unknown.
    layout
        Columns of all unknowns.
    survey
        Survey with P picks.
    """
    if layout.first_tie <= index < layout.first_frame:
        return np.zeros(len(survey.pick_label), dtype=np.bool_)
    if index < layout.first_tie:
        return np.asarray(survey.pick_label == layout.label_of(index, survey))
    frame = (index - layout.first_frame) // layout.frame_size
    return np.asarray((survey.pick_frame == frame) & (index < layout.first_intrinsic))


def weakness(survey: Survey, values: FirstValues, line_used: Bools) -> str:
    """Describe the weakness of the lengths as a set, if any, as the end of a sentence.

    Parameters
    ----------
    survey
        Survey with L known lengths.
    values
        First values, among them the places of the points.
    line_used
        (L,) lengths that take part.
    """
    start, end = survey.line_start[line_used], survey.line_end[line_used]
    if survey.telemetry is not None or survey.known or len(start) < 3:
        return ""
    faults = line_faults(values.point_m[start], values.point_m[end], values.point_m)
    if not faults and len(start) == 3:
        faults = ("two of the poses that three lengths allow merge here: tape a fourth line",)
    return f" ({'; '.join(faults)})" if faults else ""
