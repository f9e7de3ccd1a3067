"""Where the labels of a photo belong by all other picks, and which picks do not lie there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.test_statistics import cofactors, falls_without
from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.stages.refine.causes.hypothesis import Standing

STRAYS = 16.0
"""Fall of the sum of squares without a pick, from which on it is looked at."""

MOST_PICKS = 60
"""Picks that are looked at: those that were left out, and those that stray farthest."""

LEAST_CHECKED = 0.01
"""Share of an error of a pick that has to show in its residual for the others to say its place."""


class Strays(NamedTuple):
    """Picks of adjusted frames that do not fit, or were left out for it.

    Attributes
    ----------
    pick
        (n,) of the survey.
    frame
        (n,) of the adjustment.
    fall
        (n,) of the sum of squares without each; 0 of those that were left out.
    place_px
        (n, 2) where its label belongs in its photo, by all else; NaN where nothing says it.
    taking
        (n,) whether it takes part.
    """

    pick: Ints
    frame: Ints
    fall: Floats
    place_px: Floats
    taking: Bools


def strays(standing: Standing) -> Strays:
    """The picks that do not fit, those that were left out first, then the worst first."""
    adjustment, refined, survey = standing.adjustment, standing.refined, standing.survey
    fall = np.zeros(len(survey.pick_frame))
    block = adjustment.minimum.blocks["pixels"]
    fall[refined.pick_index] = falls_without(block, adjustment.covariance)
    spoilt = standing.spoilt
    frame = frames_of(standing)[survey.pick_frame]
    size = np.where(spoilt, np.inf, fall)
    picks = np.flatnonzero((size > STRAYS) & (frame >= 0))
    picks = picks[np.argsort(-size[picks], kind="stable")][:MOST_PICKS]
    place = _places(standing, picks, frame[picks])
    size = np.where(spoilt[picks], 0.0, fall[picks])
    return Strays(picks, frame[picks], size, place, ~spoilt[picks])


def frames_of(standing: Standing) -> Ints:
    """(F,) frames of the adjustment, for those of the survey; -1 where it has none."""
    known = {name: k for k, name in enumerate(standing.adjustment.survey.frame_id)}
    return np.array([known.get(name, -1) for name in standing.survey.frame_id], dtype=np.int64)


def labels_of(standing: Standing) -> Ints:
    """(K,) labels of the adjustment, for those of the survey; -1 where it has none."""
    return standing.adjustment.label_rows(standing.survey.label)


def _places(standing: Standing, picks: Ints, frame: Ints) -> Floats:
    """(n, 2) where the labels of picks belong [px], by all but each pick itself.

    In the linear model the residual without a pick is Q^-1 v, with its residual v and cofactor
    matrix Q = I - A N^-1 A^T (Cook and Weisberg 1982, "Residuals and influence", eq. 2.2.9).

    Parameters
    ----------
    standing
        Where the survey stands.
    picks
        (n,) of the survey.
    frame
        (n,) their frames in the adjustment.
    """
    adjustment, survey = standing.adjustment, standing.survey
    label = labels_of(standing)[survey.pick_label[picks]]
    place = np.full((len(picks), 2), np.nan)
    seen = np.flatnonzero(label >= 0)
    place[seen] = adjustment.pixels(frame[seen], label[seen])
    row = np.full(len(survey.pick_frame), -1)
    row[standing.refined.pick_index] = np.arange(len(standing.refined.pick_index))
    taking = np.flatnonzero(row[picks] >= 0)
    block, rows = adjustment.minimum.blocks["pixels"], row[picks[taking]]
    own = Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
    share, axes = np.linalg.eigh(cofactors(own, adjustment.covariance))
    along = np.einsum("nra,nr->na", axes, own.residual) / np.maximum(share, LEAST_CHECKED)
    without = np.einsum("nra,na->nr", axes, along)
    without[share.min(axis=1) < LEAST_CHECKED] = np.nan
    sigma = survey.pick_sigma_px[picks[taking], None]
    place[taking] = survey.pixel_px[picks[taking]] + sigma * without
    return place
