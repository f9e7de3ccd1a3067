"""Hypotheses on two labels that are swapped: in all photos by lengths, in one by another photo.

Where an adjustment does not converge, or left a photo out, its points are useless. Two photos of a
plane still differ by a homography: with two labels swapped no homography fits, and of all exchanges
the right one makes it fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.estimation.reliability.redundancy import compute_core_fit, compute_reductions
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    find_usable_picks,
)
from uavgram.stages.refine.causes.other_poses import (
    compute_decreases,
    find_picks_of_photo,
    needs_other_poses,
)
from uavgram.stages.refine.causes.stray_picks import labels_of
from uavgram.stages.refine.causes.wrong_picks import swapped_message

WRONG_DECREASE = 16.0
"""Decrease of the sum of squares without a length, above which its ends are examined."""

DISTORTED_SHARE = 0.03
"""Relative error of distances in a survey distorted by lengths between wrong labels."""

MAX_PAIRS = 3
"""Pairs of labels that are proposed: those of largest gain with the points as adjusted."""


def propose_swapped_everywhere(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose pairs of labels that are swapped in all photos, so that lengths fit better."""
    survey = diagnosis.survey
    spoilt = frozenset(np.flatnonzero(diagnosis.spoilt).tolist())
    labels = len(diagnosis.adjustment.survey.label)
    wrong = _mark_wrong_lengths(diagnosis)
    if by_other_poses := needs_other_poses(diagnosis):
        ranked = _rank_by_other_poses(diagnosis)
    else:
        ranked = _rank_by_places(diagnosis, np.flatnonzero(wrong))
    for (a, b), promise in ranked:
        touched = _touch(survey.line_start, a, b) ^ _touch(survey.line_end, a, b)
        lines = np.flatnonzero(touched & (wrong | by_other_poses))
        yield Hypothesis(
            message=partial(_swapped_everywhere_message, diagnosis, (a, b), lines),
            mend=_exchange(survey, a, b),
            # A single length between wrong labels explains as much if no other ends at either.
            is_clear=touched.sum() > 1,
            is_of_all=by_other_poses,
            back=spoilt,  # lengths between wrong labels distort everything, including whole photos
            promise=promise,
            price=float(np.log(labels * (labels - 1) / 2.0)),
            settles=frozenset(survey.line_name[k] for k in lines if survey.line_name),
        )


def propose_swapped_pair(diagnosis: Diagnosis, names: tuple[str, ...]) -> Iterator[Hypothesis]:
    """Propose that two labels, by name, are swapped in all photos."""
    survey, labels = diagnosis.survey, len(diagnosis.survey.label)
    a, b = (survey.label.index(name) for name in names)
    yield Hypothesis(
        message=partial(_swapped_everywhere_message, diagnosis, (a, b), np.zeros(0, np.int64)),
        mend=_exchange(survey, a, b),
        is_of_all=True,
        promise=diagnosis.cost,  # upper limit
        price=float(np.log(labels * (labels - 1) / 2.0)),
    )


def propose_label_of_control(diagnosis: Diagnosis, names: tuple[str, str]) -> Iterator[Hypothesis]:
    """Propose that a control point has the label of another point in the list of control points.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    names
        Label of the control point as stated, and that of the point at its coordinates.
    """
    survey = diagnosis.survey
    stated, right = (survey.label.index(name) for name in names)
    if right in survey.control_label:
        return  # it has coordinates of its own
    (row,) = np.flatnonzero(survey.control_label == stated).tolist()
    yield Hypothesis(
        message=partial(_label_of_control_message, names),
        mend=SurveyCorrection(label_of_control={row: right}),
        is_of_all=True,
        promise=diagnosis.cost,  # upper limit
        price=float(np.log(len(survey.label) - 1)),
    )


def _label_of_control_message(names: tuple[str, str], _: HypothesisTest | None) -> Message:
    """Report a control point with the label of another point."""
    stated, right = names
    return Message(
        "warning",
        "control-label-wrong",
        f"The control point {stated!r} seems to be the point {right!r}: everything fits if its "
        f"coordinates are those of {right!r}. Look at both points in the photos; then correct the "
        "label in the list of control points.",
        labels=names,
        several=MessagePlural(
            "{count} control points seem to have the labels of other points",
            f"{stated!r} seems to be {right!r}",
            ending="Look at these points in the photos; then correct the labels in the list of "
            "control points.",
        ),
    )


