"""Surveys of which every observation takes part, gross errors among them."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.survey import Survey
from uavgram.stages.refine.minima import Participants, find_best_minima


def all_of(survey: Survey) -> Participants:
    """Every pick and every length."""
    picks = np.ones(len(survey.pick_frame), dtype=np.bool_)
    return Participants(survey, picks, np.zeros(len(survey.line_start), dtype=np.bool_), {})


def with_all(survey: Survey) -> Refined:
    """The ordinary adjustment of them."""
    return find_best_minima(all_of(survey))
