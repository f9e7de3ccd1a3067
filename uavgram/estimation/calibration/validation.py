"""Cross-validation: prediction of unused photos by a calibration, and choice of the lens model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.calibration.adjustment import Fit, UndeterminedError, adjust, fit_poses
from uavgram.estimation.calibration.problem import POSE_SIZE
from uavgram.model.arrays import Floats

MAX_FOLDS = 20
"""Largest number of adjustments of a cross-validation."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Photos predicted by a camera that was calibrated without them.

    Attributes
    ----------
    squares
        (M,) whitened sum of squares of each photo's residuals: with camera and board by the other
        photos, and the pose by its own corners. NaN if the others do not determine it.
    degrees
        (M,) 2 n - 6.
    """

    squares: Floats
    degrees: Floats

    @property
    def factor(self) -> float:
        """Mean square per degree of freedom: corners' noise and camera's error; inf if unknown.

        A model that needs some of the photos to be determined predicts nothing.
        """
        if not np.isfinite(self.squares).all():
            return np.inf
        return float(self.squares.sum() / max(self.degrees.sum(), 1.0))

    @property
    def by_photo(self) -> Floats:
        """(M,) mean square per degree of freedom of each photo."""
        return np.asarray(self.squares / np.maximum(self.degrees, 1.0))


def cross_validate(fit: Fit) -> HeldOut:
    """Leave photos out, one at a time (in at most 20 groups), and predict them."""
    photos = len(fit.corners.weight)
    squares = np.full(photos, np.nan)
    group = np.arange(photos) % min(photos, MAX_FOLDS)
    for fold in range(group.max() + 1):
        out = group == fold
        try:
            rest = adjust(fit.lens, fit.corners.take(~out), fit.state.take(~out))
        except UndeterminedError:
            continue
        seen = replace(
            fit.state.take(out), parameters=rest.state.parameters, bow_m=rest.state.bow_m
        )
        cost = fit_poses(fit.lens, fit.corners.take(out), seen)[1]
        squares[out] = np.where(np.isfinite(cost), cost, np.nan)
    return HeldOut(squares, np.maximum(2.0 * fit.corners.count - POSE_SIZE, 0.0))


def compute_information_criteria(fit: Fit) -> tuple[float, float]:
    """Compute Akaike's and the Bayesian information criterion, with unknown noise of the corners.

    Burnham and Anderson 2002, "Model selection and multimodel inference", sec. 2.2 and 6.4.1.
    """
    observations = 2.0 * float(fit.corners.count.sum())
    unknowns = fit.lens.size + POSE_SIZE * np.count_nonzero(fit.corners.count) + 1
    fitted = observations * np.log(fit.corner_cost / observations)
    return float(fitted + 2 * unknowns), float(fitted + unknowns * np.log(observations))


def choose_simplest(scores: list[HeldOut]) -> int:
    """Return the index of the first model (simplest first) that predicts as well as the best one.

    As well: within one standard error of the difference over photos (Hastie, Tibshirani and
    Friedman 2009, "The elements of statistical learning", sec. 7.10).
    """
    factors = [score.factor for score in scores]
    best = int(np.argmin(factors))
    for index in range(best):
        if not np.isfinite(factors[index]):
            continue
        difference = scores[index].by_photo - scores[best].by_photo
        if difference.mean() <= difference.std(ddof=1) / np.sqrt(len(difference)):
            return index
    return best
