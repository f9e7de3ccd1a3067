"""Places of a photo's labels by all other picks, and picks that are not there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_cofactors, compute_reductions
from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.stages.refine.causes.hypothesis import Diagnosis

STRAY_DECREASE = 16.0
"""Decrease of the sum of squares without a pick, above which it is examined."""

MAX_PICKS = 60
"""Largest number of picks that are examined: left-out ones, and those of largest misfit."""

MIN_REDUNDANCY = 0.01
"""Redundancy number of a pick below which the others do not determine its place."""


class StrayPicks(NamedTuple):
    """Picks of adjusted frames that do not fit, or were left out for that reason.

    Attributes
    ----------
    pick
        (n,) picks of the survey.
    frame
        (n,) frames of the adjustment.
    fall
        (n,) decrease of the sum of squares without each; 0 for left-out picks.
    place_px
        (n, 2) place of its label in its photo, by all other observations; NaN where undetermined.
    taking
        (n,) whether it takes part.
    """

    pick: Ints
    frame: Ints
    fall: Floats
    place_px: Floats
    taking: Bools


def find_stray_picks(diagnosis: Diagnosis) -> StrayPicks:
    """Find picks that do not fit, left-out ones first, then the worst first."""
    adjustment, refined, survey = diagnosis.adjustment, diagnosis.refined, diagnosis.survey
    fall = np.zeros(len(survey.pick_frame))
    block = adjustment.minimum.blocks["pixels"]
    fall[refined.pick_index] = compute_reductions(block, adjustment.covariance)
    spoilt = diagnosis.spoilt
    frame = frames_of(diagnosis)[survey.pick_frame]
    size = np.where(spoilt, np.inf, fall)
    picks = np.flatnonzero((size > STRAY_DECREASE) & (frame >= 0))
    picks = picks[np.argsort(-size[picks], kind="stable")][:MAX_PICKS]
    place = _predict_places(diagnosis, picks, frame[picks])
    size = np.where(spoilt[picks], 0.0, fall[picks])
    return StrayPicks(picks, frame[picks], size, place, ~spoilt[picks])


def frames_of(diagnosis: Diagnosis) -> Ints:
    """Return the frames (F,) of the adjustment for those of the survey; -1 where it has none."""
    known = {name: k for k, name in enumerate(diagnosis.adjustment.survey.frame_id)}
    return np.array([known.get(name, -1) for name in diagnosis.survey.frame_id], dtype=np.int64)


def labels_of(diagnosis: Diagnosis) -> Ints:
    """Return the labels (K,) of the adjustment for those of the survey; -1 where it has none."""
    return diagnosis.adjustment.label_rows(diagnosis.survey.label)


def _predict_places(diagnosis: Diagnosis, picks: Ints, frame: Ints) -> Floats:
    """Predict the places (n, 2) of the labels of picks [px], each without the pick itself.

    In the linear model the residual without a pick is Q^-1 v, with its residual v and cofactor
    matrix Q = I - A N^-1 A^T (Cook and Weisberg 1982, "Residuals and influence", eq. 2.2.9).

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    picks
        (n,) picks of the survey.
    frame
        (n,) their frames in the adjustment.
    """
    adjustment, survey = diagnosis.adjustment, diagnosis.survey
    label = labels_of(diagnosis)[survey.pick_label[picks]]
    place = np.full((len(picks), 2), np.nan)
    seen = np.flatnonzero(label >= 0)
    # Projections of adjusted labels; for picks that take part, without the pick itself.
    place[seen] = adjustment.pixels(frame[seen], label[seen])
    row = np.full(len(survey.pick_frame), -1)
    row[diagnosis.refined.pick_index] = np.arange(len(diagnosis.refined.pick_index))
    taking = np.flatnonzero(row[picks] >= 0)
    block, rows = adjustment.minimum.blocks["pixels"], row[picks[taking]]
    own = Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
    # Q^-1 v in the eigenvectors of Q.
    share, axes = np.linalg.eigh(compute_cofactors(own, adjustment.covariance))
    along = np.einsum("nra,nr->na", axes, own.residual) / np.maximum(share, MIN_REDUNDANCY)
    without = np.einsum("nra,na->nr", axes, along)
    without[share.min(axis=1) < MIN_REDUNDANCY] = np.nan
    sigma = survey.pick_sigma_px[picks[taking], None]
    place[taking] = survey.pixel_px[picks[taking]] + sigma * without
    return place
