"""Refine poses, points and shared unknowns in one maximum-likelihood adjustment.

The steps of `refine`:

1. Test tie points and matches against each other (`sound_ties.py`).
2. Adjust at the stated noise: remove gross errors by a robust adjustment (`robust.py`), and look
   for their causes (`causes/`).
3. With ``outliers: remove``: correct the causes, such as swapped labels, and adjust again.
4. With ``noise: estimate``: learn the noise from the residuals (`noise.py`).
5. Remove further outliers at the learnt noise: with ``remove`` by data snooping (`snooping.py`),
   with ``report`` by a second robust adjustment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.at_stated_noise import adjusted_as_stated, participants
from uavgram.stages.refine.begin.photo_motion import with_motion_by_photos
from uavgram.stages.refine.begin.tied_frames import with_tied_frames
from uavgram.stages.refine.causes.adapt import adapted
from uavgram.stages.refine.causes.lengths.common import open_questions
from uavgram.stages.refine.causes.photos.mirrored import mirrored_solution, undecided
from uavgram.stages.refine.learnt import learnt_remarks
from uavgram.stages.refine.left_out import with_records
from uavgram.stages.refine.minima import best_minima
from uavgram.stages.refine.noise import with_noise_learnt
from uavgram.stages.refine.noise_remarks import noise_remarks
from uavgram.stages.refine.off_ground.remarks import off_ground_remarks
from uavgram.stages.refine.readout import with_sound_readout
from uavgram.stages.refine.remarks import (
    indispensable,
    not_located,
    remarks,
    too_many,
)
from uavgram.stages.refine.robust import adjust_robustly
from uavgram.stages.refine.snooping import MOST, blunders
from uavgram.stages.refine.sound_ties import (
    remarks_on_ties,
    with_noise_of_ties,
    with_sound_ties,
)

MOST_MENDS = 24
"""Number of corrections after which a survey is in disorder, and no more are made."""


def refine(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
    """Adjust a survey.

    Parameters
    ----------
    survey
        Observations and priors.
    options
        Treatment of blunders. With ``remove``, identified mistakes are corrected (labels swapped
        back, a unit put right); then the observation with the largest standardised residual above
        the critical value is removed and everything is readjusted, one at a time, until none is
        left. With ``report`` all observations stay as they were written.

    Raises
    ------
    GeometryError
        The observations do not determine the survey; the message names the missing ones.
    """
    # First poses from ties; then remove wrong ties and matches.
    stated, far_off = with_tied_frames(survey)
    stated = with_motion_by_photos(stated)
    sound = with_sound_ties(stated, learn=options.noise == "estimate")
    sound = replace(sound, ties_left_out=sound.ties_left_out | far_off)
    tied, shown = tuple(remarks_on_ties(survey, sound)), sound.shown.off_ground
    removed = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    # Adjust at the stated noise, correct one cause after the other, and readjust.
    begun = adjusted_as_stated(sound.survey, removed, options, shown)
    mends: tuple[Removal, ...] = ()
    while options.outliers == "remove" and len(mends) < MOST_MENDS:
        mended = adapted(begun.given, begun.causes, begun.refined)
        if not mended.removals:
            break
        mends += mended.removals
        begun = adjusted_as_stated(
            mended.survey, begun.refined.pick_removed | mended.without, options, shown
        )
    taken_out = begun.refined.pick_removed
    # Check the readout time, then learn the noise from the residuals.
    survey, refined, readout = with_sound_readout(begun.survey, begun.refined)
    if options.noise == "estimate":
        survey, refined = with_noise_learnt(survey, refined)
        refined = replace(refined, noise=with_noise_of_ties(refined.noise, stated, sound))
    noise, stated_fit, found_free = refined.noise, refined.stated, list(begun.off_ground)
    search: list[Message] = []
    if options.outliers == "remove":
        refined, search = _without_blunders(survey, refined, options.significance)
    else:  # remove outliers at the learnt noise, too
        robust = adjust_robustly(participants(survey, refined), refined)
        found_free = [*found_free, *robust.labels]
        search += robust.messages(survey)
        survey = robust.survey
        refined = replace(robust.refined, pick_removed=taken_out)
    refined = replace(refined, noise=noise, stated=stated_fit)
    refined = with_records(survey, refined)
    refined = replace(
        refined,
        off_ground=frozenset(found_free) | shown,
        causes=(*(one.cause for one in mends if one.cause), *begun.causes),
        removals=(*mends, *refined.removals),
        matches_left_out=sound.matches_left_out,
        pick_removed=refined.pick_removed | taken_out,
    )
    mirrored = mirrored_solution(refined.adjustment)
    if mirrored is not None:
        refined = replace(refined, mirrored=mirrored)
        search.append(undecided())
    # Report a point off the ground once, with its adjusted height.
    causes = (one.message for one in begun.causes if not _is_adjusted_so(one.message, refined))
    told = (*causes, *begun.messages)
    told = (*told, *tied, *off_ground_remarks(refined), *readout, *noise_remarks(refined.noise))
    told = (*told, *learnt_remarks(refined.adjustment))
    if not any("lengths" in one.message.code for one in begun.causes):
        search += open_questions(refined.adjustment)
    return refined, (*told, *remarks(survey, refined), *search)


def _is_adjusted_so(message: Message, refined: Refined) -> bool:
    """Return whether a message is on a point off the ground that has that height in the result."""
    return message.code == "point-off-ground" and refined.off_ground.issuperset(message.labels)


def _without_blunders(
    survey: Survey, refined: Refined, significance: float
) -> tuple[Refined, list[Message]]:
    """Remove one blunder at a time and readjust, until none is left or none can be chosen."""
    most = int(MOST * (len(survey.pick_frame) + len(survey.line_start) + len(survey.known)))
    while True:
        choice, undecided = blunders(refined, significance)
        if choice is None:
            return refined, [not_located(refined, suspicion) for suspicion in undecided]
        if len(refined.removals) >= most:
            return refined, [too_many(len(refined.removals))]
        try:
            after = _adjusted_without(survey, refined, choice)
        except GeometryError as why:  # not determined without it: keep it
            return refined, [indispensable(refined, choice, why)]
        refined = replace(after, removals=(*refined.removals, choice))


def _adjusted_without(survey: Survey, refined: Refined, choice: Removal) -> Refined:
    """Readjust without one more observation; those left out before stay out."""
    taking = participants(survey, refined)
    pick, line, known = (
        refined.pick_removed.copy(),
        refined.line_removed.copy(),
        taking.known_removed,
    )
    if choice.kind == "known":
        known |= {choice.index}
    else:
        (pick if choice.kind == "pick" else line)[choice.index] = True
    after = best_minima(
        replace(taking, keep=taking.keep & ~pick, line_removed=line, known_removed=known)
    )
    return replace(after, pick_removed=pick)
