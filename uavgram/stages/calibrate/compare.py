"""Which lens model: by photos left out, and by information criteria."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.calibration.adjustment import Fit, adjust
from uavgram.estimation.calibration.normals import UndeterminedError
from uavgram.estimation.calibration.problem import Corners, State, lens_of
from uavgram.estimation.calibration.start import better_of_two, first_values
from uavgram.estimation.calibration.validation import (
    HeldOut,
    held_out,
    information_criteria,
    simplest_good,
)
from uavgram.model.calibration_photos import CalibrationOptions, parameter_count
from uavgram.model.calibration_result import ModelScore
from uavgram.model.camera import LensModel

MODELS: dict[LensModel, tuple[int, ...]] = {"brown": (3, 5, 8), "fisheye": (4,)}
"""Numbers of coefficients, the simplest first."""

USUAL: dict[LensModel, int] = {"brown": 5, "fisheye": 4}


def start_staged(options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]) -> State:
    """First values for all that the options ask for: a plain lens and a flat board first.

    Rational lenses and bent boards have minima of their own far from the truth.
    """
    usual = USUAL[options.model]
    wanted = replace(options, coefficients=options.coefficients or usual)
    plain = replace(wanted, coefficients=min(wanted.coefficients, usual), bow="flat")
    lens = lens_of(plain)
    flat = replace(corners, bow=corners.bow[..., :0])
    known = None
    if plain.prior is not None and (np.diag(plain.prior.information)[:4] > 0).all():
        known = lens.prior_mean
    start = adjust(lens, flat, first_values(lens, flat, size_px, known)).state
    start = better_of_two(lens, flat, start)
    return extended(start, wanted, corners)


def extended(state: State, options: CalibrationOptions, corners: Corners) -> State:
    """A state with the parameters and the bow that the options ask for: new ones are zero."""
    parameters = np.zeros(parameter_count(options.model, options.coefficients))
    shared = min(len(parameters), len(state.parameters))
    parameters[:shared] = state.parameters[:shared]
    held = np.abs(lens_of(options).basis).sum(axis=1) == 0
    held[:4] = False  # a principal point that is held stays where it is
    parameters[held] = 0.0
    count = corners.bow.shape[2]
    bow = state.bow_m if len(state.bow_m) == count else np.zeros(count)
    return replace(state, parameters=parameters, bow_m=bow)


def compare_models(
    options: CalibrationOptions, corners: Corners, state: State, sigma_px: float
) -> tuple[ModelScore, ...]:
    """Judge every number of coefficients; the fewest that predict photos left out are chosen.

    Parameters
    ----------
    options
        All but the number of coefficients.
    corners
        Without outliers.
    state
        With the usual number of coefficients.
    sigma_px
        What a whitened residual of 1 means in pixels.
    """
    found: list[tuple[int, Fit, HeldOut]] = []
    for coefficients in MODELS[options.model]:
        own = replace(options, coefficients=coefficients)
        try:
            fit = adjust(lens_of(own), corners, extended(state, own, corners))
        except UndeterminedError:  # too many for these photos
            continue
        found.append((coefficients, fit, held_out(fit)))
    chosen = simplest_good([held for *_, held in found])
    return tuple(
        score(fit, held, coefficients, sigma_px, is_chosen=index == chosen)
        for index, (coefficients, fit, held) in enumerate(found)
    )


def score(
    fit: Fit, held: HeldOut, coefficients: int, sigma_px: float, *, is_chosen: bool
) -> ModelScore:
    """Figures of one model; `sigma_px` as for `compare_models`."""
    aic, bic = information_criteria(fit)
    return ModelScore(
        coefficients=coefficients,
        aic=aic,
        bic=bic,
        held_out_px=float(np.sqrt(held.factor)) * sigma_px if np.isfinite(held.factor) else None,
        is_chosen=is_chosen,
    )
