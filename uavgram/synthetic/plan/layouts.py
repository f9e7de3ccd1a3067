"""Choice of few of many possible reference lines, or plates, for the best accuracy.

Greedy, then exchange: the line that helps most is added until there are enough; then each in turn
is removed and replaced by the best one, until none changes (Fedorov 1972, ch. 3; Atkinson, Donev
and Tobias 2007, ch. 12). The criterion is the weighted mean of predicted sigmas, an L-optimal
design; with lengths all over an area as wanted values, an I-optimal one. Lines may be lost: tapes
are misread, marks driven over, cars parked on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.synthetic.plan.elimination import Functions

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