def _rank_by_places(diagnosis: Diagnosis, wrong: Ints) -> list[tuple[tuple[int, int], float]]:
    """List pairs of labels whose exchange lets lengths fit between the points as adjusted.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    wrong
        Lengths that were left out, or do not fit.

    Returns
    -------
    The best pairs, and the expected decrease of the sum of squares.
    """
    survey = diagnosis.survey
    ends = np.union1d(survey.line_start[wrong], survey.line_end[wrong])
    ends = ends[labels_of(diagnosis)[ends] >= 0]
    if not len(ends):
        return []
    first, second, better = _gains(diagnosis, ends)
    best = np.argsort(-better, kind="stable")[:MAX_PAIRS]
    # Left-out lengths do not distort the points, so their places as adjusted are sufficient;
    # a decrease above the whole cost means that the linear model does not hold.
    none_left_out = (
        diagnosis.adjustment.minimum.converged and not diagnosis.refined.line_removed.any()
    )
    cost = diagnosis.adjustment.minimum.cost
    pairs = zip(first[best].tolist(), second[best].tolist(), strict=True)
    return [
        (pair, max(min(_fall(diagnosis, *pair), cost), 0.0 if none_left_out else easier))
        for pair, easier in zip(pairs, better[best].tolist(), strict=True)
    ]


def _rank_by_other_poses(diagnosis: Diagnosis) -> list[tuple[tuple[int, int], float]]:
    """List pairs of labels whose exchange lets lengths and control of a photo fit in some pose.

    Returns
    -------
    The best pairs, and the expected decrease of the sum of squares.
    """
    survey, picks = diagnosis.survey, find_picks_of_photo(diagnosis)
    shown = np.unique(survey.pick_label[picks])
    known = np.concatenate([survey.line_start, survey.line_end, survey.control_label])
    ends = np.intersect1d(shown, known)
    if not len(ends) or len(shown) > MAX_LABELS:
        return []
    pairs = [(int(a), int(b)) for a in ends for b in shown if a < b or b not in ends]
    decrease = compute_decreases(diagnosis, picks, [_exchange(survey, *pair) for pair in pairs])
    best = np.argsort(-decrease, kind="stable")[:MAX_PAIRS]
    return [(pairs[k], float(decrease[k])) for k in best if decrease[k] > 0.0]


def _exchange(survey: Survey, a: int, b: int) -> SurveyCorrection:
    """Exchange two labels in all photos."""
    right = {int(k): b for k in np.flatnonzero(survey.pick_label == a)}
    right |= {int(k): a for k in np.flatnonzero(survey.pick_label == b)}
    return SurveyCorrection(label_of_pick=right)


def _mark_wrong_lengths(diagnosis: Diagnosis) -> Bools:
    """Mark lengths (L,) that were left out, or do not fit."""
    wrong = diagnosis.refined.line_removed.copy()
    adjustment = diagnosis.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is not None:
        row = diagnosis.refined.line_index[adjustment.problem.line_index]
        wrong[row[compute_reductions(block, adjustment.covariance) > WRONG_DECREASE]] = True
    return wrong


def _touch(end: Ints, a: int, b: int) -> Bools:
    return np.asarray((end == a) | (end == b))


def _gains(diagnosis: Diagnosis, ends: Ints) -> tuple[Ints, Ints, Floats]:
    """Pair some ends with all labels; return the pairs (n,), (n,) and their gains (n,)."""
    known = np.flatnonzero(labels_of(diagnosis) >= 0)
    first, second = (each.ravel() for each in np.meshgrid(ends, known, indexing="ij"))
    use = (first < second) | ((first > second) & ~np.isin(second, ends))
    first, second = first[use], second[use]
    return first, second, _gain_of(diagnosis, first, second)


