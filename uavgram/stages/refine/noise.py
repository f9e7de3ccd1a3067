"""Estimate the noise: sigmas of picks, roughness and relief of the ground.

Stated sigmas are guesses by people. Where the residuals contradict them, the model is extended step
by step: first the noise of the picks alone; where misfits show that the ground is not plane, also
the departure of each point (roughness), a quadratic surface (a crown), or correlated relief. The
marginal likelihood decides between the models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import redundancy_of
from uavgram.estimation.reliability.variance_components import (
    Component,
    Estimated,
    Linearised,
    of_one_group,
    probability_at_boundary,
)
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.ground.plane import choose_knots
from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.reliability import (
    AreaNoise,
    EstimatedSigma,
    Noise,
    PickNoise,
    SurfaceShape,
)
from uavgram.model.survey.survey import Relief, Survey
from uavgram.stages.refine.continued import carried, continued, lines_used
from uavgram.stages.refine.outstanding import Outstanding, outstanding

STATED_WEIGHT = 20.0
"""Weight of the stated sigma of picks, as a number of residuals."""

STATED_ROUGHNESS_WEIGHT = 2.0
"""Weight of a stated roughness, which is thus known to within a factor of 1.6: mostly it is the
default. A ground that is stated to be a plane has no such prior."""

STATED_IDENTIFICATION_WEIGHT = 5.0
"""Weight of the stated identification sigma (distance between picked and intended point): lengths
and known things determine it poorly."""

STATED_LENGTH_WEIGHT = 5.0
"""Weight of the stated sigma of taped lengths."""

LITTLE = 30.0
"""Redundancy of the picks below which their sigmas are never taken as smaller than stated."""

FEW_LENGTHS = 10.0
"""Redundancy of taped lengths below which their sigmas are never taken as smaller than stated."""

SAME = 0.03
"""Relative change of a sigma that does not justify another adjustment."""

BY_HAND, TARGETS, IDENTIFIED, TAPED = -1, -2, -3, -4
"""Codes of picks by people, of targets, of the identification and of taped lengths; other
components have the index of an area instead."""

UNIT_M = 0.05
"""Initial value of roughness and relief in the search [m]."""

LEAST_M = 0.002
"""Roughness or relief below which a ground counts as plane [m]."""

KNOTS = 30
"""Largest number of functions of a correlated relief."""

RANGES = (0.2, 0.45)
"""Ranges of a correlated relief, as shares of the extent of the points."""

PENALTY: dict[SurfaceShape, float] = {"plane": 0.5, "quadratic": 2.5, "correlated": 4.0}
"""Least gain in log-likelihood of each shape, with roughness, over smooth, plane ground. Small for
roughness, since that is only tried where picks and ground misfit (`MISFIT`), and an omitted
roughness makes sigmas too small. Larger for functions of the place, of which several are tried."""

LEAST_POINTS = 8
"""Number of points of an area below which only their own departures are estimated."""

PASSES = 3
"""Adjustments with sigmas learnt from the one before."""


class _Model(NamedTuple):
    """Model of the noise: likelihood in units, and components whose factors are estimated.

    Attributes
    ----------
    shape
        Shape of the ground; None: as stated.
    problem
        The likelihood with the stated sigmas, and units of roughness and relief.
    components, areas
        Variance components, those of picks first; and the index of the area of each component of
        the ground, otherwise the code of its kind.
    """

    shape: SurfaceShape | None
    problem: SurveyProblem
    components: tuple[Component, ...]
    areas: tuple[int, ...]


class _Fitted(NamedTuple):
    """Model with its likeliest factors, and the log-likelihood less the penalty of the model."""

    model: _Model
    found: Estimated
    merit: float

    @property
    def log_likelihood(self) -> float:
        """Log-likelihood without the penalty of the model."""
        return self.merit + (0.0 if self.model.shape is None else PENALTY[self.model.shape])


def with_noise_learnt(survey: Survey, refined: Refined) -> tuple[Survey, Refined]:
    """Estimate sigmas from the residuals, and readjust with them.

    Parameters
    ----------
    survey
        The original survey with the stated sigmas.
    refined
        Its adjustment, without gross errors.

    Returns
    -------
    The survey with the learnt sigmas, and its adjustment.
    """
    if not refined.adjustment.minimum.converged:
        return survey, refined
    try:
        return _with_noise_learnt(survey, refined)
    except SingularError:  # misfit so large that picks with the learnt noise determine nothing
        return survey, refined


def _with_noise_learnt(survey: Survey, refined: Refined) -> tuple[Survey, Refined]:
    stated = refined.adjustment
    few, fits = outstanding(stated)
    models = [_as_stated(stated, redundancy_of(stated, "pixels")), *_grown(stated, fits=fits)]
    simple = len(models) == 1 and len(models[0].components) == 1 and not few

    def estimated(model: _Model, adjustment: Adjustment, first: Floats | None) -> _Fitted:
        if simple:
            return _picks_alone(model, adjustment, first)
        return _fitted(model, adjustment, few, first)

    # Choose the model by its penalised marginal likelihood.
    tried = [estimated(model, stated, None) for model in models]
    fitted = max(tried, key=lambda one: one.merit)
    chance = _chance(fitted, tried)
    if fitted.model.shape is None and np.abs(np.log(fitted.found.factor)).max() < SAME:
        return survey, replace(refined, noise=_noise(fitted, stated, stated.survey, chance))
    adjustment = stated
    # Alternate readjustment and estimation until the factors are stable.
    for _ in range(PASSES):
        used = fitted
        adjustment = continued(adjustment, _learnt(used, stated.survey))
        fitted = estimated(used.model, adjustment, used.found.factor)
        if np.abs(np.log(fitted.found.factor / used.found.factor)).max() < SAME:
            break
    # Report the sigmas with which the result was adjusted.
    noise = _noise(used, adjustment, stated.survey, chance)
    return _learnt(used, survey), replace(
        refined, adjustment=adjustment, noise=noise, stated=stated
    )


def _as_stated(stated: Adjustment, redundancy: float) -> _Model:
    """Return the model that learns only the noise of the picks, and a stated roughness."""
    return _components(None, stated.problem, stated, 1.0 if redundancy < LITTLE else 0.0)


def _grown(stated: Adjustment, *, fits: bool) -> list[_Model]:
    """Return other ground shapes worth trying: none where all fits or the redundancy is small."""
    shown = (name for name in ("pixels", "matches") if name in stated.minimum.blocks)
    if sum(redundancy_of(stated, name) for name in shown) <= LITTLE:
        return []
    uneven = any(ground.roughness_sigma_m > 0 for ground in stated.survey.grounds)
    # Matches may already have shown a roughness (`off_ground/shown.py`).
    if not fits or (uneven and stated.survey.matches.points):
        return _every_shape(stated)
    # Free points fit on any ground, and so hide misfits; their heights count from the ground.
    return [_each_its_own(stated)] if stated.survey.is_free.any() else []


def _every_shape(stated: Adjustment) -> list[_Model]:
    """Return every other shape of the ground: each point's own departure, and smooth ones."""
    survey, point = stated.survey, stated.state.point[:, :2]
    own = [point[survey.area == area] for area in range(len(survey.grounds))]
    models = [_each_its_own(stated)]
    if any(len(each) >= LEAST_POINTS for each in own):
        models.append(_model("quadratic", stated, [_quadratic(each) for each in own]))
        models += [
            _model("correlated", stated, [_correlated(one, share) for one in own])
            for share in RANGES
        ]
    return models


