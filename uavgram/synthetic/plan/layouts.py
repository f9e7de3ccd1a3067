"""Choice of few of many possible reference lines, or plates, for the best accuracy.

Greedy, then exchange: the line that helps most is added until there are enough; then each in turn
is removed and replaced by the best one, until none changes (Fedorov 1972, ch. 3; Atkinson, Donev
and Tobias 2007, ch. 12). The criterion is the weighted mean of predicted sigmas, an L-optimal
design; with lengths all over an area as wanted values, an I-optimal one. Lines may be lost: tapes
are misread, marks driven over, cars parked on them.

The two ends of a candidate line occur in no other observation. Elimination from the normal
equations leaves rows on the shared unknowns alone: poses, lens, ground, biases, tapes (the core,
below).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class EliminatedPoints:
    """K eliminated points; C unknowns of the core, in the order of the layout.

    Attributes
    ----------
    base
        (C, C) information on the core from observations without a point: priors.
    root
        (K, r, C) root of the information of each point's sightings on the core, as rows.
    by_core
        (K, p, C) derivative of each point, determined by its sightings, by the core.
    covariance
        (K, p, p) of each point for a fixed core.
    """

    base: Floats
    root: Floats
    by_core: Floats
    covariance: Floats

    def information(self, point: Ints) -> Floats:
        """Return the (C, C) information of some points' sightings on the core."""
        rows = self.root[point].reshape(-1, self.root.shape[2])
        return np.asarray(rows.T @ rows)


