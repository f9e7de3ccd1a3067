"""Refine: poses, points and all that is shared, in one maximum-likelihood adjustment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.known_frames import odd_ones_out
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause, Refined, Removal
from uavgram.estimation.survey.selection import select_picks
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey.mend import Cause
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.gross_control import (
    control_beyond_doubt,
    control_left_out,
    doubtful_control,
    without_control,
)
from uavgram.stages.refine.blunders.gross_known import known_beyond_doubt, with_gross_known
from uavgram.stages.refine.blunders.gross_lengths import (
    doubtful,
    fits,
    with_gross_lengths,
    wrong_beyond_doubt,
)
from uavgram.stages.refine.blunders.misfit import TRIAL, is_settled
from uavgram.stages.refine.blunders.outstanding import outstanding, with_little_weight
from uavgram.stages.refine.blunders.snooping import MOST, best_of, blunders
from uavgram.stages.refine.causes.adapt import adapted
from uavgram.stages.refine.causes.heights import heights_by_causes
from uavgram.stages.refine.causes.hypothesis import Standing
from uavgram.stages.refine.causes.identify import Identified, identify
from uavgram.stages.refine.continued import continued
from uavgram.stages.refine.learnt import learnt_remarks
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.noise import with_noise_learnt
from uavgram.stages.refine.noise_remarks import noise_remarks
from uavgram.stages.refine.off_ground.heights import found_free, with_free
from uavgram.stages.refine.off_ground.remarks import off_ground_remarks
from uavgram.stages.refine.off_ground.unseen import with_unseen_heights
from uavgram.stages.refine.readout import with_sound_readout
from uavgram.stages.refine.remarks import (
    contradiction,
    indispensable,
    not_located,
    remarks,
    too_many,
)
from uavgram.stages.refine.robust_adjustment import adjust_survey

MOST_MENDS = 24
"""Mends after which a survey is in disorder, and no more are made."""

BEYOND_LENS = LeftOut(LeftOutCause.BEYOND_LENS, "the lens model cannot be inverted at that pixel")

TAKEN = "The results take it into account."


def refine(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
    """Adjust a survey.

    Parameters
    ----------
    survey
        Observations and priors.
    options
        What to do about blunders: with ``remove`` what was found to be wrong is mended (labels
        swapped back, a unit put right); then the observation with the largest standardised
        residual above the critical value is taken out and everything adjusted anew, one at a
        time, until none is left. With ``report`` all stays as it was written.

    Raises
    ------
    GeometryError
        The observations do not determine the survey; the message names what is missing.
    """
    begun = _begun(survey, np.zeros(len(survey.pick_frame), dtype=np.bool_), options)
    mends: tuple[Removal, ...] = ()
    while options.outliers == "remove" and len(mends) < MOST_MENDS:
        mended = adapted(begun.given, begun.causes, begun.refined)
        if not mended.removals:
            break
        mends += mended.removals
        begun = _begun(mended.survey, begun.refined.pick_removed | mended.without, options)
    taken_out = begun.refined.pick_removed
    survey, refined, readout = with_sound_readout(begun.survey, begun.refined)
    if options.noise == "estimate":
        survey, refined = with_noise_learnt(survey, refined)
    if options.outliers == "remove":
        noise = refined.noise
        refined, search = _without_blunders(survey, refined, options.significance)
        refined = replace(refined, noise=noise)  # that it was adjusted with
    else:
        refined, search = _with_the_accused(survey, refined, options.significance), []
        if options.noise == "estimate":
            refined = _with_little_weight(refined)
    refined = with_gross_lengths(survey, with_gross_known(survey, refined))
    refined = replace(
        refined,
        off_ground=frozenset(begun.off_ground),
        causes=(*(one.cause for one in mends if one.cause), *begun.causes),
        removals=(*mends, *refined.removals),
        pick_removed=refined.pick_removed | taken_out,
    )
    told = (*(cause.message for cause in begun.causes), *begun.messages)
    told = (*told, *off_ground_remarks(refined), *readout, *noise_remarks(refined.noise))
    told = (*told, *learnt_remarks(refined.adjustment))
    return refined, (*told, *remarks(survey, refined), *search)


class _Begun(NamedTuple):
    """A survey adjusted at the stated noise.

    Attributes
    ----------
    given, survey
        As it was handed over; with what was found of control and heights, and freed of prior
        knowledge that is wrong.
    refined
        Its adjustment.
    off_ground
        Labels that stand off the ground though nobody said so.
    causes
        What explains that it does not fit.
    messages
        On control, and on heights that nothing tells.
    """

    given: Survey
    survey: Survey
    refined: Refined
    off_ground: list[str]
    causes: tuple[Cause, ...]
    messages: tuple[Message, ...]


def _begun(given: Survey, removed: Bools, options: SolveOptions) -> _Begun:
    """A survey adjusted at the stated noise, and what explains that it does not fit.

    Parameters
    ----------
    given
        All observations.
    removed
        (P,) picks that were taken out.
    options
        Whether the noise is to be learnt; where it is not, no prior knowledge is given up.
    """
    keep, reason = _in_lens(given)
    keep &= ~removed
    survey, refined, left_out = _without_gross_control(given, keep, reason)
    off_ground = found_free(survey, refined)
    survey = with_free(survey, off_ground)
    survey, refined, unseen = with_unseen_heights(survey, refined, off_ground)
    refined = replace(refined, pick_removed=removed)
    found = identify(Standing(_participants(survey, refined), refined, frozenset(off_ground)))
    causes = found.causes
    back, up = (heights_by_causes(survey, causes, free=free) for free in (False, True))
    if back or up:
        before, off_ground = off_ground, sorted((set(off_ground) - back) | up)
        survey = with_free(survey, off_ground, before)
        refined = replace(best_minima(_participants(survey, refined)), pick_removed=removed)
    if options.noise == "estimate":
        survey, refined, causes = _freed(
            survey, refined, found, lambda one: _without_gross_known(one, keep, reason)
        )
    return _Begun(given, survey, refined, off_ground, causes, (*left_out, *unseen))


def _freed(
    survey: Survey, refined: Refined, found: Identified, adjust: Callable[[Survey], Refined]
) -> tuple[Survey, Refined, tuple[Cause, ...]]:
    """Adjusted anew without the prior knowledge that is wrong; as it was where that cannot be.

    Parameters
    ----------
    survey
        As it was adjusted.
    refined
        Its adjustment.
    found
        Causes, and what each gives up.
    adjust
        What makes an adjustment of a survey.
    """
    known_less = survey
    causes = list(found.causes)
    for k, freed in enumerate(found.freed):
        if freed is not None:
            known_less, message = freed(known_less), causes[k].message
            causes[k] = replace(causes[k], message=replace(message, text=f"{message.text} {TAKEN}"))
    if known_less is survey:
        return survey, refined, found.causes
    try:
        after = adjust(known_less)
    except GeometryError:
        return survey, refined, found.causes
    return known_less, replace(after, pick_removed=refined.pick_removed), tuple(causes)


def _without_gross_control(
    survey: Survey, keep: Bools, reason: dict[int, LeftOut]
) -> tuple[Survey, Refined, list[Message]]:
    """Adjusted without control points and lengths that are wrong beyond doubt.

    The survey without these control points, the result, and what is to be said of them; those that
    the result does not rule out come back.
    """
    out = doubtful_control(survey, keep)
    while True:
        rest = without_control(survey, out)
        refined = _without_gross_known(rest, keep, reason)
        control = np.flatnonzero(out)
        wrong = control_beyond_doubt(survey, refined, control)
        if wrong.all():
            return rest, refined, list(control_left_out(survey, refined, control))
        out = out.copy()
        out[control[~wrong]] = False


def _without_gross_known(survey: Survey, keep: Bools, reason: dict[int, LeftOut]) -> Refined:
    """Adjusted without the known things, and the lengths, that are wrong beyond doubt.

    Only where all does not fit together at once is it asked what fits without any known thing; or,
    where these place the photos, without which one the others agree.
    """
    wrong: frozenset[int] = frozenset()
    if survey.known and not _fits_at_once(survey, keep, reason):
        everything = frozenset(thing.index for thing in survey.known)
        try:
            rest = _without_gross_lengths(survey, keep, reason, everything)
            wrong = known_beyond_doubt(survey, rest) if fits(rest) else wrong
        except GeometryError:
            wrong = odd_ones_out(select_picks(survey, keep).survey)
    return _without_gross_lengths(survey, keep, reason, wrong)


def _fits_at_once(survey: Survey, keep: Bools, reason: dict[int, LeftOut]) -> bool:
    """Whether everything fits but for what is in doubt anyway."""
    try:
        return fits(best_minima(Participants(survey, keep, doubtful(survey, keep), reason), TRIAL))
    except GeometryError:
        return False


def _without_gross_lengths(
    survey: Survey,
    keep: Bools,
    reason: dict[int, LeftOut],
    known_removed: frozenset[int] = frozenset(),
) -> Refined:
    """Adjusted without the lengths that are wrong beyond doubt.

    It starts without all that are in doubt; those that the result does not rule out come back, and
    so do all where too few are left.

    Parameters
    ----------
    survey
        All observations.
    keep, reason
        (P,) picks that take part, and why others do not.
    known_removed
        Numbers of known things that do not.
    """
    out = doubtful(survey, keep)
    while True:
        try:
            taking = Participants(survey, keep, out, reason, known_removed)
            refined = adjust_survey(taking, heights_sought=True)
        except GeometryError as why:
            if survey.telemetry is not None:
                raise
            if not out.any():
                raise GeometryError(f"{why}{contradiction(survey, keep)}") from why
            out = np.zeros_like(out)
            continue
        line = np.flatnonzero(out)
        wrong = wrong_beyond_doubt(survey, refined, line)
        if wrong.all():
            return refined
        out = out.copy()
        out[line[~wrong]] = False


def _without_blunders(
    survey: Survey, refined: Refined, significance: float
) -> tuple[Refined, list[Message]]:
    """Take out one blunder at a time and adjust anew, until none is left or can be chosen."""
    most = int(MOST * (len(survey.pick_frame) + len(survey.line_start) + len(survey.known)))
    while True:
        choices, undecided = blunders(refined, significance)
        if not choices:
            return refined, [not_located(refined, suspicion) for suspicion in undecided]
        if len(refined.removals) >= most:
            return refined, [too_many(len(refined.removals))]
        tried = _tried(survey, refined, choices)
        if isinstance(tried, GeometryError):  # nothing is left to solve by: better with it
            return refined, [indispensable(refined, choices[0], tried)]
        removal, after = best_of(tried)
        if not is_settled(after):
            settled = adjust_survey(_participants(survey, after))
            after = replace(settled, pick_removed=after.pick_removed)
        refined = replace(after, removals=(*refined.removals, removal))


def _with_the_accused(survey: Survey, refined: Refined, significance: float) -> Refined:
    """The same, with the observation that adjustments without each of several point at.

    Lengths that are then wrong beyond doubt are left out, if the rest fits: they would bend it.
    """
    first, without = refined, refined
    while True:
        choices, _ = blunders(without, significance)
        tried = _tried(survey, without, choices) if len(choices) > 1 else []
        if isinstance(tried, GeometryError) or not tried:
            return without if fits(without) else first
        removal, after = best_of(tried)
        if without is refined:
            alone = is_settled(after) and blunders(after, significance) == ([], [])
            accused = removal.suspicion.accused
            first = replace(refined, accused=accused, accused_alone=alone)
        line = np.array([removal.index] if removal.kind == "line" else [], dtype=np.int64)
        if not (is_settled(after) and wrong_beyond_doubt(survey, after, line).any()):
            return first if without is refined or not fits(without) else without
        without = after


def _with_little_weight(refined: Refined) -> Refined:
    """The same, with little weight for few observations that stand out, where all else fits."""
    adjustment = refined.adjustment
    few, fits = outstanding(adjustment)
    located = any(one.located.any() for one in few.values())
    if not located or not fits or not adjustment.minimum.converged:
        return refined
    softer = with_little_weight(adjustment.problem, few)
    try:
        after = continued(adjustment, softer)
    except SingularError:
        return refined
    return replace(refined, adjustment=after, full_weight=adjustment)


def _tried(
    survey: Survey, refined: Refined, choices: list[Removal]
) -> list[tuple[Removal, Refined]] | GeometryError:
    """Adjustments without each choice; the error where the likeliest one cannot be missed.

    What was left out before stays out: a frame of nonsense would drown what a length does.
    """
    taking = _participants(survey, refined)
    tried = []
    for choice in choices:
        pick, line = refined.pick_removed.copy(), refined.line_removed.copy()
        known = refined.known_removed
        if choice.kind == "known":
            known |= {choice.index}
        else:
            (pick if choice.kind == "pick" else line)[choice.index] = True
        try:
            without = replace(
                taking, keep=taking.keep & ~pick, line_removed=line, known_removed=known
            )
            after = best_minima(without, TRIAL)
        except GeometryError as why:
            if choice is choices[0]:
                return why
            continue
        tried.append((choice, replace(after, pick_removed=pick, line_removed=line)))
    return tried


def _participants(survey: Survey, refined: Refined) -> Participants:
    """What takes part in an adjustment."""
    used = np.zeros(len(survey.pick_frame), dtype=bool)
    used[refined.pick_index] = True
    reason, known = refined.pick_reason, refined.known_removed
    return Participants(survey, used, refined.line_removed, reason, known)


def _in_lens(survey: Survey) -> tuple[Bools, dict[int, LeftOut]]:
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    keep: Bools = np.isfinite(ray.sum(axis=1))
    return keep, dict.fromkeys(np.flatnonzero(~keep).tolist(), BEYOND_LENS)
