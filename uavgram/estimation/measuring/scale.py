"""Scale of a survey: the observations that determine it, and the next line to tape.

The roughness of the ground is estimated from the survey's own points, and without a log the speed
of the drone from its own photos. Both are proportional to the known lengths, so they contain no
information on the scale. As priors of fixed width they would seem to contribute: the smaller the
survey, the better they would fit. For the contributions to the scale, their widths are therefore
scaled with the survey.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import Block, NormalEquations, SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.estimation.survey.observations.lengths import select_taped_lines
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey


def scale_derivatives(adjustment: Adjustment) -> dict[str, Floats]:
    """Compute the change of residuals by a factor by which all measured sizes are too long.

    Returns
    -------
    dict
        By group, (m, r) derivatives of its whitened residuals by the factor, as the widths of these
        priors and the speed scale with the size of the survey: at a given departure, a width that
        is smaller by the factor makes a residual larger by it.
    """
    blocks, rolling = adjustment.minimum.blocks, adjustment.survey.rolling
    change = {kind: block.residual for kind, block in blocks.items() if get_kind(kind).by_size}
    if rolling is not None and rolling.by_photos:
        # At half the speed, twice the readout time gives the same rows.
        share = rolling.readout.value_s / rolling.readout.sigma_s
        change["readout"] = np.full_like(blocks["readout"].residual, share)
    return change


SHORT_SHARE = 0.1
"""Share of the longest distance below which a line is not proposed: it would check little."""

MAX_RELATIVE_SIGMA = 0.3
"""Relative sigma from which an observation does not contribute to the scale."""


class ScaleSigmas(NamedTuple):
    """Relative standard deviations of the scale.

    Attributes
    ----------
    all
        Of the points' extent, by everything.
    lengths
        Of a factor common to the known lengths, by their readings and tapes; inf without any.
    others
        Of the same factor, by all other observations: log, control, stated heights; inf if there
        are none. Sizes that the survey learns from itself do not count: see estimation/survey/size.
    excess
        By how much the readings are larger than the others show, as a share; 0 if there are none.
    """

    all: float
    lengths: float
    others: float
    excess: float = 0.0


def compute_scale_sigmas(adjustment: Adjustment) -> ScaleSigmas:
    """Compute the sigmas of the scale by all observations, by the lengths, and by the others."""
    everything = _sigma_of_extent(adjustment)
    if "lengths" not in adjustment.minimum.blocks:
        return ScaleSigmas(everything, np.inf, everything)
    survey, line = adjustment.survey, adjustment.problem.line_index
    own = _sigma_by_readings(survey, line)
    return ScaleSigmas(everything, own, *_factor_by_others(adjustment))


def _sigma_by_readings(survey: Survey, line: Ints) -> float:
    """Compute the sigma of a factor of all lengths by each tape's readings and its own scale."""
    readings = (survey.length_m[line] / survey.length_sigma_m[line]) ** 2
    tapes = np.array(select_taped_lines(survey, line).tape)
    told = [
        1.0 / (1.0 / float(readings[tapes == tape].sum()) + survey.scale_sigma_of(tape) ** 2)
        for tape in dict.fromkeys(tapes.tolist())
    ]
    # Weights of independent tapes add up.
    return float(np.sqrt(1.0 / sum(told)))


def _factor_by_others(adjustment: Adjustment) -> tuple[float, float]:
    """Estimate an unknown factor common to all readings by all others; return sigma and value.

    The factor is one more unknown in place of the tapes' scales, eliminated last: its remaining
    information is then exact to rounding, however small it is.
    """
    blocks, layout = dict(adjustment.minimum.blocks), adjustment.problem.layout
    survey, line = adjustment.survey, adjustment.problem.line_index
    readings = blocks["lengths"]
    width = readings.columns.shape[1] - (1 if layout.tape else 0)
    # Residuals at a tape scale of zero, whose prior is not among the others.
    residual = readings.residual
    if layout.tape:
        scale = adjustment.state.tape[readings.columns[:, -1] - layout.first_tape]
        residual = residual - readings.jacobian[:, :, -1] * scale[:, None]
    # By the predicted readings: with the actual ones, their residuals would act as information.
    by_factor = survey.length_m[line] / survey.length_sigma_m[line] + residual[:, 0]
    blocks.pop("tape", None)
    bare = replace(layout, tape=0)
    last = bare.size
    bare_readings = Block(residual, readings.columns[:, :width], readings.jacobian[:, :, :width])
    blocks["lengths"] = _add_unknown(bare_readings, last + layout.tape, by_factor[:, None])
    for kind, change in scale_derivatives(adjustment).items():
        blocks[kind] = _add_unknown(blocks[kind], last + layout.tape, change)
    # Shift the columns behind the tapes' scales.
    moved = [
        replace(b, columns=_renumber_without_tapes(b.columns, layout)) for b in blocks.values()
    ]
    structure = replace(bare.structure, size=last + 1)
    normal = NormalEquations(moved, last + 1, structure)
    try:
        factor = normal.factor()
    except SingularError:
        return float("inf"), 0.0
    sigma = float(np.sqrt(factor.joint(np.array([last]))[0, 0]))
    return sigma, -float(factor.solve(normal.gradient)[last])


