"""What is weak about a set of known lengths, in words, and which line to tape next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

PARALLEL_RAD = np.deg2rad(12.0)
"""Lines whose directions differ from their mean by no more (root mean square) count as parallel."""

STRIP = 0.12
"""Width over length of a strip that holds the ends of all lines."""

IN_LINE = 0.01
"""The same for ends that lie in one line."""

SHORT = 0.1
"""Longest line over the extent of all points below which the lines are short."""

ONE_POINT = 0.1
"""Median distance of the lines from one point, over their median length, that is passing near."""

MOST_POINTS = 40
"""Labels among which the next line is looked for: those farthest out."""


def line_faults(start_m: Floats, end_m: Floats, point_m: Floats) -> tuple[str, ...]:
    """What is degenerate about lines on the ground as a set; nothing where they are well spread.

    Parameters
    ----------
    start_m, end_m
        (L, 2) ends of the lines on the ground.
    point_m
        (K, 2) all points, for the scene's extent; NaN where there is none.
    """
    along = end_m - start_m
    length = np.linalg.norm(along, axis=1)
    ends = np.concatenate([start_m, end_m])
    if not len(length) or not np.isfinite(ends).all() or not (length > 0).all():
        return ()
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(ends.T)), 0.0))
    faults = []
    if spread[0] <= IN_LINE * spread[1]:
        return ("the ends of all lines lie in one line",)
    angle = 2.0 * np.arctan2(along[:, 1], along[:, 0])  # a line has no sense: double angles
    mean = np.hypot(np.cos(angle).mean(), np.sin(angle).mean())
    # Root mean square of small deviations d: mean of cos 2d = 1 - 2 d^2.
    if mean >= 1.0 - 2.0 * PARALLEL_RAD**2:
        faults.append("all lines run in nearly one direction")
    elif _through_one_point(start_m, along / length[:, None], length):
        faults.append("all lines pass near one point")
    if spread[0] <= STRIP * spread[1]:
        faults.append("all lines lie in one narrow strip")
    extent = np.ptp(point_m[np.isfinite(point_m[:, 0])], axis=0).max()
    if length.max() <= SHORT * extent:
        faults.append("all lines are short beside the scene")
    return tuple(faults)


def _through_one_point(start: Floats, unit: Floats, length: Floats) -> bool:
    """Whether the lines, prolonged, pass close to the point that is nearest to all of them."""
    if len(start) < 3:
        return False
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    nearest, *_ = np.linalg.lstsq(normal, np.sum(normal * start, axis=1))
    off = np.abs(normal @ nearest - np.sum(normal * start, axis=1))
    return bool(np.median(off) <= ONE_POINT * np.median(length) and off.max() <= 0.5 * length.min())


class LineAdvice(NamedTuple):
    """The line that would help most, and what it would bring.

    Attributes
    ----------
    start, end
        Labels (of the adjusted survey).
    length_m, sigma_m
        Of that line now, and of the tape reading that was reckoned with.
    relative_sigma, relative_sigma_after
        Root mean square over the distances between all labels looked at: sigma over length.
    """

    start: int
    end: int
    length_m: float
    sigma_m: float
    relative_sigma: float
    relative_sigma_after: float


def next_line(adjustment: Adjustment) -> LineAdvice | None:
    """The pair of labels whose distance, if taped, makes the scene's distances best known.

    Every pair is a candidate but those already taped; a reading has the median sigma of those that
    are there. One more observation d of variance s^2 takes Cov(x, d) Cov(d, x) / (Var(d) + s^2)
    from the covariance of all distances x (Plackett 1950): greedy and exact to first order.

    Returns
    -------
    LineAdvice
        None with fewer than two lines' worth of labels, or no length to take a sigma from.
    """
    survey = adjustment.survey
    used = adjustment.problem.line_index
    label = _outermost(adjustment.state.point[:, :2])
    if len(label) < 3 or not len(used):
        return None
    world, covariance = adjustment.joint_points(label)
    first, second = np.triu_indices(len(label), k=1)
    along = world[second] - world[first]
    length = np.linalg.norm(along, axis=1)
    apart = length > 1e-3 * length.max()
    first, second, along, length = first[apart], second[apart], along[apart], length[apart]
    unit = along / length[:, None]
    rows = np.arange(len(length))
    gradient = np.zeros((len(length), len(label), 3))
    gradient[rows, first], gradient[rows, second] = -unit, unit
    flat = gradient.reshape(len(length), -1)
    joint = flat @ covariance @ flat.T
    relative = joint / np.outer(length, length)
    sigma = float(np.median(survey.length_sigma_m[used]))
    taken = np.sum(joint**2 / length[:, None] ** 2, axis=0) / (np.diag(joint) + sigma**2)
    taken[_taped(label[first], label[second], survey.line_start[used], survey.line_end[used])] = 0
    best = int(np.argmax(taken))
    before = float(np.trace(relative))
    number = len(length)
    return LineAdvice(
        int(label[first[best]]),
        int(label[second[best]]),
        float(length[best]),
        sigma,
        float(np.sqrt(before / number)),
        float(np.sqrt(max(before - taken[best], 0.0) / number)),
    )


def distance_changes(adjustment: Adjustment, other: Adjustment) -> tuple[float, float]:
    """Relative changes of the distances between labels in another solution: median and largest."""
    label = _outermost(adjustment.state.point[:, :2])
    first, second = np.triu_indices(len(label), k=1)
    here, there = (
        np.linalg.norm(world[first] - world[second], axis=1)
        for world in (each.joint_points(label)[0] for each in (adjustment, other))
    )
    apart = here > 1e-3 * here.max(initial=0.0)
    change = np.abs(there[apart] / here[apart] - 1.0)
    return (float(np.median(change)), float(change.max())) if len(change) else (0.0, 0.0)


def _outermost(point: Floats) -> Ints:
    """Labels in the order of the survey, the farthest from the middle where there are many."""
    from_middle = np.linalg.norm(point - np.median(point, axis=0), axis=1)
    return np.sort(np.argsort(-from_middle, kind="stable")[:MOST_POINTS])


def _taped(first: Ints, second: Ints, start: Ints, end: Ints) -> Ints:
    """Which pairs are among the lines, either way round."""
    size = 1 + max(int(a.max()) for a in (first, second, start, end))
    pair = np.minimum(first, second) * size + np.maximum(first, second)
    return np.flatnonzero(np.isin(pair, np.minimum(start, end) * size + np.maximum(start, end)))
