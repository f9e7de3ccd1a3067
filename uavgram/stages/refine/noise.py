"""Estimate the noise: sigmas of picks, roughness and relief of the ground.

Stated sigmas are guesses by people. Where the residuals contradict them, the model is extended step
by step: first the noise of the picks alone; where misfits show that the ground is not plane, also
the departure of each point (roughness), a quadratic surface (a crown), or correlated relief. The
marginal likelihood decides between the models. Messages report errors of another size than stated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_redundancy
from uavgram.estimation.reliability.variance_components import (
    LinearisedObservations,
    VarianceComponent,
    compute_boundary_probability,
    estimate_single,
)
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.ground.plane import choose_knots
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.naming import format_digits
from uavgram.model.result.reliability import (
    AreaNoise,
    EstimatedSigma,
    Noise,
    PickNoise,
    SurfaceShape,
)
from uavgram.model.survey import Relief, Survey
from uavgram.stages.refine.noise_outliers import NoiseOutliers, find_noise_outliers
from uavgram.stages.refine.readjustment import convert_state, find_used_lines, readjust

STATED_WEIGHT = 20.0
"""Weight of the stated sigma of picks, as a number of residuals."""

STATED_ROUGHNESS_WEIGHT = 1.5
"""Weight of a stated roughness, which is thus known to within a factor of 1.8: mostly it is the
default. A ground that is stated to be a plane has no such prior."""

STATED_IDENTIFICATION_WEIGHT = 5.0
"""Weight of the stated identification sigma (distance between picked and intended point): lengths
and known things determine it poorly."""

STATED_LENGTH_WEIGHT = 5.0
"""Weight of the stated sigma of taped lengths."""

LOW_WEIGHT_FACTOR = 30.0
"""Redundancy of the picks below which their sigmas are never taken as smaller than stated."""

MIN_LENGTHS = 10.0
"""Redundancy of taped lengths below which their sigmas are never taken as smaller than stated."""

MIN_SIGMA_CHANGE = 0.03
"""Relative change of a sigma that does not justify another adjustment."""

PICKS_CODE, TARGETS_CODE, IDENTIFICATION_CODE, LENGTHS_CODE = -1, -2, -3, -4
"""Codes of picks by people, of targets, of the identification and of taped lengths; other
components have the index of an area instead."""

INITIAL_ROUGHNESS_M = 0.05
"""Initial value of roughness and relief in the search [m]."""

MIN_ROUGHNESS_M = 0.002
"""Roughness or relief below which a ground counts as plane [m]."""

MAX_KNOTS = 30
"""Largest number of functions of a correlated relief."""

RANGE_SHARES = (0.2, 0.45)
"""Ranges of a correlated relief, as shares of the extent of the points."""

SHAPE_PENALTY: dict[SurfaceShape, float] = {"plane": 0.5, "quadratic": 2.5, "correlated": 4.0}
"""Least gain in log-likelihood of each shape, with roughness, over smooth, plane ground. Small for
roughness, since that is only tried where picks and ground misfit (`MISFIT`), and an omitted
roughness makes sigmas too small. Larger for functions of the place, of which several are tried."""

MIN_POINTS = 8
"""Number of points of an area below which only their own departures are estimated."""

MAX_PASSES = 3
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
    components: tuple[VarianceComponent, ...]
    areas: tuple[int, ...]


class _FittedModel(NamedTuple):
    """Model with its likeliest factors.

    Attributes
    ----------
    model, factor
        Model, and (C,) its factors.
    log_sigmas
        Function that computes the (C,) standard deviations of their logarithms: as expensive as the
        factors, and needed for one model only.
    merit
        Log-likelihood less the penalty of the model.
    """

    model: _Model
    factor: Floats
    log_sigmas: Callable[[], Floats]
    merit: float

    def average(self, log_sigma: Floats) -> Floats:
        """Return the factors (C,), that of a stated roughness as the mean of its variance.

        Few photos hardly show the roughness: what it may be then counts, and not its likeliest
        size. Of a logarithm with standard deviation s, the root mean square of the factor is
        exp(s^2) times the likeliest one (log-normal distribution).

        Parameters
        ----------
        log_sigma
            (C,) standard deviations of the logarithms.
        """
        rough = [one.weight if one.block == "roughness" else 0.0 for one in self.model.components]
        weight = np.array(rough)
        # No logarithm is less certain than by its prior, with the variance 1 / (2 weight).
        variance = np.minimum(log_sigma**2, 0.5 / np.where(weight > 0, weight, 1.0))
        return np.asarray(self.factor * np.exp(np.where(weight > 0, variance, 0.0)))

    @property
    def log_likelihood(self) -> float:
        """Log-likelihood without the penalty of the model."""
        return self.merit + (0.0 if self.model.shape is None else SHAPE_PENALTY[self.model.shape])


def estimate_noise(survey: Survey, refined: Refined) -> tuple[Survey, Refined]:
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
        return _estimate_noise(survey, refined)
    except SingularError:  # misfit so large that picks with the learnt noise determine nothing
        return survey, refined


def _estimate_noise(survey: Survey, refined: Refined) -> tuple[Survey, Refined]:
    stated = refined.adjustment
    few, fits = find_noise_outliers(stated)
    models = [
        _make_stated_model(stated, compute_redundancy(stated, "pixels")),
        *_other_models(stated, fits=fits),
    ]
    simple = len(models) == 1 and len(models[0].components) == 1 and not few

    def estimated(model: _Model, adjustment: Adjustment, first: Floats | None) -> _FittedModel:
        if simple:
            return _fit_picks_alone(model, adjustment, first)
        return _fit_model(model, adjustment, few, first)

    # Choose the model by its penalised marginal likelihood.
    tried = [estimated(model, stated, None) for model in models]
    fitted = max(tried, key=lambda one: one.merit)
    chance = _chance_of_unevenness(fitted, tried)
    model, log_sigma, factor = fitted.model, fitted.log_sigmas(), fitted.factor
    used = fitted.average(log_sigma)
    if model.shape is None and np.abs(np.log(used)).max() < MIN_SIGMA_CHANGE:
        noise = _describe_noise(model, used, log_sigma, stated, stated.survey, chance)
        return survey, replace(refined, noise=noise)
    adjustment = stated
    # Alternate readjustment and estimation until the factors are stable.
    for _ in range(MAX_PASSES):
        used = fitted.average(log_sigma)
        adjustment = readjust(adjustment, _apply_noise(model, used, stated.survey))
        fitted, before = estimated(model, adjustment, factor), factor
        factor = fitted.factor
        if np.abs(np.log(factor / before)).max() < MIN_SIGMA_CHANGE:
            break
    # Report the sigmas with which the result was adjusted.
    noise = _describe_noise(model, used, log_sigma, adjustment, stated.survey, chance)
    return _apply_noise(model, used, survey), replace(
        refined, adjustment=adjustment, noise=noise, stated=stated, compared=stated
    )


def _make_stated_model(stated: Adjustment, redundancy: float) -> _Model:
    """Return the model that learns only the noise of the picks, and a stated roughness."""
    return _components(None, stated.problem, stated, 1.0 if redundancy < LOW_WEIGHT_FACTOR else 0.0)


def _other_models(stated: Adjustment, *, fits: bool) -> list[_Model]:
    """Return other ground shapes worth trying: none where all fits or the redundancy is small."""
    shown = (name for name in ("pixels", "matches") if name in stated.minimum.blocks)
    if sum(compute_redundancy(stated, name) for name in shown) <= LOW_WEIGHT_FACTOR:
        return []
    uneven = any(ground.roughness_sigma_m > 0 for ground in stated.survey.grounds)
    # Matches may already have shown a roughness (`off_ground.py`).
    if not fits or (uneven and stated.survey.matches.points):
        return _models_of_every_shape(stated)
    # Free points fit on any ground, and so hide misfits; their heights count from the ground.
    return [_make_departure_model(stated)] if stated.survey.is_free.any() else []


def _models_of_every_shape(stated: Adjustment) -> list[_Model]:
    """Return every other shape of the ground: each point's own departure, and smooth ones."""
    survey, point = stated.survey, stated.state.point[:, :2]
    own = [point[survey.area == area] for area in range(len(survey.grounds))]
    models = [_make_departure_model(stated)]
    if any(len(each) >= MIN_POINTS for each in own):
        models.append(_model("quadratic", stated, [_quadratic_relief(each) for each in own]))
        models += [
            _model("correlated", stated, [_make_correlated_relief(one, share) for one in own])
            for share in RANGE_SHARES
        ]
    return models


