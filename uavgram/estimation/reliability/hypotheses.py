"""Tests of hypotheses that errors missing from the model explain the misfits.

Each hypothesis adds unknowns that move the predicted observations along known directions. In the
linear model the reduction of the weighted sum of squares, the values of these unknowns and their
covariance follow from the residuals (Teunissen 2006, "Testing theory", ch. 3 to 5; Baarda's w-test
is the case of one observation and one unknown).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc, gammaln

from uavgram.estimation.reliability.redundancy import limit_gross_errors
from uavgram.estimation.solver.levenberg_marquardt import MAX_UNDAMPED_REDUCTION, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError, compute_gradient
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.observations.observation import Member
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Bools, Floats, Ints

MIN_RESIDUAL_SHARE = 0.01
"""Smallest share of a direction that has to show in the residuals for its unknown to be tested."""

MIN_PROBABILITY = 1e-290
"""Probability below which its logarithm is computed from the leading term of the tail."""


@dataclass(frozen=True, eq=False)
class ObservationChange:
    """Effect of additional unknowns on the predictions of a group of observations.

    Attributes
    ----------
    kind
        Name of the group.
    rows
        (m,) its observations that are moved.
    along
        (m, r, q) derivatives of their whitened predictions by the q unknowns.
    """

    kind: str
    rows: Ints
    along: Floats


class HypothesisTest(NamedTuple):
    """Test result of a hypothesis.

    Attributes
    ----------
    gain
        Reduction of the weighted sum of squares.
    unknowns
        Number of its unknowns that are checked.
    value
        (q,) estimates of the unknowns; 0 along combinations that are not checked.
    covariance
        (q, q) covariance of the estimates; infinite for unknowns that are not checked.
    """

    gain: float
    unknowns: int
    value: Floats
    covariance: Floats


def compare_hypotheses(
    adjustment: Adjustment,
    hypotheses: Sequence[Sequence[ObservationChange]],
    checked: float = MIN_RESIDUAL_SHARE,
) -> tuple[HypothesisTest, ...]:
    """Test how much of the misfits of an adjustment each hypothesis explains.

    Parameters
    ----------
    adjustment
        The adjustment, at its minimum or near it.
    hypotheses
        Each hypothesis by the groups that it moves, all with the same number of unknowns.
    checked
        Smallest share of a direction that has to show in the residuals for its unknown to be
        tested.

    Notes
    -----
    With residuals v (predicted minus observed), directions C and normal matrix N = A^T A, the
    unknowns are x = -R^-1 C^T (v - A N^-1 A^T v) with R = C^T (I - A N^-1 A^T) C; at the minimum
    A^T v is zero. The sum of squares falls by x^T R x.
    """
    if not hypotheses:
        return ()
    blocks, size = adjustment.minimum.blocks, adjustment.problem.layout.size
    counts = [moved[0].along.shape[2] for moved in hypotheses]
    first = np.concatenate([[0], np.cumsum(counts)])
    right = np.zeros((size, int(first[-1])))
    # Of each hypothesis: A^T C as columns of the right-hand sides, C^T v and C^T C.
    scores, plain = [], []
    for moved, start, count in zip(hypotheses, first, counts, strict=False):
        score, own = np.zeros(count), np.zeros((count, count))
        for part in moved:
            block = blocks[part.kind]
            by_unknown = np.einsum("mrq,mrk->mkq", part.along, block.jacobian[part.rows])
            np.add.at(
                right[:, start : start + count],
                block.columns[part.rows].ravel(),
                by_unknown.reshape(-1, count),
            )
            score += np.einsum("mrq,mr->q", part.along, block.residual[part.rows])
            own += np.einsum("mrq,mrp->qp", part.along, part.along)
        scores.append(score)
        plain.append(own)
    # One solution for all hypotheses: N^-1 A^T C.
    solved = adjustment.minimum.factor.solve(right)
    is_at_rest = adjustment.minimum.converged
    gradient = np.zeros(size) if is_at_rest else compute_gradient(blocks.values(), size)
    found = []
    for start, count, score, own in zip(first, counts, scores, plain, strict=False):
        span = slice(int(start), int(start) + count)
        information = own - right[:, span].T @ solved[:, span]
        found.append(
            _test_hypothesis(score - solved[:, span].T @ gradient, own, information, checked)
        )
    return tuple(found)


def _test_hypothesis(
    score: Floats, plain: Floats, information: Floats, least: float
) -> HypothesisTest:
    """Compute the result of one hypothesis from C^T v, C^T C and R."""
    scale, share, axes = _find_directions(plain.diagonal(), information)
    checked = share > least
    along = axes[:, checked]
    inverse = scale[:, None] * along
    value = -inverse @ ((inverse.T @ score) / share[checked])
    covariance = (inverse / share[checked]) @ inverse.T
    loose = np.abs(axes[:, ~checked]).max(axis=1, initial=0.0) > 1e-6
    covariance[loose, loose] = np.inf
    gain = float(np.sum((inverse.T @ score) ** 2 / share[checked]))
    return HypothesisTest(gain, int(checked.sum()), value, covariance)


def compute_gains(
    score: Floats, plain: Floats, information: Floats, least: float = MIN_RESIDUAL_SHARE
) -> Floats:
    """Compute the decreases (n,) of the sum of squares by n hypotheses of q unknowns each.

    Parameters
    ----------
    score, plain, information
        (n, q), (n, q), (n, q, q): C^T v, the diagonal of C^T C, and R (see `compare_hypotheses`).
    least
        Smallest share of a direction that has to show in the residuals.
    """
    scale, share, axes = _find_directions(plain, information)
    along = np.einsum("nqk,nq->nk", axes, scale * score)
    is_checked = share > least
    gain = along**2 / np.where(is_checked, share, 1.0)
    return np.asarray(np.sum(np.where(is_checked, gain, 0.0), axis=1))


def invert_information(
    plain: Floats, information: Floats, least: float = MIN_RESIDUAL_SHARE
) -> Floats:
    """Invert the information of a hypothesis in the directions that show in the residuals.

    Parameters
    ----------
    plain, information
        (q,), (q, q): the diagonal of C^T C, and R (see `compare_hypotheses`).
    least
        Smallest share of a direction that has to show in the residuals.
    """
    scale, share, axes = _find_directions(plain, information)
    along = scale[:, None] * axes[:, share > least]
    return np.asarray((along / share[share > least]) @ along.T)


def _find_directions(plain: Floats, information: Floats) -> tuple[Floats, Floats, Floats]:
    """Find the directions of unknowns, and the shares of them that show in the residuals.

    Parameters
    ----------
    plain, information
        (..., q), (..., q, q): diagonal of C^T C, and R.

    Returns
    -------
    scale, share, axes
        (..., q) factors by which C^T C gets a unit diagonal; (..., q) eigenvalues of R with these
        units, which are the shares; and (..., q, q) its eigenvectors.
    """
    length = np.sqrt(np.maximum(plain, 0.0))
    scale = np.where(length > 0, 1.0 / np.where(length > 0, length, 1.0), 0.0)
    share, axes = np.linalg.eigh(information * scale[..., :, None] * scale[..., None, :])
    return scale, share, axes


PLACE_STEP_M = 0.01
"""Step [m] for the derivatives of picks by the places of their points."""


def derive_picks_by_place(adjustment: Adjustment, rows: Ints, directions: Floats) -> Floats:
    """Compute the derivatives (m, 2, q) of whitened picks by shifts of their points.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    rows
        (m,) its picks.
    directions
        (q, 3) directions of the shifts: east, north, up.
    """
    survey, state = adjustment.survey, adjustment.state
    frame = survey.pick_frame[rows]
    world, _, _ = adjustment.problem.world_points(state, survey.pick_label[rows])
    poses = RowPoses(state.center[frame], state.rotation[frame], adjustment.sweep()[frame])
    lens, camera = adjustment.problem.intrinsics(state), survey.calibration
    steps = PLACE_STEP_M * directions
    differences = [
        project_rows(camera, lens, poses, world + step)
        - project_rows(camera, lens, poses, world - step)
        for step in steps
    ]
    along = np.stack(differences, axis=-1) / (2.0 * PLACE_STEP_M)
    return np.asarray(along / survey.pick_sigma_px[rows, None, None])


def compute_log_probability(gain: float, unknowns: int, count: int = 1) -> float:
    """Compute the log probability that one of `count` hypotheses explains as much by chance.

    Parameters
    ----------
    gain
        Reduction of the weighted sum of squares.
    unknowns
        Number of unknowns that the hypothesis adds.
    count
        Number of possible hypotheses of its kind.

    Notes
    -----
    Upper tail of chi-square, times the count (Bonferroni), at most one.
    """
    if gain <= 0.0 or unknowns == 0:
        return 0.0
    half = unknowns / 2.0
    probability = float(gammaincc(half, gain / 2.0))
    if probability > MIN_PROBABILITY:
        tail = float(np.log(probability))
    else:  # leading term: Abramowitz and Stegun 6.5.32
        tail = -gain / 2.0 + (half - 1.0) * float(np.log(gain / 2.0)) - float(gammaln(half))
    return min(0.0, tail + float(np.log(count)))


def adjust_without(adjustment: Adjustment, members: Iterable[Member]) -> Adjustment:
    """Adjust without some readings.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    members
        Readings to leave out. Priors among them are kept. Readings are kept, too, if the rest does
        not determine the unknowns, or if there are too many of a kind to be the exception: then
        that kind is less precise than stated.

    Returns
    -------
    Adjustment of the same likelihood; its blocks lack the rows that were left out.
    """
    problem = adjustment.problem
    keep = _mark_kept_rows(adjustment, members)
    if not keep:
        return adjustment

    def evaluate(now: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(now)
        if blocks is None:
            return None
        return blocks | {name: _rows(blocks[name], rows) for name, rows in keep.items()}

    layout = problem.layout
    try:
        minimum = minimise(
            adjustment.state,
            evaluate,
            lambda now, step: advance_state(layout, now, step),
            layout.size,
            layout.structure,
            at_rest=MAX_UNDAMPED_REDUCTION,
        )
        rest = Adjustment(problem, minimum, minimum.factor.covariance())
    except SingularError:  # an unknown depends on these readings alone
        return adjustment
    return rest if minimum.converged else adjustment


def _mark_kept_rows(adjustment: Adjustment, members: Iterable[Member]) -> dict[str, Bools]:
    """Mark the kept rows of each kind of readings from which some, but not too many, are out."""
    keep = {
        kind: np.ones(len(block.residual), dtype=np.bool_)
        for kind, block in adjustment.minimum.blocks.items()
        if kind in READINGS
    }
    for member in members:
        if member.kind in keep:
            thing = adjustment.problem.observations[member.kind].things()
            own = member.row if thing is None else thing == thing[member.row]
            keep[member.kind][own] = False
    return {
        kind: rows
        for kind, rows in keep.items()
        if rows.any() and 0 < (~rows).sum() <= limit_gross_errors(len(rows))
    }


def _rows(block: Block, rows: Bools) -> Block:
    return Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