def eliminate_points(problem: SurveyProblem, blocks: dict[str, Block]) -> EliminatedPoints:
    """Eliminate all points of a survey whose observations each see one point, or none.

    With the whitened rows of a point, the part A of its own unknowns and B of the core, and A = Q
    R, the reduced rows are the component of B orthogonal to A: the last columns of Q, transposed,
    times B (Golub and Pereyra 1973, variable projection).

    Parameters
    ----------
    problem
        The likelihood.
    blocks
        Its observations, without those between points (lengths).
    """
    layout = problem.layout
    size, first = layout.point_size, layout.first_frame
    count, core = layout.points, layout.size - first
    base = np.zeros((core, core))
    found: list[tuple[Ints, Floats, Floats]] = []
    # priors of the core; split rows with a point into the parts of point and core
    for block in blocks.values():
        own = block.columns < layout.first_tie
        if not own.any():
            base += _information(block, layout)
            continue
        label = np.where(own, block.columns // size, -1).max(axis=1)
        found.append((label, *_split(block, layout)))
    # collect the rows of each point, padded with zeros to the same number
    label = np.concatenate([np.repeat(one[0], one[1].shape[1]) for one in found])
    own_rows = np.concatenate([one[1].reshape(-1, size) for one in found])
    core_rows = np.concatenate([one[2].reshape(-1, core) for one in found])
    order = np.argsort(label, kind="stable")
    rows = np.bincount(label, minlength=count)
    slot = np.arange(len(label)) - np.repeat(np.cumsum(rows) - rows, rows)
    most = max(int(rows.max()), size)
    a, b = np.zeros((count, most, size)), np.zeros((count, most, core))
    a[label[order], slot], b[label[order], slot] = own_rows[order], core_rows[order]
    # QR decomposition of each point's own part: A = Q R
    q, r = np.linalg.qr(a, mode="complete")
    # rotated core part: the first rows determine the point, the others are the reduced rows
    turned = np.swapaxes(q, 1, 2) @ b
    inverse = np.linalg.inv(r[:, :size])
    return EliminatedPoints(
        base=base,
        root=turned[:, size:],
        by_core=-inverse @ turned[:, :size],
        covariance=inverse @ np.swapaxes(inverse, 1, 2),
    )


def _split(block: Block, layout: Layout) -> tuple[Floats, Floats]:
    """Return the Jacobian by the row's own point (n, r, p), and by the core (n, r, C)."""
    size, first = layout.point_size, layout.first_frame
    n, rows, _ = block.jacobian.shape
    own = np.zeros((n, rows, size))
    core = np.zeros((n, rows, layout.size - first))
    at = np.arange(n)
    for k in range(block.columns.shape[1]):
        column = block.columns[:, k]
        is_core = column >= first
        c, o = at[is_core], at[~is_core]
        core[c, :, column[is_core] - first] += block.jacobian[c, :, k]
        own[o, :, column[~is_core] % size] += block.jacobian[o, :, k]
    return own, core


def _information(block: Block, layout: Layout) -> Floats:
    _, core = _split(block, layout)
    rows = core.reshape(-1, core.shape[2])
    return np.asarray(rows.T @ rows)


@dataclass(frozen=True, eq=False)
class Functions:
    """N linear functions of points and core, with the points eliminated.

    Attributes
    ----------
    gradient
        (N, C) by the core.
    variance
        (N,) for a fixed core: from the points' own errors.
    """

    gradient: Floats
    variance: Floats


def whiten_readings(
    points: EliminatedPoints, layout: Layout, columns: Ints, jacobian: Floats, ends: Ints
) -> Floats:
    """Compute the (n, q, C) information of groups of q readings on the core, as whitened rows.

    The points of a group occur only in it: their elimination correlates its readings.

    Parameters
    ----------
    points
        The points, eliminated.
    layout
        Of the unknowns.
    columns, jacobian
        (n, q, k) unknowns, and derivatives of the whitened readings; an unknown may occur twice.
    ends
        (n, m) the points of each group.
    """
    size, first = layout.point_size, layout.first_frame
    n, q, _ = columns.shape
    # split the derivatives into those by the core and those by the group's own points
    core = np.zeros((n, q, layout.size - first))
    own = np.zeros((n, q, ends.shape[1], size))
    group, reading = np.indices((n, q))
    for column, by_column in zip(
        np.moveaxis(columns, 2, 0), np.moveaxis(jacobian, 2, 0), strict=True
    ):
        of_core = column >= first
        at = group[of_core], reading[of_core]
        core[*at, column[of_core] - first] += by_column[of_core]
        at = group[~of_core], reading[~of_core]
        label = column[~of_core] // size
        which = (ends[at[0]] == label[:, None]).argmax(axis=1)
        own[*at, which, column[~of_core] % size] += by_column[~of_core]
    # substitute the points: their dependence on the core, and their own variance
    core += np.einsum("nqmp,nmpc->nqc", own, points.by_core[ends], optimize=True)
    moved = np.einsum("nqmp,nmpr->nqmr", own, points.covariance[ends], optimize=True)
    variance = np.eye(q) + np.einsum("nqmr,nsmr->nqs", moved, own, optimize=True)
    if q == 1:
        return np.asarray(core / np.sqrt(variance))
    # whiten with the Cholesky factor of the readings' joint covariance
    return np.asarray(np.linalg.solve(np.linalg.cholesky(variance), core), dtype=np.float64)


def combine_functions(points: EliminatedPoints, layout: Layout, gradient: Floats) -> Functions:
    """Return functions of any number of points by their gradients (size, N), points eliminated.

    Parameters
    ----------
    points, layout
        The points, eliminated; the unknowns.
    gradient
        (size, N) by all unknowns.
    """
    size, first = layout.point_size, layout.first_frame
    own = gradient[:first].reshape(layout.points, size, -1)
    used = np.flatnonzero(own.any(axis=(1, 2)))
    own, by_core = own[used], points.by_core[used]
    core = gradient[first:].T + np.einsum("kpn,kpc->nc", own, by_core, optimize=True)
    variance = np.einsum("kpn,kpq,kqn->n", own, points.covariance[used], own, optimize=True)
    return Functions(np.asarray(core), np.asarray(variance))


SHORTLIST_SIZE = 48
"""Number of best candidates by their tapes whose ends' own sightings are evaluated too."""

MAX_PASSES = 6
MIN_GAIN = 1e-4
"""Smallest relative gain of the criterion for an exchange."""


@dataclass(frozen=True, eq=False)
class Objective:
    """Wanted values, and prior information without any line.

    Attributes
    ----------
    information
        (C, C) on the core.
    wanted
        M values.
    weight
        (M,) of each sigma in the criterion; they sum up to one where it is a mean.
    """

    information: Floats
    wanted: Functions
    weight: Floats

    def sigma(self, covariance: Floats) -> Floats:
        """Return the (M,) sigmas for a covariance (C, C) of the core."""
        gradient = self.wanted.gradient
        shared = np.einsum("mc,cd,md->m", gradient, covariance, gradient, optimize=True)
        return np.asarray(np.sqrt(shared + self.wanted.variance))

    def criterion(self, covariance: Floats) -> float:
        """Return the weighted mean of the sigmas."""
        return float(self.weight @ self.sigma(covariance))


@dataclass(frozen=True, eq=False)
class Candidates:
    """N lines that could be taped, or plates that could be laid out.

    Attributes
    ----------
    whitened
        (N, q, C) information of the q lengths of each on the core (`whitened_readings`).
    ends
        (N, m) nodes.
    node_root
        (K, r, C) information of a node's sightings on the core (`Eliminated.root`).
    """

    whitened: Floats
    ends: Ints
    node_root: Floats

    def rows(self, lines: Ints) -> Floats:
        """Return the (n, m r + q, C) whitened rows of candidates on the core."""
        of_nodes = self.node_root[self.ends[lines]]
        flat = of_nodes.reshape(len(lines), -1 if of_nodes.size else 0, of_nodes.shape[-1])
        return np.concatenate([flat, self.whitened[lines]], axis=1)

    def information(self, lines: Sequence[int]) -> Floats:
        """Return the (C, C) information of lines together on the core."""
        rows = self.rows(np.array(lines, dtype=np.int64)).reshape(-1, self.node_root.shape[2])
        return np.asarray(rows.T @ rows)

    def apart_from(self, lines: Sequence[int]) -> Bools:
        """Return a (N,) mask of candidates that share no end with some lines."""
        taken = np.zeros(len(self.node_root), dtype=np.bool_)
        taken[self.ends[list(lines)].ravel()] = True
        return np.asarray(~taken[self.ends].any(axis=1))


@dataclass(frozen=True, eq=False)
class ChosenLines:
    """Chosen lines, by index, and the criterion with them."""

    lines: tuple[int, ...]
    criterion: float


def invert(information: Floats) -> Floats:
    """Invert a positive definite matrix, scaled to a unit diagonal beforehand."""
    scale = 1.0 / np.sqrt(np.diag(information))
    factor = cho_factor(information * np.outer(scale, scale), lower=True)
    return np.asarray(cho_solve(factor, np.eye(len(scale))) * np.outer(scale, scale))


def compute_criterion_with_one_more(
    aim: Objective, candidates: Candidates, covariance: Floats, among: Ints
) -> Floats:
    """Compute the criterion with each of some candidates (n,) added; upper bounds of poor ones.

    One more observation of gradient g and variance s^2 takes (g S w)^2 / (g S g + s^2) from the
    variance of w, with S the covariance before (Plackett 1950). The contribution of the ends' own
    sightings is included for the best candidates only.

    Parameters
    ----------
    aim
        Wanted values.
    candidates
        The lines.
    covariance
        (C, C) of the core without the line.
    among
        (n,) indices of the candidates.
    """
    before = aim.sigma(covariance) ** 2
    with_wanted = covariance @ aim.wanted.gradient.T
    found, best = np.full(len(among), np.inf), np.arange(len(among))
    if candidates.whitened.shape[1] == 1:  # one reading: rank-one update
        rows = candidates.whitened[among, 0]
        taken = (rows @ with_wanted) ** 2
        taken /= 1.0 + np.einsum("nc,nc->n", rows @ covariance, rows)[:, None]
        found = _criterion(aim, before - taken)
        if not candidates.node_root.shape[1]:
            return found
        best = np.argsort(found)[:SHORTLIST_SIZE]
    # exact update for several rows: variance - |L^-1 R S w|^2 with L L^T = R S R^T + I
    rows = candidates.rows(among[best])
    inner = rows @ covariance @ np.swapaxes(rows, 1, 2)
    inner += np.eye(inner.shape[1])
    across = np.linalg.solve(np.linalg.cholesky(inner), rows @ with_wanted)
    exact = _criterion(aim, before - np.sum(across**2, axis=1))
    found[best] = exact
    # a candidate outside the shortlist must not be chosen before one inside
    others = np.setdiff1d(np.arange(len(found)), best)
    found[others] = np.maximum(found[others], exact.min())
    return found


def _criterion(aim: Objective, variance: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)) @ aim.weight)


