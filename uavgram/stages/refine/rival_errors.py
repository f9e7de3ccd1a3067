"""Find other readings whose errors would explain a misfit as well, in the linear model.

Two explanations of a misfit differ by the decrease of the sum of squares without the one reading or
the other (Baarda 1968; Teunissen 2006, "Testing theory").
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uavgram.estimation.reliability.redundancy import (
    GROSS_SIGMAS,
    compute_cofactors,
    reduce_squares,
)
from uavgram.estimation.reliability.stated_values import explain_length
from uavgram.estimation.solver.normal_equations import DenseStack
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.model.arrays import Floats, Ints
from uavgram.stages.refine.robust_adjustment import (
    LEAST_REDUNDANCY,
    Annealed,
    compute_gross_cost,
)

MAX_RIVAL_INCREASE = 2.0 * float(np.log(20.0))
"""Difference of costs up to which another explanation has odds of more than 1 in 20."""

HEIGHTS = ("heights", "roughness")
"""Groups of a point's height, stated or on the ground, which may be wrong like a reading."""

PIXEL_SQUARES = 2.0
"""Expected sum of squares of the two coordinates of a click with an error of the stated size."""

MAX_CHANCE_MATCH = 0.02
"""Largest relative sigma of a length that shows a known mistake. With a larger one, the ten ratios
of `explain_ratio` and their 3 sigma would cover more than a tenth of all ratios up to 1,000."""

USUAL_LOG_RATIO = 0.5
"""Usual size of a gross error of a length, as the logarithm of the ratio of both lengths: one
misread digit may change it by half."""

LEAST_SHARE = 1e-3
"""Least share of a taped length that the others show, as the ratio has no logarithm at zero."""


def has_rival(found: Annealed, row: int) -> bool:
    """Return whether another length explains the misfit of a removed one, in the linear model."""
    whole, falls = falls_with_all(found, {"lengths": np.array([row])})
    others = found.misfit["lengths"] <= GROSS_SIGMAS
    return bool((falls["lengths"][others] > whole - MAX_RIVAL_INCREASE).any())


def falls_with_all(
    found: Annealed, restored: Mapping[str, Ints]
) -> tuple[float, dict[str, Floats]]:
    """Compute the decrease of the sum of squares without each single reading.

    Parameters
    ----------
    found
        A robust adjustment.
    restored
        Rows of its gross errors that take part again, by group.

    Returns
    -------
    whole, falls
        Decrease without all restored observations; and (n,) without each single reading of each
        group while all others take part, the restored ones included, in the linear model.

    Notes
    -----
    Let J be the Jacobian of the restored observations, e the errors of their predictions without
    them, S the covariance of the unknowns without them, and V = I + J S J^T the covariance of e.
    Restoring them increases the sum of squares by e^T V^-1 e and moves the unknowns by
    -S J^T V^-1 e. With X = J' S J^T, the residuals r and cofactors Q of another observation become
    r - X V^-1 e and Q + X V^-1 X^T, and the sum of squares decreases by r^T Q^-1 r without it. Axes
    that no other observation checks count 0. For a restored observation i itself the decrease is
    v_i^T ((V^-1)_ii)^-1 v_i, with v = V^-1 e.
    """
    minimum = found.minimum
    gradient, error, place = _predict(found, restored)
    # S J^T, V^-1 and v = V^-1 e.
    pull = minimum.factor.solve(gradient)
    inverse = np.asarray(np.linalg.inv(np.eye(len(error)) + gradient.T @ pull), np.float64)
    force = inverse @ error
    covariance = minimum.factor.covariance()
    falls: dict[str, Floats] = {}
    for name in (one for one in (*READINGS, *HEIGHTS) if one in minimum.blocks):
        other = minimum.blocks[name]
        # Residuals r - X v and cofactors Q + X V^-1 X^T of all others.
        moved = other.times(slice(None), pull)
        residual = other.residual - moved @ force
        share = compute_cofactors(other, covariance) + moved @ inverse @ moved.swapaxes(1, 2)
        falls[name] = reduce_squares(residual, share, LEAST_REDUNDANCY)
        if name in restored:
            own = place[name]
            block = inverse[own[:, :, None], own[:, None, :]]
            falls[name][restored[name]] = reduce_squares(force[own], block, LEAST_REDUNDANCY)
    return float(error @ force), falls