def _gain_of(diagnosis: Diagnosis, first: Ints, second: Ints) -> Floats:
    """Compute the better fit (n,) of the lengths with two labels exchanged, points as adjusted.

    The logarithm prevents one length of large misfit from outweighing several others.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    first, second
        (n,) labels of the survey.
    """
    survey, at = diagnosis.survey, labels_of(diagnosis)
    place = diagnosis.adjustment.points_with_jacobian(at[at >= 0])[0]
    world = np.full((len(at), 3), np.nan)
    world[at >= 0] = place
    gain = np.zeros(len(first))
    for line, (start, end) in enumerate(zip(survey.line_start, survey.line_end, strict=True)):
        if at[start] < 0 or at[end] < 0:
            continue  # it takes no part, so its fit is unknown
        row = np.flatnonzero(np.isin(first, (start, end)) | np.isin(second, (start, end)))
        swapped = [_exchange_labels(label, first[row], second[row]) for label in (start, end)]
        apart = [np.linalg.norm(world[a] - world[b], axis=-1) for a, b in ((start, end), swapped)]
        sigma = np.hypot(survey.length_sigma_m[line], DISTORTED_SHARE * survey.length_m[line])
        squares = [((each - survey.length_m[line]) / sigma) ** 2 for each in apart]
        now, then = (np.log1p(np.nan_to_num(each, nan=np.inf)) for each in squares)
        gain[row] += now - then
    return gain


def _fall(diagnosis: Diagnosis, first: int, second: int) -> float:
    """Compute the decrease of the sum of squares with two labels exchanged, in the linear model.

    Without the lengths A that end at one of them it decreases by v^T Q^-1 v, with Q = I - A S A^T
    and S the inverse of the normal matrix; between the other labels, with derivatives B, they add
    r^T (I + B S' B^T)^-1 r. S' = S + S A^T Q^-1 A S and the residuals r are those without them.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    first, second
        Labels of the survey.
    """
    survey, at = diagnosis.survey, labels_of(diagnosis)
    touched = _touch(survey.line_start, first, second) ^ _touch(survey.line_end, first, second)
    known = (at[survey.line_start] >= 0) & (at[survey.line_end] >= 0)
    used = np.zeros(len(known), dtype=np.bool_)
    used[diagnosis.refined.line_index[diagnosis.adjustment.problem.line_index]] = True
    old, new = np.flatnonzero(touched & used), np.flatnonzero(touched & known)
    if not len(new):
        return 0.0
    ends = survey.line_start, survey.line_end
    a, v = _rows(diagnosis, old, at[ends[0][old]], at[ends[1][old]])
    pair = np.array(first), np.array(second)
    # Derivatives of the old lengths (a) and of the exchanged ones (b).
    b, r = _rows(diagnosis, new, *(at[_exchange_labels(each[new], *pair)] for each in ends))
    solved = diagnosis.adjustment.minimum.factor.solve(np.concatenate([a, b]).T)
    to_a, to_b = solved[:, : len(old)], solved[:, len(old) :]
    # Q^-1; then residuals r and covariance B S' B^T of the exchanged lengths without the old ones.
    without = np.linalg.pinv(np.eye(len(old)) - a @ to_a, rcond=1e-6, hermitian=True)
    moved = r + b @ to_a @ without @ v
    spread = b @ to_b + b @ to_a @ without @ (a @ to_b)
    added = moved @ np.linalg.solve(np.eye(len(new)) + spread, moved)
    return float(v @ without @ v - added)


def _rows(diagnosis: Diagnosis, line: Ints, start: Ints, end: Ints) -> tuple[Floats, Floats]:
    """Compute derivatives (n, size) and residuals (n,) of lengths between labels, whitened.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    line
        (n,) lengths of the survey.
    start, end
        (n,) labels of the adjustment.
    """
    problem, state = diagnosis.adjustment.problem, diagnosis.adjustment.state
    length, gradient, columns = problem.lengths_between(state, start, end)
    sigma = diagnosis.survey.length_sigma_m[line]
    dense = np.zeros((len(line), problem.layout.size))
    np.add.at(dense, (np.arange(len(line))[:, None], columns), gradient / sigma[:, None])
    return dense, (length - diagnosis.survey.length_m[line]) / sigma


