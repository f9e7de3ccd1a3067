"""Adjust robustly from first values: weights by misfit, while sigmas shrink to those stated.

Graduated non-convexity (Blake and Zisserman 1987, "Visual reconstruction"; Yang, Antonante, Tzoumas
and Carlone 2020, "Graduated non-convexity for robust spatial perception"):

1. All readings begin with sigmas a hundred times as large, so that no misfit is large.
2. The sigmas shrink to those stated (`SCHEDULE`). In each step every observation gets the weight of
   a Cauchy distribution by its own misfit (`anneal`).
3. In the end each observation takes part with full weight or not at all (`decide`).

The misfit of an observation is its difference from the prediction by all *other* observations
(Baarda's w, generalised to observations of any weight; `compute_squared_misfits`). Hence a reading
that distorts its neighbours is found, and not the neighbours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.reliability.redundancy import (
    GROSS_SIGMAS,
    MAX_GROSS_SHARE,
    compute_cofactors,
    limit_gross_errors,
)
from uavgram.estimation.solver.levenberg_marquardt import Minimum, minimise
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.lengths import find_tape_rows, select_taped_lines
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey
from uavgram.stages.refine.off_ground import count_photos
from uavgram.stages.refine.staged_sigmas import DAMPING

SIZES = ("lengths", "known")
"""Groups of sizes on the ground, which photos and log predict."""

ROBUST = (*READINGS, "roughness", "matches", "ties", "telemetry", "heights", "tape")
"""Groups whose observations get weights. The scale of a tape represents all of its lengths, and the
roughness of a point its being on the ground."""

SCHEDULE = (100.0, 30.0, 10.0, 3.0, 1.0, 1.0, 1.0)
"""Factors of the sigmas of the successive adjustments."""

CAUCHY_SIGMAS = 3.0
"""Standardised misfit at which an observation has half its weight."""

LEAST_REDUNDANCY = 0.01
"""Redundancy number below which an observation is unchecked, and its misfit without meaning."""

MIN_CHECKED_COUNT = 8
"""Least number of checked observations of a kind whose median shows their noise."""

MAX_NOISE_FACTOR = 5.0
"""Largest factor by which sigmas of lengths, known things, control and the ground may be too small.
A larger one means that none of them is right, as where all are in another unit."""

MOST_OF_A_FRAME = 0.5
"""Share of a frame's picks that are gross errors, above which the frame shows another place."""

LOWEST_M, HIGHEST_M, TWO_RAYS = -0.5, 4.5, 2
"""Range of heights [m] of a point that only two rays show off the ground, whether they meet or not:
from a ditch to the roof of a lorry."""

EAVES_M, MEET = 8.0, 4.0
"""Largest height [m] where the two rays meet, as on a house; and the sum of their squared
residuals, with one degree of freedom, below which they do."""

MOST_ROUNDS = 6
"""Largest number of rounds in which observations leave and return."""

SURE_ROUNDS, HOPELESS_COST = 3, 64.0
"""Least number of rounds, and excess of the costs of the last two over a limit, from which the
result is taken to remain above it: later rounds seldom reduce the cost by half."""

ZERO_WEIGHT = 1e-8
"""Weight of an observation that takes no part."""

ITERATIONS_EACH, MOST_ITERATIONS, MIN_REDUCTION = 15, 60, 1e-4
"""Iterations of each adjustment, and the predicted decrease of the cost below which they end."""

MIN_GROUND_WEIGHT = 0.5
"""Least weight at which a point counts as one of the ground."""

FULL_WEIGHT = np.ones(1)
"""Weight of every observation of a group without weights of its own."""


MIN_TURN_RAD = np.radians(45.0)
"""Angle between a photo's pose and the log [rad] above which it may have been rotated when it was
picked."""