def _make_departure_model(stated: Adjustment) -> _Model:
    """Return the model with a departure of each point, and without smooth relief."""
    return _model("plane", stated, [None for _ in stated.survey.grounds])


def _quadratic_relief(point_m: Floats) -> Relief | None:
    if len(point_m) < MIN_POINTS:
        return None
    middle = 0.5 * (point_m.min(axis=0) + point_m.max(axis=0))
    scale = 0.5 * float(np.ptp(point_m, axis=0).max())
    return Relief(
        kind="quadratic", sigma_m=INITIAL_ROUGHNESS_M, scale_m=scale, knots_m=middle[None]
    )


def _make_correlated_relief(point_m: Floats, share: float) -> Relief | None:
    if len(point_m) < MIN_POINTS:
        return None
    reach = share * float(np.ptp(point_m, axis=0).max())
    knots = choose_knots(point_m, MAX_KNOTS)
    return Relief(kind="correlated", sigma_m=INITIAL_ROUGHNESS_M, scale_m=reach, knots_m=knots)


def _model(shape: SurfaceShape, stated: Adjustment, relief: Sequence[Relief | None]) -> _Model:
    grounds = tuple(
        replace(
            ground, roughness_sigma_m=ground.roughness_sigma_m or INITIAL_ROUGHNESS_M, relief=own
        )
        for ground, own in zip(stated.survey.grounds, relief, strict=True)
    )
    survey = replace(stated.survey, grounds=grounds)
    problem = SurveyProblem(survey, stated.problem.pivot_m, find_used_lines(stated))
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
            found.append(VarianceComponent("pixels", rows, STATED_WEIGHT, smallest))
            areas.append(TARGETS_CODE if target else PICKS_CODE)
    if len(stated.identified):
        found.append(VarianceComponent("identification", None, STATED_IDENTIFICATION_WEIGHT))
        areas.append(IDENTIFICATION_CODE)
    taped = np.flatnonzero(_is_taped(stated)[problem.line_index])
    if len(taped):
        least = 1.0 if compute_redundancy(adjustment, "lengths") < MIN_LENGTHS else 0.0
        found.append(VarianceComponent("lengths", taped, STATED_LENGTH_WEIGHT, least))
        areas.append(LENGTHS_CODE)
    for area, ground in enumerate(problem.survey.grounds):
        rows = np.flatnonzero(stated.area[problem.third.rough] == area)
        if ground.roughness_sigma_m > 0 and len(rows):
            prior = STATED_ROUGHNESS_WEIGHT * (stated.grounds[area].roughness_sigma_m > 0)
            found.append(VarianceComponent("roughness", rows, prior))
            areas.append(area)
    for area, ground in enumerate(problem.survey.grounds):
        if ground.relief is not None:
            found.append(VarianceComponent("relief", problem.ground.relief_rows(area)))
            areas.append(area)
    return _Model(shape, problem, tuple(found), tuple(areas))