def _predict(found: Annealed, rows: Mapping[str, Ints]) -> tuple[Floats, Floats, dict[str, Ints]]:
    """Predict observations that take no part, at full weight.

    Parameters
    ----------
    found, rows
        A robust adjustment; rows of observations, by group.

    Returns
    -------
    gradient, error, place
        (u, k), (k,) of all k numbers in sigmas, and (n, r) which of them are of each observation,
        by group.
    """
    if not rows:
        return np.zeros((found.problem.layout.size, 0)), np.zeros(0), {}
    blocks = {name: found.minimum.blocks[name] for name in rows}
    scale = {name: 1.0 / np.sqrt(found.weight[name][own]) for name, own in rows.items()}
    jacobians = [
        blocks[name].jacobian[own] * scale[name][:, None, None] for name, own in rows.items()
    ]
    errors = [blocks[name].residual[own] * scale[name][:, None] for name, own in rows.items()]
    columns = [blocks[name].columns[own] for name, own in rows.items()]
    dense = DenseStack(columns, jacobians, found.problem.layout.size).jacobian(jacobians)
    ends = np.cumsum([one.size for one in errors])
    place = {
        name: end - one.size + np.arange(one.size).reshape(one.shape)
        for name, one, end in zip(rows, errors, ends.tolist(), strict=True)
    }
    return dense.T, np.concatenate([one.ravel() for one in errors]), place


def is_known_mistake(found: Annealed, row: int) -> bool:
    """Return whether a removed length has another unit, or a misplaced decimal point."""
    taped_m, seen_m, seen_sigma_m = _compare_length(found, row)
    if seen_sigma_m > MAX_CHANCE_MATCH * abs(seen_m):
        return False  # so many lengths would match one of the mistakes by chance
    sigma_m = float(found.problem.survey.length_sigma_m[found.problem.line_index[row]])
    return bool(explain_length(taped_m, sigma_m, seen_m, seen_sigma_m))


def compute_size_cost(found: Annealed) -> float:
    """Compute the cost of the sizes of errors of removed lengths; known mistakes have none.

    Errors of half the length are usual, such of many times the length are not: the logarithm of the
    ratio of both lengths has a Cauchy distribution, of scale `USUAL_LOG_RATIO`.
    """
    cost = 0.0
    for row in found.gross("lengths").tolist():
        taped_m, seen_m, _ = _compare_length(found, row)
        if not is_known_mistake(found, row):
            log_ratio = np.log(taped_m / max(seen_m, LEAST_SHARE * taped_m))
            cost += 2.0 * float(np.log1p((log_ratio / USUAL_LOG_RATIO) ** 2))
    return cost


def compute_repeated_cost(found: Annealed) -> float:
    """Compute the cost that gross clicks of one point in one photo do not have together.

    Who clicks on the wrong thing does so again: they are one mistake, and the others errors of
    the stated size.
    """
    survey = found.problem.survey
    rows = found.gross("pixels")
    place = survey.pick_frame[rows] * len(survey.label) + survey.pick_label[rows]
    repeated = len(rows) - len(np.unique(place))
    return repeated * (compute_gross_cost("pixels") - PIXEL_SQUARES)


def _compare_length(found: Annealed, row: int) -> tuple[float, float, float]:
    """Return a removed length as taped, as all others show it, and the sigma of that [m]."""
    survey, line = found.problem.survey, found.problem.line_index[row]
    taped_m, sigma_m = float(survey.length_m[line]), float(survey.length_sigma_m[line])
    root = np.sqrt(found.weight["lengths"][row])
    error_m = float(found.minimum.blocks["lengths"].residual[row, 0] / root) * sigma_m
    return taped_m, taped_m + error_m, abs(error_m) / float(found.misfit["lengths"][row])
