"""Remove gross errors from a survey by one robust adjustment over every kind of observation.

1. `adjust_robustly` keeps an ordinary adjustment that fits (`_is_in_order`).
2. Otherwise robust adjustments (`robust_candidate.py`) begin from several first values: with
   enlarged sigmas, with two readings exchanged (`exchanged_readings.py`), then without single
   lengths, known things or photos (`reduced_starts.py`).
3. The candidate of least cost decides which observations are gross errors.
4. The remaining observations are adjusted as usual, and the removed ones are reported
   (`cleaned_adjustment.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TypeAlias

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.redundancy import compute_core_fit
from uavgram.estimation.survey.adjustment import LeftOutCause, Refined, Rival, explain
from uavgram.estimation.survey.observations.sightings import have_folded
from uavgram.model.survey import Survey
from uavgram.stages.refine.cleaned_adjustment import (
    Robust,
    adjust_without_candidate,
    find_wrong_poses,
    list_left_out,
)
from uavgram.stages.refine.exchanged_readings import try_exchanged_readings
from uavgram.stages.refine.minima import Participants, Patience, find_best_minima
from uavgram.stages.refine.reduced_starts import (
    exchange_gross_errors,
    take_until_agreed,
    try_other_clicks,
    try_single_error,
    try_without_photos,
    try_without_references,
    try_without_suspects,
    try_without_two_lengths,
)
from uavgram.stages.refine.rival_errors import MAX_RIVAL_INCREASE
from uavgram.stages.refine.robust_adjustment import compute_squared_misfits
from uavgram.stages.refine.robust_candidate import (
    COORDINATES,
    MISFIT_PROBABILITY,
    MISPLACED,
    Candidate,
    adjust_from_softened,
    sort_by_cost,
)

ORDINARY_SIGMAS = 5.0
"""Standardised misfit up to which an ordinary adjustment is accepted without a robust one."""

LEFT_OUT_SIGMA_FACTOR = 3.0
"""Factor of the sigmas of poses of a log that is wrong as a whole, where a photo was left out."""

MOST_SHARED = 20
"""Largest number of unknowns that all photos share: camera, readout, ground, log and tapes."""


def adjust_robustly(taking: Participants, plain: Refined | None = None) -> Robust:
    """Adjust without observations that are gross errors.

    Parameters
    ----------
    taking
        Participating observations.
    plain
        Their ordinary adjustment, where it is known.

    Raises
    ------
    GeometryError
        The observations do not determine the survey.
    """
    failed: GeometryError | None = None
    try:
        plain = plain or find_best_minima(taking, Patience(goal=_bound_cost_in_order(taking)))
    except GeometryError as why:
        failed = why
    if plain is None or not _is_in_order(taking, plain):
        agreed = _find_best_candidates(taking)
        # Without a photo of another place, the rest may have gross errors of other kinds.
        rest = taking
        while agreed and agreed[0].taking.keep.sum() < rest.keep.sum():
            rest = agreed[0].taking
            if not agreed[0].explains():
                agreed = _find_best_candidates(rest)
        # Photos that contradict the rest, but without which it does not fit, are no exception; then
        # a candidate with them is the last resort.
        agreed = [one for one in agreed if not one.misplaced] or agreed
        # Without a log that is wrong as a whole, the rest may have no gross errors.
        wrong = _find_wrong_log(taking, agreed[0]) if agreed else {}
        if len(taking.pose_widened) < len(wrong):
            with suppress(GeometryError):
                return adjust_robustly(replace(taking, pose_widened=wrong))
        robust = _adjust_without_outliers(taking, agreed)
        if robust is not None:
            return replace(robust, refined=_mark_misplaced_photos(taking.survey, robust.refined))
    if plain is None:
        assert failed is not None  # noqa: S101  (one of the two is always there)
        raise failed
    if not plain.adjustment.minimum.converged:  # it may have been interrupted
        plain = find_best_minima(taking)
    plain = _mark_misplaced_photos(taking.survey, plain)
    return Robust(taking.survey, plain)


def _find_wrong_log(taking: Participants, best: Candidate) -> dict[str, float]:
    """Find factors of the sigmas of all poses by the log; empty unless it is wrong as a whole.

    Then a photo that was left out may have contradicted the log alone.
    """
    prior, part = taking.survey.telemetry, best.annealed.problem.survey.telemetry
    wrong = find_wrong_poses(best.annealed, taking.pose_widened)
    if prior is None or part is None:
        return {}
    number = len(part.frame_index)
    if len(wrong) < number or number < min(2, len(prior.frame_index)):
        return {}
    names = [taking.survey.frame_id[k] for k in prior.frame_index]
    # The pose of a photo that was left out is worse than those of the others.
    factor = max(wrong.values()) * (1.0 if number == len(names) else LEFT_OUT_SIGMA_FACTOR)
    return dict.fromkeys(names, factor)


def _mark_misplaced_photos(survey: Survey, refined: Refined) -> Refined:
    """Mark photos as misplaced whose pose, from their own picks, shows the sky at all picks."""
    if survey.telemetry is not None:  # otherwise the pose is that of the log
        return refined
    frame, reason = survey.pick_frame, refined.pick_reason
    sky = [k for k, why in reason.items() if why.cause is LeftOutCause.NO_GROUND]
    others = np.setdiff1d(np.arange(len(frame)), sky)
    whole = np.setdiff1d(frame[sky], frame[others])
    misplaced = {k: MISPLACED for k in sky if frame[k] in whole}
    return replace(refined, pick_reason={**reason, **misplaced})


def _bound_cost_in_order(taking: Participants) -> float:
    """Bound the sum of squares of an adjustment in order (`_is_in_order`)."""
    survey = taking.survey
    if survey.matches.points + survey.ties.points or any(one.relief for one in survey.grounds):
        return np.inf  # their sightings begin far off, and are tested elsewhere
    readings = 2 * len(survey.pick_frame) + len(survey.line_start) + len(survey.known)
    others = len(survey.control_label) + len(survey.label) + len(survey.frame_id)
    numbers = readings + 2 * COORDINATES * others + MOST_SHARED
    priors = ORDINARY_SIGMAS**2 * (len(survey.frame_id) + MOST_SHARED)
    return float(chdtri(numbers, MISFIT_PROBABILITY)) + priors


def _is_in_order(taking: Participants, refined: Refined) -> bool:
    """Return whether an ordinary adjustment uses all observations and has no large misfit.

    Nor may it place a point where no lens shows it.
    """
    adjustment = refined.adjustment
    if not adjustment.minimum.converged or len(refined.pick_reason) > len(taking.reason):
        return False
    if have_folded(adjustment.minimum.blocks):
        return False
    if compute_core_fit(adjustment).probability < MISFIT_PROBABILITY:
        return False
    squares = compute_squared_misfits(adjustment.problem, adjustment.minimum, {})
    return all(square.max(initial=0.0) < ORDINARY_SIGMAS**2 for square in squares.values())


_Search: TypeAlias = Callable[[Participants, Sequence[Candidate]], Iterator[Candidate]]
"""Function that adjusts robustly from other first values than those of the candidates so far."""


def _find_best_candidates(taking: Participants) -> list[Candidate]:
    """Adjust robustly from all first values; return the candidates, that of least cost first.

    First values without some of the observations are tried where the earlier ones lead to no
    agreement.
    """
    exchanged: set[tuple[str, int, int]] = set()
    try_exchange = partial(try_exchanged_readings, exchanged)
    found = sort_by_cost(taking, take_until_agreed(adjust_from_softened(taking)))
    # Two exchanged lengths spoil no whole photo: search for such a photo first.
    if len(taking.survey.control_label) or not (found and found[0].doubts_a_photo()):
        found = sort_by_cost(taking, chain(found, try_exchange(taking, found)))
    if found and found[0].is_agreed() and found[0].fits():
        return found[:1]
    # Several gross errors, or one that leaves a misfit, may be the effects of another single one.
    several = (one for one in found if one.has_several_gross_errors())
    found = sort_by_cost(taking, chain(found, *map(try_single_error, several)))
    if found and found[0].is_agreed():
        return found[:1]
    # First values may depend on gross errors: leave out some observations.
    searches: list[_Search] = [try_without_references, try_without_photos]
    if not found or found[0].doubts_a_photo():
        searches.reverse()
    last: tuple[_Search, ...] = (try_exchange, try_without_two_lengths)
    for search in (try_without_suspects, *searches, *last):
        best = found[:1]
        for candidate in search(taking, found):
            found = sort_by_cost(taking, [*found, candidate])
            is_sure = candidate.is_agreed() and candidate.keeps_lengths(taking)
            if is_sure and found and found[0] is candidate:
                return found[:1]
        # Without references, or with other gross errors, something else may be wrong: search on.
        if search is try_without_references or found[:1] == best or not found[0].explains():
            continue
        if found[0].leaves_no_other() and found[0].keeps_lengths(taking):
            break
    return found


def _adjust_without_outliers(taking: Participants, agreed: Sequence[Candidate]) -> Robust | None:
    """Adjust without the gross errors of the best candidate; None where that has no result.

    Among candidates that explain as much, the one that keeps most picks comes first, and one that
    converges. Those that leave out other readings are rivals of the result.
    """
    if not agreed:
        return None
    agreed = sort_by_cost(taking, [*agreed, *try_other_clicks(taking, agreed[0])])
    agreed = sort_by_cost(taking, [*agreed, *exchange_gross_errors(agreed[0])])
    pairs: list[tuple[Robust, Candidate]] = []
    while agreed and not pairs:
        least = agreed[0].cost(taking)
        near = [one for one in agreed if one.cost(taking) <= least + MAX_RIVAL_INCREASE]
        agreed = [one for one in agreed if one not in near]
        # One wrong reading is likelier than an exchange of two that explains no more, or a tape, of
        # which all lengths stay.
        near.sort(key=lambda one: (one.exchanges_lengths(), one.doubts_a_tape(), -len(one.used)))
        # One candidate for each set of left-out observations.
        different = {one.left_out: one for one in reversed(near)}
        each = (one for one in near if different[one.left_out] is one)
        pairs = [(one, found) for found in each if (one := adjust_without_candidate(found))]
    if not pairs:
        return None
    pairs.sort(key=lambda pair: not pair[0].refined.adjustment.minimum.converged)
    (robust, _), *others = pairs
    refined, survey = robust.refined, taking.survey
    left = list_left_out(survey, robust)
    # Record the readings that other explanations leave out, and their adjustments.
    rivals: list[Rival] = []
    minima = [*refined.alternatives]
    for rival, _ in others:
        other, theirs = rival.refined, list_left_out(survey, rival)
        readings, instead_of = (tuple(sorted(one)) for one in (theirs - left, left - theirs))
        if not readings:
            continue
        same = other.adjustment.survey.label == refined.adjustment.survey.label
        kinds = {one.kind for one in readings}
        if same and "lengths" in kinds:
            minima.append(other.adjustment)
        if same and kinds != {"lengths"}:
            minima.extend(other.alternatives)
        explanation = None
        if not (same and kinds == {"lengths"}):
            explanation = explain(refined.adjustment, other.adjustment)
        rivals.append(Rival(readings, instead_of, explanation))
    refined = replace(
        refined,
        alternatives=tuple(minima),
        left_out=tuple(sorted(left)),
        rivals=tuple(rivals),
    )
    # Of two clicks of one point in a photo either may be wrong.
    in_doubt = [one for rival in rivals for one in rival.readings]
    ours, others_of = (
        {one.name for one in some if one.kind == "pixels"} for some in (left, in_doubt)
    )
    contradicting = tuple(sorted({*robust.contradicting, *(ours & others_of)}))
    return replace(robust, refined=refined, contradicting=contradicting)
