"""Refine poses, points and shared unknowns in one maximum-likelihood adjustment.

The steps of `refine`:

1. Test tie points and matches against each other (`tie_outliers.py`).
2. Adjust at the stated noise: remove gross errors by a robust adjustment (`gross_errors.py`), and
   look for their causes (`causes/`).
3. With ``outliers: remove``: correct the causes, such as swapped labels, and adjust again.
4. With ``noise: estimate``: learn the noise from the residuals (`noise.py`).
5. Remove further outliers at the learnt noise: with ``remove`` by data snooping
   (`blunder_removal.py`), with ``report`` by a second robust adjustment.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined, Removal, explain
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Cause, Survey
from uavgram.model.work import report_work
from uavgram.stages.refine.at_stated_noise import adjust_at_stated_noise, find_participants
from uavgram.stages.refine.blunder_removal import MAX_REMOVED_SHARE, find_blunder
from uavgram.stages.refine.causes.common_length_errors import (
    drop_insignificant_errors,
    report_possible_errors,
)
from uavgram.stages.refine.causes.correction import apply_corrections
from uavgram.stages.refine.causes.mirrored_photos import (
    PRIOR_LOG_ODDS,
    find_mirrored_solution,
    report_mirror_image,
)
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.impossible_heights import (
    correct_impossible_heights,
    report_impossible_heights,
)
from uavgram.stages.refine.left_out import add_records, report_poses_left_out
from uavgram.stages.refine.minima import find_best_minima
from uavgram.stages.refine.misspelt_labels import report_misspelt_labels
from uavgram.stages.refine.noise import estimate_noise, report_noise
from uavgram.stages.refine.off_ground import report_off_ground
from uavgram.stages.refine.remarks import (
    indispensable_message,
    not_located_message,
    report_learnt,
    report_refinement,
    too_many_message,
)
from uavgram.stages.refine.rolling_shutter import add_motion_by_photos, correct_readout
from uavgram.stages.refine.tie_outliers import (
    add_noise_of_ties,
    remove_wrong_ties,
    report_ties,
)
from uavgram.stages.refine.tied_frames import add_tied_frames

MAX_CORRECTIONS = 24
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
    given = survey
    survey, above = correct_impossible_heights(given)
    stated, far_off = add_tied_frames(survey)
    stated = add_motion_by_photos(stated)
    sound = remove_wrong_ties(stated, learn=options.noise == "estimate")
    sound = replace(sound, ties_left_out=sound.ties_left_out | far_off)
    tied, shown = tuple(report_ties(survey, sound)), sound.shown.off_ground
    removed = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    # Adjust at the stated noise, correct one cause after the other, and readjust.
    report_work("adjust, and look for wrong picks and lengths")
    begun = adjust_at_stated_noise(sound.survey, removed, options, shown)
    mends: tuple[Removal, ...] = ()
    while options.outliers == "remove" and len(mends) < MAX_CORRECTIONS:
        mended = apply_corrections(begun.given, begun.causes, begun.refined)
        if not mended.removals:
            break
        mends += mended.removals
        begun = adjust_at_stated_noise(
            mended.survey, begun.refined.pick_removed | mended.without, options, shown
        )
    taken_out = begun.refined.pick_removed
    # Check the readout time, then learn the noise from the residuals.
    report_work("learn how exact the picks are, and adjust again")
    survey, refined, readout = correct_readout(begun.survey, begun.refined)
    if options.noise == "estimate":
        survey, refined = estimate_noise(survey, refined)
        refined = replace(refined, noise=add_noise_of_ties(refined.noise, stated, sound))
    noise, stated_fit, found_free = refined.noise, refined.stated, list(begun.off_ground)
    search: list[Message] = []
    if options.outliers == "remove":
        refined, search = _remove_blunders(survey, refined, options.significance)
    elif not begun.are_all_wrong:  # remove outliers at the learnt noise, too
        robust = adjust_robustly(find_participants(survey, refined), refined)
        found_free = [*found_free, *robust.labels]
        search += robust.messages(survey)
        survey, first = robust.survey, refined
        refined = replace(
            robust.refined,
            pick_removed=taken_out,
            left_out=tuple(dict.fromkeys((*first.left_out, *robust.refined.left_out))),
            rivals=tuple(
                {one.readings: one for one in (*first.rivals, *robust.refined.rivals)}.values()
            ),
        )
    causes = drop_insignificant_errors(begun.causes, refined.adjustment, noise)
    causes = tuple(_mention_left_out_lengths(one, survey, refined) for one in causes)
    named = {one.message.code for one in causes}
    forbidding = tuple(one for one in begun.forbidding if one[0] in named)
    refined = replace(refined, noise=noise, stated=stated_fit)
    refined = add_records(survey, refined)
    refined = replace(
        refined,
        off_ground=frozenset(found_free) | shown,
        causes=(*(one.cause for one in mends if one.cause), *causes),
        explanations=begun.explanations,
        forbidding=forbidding,
        removals=(*mends, *refined.removals),
        matches_left_out=sound.matches_left_out,
        pick_removed=refined.pick_removed | taken_out,
    )
    mirrored = None if "photos-mirrored" in named else find_mirrored_solution(refined.adjustment)
    if mirrored is not None:
        mirrored_explanation = explain(refined.adjustment, mirrored, -PRIOR_LOG_ODDS)
        refined = replace(refined, explanations=(*refined.explanations, (mirrored_explanation,)))
        search.append(report_mirror_image(refined.adjustment, mirrored))
    # Report a point off the ground once, with its adjusted height.
    messages = (
        *(one.message for one in causes if not _is_adjusted_so(one.message, refined)),
        *report_impossible_heights(given, refined, above),
        *(one for one in begun.messages if not _is_on_height_of(one, above)),
        *tied,
        *report_off_ground(refined),
        *readout,
        *report_noise(refined.noise),
        *report_learnt(refined.adjustment),
        *report_poses_left_out(refined),
        *report_misspelt_labels(survey, refined.adjustment),
    )
    if not any("lengths" in one.message.code for one in causes):
        search += report_possible_errors(refined.adjustment)
    return refined, (*messages, *report_refinement(survey, refined), *search)


def _mention_left_out_lengths(cause: Cause, survey: Survey, refined: Refined) -> Cause:
    """Add to the message on several lengths that they were left out, if all of them were."""
    message = cause.message
    used = {survey.line_name[k] for k in np.flatnonzero(~refined.line_removed) if survey.line_name}
    if len(message.lengths) < 2 or not used.isdisjoint(message.lengths):
        return cause
    text = f"{message.text} The results do without these lengths."
    return replace(cause, message=replace(message, text=text))


def _is_on_height_of(message: Message, names: Collection[str]) -> bool:
    """Return whether a message is on the stated height of one of some points."""
    return message.code == "height-left-out" and set(names).issuperset(message.labels)


def _is_adjusted_so(message: Message, refined: Refined) -> bool:
    """Return whether a message is on a point off the ground that has that height in the result."""
    return message.code == "point-off-ground" and refined.off_ground.issuperset(message.labels)


def _remove_blunders(
    survey: Survey, refined: Refined, significance: float
) -> tuple[Refined, list[Message]]:
    """Remove one blunder at a time and readjust, until none is left or none can be chosen."""
    most = int(
        MAX_REMOVED_SHARE * (len(survey.pick_frame) + len(survey.line_start) + len(survey.known))
    )
    while True:
        choice, undecided = find_blunder(refined, significance)
        if choice is None:
            return refined, [not_located_message(refined, suspicion) for suspicion in undecided]
        if len(refined.removals) >= most:
            return refined, [too_many_message(len(refined.removals))]
        try:
            after = _readjust_without(survey, refined, choice)
        except GeometryError as why:  # not determined without it: keep it
            return refined, [indispensable_message(refined, choice, why)]
        refined = replace(after, removals=(*refined.removals, choice))


def _readjust_without(survey: Survey, refined: Refined, choice: Removal) -> Refined:
    """Readjust without one more observation; those left out before stay out."""
    taking = find_participants(survey, refined)
    pick, line, known = (
        refined.pick_removed.copy(),
        refined.line_removed.copy(),
        taking.known_removed,
    )
    if choice.kind == "known":
        known |= {choice.index}
    else:
        (pick if choice.kind == "pick" else line)[choice.index] = True
    after = find_best_minima(
        replace(taking, keep=taking.keep & ~pick, line_removed=line, known_removed=known)
    )
    return replace(after, pick_removed=pick)
