"""Adjust at the stated noise: remove gross errors, and look for their causes."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.redundancy import compute_core_fit
from uavgram.estimation.survey.adjustment import Explanation, LeftOut, LeftOutCause, Refined
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.message_catalogue import Effect, entry_of
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Cause, Survey
from uavgram.stages.messages import TAKEN_INTO_ACCOUNT
from uavgram.stages.refine.causes.hypothesis import (
    CONTRADICTING,
    GROSS_ERROR_LOG_ODDS,
    MISFIT_PROBABILITY,
    SURE_LOG_ODDS,
    Diagnosis,
    Hypothesis,
)
from uavgram.stages.refine.causes.identification import (
    COMMON_ERRORS,
    ERRORS_OF_ONLY_PHOTO,
    IdentifiedCauses,
    Proposal,
    add_possible,
    describe_possible,
    identify_causes,
    identify_common_errors,
)
from uavgram.stages.refine.causes.mirrored_photos import (
    propose_all_mirrored,
    propose_exchanged_axes,
    shows_mirrored_control,
)
from uavgram.stages.refine.causes.swapped_labels import (
    propose_label_of_control,
    propose_swapped_pair,
)
from uavgram.stages.refine.causes.turned_photos import propose_photos_elsewhere
from uavgram.stages.refine.causes.wrong_heights import find_freed_heights
from uavgram.stages.refine.cleaned_adjustment import Robust, list_left_out
from uavgram.stages.refine.first_values import find_picks_in_lens
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.minima import FULL, Participants, adjust_on_trial, find_best_minima
from uavgram.stages.refine.off_ground import free_unchecked_heights, set_free_heights


class StatedNoiseAdjustment(NamedTuple):
    """Survey adjusted at the stated noise.

    Attributes
    ----------
    given, survey
        The original survey; and the survey with the findings on control and heights, freed of wrong
        prior knowledge.
    refined
        Its adjustment.
    off_ground
        Labels off the ground without a statement to that effect.
    causes
        Causes that explain the misfit.
    explanations
        The survey adjusted without the mistakes that the result does not take into account; a group
        for each cause.
    forbidding
        Those of causes that make the verdict red where they contradict a value, with their codes.
    messages
        Messages on control, and on heights that no observation determines.
    are_all_wrong
        Whether the causes prove every participating pick wrong.
    """

    given: Survey
    survey: Survey
    refined: Refined
    off_ground: list[str]
    causes: tuple[Cause, ...]
    explanations: tuple[tuple[Explanation, ...], ...]
    forbidding: tuple[tuple[str, tuple[Explanation, ...]], ...]
    messages: tuple[Message, ...]
    are_all_wrong: bool


def adjust_at_stated_noise(
    given: Survey, removed: Bools, options: SolveOptions, shown: Collection[str] = ()
) -> StatedNoiseAdjustment:
    """Adjust a survey at the stated noise, and find the causes of its misfit.

    Parameters
    ----------
    given
        All observations.
    removed
        (P,) picks that were removed.
    options
        Options with the choice whether the noise is learnt; where it is not, no prior is given up.
    shown
        Labels that matches show off the ground: their heights are free.
    """
    keep, reason = find_picks_in_lens(given)
    keep &= ~removed
    none = np.zeros(len(given.line_start), dtype=np.bool_)
    # Robust adjustment, then causes of the gross errors.
    taking = Participants(given, keep, none, reason)
    robust = _find_mirrored(taking) or adjust_robustly(taking)
    survey, refined, unseen = free_unchecked_heights(
        robust.survey, robust.refined, [*robust.labels, *shown]
    )
    found = identify_causes(Diagnosis(find_participants(survey, refined), refined))
    if found.restored is not None:
        survey, refined = found.restored.survey, _record_left_out(robust, found.restored)
    # Take errors of many picks, or common to all readings, where they explain more than these
    # causes; mention errors of picks that explain as much.
    cost = _compute_cost(taking, robust, found)
    of_picks = _find_errors_of_picks(taking, robust, found)
    is_of_picks = of_picks is not None and of_picks.is_likelier(cost)
    common = of_picks if is_of_picks else _find_common_errors(taking, robust, found)
    if common is not None:
        found, cost = common, common.cost
    if of_picks is not None and not is_of_picks:
        found = add_possible(found, of_picks.list_rivals(cost))
    if common is not None and _are_all_left_out(given, robust, found):
        found = found._replace(freed=(None,) * len(found.causes))
    # Without the readings that the causes prove wrong, others may fit that were left out.
    sound = _leave_out_wrong_readings(taking, refined, found)
    again = None if sound is taking else _adjust_again(sound)
    if again is not None:
        taking, robust = sound, again
        survey, refined, unseen = free_unchecked_heights(
            robust.survey, robust.refined, [*robust.labels, *shown]
        )
    causes = _add_photos_elsewhere(survey, refined, found.causes)
    off_ground = list(robust.labels)
    # What wrong picks contradict is not at fault.
    left_out = [] if is_of_picks and again is None else list(robust.messages(given))
    refined = replace(refined, pick_removed=removed)
    if up := find_freed_heights(survey, causes):
        before, off_ground = off_ground, sorted({*off_ground, *up})
        survey = set_free_heights(survey, off_ground, before)
        refined = replace(
            find_best_minima(find_participants(survey, refined)), pick_removed=removed
        )
    # Free the priors that the causes prove wrong; without a result, the one so far remains.
    if options.noise == "estimate" and any(found.freed):
        known_less, accounted = _free_wrong_priors(given if common else survey, found)
        again = _adjust_again(replace(taking, survey=known_less))
        if again is not None:
            survey, refined = again.survey, again.refined
            causes = _add_photos_elsewhere(survey, refined, accounted)
            if common:  # what seemed to be gross errors may be none
                off_ground, left_out = [], []
                survey, refined, unseen = free_unchecked_heights(
                    survey, refined, [*again.labels, *shown]
                )
            left_out += again.messages(known_less)
            off_ground = sorted({*off_ground, *again.labels})
            refined = replace(refined, pick_removed=removed)
    explained = [
        (cause.message, group)
        for cause, group in zip(causes, found.explanations, strict=False)
        if not cause.is_accounted
    ]
    forbidding = [one for one in explained if _forbids_use(one[0], refined, given)]
    explanations = tuple(
        group for message, group in explained if not _forbids_use(message, refined, given)
    )
    other = tuple(
        Explanation(one.after.adjustment, one.odds) for one in found.possible if one.after
    )
    explanations = (*explanations, other) if other else explanations
    return StatedNoiseAdjustment(
        given,
        survey,
        replace(refined, possible=describe_possible(found.possible)),
        off_ground,
        causes,
        explanations,
        tuple((message.code, group) for message, group in forbidding),
        (*left_out, *unseen),
        are_all_wrong=found.wrong.issuperset(refined.pick_index.tolist()),
    )


def _record_left_out(robust: Robust, restored: Diagnosis) -> Refined:
    """Record the readings that another adjustment than the robust one leaves out."""
    left = list_left_out(restored.survey, replace(robust, refined=restored.refined))
    return replace(restored.refined, left_out=tuple(sorted(left)))


def _add_photos_elsewhere(
    survey: Survey, refined: Refined, causes: tuple[Cause, ...]
) -> tuple[Cause, ...]:
    """Add the photos to causes that were left out for another reason than these."""
    diagnosis = Diagnosis(find_participants(survey, refined), refined)
    return (*causes, *propose_photos_elsewhere(diagnosis, causes))


def _find_mirrored(taking: Participants) -> Robust | None:
    """Return the ordinary adjustment of photos that all fit control once either is mirrored back.

    They contradict control so much that no robust adjustment is of use. None for other surveys.
    """
    plain = adjust_on_trial(taking, FULL) if shows_mirrored_control(taking.survey) else None
    if plain is None:
        return None
    diagnosis = Diagnosis(find_participants(taking.survey, plain), plain)
    found = identify_common_errors(diagnosis, [propose_all_mirrored, propose_exchanged_axes])
    return Robust(taking.survey, plain) if found.causes and found.fits else None


def _forbids_use(message: Message, refined: Refined, given: Survey) -> bool:
    """Return whether a message may make the verdict red: lengths that were all left out do not."""
    names = given.line_name or ("",) * len(given.line_start)
    used = {names[k] for k in np.flatnonzero(~refined.line_removed)}
    is_left_out = bool(message.lengths) and used.isdisjoint(message.lengths)
    return entry_of(message.code).effect is Effect.RED and not is_left_out


def _find_common_errors(
    taking: Participants, robust: Robust, found: IdentifiedCauses
) -> IdentifiedCauses | None:
    """Find errors common to all readings of a kind that explain more than gross errors do.

    Lengths in feet and a log that is wrong contradict each other alike; with another camera, most
    lengths or photos contradict the rest. Readings that seem to be gross errors then are none. The
    errors are looked for in the ordinary adjustment of all readings.

    Parameters
    ----------
    taking
        All participating observations.
    robust, found
        Their robust adjustment, and its causes.

    Returns
    -------
    The causes; None if there are none, or if gross errors are nearly as likely.
    """
    # Where the rest fits, a single pick or length that is wrong needs no other cause; a photo or a
    # control point has many numbers that another cause may explain. Beside one, the poses of the
    # log may be strained, as by a wrong one that was left out.
    accusing = [one for one in found.causes if one.settles]
    explained = {name for one in found.causes for name in one.message.labels}
    others = robust.count_others() - len(explained.intersection(robust.contradicting))
    wrong = found.left_out + len(accusing) + others
    core = compute_core_fit(robust.refined.adjustment).probability
    fits = found.fits or (wrong == 1 and core >= MISFIT_PROBABILITY)
    is_alone = len(np.unique(taking.survey.pick_frame[taking.keep])) == 1
    is_large = bool(len(robust.control)) or any(
        why.cause is LeftOutCause.MISPLACED_FRAME for why in robust.refined.pick_reason.values()
    )
    is_settled = wrong <= int(not is_alone) and not is_large
    if is_settled and fits and not robust.refined.is_log_left_out:
        return None
    plain = adjust_on_trial(taking, FULL)
    if plain is None:
        return None
    diagnosis = Diagnosis(find_participants(taking.survey, plain), plain)
    cost = _compute_cost(taking, robust, found)
    # A rival of common errors that are likelier may have a cost as large as that.
    common = identify_common_errors(diagnosis, COMMON_ERRORS, cost + 2.0 * SURE_LOG_ODDS)
    if not common.causes:
        return None
    price = 2.0 * GROSS_ERROR_LOG_ODDS * _count_lost(taking, plain)
    common = common._replace(cost=common.cost + price)
    return common if common.is_likelier(cost) else None


def _compute_cost(taking: Participants, robust: Robust, found: IdentifiedCauses) -> float:
    """Compute the cost of causes, with the price of all that the robust adjustment left out."""
    numbers = robust.count_numbers() + _count_lost(taking, robust.refined)
    return found.cost + 2.0 * GROSS_ERROR_LOG_ODDS * numbers


def _find_errors_of_picks(
    taking: Participants, robust: Robust, found: IdentifiedCauses
) -> IdentifiedCauses | None:
    """Find errors of many picks that may explain what was left out; None where nothing was.

    Where all picks of the only photo are wrong, any pose of it is of no use. Photos that were
    mirrored against control may be in order without it, or have no result. In place of exchanged
    control points, their labels may be swapped; a left-out control point may be the point at its
    coordinates, by a wrong label of it or by two swapped labels. Causes that are possible beside
    gross errors may explain these, too.

    Parameters
    ----------
    taking
        All participating observations.
    robust, found
        Their robust adjustment, and its causes.
    """
    numbers = robust.count_numbers() + _count_lost(taking, robust.refined)
    is_alone = len(np.unique(taking.survey.pick_frame[taking.keep])) == 1
    proposals: tuple[Proposal, ...] = ERRORS_OF_ONLY_PHOTO if is_alone else ()
    named = {one.message.code for one in found.causes}
    is_mirrored = "photos-mirrored" not in named and shows_mirrored_control(taking.survey)
    if is_mirrored:
        proposals += (propose_all_mirrored,)
    if robust.exchanged:
        proposals += (partial(propose_swapped_pair, names=robust.exchanged),)
    for names in _list_labels_at_control(taking.survey, robust):
        proposals += (
            partial(propose_label_of_control, names=names),
            partial(propose_swapped_pair, names=names),
        )
    if numbers:
        again = [one.hypothesis for one in found.possible if one.hypothesis.mend is not None]
        proposals += (partial(_propose_for_all, hypotheses=again),)
    is_in_order = found.fits and not (found.causes or found.left_out or numbers)
    if not proposals or (is_in_order and not is_mirrored):
        return None
    left = find_participants(taking.survey, robust.refined)
    diagnosis = Diagnosis(
        replace(left, known_removed=taking.known_removed), robust.refined, robust.count_numbers()
    )
    return identify_common_errors(diagnosis, proposals)


def _propose_for_all(diagnosis: Diagnosis, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Propose hypotheses again, with all readings that were left out."""
    # The decrease of the sum of squares is at most all of it.
    return [replace(one, is_of_all=True, moved=(), promise=diagnosis.cost) for one in hypotheses]