@dataclass(frozen=True, eq=False)
class Annealed:
    """Robust adjustment.

    Attributes
    ----------
    problem, minimum
        The likelihood with the stated sigmas, and the end of the weighted iterations.
    frames
        Names of frames most of whose picks are gross errors, or that the log contradicts.
    weight
        Weight of each observation, by group: 1 or nearly none.
    misfit
        Standardised misfit of each observation, by group, in units of the noise of its kind; above
        `GROSS_SIGMAS` where it takes no part.
    cost
        Sum of squares, in which no observation counts more than a gross error, and each one that
        takes no part counts as one.
    """

    problem: SurveyProblem
    minimum: Minimum[State]
    frames: tuple[str, ...]
    weight: Mapping[str, Floats]
    misfit: Mapping[str, Floats]
    cost: float

    def gross(self, name: str) -> Ints:
        """Return the rows of the gross errors of a group."""
        return np.flatnonzero(self.misfit.get(name, np.zeros(0)) > GROSS_SIGMAS)


def anneal(
    problem: SurveyProblem, state: State, *, on_ground: bool = True, limit: float = np.inf
) -> Annealed:
    """Adjust robustly from first values.

    Parameters
    ----------
    problem, state
        The likelihood with the stated sigmas, and first values.
    on_ground
        Whether the roughness of the ground shrinks with the readings' sigmas, as is right where
        most points are on the ground.
    limit
        Cost above which the result is of no use (see `decide`).

    Raises
    ------
    SingularError
        An unknown is not determined.
    """
    groups = (*READINGS, "roughness") if on_ground else READINGS
    minimum = minimise_weighted_cost(problem, state, {}, dict.fromkeys(groups, SCHEDULE[0]))
    weight: dict[str, Floats] = {}
    for softness in SCHEDULE[1:]:
        squares = compute_squared_misfits(problem, minimum, weight)
        noise = _estimate_noise(squares, weight) if softness == 1.0 else dict.fromkeys(squares, 1.0)
        weight = {
            name: 1.0 / (1.0 + square / (CAUCHY_SIGMAS * noise[name]) ** 2)
            for name, square in squares.items()
        }
        soft = dict.fromkeys(groups, softness)
        minimum = minimise_weighted_cost(problem, minimum.state, weight, soft)
    return decide(problem, minimum, weight, limit)


def decide(
    problem: SurveyProblem,
    minimum: Minimum[State],
    weight: Mapping[str, Floats],
    limit: float = np.inf,
) -> Annealed:
    """Decide for each observation whether it takes part with full weight or not at all.

    An observation that takes no part is predicted by the rest, and returns where it agrees with the
    prediction. So do neighbours of a gross error, which shared its misfit while all had weights. An
    observation that has to leave a second time stays out. So do those that fit one by one, as all
    do where little else determines a pose, but together contradict the rest.

    Parameters
    ----------
    problem
        The likelihood.
    minimum, weight
        The adjustment so far, and its weights.
    limit
        Cost above which the result is of no use.

    Raises
    ------
    ValueError
        The cost remains far above the limit (`HOPELESS_COST`).
    """
    out: dict[str, Bools] = {}
    costs: list[float] = []
    has_returned: dict[str, Bools] = {}
    frames: tuple[str, ...] = ()
    misfit: dict[str, Floats] = {}
    noise: dict[str, float] = {}
    on_ground = np.zeros(len(problem.third.rough), dtype=np.bool_)
    for k in range(MOST_ROUNDS):
        misfit, noise = _compute_misfits(problem, minimum, weight)
        gross = {name: value > GROSS_SIGMAS for name, value in misfit.items()}
        if k == 0:
            frames = _find_frames_of_other_places(problem, gross["pixels"])
        elif "tape" in gross:  # no single length explains a wrong scale
            gross["lengths"] |= gross["tape"][_tapes(problem)]
        # Points with gross roughness leave the ground, unless the resulting height is implausible.
        if "roughness" in gross:
            unlikely = _find_unlikely_heights(problem, minimum, out) & ~on_ground
            on_ground |= unlikely
            gross["pixels"] |= np.isin(problem.survey.pick_label, problem.third.rough[unlikely])
            gross["roughness"] &= ~on_ground
            _try_heights(problem, gross, "roughness", out, ~on_ground)
        if "heights" in gross:
            _try_heights(problem, gross, "heights", out)
        back = _keep_out(gross, out, has_returned)
        if out and all(np.array_equal(is_out, out[name]) for name, is_out in gross.items()):
            break
        goal = minimum.cost + _bound_increase(back, noise) if out else np.inf
        weight = _weigh(gross)
        found = minimise_weighted_cost(problem, minimum.state, weight, goal=goal)
        if any(map(np.any, back.values())) and found.cost > goal:
            gross = {name: is_out | back[name] for name, is_out in gross.items()}
            weight = _weigh(gross)
            found = minimise_weighted_cost(problem, minimum.state, weight)
        out, minimum = gross, found
        costs.append(minimum.cost + _compute_price(problem.survey, out))
        if len(costs) >= SURE_ROUNDS and min(costs[-2:]) > limit + HOPELESS_COST:
            raise ValueError("another explanation costs less")
    out, minimum, misfit = _restore_observations(problem, minimum, out, misfit, noise)
    weight = _weigh(out)
    if not minimum.converged:
        minimum = minimise_weighted_cost(problem, minimum.state, weight, most=MOST_ITERATIONS)
    frames = frames or _find_frames_of_other_places(problem, out["pixels"])
    frames = frames or _find_turned_frames(problem, minimum, out)
    # Make the misfits consistent with the decisions.
    beyond = np.nextafter(GROSS_SIGMAS, np.inf)
    misfit = {
        name: np.where(out[name], np.maximum(value, beyond), np.minimum(value, GROSS_SIGMAS))
        for name, value in misfit.items()
    }
    return Annealed(
        problem, minimum, frames, weight, misfit, compute_bounded_cost(problem, minimum, out)
    )


