"""Remove gross errors from a survey by one robust adjustment over every kind of observation.

1. `adjust_robustly` keeps an ordinary adjustment that fits (`_is_in_order`).
2. Otherwise robust adjustments (`robust_adjustment.py`) begin from several first values: with
   enlarged sigmas, with two readings exchanged, then without single lengths, known things or
   photos (`_find_best_candidates`).
3. The candidate of least cost decides which observations are gross errors.
4. The remaining observations are adjusted as usual (`_adjust_without_candidate`), and the removed
   ones are reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, combinations, islice
from typing import TypeAlias

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import FirstValues
from uavgram.estimation.first_poses.resection import MIN_PICKS, find_consensus
from uavgram.estimation.reliability.redundancy import (
    GROSS_SIGMAS,
    MAX_GROSS_SHARE,
    compute_cofactors,
    compute_core_fit,
    reduce_squares,
)
from uavgram.estimation.reliability.stated_values import explain_length
from uavgram.estimation.solver.normal_equations import (
    DenseStack,
    NormalEquations,
    SingularError,
    compute_cost,
    compute_gradient,
)
from uavgram.estimation.survey.adjustment import (
    Adjustment,
    LeftOut,
    LeftOutCause,
    Reading,
    Refined,
    Rival,
    explain,
)
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.kinds import READINGS, get_kind
from uavgram.estimation.survey.observations.known import describe_thing
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.estimation.survey.selection import (
    remove_known,
    select_control,
    select_picks,
)
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import fit_robust_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names, join_photo_names
from uavgram.model.survey import Ground, Survey
from uavgram.stages.refine.first_values import (
    do_all_agree,
    find_agreeing_control,
    find_first_values,
)
from uavgram.stages.refine.left_out import (
    report_control_exchanged,
    report_control_left_out,
    report_heights_left_out,
)
from uavgram.stages.refine.minima import (
    FULL,
    QUICK_TRIAL,
    Participants,
    Patience,
    adjust_on_trial,
    find_best_minima,
    find_minima_from,
)
from uavgram.stages.refine.off_ground import count_photos
from uavgram.stages.refine.readjustment import convert_state
from uavgram.stages.refine.robust_adjustment import (
    LEAST_REDUNDANCY,
    ROBUST,
    SCHEDULE,
    ZERO_WEIGHT,
    Annealed,
    anneal,
    compute_gross_cost,
    compute_squared_misfits,
    decide,
    minimise_weighted_cost,
)
from uavgram.stages.refine.staged_sigmas import DAMPING

ORDINARY_SIGMAS = 5.0
"""Standardised misfit up to which an ordinary adjustment is accepted without a robust one."""

MOST_ALTERNATIVES = 4
"""Largest number of alternative minima of an adjustment from which robust adjustments begin."""

MOST_STARTS = 12
"""Largest number of lengths, or photos, that are left out of the first values in turn; with more of
them the search is skipped."""

MOST_EXCHANGES = 28
"""Largest number of pairs of control points that are tried as exchanged: of eight points."""

MOST_IN_PAIRS = 7
"""Largest number of lengths that are left out in pairs, without a log."""

SEVERAL_PHOTOS, MOST_LENGTHS_ALONE = 3, 3
"""Number of photos that show the shape of the ground without lengths; and largest number of lengths
that give its size in turn."""

COORDINATES = 3
"""Number of coordinates of a control point."""

CONTROL_EXCHANGE_COST, LENGTH_EXCHANGE_COST = GROSS_SIGMAS**2 / COORDINATES, GROSS_SIGMAS**2
"""Costs of two control points, or two lengths, with each other's readings. An exchange has no
unknown amount, where a gross control point has three; two lengths often differ by little, so that
their exchange explains an error of one of them by chance."""

LEAST_AGREEING_CONTROL = 3
"""Number of control points that determine the place and direction of a scene, and check it."""

MOST_GROSS_OF_A_PHOTO = 4
"""Number of gross errors that a photo counts as where it is left out: three picks determine its
pose, and a fourth one checks it."""

CORRELATED_SIGMA_FACTOR = 3.0
"""Factor of the sigmas of poses of a log that is wrong as a whole: their errors go together."""

MISFIT_PROBABILITY = 1e-6
"""Probability of the sum of squares without gross errors, below which the rest does not fit."""

FEW_GROSS_SHARE = 0.03
"""Share of all observations, and at least one, that may be gross errors without a search from other
first values."""

MAX_RIVAL_INCREASE = 2.0 * float(np.log(20.0))
"""Difference of costs up to which another explanation has odds of more than 1 in 20."""

MIN_DECREASE_SHARE = 0.8
"""Share of the gross error's decrease of the sum of squares that another observation must reach, in
the linear model, to be tried instead."""

MOST_PROPOSED = 3
"""Number of single gross errors that are tried in place of several."""

ROUGH_POSE_FACTOR = 5.0
"""Factor of the sigmas of picks for a pose by control points that are not in a plane."""

OFF_GROUND_M = 0.1
"""Departure from the ground [m] above which a point has a height of its own."""

LEAST_ROUGHNESS_M, LEAST_TAPE_SCALE = 0.02, 1e-3
"""Least roughness of the ground [m] and least sigma of the scale of tapes. With zero, no point
could be off the ground, and no tape in another unit."""

NO_PLACE = (LeftOutCause.NO_GROUND, LeftOutCause.MISPLACED_FRAME, LeftOutCause.GROSS)
"""Causes of missing first values for picks that contradict others; all other causes are
undetermined picks."""

MISPLACED = LeftOut(
    LeftOutCause.MISPLACED_FRAME,
    "most of its picks contradict all other observations: look for labels in disorder, for a photo "
    "of another place, or one that was mirrored or turned",
)


DISAGREEING = LeftOut(
    LeftOutCause.GROSS, "all other observations contradict it, and leave no place for its point"
)

EITHER = LeftOut(
    LeftOutCause.MISPLACED_FRAME,
    "it and the other photo contradict each other, and nothing shows which of the two is wrong: "
    "look whether both show the same points, and whether one was mirrored or turned",
)


@dataclass(frozen=True, eq=False)
class Robust:
    """Survey adjusted without its gross errors.

    Attributes
    ----------
    survey
        Survey without control points that are gross errors, and with a height of its own for each
        label that is off the ground.
    refined
        Its adjustment; `line_removed`, `known_removed`, `pick_reason` and `pose_widened` hold the
        other gross errors.
    control
        Rows of the control points of the original survey that were left out.
    labels
        Names of labels off the ground.
    heights
        Names of labels whose stated heights are gross errors: they have heights of their own.
    contradicting
        Names of labels whose picks contradict each other. These picks have sigmas as large as their
        misfit, since no observation shows which of them is wrong.
    exchanged
        Names of two control points that have each other's coordinates in `survey`; empty for none.
    """

    survey: Survey
    refined: Refined
    control: Ints
    labels: tuple[str, ...] = ()
    heights: tuple[str, ...] = ()
    contradicting: tuple[str, ...] = ()
    exchanged: tuple[str, ...] = ()

    def count_others(self) -> int:
        """Count the gross errors that are no picks, lengths or poses of the log."""
        heights = len(self.labels) + len(self.heights)
        known = len(self.refined.known_removed)
        mistakes = int(bool(self.exchanged))
        return heights + known + len(self.control) + len(self.contradicting) + mistakes

    def count_numbers(self) -> int:
        """Count the numbers of these: two of a control point, or of a label that contradicts."""
        return self.count_others() + len(self.control) + len(self.contradicting)

    def messages(self, survey: Survey) -> Iterator[Message]:
        """Report what was left out of control and heights, and picks that contradict."""
        names = (survey.label[k] for k in survey.control_label[self.control])
        contested = [self.refined.is_contested("control", name) for name in names]
        control = self.control[~np.array(contested, dtype=np.bool_)]
        yield from report_control_left_out(survey, self.refined, control)
        if not self.refined.is_contested("control", _name_pair(self.exchanged)):
            yield from report_control_exchanged(survey, self.refined, self.exchanged)
        yield from report_heights_left_out(survey, self.refined, self.heights)
        for label in self.contradicting:
            own = survey.pick_label == survey.label.index(label)
            frames = tuple(dict.fromkeys(survey.frame_id[k] for k in survey.pick_frame[own]))
            what = f"{label!r} in {join_photo_names(frames)}"
            text = (
                f"The picks of {what} contradict each other. Nothing shows which of them is wrong, "
                "so what depends on it is uncertain by as much as they differ. Pick it again in "
                "these photos, or in another one too."
            )
            several = MessagePlural(
                "The picks of {count} points contradict each other",
                what,
                ending="Pick them again in these photos, or in another one too.",
            )
            yield Message(
                "warning",
                "picks-contradict",
                text,
                frames=frames,
                labels=(label,),
                several=several,
            )


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
        wrong = _find_wrong_poses(agreed[0].annealed, taking.pose_widened) if agreed else {}
        prior = taking.survey.telemetry
        if prior is not None and len(taking.pose_widened) < len(wrong) == len(prior.frame_index):
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
    return Robust(taking.survey, plain, np.zeros(0, dtype=np.int64))


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


def _are_most_left(whole: Participants, rest: Participants) -> bool:
    """Return whether few frames were left out; if many were, the frames are not at fault."""
    before, after = (np.unique(one.survey.pick_frame[one.keep]) for one in (whole, rest))
    return len(after) >= (1.0 - MAX_GROSS_SHARE) * len(before)


def _bound_cost_in_order(taking: Participants) -> float:
    """Bound the sum of squares of an adjustment in order (`_is_in_order`)."""
    survey = taking.survey
    if survey.matches.points + survey.ties.points:
        return np.inf  # their sightings begin far off, and are tested elsewhere
    readings = len(survey.pick_frame) + len(survey.line_start) + len(survey.known)
    others = len(survey.control_label) + len(survey.label) + len(survey.frame_id)
    return ORDINARY_SIGMAS**2 * (readings + others)


def _is_in_order(taking: Participants, refined: Refined) -> bool:
    """Return whether an ordinary adjustment uses all observations and has no large misfit."""
    adjustment = refined.adjustment
    if not adjustment.minimum.converged or len(refined.pick_reason) > len(taking.reason):
        return False
    if compute_core_fit(adjustment).probability < MISFIT_PROBABILITY:
        return False
    squares = compute_squared_misfits(adjustment.problem, adjustment.minimum, {})
    return all(square.max(initial=0.0) < ORDINARY_SIGMAS**2 for square in squares.values())


@dataclass(frozen=True, eq=False)
class Candidate:
    """Robust adjustment from certain first values.

    Attributes
    ----------
    taking
        Participating observations.
    first
        The adjustment from which it began; its `pick_index` holds the picks of the robust
        adjustment.
    annealed
        The robust adjustment.
    price
        Cost of an exchange that it takes into account; zero without one.
    exchanged
        Names of two control points that have each other's coordinates in it; empty for none.
    """

    taking: Participants
    first: Refined
    annealed: Annealed
    price: float = 0.0
    exchanged: tuple[str, ...] = ()

    @property
    def left_out(self) -> tuple[object, ...]:
        """Key of the left-out observations: equal for candidates that leave out the same."""
        gross = ((name, *self.annealed.gross(name).tolist()) for name in self.annealed.misfit)
        return (self.first.pick_index.tobytes(), *gross, self.exchanged)

    @property
    def unplaced(self) -> Ints:
        """Picks without a place in the robust adjustment, by their row in the whole survey."""
        return np.setdiff1d(np.flatnonzero(self.taking.keep), self.first.pick_index)

    @property
    def contradicting(self) -> Ints:
        """Picks without a place for another reason than too few observations."""
        why = self.first.pick_reason
        return np.array(
            [k for k in self.unplaced.tolist() if why.get(k, MISPLACED).cause in NO_PLACE],
            dtype=np.int64,
        )

    @property
    def misplaced(self) -> tuple[str, ...]:
        """Names of frames that contradict all the others."""
        survey, frames = self.taking.survey, self.annealed.frames
        if survey.telemetry is not None:  # otherwise the pose of the log leads to the sky
            return frames
        placed = survey.pick_frame[self.first.pick_index]
        lost = np.setdiff1d(survey.pick_frame[self.contradicting], placed)
        return (*frames, *(survey.frame_id[k] for k in lost.tolist()))

    @property
    def used(self) -> Ints:
        """Picks that take part, by their row in the whole survey."""
        return np.delete(self.first.pick_index, self.annealed.gross("pixels"))

    def cost(self, whole: Participants) -> float:
        """Return the cost, with each participating pick without a place as a gross error.

        Of a whole photo without a place only so many picks count as gross errors as determine its
        pose and check it, and the others as errors of the stated size. So do lengths, known things
        and control at points without a place.
        """
        frame, frames = whole.survey.pick_frame, len(whole.survey.frame_id)
        placed = np.bincount(frame[self.first.pick_index], minlength=frames)
        lost = np.bincount(frame[whole.keep], minlength=frames) - placed
        gross = np.where(placed > 0, lost, np.minimum(lost, MOST_GROSS_OF_A_PHOTO))
        usual = 2.0 * (lost - gross)  # expected sum of squares of two numbers each
        picks = float(np.sum(GROSS_SIGMAS**2 * gross + usual))
        return self.annealed.cost + picks + self._count_lost_numbers(whole) + self.price

    def _count_lost_numbers(self, whole: Participants) -> int:
        """Count the numbers of lengths, known things and control that have no part in it."""
        survey, problem = whole.survey, self.annealed.problem
        lines = int((~whole.line_removed).sum()) - len(problem.line_index)
        control = len(survey.control_label) - len(problem.survey.control_label)
        known = len(survey.known) - len(whole.known_removed) - len(problem.known)
        return lines + known + COORDINATES * control

    def fits(self) -> bool:
        """Test whether the observations without the gross errors agree (chi-square test)."""
        found, blocks = self.annealed, self.annealed.minimum.blocks
        gross = {name: len(found.gross(name)) for name in found.misfit}
        left = sum(blocks[name].residual.shape[1] * count for name, count in gross.items())
        numbers = sum(block.residual.size for block in blocks.values())
        degrees = max(numbers - left - found.problem.layout.size, 1)
        # Sum of squares of the rest.
        squares = found.cost - sum(compute_gross_cost(name) * n for name, n in gross.items())
        return bool(squares < chdtri(degrees, MISFIT_PROBABILITY))

    def is_agreed(self) -> bool:
        """Return whether nearly all take part, and no other length or the log could be wrong."""
        is_converged = self.annealed.minimum.converged and not self.misplaced
        gross = self._count_gross_errors()
        number = sum(map(len, self.annealed.misfit.values()))
        is_log_lost = gross > 1 and self.gives_up_log()
        if not is_converged or gross > max(1, FEW_GROSS_SHARE * number) or is_log_lost:
            return False
        if gross and not self.checks_lengths():
            return False  # an unchecked length could be wrong instead
        is_bent = bool(gross) or not self.fits()
        if self.exchanges_lengths() or (is_bent and self._is_alone_without_log()):
            return False  # in another pose another reading may be wrong
        if any(_has_rival(self.annealed, row) for row in self.annealed.gross("lengths")):
            return False
        if self._has_raised_point_in_error():
            return False  # a wrong pick may raise its point, and spoil a length there
        return not self._strains_a_prior()

    def _has_raised_point_in_error(self) -> bool:
        """Return whether a length or a pick of a point off the ground is a gross error, too."""
        found, problem = self.annealed, self.annealed.problem
        raised = problem.third.rough[found.gross("roughness")]
        line = problem.line_index[found.gross("lengths")]
        survey = problem.survey
        labels = (
            survey.line_start[line],
            survey.line_end[line],
            survey.pick_label[found.gross("pixels")],
        )
        return bool(np.isin(np.concatenate(labels), raised).any())

    def has_several_gross_errors(self) -> bool:
        """Return whether several observations are gross errors, or a misfit remains without."""
        gross = sum(len(self.annealed.gross(name)) for name in self.annealed.misfit)
        return gross > 1 or not self.fits()

    def keeps_lengths(self, whole: Participants) -> bool:
        """Return whether no length is unseen without left-out photos: it may be the wrong one."""
        used = self.first.line_index[self.annealed.problem.line_index]
        return set(used.tolist()) >= _find_seen_lines(whole)

    def exchanges_lengths(self) -> bool:
        """Return whether it takes an exchange of two lengths into account."""
        return self.price > 0.0 and not self.exchanged

    def doubts_a_tape(self) -> bool:
        """Return whether the common scale of a tape's lengths is a gross error in it."""
        return bool((self.annealed.misfit.get("tape", np.zeros(0)) > GROSS_SIGMAS).any())

    def leaves_out_nothing(self) -> bool:
        """Return whether all observations take part, and fit."""
        return not self._count_gross_errors() and self.fits()

    def list_unused_control(self, whole: Participants) -> Ints:
        """List the rows of control points that have no part in it, or are gross errors."""
        problem = self.annealed.problem
        used = np.delete(problem.survey.control_label, self.annealed.gross("control"))
        names = {problem.survey.label[k] for k in used.tolist()}
        survey = whole.survey
        is_unused = [survey.label[k] not in names for k in survey.control_label.tolist()]
        return np.flatnonzero(is_unused)

    def leaves_no_other(self) -> bool:
        """Return whether no other explanation is left: all take part, or nearly all agree."""
        return not self._count_gross_errors() or self.is_agreed()

    def _count_gross_errors(self) -> int:
        """Count gross errors and picks without a place; points off the ground are none."""
        misfit = self.annealed.misfit
        gross = sum(len(self.annealed.gross(name)) for name in misfit if name != "roughness")
        return gross + len(self.contradicting) + len(self.first.undetermined)

    def explains(self) -> bool:
        """Return whether few gross errors explain everything, without a photo that contradicts."""
        is_explained = (self.fits() or self.is_agreed()) and not self.is_in_disorder()
        return is_explained and not self.misplaced

    def is_in_disorder(self) -> bool:
        """Return whether so much is wrong that a whole photo may be, which would cost less.

        Picks are part of it: where the photos agree with each other, none of them is wrong.
        """
        wrong = self._wrong_picks + self._wrong_references
        is_costly = self._wrong_picks > 0 and wrong > MOST_GROSS_OF_A_PHOTO
        return is_costly or not self.annealed.minimum.converged

    def may_hide_a_photo(self) -> bool:
        """Return whether one of two photos may be wrong instead, which would cost less.

        Its pose adapts to the other photo, though both may be of different scales.
        """
        photos = len(np.unique(self.taking.survey.pick_frame[self.first.pick_index]))
        found = self.annealed
        price = sum(compute_gross_cost(name) * len(found.gross(name)) for name in found.misfit)
        return photos == 2 and price >= MOST_GROSS_OF_A_PHOTO * GROSS_SIGMAS**2

    def doubts_a_photo(self) -> bool:
        """Return whether much is wrong, and more picks than lengths, known things and control."""
        return self.is_in_disorder() and self._wrong_picks > self._wrong_references

    @property
    def _wrong_picks(self) -> int:
        return len(self.annealed.gross("pixels")) + len(self.contradicting)

    @property
    def _wrong_references(self) -> int:
        return sum(len(self.annealed.gross(name)) for name in READINGS if name != "pixels")

    def has_scale(self) -> bool:
        """Return whether one of the lengths, known things and control takes part, or the log fits.

        A log that is given up, or strained, does not determine the size of the scene alone.
        """
        misfit = self.annealed.misfit
        references = [name for name in READINGS if name != "pixels" and name in misfit]
        is_left = (len(self.annealed.gross(name)) < len(misfit[name]) for name in references)
        return not references or any(is_left) or self._fits_log()

    def _fits_log(self) -> bool:
        """Return whether most poses of the log fit at their stated sigmas."""
        prior, problem = self.annealed.problem.survey.telemetry, self.annealed.problem
        if prior is None:
            return False
        blocks = problem.evaluate(self.annealed.minimum.state)
        assert blocks is not None  # noqa: S101  (the iterations ended there)
        fits = np.linalg.norm(blocks["telemetry"].residual, axis=1) <= GROSS_SIGMAS
        names = (problem.survey.frame_id[k] for k in prior.frame_index.tolist())
        stated = np.array([name not in self.taking.pose_widened for name in names])
        return bool(2 * (fits & stated).sum() > len(fits))

    def gives_up_log(self) -> bool:
        """Return whether half of the log's poses, or more, are gross errors."""
        misfit = self.annealed.misfit.get("telemetry", np.zeros(0))
        return len(misfit) > 0 and 2 * len(self.annealed.gross("telemetry")) >= len(misfit)

    def checks_lengths(self) -> bool:
        """Return whether other observations check every length."""
        return bool(self.annealed.misfit.get("lengths", np.ones(1)).all())

    def _is_alone_without_log(self) -> bool:
        """Return whether few readings place a single photo: a wrong one leads to another pose."""
        survey = self.annealed.problem.survey
        return survey.telemetry is None and len(survey.frame_id) == 1

    def _strains_a_prior(self) -> bool:
        """Return whether a shared unknown, such as the camera, is far from its prior."""
        common = (
            block
            for name, block in self.annealed.minimum.blocks.items()
            if name not in ROBUST and get_kind(name).role != "construction"
        )
        return any(np.abs(block.residual).max(initial=0.0) > GROSS_SIGMAS for block in common)