def _list_labels_at_control(survey: Survey, robust: Robust) -> Iterator[tuple[str, str]]:
    """List each left-out control point, and the label that was found nearest to its coordinates."""
    adjustment = robust.refined.adjustment
    place, labels = adjustment.points()[0], np.array(adjustment.survey.label)
    for row in robust.control.tolist():
        name = survey.label[survey.control_label[row]]
        apart = np.linalg.norm(place[:, :2] - survey.control_world_m[row, :2], axis=1)
        yield name, str(labels[np.where(labels == name, np.inf, apart).argmin()])


def _count_lost(taking: Participants, refined: Refined) -> int:
    """Count the coordinates of picks that the adjustment could not place."""
    lost = [
        k
        for k, why in refined.pick_reason.items()
        if taking.keep[k] and why.cause not in CONTRADICTING
    ]
    return 2 * len(lost)


def _are_all_left_out(given: Survey, robust: Robust, found: IdentifiedCauses) -> bool:
    """Return whether the robust adjustment left out all that the causes accuse, and nothing else.

    The causes accuse lengths by name, or all control points.
    """
    refined, causes = robust.refined, found.causes
    if not all(one.settles or one.message.labels for one in causes):
        return False
    diagnosis = Diagnosis(find_participants(robust.survey, refined), refined)
    names = given.line_name or ("",) * len(given.line_start)
    lines = {names[k] for k in np.flatnonzero(refined.line_removed)}
    control = {given.label[k] for k in given.control_label[robust.control]}
    accused = {name for one in causes for name in one.settles}
    shifted = {name for one in causes if not one.settles for name in one.message.labels}
    count = diagnosis.count_readings() + robust.count_others()
    return (accused, shifted) == (lines, control) and 0 < count == len(lines) + len(control)


