"""Compare lengths with their view by a camera that looks straight down."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.network import seen_lines
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

FEW = 3
"""Least number of lengths that determine their common scale, which the log may miss."""

ODD = 30.0
"""Ratio of a length to the others of its frame that perspective alone cannot explain."""


def ratios_in_view(survey: Survey, keep: Bools) -> Floats:
    """Compute logarithms (L,) of lengths over their view by a camera that looks straight down.

    Each is relative to the median in its frame, for frames that show three or more; NaN for other
    lengths.
    """
    seen = seen_lines(survey)
    usable = np.flatnonzero(keep[seen.start] & keep[seen.end])
    number = np.bincount(seen.frame[usable], minlength=len(survey.frame_id))
    rows = usable[number[seen.frame[usable]] >= FEW]
    frame, line = seen.frame[rows], seen.line[rows]
    pixel = survey.pixel_px[np.concatenate([seen.start[rows], seen.end[rows]])]
    calibration = survey.calibration
    ray = back_project(calibration.model, calibration.parameters, pixel)
    # Distance of the ends in the image plane z = 1.
    apart = np.linalg.norm(ray[: len(rows)] - ray[len(rows) :], axis=1)
    # Log ratios relative to the median of their frame, then the median over frames.
    ratio = np.log(survey.length_m[line] / apart)
    ratio -= group_medians(ratio, frame, len(survey.frame_id))[frame]
    shown = np.bincount(line, minlength=len(survey.line_start)) > 0
    return np.where(shown, group_medians(ratio, line, len(survey.line_start)), np.nan)


def odd_in_view(ratio: Floats) -> Bools:
    """Mark the ratios (L,) that no perspective explains."""
    return np.asarray(np.abs(ratio) > np.log(ODD))


def group_medians(value: Floats, group: Ints, groups: int) -> Floats:
    """Compute the lower median of the values of each group; 0 where it has none.

    Parameters
    ----------
    value
        (n,) values, in any unit.
    group
        (n,) group of each.
    groups
        Number of groups.
    """
    if not len(value):
        return np.zeros(groups)
    order = np.lexsort((value, group))
    number = np.bincount(group, minlength=groups)
    first = np.cumsum(number) - number
    middle = np.minimum(first + np.maximum(number - 1, 0) // 2, len(value) - 1)
    return np.where(number > 0, value[order][middle], 0.0)