_Search: TypeAlias = Callable[[Participants, Sequence[Candidate]], Iterator[Candidate]]
"""Function that adjusts robustly from other first values than those of the candidates so far."""


def _find_seen_lines(taking: Participants) -> set[int]:
    """Find the lengths that take part and both of whose ends are picked."""
    survey = taking.survey
    picked = np.unique(survey.pick_label[taking.keep])
    is_seen = np.isin(survey.line_start, picked) & np.isin(survey.line_end, picked)
    return set(np.flatnonzero(is_seen & ~taking.line_removed).tolist())


def _find_best_candidates(taking: Participants) -> list[Candidate]:
    """Adjust robustly from all first values; return the candidates, that of least cost first.

    First values without some of the observations are tried where the earlier ones lead to no
    agreement.
    """
    exchanged: set[tuple[str, int, int]] = set()
    try_exchanged_readings = partial(_try_exchanged_readings, exchanged)
    found = _sort_by_cost(taking, _take_until_agreed(_adjust_from_softened(taking)))
    found = _sort_by_cost(taking, chain(found, try_exchanged_readings(taking, found)))
    if found and found[0].is_agreed() and found[0].fits():
        return found[:1]
    # Several gross errors, or one that leaves a misfit, may be the effects of another single one.
    several = (one for one in found if one.has_several_gross_errors())
    found = _sort_by_cost(taking, chain(found, *map(_try_single_error, several)))
    if found and found[0].is_agreed():
        return found[:1]
    # First values may depend on gross errors: leave out some observations.
    searches: list[_Search] = [_try_without_references, _try_without_photos]
    if not found or found[0].doubts_a_photo():
        searches.reverse()
    last: tuple[_Search, ...] = (try_exchanged_readings, _try_without_two_lengths)
    for search in (_try_without_suspects, *searches, *last):
        best = found[:1]
        for candidate in search(taking, found):
            found = _sort_by_cost(taking, [*found, candidate])
            is_sure = candidate.is_agreed() and candidate.keeps_lengths(taking)
            if is_sure and found and found[0] is candidate:
                return found[:1]
        # Without references, or with other gross errors, something else may be wrong: search on.
        if search is _try_without_references or found[:1] == best or not found[0].explains():
            continue
        if found[0].leaves_no_other() and found[0].keeps_lengths(taking):
            break
    return found