def _each_its_own(stated: Adjustment) -> _Model:
    """Return the model with a departure of each point, and without smooth relief."""
    return _model("plane", stated, [None for _ in stated.survey.grounds])


def _quadratic(point_m: Floats) -> Relief | None:
    if len(point_m) < LEAST_POINTS:
        return None
    middle = 0.5 * (point_m.min(axis=0) + point_m.max(axis=0))
    scale = 0.5 * float(np.ptp(point_m, axis=0).max())
    return Relief(kind="quadratic", sigma_m=UNIT_M, scale_m=scale, knots_m=middle[None])


def _correlated(point_m: Floats, share: float) -> Relief | None:
    if len(point_m) < LEAST_POINTS:
        return None
    reach = share * float(np.ptp(point_m, axis=0).max())
    knots = choose_knots(point_m, KNOTS)
    return Relief(kind="correlated", sigma_m=UNIT_M, scale_m=reach, knots_m=knots)


def _model(shape: SurfaceShape, stated: Adjustment, relief: Sequence[Relief | None]) -> _Model:
    grounds = tuple(
        replace(ground, roughness_sigma_m=ground.roughness_sigma_m or UNIT_M, relief=own)
        for ground, own in zip(stated.survey.grounds, relief, strict=True)
    )
    survey = replace(stated.survey, grounds=grounds)
    problem = SurveyProblem(survey, stated.problem.pivot_m, lines_used(stated))
    return _components(shape, problem, stated, 0.0)


