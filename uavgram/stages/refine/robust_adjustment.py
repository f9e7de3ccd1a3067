"""Adjust without the frames, or the lengths, that take all others with them, and name them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause, Refined
from uavgram.stages.refine.blunders.consensus import contradicting
from uavgram.stages.refine.blunders.gross_picks import without_gross_picks
from uavgram.stages.refine.blunders.misfit import (
    GAIN,
    MOST_TRIED,
    TRIAL,
    culprit,
    ends_among,
    gross,
    is_settled,
    misfit,
    suspects,
    trial_adjustment,
)
from uavgram.stages.refine.blunders.wrong_lengths import without_wrong_lengths
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.off_ground.heights import (
    found_free,
    labels_off_ground,
    with_free,
    with_heights_freed,
)

MOST_MISPLACED = 3
"""One frame in so many may be left out because it shows something else than the others."""

MISPLACED = LeftOut(
    LeftOutCause.MISPLACED_FRAME,
    "its picks contradict all that the other frames, the lengths and the log say, and without them "
    "the rest agrees: look for labels in disorder, or a photo of another place",
)


def adjust_survey(taking: Participants, *, heights_sought: bool = False) -> Refined:
    """`best_minima` of what takes part, without frames that contradict the others.

    `pick_reason` of the result says which, and why. Of a frame of which most picks agree with the
    others, only the rest is left out. Of lengths without a log, those that all else rules out are
    left out too: `line_removed` of the result has them.

    Parameters
    ----------
    taking
        What takes part.
    heights_sought
        Whether labels that do not lie on the ground are looked for (see `heights.py`); where what
        is found leads nowhere, all stay on it.
    """
    if heights_sought:
        with suppress(GeometryError):
            return _adjusted(taking, heights_sought=True)
    return _adjusted(taking, heights_sought=False)


def _adjusted(taking: Participants, *, heights_sought: bool) -> Refined:
    refined, failed, stated, searched = None, None, taking.survey, 0
    try:
        refined = _begun(taking)
        searched = len(refined.pick_index)
        if heights_sought:
            refined, taking = _with_heights(taking, refined, [])
        refined, taking = without_gross_picks(taking, refined)
    except GeometryError as why:
        failed = why
    single = without_wrong_lengths(taking, refined, 1)
    if single is not None:
        refined, taking = single, replace(taking, line_removed=single.line_removed)
    refined, left = _without_misplaced(taking, refined)
    pair = without_wrong_lengths(taking, refined, 2)
    if pair is not None:
        return pair
    if refined is None:
        assert failed is not None  # noqa: S101  (one of the two is always there)
        raise failed
    if heights_sought and len(refined.pick_index) != searched:  # what was left out hid them
        refined, left = _with_heights(left, refined, found_free(stated, refined))
    return refined if refined.adjustment.minimum.converged else best_minima(left)


def _with_heights(
    taking: Participants, refined: Refined, before: list[str]
) -> tuple[Refined, Participants]:
    """The result with free heights of labels that do not lie on the ground, and what takes part.

    Parameters
    ----------
    taking
        What takes part.
    refined
        Its result.
    before
        Labels whose heights it has free, though nobody said so.
    """
    found = labels_off_ground(refined.adjustment, before)
    if found is None:
        return refined, taking
    taking = replace(taking, survey=with_free(taking.survey, found.labels, before))
    return with_heights_freed(refined, found, before) or _begun(taking), taking


def _without_misplaced(
    taking: Participants, refined: Refined | None
) -> tuple[Refined | None, Participants]:
    """The result without frames that show something else, and what then takes part."""
    survey = taking.survey
    left = len(np.unique(survey.pick_frame[taking.keep])) // MOST_MISPLACED
    while True:
        better = _without_culprits(taking, refined, left)
        if better is None:
            return refined, taking
        frames, rest = better
        left -= len(frames)
        out: dict[int, LeftOut] = {}
        entire = True
        for frame in frames:
            picks = np.flatnonzero((survey.pick_frame == frame) & taking.keep)
            # A few wrong labels do not condemn a frame of which the others agree.
            wrong = contradicting(survey, picks, rest)
            out |= wrong or dict.fromkeys(picks.tolist(), MISPLACED)
            entire &= not wrong
        taking = taking.without_picks(out)
        refined = rest if entire else _begun(taking)


def _begun(taking: Participants) -> Refined:
    """`best_minima`, cut short where a frame fits so badly that it would lead nowhere."""
    refined = best_minima(taking, TRIAL)
    if refined.adjustment.minimum.converged or gross(refined.adjustment):
        return refined
    return best_minima(taking)


def _without_culprits(
    taking: Participants, refined: Refined | None, most: int
) -> tuple[list[int], Refined] | None:
    """The frames, at most `most`, that spoil the adjustment, and the result without them.

    Parameters
    ----------
    taking
        What takes part.
    refined
        With all frames; None where nothing could be adjusted.
    most
        Frames that may be left out.

    Returns
    -------
    None where no frame stands out. Two bad frames hide each other: where no single one stands out,
    the best is set aside and the search goes on, and both count if the rest is then in order.
    """
    if most < 1:
        return None
    tried: list[tuple[int, Participants, Refined]] = []
    costs: list[float] = []
    suspected = _suspected(taking, refined)
    for frame in suspected:
        without = taking.without_frame(frame, MISPLACED)
        rest = trial_adjustment(without)
        if rest is not None:
            tried.append((frame, without, rest))
            costs.append(misfit(rest, without))
    if not tried or len(suspected) < 2:
        return None
    failures = len(suspected) - len(tried)
    found = culprit(misfit(refined, taking), np.array(costs + failures * [np.inf]))
    if found is not None:
        frame, _, rest = tried[found]
        return None if _one_length(taking, frame, costs[found]) else ([frame], rest)
    frame, without, rest = tried[int(np.argmin(costs))]
    more = _without_culprits(without, rest, most - 1)
    if more is None or not is_settled(more[1]):
        return None
    return [frame, *more[0]], more[1]


def _one_length(taking: Participants, frame: int, without: float) -> bool:
    """Whether a length less, of those that no other frame shows, serves as well as a frame less."""
    survey = taking.survey
    mine = survey.pick_frame == frame
    shown, elsewhere = (
        ends_among(survey, survey.pick_label[picks & taking.keep]) for picks in (mine, ~mine)
    )
    lines = np.flatnonzero(shown & ~elsewhere & ~taking.line_removed)[:MOST_TRIED].tolist()
    trials = (trial_adjustment(taking.without_lines([line])) for line in lines)
    return any(misfit(rest, taking) < GAIN * without for rest in trials)


def _suspected(taking: Participants, refined: Refined | None) -> list[int]:
    """Frames of the survey to leave out in turn."""
    survey = taking.survey
    if refined is None:
        picks = np.bincount(survey.pick_frame[taking.keep], minlength=len(survey.frame_id))
        present = np.flatnonzero(picks)
        return present[:MOST_TRIED].tolist() if len(present) > 2 else []
    names = refined.adjustment.survey.frame_id
    return [survey.frame_id.index(names[k]) for k in suspects(refined.adjustment)]