def _is_taped(survey: Survey) -> Bools:
    """Mark lengths (L,) that people taped, not those of plates, whose tape has its own prior."""
    plates = {name for name, _ in survey.own_scale_sigma}
    taped = [tape not in plates for tape in survey.line_tape]
    return np.array(taped or [True] * len(survey.line_start), dtype=np.bool_)


def _fit_model(
    model: _Model, adjustment: Adjustment, few: Mapping[str, NoiseOutliers], first: Floats | None
) -> _FittedModel:
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

    def linearised() -> LinearisedObservations:
        problem, layout = model.problem, model.problem.layout
        blocks = problem.evaluate(convert_state(adjustment, problem))
        assert blocks is not None  # noqa: S101  (the state is that of an adjusted survey)
        for name, one in few.items():
            blocks[name] = _lower_weight(blocks[name], one)
        return LinearisedObservations(blocks, layout.size, layout.structure)

    linear, begin = linearised(), np.ones(len(model.components)) if first is None else first
    found = linear.estimate(model.components, begin)
    # Add the log of the prior sigma of each unknown, so that models with different unknowns
    # can be compared.
    unit = sum(
        float(np.log(linear.blocks[k].jacobian).sum())
        for k in ("roughness", "relief")
        if k in linear.blocks
    )
    price = 0.0 if model.shape is None else SHAPE_PENALTY[model.shape]
    merit = found.log_likelihood + unit - price
    # Linearised again for the sigmas: the matrices of all models would fill the memory.
    return _FittedModel(
        model, found.factor, lambda: linearised().log_sigmas(model.components, found.factor), merit
    )


def _fit_picks_alone(model: _Model, adjustment: Adjustment, first: Floats | None) -> _FittedModel:
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
    found = estimate_single(squares, leverage.size - float(leverage.sum()), model.components[0])
    return _FittedModel(model, np.array([found.factor]), lambda: np.array([found.sigma]), 0.0)