def compute_criterion(aim: Objective, candidates: Candidates, lines: Sequence[int]) -> float:
    """Return the criterion with some lines.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    lines
        Candidates by index.
    """
    return aim.criterion(invert(aim.information + candidates.information(lines)))


def add_greedily(
    aim: Objective, candidates: Candidates, count: int, start: Sequence[int] = ()
) -> tuple[ChosenLines, ...]:
    """Add lines one after the other: the layouts of each number up to `count`.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    count
        Largest number of lines.
    start
        Lines that are already chosen.
    """
    lines = list(start)
    steps = []
    while len(lines) < count:
        among = np.flatnonzero(candidates.apart_from(lines))
        if not len(among):
            break
        covariance = invert(aim.information + candidates.information(lines))
        found = compute_criterion_with_one_more(aim, candidates, covariance, among)
        lines.append(int(among[np.argmin(found)]))
        steps.append(ChosenLines(tuple(lines), float(found.min())))
    return tuple(steps)


def exchange_lines(aim: Objective, candidates: Candidates, start: ChosenLines) -> ChosenLines:
    """Exchange single lines of a layout as long as that improves it.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    start
        Initial layout.
    """

    def one_more(others: list[int], among: Ints) -> Floats:
        covariance = invert(aim.information + candidates.information(others))
        return compute_criterion_with_one_more(aim, candidates, covariance, among)

    def score(lines: Sequence[int]) -> float:
        return compute_criterion(aim, candidates, lines)

    return ChosenLines(*_improve(candidates, start, score, one_more))