def _take_until_agreed(candidates: Iterable[Candidate]) -> Iterator[Candidate]:
    """Take candidates up to the first that fits, and in which nearly all observations agree."""
    for one in candidates:
        yield one
        if one.is_agreed() and one.fits():
            return


def _try_without_references(
    taking: Participants, found: Sequence[Candidate]
) -> Iterator[Candidate]:
    """Adjust robustly from first values without a click, a known thing, control, or lengths.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    whole, patience = _add_small_roughness(taking), _choose_patience(taking, found)
    parts = (
        _leave_out_contradicting_control,
        _leave_out_each_click,
        _leave_out_each_known_thing,
        _leave_out_each_length,
        _leave_out_all_but_a_length,
    )
    for part in chain.from_iterable(leave_out(whole) for leave_out in parts):
        yield from _adjust_from_reduced(part, whole, taking, patience)


def _try_without_two_lengths(
    taking: Participants, found: Sequence[Candidate]
) -> Iterator[Candidate]:
    """Adjust robustly from first values without each pair of lengths, where no log gives others.

    Several photos that agree need no such search, nor does an explanation likelier than two errors.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    if found and found[0].explains():
        is_costly = found[0].cost(taking) + MAX_RIVAL_INCREASE > 2.0 * GROSS_SIGMAS**2
        if not is_costly or len(np.unique(taking.survey.pick_frame)) > 1:
            return
    whole, patience = _add_small_roughness(taking), _choose_patience(taking, found)
    lines = np.flatnonzero(~taking.line_removed).tolist()
    if taking.survey.telemetry is None and 4 < len(lines) <= MOST_IN_PAIRS:
        for rest in map(whole.leave_out_lines, combinations(lines, 2)):
            yield from _adjust_from_reduced(rest, whole, taking, patience)