def _lower_weight(block: Block, few: NoiseOutliers) -> Block:
    weight = np.ones(len(block.residual))
    weight[few.rows] = 1.0 / few.errors
    residual = block.residual * weight[:, None]
    return Block(residual, block.columns, block.jacobian * weight[:, None, None])


def _apply_noise(model: _Model, factor: Floats, survey: Survey) -> Survey:
    """Return the survey, which has the stated sigmas, with sigmas and ground by factors (C,)."""
    grounds = list(model.problem.survey.grounds)
    for one, area, scale in zip(model.components, model.areas, factor.tolist(), strict=True):
        if one.block == "roughness":
            size = scale * grounds[area].roughness_sigma_m
            is_stated = survey.grounds[area].roughness_sigma_m > 0
            size = size if size > MIN_ROUGHNESS_M or is_stated else 0.0
            grounds[area] = replace(grounds[area], roughness_sigma_m=size)
        if one.block == "relief" and (relief := grounds[area].relief) is not None:
            size = scale * relief.sigma_m
            own = replace(relief, sigma_m=size) if size > MIN_ROUGHNESS_M else None
            grounds[area] = replace(grounds[area], relief=own)
    sigma = np.array(survey.pick_sigma_px)
    length_m, beside_m = np.array(survey.length_sigma_m), survey.identification_sigma_m
    for area, scale in zip(model.areas, factor.tolist(), strict=True):
        if area in (PICKS_CODE, TARGETS_CODE):
            sigma[survey.pick_is_target == (area == TARGETS_CODE)] *= scale
        if area == LENGTHS_CODE:
            length_m[_is_taped(survey)] *= scale
        if area == IDENTIFICATION_CODE:
            beside_m = scale * beside_m
    return replace(
        survey,
        pick_sigma_px=sigma,
        length_sigma_m=length_m,
        identification_sigma_m=beside_m,
        grounds=tuple(grounds),
    )


def _chance_of_unevenness(fitted: _FittedModel, tried: Sequence[_FittedModel]) -> float:
    """Return the probability of such uneven ground by chance; `tried[0]` is the model as stated."""
    own = len(fitted.model.components) - len(tried[0].model.components)
    if fitted.model.shape is None or own < 1:
        return 1.0
    gain = fitted.log_likelihood - tried[0].log_likelihood
    return min(1.0, (len(tried) - 1) * compute_boundary_probability(gain, own))