def _improve(
    candidates: Candidates,
    start: ChosenLines,
    score: Callable[[Sequence[int]], float],
    scores: Callable[[list[int], Ints], Floats],
) -> tuple[tuple[int, ...], float]:
    """Exchange single lines as long as that improves the score; return layout and score.

    `score` evaluates a layout, `scores` some lines with each of the candidates (n,), where those of
    poor ones may be upper bounds.
    """
    lines, value = list(start.lines), score(start.lines)
    for _ in range(MAX_PASSES):
        before = value
        for place in range(len(lines)):
            others = lines[:place] + lines[place + 1 :]
            among = np.flatnonzero(candidates.apart_from(others))
            best = int(among[np.argmin(scores(others, among))])
            changed = [*lines[:place], best, *lines[place + 1 :]]
            if (reached := score(changed)) < value * (1.0 - MIN_GAIN):
                lines, value = changed, reached
        if value > before * (1.0 - MIN_GAIN):
            break
    return tuple(lines), value


def find_best_layout(aim: Objective, candidates: Candidates, count: int) -> ChosenLines:
    """Return the best layout of a number of lines by greedy choice and exchange.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    count
        Number of lines.
    """
    steps = add_greedily(aim, candidates, count)
    if not steps:
        return ChosenLines((), compute_criterion(aim, candidates, ()))
    return exchange_lines(aim, candidates, steps[-1])


WORST_LOSS_WEIGHT = 0.1
"""Weight of the criterion after the worst loss, relative to that without any loss."""


def compute_criterion_without_each(
    aim: Objective, candidates: Candidates, lines: Sequence[int]
) -> Floats:
    """Return the (L,) criterion after the loss of each line.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    lines
        The layout: candidates by index.
    """
    left = (tuple(one for one in lines if one != lost) for lost in lines)
    return np.array([compute_criterion(aim, candidates, some) for some in left])


def find_robust_layout(aim: Objective, candidates: Candidates, start: ChosenLines) -> ChosenLines:
    """Find a layout of as many lines that tolerates the loss of any one of them.

    By exchanges, as `exchange_lines`; the sum of the criterion and `WORST_LOSS_WEIGHT` times that
    after the worst loss is minimised.

    Parameters
    ----------
    aim, candidates
        Wanted values, possible lines.
    start
        Initial layout: at least two lines.
    """

    def score(lines: Sequence[int]) -> float:
        whole = compute_criterion(aim, candidates, lines)
        return whole + WORST_LOSS_WEIGHT * float(
            compute_criterion_without_each(aim, candidates, lines).max()
        )

    def scores(others: list[int], among: Ints) -> Floats:
        worst = np.full(len(among), compute_criterion(aim, candidates, others))
        for place in range(len(others)):
            left = others[:place] + others[place + 1 :]
            covariance = invert(aim.information + candidates.information(left))
            worst = np.maximum(
                worst, compute_criterion_with_one_more(aim, candidates, covariance, among)
            )
        covariance = invert(aim.information + candidates.information(others))
        return (
            compute_criterion_with_one_more(aim, candidates, covariance, among)
            + WORST_LOSS_WEIGHT * worst
        )

    lines, _ = _improve(candidates, start, score, scores)
    return ChosenLines(lines, compute_criterion(aim, candidates, lines))