def _try_without_suspects(taking: Participants, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Adjust robustly without all photos that contradict the rest, until no other one does.

    A photo of another place, mirrored, or with its labels in disorder spoils the tests of all
    others. Without it, the adjustment starts again from new first values.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    names, rest = found[0].misplaced if found else (), taking
    while names:
        before, rest = rest, taking.leave_out_frames(names, MISPLACED)
        # A photo without picks takes part by matches alone, which stay.
        if rest.keep.sum() == before.keep.sum() or not _are_most_left(taking, rest):
            return
        each = chain(_adjust_from_rest(rest), _adjust_from_softened(rest))
        best = _sort_by_cost(rest, _take_until_agreed(each))[:1]
        yield from best
        names = (*names, *best[0].misplaced) if best and best[0].misplaced else ()


def _try_without_photos(taking: Participants, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Adjust robustly without one photo until the rest fits, or with those of its picks that agree.

    Where either of two photos fits alone, nothing shows which of them is wrong.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    photos = _photos_by_gross_picks(taking, found)
    is_explained = bool(found) and found[0].explains() and not found[0].may_hide_a_photo()
    if not 1 < len(photos) <= MOST_STARTS or is_explained:
        return
    parts = (taking.leave_out_frames([name], MISPLACED) for name in photos)
    each = (one for rest in parts for one in _adjust_from_rest(rest))
    fitting = (one for one in each if one.explains() and one.leaves_no_other())
    best = _better_of_two(taking, fitting) if len(photos) == 2 else list(islice(fitting, 1))
    for candidate in best:
        agreeing = list(_try_without_wrong_picks(taking, candidate))
        yield from agreeing
        # A photo of several whose picks mostly agree shows this place, also where that is no
        # better.
        if len(photos) == 2 or not any(one.explains() for one in agreeing):
            yield candidate


def _adjust_from_rest(rest: Participants) -> Iterator[Candidate]:
    """Adjust robustly from the ordinary minima of the remaining observations."""
    whole = _add_small_roughness(rest)
    return _adjust_from_reduced(whole, whole, rest)


def _photos_by_gross_picks(taking: Participants, found: Sequence[Candidate]) -> list[str]:
    """Return names of photos with picks, those with the largest share of gross errors first."""
    frame, names = taking.survey.pick_frame, taking.survey.frame_id
    number = np.bincount(frame[taking.keep], minlength=len(names))
    used = found[0].used if found else np.flatnonzero(taking.keep)
    wrong = 1.0 - np.bincount(frame[used], minlength=len(names)) / np.maximum(number, 1)
    return [names[k] for k in np.argsort(-wrong, kind="stable") if number[k]]


def _better_of_two(taking: Participants, alone: Iterable[Candidate]) -> list[Candidate]:
    """Return the better of the candidates without either of two photos.

    Where each of the two fits alone, the picks of the photo are left out with the reason `EITHER`:
    their costs are of different observations, so the smaller one is no evidence.
    """
    fitting = _sort_by_cost(taking, alone)
    if len(fitting) < 2:
        return fitting
    best = fitting[0].taking
    left = np.flatnonzero(taking.keep & ~best.keep).tolist()
    reason = {**best.reason, **dict.fromkeys(left, EITHER)}
    return [replace(fitting[0], taking=replace(best, reason=reason))]


def _try_without_wrong_picks(taking: Participants, without: Candidate) -> Iterator[Candidate]:
    """Adjust robustly with the picks of left-out photos that agree on a pose, among wrong ones.

    Labels that are swapped, or one wrong pick, rotate and move their photo, and all of its picks
    contradict the others.

    Parameters
    ----------
    taking
        Participating observations.
    without
        Candidate without some photos, whose points place them again.
    """
    survey, reduced = taking.survey, without.annealed.problem.survey
    point_m, camera = without.annealed.minimum.state.point, survey.calibration
    row = np.array([reduced.row_of_label.get(name, -1) for name in survey.label])
    known = (row >= 0) & ~survey.off_ground
    left = taking.keep & ~without.taking.keep & known[survey.pick_label]
    wrong: list[int] = []
    for frame in np.unique(survey.pick_frame[left]).tolist():
        picks = np.flatnonzero(left & (survey.pick_frame == frame))
        ray = back_project(camera.model, camera.parameters, survey.pixel_px[picks])
        is_in_lens = np.isfinite(ray).all(axis=1)
        picks, ray = picks[is_in_lens], ray[is_in_lens]
        sigma = survey.pick_sigma_px[picks] / camera.parameters[0]
        agree = find_consensus(point_m[row[survey.pick_label[picks]], :2], ray, sigma)
        if agree is None or 2 * agree.sum() <= len(picks) or agree.sum() <= MIN_PICKS:
            return  # so few agree on any pose
        wrong += picks[~agree].tolist()
    whole = _add_small_roughness(taking)
    yield from _adjust_from_reduced(
        whole.leave_out_picks(dict.fromkeys(wrong, MISPLACED)), whole, taking
    )


def _add_small_roughness(taking: Participants) -> Participants:
    """Return the observations with a little roughness of the ground, and of the tapes' scales."""
    return replace(taking, survey=_softer(taking.survey, 1.0))


def _choose_patience(taking: Participants, found: Sequence[Candidate]) -> Patience:
    """Choose the patience with a part whose missing observation could be the gross error.

    Where few gross errors explain everything, a part that still contains some is no rival, and not
    worth a robust adjustment; few iterations show whether it does.
    """
    if not found or not found[0].explains() or len(found[0].unplaced):
        return FULL
    goal = found[0].cost(taking) + MAX_RIVAL_INCREASE - GROSS_SIGMAS**2
    return QUICK_TRIAL._replace(goal=goal)


def _sort_by_cost(taking: Participants, candidates: Iterable[Candidate]) -> list[Candidate]:
    """Sort candidates by their cost for all participating picks, that of least cost first.

    Candidates with photos that contradict the rest come last: without these photos the other
    observations may show something else. The log as a whole is given up where nothing else
    explains everything. Candidates without a scale are none: a scene of no size has no misfit on
    the ground.
    """
    scaled = [one for one in candidates if one.has_scale()]
    log_may_be_right = any(one.explains() and not one.gives_up_log() for one in scaled)
    return sorted(
        scaled,
        key=lambda one: (
            len(one.misplaced) > 0,
            log_may_be_right and one.gives_up_log(),
            one.cost(taking),
        ),
    )


def _try_exchanged_readings(
    tried: set[tuple[str, int, int]], taking: Participants, found: Sequence[Candidate]
) -> Iterator[Candidate]:
    """Adjust with the readings of two lengths, or the coordinates of two control points, exchanged.

    Of few control points, two that are exchanged agree with each other in another direction of the
    scene, and a right one contradicts them. Two exchanged lengths lead to another pose, in which a
    right reading is a gross error. Lengths are left out then; coordinates remain exchanged, as
    nothing else may place the scene. An exchange has to explain everything, unless nothing else
    gives a result.

    Parameters
    ----------
    tried
        Kind and rows of exchanges that were tried before; those of this call are added.
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    if found and found[0].leaves_out_nothing():
        return
    goal = found[0].cost(taking) + MAX_RIVAL_INCREASE if found else np.inf
    survey = taking.survey
    control, is_explained = _list_control_to_exchange(taking, found), False
    for pair in _choose_untried("control", control, tried):
        world_m, sigma_m = survey.control_world_m.copy(), survey.control_sigma_m.copy()
        world_m[pair], sigma_m[pair] = world_m[pair[::-1]], sigma_m[pair[::-1]]
        other = replace(survey, control_world_m=world_m, control_sigma_m=sigma_m)
        exchanged = replace(taking, survey=other)
        whole = _add_small_roughness(exchanged)
        names = tuple(survey.label[k] for k in survey.control_label[pair])
        for one in _adjust_from_reduced(whole, whole, exchanged, Patience(goal=goal), again=True):
            explains_all = one.leaves_out_nothing()
            is_explained |= explains_all
            if explains_all or not found:
                yield replace(one, price=CONTROL_EXCHANGE_COST, exchanged=names)
    if is_explained:
        return  # two lengths would cost more
    several = [one for one in found[:1] if len(one.annealed.problem.survey.frame_id) > 1]
    lines = _list_lengths_to_exchange(taking)
    for best in several:
        lines = _choose_promising_lengths(best, goal, lines)
    for pair in _choose_untried("lengths", lines, tried):
        length_m = survey.length_m.copy()
        length_m[pair] = length_m[pair[::-1]]
        reduced = replace(taking, survey=replace(survey, length_m=length_m))
        rest = taking.leave_out_lines(pair)
        patience = Patience(goal=goal)
        parts = (_add_small_roughness(reduced), _add_small_roughness(rest), rest)
        for one in _adjust_from_reduced(*parts, patience, again=True):
            if one.leaves_out_nothing() and _adjust_without_candidate(one) is not None:
                yield replace(one, price=LENGTH_EXCHANGE_COST)


def _choose_promising_lengths(
    best: Candidate, goal: float, pairs: Iterable[list[int]]
) -> Iterator[list[int]]:
    """Choose the pairs of lengths whose exchange explains what a candidate of several photos left.

    One Gauss-Newton step with all observations and the exchanged readings gives the sum of squares
    in the linear model. Several photos show the shape of the ground without lengths.

    Parameters
    ----------
    best
        The candidate of least cost.
    goal
        Sum of squares that the exchange has to reach.
    pairs
        Pairs of lengths, by row of the whole survey.
    """
    problem = best.annealed.problem
    blocks = problem.evaluate(best.annealed.minimum.state)
    if blocks is None or "lengths" not in blocks:
        return
    normal = NormalEquations(list(blocks.values()), problem.layout.size, problem.layout.structure)
    factor, own = normal.factor(DAMPING), blocks["lengths"]
    row = {int(line): k for k, line in enumerate(best.first.line_index[problem.line_index])}
    survey = best.taking.survey
    whole = normal.cost - float(normal.gradient @ factor.solve(normal.gradient))
    for pair in pairs:
        rows = [row[line] for line in pair if line in row]
        change = survey.length_m[pair[::-1]] - survey.length_m[pair]
        if len(rows) < 2:
            yield pair
            continue
        residual = own.residual.copy()
        residual[rows, 0] -= change / survey.length_sigma_m[pair]
        exchanged = {**blocks, "lengths": replace(own, residual=residual)}
        gradient = compute_gradient(exchanged.values(), problem.layout.size)
        squares = compute_cost(exchanged.values()) - float(gradient @ factor.solve(gradient))
        if squares <= max(goal, (1.0 - MIN_DECREASE_SHARE) * whole):
            yield pair


def _choose_untried(
    kind: str, pairs: Iterable[list[int]], tried: set[tuple[str, int, int]]
) -> Iterator[list[int]]:
    """Choose the pairs of rows of a kind that were not tried before, and add them to those."""
    for first, second in pairs:
        if (kind, first, second) not in tried:
            tried.add((kind, first, second))
            yield [first, second]


def _list_control_to_exchange(
    taking: Participants, found: Sequence[Candidate]
) -> Iterator[list[int]]:
    """List pairs of control points, by row, that may have each other's coordinates.

    Where a log, or three others, place the scene, those that the best candidate leaves out are
    among them.
    """
    survey = taking.survey
    number, is_logged = len(survey.control_label), survey.telemetry is not None
    wrong = found[0].list_unused_control(taking) if found else np.arange(number)
    is_shown = is_logged and bool(found) and found[0].fits()
    least = 0
    if is_shown or number - len(wrong) >= LEAST_AGREEING_CONTROL:
        least = min(len(wrong), 2)
    pairs = [
        list(pair)
        for pair in combinations(range(number), 2)
        if np.isin(pair, wrong).sum() >= max(least, int(is_shown))
        and not (found and _contradicts_exchange(found[0], taking, list(pair)))
    ]
    if len(pairs) <= MOST_EXCHANGES and number + int(is_logged) >= LEAST_AGREEING_CONTROL:
        yield from pairs


def _contradicts_exchange(best: Candidate, taking: Participants, pair: list[int]) -> bool:
    """Return whether several photos show another shape than the control with a pair exchanged."""
    found, survey = best.annealed, taking.survey
    is_reliable = best.fits() and found.minimum.converged and not best.misplaced
    if not is_reliable or len(found.problem.survey.frame_id) < 2:
        return False
    row = best.annealed.problem.survey.row_of_label
    known = [k for k, label in enumerate(survey.control_label) if survey.label[label] in row]
    here = found.minimum.state.point[[row[survey.label[k]] for k in survey.control_label[known]]]
    there = survey.control_world_m.copy()
    there[pair] = there[pair[::-1]]
    return not do_all_agree(here[:, :2], there[known, :2])


def _list_lengths_to_exchange(taking: Participants) -> Iterator[list[int]]:
    """List pairs of lengths, by row, that may have each other's readings, without a log."""
    survey = taking.survey
    lines = np.flatnonzero(~taking.line_removed).tolist()
    pairs = [
        list(pair)
        for pair in combinations(lines, 2)
        if abs(np.diff(survey.length_m[list(pair)])[0])
        > GROSS_SIGMAS * survey.length_sigma_m[list(pair)].max()
    ]
    if survey.telemetry is None and len(pairs) <= MOST_STARTS:
        yield from pairs


def _leave_out_contradicting_control(whole: Participants) -> Iterator[Participants]:
    """Leave out the control that contradicts most other control, in the network of the photos.

    Where the photos have no network without control, in the pose of one photo.
    """
    survey = whole.survey
    if survey.telemetry is not None or len(survey.control_label) < 3:
        return
    without = select_control(survey, np.zeros(len(survey.control_label), dtype=np.bool_))
    network = adjust_on_trial(replace(whole, survey=replace(without, gauge="plane")), QUICK_TRIAL)
    if network is None:
        agree = _find_control_of_one_pose(whole)
    else:
        names = [survey.label[k] for k in survey.control_label]
        row = network.adjustment.label_rows(names)
        point = network.adjustment.state.point[row, :2]
        here = np.where(row[:, None] >= 0, point, np.nan)
        agree = find_agreeing_control(here, survey.control_world_m[:, :2])
    if agree.any() and not agree.all():
        yield replace(whole, survey=select_control(survey, agree))


def _find_control_of_one_pose(whole: Participants) -> Bools:
    """Mark the control points (C,) that agree on a pose of the photo with most of them."""
    survey, camera = whole.survey, whole.survey.calibration
    row = np.full(len(survey.label), -1)
    row[survey.control_label] = np.arange(len(survey.control_label))
    usable = whole.keep & (row[survey.pick_label] >= 0)
    number = np.bincount(survey.pick_frame[usable], minlength=len(survey.frame_id))
    picks = np.flatnonzero(usable & (survey.pick_frame == number.argmax()))
    # One click of each point.
    of, first = np.unique(row[survey.pick_label[picks]], return_index=True)
    picks = picks[first]
    ray = back_project(camera.model, camera.parameters, survey.pixel_px[picks])
    is_in_lens = np.isfinite(ray).all(axis=1)
    of, picks, ray = of[is_in_lens], picks[is_in_lens], ray[is_in_lens]
    # Control points are near a plane only, so that a pose by four of them is a rough one.
    sigma = ROUGH_POSE_FACTOR * survey.pick_sigma_px[picks] / camera.parameters[0]
    found = find_consensus(survey.control_world_m[of, :2], ray, sigma) if len(of) else None
    agree = np.zeros(len(survey.control_label), dtype=np.bool_)
    if found is not None and found.sum() >= MIN_PICKS:
        agree[of[found]] = True
    return agree


def _leave_out_each_click(whole: Participants) -> Iterator[Participants]:
    """Leave out each point of a single photo without a log at which lengths and the like end."""
    survey = whole.survey
    picks = np.flatnonzero(whole.keep)
    if survey.telemetry is not None or len(np.unique(survey.pick_frame[picks])) != 1:
        return
    things = [k for one in survey.known for k in one.label]
    is_end = _are_ends(survey, survey.pick_label[picks])
    is_end |= np.isin(survey.pick_label[picks], [*things, *survey.control_label])
    labels = np.unique(survey.pick_label[picks[is_end]])
    for label in labels.tolist() if len(labels) <= MOST_STARTS else []:
        own = picks[survey.pick_label[picks] == label].tolist()
        yield whole.leave_out_picks(dict.fromkeys(own, DISAGREEING))


def _leave_out_each_known_thing(whole: Participants) -> Iterator[Participants]:
    """Leave out each known thing, and all control points or, where no log places photos, each."""
    survey, number = whole.survey, len(whole.survey.control_label)
    things = [one.index for one in survey.known if one.index not in whole.known_removed]
    for thing in things if len(things) <= MOST_STARTS else []:
        yield replace(whole, known_removed=whole.known_removed | {thing})
    each, together = np.eye(number, dtype=np.bool_), np.ones((1, number), dtype=np.bool_)
    left_out = each if survey.telemetry is None else together
    for rows in left_out if len(left_out) <= MOST_STARTS else []:
        if rows.any():
            yield replace(whole, survey=select_control(survey, ~rows))


def _leave_out_each_length(whole: Participants) -> Iterator[Participants]:
    """Leave out all lengths where there is a log, and each one where no third photo checks it.

    First values without a log may depend on a wrong length, and so may the poses of one or two
    photos with one. Where all lengths are in another unit, they and the log may force all other
    observations into agreement with them.
    """
    survey, lines = whole.survey, np.flatnonzero(~whole.line_removed).tolist()
    if survey.telemetry is not None and lines:
        yield whole.leave_out_lines(lines)
    are_few = len(np.unique(survey.pick_frame[whole.keep])) < SEVERAL_PHOTOS
    if (survey.telemetry is None or are_few) and len(lines) <= MOST_STARTS:
        yield from (whole.leave_out_lines([line]) for line in lines)


def _leave_out_all_but_a_length(whole: Participants) -> Iterator[Participants]:
    """Leave out all references but one length, where several photos show the shape of the ground.

    Several wrong lengths, as at a label that is swapped, may distort the first values of all
    photos.
    """
    survey, lines = whole.survey, np.flatnonzero(~whole.line_removed)
    photos = len(np.unique(survey.pick_frame[whole.keep]))
    if survey.telemetry is not None or photos < SEVERAL_PHOTOS or not len(lines):
        return
    without = select_control(survey, np.zeros(len(survey.control_label), dtype=np.bool_))
    longest = lines[np.argsort(-survey.length_m[lines], kind="stable")][:MOST_LENGTHS_ALONE]
    for line in longest.tolist():
        rest = np.setdiff1d(lines, line).tolist()
        yield replace(whole.leave_out_lines(rest), survey=without)


def _adjust_from_softened(taking: Participants) -> Iterator[Candidate]:
    """Adjust robustly from hundredfold sigmas, and from heights that photos show.

    The second start is for surveys with most points off the ground, as on roofs and cars: there no
    point pulls the ground plane.
    """
    whole = replace(taking, survey=_softer(taking.survey, 1.0))
    try:
        first = find_best_minima(replace(taking, survey=_softer(taking.survey, SCHEDULE[0])))
    except GeometryError:
        return
    for adjustment in (first.adjustment, *first.alternatives[:MOST_ALTERNATIVES]):
        with suppress(SingularError, ValueError):  # undetermined, or impossible with all of it
            placed, problem = _build_stated_problem(adjustment, first, whole)
            annealed = anneal(problem, convert_state(adjustment, problem))
            yield Candidate(taking, placed, annealed)
    with suppress(SingularError, ValueError):
        placed, problem = _build_stated_problem(first.adjustment, first, whole)
        survey = problem.survey
        # Second start: heights are nearly free, then points clear of the main plane leave the
        # ground.
        grounds = [replace(one, roughness_sigma_m=UNKNOWN_HEIGHT_SIGMA_M) for one in survey.grounds]
        anywhere = _replace_ground(problem, tuple(grounds))
        start = convert_state(first.adjustment, anywhere)
        found = anneal(anywhere, start, on_ground=False)
        is_off = _clear_of_ground(survey, found.minimum.state.point)[problem.third.rough]
        weight = {**found.weight, "roughness": np.where(is_off, ZERO_WEIGHT, 1.0)}
        minimum = minimise_weighted_cost(problem, found.minimum.state, weight)
        yield Candidate(taking, placed, decide(problem, minimum, weight))


def _adjust_from_reduced(
    reduced: Participants,
    whole: Participants,
    taking: Participants,
    patience: Patience = FULL,
    *,
    again: bool = False,
) -> Iterator[Candidate]:
    """Adjust robustly from each ordinary minimum of a part of the observations.

    Parameters
    ----------
    reduced
        Participating observations without some of them.
    whole
        All participating observations; the robust adjustment decides on those that were left out.
    taking
        The same with the stated sigmas.
    patience
        Largest numbers of iterations, and the sum of squares of the part beyond which it is
        skipped.
    again
        Whether frames in doubt begin again in another pose.
    """
    try:
        first = (
            find_best_minima(reduced, patience)
            if again
            else find_minima_from(reduced, find_first_values, patience)
        )
    except GeometryError:
        return
    if first.adjustment.minimum.cost > patience.goal:
        return
    for adjustment in (first.adjustment, *first.alternatives[:MOST_ALTERNATIVES]):
        with suppress(SingularError, ValueError):  # undetermined, or impossible with all of it
            placed, problem = _build_stated_problem(adjustment, first, whole)
            weight = _weights_without(problem, adjustment, first, reduced)
            weight["pixels"] = np.where(
                np.isin(placed.pick_index, first.pick_index), 1.0, ZERO_WEIGHT
            )
            minimum = minimise_weighted_cost(problem, convert_state(adjustment, problem), weight)
            yield Candidate(taking, placed, decide(problem, minimum, weight))


def _build_stated_problem(
    adjustment: Adjustment, first: Refined, whole: Participants
) -> tuple[Refined, SurveyProblem]:
    """Build the likelihood of all observations of the points and photos in an adjustment.

    Parameters
    ----------
    adjustment, first
        One of the minima of a part of the observations, or with other sigmas; and the record of
        that adjustment.
    whole
        All observations, with their sigmas.

    Returns
    -------
    The record with the picks of the likelihood, and the likelihood.
    """
    survey, reduced = whole.survey, adjustment.survey
    is_placed = np.zeros(len(whole.keep), dtype=np.bool_)
    is_placed[first.pick_index] = True
    if not reduced.matches.points + reduced.ties.points:  # otherwise a pick has unknowns of its own
        is_placed |= (
            whole.keep
            & np.isin(np.array(survey.label)[survey.pick_label], reduced.label)
            & np.isin(np.array(survey.frame_id)[survey.pick_frame], reduced.frame_id)
        )
    stated = select_picks(remove_known(survey, whole.known_removed), is_placed).survey
    roughness = (one.roughness_sigma_m for one in stated.grounds)
    survey = replace(
        reduced,
        pick_frame=stated.pick_frame,
        pick_label=stated.pick_label,
        pixel_px=stated.pixel_px,
        pick_sigma_px=stated.pick_sigma_px,
        target_pick=stated.target_pick,
        length_m=stated.length_m,
        length_sigma_m=stated.length_sigma_m,
        known=stated.known,
        control_label=stated.control_label,
        control_world_m=stated.control_world_m,
        control_sigma_m=stated.control_sigma_m,
        grounds=tuple(
            replace(ground, roughness_sigma_m=sigma_m)
            for ground, sigma_m in zip(reduced.grounds, roughness, strict=True)
        ),
    )
    lines = ~whole.line_removed[first.line_index]
    placed = replace(first, pick_index=np.flatnonzero(is_placed))
    return placed, SurveyProblem(survey, adjustment.problem.pivot_m, lines)


def _replace_ground(problem: SurveyProblem, grounds: tuple[Ground, ...]) -> SurveyProblem:
    """Build the likelihood of the same observations on another ground."""
    used = np.zeros(len(problem.survey.line_start), dtype=np.bool_)
    used[problem.line_index] = True
    return SurveyProblem(replace(problem.survey, grounds=grounds), problem.pivot_m, used)


def _clear_of_ground(survey: Survey, point_m: Floats) -> Bools:
    """Mark labels (K,), seen in two photos, clear of the plane of most labels of their area."""
    seen = np.flatnonzero((count_photos(survey) > 1) & ~survey.off_ground)
    is_off = np.zeros(len(survey.label), dtype=np.bool_)
    for area in np.unique(survey.area[seen]):
        own = seen[survey.area[seen] == area]
        height, sigma = point_m[own, 2], np.full(len(own), OFF_GROUND_M)
        plane = fit_robust_plane(point_m[own, :2], height, sigma)
        if plane is not None:
            is_off[own] = np.abs(height - plane) > MIN_RAISED_M
    return is_off


MIN_RAISED_M = 0.3
"""Height above the plane of most points [m] above which a point begins off the ground."""

UNKNOWN_HEIGHT_SIGMA_M = 3.0
"""Sigma of the height of a point above the ground [m] without any knowledge of it."""


def _weights_without(
    problem: SurveyProblem, adjustment: Adjustment, first: Refined, taking: Participants
) -> dict[str, Floats]:
    """Return weights by group, nearly none for observations not in the first adjustment."""
    lines = taking.line_removed[first.line_index[problem.line_index]]
    known = [problem.known[k].index in taking.known_removed for k in problem.known_thing]
    control = ~np.isin(problem.survey.control_label, adjustment.survey.control_label)
    is_out = {"lengths": lines, "known": np.array(known, dtype=np.bool_), "control": control}
    return {name: np.where(rows, ZERO_WEIGHT, 1.0) for name, rows in is_out.items() if len(rows)}


def _softer(survey: Survey, factor: float) -> Survey:
    """Return the survey with enlarged sigmas of readings, and with uncertain ground and tapes."""
    grounds = tuple(
        replace(one, roughness_sigma_m=factor * max(one.roughness_sigma_m, LEAST_ROUGHNESS_M))
        for one in survey.grounds
    )
    scales = tuple((name, max(sigma, LEAST_TAPE_SCALE)) for name, sigma in survey.own_scale_sigma)
    return replace(
        survey,
        pick_sigma_px=factor * survey.pick_sigma_px,
        length_sigma_m=factor * survey.length_sigma_m,
        control_sigma_m=factor * survey.control_sigma_m,
        known=tuple(replace(one, sigma=factor * one.sigma) for one in survey.known),
        grounds=grounds,
        tape_scale_sigma=max(survey.tape_scale_sigma, LEAST_TAPE_SCALE),
        own_scale_sigma=scales,
    )


def _has_rival(found: Annealed, row: int) -> bool:
    """Return whether another length explains the misfit of a removed one, in the linear model."""
    whole, falls = _falls_with_all(found, {"lengths": np.array([row])})
    others = found.misfit["lengths"] <= GROSS_SIGMAS
    return bool((falls["lengths"][others] > whole - MAX_RIVAL_INCREASE).any())


def _falls_with_all(
    found: Annealed, restored: Mapping[str, Ints]
) -> tuple[float, dict[str, Floats]]:
    """Compute the decrease of the sum of squares without each single reading.

    Parameters
    ----------
    found
        A robust adjustment.
    restored
        Rows of its gross errors that take part again, by group.

    Returns
    -------
    whole, falls
        Decrease without all restored observations; and (n,) without each single reading of each
        group while all others take part, the restored ones included, in the linear model.

    Notes
    -----
    Let J be the Jacobian of the restored observations, e the errors of their predictions without
    them, S the covariance of the unknowns without them, and V = I + J S J^T the covariance of e.
    Restoring them increases the sum of squares by e^T V^-1 e and moves the unknowns by
    -S J^T V^-1 e. With X = J' S J^T, the residuals r and cofactors Q of another observation become
    r - X V^-1 e and Q + X V^-1 X^T, and the sum of squares decreases by r^T Q^-1 r without it. Axes
    that no other observation checks count 0. For a restored observation i itself the decrease is
    v_i^T ((V^-1)_ii)^-1 v_i, with v = V^-1 e.
    """
    minimum = found.minimum
    gradient, error, place = _predict(found, restored)
    # S J^T, V^-1 and v = V^-1 e.
    pull = minimum.factor.solve(gradient)
    inverse = np.asarray(np.linalg.inv(np.eye(len(error)) + gradient.T @ pull), np.float64)
    force = inverse @ error
    covariance = minimum.factor.covariance()
    falls: dict[str, Floats] = {}
    for name in (one for one in READINGS if one in minimum.blocks):
        other = minimum.blocks[name]
        # Residuals r - X v and cofactors Q + X V^-1 X^T of all others.
        moved = other.times(slice(None), pull)
        residual = other.residual - moved @ force
        share = compute_cofactors(other, covariance) + moved @ inverse @ moved.swapaxes(1, 2)
        falls[name] = reduce_squares(residual, share, LEAST_REDUNDANCY)
        if name in restored:
            own = place[name]
            block = inverse[own[:, :, None], own[:, None, :]]
            falls[name][restored[name]] = reduce_squares(force[own], block, LEAST_REDUNDANCY)
    return float(error @ force), falls


def _predict(found: Annealed, rows: Mapping[str, Ints]) -> tuple[Floats, Floats, dict[str, Ints]]:
    """Predict observations that take no part, at full weight.

    Parameters
    ----------
    found, rows
        A robust adjustment; rows of observations, by group.

    Returns
    -------
    gradient, error, place
        (u, k), (k,) of all k numbers in sigmas, and (n, r) which of them are of each observation,
        by group.
    """
    if not rows:
        return np.zeros((found.problem.layout.size, 0)), np.zeros(0), {}
    blocks = {name: found.minimum.blocks[name] for name in rows}
    scale = {name: 1.0 / np.sqrt(found.weight[name][own]) for name, own in rows.items()}
    jacobians = [
        blocks[name].jacobian[own] * scale[name][:, None, None] for name, own in rows.items()
    ]
    errors = [blocks[name].residual[own] * scale[name][:, None] for name, own in rows.items()]
    columns = [blocks[name].columns[own] for name, own in rows.items()]
    dense = DenseStack(columns, jacobians, found.problem.layout.size).jacobian(jacobians)
    ends = np.cumsum([one.size for one in errors])
    place = {
        name: end - one.size + np.arange(one.size).reshape(one.shape)
        for name, one, end in zip(rows, errors, ends.tolist(), strict=True)
    }
    return dense.T, np.concatenate([one.ravel() for one in errors]), place


def _try_single_error(
    candidate: Candidate, restored: Mapping[str, Ints] | None = None
) -> Iterator[Candidate]:
    """Try one gross error in place of others, or of a misfit that has none.

    A single wrong pick can rotate its photo, so that many lengths and other picks of the photo no
    longer fit. Or a length is a gross error, and a wrong pick at one of its ends would explain as
    much. The linear model proposes single readings. For each, the restored gross errors take part
    again, and that reading is left out in their place.

    Parameters
    ----------
    candidate
        A robust adjustment.
    restored
        Rows of its gross errors, by group; None for all of them.
    """
    found = candidate.annealed
    gross = {name: found.gross(name) for name in found.misfit if len(found.gross(name))}
    if sum(map(len, gross.values())) > MOST_STARTS:
        return
    restored = gross if restored is None else restored
    whole, falls = _falls_with_all(found, restored)
    proposed = sorted(
        (
            (fall, name, row)
            for name, each in falls.items()
            for row, fall in enumerate(each.tolist())
        ),
        reverse=True,
    )
    back = {(name, row) for name, rows in restored.items() for row in rows.tolist()}
    out = {(name, row) for name, rows in gross.items() for row in rows.tolist()} - back
    new = [one for one in proposed if one[1:] not in out and {one[1:]} != back]
    least = max(MIN_DECREASE_SHARE * whole, GROSS_SIGMAS**2)
    likely = [one for one in new if one[0] >= least][:MOST_PROPOSED]
    # Few control points hold a scene without a log: an error bends it beyond the linear model.
    if set(restored) == {"control"} and candidate.taking.survey.telemetry is None:
        others = (one for one in new if one[1] == "control" and one not in likely)
        likely += islice(others, MOST_PROPOSED)
    for _, name, row in likely:
        weight = {one: np.ones(len(misfit)) for one, misfit in found.misfit.items()}
        for group, own in (*out, (name, row)):
            weight[group][own] = ZERO_WEIGHT
        with suppress(SingularError, ValueError):  # undetermined, or impossible
            minimum = minimise_weighted_cost(found.problem, found.minimum.state, weight)
            yield replace(candidate, annealed=decide(found.problem, minimum, weight))


def _exchange_gross_errors(candidate: Candidate) -> Iterator[Candidate]:
    """Try another reading in place of each gross error of a candidate that may be the wrong one.

    A length with a known mistake, such as another unit, has no rivals.
    """
    found = candidate.annealed
    gross = [(name, row) for name in READINGS for row in found.gross(name).tolist()]
    if len(gross) > MOST_GROSS_OF_A_PHOTO:
        return
    for name, row in gross:
        if name != "lengths" or not _is_known_mistake(found, row):
            each = _try_single_error(candidate, {name: np.array([row])})
            yield from (one for one in each if not one.misplaced)


def _is_known_mistake(found: Annealed, row: int) -> bool:
    """Return whether a removed length has another unit, or a misplaced decimal point."""
    survey, line = found.problem.survey, found.problem.line_index[row]
    taped, sigma = float(survey.length_m[line]), float(survey.length_sigma_m[line])
    root = np.sqrt(found.weight["lengths"][row])
    error_m = float(found.minimum.blocks["lengths"].residual[row, 0] / root) * sigma
    error_sigma_m = abs(error_m) / float(found.misfit["lengths"][row])
    return bool(explain_length(taped, sigma, taped + error_m, error_sigma_m))


def _adjust_without_outliers(taking: Participants, agreed: Sequence[Candidate]) -> Robust | None:
    """Adjust without the gross errors of the best candidate; None where that has no result.

    Among candidates that explain as much, the one that keeps most picks comes first, and one that
    converges. Those that leave out other readings are rivals of the result.
    """
    if not agreed:
        return None
    agreed = _sort_by_cost(taking, [*agreed, *_try_other_clicks(taking, agreed[0])])
    agreed = _sort_by_cost(taking, [*agreed, *_exchange_gross_errors(agreed[0])])
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
        pairs = [(one, found) for found in each if (one := _adjust_without_candidate(found))]
    if not pairs:
        return None
    pairs.sort(key=lambda pair: not pair[0].refined.adjustment.minimum.converged)
    (robust, _), *others = pairs
    refined, survey = robust.refined, taking.survey
    left = _list_left_out(survey, robust)
    # Record the readings that other explanations leave out, and their adjustments.
    rivals: list[Rival] = []
    minima = [*refined.alternatives]
    for rival, _ in others:
        other, theirs = rival.refined, _list_left_out(survey, rival)
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


def _list_left_out(survey: Survey, robust: Robust) -> set[Reading]:
    """List the readings that a robust adjustment leaves out as gross errors."""
    label, refined = survey.label, robust.refined
    found: set[Reading] = set()
    for k in _list_gross_picks(refined):
        name, frame = label[survey.pick_label[k]], survey.frame_id[survey.pick_frame[k]]
        found.add(Reading("pixels", name, f"the click on {name!r} in {frame!r}", (name,), (frame,)))
    for k in np.flatnonzero(refined.line_removed).tolist():
        ends = (label[survey.line_start[k]], label[survey.line_end[k]])
        name = survey.line_name[k] if survey.line_name else ""
        found.add(Reading("lengths", name, f"the length {describe_ends(name, *ends)}", ends))
    for thing in survey.known:
        if thing.index in refined.known_removed:
            points = tuple(label[k] for k in thing.label)
            words = f"the known {describe_thing(thing.kind, thing.name, points)}"
            found.add(Reading("known", thing.name, words, points))
    for k in survey.control_label[robust.control].tolist():
        words = f"the coordinates of the control point {label[k]!r}"
        found.add(Reading("control", label[k], words, (label[k],)))
    if robust.exchanged:
        name = _name_pair(robust.exchanged)
        words = f"the coordinates of the control points {join_names(map(repr, robust.exchanged))}"
        found.add(Reading("control", name, f"{words} (exchanged)", robust.exchanged))
    return found


def _name_pair(names: Sequence[str]) -> str:
    """Return the name of two control points with exchanged coordinates, as of one reading."""
    return " and ".join(names)


def _try_other_clicks(taking: Participants, candidate: Candidate) -> Iterator[Candidate]:
    """Adjust robustly with a gross click of a point in place of the others in the same photo.

    A wrong click on the end of a length leads to another pose, in which the right one is gross.
    """
    survey = taking.survey
    gross = np.setdiff1d(candidate.first.pick_index, candidate.used)
    gross = gross[_are_ends(survey, survey.pick_label[gross])]
    if not 0 < len(gross) <= MOST_ALTERNATIVES:
        return
    whole, patience = _add_small_roughness(taking), _choose_patience(taking, [candidate])
    place = survey.pick_frame * len(survey.label) + survey.pick_label
    for pick in gross.tolist():
        others = np.setdiff1d(np.flatnonzero(whole.keep & (place == place[pick])), pick)
        if len(others):
            rest = whole.leave_out_picks(dict.fromkeys(others.tolist(), DISAGREEING))
            yield from _adjust_from_reduced(rest, whole, taking, patience)


def _are_ends(survey: Survey, label: Ints) -> Bools:
    """Mark the labels (n,) at which a length ends."""
    return np.asarray(np.isin(label, survey.line_start) | np.isin(label, survey.line_end))


def _list_gross_picks(refined: Refined) -> set[int]:
    """Return picks that were left out as gross errors."""
    return {k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS}


def _adjust_without_candidate(candidate: Candidate) -> Robust | None:
    """Adjust without the gross errors of a candidate, as usual; None where that has no result."""
    taking, first, found = candidate.taking, candidate.first, candidate.annealed
    survey, reduced, problem = taking.survey, found.problem.survey, found.problem
    picks = found.gross("pixels")
    # Picks that contradict each other stay, with a sigma as large as their misfit.
    lost = np.flatnonzero(np.isin(reduced.pick_label, _find_contradicting(found)))
    sigma_px = survey.pick_sigma_px.copy()
    sigma_px[first.pick_index[lost]] = _spread_px(found, lost)
    reason = {
        int(first.pick_index[row]): _far_off(found, row)
        for row in np.setdiff1d(picks, lost).tolist()
    }
    removed = taking.line_removed.copy()
    removed[first.line_index[problem.line_index[found.gross("lengths")]]] = True
    known = frozenset(problem.known[problem.known_thing[k]].index for k in found.gross("known"))
    # Points with gross roughness get heights of their own.
    rough = problem.third.rough[found.gross("roughness")]
    off_ground = rough[np.abs(found.minimum.state.point[rough, 2]) > OFF_GROUND_M]
    names = tuple(reduced.label[k] for k in off_ground)
    heights = tuple(reduced.label[k] for k in problem.third.stated[found.gross("heights")])
    wrong = {reduced.label[reduced.control_label[k]] for k in found.gross("control")}
    is_wrong = np.array([survey.label[k] in wrong for k in survey.control_label], dtype=np.bool_)
    wrong_poses = _find_wrong_poses(found, taking.pose_widened)
    rest = replace(
        select_control(survey, ~is_wrong),
        is_free=survey.is_free | np.isin(survey.label, [*names, *heights]),
        pick_sigma_px=sigma_px,
    )
    left = replace(
        taking,
        survey=rest,
        line_removed=removed,
        known_removed=taking.known_removed | known,
        pose_widened={**taking.pose_widened, **wrong_poses},
    )
    left = left.leave_out_picks(reason)
    unplaced = {k: first.pick_reason.get(k, MISPLACED) for k in candidate.unplaced.tolist()}
    placed = left.leave_out_picks(unplaced)
    whole = None
    if unplaced:  # without the gross errors, first values may have a place for all picks
        whole = adjust_on_trial(left, FULL)
    if whole is not None:  # a pick that has a place there is not undetermined, but contradicts
        placed = placed.leave_out_picks(
            dict.fromkeys(
                np.intersect1d(candidate.unplaced, whole.pick_index).tolist(), DISAGREEING
            )
        )
    results = [_adjust_rest(placed, found), whole]
    number = int(left.keep.sum())
    refined = min(filter(None, results), key=lambda one: _cost_of_all(one, number), default=None)
    if refined is None:
        return None
    contradicting = tuple(reduced.label[k] for k in np.unique(reduced.pick_label[lost]))
    control = np.flatnonzero(is_wrong)
    return Robust(
        rest, refined, control, names, heights, contradicting, exchanged=candidate.exchanged
    )


def _find_wrong_poses(found: Annealed, before: Mapping[str, float]) -> dict[str, float]:
    """Find poses by the log that are gross errors, and factors that enlarge their sigmas.

    Where they are half of the poses or more, together with earlier ones, the log as a whole is less
    exact than stated, and all its poses have one factor.

    Parameters
    ----------
    found
        A robust adjustment.
    before
        Factors by which sigmas of wrong poses are enlarged in it, by photo.

    Returns
    -------
    Factors of the stated sigmas, by photo.
    """
    prior, frame_id = found.problem.survey.telemetry, found.problem.survey.frame_id
    if prior is None:
        return {}
    squares = compute_squared_misfits(found.problem, found.minimum, found.weight)["telemetry"]
    name = [frame_id[k] for k in prior.frame_index]
    factor = np.sqrt(squares) * [before.get(one, 1.0) for one in name]
    rows = np.flatnonzero(squares > GROSS_SIGMAS**2)
    if 2 * len({name[k] for k in rows} | before.keys()) < len(name):
        return {name[k]: float(factor[k]) for k in rows}
    common = CORRELATED_SIGMA_FACTOR * float(np.sqrt(np.mean(factor**2)))
    return dict.fromkeys(name, common) if len(rows) else {}


def _adjust_rest(left: Participants, found: Annealed) -> Refined | None:
    """Adjust the rest, from the robust adjustment where other first values lead nowhere near it."""
    number = int(left.keep.sum())
    results: list[Refined] = []
    with suppress(GeometryError):
        results.append(find_best_minima(left))
    if not results or _cost_of_all(results[0], number) > (False, found.cost + MAX_RIVAL_INCREASE):
        with suppress(GeometryError):
            results.append(find_minima_from(left, lambda survey: [_first_values(found, survey)]))
    return min(results, key=lambda one: _cost_of_all(one, number), default=None)


def _cost_of_all(refined: Refined, picks: int) -> tuple[bool, float]:
    """Return a sort key of adjustments of so many picks: converged ones first, then by cost."""
    minimum, lost = refined.adjustment.minimum, picks - len(refined.pick_index)
    return not minimum.converged, minimum.cost + GROSS_SIGMAS**2 * lost


def _first_values(found: Annealed, survey: Survey) -> FirstValues:
    """Return first values from a robust adjustment that has the survey's labels and frames."""
    state, reduced = found.minimum.state, found.problem.survey
    frame = [reduced.frame_id.index(name) for name in survey.frame_id]
    label = [reduced.row_of_label[name] for name in survey.label]
    free = survey.is_free | (survey.height_sigma_m > 0)
    return FirstValues(
        point_m=state.point[label, :2],
        center=state.center[frame],
        rotation=state.rotation[frame],
        height_m=float(state.plane[0]),
        departure_m=np.where(free, state.point[label, 2], 0.0),
    )


def _find_contradicting(found: Annealed) -> list[int]:
    """Find labels whose picks contradict each other, without evidence for which of them is wrong.

    Either all picks of the label are gross errors, or others of its picks could be the gross errors
    with an equally good fit of the rest.
    """
    gross = np.zeros(len(found.problem.survey.pick_label), dtype=np.bool_)
    gross[found.gross("pixels")] = True
    label = found.problem.survey.pick_label
    number, wrong = (np.bincount(of, minlength=label.max() + 1) for of in (label, label[gross]))
    # Labels with at least half of their picks gross.
    asked = np.flatnonzero((number > 1) & (2 * wrong >= number)).tolist()
    # At the end of a length each click is tried in place of the others (`_try_other_clicks`).
    survey = found.problem.survey
    place = survey.pick_frame * len(number) + label
    repeated = label[gross & np.isin(place, place[~gross])]
    tried = set(repeated[_are_ends(survey, repeated)].tolist())
    return [
        k
        for k in asked
        if wrong[k] == number[k]
        or (
            k not in tried
            and not _shows_photo_at_fault(found, gross, label == k)
            and _is_as_good(found, gross, label == k)
        )
    ]


def _shows_photo_at_fault(found: Annealed, gross: Bools, own: Bools) -> bool:
    """Return whether contradicting picks are of a photo in which picks of other points left too.

    Such errors go together, as of two labels that are swapped: the photo is in doubt, not the
    point.
    """
    frame = found.problem.survey.pick_frame
    others = np.bincount(frame[gross & ~own], minlength=frame.max() + 1)
    left, stayed = others[frame[gross & own]], others[frame[own & ~gross]]
    return bool(left.min() > stayed.max() or stayed.min() > left.max())


def _is_as_good(found: Annealed, gross: Bools, own: Bools) -> bool:
    """Return whether removed picks of a point may take the place of its remaining ones.

    Parameters
    ----------
    found
        The robust adjustment.
    gross, own
        Picks that take no part, and picks of the point.
    """
    problem = found.problem
    # Exchange the roles of the point's picks, and decide again.
    weight = {**found.weight, "pixels": np.where(gross ^ own, ZERO_WEIGHT, 1.0)}
    try:
        other = decide(
            problem, minimise_weighted_cost(problem, found.minimum.state, weight), weight
        )
    except (SingularError, ValueError):  # undetermined, or impossible
        return False
    is_other = own & gross & (other.misfit["pixels"] <= GROSS_SIGMAS)
    return bool(is_other.any()) and other.cost <= found.cost + MAX_RIVAL_INCREASE


def _spread_px(found: Annealed, rows: Ints) -> Floats:
    """Compute sigmas (n,) [px] of picks of points whose picks contradict each other.

    Each is at least as large as the misfit of a gross pick, and such that the mean of a point's
    picks has a sigma of half the distance between them.
    """
    survey, misfit = found.problem.survey, found.misfit["pixels"][rows]
    blocks = found.problem.evaluate(found.minimum.state)
    assert blocks is not None  # noqa: S101  (the iterations ended there)
    own_px = survey.pick_sigma_px
    off_px = np.linalg.norm(blocks["pixels"].residual, axis=1) * own_px
    label = survey.pick_label[rows]
    # sigma = distance / 2 * sqrt(n), so that the mean of n picks has half the distance as sigma.
    spread_px = np.zeros(len(survey.label))
    for one in np.unique(label):
        mine = np.flatnonzero(survey.pick_label == one)
        takes_part = (found.misfit["pixels"][mine] <= GROSS_SIGMAS).any()
        # The point is at the picks that take part, or, if none does, between all of them.
        apart_px = off_px[mine].max() * (1.0 if takes_part else 2.0)
        spread_px[one] = apart_px / 2.0 * np.sqrt(len(mine))
    gross = misfit > GROSS_SIGMAS
    return np.asarray(np.maximum(spread_px[label], np.where(gross, misfit, 1.0) * own_px[rows]))


def _far_off(found: Annealed, row: int) -> LeftOut:
    """Describe the reason why a pick is a gross error."""
    blocks = found.problem.evaluate(found.minimum.state)
    assert blocks is not None  # noqa: S101  (the iterations ended there)
    sigma_px = found.problem.survey.pick_sigma_px[row]
    off_px = float(np.linalg.norm(blocks["pixels"].residual[row]) * sigma_px)
    return LeftOut(
        LeftOutCause.GROSS,
        f"all other observations contradict it: they show its point {off_px:.0f} px away",
    )