def _keep_out(
    gross: Mapping[str, Bools], out: Mapping[str, Bools], has_returned: dict[str, Bools]
) -> dict[str, Bools]:
    """Keep observations out that leave a second time; return those that take part again.

    Parameters
    ----------
    gross, out
        Observations that are gross errors, and that were out before; the first is changed.
    has_returned
        Observations that returned before; those of this round are added.
    """
    back: dict[str, Bools] = {}
    for name, is_out in gross.items():
        before = out.get(name, np.zeros_like(is_out))
        returned = has_returned.get(name, np.zeros_like(is_out))
        is_out[returned & before] = True
        back[name] = before & ~is_out
        has_returned[name] = returned | back[name]
    return back


def compute_gross_cost(name: str) -> float:
    """Compute the cost of a gross error of a group: a wrong pose of the log counts as two."""
    return GROSS_SIGMAS**2 * (2.0 if name == "telemetry" else 1.0)


def _compute_price(survey: Survey, out: Mapping[str, Bools]) -> float:
    """Compute the cost of the gross errors alone: all clicks of a point in a photo are one."""
    clicks = count_photos_of_picks(survey, out["pixels"])
    counts = ((name, clicks if name == "pixels" else is_out) for name, is_out in out.items())
    return sum(compute_gross_cost(name) * float(count.sum()) for name, count in counts)


def _weigh(out: Mapping[str, Bools]) -> dict[str, Floats]:
    """Return weights by group: 1, and nearly none for observations that take no part."""
    return {name: np.where(is_out, ZERO_WEIGHT, 1.0) for name, is_out in out.items()}


def _bound_increase(back: Mapping[str, Bools], noise: Mapping[str, float]) -> float:
    """Bound the increase of the cost by observations that return, none of them a gross error."""
    return sum((GROSS_SIGMAS * noise[name]) ** 2 * int(own.sum()) for name, own in back.items())


def compute_bounded_cost(
    problem: SurveyProblem, minimum: Minimum[State], out: Mapping[str, Bools]
) -> float:
    """Sum the squares of an adjustment, in which no observation counts more than a gross error.

    Parameters
    ----------
    problem, minimum
        The likelihood, and the adjustment without the gross errors.
    out
        Mask of the observations that take no part, by group. Each counts as a gross error;
        otherwise it would cost nothing to leave out observations that agree.
    """
    blocks = problem.evaluate(minimum.state) or {}
    return sum(_compute_group_cost(name, block, out.get(name)) for name, block in blocks.items())