def _exchange_labels(label: int | Ints, first: int | Ints, second: int | Ints) -> Ints:
    """Return the label (n,) that replaces a label where each pair of labels is exchanged."""
    return np.asarray(np.where(first == label, second, np.where(second == label, first, label)))


def _swapped_everywhere_message(
    diagnosis: Diagnosis, labels: tuple[int, int], lines: Ints, _: HypothesisTest | None
) -> Message:
    """Report two labels that are exchanged in all photos.

    Parameters
    ----------
    diagnosis, labels
        The survey, and two of its labels.
    lines
        Lengths that did not fit before the exchange, but do afterwards.
    """
    survey = diagnosis.survey
    first, second = (survey.label[k] for k in labels)
    frames = np.unique(survey.pick_frame[np.isin(survey.pick_label, labels)])
    names = tuple(survey.line_name[k] for k in lines if survey.line_name)
    which = f" ({', '.join(map(repr, names))})" if names else ""
    one = len(lines) == 1
    alone = f", or the length{which} is between other points" if one else ""
    these = "everything else" if not len(lines) else f"{len(lines)} lengths"
    fit = f"{'The length' if one else these}{which} {'fit' if len(lines) > 1 else 'fits'}"
    is_only = len(survey.frame_id) == 1
    where = f"in {survey.frame_id[0]!r}" if is_only else "in all photos"
    there = "there" if is_only else "everywhere"
    return Message(
        "warning",
        "labels-swapped-everywhere",
        f"The labels {first!r} and {second!r} seem to be swapped {where}{alone}: look which point "
        f"is which, and swap the labels {there}. {fit[:1].upper()}{fit[1:]} then.",
        frames=tuple(survey.frame_id[k] for k in frames),
        labels=(first, second),
        lengths=names,
        plain=f"{first} and {second} seem swapped." if is_only else "",
        several=MessagePlural(
            "{count} pairs of labels seem to be swapped in all photos",
            f"{first!r} and {second!r}",
            ending="Look which point is which, and swap the labels everywhere.",
        ),
    )


MIN_LABELS = 6
"""Labels needed in both photos: a homography takes four, and five fit after more than one
exchange."""

MAX_LABELS, MAX_PHOTOS = 30, 12
"""Largest number of labels of which all pairs are tried; and of photos that are examined."""

MIN_PICKS_PER_LEFT_OUT = 4
"""A photo is in question where more than one in so many of its picks was left out."""

MISFIT_PROBABILITY = 1e-5
"""Probability of the core's squares below which every photo is in question."""

MAX_MISFIT_RATIO = 0.1
"""Largest ratio of the squares after an exchange to those before it."""


