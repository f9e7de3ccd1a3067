"""Adjust without the frames that take all others with them, and name them."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Refined
from uavgram.model.arrays import Bools, Ints
from uavgram.model.survey import Survey
from uavgram.stages.refine.consensus import contradicting
from uavgram.stages.refine.minima import adjust_all
from uavgram.stages.refine.misfit import GAIN, GROSS, MOST_TRIED, culprit, gross, suspects

MOST_MISPLACED = 3
"""One frame in so many may be left out because it shows something else than the others."""

MISPLACED = (
    "its picks contradict all that the other frames, the lengths and the log say, and without them "
    "the rest agrees: look for labels in disorder, or a photo of another place"
)

TRIAL = 20
"""Iterations of an adjustment that only has to show whether what was left out was the trouble:
where it was, few are needed."""


def adjust(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """`adjust_all` of the picks in `keep`, without frames that show something else than the others.

    `pick_reason` of the result says which, and why. Of a frame of which most picks agree with the
    others, only the rest is left out.
    """
    out = dict(reason)
    refined = failed = None
    left = len(np.unique(survey.pick_frame[keep])) // MOST_MISPLACED
    while True:
        if refined is None:
            try:
                refined = _begun(survey, keep, line_removed, out)
            except GeometryError as why:
                failed = why
        better = _without_culprits(survey, keep, line_removed, out, refined, left)
        if better is None:
            break
        frames, rest = better
        left -= len(frames)
        entire = True
        for frame in frames:
            picks = np.flatnonzero((survey.pick_frame == frame) & keep)
            # A few wrong labels do not condemn a frame of which the others agree.
            wrong = contradicting(survey, picks, rest)
            out |= wrong or dict.fromkeys(picks.tolist(), MISPLACED)
            entire &= not wrong
        keep = keep.copy()
        keep[list(out)] = False
        refined = rest if entire else _begun(survey, keep, line_removed, out)
    if refined is None:
        assert failed is not None  # noqa: S101  (one of the two is always there)
        raise failed
    if refined.adjustment.minimum.converged:
        return refined
    return adjust_all(survey, keep, line_removed, out)


def _begun(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """`adjust_all`, cut short where a frame fits so badly that it would lead nowhere."""
    refined = attempt(survey, keep, line_removed, reason)
    if refined.adjustment.minimum.converged or gross(refined.adjustment):
        return refined
    return adjust_all(survey, keep, line_removed, reason)


def attempt(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """`adjust_all` cut short: to see what leaving something out does.

    In order (see `in_order`), it is the result of `adjust`.
    """
    return adjust_all(survey, keep, line_removed, reason, TRIAL)


def in_order(refined: Refined) -> bool:
    """Whether an adjustment came to rest, and no frame spoils it."""
    return refined.adjustment.minimum.converged and not len(suspects(refined.adjustment))


def _without_culprits(
    survey: Survey,
    keep: Bools,
    line_removed: Bools,
    reason: dict[int, str],
    refined: Refined | None,
    most: int,
) -> tuple[list[int], Refined] | None:
    """The frames, at most `most`, that spoil the adjustment, and the result without them.

    Parameters
    ----------
    survey, keep, line_removed, reason
        As for `adjust`.
    refined
        With all frames; None where nothing could be adjusted.

    Returns
    -------
    None where no frame stands out. Two bad frames hide each other: where no single one stands out,
    the best is set aside and the search goes on, and both count if the rest is then in order.
    """
    if most < 1:
        return None
    tried: list[tuple[int, Refined]] = []
    costs: list[float] = []
    failures = 0
    for frame in _suspected(survey, keep, refined):
        without = keep & (survey.pick_frame != frame)
        why = reason | dict.fromkeys(np.flatnonzero(keep & ~without).tolist(), MISPLACED)
        try:
            rest = attempt(survey, without, line_removed, why)
        except GeometryError:  # without this frame nothing is left to hold on to
            failures += 1
            continue
        tried.append((frame, rest))
        costs.append(_misfit(rest, int(without.sum())))
    if not tried or len(tried) + failures < 2:
        return None
    before = np.inf if refined is None else _misfit(refined, int(keep.sum()))
    found = culprit(before, np.array(costs + failures * [np.inf]))
    if found is not None:
        frame, rest = tried[found]
        spares = _one_length(survey, keep, line_removed, frame, costs[found])
        return None if spares else ([frame], rest)
    frame, rest = tried[int(np.argmin(costs))]
    without = keep & (survey.pick_frame != frame)
    why = reason | dict.fromkeys(np.flatnonzero(keep & ~without).tolist(), MISPLACED)
    more = _without_culprits(survey, without, line_removed, why, rest, most - 1)
    if more is None or not in_order(more[1]):
        return None
    return [frame, *more[0]], more[1]


def _one_length(
    survey: Survey, keep: Bools, line_removed: Bools, frame: int, without: float
) -> bool:
    """Whether a length less, of those that no other frame shows, serves as well as a frame less."""
    mine, others = survey.pick_frame == frame, survey.pick_frame != frame
    shown, elsewhere = (_ends_among(survey, survey.pick_label[p & keep]) for p in (mine, others))
    for line in np.flatnonzero(shown & ~elsewhere & ~line_removed)[:MOST_TRIED]:
        removed = line_removed.copy()
        removed[line] = True
        try:
            rest = attempt(survey, keep, removed, {})
        except GeometryError:
            continue
        if _misfit(rest, int(keep.sum())) < GAIN * without:
            return True
    return False


def _ends_among(survey: Survey, labels: Ints) -> Bools:
    """(L,) whether both ends of a line are among some labels."""
    return np.asarray(np.isin(survey.line_start, labels) & np.isin(survey.line_end, labels))


def _misfit(refined: Refined, picks: int) -> float:
    """Cost of an adjustment; a pick that it had to leave out counts as one that fits badly."""
    return refined.adjustment.minimum.cost + GROSS**2 * (picks - len(refined.pick_index))


def _suspected(survey: Survey, keep: Bools, refined: Refined | None) -> list[int]:
    """Frames of the survey to leave out in turn."""
    if refined is None:
        picks = np.bincount(survey.pick_frame[keep], minlength=len(survey.frame_id))
        present = np.flatnonzero(picks)
        return present[:MOST_TRIED].tolist() if len(present) > 2 else []
    names = refined.adjustment.survey.frame_id
    return [survey.frame_id.index(names[k]) for k in suspects(refined.adjustment)]