def _restore_observations(
    problem: SurveyProblem,
    minimum: Minimum[State],
    out: dict[str, Bools],
    misfit: dict[str, Floats],
    noise: Mapping[str, float],
) -> tuple[dict[str, Bools], Minimum[State], dict[str, Floats]]:
    """Restore observations that left a second time, but agree with all that take part.

    If two contradict each other, both may have left: then the one that agrees better returns.
    Lengths of a wrong tape stay out: one by one they agree with each other.

    Parameters
    ----------
    problem, minimum
        The likelihood, and the adjustment without the gross errors.
    out, misfit
        Mask of the observations that take no part, and the standardised misfits, by group.
    noise
        Factors of the sigmas of each kind.
    """
    may_return = {name: is_out & (misfit[name] <= GROSS_SIGMAS) for name, is_out in out.items()}
    if "tape" in out:
        may_return["lengths"] &= ~out["tape"][_tapes(problem)]
    agreeing = [
        (float(misfit[name][row]), name, row)
        for name, rows in may_return.items()
        for row in np.flatnonzero(rows).tolist()
    ]
    # Try all of them, then without the one of largest misfit, and so on, until no misfit is gross.
    for number in range(len(agreeing), max(0, len(agreeing) - MOST_ROUNDS), -1):
        fewer = {name: is_out.copy() for name, is_out in out.items()}
        for _, name, row in sorted(agreeing)[:number]:
            fewer[name][row] = False
        back = {name: is_out & ~fewer[name] for name, is_out in out.items()}
        goal = minimum.cost + _bound_increase(back, noise)
        weight = _weigh(fewer)
        found = minimise_weighted_cost(problem, minimum.state, weight, goal=goal)
        if found.cost > goal:
            continue
        size, _ = _compute_misfits(problem, found, weight)
        if not any((size[name][~is_out] > GROSS_SIGMAS).any() for name, is_out in fewer.items()):
            return fewer, found, size
    return out, minimum, misfit