TURNED_FRAME = LeftOut(LeftOutCause.MISPLACED_FRAME, "its picks fit once they are put back")
WRONG_LABEL = LeftOut(LeftOutCause.GROSS, "it fits under another label of its photo")
"""Reason why picks of a photo are wrong: all of them (`TURNED`), or some."""

MOVED_POINT = LeftOut(LeftOutCause.GROSS, "its point was moved between the photos")
"""Reason why picks that show a point elsewhere take no part."""


def _leave_out_wrong_readings(
    taking: Participants, refined: Refined, found: IdentifiedCauses
) -> Participants:
    """Leave out the picks and lengths that causes prove wrong, unless this changes nothing.

    Parameters
    ----------
    taking
        All participating observations.
    refined, found
        Their adjustment, and the causes of its misfits.
    """
    spoilt = np.flatnonzero(Diagnosis(taking, refined).spoilt).tolist()
    others = int(refined.line_removed.sum()) + len(refined.pose_widened)
    sound, survey = taking, taking.survey
    # Without any length, only control gives a scale that depends on no camera and no height.
    has_scale = len(found.wrong_lines) < len(survey.line_start) or len(survey.control_label) > 1
    is_new = not found.wrong_lines <= set(np.flatnonzero(refined.line_removed).tolist())
    if is_new and has_scale:
        sound = taking.leave_out_lines(sorted(found.wrong_lines))
    if not found.wrong or (found.wrong == frozenset(spoilt) and not others):
        return sound
    mends = [one.hypothesis.mend for one in found.judged if one.hypothesis.mend is not None]
    moved = frozenset[int]().union(*(mend.apart for mend in mends))
    reason = _reasons(survey, sorted(found.wrong - moved))
    return sound.leave_out_picks(reason | dict.fromkeys(sorted(found.wrong & moved), MOVED_POINT))


