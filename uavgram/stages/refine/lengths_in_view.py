"""Compare lengths with what a camera that looks straight down would see of them."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.network import seen_lines
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

FEW = 3
"""Lengths from which on they tell what they have in common: the scale, which the log may miss."""

ODD = 30.0
"""Factor by which no length differs from the others of a frame for its perspective alone."""


def ratios_in_view(survey: Survey, keep: Bools) -> Floats:
    """(L,) logarithms of lengths over what a camera would see that looked straight down.

    Less their median in each frame, of frames that show three or more; NaN for other lengths.
    """
    seen = seen_lines(survey)
    usable = np.flatnonzero(keep[seen.start] & keep[seen.end])
    number = np.bincount(seen.frame[usable], minlength=len(survey.frame_id))
    rows = usable[number[seen.frame[usable]] >= FEW]
    frame, line = seen.frame[rows], seen.line[rows]
    pixel = survey.pixel_px[np.concatenate([seen.start[rows], seen.end[rows]])]
    calibration = survey.calibration
    ray = back_project(calibration.model, calibration.parameters, pixel)
    apart = np.linalg.norm(ray[: len(rows)] - ray[len(rows) :], axis=1)
    ratio = np.log(survey.length_m[line] / apart)
    ratio -= group_medians(ratio, frame, len(survey.frame_id))[frame]
    shown = np.bincount(line, minlength=len(survey.line_start)) > 0
    return np.where(shown, group_medians(ratio, line, len(survey.line_start)), np.nan)


def odd_in_view(ratio: Floats) -> Bools:
    """(L,) which of these no perspective explains."""
    return np.asarray(np.abs(ratio) > np.log(ODD))


def group_medians(value: Floats, group: Ints, groups: int) -> Floats:
    """Lower median of the values of each group; 0 where it has none.

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