def minimise_weighted_cost(
    problem: SurveyProblem,
    state: State,
    weight: Mapping[str, Floats],
    softness: Mapping[str, float] | None = None,
    goal: float = np.inf,
    most: int = ITERATIONS_EACH,
) -> Minimum[State]:
    """Minimise the weighted cost.

    Parameters
    ----------
    problem, state
        The likelihood, and first values.
    weight
        (n,) weights of the observations, by group; 1 where a group has none.
    softness
        Factors of the sigmas, by group; 1 where a group has none.
    goal
        Cost above which the result is of no use.
    most
        Largest number of iterations.
    """

    def evaluate(now: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(now)
        if blocks is None:
            return None
        return {
            name: _scale_rows(block, np.sqrt(weight.get(name, FULL_WEIGHT)) / soft.get(name, 1.0))
            for name, block in blocks.items()
        }

    layout, soft = problem.layout, softness or {}
    return minimise(
        state,
        evaluate,
        lambda now, step: advance_state(layout, now, step),
        layout.size,
        layout.structure,
        most,
        at_rest=MIN_REDUCTION,
        slack=DAMPING,
        goal=goal,
        bends=problem.survey.calibration.is_poorly_known,
    )


def compute_squared_misfits(
    problem: SurveyProblem, minimum: Minimum[State], weight: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Compute squared standardised misfits (n,) of all observations, by group.

    Parameters
    ----------
    problem, minimum
        The likelihood, and a weighted adjustment.
    weight
        Its weights, by group; 1 where a group has none.

    Notes
    -----
    For an observation of weight w, let r be its whitened residual and A its covariance that follows
    from that of the unknowns (both at full weight), and Q = I - w A its cofactor matrix. The
    prediction from all others then errs by Q^-1 r, with the covariance I + Q^-1 A, and the square
    is

        r^T [(Q + A) Q]^-1 r,

    with w = 1 Baarda's statistic (1968), with w = 0 the test of a new observation. Unchecked axes
    count 0.
    """
    covariance = minimum.factor.covariance()
    found = {}
    for name in ROBUST:
        block = minimum.blocks.get(name)
        if block is None or not len(block.residual):
            continue
        own = weight.get(name, np.ones(len(block.residual)))
        # Eigenvalues of Q are the redundancy numbers of the observation's axes.
        redundancy, axes = np.linalg.eigh(compute_cofactors(block, covariance))
        residual = np.einsum("nra,nr->na", axes, block.residual) / np.sqrt(own)[:, None]
        is_checked = redundancy > LEAST_REDUNDANCY
        redundancy = np.where(is_checked, redundancy, 1.0)
        # A = (I - Q) / w
        predicted = np.maximum(1.0 - redundancy, 0.0) / own[:, None]
        square = residual**2 / ((redundancy + predicted) * redundancy)
        found[name] = np.sum(np.where(is_checked, square, 0.0), axis=1)
    of = {"roughness": problem.third.rough, "heights": problem.third.stated}
    for name in found.keys() & of.keys():  # one photo alone shows no height
        found[name][count_photos(problem.survey)[of[name]] < 2] = 0.0
    return found


def _compute_misfits(
    problem: SurveyProblem, minimum: Minimum[State], weight: Mapping[str, Floats]
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Compute standardised misfits (n,) of all observations, in units of their kind's noise.

    Returns
    -------
    The misfits, and the noise as a factor of the stated sigmas, by group.
    """
    squares = compute_squared_misfits(problem, minimum, weight)
    noise = _estimate_noise(squares, weight)
    return {name: np.sqrt(square) / noise[name] for name, square in squares.items()}, noise


def _estimate_noise(
    squares: Mapping[str, Floats], weight: Mapping[str, Floats]
) -> dict[str, float]:
    """Estimate the factor by which the sigmas of each kind are too small, at least one.

    The factor follows from the median of the squares over that of chi-square, and is large enough
    that no more than a share of the kind are gross errors. Where no size takes part, the misfits
    are those of predictions by other kinds, and the factor is one. Most points may be off the
    ground; therefore only points on it count for the roughness.
    """
    factor = {}
    for name, square in squares.items():
        is_ground = name == "roughness"
        counts = square > 0
        if is_ground and name in weight:
            counts &= weight[name] > MIN_GROUND_WEIGHT
        elif name in SIZES and name in weight and (weight[name] <= ZERO_WEIGHT).all():
            counts[:] = False
        checked = np.sort(square[counts])[::-1]
        large = 1.0
        # Robust variance factor: median of the squares over that of chi-square.
        if len(checked) >= MIN_CHECKED_COUNT:
            usual = float(chdtri(_axes(name), 0.5))
            large = max(large, float(np.sqrt(np.median(checked) / usual)))
        # Large enough that no more than the allowed share is gross.
        most = limit_gross_errors(len(checked))
        if len(checked) > most and not is_ground:
            large = max(large, float(np.sqrt(checked[most])) / GROSS_SIGMAS)
        is_stated = name in ("lengths", "known", "control", "roughness", "telemetry")
        factor[name] = min(large, MAX_NOISE_FACTOR) if is_stated else large
    return factor


def _axes(name: str) -> int:
    """Return the number of components of an observation of a kind."""
    return {"pixels": 2, "matches": 2, "ties": 2, "control": 3, "telemetry": 6}.get(name, 1)


def _find_unlikely_heights(
    problem: SurveyProblem, minimum: Minimum[State], out: Mapping[str, Bools]
) -> Bools:
    """Find points of rough ground that only two picks put far below it, or high above it.

    A wrong pick meets another ray at some height when it errs along the other's line of sight.
    """
    survey, rough = problem.survey, problem.third.rough
    if "roughness" not in out:
        return np.zeros(len(rough), dtype=np.bool_)
    rays = np.bincount(survey.pick_label[~out["pixels"]], minlength=len(survey.label))
    up_m = minimum.state.point[rough, 2]
    square = np.sum(minimum.blocks["pixels"].residual ** 2, axis=1)
    apart = np.bincount(survey.pick_label, square, len(survey.label))
    # Two rays that meet may be of a high point, such as on a house.
    meet = (apart[rough] < MEET) & (rays[rough] == TWO_RAYS)
    is_far = (up_m < LOWEST_M) | (up_m > np.where(meet, EAVES_M, HIGHEST_M))
    return np.asarray(out["roughness"] & is_far & (rays[rough] <= TWO_RAYS))


def _try_heights(
    problem: SurveyProblem,
    gross: dict[str, Bools],
    name: str,
    out: Mapping[str, Bools],
    possible: Bools | None = None,
) -> None:
    """Give up heights of points that are gross errors there in most of their photos.

    Parameters
    ----------
    problem
        The likelihood.
    gross
        Mask of the observations that will take no part, by group; changed in place.
    name
        Group of heights: the roughness of points on the ground, or stated heights.
    out
        Mask of those that take no part already: where a height does not, the picks of the point do
        not agree on another one either.
    possible
        Heights that may be given up; None for all.
    """
    survey, third = problem.survey, problem.third
    point = third.rough if name == "roughness" else third.stated
    photos, wrong = (count_photos_of_picks(survey, rows) for rows in (slice(None), gross["pixels"]))
    is_new = (2 * wrong > photos)[point] & (count_photos(survey) > 1)[point]
    if name in out:
        is_new &= ~out[name]
    if possible is not None:
        is_new &= possible
    gross[name][is_new] = True
    gross["pixels"] &= ~np.isin(survey.pick_label, point[is_new])


def count_photos_of_picks(survey: Survey, rows: slice | Bools) -> Ints:
    """Count the photos (K,) in which each label has one of some picks, however many there are."""
    count = len(survey.label)
    place = survey.pick_frame[rows] * count + survey.pick_label[rows]
    return np.bincount(np.unique(place) % count, minlength=count)


def _find_frames_of_other_places(problem: SurveyProblem, gross: Bools) -> tuple[str, ...]:
    """Find frames most of whose picks are gross errors (P,)."""
    survey = problem.survey
    frames = len(survey.frame_id)
    number = np.bincount(survey.pick_frame, minlength=frames)
    wrong = np.bincount(survey.pick_frame[gross], minlength=frames)
    return _names_of_few(problem, (wrong > MOST_OF_A_FRAME * number) & (wrong > 2))


def _find_turned_frames(
    problem: SurveyProblem, minimum: Minimum[State], gross: Mapping[str, Bools]
) -> tuple[str, ...]:
    """Find frames whose attitude contradicts the log.

    A photo that was rotated when it was picked fits all of its picks, but not the log. Where only
    poses of the log are gross errors, photos that are turned by less than 45 degrees were not:
    their recorded directions are wrong.
    """
    telemetry, seeds = problem.survey.telemetry, problem.survey.seeds
    if telemetry is None or seeds is None or not gross["telemetry"].any():
        return ()
    blocks = problem.evaluate(minimum.state)
    assert blocks is not None  # noqa: S101  (the iterations ended there)
    attitude = np.linalg.norm(blocks["telemetry"].residual[:, 3:], axis=1)
    is_turned = np.zeros(len(problem.survey.frame_id), dtype=np.bool_)
    turned = gross["telemetry"] & (attitude > GROSS_SIGMAS)
    is_turned[telemetry.frame_index[turned]] = True
    if sum(int(rows.sum()) for rows in gross.values()) == gross["telemetry"].sum():
        # Rotation angle against the log: cos(angle) = (trace - 1) / 2.
        trace = np.einsum("fij,fij->f", seeds.world_from_camera, minimum.state.rotation)
        is_turned &= (trace - 1.0) / 2.0 < np.cos(MIN_TURN_RAD)
    return _names_of_few(problem, is_turned)


def _names_of_few(problem: SurveyProblem, is_bad: Bools) -> tuple[str, ...]:
    """Return the names of bad frames; none where they are too many to be the exception."""
    if is_bad.sum() > MAX_GROSS_SHARE * len(is_bad):
        return ()
    return tuple(problem.survey.frame_id[k] for k in np.flatnonzero(is_bad))


def _tapes(problem: SurveyProblem) -> Ints:
    """Return the row (n,) of the tape of each length that takes part."""
    return find_tape_rows(
        problem.tapes, select_taped_lines(problem.survey, problem.line_index).tape
    )


def _compute_group_cost(name: str, block: Block, out: Bools | None) -> float:
    """Sum the squares of a group, each robust observation bounded by a gross error."""
    square = np.sum(block.residual**2, axis=1)
    if name not in ROBUST:
        return float(square.sum())
    most = compute_gross_cost(name)
    counted = np.minimum(square, most)
    return float((counted if out is None else np.where(out, most, counted)).sum())


def _scale_rows(block: Block, by: Floats) -> Block:
    """Multiply rows by factors, (n,) or (1,) for all."""
    if (by == 1.0).all():
        return block
    each = np.broadcast_to(by, len(block.residual))
    return Block(
        block.residual * each[:, None], block.columns, block.jacobian * each[:, None, None]
    )