def _reasons(survey: Survey, wrong: Sequence[int]) -> dict[int, LeftOut]:
    """Return the reason why each wrong pick takes no part."""
    frame, frames = survey.pick_frame, len(survey.frame_id)
    every, out = (np.bincount(some, minlength=frames) for some in (frame, frame[list(wrong)]))
    return {k: TURNED_FRAME if every[frame[k]] == out[frame[k]] else WRONG_LABEL for k in wrong}


def _free_wrong_priors(survey: Survey, found: IdentifiedCauses) -> tuple[Survey, tuple[Cause, ...]]:
    """Give up wrong prior knowledge, and add to the messages of its causes that it was given up.

    Parameters
    ----------
    survey
        The survey as it was adjusted.
    found
        Causes, and the prior that each gives up.
    """
    known_less, causes = survey, list(found.causes)
    for k, freed in enumerate(found.freed):
        if freed is not None:
            known_less, message = freed(known_less), causes[k].message
            message = replace(message, text=f"{message.text} {TAKEN_INTO_ACCOUNT}")
            causes[k] = replace(causes[k], message=message, is_accounted=True)
    return known_less, tuple(causes)


def _adjust_again(taking: Participants) -> Robust | None:
    """Adjust robustly once more; None where that has no result."""
    try:
        after = adjust_robustly(taking)
    except GeometryError:
        return None
    return after if after.refined.adjustment.minimum.converged else None


def find_participants(survey: Survey, refined: Refined) -> Participants:
    """Return the participating observations of an adjustment."""
    used = np.zeros(len(survey.pick_frame), dtype=bool)
    used[refined.pick_index] = True
    return Participants(
        survey,
        used,
        refined.line_removed,
        refined.pick_reason,
        refined.known_removed,
        refined.pose_widened,
    )
