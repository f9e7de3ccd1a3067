"""Free the heights of labels, or put the labels back on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavgram.model.survey.survey import Survey


def with_free(survey: Survey, names: Sequence[str], before: Sequence[str] = ()) -> Survey:
    """Make the heights of labels unknowns.

    Parameters
    ----------
    survey
        The survey before.
    names
        Labels whose heights become unknowns.
    before
        Labels whose heights were unknowns; those that are not among `names` return to the ground.
    """
    free = survey.is_free & ~np.isin(survey.label, list(before))
    return replace(survey, is_free=free | np.isin(survey.label, list(names)))