def _add_unknown(block: Block, column: int, derivative: Floats) -> Block:
    """Add one more unknown to rows, with the derivative (m, r) of each row."""
    return Block(
        block.residual,
        np.column_stack([block.columns, np.full(len(block.columns), column)]),
        np.concatenate([block.jacobian, derivative[:, :, None]], axis=2),
    )


def _renumber_without_tapes(columns: Ints, layout: Layout) -> Ints:
    """Return the columns in a layout without tape scales."""
    return np.where(columns >= layout.first_readout, columns - layout.tape, columns)


def _sigma_of_extent(adjustment: Adjustment) -> float:
    """Compute the relative sigma of the extent of all points about their mean; inf for one."""
    layout = adjustment.problem.layout
    world, jacobian, columns = adjustment.points_with_jacobian(np.arange(layout.points))
    arm = world - world.mean(axis=0)
    size = float(np.vdot(arm, arm))
    if size == 0.0:
        return float("inf")
    # Gradient of the log of the root sum of squares: arm / size.
    gradient = np.zeros(layout.size)
    np.add.at(gradient, columns, np.einsum("ni,nik->nk", arm / size, jacobian))
    solved = adjustment.minimum.factor.solve(gradient[:, None])[:, 0]
    return float(np.sqrt(gradient @ solved))


PARALLEL_RAD = np.deg2rad(12.0)
"""Largest root mean square deviation of lines from their mean direction that counts as parallel
[rad]."""

MAX_STRIP_RATIO = 0.12
"""Width over length of a strip that holds the ends of all lines."""

MAX_LINE_RATIO = 0.01
"""The same ratio for ends that are on one line."""

MIN_LENGTH_RATIO = 0.1
"""Longest line over the extent of all points below which the lines are short."""

MAX_RELATIVE_DISTANCE = 0.1
"""Median distance of the lines from one point, over their median length, that counts as passing
near."""

MAX_POINTS = 40
"""Number of labels among which the next line is searched: the outermost ones."""


def describe_line_faults(start_m: Floats, end_m: Floats, point_m: Floats) -> tuple[str, ...]:
    """List the degeneracies of a set of lines on the ground; empty if they are well spread.

    Parameters
    ----------
    start_m, end_m
        (L, 2) ends of the lines on the ground.
    point_m
        (K, 2) all points, for the scene's extent; NaN if there is none.
    """
    along = end_m - start_m
    length = np.linalg.norm(along, axis=1)
    ends = np.concatenate([start_m, end_m])
    if not len(length) or not np.isfinite(ends).all() or not (length > 0).all():
        return ()
    # Principal axes of the ends: width and length of the strip that holds them.
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(ends.T)), 0.0))
    faults = []
    if spread[0] <= MAX_LINE_RATIO * spread[1]:
        return ("the ends of all lines are in one line",)
    # Double angles, as a line has no sense of direction.
    angle = 2.0 * np.arctan2(along[:, 1], along[:, 0])
    mean = np.hypot(np.cos(angle).mean(), np.sin(angle).mean())
    # Root mean square of small deviations d: mean of cos 2d = 1 - 2 d^2.
    if mean >= 1.0 - 2.0 * PARALLEL_RAD**2:
        faults.append("all lines run in nearly one direction")
    elif _pass_through_one_point(start_m, along / length[:, None], length):
        faults.append("all lines pass near one point")
    if spread[0] <= MAX_STRIP_RATIO * spread[1]:
        faults.append("all lines are in one narrow strip")
    extent = np.ptp(point_m[np.isfinite(point_m[:, 0])], axis=0).max()
    if length.max() <= MIN_LENGTH_RATIO * extent:
        faults.append("all lines are short compared with the scene")
    return tuple(faults)


def _pass_through_one_point(start: Floats, unit: Floats, length: Floats) -> bool:
    """Return whether the extended lines pass near the point that is nearest to all of them."""
    if len(start) < 3:
        return False
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    # Least-squares intersection: normal . x = normal . start for every line.
    nearest, *_ = np.linalg.lstsq(normal, np.sum(normal * start, axis=1))
    off = np.abs(normal @ nearest - np.sum(normal * start, axis=1))
    return bool(
        np.median(off) <= MAX_RELATIVE_DISTANCE * np.median(length)
        and off.max() <= 0.5 * length.min()
    )


