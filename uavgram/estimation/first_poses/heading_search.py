"""Headings of photos with a stated position but no heading, from shared points.

A photo of known tilt gives a plan of its points, up to a rotation about the vertical and a shift.
Photos are placed one by one. For each, all headings of a full circle are tried, and the one is
taken at which its points agree with those already placed and its position with the stated one. The
search is repeated from many headings of the first photo, because only the positions determine the
heading of the whole group.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints

START_COUNT = 18
"""Number of initial headings of a group of photos: close enough that the right one keeps the others
in place."""

HEADING_COUNT = 48
"""Number of headings that are tried for each photo; the best is then refined."""

KEPT_COUNT = 3
"""Number of initial headings that are continued to the end: those that fit best so far."""

SWEEPS = 3
"""Number of times that each photo is placed again among all others."""

ROBUST_SIGMAS = 3.0
"""Distance in sigmas above which the weight of a pick falls (Cauchy), because labels may be
wrong."""


class PlanPoints(NamedTuple):
    """Points of the ground in plan, as the photos show them.

    Attributes
    ----------
    frame, label
        (P,) of each pick.
    offset_m
        (P, 2) east and north from the photo's position, at its present heading.
    sigma_m
        (P,) sigma of each offset, without errors that move all points of a photo alike.
    center_m
        (F, 2) positions of the photos.
    center_sigma_m
        (F,) sigma of each, including errors that move all points of a photo alike.
    turn_sigma_rad
        (F,) sigma of the present heading; infinite: unknown.
    anchor_m
        (K, 2) known points; NaN for others.
    """

    frame: Ints
    label: Ints
    offset_m: Floats
    sigma_m: Floats
    center_m: Floats
    center_sigma_m: Floats
    turn_sigma_rad: Floats
    anchor_m: Floats


def search_headings(plan: PlanPoints, free: Bools) -> Floats:
    """Search turns (F,) about up [rad] by which the photos' plans agree; 0 if undetermined.

    Parameters
    ----------
    plan
        Plans of the photos.
    free
        (F,) mask of the photos with unknown heading; the others do not move.
    """
    turns = np.zeros(len(free))
    for frames in _find_groups(plan):
        if not free[frames].any():
            continue
        anchored = not free[frames].all() or _has_anchor(plan, frames)
        if len(frames) == 1 and not anchored:
            continue
        found = _find_best_layout(plan, free, frames, anchored=anchored)
        turns[frames] = found[frames]
    return np.asarray((turns + np.pi) % (2 * np.pi) - np.pi)


def _find_groups(plan: PlanPoints) -> list[Ints]:
    """Return groups of photos that are connected by common points."""
    group = np.arange(len(plan.center_m))
    while True:
        of_label = np.full(len(plan.anchor_m), len(group))
        np.minimum.at(of_label, plan.label, group[plan.frame])
        new = group.copy()
        np.minimum.at(new, plan.frame, of_label[plan.label])
        if (new == group).all():
            seen = np.unique(plan.frame)
            return [seen[group[seen] == k] for k in np.unique(group[seen])]
        group = new


def _has_anchor(plan: PlanPoints, frames: Ints) -> bool:
    mine = np.isin(plan.frame, frames)
    return bool(np.isfinite(plan.anchor_m[plan.label[mine], 0]).any())


def _find_best_layout(plan: PlanPoints, free: Bools, frames: Ints, *, anchored: bool) -> Floats:
    """Return the turns (F,) of the layout that fits best."""
    starts: list[tuple[int, float] | None] = [None]
    if not anchored:
        first = int(frames[np.argmax(np.bincount(plan.frame, minlength=len(free))[frames])])
        starts = [(first, 2 * np.pi * k / START_COUNT) for k in range(START_COUNT)]
    laid = [_place_group(plan, free, frames, start) for start in starts]
    laid.sort(key=lambda each: each[0])
    moving = [int(f) for f in frames if free[f]]
    swept = []
    for cost, laying in laid[:KEPT_COUNT]:
        for _ in range(SWEEPS):
            cost = sum(laying.settle(frame) for frame in moving)  # noqa: PLW2901
        swept.append((cost, laying.turn))
    return min(swept, key=lambda each: each[0])[1]


def _place_group(
    plan: PlanPoints, free: Bools, frames: Ints, start: tuple[int, float] | None
) -> tuple[float, _Layout]:
    """Place a group from a first photo's turn, or from known photos; also return its cost."""
    laying = _Layout.begun(plan)
    if start is None:
        for frame in frames[~free[frames]]:
            laying.put(int(frame), 0.0, np.zeros(2))
    else:
        laying.put(*start, np.zeros(2))
    waiting = [int(f) for f in frames if not laying.there[f]]
    cost = 0.0
    while waiting:
        frame = max(waiting, key=laying.heading_information)
        cost += laying.settle(frame)
        waiting.remove(frame)
    return cost, laying


