"""Points in only one photo, beside others that are off the ground without a statement.

One photo does not determine a height. Where several of the points in two photos were found off the
ground, the others may be off it as well, with the same frequency and size.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.continued import continued
from uavgram.stages.refine.off_ground.shown import photos_of

SEVERAL = 3
"""Least number of points off the ground that are not exceptions: one or two are roof corners."""


def with_unseen_heights(
    survey: Survey, refined: Refined, found: Collection[str]
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Give points in only one photo uncertain heights, and readjust.

    Parameters
    ----------
    survey
        All observations, with the detected heights free.
    refined
        Its adjustment.
    found
        Labels whose heights were found.
    """
    adjustment = refined.adjustment
    photos = photos_of(adjustment.survey)
    on_ground = ~adjustment.survey.off_ground
    unseen = [adjustment.survey.label[k] for k in np.flatnonzero(on_ground & (photos < 2))]
    if len(found) < SEVERAL or not unseen:
        return survey, refined, ()
    share = len(found) / (len(found) + int((on_ground & (photos >= 2)).sum()))
    height = adjustment.state.point[adjustment.label_rows(found), 2]
    # Height 0 with probability 1 - p, otherwise of mean square s^2: the variance is p s^2.
    sigma_m = float(np.sqrt(share * np.mean(height**2)))
    after = _adjusted(adjustment, _with_sigma(adjustment.survey, unseen, sigma_m))
    if after is None:
        return survey, refined, ()
    return (
        _with_sigma(survey, unseen, sigma_m),
        replace(refined, adjustment=after),
        (_message(unseen, sigma_m, len(found)),),
    )


def _with_sigma(survey: Survey, names: list[str], sigma_m: float) -> Survey:
    of = np.isin(survey.label, names)
    return replace(survey, height_sigma_m=np.where(of, sigma_m, survey.height_sigma_m))


def _adjusted(adjustment: Adjustment, survey: Survey) -> Adjustment | None:
    try:
        after = continued(adjustment, survey)
    except SingularError:
        return None
    return after if after.minimum.converged else None


def _message(unseen: list[str], sigma_m: float, found: int) -> Message:
    several = len(unseen) > 1
    what = f"{len(unseen)} points are" if several else f"The point {unseen[0]!r} is"
    it = "They" if several else "It"
    text = (
        f"{what} picked in one photo only, where {found} others stand off the ground: pick "
        f"{'them' if several else 'it'} in a second photo. {it} may stand off the ground too, so "
        f"{'their heights are' if several else 'its height is'} taken as uncertain by "
        f"{sigma_m:.2f} m."
    )
    return Message("warning", "heights-unseen", text, labels=tuple(unseen))