class LineAdvice(NamedTuple):
    """Line whose measurement would improve the survey most, and the improvement.

    Attributes
    ----------
    start, end
        Labels (of the adjusted survey).
    length_m, sigma_m
        Present length of that line, and the assumed sigma of the tape reading.
    relative_sigma, relative_sigma_after
        Root mean square over the distances between all labels considered: sigma over length.
    """

    start: int
    end: int
    length_m: float
    sigma_m: float
    relative_sigma: float
    relative_sigma_after: float


def find_next_line(adjustment: Adjustment) -> LineAdvice | None:
    """Find the pair of labels whose taped distance would improve the scene's distances most.

    Every pair is a candidate except those already taped; a reading has the median sigma of the
    existing ones. One more observation d of variance s^2 takes Cov(x, d) Cov(d, x) / (Var(d) + s^2)
    from the covariance of all distances x (Plackett 1950): greedy and exact to first order.

    Returns
    -------
    LineAdvice
        None with fewer than two lines' worth of labels, or no length to take a sigma from.
    """
    survey = adjustment.survey
    used = adjustment.problem.line_index
    label = _find_outermost(adjustment.state.point[:, :2])
    if len(label) < 3 or not len(used):
        return None
    first, second, length, joint = _compute_distances(adjustment, label)
    if not len(length):
        return None
    relative = joint / np.outer(length, length)
    sigma = float(np.median(survey.length_sigma_m[used]))
    # Reduction of the sum of relative variances by a reading of each distance.
    taken = np.sum(joint**2 / length[:, None] ** 2, axis=0) / (np.diag(joint) + sigma**2)
    taken[
        _find_taped(label[first], label[second], survey.line_start[used], survey.line_end[used])
    ] = 0
    taken[length < SHORT_SHARE * length.max()] = 0
    best = int(np.argmax(taken))
    if not taken[best] > 0:
        return None
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


class DistanceChanges(NamedTuple):
    """Changes of the distances between labels in another solution.

    Attributes
    ----------
    median, largest
        As shares of the distances.
    sigmas
        The largest, in sigmas of the distance.
    """

    median: float
    largest: float
    sigmas: float


def compute_distance_changes(adjustment: Adjustment, other: Adjustment) -> DistanceChanges:
    """Compute the changes of distances between labels in another solution."""
    label = _find_outermost(adjustment.state.point[:, :2])
    first, second, here, joint = _compute_distances(adjustment, label)
    if not len(here):
        return DistanceChanges(0.0, 0.0, 0.0)
    world = other.points_with_jacobian(label)[0]
    change = np.abs(np.linalg.norm(world[first] - world[second], axis=1) - here)
    sigmas = change / np.sqrt(np.maximum(np.diag(joint), np.finfo(float).tiny))
    share = change / here
    return DistanceChanges(float(np.median(share)), float(share.max()), float(sigmas.max()))


def _compute_distances(adjustment: Adjustment, label: Ints) -> tuple[Ints, Ints, Floats, Floats]:
    """Compute the distances (n,) between all pairs of labels that are apart.

    Returns
    -------
    first, second
        (n,) rows of `label`.
    length, joint
        (n,) distances [m], and their covariance (n, n).
    """
    world, covariance = adjustment.joint_points(label)
    first, second = np.triu_indices(len(label), k=1)
    along = world[second] - world[first]
    length = np.linalg.norm(along, axis=1)
    apart = length > 1e-3 * length.max(initial=0.0)
    first, second, along, length = first[apart], second[apart], along[apart], length[apart]
    unit = along / length[:, None]
    rows = np.arange(len(length))
    gradient = np.zeros((len(length), len(label), 3))
    gradient[rows, first], gradient[rows, second] = -unit, unit
    flat = gradient.reshape(len(length), -1)
    return first, second, length, flat @ covariance @ flat.T


def _find_outermost(point: Floats) -> Ints:
    """Return labels in the survey's order; if there are many, those farthest from the middle."""
    from_middle = np.linalg.norm(point - np.median(point, axis=0), axis=1)
    return np.sort(np.argsort(-from_middle, kind="stable")[:MAX_POINTS])


def _find_taped(first: Ints, second: Ints, start: Ints, end: Ints) -> Ints:
    """Return the pairs that are among the lines, in either direction."""
    size = 1 + max(int(a.max()) for a in (first, second, start, end))
    pair = np.minimum(first, second) * size + np.maximum(first, second)
    return np.flatnonzero(np.isin(pair, np.minimum(start, end) * size + np.maximum(start, end)))
