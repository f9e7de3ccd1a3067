"""Adjust without the frames, or the lengths, that take all others with them, and name them."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.consensus import contradicting
from uavgram.stages.refine.blunders.gross_picks import without_gross_picks
from uavgram.stages.refine.blunders.misfit import GAIN, MOST_TRIED, culprit, gross, suspects
from uavgram.stages.refine.blunders.trial_adjustment import (
    ends_among,
    is_settled,
    misfit,
    trial_adjustment,
)
from uavgram.stages.refine.blunders.wrong_lengths import without_wrong_lengths
from uavgram.stages.refine.minima import best_minima

MOST_MISPLACED = 3
"""One frame in so many may be left out because it shows something else than the others."""

MISPLACED = (
    "its picks contradict all that the other frames, the lengths and the log say, and without them "
    "the rest agrees: look for labels in disorder, or a photo of another place"
)


def adjust_survey(
    survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]
) -> Refined:
    """`best_minima` of the picks in `keep`, without frames that contradict the others.

    `pick_reason` of the result says which, and why. Of a frame of which most picks agree with the
    others, only the rest is left out. Of lengths without a log, those that all else rules out are
    left out too: `line_removed` of the result has them.
    """
    refined = failed = None
    try:
        refined = _begun(survey, keep, line_removed, reason)
        refined, keep, reason = without_gross_picks(survey, keep, line_removed, reason, refined)
    except GeometryError as why:
        failed = why
    single = without_wrong_lengths(survey, keep, line_removed, reason, refined, 1)
    if single is not None:
        refined, line_removed = single, single.line_removed
    refined, kept, out = _without_misplaced(survey, keep, line_removed, reason, refined)
    pair = without_wrong_lengths(survey, keep, line_removed, reason, refined, 2)
    if pair is not None:
        return pair
    if refined is None:
        assert failed is not None  # noqa: S101  (one of the two is always there)
        raise failed
    if refined.adjustment.minimum.converged:
        return refined
    return best_minima(survey, kept, line_removed, out)


def _without_misplaced(
    survey: Survey,
    keep: Bools,
    line_removed: Bools,
    reason: dict[int, str],
    refined: Refined | None,
) -> tuple[Refined | None, Bools, dict[int, str]]:
    """The result without frames that show something else, the picks left, and why others are not.

    Parameters as for `_without_culprits`.
    """
    out = dict(reason)
    left = len(np.unique(survey.pick_frame[keep])) // MOST_MISPLACED
    while True:
        better = _without_culprits(survey, keep, line_removed, out, refined, left)
        if better is None:
            return refined, keep, out
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


def _begun(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """`best_minima`, cut short where a frame fits so badly that it would lead nowhere."""
    refined = trial_adjustment(survey, keep, line_removed, reason)
    if refined.adjustment.minimum.converged or gross(refined.adjustment):
        return refined
    return best_minima(survey, keep, line_removed, reason)


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
        As for `adjust_survey`.
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
            rest = trial_adjustment(survey, without, line_removed, why)
        except GeometryError:  # without this frame nothing is left to hold on to
            failures += 1
            continue
        tried.append((frame, rest))
        costs.append(misfit(rest, int(without.sum())))
    if not tried or len(tried) + failures < 2:
        return None
    before = np.inf if refined is None else misfit(refined, int(keep.sum()))
    found = culprit(before, np.array(costs + failures * [np.inf]))
    if found is not None:
        frame, rest = tried[found]
        spares = _one_length(survey, keep, line_removed, frame, costs[found])
        return None if spares else ([frame], rest)
    frame, rest = tried[int(np.argmin(costs))]
    without = keep & (survey.pick_frame != frame)
    why = reason | dict.fromkeys(np.flatnonzero(keep & ~without).tolist(), MISPLACED)
    more = _without_culprits(survey, without, line_removed, why, rest, most - 1)
    if more is None or not is_settled(more[1]):
        return None
    return [frame, *more[0]], more[1]


def _one_length(
    survey: Survey, keep: Bools, line_removed: Bools, frame: int, without: float
) -> bool:
    """Whether a length less, of those that no other frame shows, serves as well as a frame less."""
    mine, others = survey.pick_frame == frame, survey.pick_frame != frame
    shown, elsewhere = (ends_among(survey, survey.pick_label[p & keep]) for p in (mine, others))
    for line in np.flatnonzero(shown & ~elsewhere & ~line_removed)[:MOST_TRIED]:
        removed = line_removed.copy()
        removed[line] = True
        try:
            rest = trial_adjustment(survey, keep, removed, {})
        except GeometryError:
            continue
        if misfit(rest, int(keep.sum())) < GAIN * without:
            return True
    return False


def _suspected(survey: Survey, keep: Bools, refined: Refined | None) -> list[int]:
    """Frames of the survey to leave out in turn."""
    if refined is None:
        picks = np.bincount(survey.pick_frame[keep], minlength=len(survey.frame_id))
        present = np.flatnonzero(picks)
        return present[:MOST_TRIED].tolist() if len(present) > 2 else []
    names = refined.adjustment.survey.frame_id
    return [survey.frame_id.index(names[k]) for k in suspects(refined.adjustment)]