def _describe_noise(
    model: _Model,
    factor: Floats,
    log_sigma: Floats,
    adjustment: Adjustment,
    stated: Survey,
    chance: float,
) -> Noise:
    """Describe the learnt noise for the report.

    Parameters
    ----------
    model
        The components.
    factor, log_sigma
        (C,) factors of their sigmas, and standard deviations of the logarithms.
    adjustment
        The adjustment with them.
    stated
        The survey with the stated sigmas.
    chance
        Probability of such uneven ground by chance.
    """
    # Sigmas of the factors are relative.
    sigma = factor * log_sigma
    components = zip(model.components, model.areas, sigma.tolist(), strict=True)
    rough = {area: own for one, area, own in components if one.block == "roughness"}
    units = model.problem.survey.grounds
    picks, others = [], {}
    for k, area in enumerate(model.areas):
        if area in (IDENTIFICATION_CODE, LENGTHS_CODE):
            own = stated.length_sigma_m[_is_taped(stated)]
            own = stated.identification_sigma_m if area == IDENTIFICATION_CODE else own
            size = float(np.sqrt(np.mean(own**2)))
            others[area] = EstimatedSigma(
                stated_m=size, factor=float(factor[k]), sigma=float(sigma[k])
            )
        if area in (PICKS_CODE, TARGETS_CODE):
            own = stated.pick_sigma_px[stated.pick_is_target == (area == TARGETS_CODE)]
            picks.append(
                PickNoise(
                    source="target" if area == TARGETS_CODE else "hand",
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
        for area, ground in enumerate(_apply_noise(model, factor, stated).grounds)
    ]
    return Noise(
        picks=tuple(picks),
        roughness=tuple(areas),
        lengths=others.get(LENGTHS_CODE),
        identification=others.get(IDENTIFICATION_CODE),
    )


CARELESS_FACTOR = 2.5
"""Factor of the stated identification beyond which tape and picks no longer mean the same point."""

UNUSUAL_FACTOR = 3.0
"""Factor of the stated sigma of clicks from which their scatter has another cause than the hand."""

WORSE_FACTOR, BETTER_FACTOR = 1.3, 0.75
"""Factors of the stated sigma of picks beyond which a message is issued."""

GROUND_SIGNIFICANCE = 0.001
"""Significance level for a whole survey: frequency of a plane ground being reported as uneven."""

FACTOR_SIGMAS = 3.0
"""Least difference of the factor from one, in sigmas."""

ADVICE = {
    "hand": "Check whether each label is at the same place in all photos.",
    "target": "Check whether the plates were flat and did not move.",
    "match": "Look at those that are furthest off.",
    "tie": "Something may have moved between the photos.",
}
"""Where to look for the reason of larger errors than stated."""


def report_noise(noise: Noise | None) -> Iterator[Message]:
    """Report uneven ground, and readings that are more or less exact than stated."""
    if noise is None:
        return
    for area in noise.roughness:
        yield from _report_ground(area, several=len(noise.roughness) > 1)
    for picks in noise.picks:
        if abs(picks.factor - 1.0) > FACTOR_SIGMAS * picks.sigma:
            yield from _report_picks(picks, noise.describe_picks(picks))
    lengths = noise.lengths
    if lengths is not None and lengths.factor > max(WORSE_FACTOR, 1.0 + lengths.sigma):
        text = (
            f"The taped lengths fit less well than stated: ± {format_digits(lengths.stated_m)} m "
            f"is stated, ± {format_digits(lengths.stated_m * lengths.factor)} m was found. All "
            "uncertainties are wider for that. State how exactly the tape was read, in the column "
            "`sigma_m` of the lengths."
        )
        yield Message("warning", "lengths-less-exact", text)
    beside = noise.identification
    if beside is not None and beside.factor > max(CARELESS_FACTOR, 1.0 + beside.sigma):
        text = (
            "Picks and lengths fit each other less well than stated: points were picked within "
            f"{_length_text(beside.stated_m)} of the meant points as stated, within "
            f"{_length_text(beside.stated_m * beside.factor)} as found. All uncertainties are "
            "wider for that, but several wrong lengths would look alike. Check whether tape and "
            "picks mean the same place of each mark, and whether each length was read right."
        )
        yield Message("warning", "identification-less-exact", text)


def _report_ground(area: AreaNoise, *, several: bool) -> Iterator[Message]:
    size = area.size_m
    if size <= area.stated_m * WORSE_FACTOR or area.probability > GROUND_SIGNIFICANCE:
        return
    where = f"The ground of area {area.area!r}" if several else "This ground"
    shape = {
        "plane": "each point by itself",
        "quadratic": "as a crown or a hollow does",
        "correlated": "in smooth rises and hollows",
    }[area.shape]
    text = (
        f"{where} is not a plane: its points are about {_length_text(size)} off it, {shape}. "
        "The uncertainties contain that. Where they must be smaller: pick the points in more "
        "photos, or give other ground an area of its own."
    )
    yield Message("warning", "ground-not-plane", text)


def _length_text(size_m: float) -> str:
    return f"{format_digits(100 * size_m)} cm" if size_m < 1.0 else f"{format_digits(size_m)} m"


def _report_picks(picks: PickNoise, what: str) -> Iterator[Message]:
    """Report picks with other errors than stated; not matches that are merely more exact."""
    by_likeness = picks.source in ("match", "tie")
    stated = f"± {format_digits(picks.stated_px)} px stated"
    found = f"± {format_digits(picks.stated_px * picks.factor)} px found"
    if picks.factor > WORSE_FACTOR:
        text = (
            f"The {what} are less exact than stated: {stated}, {found}. {ADVICE[picks.source]} All "
            "uncertainties are wider for that."
        )
        if by_likeness:
            yield Message("info", "found-less-exact", text)
        elif picks.factor > UNUSUAL_FACTOR:
            yield Message(
                "warning",
                "picks-misfit",
                f"{text} So much is unusual: look whether labels are on different things, and "
                "whether something was moved between the photos, such as a car.",
            )
        else:
            yield Message("warning", "picks-less-exact", text)
    if picks.factor < BETTER_FACTOR and not by_likeness:
        text = (
            f"The {what} are more exact than stated: {stated}, {found}. "
            "All uncertainties are smaller for that."
        )
        yield Message("info", "picks-more-exact", text)
