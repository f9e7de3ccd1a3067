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
from uavgram.stages.refine.blunders import MOST, blunders
from uavgram.stages.refine.minima import adjust
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
    out = {
        "pick": np.zeros(len(survey.pick_frame), dtype=bool),
        "line": np.zeros(len(survey.line_start), dtype=bool),
    }
    most = int(MOST * (len(survey.pick_frame) + len(survey.line_start)))
    removals: list[Removal] = []
    said: list[Message] = []
    refined = adjust(survey, keep, out["line"], reason)
    while options.outliers == "remove":
        found = blunders(refined, options.significance)
        if len(found) != 1:
            said += [not_located(survey, found)] if found else []
            break
        (blunder,) = found
        if len(removals) >= most:
            said.append(too_many(len(removals)))
            break
        out[blunder.kind][blunder.index] = True
        try:
            refined = adjust(survey, keep & ~out["pick"], out["line"], reason)
        except GeometryError as why:  # nothing is left to solve by: better with it than not at all
            out[blunder.kind][blunder.index] = False
            said.append(indispensable(survey, blunder, why))
            break
        removals.append(blunder)
    result = replace(
        refined,
        removals=tuple(removals),
        pick_removed=out["pick"],
        line_removed=out["line"],
    )
    return result, (*remarks(survey, result), *said)


def _in_lens(survey: Survey) -> tuple[Bools, dict[int, str]]:
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    keep: Bools = np.isfinite(ray.sum(axis=1))
    return keep, {int(i): BEYOND_LENS for i in np.flatnonzero(~keep)}
