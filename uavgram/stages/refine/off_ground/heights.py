"""Labels whose picks fit at one height off the ground and not on it, though nobody said so.

A roof corner that is taken for a point of the ground bends poses, camera and plane, and the noise
that is learnt from the residuals would swallow it as relief. So where the picks of a survey do not
fit, such labels are looked for (`search.py`), before noise is learnt and before single picks
are accused, and adjusted with free heights from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.continued import continued
from uavgram.stages.refine.off_ground.search import MOST_NOISE, noise_of_most, searched


class Found(NamedTuple):
    """All labels that stand off the ground, and the adjustment that shows it."""

    labels: list[str]
    adjustment: Adjustment


def labels_off_ground(adjustment: Adjustment, before: Sequence[str] = ()) -> Found | None:
    """Labels that do not lie on the ground; None where there are none, or nothing new can be told.

    Parameters
    ----------
    adjustment
        As stated, or with free heights of some labels.
    before
        These labels: they are looked at anew.
    """
    try:
        stated = with_free(adjustment.survey, (), before)
        search = searched(adjustment, stated, again=len(before) > 0)
    except SingularError:
        return None
    if search is None:
        return None
    names = [adjustment.survey.label[k] for k in np.flatnonzero(search.off)]
    return Found(names, search.adjustment) if names or before else None


def with_heights_freed(refined: Refined, found: Found, before: Sequence[str]) -> Refined | None:
    """The result with free heights of what was found; None where that is no result either.

    It does not come to rest then, or most picks do not fit.

    Parameters
    ----------
    refined
        The result so far.
    found
        Labels whose heights are to be free.
    before
        Those whose heights it has free, though nobody said so.
    """
    survey = with_free(refined.adjustment.survey, found.labels, before)
    try:
        after = continued(found.adjustment, survey)
    except SingularError:
        return None
    # The search gives stray picks less weight: with all of it, heights may not be what is wrong.
    if not after.minimum.converged or noise_of_most(after) > MOST_NOISE:
        return None
    return replace(refined, adjustment=after, alternatives=())


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


def found_free(stated: Survey, refined: Refined) -> list[str]:
    """Labels that are adjusted with a free height though nobody said so."""
    survey = refined.adjustment.survey
    said = {stated.label[k] for k in np.flatnonzero(stated.is_free)}
    return [survey.label[k] for k in np.flatnonzero(survey.is_free) if survey.label[k] not in said]