def _components(
    shape: SurfaceShape | None, problem: SurveyProblem, adjustment: Adjustment, smallest: float
) -> _Model:
    """List the variance components of a likelihood in units.

    Parameters
    ----------
    shape
        Shape of the ground.
    problem
        The likelihood.
    adjustment
        Adjustment with the stated sigmas, which are priors.
    smallest
        Lower limit of the factor of the picks' sigmas.
    """
    stated = adjustment.survey
    targets = stated.pick_is_target
    found, areas = [], []
    for target in (False, True):
        if (targets == target).any():
            rows = None if (targets == target).all() else np.flatnonzero(targets == target)
            found.append(Component("pixels", rows, STATED_WEIGHT, smallest))
            areas.append(TARGETS if target else BY_HAND)
    if len(stated.identified):
        found.append(Component("identification", None, STATED_IDENTIFICATION_WEIGHT))
        areas.append(IDENTIFIED)
    taped = np.flatnonzero(_is_taped(stated)[problem.line_index])
    if len(taped):
        least = 1.0 if redundancy_of(adjustment, "lengths") < FEW_LENGTHS else 0.0
        found.append(Component("lengths", taped, STATED_LENGTH_WEIGHT, least))
        areas.append(TAPED)
    for area, ground in enumerate(problem.survey.grounds):
        rows = np.flatnonzero(stated.area[problem.third.rough] == area)
        if ground.roughness_sigma_m > 0 and len(rows):
            prior = STATED_ROUGHNESS_WEIGHT * (stated.grounds[area].roughness_sigma_m > 0)
            found.append(Component("roughness", rows, prior))
            areas.append(area)
    for area, ground in enumerate(problem.survey.grounds):
        if ground.relief is not None:
            found.append(Component("relief", problem.ground.relief_rows(area)))
            areas.append(area)
    return _Model(shape, problem, tuple(found), tuple(areas))


def _is_taped(survey: Survey) -> Bools:
    """Mark lengths (L,) that people taped, not those of plates, whose tape has its own prior."""
    plates = {name for name, _ in survey.own_scale_sigma}
    taped = [tape not in plates for tape in survey.line_tape]
    return np.array(taped or [True] * len(survey.line_start), dtype=np.bool_)


def _fitted(
    model: _Model, adjustment: Adjustment, few: Mapping[str, Outstanding], first: Floats | None
) -> _Fitted:
    """Estimate the likeliest factors of a model, linearised about an adjustment.

    Parameters
    ----------
    model
        The components to be estimated.
    adjustment
        The adjustment about whose state the model is linearised.
    few
        Outliers, which get little weight.
    first
        (C,) factors to start from.
    """
    problem, layout = model.problem, model.problem.layout
    blocks = problem.evaluate(carried(adjustment, problem))
    assert blocks is not None  # noqa: S101  (the state is that of an adjusted survey)
    for name, one in few.items():
        blocks[name] = _with_little_weight(blocks[name], one)
    begin = np.ones(len(model.components)) if first is None else first
    found = Linearised(blocks, layout.size, layout.structure).estimate(model.components, begin)
    # Add the log of the prior sigma of each unknown, so that models with different unknowns
    # can be compared.
    unit = sum(
        float(np.log(blocks[k].jacobian).sum()) for k in ("roughness", "relief") if k in blocks
    )
    price = 0.0 if model.shape is None else PENALTY[model.shape]
    return _Fitted(model, found, found.log_likelihood + unit - price)


def _picks_alone(model: _Model, adjustment: Adjustment, first: Floats | None) -> _Fitted:
    """Estimate the factor of the picks' sigmas, where no other component is in question.

    Parameters
    ----------
    model
        Model with one component.
    adjustment
        Adjustment with the sigmas as stated, or times a factor.
    first
        (1,) the factor of the sigmas of that adjustment; None: one.
    """
    block = adjustment.minimum.blocks["pixels"]
    scale = 1.0 if first is None else float(first[0])
    # Sum of squares at the stated sigmas, and redundancy n - trace(leverage).
    squares = scale**2 * float(np.sum(block.residual**2))
    leverage = adjustment.covariance.leverage(block)
    found = of_one_group(squares, leverage.size - float(leverage.sum()), model.components[0])
    return _Fitted(model, found, 0.0)


