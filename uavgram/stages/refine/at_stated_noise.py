"""A survey adjusted at the stated noise: what is wrong beyond doubt left out, causes looked for."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.known_frames import odd_ones_out
from uavgram.estimation.first_poses.line_poses import are_alone, odd_lines
from uavgram.estimation.survey.adjustment import LeftOut, Refined
from uavgram.estimation.survey.selection import select_picks
from uavgram.model.arrays import Bools
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey.mend import Cause
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.starts import in_lens
from uavgram.stages.refine.blunders.gross_control import (
    control_beyond_doubt,
    control_left_out,
    doubtful_control,
    without_control,
)
from uavgram.stages.refine.blunders.gross_known import known_beyond_doubt
from uavgram.stages.refine.blunders.gross_lengths import (
    doubtful,
    fits,
    wrong_beyond_doubt,
)
from uavgram.stages.refine.blunders.misfit import TRIAL
from uavgram.stages.refine.causes.hypothesis import Standing
from uavgram.stages.refine.causes.identify import Identified, identify
from uavgram.stages.refine.causes.labels.heights import heights_by_causes
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.off_ground.heights import found_free, with_free
from uavgram.stages.refine.off_ground.unseen import with_unseen_heights
from uavgram.stages.refine.remarks import (
    contradiction,
)
from uavgram.stages.refine.robust_adjustment import adjust_survey

TAKEN = "The results take it into account."


class AtStatedNoise(NamedTuple):
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


def adjusted_as_stated(
    given: Survey, removed: Bools, options: SolveOptions, shown: Collection[str] = ()
) -> AtStatedNoise:
    """A survey adjusted at the stated noise, and what explains that it does not fit.

    Parameters
    ----------
    given
        All observations.
    removed
        (P,) picks that were taken out.
    options
        Whether the noise is to be learnt; where it is not, no prior knowledge is given up.
    shown
        Labels that matches show off the ground: their heights are free.
    """
    keep, reason = in_lens(given)
    keep &= ~removed
    survey, refined, left_out = _without_gross_control(given, keep, reason)
    off_ground = found_free(survey, refined)
    survey = with_free(survey, off_ground)
    survey, refined, unseen = with_unseen_heights(survey, refined, [*off_ground, *shown])
    refined = replace(refined, pick_removed=removed)
    found = identify(Standing(participants(survey, refined), refined, frozenset(off_ground)))
    causes = found.causes
    back, up = (heights_by_causes(survey, causes, free=free) for free in (False, True))
    if back or up:
        before, off_ground = off_ground, sorted((set(off_ground) - back) | up)
        survey = with_free(survey, off_ground, before)
        refined = replace(best_minima(participants(survey, refined)), pick_removed=removed)
    if options.noise == "estimate":
        survey, refined, causes = _freed(
            survey, refined, found, lambda one: _without_gross_known(one, keep, reason)
        )
    return AtStatedNoise(given, survey, refined, off_ground, causes, (*left_out, *unseen))


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
    where these place the photos, without which one the others agree: of lines of known position
    too, without which nothing has a place.
    """
    wrong: frozenset[int] = frozenset()
    if survey.known and not _fits_at_once(survey, keep, reason):
        if are_alone(survey):
            wrong = odd_lines(select_picks(survey, keep).survey)
            return _without_gross_lengths(survey, keep, reason, wrong)
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


def participants(survey: Survey, refined: Refined) -> Participants:
    """What takes part in an adjustment."""
    used = np.zeros(len(survey.pick_frame), dtype=bool)
    used[refined.pick_index] = True
    reason, known = refined.pick_reason, refined.known_removed
    return Participants(survey, used, refined.line_removed, reason, known)
