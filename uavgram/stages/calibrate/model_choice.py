"""Choose the number of distortion coefficients: the best one that the photos determine.

The criteria are predictions of left-out photos (cross-validation), and information criteria.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import (
    Fit,
    HeldOut,
    UndeterminedError,
    adjust,
    choose_simplest,
    compute_information_criteria,
    cross_validate,
)
from uavgram.estimation.calibration.problem import Corners, State, make_lens
from uavgram.estimation.calibration.projection import compute_length_sigmas
from uavgram.estimation.calibration.reliability import CleanedFit, remove_outliers
from uavgram.estimation.calibration.start import choose_better_pose, estimate_first_values
from uavgram.model.board import BoardObservations, CalibrationOptions, ModelScore, parameter_count
from uavgram.model.camera import LensModel
from uavgram.stages.calibrate.assessment import AssessedCalibration, judge

MODELS: dict[LensModel, tuple[int, ...]] = {"brown": (3, 5, 8), "fisheye": (4,)}
"""Numbers of coefficients, the simplest first."""

USUAL: dict[LensModel, int] = {"brown": 5, "fisheye": 4}


def start_staged(options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]) -> State:
    """Compute first values for the requested options, with a plain lens and a flat board first.

    Rational lenses and bent boards have minima of their own far from the truth.

    Parameters
    ----------
    options
        Requested options.
    corners
        (M, n) corners of all photos.
    size_px
        Width and height of the image [px].
    """
    usual = USUAL[options.model]
    wanted = replace(options, coefficients=options.coefficients or usual)
    plain = replace(wanted, coefficients=min(wanted.coefficients, usual), bow="flat")
    lens = make_lens(plain)
    flat = replace(corners, bow=corners.bow[..., :0])
    known = None
    if plain.prior is not None and (np.diag(plain.prior.information)[:4] > 0).all():
        known = lens.prior_mean
    start = adjust(lens, flat, estimate_first_values(lens, flat, size_px, known)).state
    start = choose_better_pose(lens, flat, start)
    return extended(start, wanted, corners)


def extended(state: State, options: CalibrationOptions, corners: Corners) -> State:
    """Extend a state to the requested parameters and bow, with zeros.

    Parameters
    ----------
    state
        State with any number of coefficients.
    options
        Requested options.
    corners
        (M, n) corners of all photos.
    """
    parameters = np.zeros(parameter_count(options.model, options.coefficients))
    shared = min(len(parameters), len(state.parameters))
    parameters[:shared] = state.parameters[:shared]
    held = np.abs(make_lens(options).basis).sum(axis=1) == 0
    held[:4] = False  # a fixed principal point is unchanged
    parameters[held] = 0.0
    count = corners.bow.shape[2]
    bow = state.bow_m if len(state.bow_m) == count else np.zeros(count)
    return replace(state, parameters=parameters, bow_m=bow)


@dataclass(frozen=True, eq=False)
class Candidate:
    """Lens model with a certain number of coefficients.

    Attributes
    ----------
    coefficients
        Number of distortion coefficients.
    fit, held
        Its adjustment, and its prediction of left-out photos; None where the photos do not
        determine it.
    dropped
        Reason why it cannot be chosen; empty where it can.
    """

    coefficients: int
    fit: Fit | None
    held: HeldOut | None
    dropped: str = ""

    def score(self, sigma_px: float, *, is_chosen: bool) -> ModelScore:
        """Return figures of this model; `sigma_px` converts a whitened residual to pixels."""
        aic, bic = (None, None) if self.fit is None else compute_information_criteria(self.fit)
        known = self.held is not None and np.isfinite(self.held.factor)
        return ModelScore(
            coefficients=self.coefficients,
            aic=aic,
            bic=bic,
            held_out_px=float(np.sqrt(self.held.factor)) * sigma_px
            if known and self.held
            else None,
            is_chosen=is_chosen,
            dropped=self.dropped,
        )


def candidates(options: CalibrationOptions, corners: Corners, state: State) -> list[Candidate]:
    """Adjust every number of coefficients, the simplest first, and predict left-out photos.

    Parameters
    ----------
    options
        All options but the number of coefficients.
    corners
        Corners without outliers.
    state
        State with any number of coefficients.
    """
    found = []
    for coefficients in MODELS[options.model]:
        own = replace(options, coefficients=coefficients)
        try:
            fit = adjust(make_lens(own), corners, extended(state, own, corners))
            found.append(Candidate(coefficients, fit, cross_validate(fit)))
        except UndeterminedError as fault:
            found.append(Candidate(coefficients, None, None, str(fault)))
    return found


def choose(found: list[Candidate]) -> Candidate | None:
    """Return the fewest coefficients with an equally good prediction; None without a candidate."""
    left = [(one, one.held) for one in found if one.held is not None and not one.dropped]
    return left[choose_simplest([held for _, held in left])][0] if left else None


LARGEST_COST = 0.01
"""Largest relative sigma of a usual length due to the lens: ordinary calibrations have 0.0002 to
0.002, rational lenses with interchangeable coefficients 0.01 to 9."""


def choose_and_estimate(
    observations: BoardObservations, options: CalibrationOptions, corners: Corners
) -> tuple[AssessedCalibration, tuple[ModelScore, ...]]:
    """Estimate with the best number of coefficients that the photos determine.

    Parameters
    ----------
    observations
        Corners found in M photos.
    options
        Requested options.
    corners
        The corners, padded to one size (M, n).

    Raises
    ------
    UndeterminedError
        They determine none.
    """
    photo = observations.photos[0]
    cleaned = _cleaned(options, corners, (photo.width_px, photo.height_px))
    kept = cleaned.fit.corners.count > 0
    clean = cleaned.fit.corners.take(kept)
    sigma_px = float(np.sqrt(np.mean(clean.weight[clean.weight > 0] ** -2.0)))
    found = candidates(options, clean, cleaned.fit.state.take(kept))
    estimated: dict[int, AssessedCalibration] = {}
    best = choose(found)
    while best is not None:
        own = replace(options, coefficients=best.coefficients)
        start = extended(cleaned.fit.state, own, corners)
        try:
            judged = judge(
                observations, own, corners, remove_outliers(make_lens(own), corners, start, own)
            )
            estimated[own.coefficients], why = judged, _why_not(judged)
        except UndeterminedError as fault:
            why = str(fault)
        if not why:
            break
        found = [replace(one, dropped=why) if one is best else one for one in found]
        best = choose(found)
    if not estimated:
        raise UndeterminedError(found[0].dropped)
    # Where none is good, take the simplest, with the fewest unknowns; the verdict rates it.
    chosen = min(estimated) if best is None else best.coefficients
    scores = (one.score(sigma_px, is_chosen=one.coefficients == chosen) for one in found)
    return estimated[chosen], tuple(scores)


def _cleaned(options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]) -> CleanedFit:
    """Remove outliers with the usual number of coefficients, or with as many as are determined."""
    usual = USUAL[options.model]
    *first, last = (usual, *(n for n in reversed(MODELS[options.model]) if n < usual))

    def clean(count: int) -> CleanedFit:
        own = replace(options, coefficients=count, outliers="remove")
        return remove_outliers(make_lens(own), corners, start_staged(own, corners, size_px), own)

    for count in first:
        with suppress(UndeterminedError):
            return clean(count)
    return clean(last)


def _why_not(judged: AssessedCalibration) -> str:
    """Return the reason against a lens that fits; empty without one."""
    if not judged.fit.converged:
        return "its adjustment did not converge"
    try:
        cost = compute_length_sigmas(judged.camera("camera"), tilt_rad=0.0).medians[0]
    except GeometryError:  # it folds back all over the image
        return "hardly a pixel of it has a ray"
    if cost <= LARGEST_COST:
        return ""
    return f"the photos do not determine its coefficients: it alone would cost a length {cost:.1%}"
