"""Scale of a survey: what it rests on, and which line to tape next.

How uneven the ground is, the survey learns from its own points, and without a log how fast the
drone flew, from its own photos: in metres that the known lengths alone give. Were these twice as
long, so would be both. As priors of a fixed width they would bear on the scale nevertheless, the
smaller the survey the better they would fit; so where it is asked what bears on the scale, their
widths go with it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Block, NormalEquations, SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import kind_of
from uavgram.estimation.survey.observations.lengths import taped_lines
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey


def by_size(adjustment: Adjustment) -> dict[str, Floats]:
    """How residuals change with a factor by which all that is measured comes out too long.

    Returns
    -------
    dict
        By group, (m, r) derivatives of its whitened residuals by the factor, as the widths of these
        priors and the speed go with the size of the survey: at a given departure, a width that is
        smaller by the factor makes a residual larger by it.
    """
    blocks, rolling = adjustment.minimum.blocks, adjustment.survey.rolling
    change = {kind: block.residual for kind, block in blocks.items() if kind_of(kind).by_size}
    if rolling is not None and rolling.by_photos:
        # At half the speed, rows read in twice the time show the same.
        share = rolling.readout.value_s / rolling.readout.sigma_s
        change["readout"] = np.full_like(blocks["readout"].residual, share)
    return change


NOTHING = 0.3
"""Relative sigma from which on something does not bear on the scale."""


class ScaleSigmas(NamedTuple):
    """Relative standard deviations of the size of all.

    Attributes
    ----------
    all
        Of the points' extent, by everything.
    lengths
        Of a factor common to the known lengths, by their readings and tapes; inf without any.
    others
        Of the same factor, by all the rest: log, control, stated heights; inf where nothing else
        bears on it. What the survey learns of itself does not: see estimation/survey/size.
    """

    all: float
    lengths: float
    others: float


def scale_sigmas(adjustment: Adjustment) -> ScaleSigmas:
    """How well the scale is known, and by what."""
    everything = _of_extent(adjustment)
    if "lengths" not in adjustment.minimum.blocks:
        return ScaleSigmas(everything, np.inf, everything)
    survey, line = adjustment.survey, adjustment.problem.line_index
    own = _of_readings(survey, line)
    return ScaleSigmas(everything, own, _of_others(adjustment))


def _of_readings(survey: Survey, line: Ints) -> float:
    """Sigma of a factor common to all lengths: by the readings of each tape, and its own scale."""
    readings = (survey.length_m[line] / survey.length_sigma_m[line]) ** 2
    tapes = np.array(taped_lines(survey, line).tape)
    told = [
        1.0 / (1.0 / float(readings[tapes == tape].sum()) + survey.scale_sigma_of(tape) ** 2)
        for tape in dict.fromkeys(tapes.tolist())
    ]
    return float(np.sqrt(1.0 / sum(told)))


def _of_others(adjustment: Adjustment) -> float:
    """Sigma of a factor common to all readings, of which nothing is known but by all else.

    It is one more unknown in place of the tapes' scales, and eliminated last: what is left of its
    information then is exact to rounding, however little it is.
    """
    blocks, layout = dict(adjustment.minimum.blocks), adjustment.problem.layout
    survey, line = adjustment.survey, adjustment.problem.line_index
    readings = blocks["lengths"]
    width = readings.columns.shape[1] - (1 if layout.tape else 0)
    # Of what should be read: what is read would take its residual for something that is known.
    by_factor = survey.length_m[line] / survey.length_sigma_m[line] + readings.residual[:, 0]
    blocks.pop("tape", None)
    bare = replace(layout, tape=0)
    last = bare.size
    bare_readings = Block(
        readings.residual, readings.columns[:, :width], readings.jacobian[:, :, :width]
    )
    blocks["lengths"] = _with_column(bare_readings, last + layout.tape, by_factor[:, None])
    for kind, change in by_size(adjustment).items():
        blocks[kind] = _with_column(blocks[kind], last + layout.tape, change)
    # What stands behind the tapes' scales moves up.
    moved = [replace(b, columns=_without_tapes(b.columns, layout)) for b in blocks.values()]
    structure = replace(bare.structure, size=last + 1)
    try:
        factor = NormalEquations(moved, last + 1, structure).factor()
    except SingularError:
        return float("inf")
    return float(np.sqrt(factor.joint(np.array([last]))[0, 0]))


def _with_column(block: Block, column: int, derivative: Floats) -> Block:
    """Rows by one more unknown, of which each row has its derivative (m, r)."""
    return Block(
        block.residual,
        np.column_stack([block.columns, np.full(len(block.columns), column)]),
        np.concatenate([block.jacobian, derivative[:, :, None]], axis=2),
    )


def _without_tapes(columns: Ints, layout: Layout) -> Ints:
    """Columns of a layout in which no tape has a scale."""
    return np.where(columns >= layout.first_readout, columns - layout.tape, columns)


def _of_extent(adjustment: Adjustment) -> float:
    """Relative sigma of the extent of all points about their middle; inf for a single one."""
    layout = adjustment.problem.layout
    world, jacobian, columns = adjustment.points_with_jacobian(np.arange(layout.points))
    arm = world - world.mean(axis=0)
    size = float(np.vdot(arm, arm))
    if size == 0.0:
        return float("inf")
    gradient = np.zeros(layout.size)
    np.add.at(gradient, columns, np.einsum("ni,nik->nk", arm / size, jacobian))
    solved = adjustment.minimum.factor.solve(gradient[:, None])[:, 0]
    return float(np.sqrt(gradient @ solved))


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