def _with_little_weight(block: Block, few: Outstanding) -> Block:
    weight = np.ones(len(block.residual))
    weight[few.rows] = 1.0 / few.errors
    residual = block.residual * weight[:, None]
    return Block(residual, block.columns, block.jacobian * weight[:, None, None])


def _learnt(fitted: _Fitted, survey: Survey) -> Survey:
    """Return the survey with learnt sigmas and ground; `survey` has the stated ones."""
    factor = fitted.found.factor
    grounds = list(fitted.model.problem.survey.grounds)
    for one, area, scale in zip(
        fitted.model.components, fitted.model.areas, factor.tolist(), strict=True
    ):
        if one.block == "roughness":
            size = scale * grounds[area].roughness_sigma_m
            is_stated = survey.grounds[area].roughness_sigma_m > 0
            size = size if size > LEAST_M or is_stated else 0.0
            grounds[area] = replace(grounds[area], roughness_sigma_m=size)
        if one.block == "relief" and (relief := grounds[area].relief) is not None:
            size = scale * relief.sigma_m
            own = replace(relief, sigma_m=size) if size > LEAST_M else None
            grounds[area] = replace(grounds[area], relief=own)
    sigma = np.array(survey.pick_sigma_px)
    length_m, beside_m = np.array(survey.length_sigma_m), survey.identification_sigma_m
    for area, scale in zip(fitted.model.areas, factor.tolist(), strict=True):
        if area in (BY_HAND, TARGETS):
            sigma[survey.pick_is_target == (area == TARGETS)] *= scale
        if area == TAPED:
            length_m[_is_taped(survey)] *= scale
        if area == IDENTIFIED:
            beside_m = scale * beside_m
    return replace(
        survey,
        pick_sigma_px=sigma,
        length_sigma_m=length_m,
        identification_sigma_m=beside_m,
        grounds=tuple(grounds),
    )


def _chance(fitted: _Fitted, tried: Sequence[_Fitted]) -> float:
    """Return the probability of such uneven ground by chance; `tried[0]` is the model as stated."""
    own = len(fitted.model.components) - len(tried[0].model.components)
    if fitted.model.shape is None or own < 1:
        return 1.0
    gain = fitted.log_likelihood - tried[0].log_likelihood
    return min(1.0, (len(tried) - 1) * probability_at_boundary(gain, own))


def _noise(fitted: _Fitted, adjustment: Adjustment, stated: Survey, chance: float) -> Noise:
    """Describe the learnt noise for the report.

    Parameters
    ----------
    fitted
        The factors of the sigmas.
    adjustment
        The adjustment with them.
    stated
        The survey with the stated sigmas.
    chance
        Probability of such uneven ground by chance.
    """
    # Sigmas of the factors are relative.
    factor, sigma = fitted.found.factor, fitted.found.factor * fitted.found.sigma
    components = zip(fitted.model.components, fitted.model.areas, sigma.tolist(), strict=True)
    rough = {area: own for one, area, own in components if one.block == "roughness"}
    units = fitted.model.problem.survey.grounds
    picks, others = [], {}
    for k, area in enumerate(fitted.model.areas):
        if area in (IDENTIFIED, TAPED):
            own = stated.length_sigma_m[_is_taped(stated)]
            own = stated.identification_sigma_m if area == IDENTIFIED else own
            size = float(np.sqrt(np.mean(own**2)))
            others[area] = EstimatedSigma(
                stated_m=size, factor=float(factor[k]), sigma=float(sigma[k])
            )
        if area in (BY_HAND, TARGETS):
            own = stated.pick_sigma_px[stated.pick_is_target == (area == TARGETS)]
            picks.append(
                PickNoise(
                    source="target" if area == TARGETS else "hand",
                    stated_px=float(np.sqrt(np.mean(own**2))),
                    factor=float(factor[k]),
                    sigma=float(sigma[k]),
                )
            )
    areas = [
        AreaNoise(
            area=ground.name,
            stated_m=stated.grounds[area].roughness_sigma_m,
            estimated_m=ground.roughness_sigma_m,
            sigma_m=rough.get(area, 0.0) * units[area].roughness_sigma_m,
            shape="plane" if ground.relief is None else ground.relief.kind,
            relief_m=adjustment.relief_m(area),
            probability=chance,
        )
        for area, ground in enumerate(_learnt(fitted, stated).grounds)
    ]
    return Noise(
        picks=tuple(picks),
        roughness=tuple(areas),
        lengths=others.get(TAPED),
        identification=others.get(IDENTIFIED),
    )