def propose_swapped_by_two_views(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose two labels of a photo whose exchange makes it fit another photo."""
    survey = diagnosis.survey
    may = find_usable_picks(diagnosis.taking) & ~survey.off_ground[survey.pick_label]
    photos = [np.flatnonzero(may & (survey.pick_frame == k)) for k in range(len(survey.frame_id))]
    for frame in _find_photos(diagnosis)[:MAX_PHOTOS]:
        here, there = _find_shared_picks(diagnosis, photos, frame)
        pair = _find_exchange(diagnosis, here, there)
        if pair is None:
            continue
        label, count = survey.pick_label, len(here)
        right = {pair[0]: int(label[pair[1]]), pair[1]: int(label[pair[0]])}
        choices = float(np.log(count * (count - 1) / 2) + np.log(len(survey.frame_id)))
        yield Hypothesis(
            message=partial(swapped_message, diagnosis, right),
            # With it all picks of the photo take part again.
            mend=SurveyCorrection(label_of_pick={int(k): int(label[k]) for k in here} | right),
            promise=diagnosis.cost,  # everything should fit then
            price=choices - GROSS_ERROR_LOG_ODDS * _count_regained(diagnosis, here),
            settles=frozenset([survey.frame_id[frame]]),
        )


def _count_regained(diagnosis: Diagnosis, here: Ints) -> int:
    """Count left-out numbers that fit at their places, less those that fix the photo's pose."""
    label, used = diagnosis.survey.pick_label, diagnosis.refined.pick_index
    lost = np.setdiff1d(here, used[~diagnosis.spoilt[used]])
    lost = lost[~diagnosis.spoilt[lost]]  # the others are known to be wrong
    seen = int(np.isin(label[lost], label[used]).sum())
    pose = 6 if len(lost) == len(here) else 0
    return max(2 * seen - pose, 0)


def _find_photos(diagnosis: Diagnosis) -> list[int]:
    """Return photos that lost many of their picks for any reason; all, where nothing fits."""
    survey, adjustment = diagnosis.survey, diagnosis.adjustment
    few = len(survey.frame_id) <= MAX_PHOTOS  # with many, the others determine the points
    if not adjustment.minimum.converged or (
        few and compute_core_fit(adjustment).probability < MISFIT_PROBABILITY
    ):
        return list(range(len(survey.frame_id)))
    used = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    used[diagnosis.refined.pick_index] = True
    every, out = (
        np.bincount(survey.pick_frame[some], minlength=len(survey.frame_id))
        for some in (slice(None), ~used)
    )
    return np.flatnonzero((every >= MIN_LABELS) & (MIN_PICKS_PER_LEFT_OUT * out > every)).tolist()


def _find_shared_picks(diagnosis: Diagnosis, photos: list[Ints], frame: int) -> tuple[Ints, Ints]:
    """Return picks (n,) of a photo, and those of the same labels in the photo that shares most."""
    label = diagnosis.survey.pick_label
    best: tuple[Ints, Ints] = (np.zeros(0, np.int64), np.zeros(0, np.int64))
    for other, picks in enumerate(photos):
        if other == frame:
            continue
        _, mine, theirs = np.intersect1d(label[photos[frame]], label[picks], return_indices=True)
        if len(mine) > len(best[0]):
            best = photos[frame][mine], picks[theirs]
    return best


def _find_exchange(diagnosis: Diagnosis, here: Ints, there: Ints) -> tuple[int, int] | None:
    """Find the exchange of two picks of a photo that makes it fit another; None without one."""
    count = len(here)
    if not MIN_LABELS <= count <= MAX_LABELS:
        return None
    camera, survey = diagnosis.survey.calibration, diagnosis.survey
    rays = [
        back_project(camera.model, camera.parameters, survey.pixel_px[k]) for k in (here, there)
    ]
    if not all(np.isfinite(ray).all() for ray in rays):
        return None
    x, y = (_normalise(ray[:, :2]) for ray in rays)
    # All exchanges of two picks, and the original order at the end.
    first, second = np.triu_indices(count, 1)
    order = np.tile(np.arange(count), (len(first) + 1, 1))  # the last: as they are
    rows = np.arange(len(first))
    order[rows, first], order[rows, second] = second, first
    squares = _misfit(x[order], y)
    best = int(np.argmin(squares[:-1]))
    if not squares[best] < MAX_MISFIT_RATIO * squares[-1]:
        return None
    return int(here[first[best]]), int(here[second[best]])


def _normalise(point: Floats) -> Floats:
    """Centre points (n, 2) and scale them to a mean distance of sqrt(2) (Hartley 1997)."""
    away = point - point.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum(away**2, axis=1)) / 2.0))
    scaled: Floats = away / max(size, np.finfo(float).tiny)
    return scaled


def _misfit(x: Floats, y: Floats) -> Floats:
    """Compute algebraic squares (S,) of the best homographies from points (S, n, 2) to (n, 2).

    Direct linear transformation (Hartley and Zisserman 2004, algorithm 4.1).
    """
    one = np.concatenate([x, np.ones((*x.shape[:2], 1))], axis=2)
    zero = np.zeros_like(one)
    u, v = y[:, :1], y[:, 1:]
    rows = np.concatenate(
        [
            np.concatenate([one, zero, -u * one], axis=2),
            np.concatenate([zero, one, -v * one], axis=2),
        ],
        axis=1,
    )
    smallest: Floats = np.linalg.svd(rows, compute_uv=False)[:, -1]
    return np.asarray(smallest**2, dtype=np.float64)
