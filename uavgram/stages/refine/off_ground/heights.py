"""Set the heights of labels free, or back on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavgram.model.survey.survey import Survey


def with_free(survey: Survey, names: Sequence[str], before: Sequence[str] = ()) -> Survey:
    """The survey in which the heights of these labels are to be found.

    Parameters
    ----------
    survey
        As it was.
    names
        Labels.
    before
        Those whose heights were to be found, and are no more unless they are among them.
    """
    free = survey.is_free & ~np.isin(survey.label, list(before))
    return replace(survey, is_free=free | np.isin(survey.label, list(names)))
