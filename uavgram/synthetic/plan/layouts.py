"""Choose few of many possible reference lines, or plates, that make what is wanted best known.

Greedy, then exchange: the line that helps most is added until there are enough; then each in turn
is taken out and the best put in its place, until none changes (Fedorov 1972, ch. 3; Atkinson,
Donev and Tobias 2007, ch. 12). The criterion is the weighted mean of predicted sigmas, an L-optimal
design; with lengths all over an area as what is wanted, an I-optimal one. Lines are lost: tapes are
misread, marks driven over, cars parked on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.synthetic.plan.elimination import Functions

SHORTLIST = 48
"""Candidates whose ends' own sightings are reckoned with as well, of those whose tapes say most."""

PASSES = 6
LEAST_GAIN = 1e-4
"""Share of the criterion that makes an exchange worth it."""


@dataclass(frozen=True, eq=False)
class Aim:
    """What is wanted, and what is known without any line.

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
        """(M,) sigmas where the core has a covariance (C, C)."""
        gradient = self.wanted.gradient
        shared = np.einsum("mc,cd,md->m", gradient, covariance, gradient, optimize=True)
        return np.asarray(np.sqrt(shared + self.wanted.variance))

    def criterion(self, covariance: Floats) -> float:
        """Weighted mean of the sigmas."""
        return float(self.weight @ self.sigma(covariance))


@dataclass(frozen=True, eq=False)
class Candidates:
    """N lines that could be taped, or plates that could be laid.

    Attributes
    ----------
    whitened
        (N, q, C) what the q lengths of each say of the core (`whitened_readings`).
    ends
        (N, m) nodes.
    node_root
        (K, r, C) what the sightings of a node say of the core (`Eliminated.root`).
    """

    whitened: Floats
    ends: Ints
    node_root: Floats

    def rows(self, lines: Ints) -> Floats:
        """(n, m r + q, C) all that candidates say of the core, as rows."""
        of_nodes = self.node_root[self.ends[lines]]
        flat = of_nodes.reshape(len(lines), -1 if of_nodes.size else 0, of_nodes.shape[-1])
        return np.concatenate([flat, self.whitened[lines]], axis=1)

    def information(self, lines: Sequence[int]) -> Floats:
        """(C, C) what lines say of the core together."""
        rows = self.rows(np.array(lines, dtype=np.int64)).reshape(-1, self.node_root.shape[2])
        return np.asarray(rows.T @ rows)

    def apart_from(self, lines: Sequence[int]) -> Bools:
        """(N,) which candidates share no end with some lines."""
        taken = np.zeros(len(self.node_root), dtype=np.bool_)
        taken[self.ends[list(lines)].ravel()] = True
        return np.asarray(~taken[self.ends].any(axis=1))


@dataclass(frozen=True, eq=False)
class Chosen:
    """Lines that were chosen, by index, and the criterion with them."""

    lines: tuple[int, ...]
    criterion: float


def covariance_of(information: Floats) -> Floats:
    """Inverse of a positive definite matrix, scaled to a unit diagonal beforehand."""
    scale = 1.0 / np.sqrt(np.diag(information))
    factor = cho_factor(information * np.outer(scale, scale), lower=True)
    return np.asarray(cho_solve(factor, np.eye(len(scale))) * np.outer(scale, scale))


def with_one_more(aim: Aim, candidates: Candidates, covariance: Floats, among: Ints) -> Floats:
    """The criterion with each of some candidates (n,) added; upper bounds of the poor ones.

    One more observation of gradient g and variance s^2 takes (g S w)^2 / (g S g + s^2) from the
    variance of w, S the covariance before (Plackett 1950). What the ends' own sightings add is
    reckoned with for the best ones.

    Parameters
    ----------
    aim
        What is wanted.
    candidates
        The lines.
    covariance
        (C, C) of the core without the line.
    among
        (n,) which candidates.
    """
    before = aim.sigma(covariance) ** 2
    with_wanted = covariance @ aim.wanted.gradient.T
    found, best = np.full(len(among), np.inf), np.arange(len(among))
    if candidates.whitened.shape[1] == 1:  # one reading each: a formula, and few looked at closely
        rows = candidates.whitened[among, 0]
        taken = (rows @ with_wanted) ** 2
        taken /= 1.0 + np.einsum("nc,nc->n", rows @ covariance, rows)[:, None]
        found = _criterion(aim, before - taken)
        if not candidates.node_root.shape[1]:
            return found
        best = np.argsort(found)[:SHORTLIST]
    rows = candidates.rows(among[best])
    inner = rows @ covariance @ np.swapaxes(rows, 1, 2)
    inner += np.eye(inner.shape[1])
    across = np.linalg.solve(np.linalg.cholesky(inner), rows @ with_wanted)
    exact = _criterion(aim, before - np.sum(across**2, axis=1))
    found[best] = exact
    # Whoever was not looked at closely is not chosen before one that was.
    others = np.setdiff1d(np.arange(len(found)), best)
    found[others] = np.maximum(found[others], exact.min())
    return found


def _criterion(aim: Aim, variance: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)) @ aim.weight)


def criterion_of(aim: Aim, candidates: Candidates, lines: Sequence[int]) -> float:
    """The criterion with some lines.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    lines
        Candidates by index.
    """
    return aim.criterion(covariance_of(aim.information + candidates.information(lines)))


def greedy(
    aim: Aim, candidates: Candidates, count: int, start: Sequence[int] = ()
) -> tuple[Chosen, ...]:
    """Lines added one after the other: the layouts of each number up to `count`.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    count
        Most lines.
    start
        Lines that are there already.
    """
    lines = list(start)
    steps = []
    while len(lines) < count:
        among = np.flatnonzero(candidates.apart_from(lines))
        if not len(among):
            break
        covariance = covariance_of(aim.information + candidates.information(lines))
        found = with_one_more(aim, candidates, covariance, among)
        lines.append(int(among[np.argmin(found)]))
        steps.append(Chosen(tuple(lines), float(found.min())))
    return tuple(steps)


def exchanged(aim: Aim, candidates: Candidates, start: Chosen) -> Chosen:
    """The layout after exchanges of single lines, until none is worth it.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    start
        The layout to begin with.
    """

    def one_more(others: list[int], among: Ints) -> Floats:
        covariance = covariance_of(aim.information + candidates.information(others))
        return with_one_more(aim, candidates, covariance, among)

    def score(lines: Sequence[int]) -> float:
        return criterion_of(aim, candidates, lines)

    return Chosen(*_improved(candidates, start, score, one_more))


def _improved(
    candidates: Candidates,
    start: Chosen,
    score: Callable[[Sequence[int]], float],
    scores: Callable[[list[int], Ints], Floats],
) -> tuple[tuple[int, ...], float]:
    """Exchange single lines until none is worth it: the layout, and its score.

    `score` is of a layout, `scores` of some lines with each of the candidates (n,), where those of
    poor ones may be upper bounds.
    """
    lines, value = list(start.lines), score(start.lines)
    for _ in range(PASSES):
        before = value
        for place in range(len(lines)):
            others = lines[:place] + lines[place + 1 :]
            among = np.flatnonzero(candidates.apart_from(others))
            best = int(among[np.argmin(scores(others, among))])
            changed = [*lines[:place], best, *lines[place + 1 :]]
            if (reached := score(changed)) < value * (1.0 - LEAST_GAIN):
                lines, value = changed, reached
        if value > before * (1.0 - LEAST_GAIN):
            break
    return tuple(lines), value


def best_layout(aim: Aim, candidates: Candidates, count: int) -> Chosen:
    """The best layout of a number of lines that greedy choice and exchange find.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    count
        How many lines.
    """
    steps = greedy(aim, candidates, count)
    if not steps:
        return Chosen((), criterion_of(aim, candidates, ()))
    return exchanged(aim, candidates, steps[-1])


WORST = 0.1
"""Weight of the criterion after the worst loss beside that without any."""


def without_each(aim: Aim, candidates: Candidates, lines: Sequence[int]) -> Floats:
    """(L,) the criterion where one of the lines is lost.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    lines
        The layout: candidates by index.
    """
    left = (tuple(one for one in lines if one != lost) for lost in lines)
    return np.array([criterion_of(aim, candidates, some) for some in left])


def surviving(aim: Aim, candidates: Candidates, start: Chosen) -> Chosen:
    """A layout of as many lines that bears the loss of any one of them.

    By exchanges, as `exchanged`; what is made small is the criterion plus `WORST` times that after
    the worst loss.

    Parameters
    ----------
    aim, candidates
        What is wanted, what is possible.
    start
        Where the exchanges begin: at least two lines.
    """

    def score(lines: Sequence[int]) -> float:
        whole = criterion_of(aim, candidates, lines)
        return whole + WORST * float(without_each(aim, candidates, lines).max())

    def scores(others: list[int], among: Ints) -> Floats:
        worst = np.full(len(among), criterion_of(aim, candidates, others))
        for place in range(len(others)):
            left = others[:place] + others[place + 1 :]
            covariance = covariance_of(aim.information + candidates.information(left))
            worst = np.maximum(worst, with_one_more(aim, candidates, covariance, among))
        covariance = covariance_of(aim.information + candidates.information(others))
        return with_one_more(aim, candidates, covariance, among) + WORST * worst

    lines, _ = _improved(candidates, start, score, scores)
    return Chosen(lines, criterion_of(aim, candidates, lines))
