"""Hypotheses on two labels that are swapped in all photos, by lengths between them and others."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey.corrections import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing
from uavgram.stages.refine.causes.labels.places import labels_of

WRONG = 16.0
"""Decrease of the sum of squares without a length, above which its ends are examined."""

BENT = 0.03
"""Relative error of distances in a survey distorted by lengths between wrong labels."""

MOST_PAIRS = 3
"""Pairs of labels that are proposed: those of largest gain with the points as adjusted."""


def swapped_everywhere(standing: Standing) -> Iterator[Hypothesis]:
    """Propose pairs of labels that are swapped in all photos, so that lengths fit better."""
    survey = standing.survey
    wrong = _wrong_lengths(standing)
    ends = np.union1d(survey.line_start[wrong], survey.line_end[wrong])
    ends = ends[labels_of(standing)[ends] >= 0]
    if not len(ends):
        return
    spoilt = frozenset(np.flatnonzero(standing.spoilt).tolist())
    first, second, better = _gains(standing, ends)
    labels = len(standing.adjustment.survey.label)
    best = np.argsort(-better, kind="stable")[:MOST_PAIRS]
    # Left-out lengths do not distort the points, so their places as adjusted are sufficient;
    # a decrease above the whole cost means that the linear model does not hold.
    none_left_out = (
        standing.adjustment.minimum.converged and not standing.refined.line_removed.any()
    )
    pairs = zip(first[best].tolist(), second[best].tolist(), better[best].tolist(), strict=True)
    for a, b, easier in pairs:
        touched = _touch(survey.line_start, a, b) ^ _touch(survey.line_end, a, b)
        lines = np.flatnonzero(touched & wrong)
        # A single length between wrong labels explains as much if no other ends at either.
        alone = PRICE if touched.sum() < 2 else 0.0
        right = {int(k): b for k in np.flatnonzero(survey.pick_label == a)}
        right |= {int(k): a for k in np.flatnonzero(survey.pick_label == b)}
        fall, cost = _fall(standing, a, b), standing.adjustment.minimum.cost
        yield Hypothesis(
            tell=partial(_swapped, standing, (a, b), lines),
            mend=SurveyCorrection(label_of_pick=right),
            is_clear=not alone,
            back=spoilt,  # lengths between wrong labels distort everything, including whole photos
            promise=max(min(fall, cost), 0.0 if none_left_out else easier),
            price=float(np.log(labels * (labels - 1) / 2.0)) + alone,
            settles=frozenset(survey.line_name[k] for k in lines if survey.line_name),
        )


def _wrong_lengths(standing: Standing) -> Bools:
    """Mark lengths (L,) that were left out, or do not fit."""
    wrong = standing.refined.line_removed.copy()
    adjustment = standing.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is not None:
        row = standing.refined.line_index[adjustment.problem.line_index]
        wrong[row[falls_without(block, adjustment.covariance) > WRONG]] = True
    return wrong


def _touch(end: Ints, a: int, b: int) -> Bools:
    return np.asarray((end == a) | (end == b))


def _gains(standing: Standing, ends: Ints) -> tuple[Ints, Ints, Floats]:
    """Pair some ends with all labels; return the pairs (n,), (n,) and their gains (n,)."""
    known = np.flatnonzero(labels_of(standing) >= 0)
    first, second = (each.ravel() for each in np.meshgrid(ends, known, indexing="ij"))
    use = (first < second) | ((first > second) & ~np.isin(second, ends))
    first, second = first[use], second[use]
    return first, second, _gain_of(standing, first, second)


def _gain_of(standing: Standing, first: Ints, second: Ints) -> Floats:
    """Compute the better fit (n,) of the lengths with two labels exchanged, points as adjusted.

    The logarithm prevents one length of large misfit from outweighing several others.

    Parameters
    ----------
    standing
        The survey under diagnosis.
    first, second
        (n,) labels of the survey.
    """
    survey, at = standing.survey, labels_of(standing)
    place = standing.adjustment.points_with_jacobian(at[at >= 0])[0]
    world = np.full((len(at), 3), np.nan)
    world[at >= 0] = place
    gain = np.zeros(len(first))
    for line, (start, end) in enumerate(zip(survey.line_start, survey.line_end, strict=True)):
        if at[start] < 0 or at[end] < 0:
            continue  # it takes no part, so its fit is unknown
        row = np.flatnonzero(np.isin(first, (start, end)) | np.isin(second, (start, end)))
        swapped = [_exchanged(label, first[row], second[row]) for label in (start, end)]
        apart = [np.linalg.norm(world[a] - world[b], axis=-1) for a, b in ((start, end), swapped)]
        sigma = np.hypot(survey.length_sigma_m[line], BENT * survey.length_m[line])
        squares = [((each - survey.length_m[line]) / sigma) ** 2 for each in apart]
        now, then = (np.log1p(np.nan_to_num(each, nan=np.inf)) for each in squares)
        gain[row] += now - then
    return gain


def _fall(standing: Standing, first: int, second: int) -> float:
    """Compute the decrease of the sum of squares with two labels exchanged, in the linear model.

    Without the lengths A that end at one of them it decreases by v^T Q^-1 v, with Q = I - A S A^T
    and S the inverse of the normal matrix; between the other labels, with derivatives B, they add
    r^T (I + B S' B^T)^-1 r. S' = S + S A^T Q^-1 A S and the residuals r are those without them.

    Parameters
    ----------
    standing
        The survey under diagnosis.
    first, second
        Labels of the survey.
    """
    survey, at = standing.survey, labels_of(standing)
    touched = _touch(survey.line_start, first, second) ^ _touch(survey.line_end, first, second)
    known = (at[survey.line_start] >= 0) & (at[survey.line_end] >= 0)
    used = np.zeros(len(known), dtype=np.bool_)
    used[standing.refined.line_index[standing.adjustment.problem.line_index]] = True
    old, new = np.flatnonzero(touched & used), np.flatnonzero(touched & known)
    if not len(new):
        return 0.0
    ends = survey.line_start, survey.line_end
    a, v = _rows(standing, old, at[ends[0][old]], at[ends[1][old]])
    pair = np.array(first), np.array(second)
    # Derivatives of the old lengths (a) and of the exchanged ones (b).
    b, r = _rows(standing, new, *(at[_exchanged(each[new], *pair)] for each in ends))
    solved = standing.adjustment.minimum.factor.solve(np.concatenate([a, b]).T)
    to_a, to_b = solved[:, : len(old)], solved[:, len(old) :]
    # Q^-1; then residuals r and covariance B S' B^T of the exchanged lengths without the old ones.
    without = np.linalg.pinv(np.eye(len(old)) - a @ to_a, rcond=1e-6, hermitian=True)
    moved = r + b @ to_a @ without @ v
    spread = b @ to_b + b @ to_a @ without @ (a @ to_b)
    added = moved @ np.linalg.solve(np.eye(len(new)) + spread, moved)
    return float(v @ without @ v - added)


def _rows(standing: Standing, line: Ints, start: Ints, end: Ints) -> tuple[Floats, Floats]:
    """Compute derivatives (n, size) and residuals (n,) of lengths between labels, whitened.

    Parameters
    ----------
    standing
        The survey under diagnosis.
    line
        (n,) lengths of the survey.
    start, end
        (n,) labels of the adjustment.
    """
    problem, state = standing.adjustment.problem, standing.adjustment.state
    length, gradient, columns = problem.lengths_between(state, start, end)
    sigma = standing.survey.length_sigma_m[line]
    dense = np.zeros((len(line), problem.layout.size))
    np.add.at(dense, (np.arange(len(line))[:, None], columns), gradient / sigma[:, None])
    return dense, (length - standing.survey.length_m[line]) / sigma


def _exchanged(label: int | Ints, first: Ints, second: Ints) -> Ints:
    """Return the label (n,) that replaces a label where each pair of labels is exchanged."""
    return np.asarray(np.where(first == label, second, np.where(second == label, first, label)))


def _swapped(
    standing: Standing, labels: tuple[int, int], lines: Ints, _: Explained | None
) -> Message:
    """Report two labels that are exchanged in all photos.

    Parameters
    ----------
    standing, labels
        The survey, and two of its labels.
    lines
        Lengths that did not fit before the exchange, but do afterwards.
    """
    survey = standing.survey
    first, second = (survey.label[k] for k in labels)
    frames = np.unique(survey.pick_frame[np.isin(survey.pick_label, labels)])
    names = tuple(survey.line_name[k] for k in lines if survey.line_name)
    which = f" ({', '.join(map(repr, names))})" if names else ""
    one = len(lines) == 1
    alone = f", or the length{which} is between other points" if one else ""
    fit = f"{'The length' if one else f'{len(lines)} lengths'}{which} {'fits' if one else 'fit'}"
    return Message(
        "warning",
        "labels-swapped-everywhere",
        f"The labels {first!r} and {second!r} seem to be swapped in all photos{alone}: look which "
        f"point is which, and swap the labels everywhere. {fit} then.",
        frames=tuple(survey.frame_id[k] for k in frames),
        labels=(first, second),
        lengths=names,
        several=MessagePlural(
            "{count} pairs of labels seem to be swapped in all photos",
            f"{first!r} and {second!r}",
            ending="Look which point is which, and swap the labels everywhere.",
        ),
    )
