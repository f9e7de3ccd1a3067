"""Lengths that are wrong beyond doubt: in another unit, a decimal off, or between other points.

Such a length is no blunder among good observations, which the tests of the residuals find: one
that the adjustment has to fulfil to a centimetre bends poses, camera and ground out of all shape,
and the tests then accuse whatever is bent. So it does not take part; what the rest says of it
decides that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.network import seen_lines
from uavgram.estimation.reliability.wrong_units import likely_mistake
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.suspicion import Member, Suspicion
from uavgram.estimation.survey.terms.tapes import taped_lines
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.misfit import group_medians
from uavgram.stages.refine.seeded_lengths import seeded_lengths

FACTOR = 1.5
"""A length that is wrong by less is left to the tests of the residuals."""

BEYOND = 20.0
"""Sigmas beyond which nothing but a gross error explains a length."""

DOUBT = 4.0
"""Sigmas, of what the seeds say, from which a length has to be confirmed by the others."""

KNOWN = 0.5
"""Relative sigma from which on the seeds say nothing of a length."""

FEW = 3
"""Lengths from which on they tell what they have in common: the scale, which the log may miss."""

SLACK = 2.0
"""Factor by which all sigmas may be too small in an adjustment that counts as fitting."""

TRIMMED = 5.0
"""Residual of a pick, in its sigmas, from which on it counts as a blunder of its own."""

UNLIKELY = 0.001
"""Probability of a sum of squares beyond which an adjustment does not fit."""

ODD = 30.0
"""Factor by which no length differs from the others of a frame for its perspective alone."""


def doubtful(survey: Survey, keep: Bools) -> Bools:
    """(L,) lengths with which the adjustment had better not start; the rest has to confirm it."""
    if not len(survey.line_start):
        return np.zeros(0, dtype=bool)
    if survey.seeds is None:
        return odd_in_view(ratios_in_view(survey, keep))
    return _by_seeds(survey, keep)


def _by_seeds(survey: Survey, keep: Bools) -> Bools:
    """(L,) lengths that are far from the others, as the seeds see them.

    And all, where they agree with each other in a scale that the log rules out, if that is the
    scale of a unit: else the ground may lie elsewhere than was said.
    """
    seen, relative = seeded_lengths(survey, keep)
    known = relative < KNOWN
    ratio = np.log(survey.length_m / np.where(known, seen, np.nan))
    limit = np.maximum(np.log(FACTOR), DOUBT * relative)
    if known.sum() < FEW:
        return np.asarray(np.abs(ratio) > limit)
    scale, sigma = float(np.median(ratio[known])), float(np.median(relative[known]))
    if abs(scale) > DOUBT * sigma and likely_mistake(float(np.exp(scale)), sigma):
        return np.asarray(known)
    return np.asarray(np.abs(ratio - scale) > limit)


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


def wrong_beyond_doubt(survey: Survey, refined: Refined, line: Ints) -> Bools:
    """(n,) which of some lengths an adjustment without them rules out.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjusted without these lengths.
    line
        (n,) rows of known lengths.
    """
    seen, sigma = seen_lengths(survey, refined, line)
    taped, own = survey.length_m[line], survey.length_sigma_m[line]
    # What the adjustment says may err by a factor, a tape by metres: given all that its sigma
    # allows, it is still another length.
    nearest = taped + np.clip(seen - taped, -BEYOND * own, BEYOND * own)
    ratio = np.abs(np.log(nearest / seen))
    return np.asarray(ratio > np.maximum(np.log(FACTOR), BEYOND * sigma / seen))


def fits(refined: Refined) -> bool:
    """Whether an adjustment is in order, but for single picks: then it may speak against others.

    Without redundancy, nothing says that it is.
    """
    minimum, degrees = refined.adjustment.minimum, refined.adjustment.degrees_of_freedom
    squares = np.sum(minimum.blocks["pixels"].residual ** 2, axis=1)
    cost = minimum.cost - float(np.maximum(squares - TRIMMED**2, 0.0).sum())
    return bool(
        minimum.converged and degrees > 0 and cost <= SLACK**2 * float(chdtri(degrees, UNLIKELY))
    )


def seen_lengths(survey: Survey, refined: Refined, line: Ints) -> tuple[Floats, Floats]:
    """What tapes should read (n,) of some lines, and the sigmas; NaN where an end is not adjusted.

    Parameters
    ----------
    survey
        All observations.
    refined
        The adjusted survey.
    line
        (n,) rows of known lengths.
    """
    at = refined.adjustment.label_rows(survey.label)
    there = (at[survey.line_start[line]] >= 0) & (at[survey.line_end[line]] >= 0)
    taped = taped_lines(survey, line[there])
    taped = taped._replace(start=at[taped.start], end=at[taped.end])
    found = np.full((2, len(line)), np.nan)
    found[:, there] = refined.adjustment.readings(taped)
    return found[0], found[1]


def with_gross_lengths(survey: Survey, refined: Refined) -> Refined:
    """The same, with a record of the lengths that were left out before anything was tested."""
    recorded = {removal.index for removal in refined.removals if removal.kind == "line"}
    line = np.array(
        [i for i in np.flatnonzero(refined.line_removed) if i not in recorded], dtype=int
    )
    if not len(line):
        return refined
    seen, sigma = seen_lengths(survey, refined, line)
    w = (seen - survey.length_m[line]) / np.hypot(sigma, survey.length_sigma_m[line])
    records = [
        Removal("line", index, Suspicion(Member("lengths", -1, 0), off, (), ()), None)
        for index, off in zip(line.tolist(), w.tolist(), strict=True)
    ]
    return replace(refined, removals=(*records, *refined.removals))