@dataclass(eq=False)
class _Layout:
    """Photos placed so far, and positions of their points (`total` over `weight`, by label)."""

    plan: PlanPoints
    picks: list[Ints]
    turn: Floats
    shift: Floats
    there: Bools
    total: Floats
    weight: Floats

    @classmethod
    def begun(cls, plan: PlanPoints) -> _Layout:
        order = np.argsort(plan.frame, kind="stable")
        bounds = np.searchsorted(plan.frame[order], np.arange(len(plan.center_m) + 1))
        picks = [order[bounds[f] : bounds[f + 1]] for f in range(len(plan.center_m))]
        known = np.isfinite(plan.anchor_m[:, 0])
        weight = np.where(known, 1.0, 0.0)
        total = np.where(known[:, None], plan.anchor_m, 0.0)
        count = len(plan.center_m)
        none = np.zeros(count, dtype=np.bool_)
        return cls(plan, picks, np.zeros(count), np.zeros((count, 2)), none, total, weight)

    def heading_information(self, frame: int) -> float:
        """Compute the information of the points already placed on a photo's heading."""
        picks = self.picks[frame]
        weight = np.where(self.weight[self.plan.label[picks]] > 0, 1.0, 0.0)
        weight /= self.plan.sigma_m[picks] ** 2
        offset = self.plan.offset_m[picks]
        size = weight.sum()
        if not size > 0:
            return -1.0
        mean = weight @ offset / size
        own = 1.0 / (1.0 / size + self.plan.center_sigma_m[frame] ** 2)
        return float(weight @ np.sum((offset - mean) ** 2, axis=1) + own * (mean @ mean))

    def put(self, frame: int, turn: float, shift: Floats) -> None:
        """Place a photo; its points move with it."""
        self._weigh(frame, -1.0)
        self.turn[frame], self.shift[frame], self.there[frame] = turn, shift, True
        self._weigh(frame, 1.0)

    def _weigh(self, frame: int, sign: float) -> None:
        if not self.there[frame]:
            return
        picks = self.picks[frame]
        weight = sign / self.plan.sigma_m[picks] ** 2
        label = self.plan.label[picks]
        place = self.plan.center_m[frame] + self.shift[frame]
        place = place + self.plan.offset_m[picks] @ _rotation(np.array([self.turn[frame]]))[0].T
        np.add.at(self.total, label, weight[:, None] * place)
        np.add.at(self.weight, label, weight)

    def settle(self, frame: int) -> float:
        """Place a photo where it fits best among the others, and return its cost there."""
        self._weigh(frame, -1.0)
        self.there[frame] = False
        around = 2 * np.pi * np.arange(HEADING_COUNT) / HEADING_COUNT
        cost, _ = self._costs(frame, around)
        best = around[int(cost.argmin())]
        near = best + np.linspace(-1.0, 1.0, 17) * 2 * np.pi / HEADING_COUNT
        cost, shift = self._costs(frame, near)
        k = int(cost.argmin())
        self.put(frame, float(near[k]), shift[k])
        return float(cost[k])

    def _costs(self, frame: int, turn: Floats) -> tuple[Floats, Floats]:
        """Compute costs (T,) of a photo at some turns, and the best shifts (T, 2) there."""
        plan, picks = self.plan, self.picks[frame]
        label = plan.label[picks]
        met = self.weight[label] > 1e-9
        picks, label = picks[met], label[met]
        sigma = plan.turn_sigma_rad[frame]
        prior = (((turn + np.pi) % (2 * np.pi) - np.pi) / sigma) ** 2
        if not len(picks):
            return prior, np.zeros((len(turn), 2))
        target = self.total[label] / self.weight[label][:, None] - plan.center_m[frame]
        place = np.einsum("tij,pj->tpi", _rotation(turn), plan.offset_m[picks])
        off = place - target
        weight = 1.0 / (plan.sigma_m[picks] ** 2 + 1.0 / self.weight[label])
        own = 1.0 / (2.0 * plan.center_sigma_m[frame] ** 2)
        robust = np.ones(off.shape[:2])
        # Robust shift by reweighted least squares, with the position's sigma as prior.
        for _ in range(3):
            total = weight * robust
            shift = -np.einsum("tp,tpi->ti", total, off) / (total.sum(axis=1) + own)[:, None]
            squared = weight * np.sum((off + shift[:, None]) ** 2, axis=2)
            robust = 1.0 / (1.0 + squared / ROBUST_SIGMAS**2)
        cost = ROBUST_SIGMAS**2 * np.log1p(squared / ROBUST_SIGMAS**2).sum(axis=1)
        return cost + own * np.sum(shift**2, axis=1) + prior, shift


def _rotation(angle: Floats) -> Floats:
    """Return (T, 2, 2) rotations about up."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], -2)
