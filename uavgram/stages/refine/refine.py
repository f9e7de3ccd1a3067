"""Refine: poses, points and all that is shared, in one maximum-likelihood adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Refined, Removal
from uavgram.geometry.back_projection import back_project
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine.blunders import MOST, best_of, blunders
from uavgram.stages.refine.misplaced import adjust, attempt, in_order
from uavgram.stages.refine.remarks import indispensable, not_located, remarks, too_many

BEYOND_LENS = "the lens model cannot be inverted at that pixel"


def refine(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
    """Adjust a survey.

    Parameters
    ----------
    survey
        Observations and priors.
    options
        What to do about blunders: with ``remove`` the observation with the largest standardised
        residual above the critical value is taken out and everything adjusted anew, one at a
        time, until none is left.

    Raises
    ------
    GeometryError
        The observations do not determine the survey; the message names what is missing.
    """
    keep, reason = _in_lens(survey)
    no_pick = np.zeros(len(survey.pick_frame), dtype=bool)
    no_line = np.zeros(len(survey.line_start), dtype=bool)
    refined = replace(adjust(survey, keep, no_line, reason), pick_removed=no_pick)
    if options.outliers == "remove":
        refined, said = _without_blunders(survey, refined, options.significance)
    else:
        refined, said = _with_the_accused(survey, refined, options.significance), []
    return refined, (*remarks(survey, refined), *said)


def _without_blunders(
    survey: Survey, refined: Refined, significance: float
) -> tuple[Refined, list[Message]]:
    """Take out one blunder at a time and adjust anew, until none is left or can be chosen."""
    most = int(MOST * (len(survey.pick_frame) + len(survey.line_start)))
    while True:
        choices, undecided = blunders(refined, significance)
        if not choices:
            return refined, [not_located(refined, suspicion) for suspicion in undecided]
        if len(refined.removals) >= most:
            return refined, [too_many(len(refined.removals))]
        tried = _tried(survey, refined, choices)
        if isinstance(tried, GeometryError):  # nothing is left to solve by: better with it
            return refined, [indispensable(choices[0], tried)]
        removal, after = best_of(tried)
        if not in_order(after):
            settled = adjust(survey, _used(survey, after), after.line_removed, after.pick_reason)
            after = replace(settled, pick_removed=after.pick_removed)
        refined = replace(after, removals=(*refined.removals, removal))


def _with_the_accused(survey: Survey, refined: Refined, significance: float) -> Refined:
    """The same, with the observation that adjustments without each of several point at."""
    choices, _ = blunders(refined, significance)
    if len(choices) < 2:
        return refined
    tried = _tried(survey, refined, choices)
    if isinstance(tried, GeometryError):
        return refined
    return replace(refined, accused=best_of(tried)[0].suspicion.accused)


def _tried(
    survey: Survey, refined: Refined, choices: list[Removal]
) -> list[tuple[Removal, Refined]] | GeometryError:
    """Adjustments without each choice; the error where the likeliest one cannot be missed.

    What was left out before stays out: a frame of nonsense would drown what a length does.
    """
    keep, reason = _used(survey, refined), refined.pick_reason
    tried = []
    for choice in choices:
        pick, line = refined.pick_removed.copy(), refined.line_removed.copy()
        (pick if choice.kind == "pick" else line)[choice.index] = True
        try:
            after = attempt(survey, keep & ~pick, line, reason)
        except GeometryError as why:
            if choice is choices[0]:
                return why
            continue
        tried.append((choice, replace(after, pick_removed=pick, line_removed=line)))
    return tried


def _used(survey: Survey, refined: Refined) -> Bools:
    """(P,) picks that are in an adjustment."""
    used = np.zeros(len(survey.pick_frame), dtype=bool)
    used[refined.pick_index] = True
    return used


def _in_lens(survey: Survey) -> tuple[Bools, dict[int, str]]:
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    keep: Bools = np.isfinite(ray.sum(axis=1))
    return keep, {int(i): BEYOND_LENS for i in np.flatnonzero(~keep)}
