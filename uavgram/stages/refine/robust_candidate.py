"""Robust adjustments from certain first values, and their costs.

A candidate explains the survey by a set of gross errors. Its cost is the sum of squares of the
rest, and a price of each gross error (`robust_adjustment.compute_gross_cost`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.redundancy import GROSS_SIGMAS
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, LeftOut, LeftOutCause, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.kinds import READINGS, get_kind
from uavgram.estimation.survey.observations.sightings import have_folded
from uavgram.estimation.survey.selection import remove_known, select_picks
from uavgram.geometry.ground.plane import fit_robust_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Ground, Survey
from uavgram.stages.refine.first_values import find_first_values
from uavgram.stages.refine.minima import (
    FULL,
    Participants,
    Patience,
    find_best_minima,
    find_minima_from,
)
from uavgram.stages.refine.off_ground import count_photos
from uavgram.stages.refine.readjustment import convert_state
from uavgram.stages.refine.rival_errors import (
    MAX_RIVAL_INCREASE,
    compute_repeated_cost,
    compute_size_cost,
    has_rival,
)
from uavgram.stages.refine.robust_adjustment import (
    ROBUST,
    SCHEDULE,
    ZERO_WEIGHT,
    Annealed,
    anneal,
    compute_gross_cost,
    decide,
    minimise_weighted_cost,
)

MOST_ALTERNATIVES = 4
"""Largest number of alternative minima of an adjustment from which robust adjustments begin."""

COORDINATES = 3
"""Number of coordinates of a control point."""

MOST_GROSS_OF_A_PHOTO = 4
"""Number of gross errors that a photo counts as where it is left out: three picks determine its
pose, and a fourth one checks it."""

MISFIT_PROBABILITY = 1e-6
"""Probability of the sum of squares without gross errors, below which the rest does not fit."""

FEW_GROSS_SHARE = 0.03
"""Share of all observations, and at least one, that may be gross errors without a search from other
first values."""

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
        return self._own_cost + picks + self._count_lost_numbers(whole)

    @cached_property
    def _own_cost(self) -> float:
        """Cost of the observations that have a place."""
        found = self.annealed
        return found.cost - compute_repeated_cost(found) + compute_size_cost(found) + self.price

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

    def bound_exchange(self, whole: Participants) -> float:
        """Return the sum of squares that exchanged readings have to reach, and all have to fit."""
        numbers = sum(block.residual.size for block in self.annealed.minimum.blocks.values())
        lost = 2 * len(self.unplaced) + self._count_lost_numbers(whole)
        fitting = float(chdtri(numbers + lost, MISFIT_PROBABILITY))
        return min(self.cost(whole) + MAX_RIVAL_INCREASE, fitting)

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
        if any(has_rival(self.annealed, row) for row in self.annealed.gross("lengths")):
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

    def fits_beyond_lens(self) -> bool:
        """Return whether it fits only with a point that no lens shows."""
        blocks = self.annealed.problem.evaluate(self.annealed.minimum.state) or {}
        return have_folded(blocks, without=self.annealed.gross("pixels")) and self.fits()

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


def _find_seen_lines(taking: Participants) -> set[int]:
    """Find the lengths that take part and both of whose ends are picked."""
    survey = taking.survey
    picked = np.unique(survey.pick_label[taking.keep])
    is_seen = np.isin(survey.line_start, picked) & np.isin(survey.line_end, picked)
    return set(np.flatnonzero(is_seen & ~taking.line_removed).tolist())


def add_small_roughness(taking: Participants) -> Participants:
    """Return the observations with a little roughness of the ground, and of the tapes' scales."""
    return replace(taking, survey=_softer(taking.survey, 1.0))


def sort_by_cost(taking: Participants, candidates: Iterable[Candidate]) -> list[Candidate]:
    """Sort candidates by their cost for all participating picks, that of least cost first.

    Candidates with photos that contradict the rest come last: without these photos the other
    observations may show something else. The log as a whole is given up where nothing else
    explains everything. Candidates without a scale are none, as a scene of no size has no misfit on
    the ground; and so are those that fit with a point that no lens shows.
    """
    possible = [one for one in candidates if one.has_scale() and not one.fits_beyond_lens()]
    log_may_be_right = any(one.explains() and not one.gives_up_log() for one in possible)
    return sorted(
        possible,
        key=lambda one: (
            len(one.misplaced) > 0,
            log_may_be_right and one.gives_up_log(),
            one.cost(taking),
        ),
    )


def bound_cost(taking: Participants, found: Sequence[Candidate]) -> float:
    """Return the cost of the best candidate so far, which others have to reach.

    It is infinite where one of larger cost may come first (`sort_by_cost`).
    """
    is_last_resort = not found or found[0].misplaced or found[0].gives_up_log()
    return np.inf if is_last_resort else found[0].cost(taking)


def adjust_from_softened(taking: Participants) -> Iterator[Candidate]:
    """Adjust robustly from hundredfold sigmas, and from heights that photos show.

    The second start is for surveys with most points off the ground, as on roofs and cars: there no
    point pulls the ground plane.
    """
    whole = replace(taking, survey=_softer(taking.survey, 1.0))
    try:
        first = find_best_minima(replace(taking, survey=_softer(taking.survey, SCHEDULE[0])))
    except GeometryError:
        return
    found: list[Candidate] = []
    for adjustment in (first.adjustment, *first.alternatives[:MOST_ALTERNATIVES]):
        with suppress(SingularError, ValueError):  # undetermined, or impossible with all of it
            placed, problem = _build_stated_problem(adjustment, first, whole)
            start, limit = convert_state(adjustment, problem), bound_cost(taking, found)
            candidate = Candidate(taking, placed, anneal(problem, start, limit=limit))
            found = sort_by_cost(taking, [*found, candidate])
            yield candidate
    if (count_photos(first.adjustment.survey) < 2).all():
        return  # one photo alone shows no heights
    with suppress(SingularError, ValueError):
        placed, problem = _build_stated_problem(first.adjustment, first, whole)
        survey = problem.survey
        # Second start: heights are nearly free, then points clear of the main plane leave the
        # ground.
        grounds = [replace(one, roughness_sigma_m=UNKNOWN_HEIGHT_SIGMA_M) for one in survey.grounds]
        anywhere = _replace_ground(problem, tuple(grounds))
        start = convert_state(first.adjustment, anywhere)
        raised = anneal(anywhere, start, on_ground=False)
        is_off = _clear_of_ground(survey, raised.minimum.state.point)[problem.third.rough]
        weight = {**raised.weight, "roughness": np.where(is_off, ZERO_WEIGHT, 1.0)}
        minimum = minimise_weighted_cost(problem, raised.minimum.state, weight)
        limit = bound_cost(taking, found)
        yield Candidate(taking, placed, decide(problem, minimum, weight, limit))


def adjust_from_reduced(
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
            yield Candidate(taking, placed, decide(problem, minimum, weight, patience.limit))


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
