"""Labels whose picks fit at one height off the ground and not on it, though nobody said so.

A roof corner that is taken for a point of the ground bends poses, camera and plane, and the noise
that is learnt from the residuals would swallow it as relief. So where the picks of a survey do not
fit, every label that two photos show gets a departure of its own with a wide prior; the plane that
most labels lie on is the ground, and what stands clear of it, more than the ground's own relief
explains, is adjusted with a free height from then on. Everything goes at the stated noise, times
what the picks show of their own when nothing is asked of the ground.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from uavgram.estimation.reliability.off_ground import (
    ANYWHERE_M,
    LabelMisfit,
    Mixture,
    Seen,
    label_misfit,
    mixture,
    seen_departures,
)
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.ground.plane_of_most import plane_of_most
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.continued import carried, continued, lines_used
from uavgram.stages.refine.height_rivals import one_wrong_pick_explains
from uavgram.stages.refine.minima import Participants
from uavgram.stages.refine.poor_camera import iterate

MISFIT = 0.05
"""Probability below which the picks of the survey, or of its worst label, ask for a search."""

LEAST_GROUND = 4
"""Labels that have to lie on the ground, for others to stand off it."""

SURE = 0.99
"""Probability with which a label stands off the ground."""

LEAST_HEIGHT_M, RELIEFS = 0.1, 4.0
"""Departure below which relief explains it: at least so much, and so many times the relief."""

KERB_M = 0.1
"""By which points of a plane lie off it, when the plane is looked for."""

MOST_AT_ONCE = 300
"""Labels of which the first plane is made, of surveys with more."""

ROUNDS, EACH, FIRST = 8, 10, 30
"""Rounds of the search, iterations of each, and of the first."""

STRAY = 4.0
"""Residual of a pick, in sigmas of the others, beyond which the search gives it less weight."""

MEDIAN = 1.1774
"""Of the length of two independent residuals of variance 1: the root of 2 log 2."""

SAME = 0.1
"""Relative change of the weight of a stray pick that is not worth another adjustment."""

TRIMMED = 0.85
"""Share of the labels, best first, by which the noise of the picks is judged."""

STATED_WEIGHT = 20.0
"""Of the stated sigma of picks beside it, as so many residuals."""

LEVEL_WITH_M = 0.15
"""Labels within so much of each other's height lie at one level."""

LOWER = 0.25
"""A level below the plane with so many labels, as a share of those on it, may be the ground."""


def with_heights_found(taking: Participants, refined: Refined) -> tuple[Refined, Participants]:
    """The result with free heights of labels that do not lie on the ground, and what takes part.

    Parameters
    ----------
    taking
        What takes part.
    refined
        Adjusted as stated; it comes back where nothing was found, or nothing can be told.
    """
    adjustment = refined.adjustment
    try:
        search = _searched(adjustment)
        if search is None:
            return refined, taking
        names = [adjustment.survey.label[k] for k in np.flatnonzero(search.off)]
        after = continued(search.adjustment, with_free(adjustment.survey, names))
    except SingularError:
        return refined, taking
    if not after.minimum.converged:
        return refined, taking
    survey = with_free(taking.survey, names)
    return replace(refined, adjustment=after, alternatives=()), replace(taking, survey=survey)


def with_free(survey: Survey, names: list[str]) -> Survey:
    """The survey in which the heights of these labels are to be found."""
    return replace(survey, is_free=survey.is_free | np.isin(survey.label, names))


def found_free(stated: Survey, refined: Refined) -> list[str]:
    """Labels that are adjusted with a free height though nobody said so."""
    survey = refined.adjustment.survey
    said = {stated.label[k] for k in np.flatnonzero(stated.is_free)}
    return [survey.label[k] for k in np.flatnonzero(survey.is_free) if survey.label[k] not in said]


@dataclass(frozen=True, eq=False)
class _Search:
    """Where the search stands.

    Attributes
    ----------
    stated
        As it was adjusted first.
    adjustment
        With a prior of its own for each candidate's departure.
    candidate
        (K,) labels that two photos show and that are stated to lie on the ground.
    off
        (K,) those that stand off it.
    relief_m
        Of the ground, as it is found.
    """

    stated: Survey
    adjustment: Adjustment
    candidate: Bools
    off: Bools
    relief_m: float

    @property
    def noise(self) -> float:
        """Variance factor of the picks, at least one: of most labels, the worst left out."""
        fit = label_misfit(self.adjustment)
        use = fit.redundancy > 0.2
        order = np.argsort(fit.squares[use] / fit.redundancy[use])
        best = np.flatnonzero(use)[order][: int(np.ceil(TRIMMED * len(order)))]
        squares, degrees = fit.squares[best].sum() / TRIMMED, fit.redundancy[best].sum()
        return max(1.0, float((squares + STATED_WEIGHT) / (degrees + STATED_WEIGHT)))

    @property
    def roughness_m(self) -> Floats:
        """(K,) stated of the ground under each label."""
        return np.array([g.roughness_sigma_m for g in self.stated.grounds])[self.stated.area]

    def seen(self, noise: float) -> tuple[Seen, Ints]:
        """What the picks say of departures, at their own noise, and of which labels they do."""
        found = seen_departures(self.adjustment, self.adjustment.problem.third.sigma_m)
        known = np.flatnonzero(self.candidate & np.isfinite(found.variance_m2))
        return Seen(found.departure_m[known], noise * found.variance_m2[known]), known

    def readjusted(self, most: int = EACH) -> _Search:
        """Adjusted anew with what is now known of the labels, and less weight for stray picks."""
        sigma = np.where(self.off, ANYWHERE_M, self.relief_m)
        survey = replace(
            self.stated,
            height_sigma_m=np.where(self.candidate, sigma, self.stated.height_sigma_m),
            pick_sigma_px=self.stated.pick_sigma_px * self._stray(),
        )
        now = self.adjustment
        problem = SurveyProblem(survey, now.problem.pivot_m, lines_used(now))
        minimum = iterate(problem, carried(now, problem), most)
        after = Adjustment(problem, minimum, minimum.factor.covariance())
        return replace(self, adjustment=after)

    def _stray(self) -> Floats:
        """(P,) factors of the sigmas of picks; 1 before anything is known of the labels."""
        survey = self.adjustment.survey
        if survey is self.stated:
            return np.ones(len(survey.pick_sigma_px))
        size = np.linalg.norm(self.adjustment.minimum.blocks["pixels"].residual, axis=1)
        size = size * survey.pick_sigma_px / self.stated.pick_sigma_px
        usual = max(1.0, float(np.median(size)) / MEDIAN)
        return np.maximum(1.0, size / (STRAY * usual))


def _searched(adjustment: Adjustment) -> _Search | None:
    """The search's end; None where all fits, or nothing can be told."""
    fit, survey = label_misfit(adjustment), adjustment.survey
    candidate = (fit.photos >= 2) & ~survey.off_ground
    if candidate.sum() <= LEAST_GROUND or _all_fit(fit):
        return None
    search = _settled(_Search(survey, adjustment, candidate, candidate, 0.0).readjusted(FIRST))
    search = _about_planes(search)
    if search is None:
        return None
    for _ in range(ROUNDS):
        before = search
        search = _classified(search.readjusted())
        same = np.array_equal(search.off, before.off)
        if same and search.relief_m == before.relief_m:
            break
    else:
        search = replace(search, off=search.off & before.off)
    sigma_px = survey.pick_sigma_px * np.sqrt(search.noise)
    off = search.off & ~one_wrong_pick_explains(search.adjustment, search.off, sigma_px)
    if not off.any() or not _is_ground(search, off):
        return None
    return replace(search, off=off)


def _settled(search: _Search) -> _Search:
    """At rest, with each candidate's height free and little weight for picks that stray."""
    for _ in range(ROUNDS):
        before, search = search, search.readjusted()
        change = search.adjustment.survey.pick_sigma_px / before.adjustment.survey.pick_sigma_px
        if search.adjustment.minimum.converged and np.abs(np.log(change)).max() < SAME:
            break
    return search


def _all_fit(fit: LabelMisfit) -> bool:
    tested = fit.redundancy > 0.5
    each = chdtrc(np.maximum(fit.redundancy, 0.5), fit.squares)[tested]
    together = chdtrc(max(fit.redundancy.sum(), 0.5), fit.squares.sum())
    return bool(each.min(initial=1.0) * tested.sum() > MISFIT and together > MISFIT)


def _about_planes(search: _Search) -> _Search | None:
    """Labels off the plane that most labels of their area lie on; None where there is no such."""
    adjustment = search.adjustment
    noise = search.noise
    seen, known = search.seen(noise)
    off, relief = np.zeros(len(search.candidate), dtype=np.bool_), []
    for area in range(len(search.stated.grounds)):
        rows = np.flatnonzero(search.stated.area[known] == area)
        if len(rows) < LEAST_GROUND:
            continue
        rows = rows[np.argsort(seen.variance_m2[rows], kind="stable")[:MOST_AT_ONCE]]
        label = known[rows]
        place, height = adjustment.state.point[label, :2], adjustment.state.point[label, 2]
        sigma = np.sqrt(noise * _relative_variance(adjustment, label) + KERB_M**2)
        plane = plane_of_most(place, height, sigma)
        if plane is None:
            return None
        stands = np.abs(height - plane) > 3.0 * sigma
        off[label] = stands
        relief.append(1.4826 * float(np.median(np.abs(height - plane)[~stands])))
    if not relief:
        return None
    return replace(search, off=off, relief_m=max(0.02, *relief))


def _relative_variance(adjustment: Adjustment, label: Ints) -> Floats:
    """(n,) variances of departures, less what any plane takes up of them."""
    columns = adjustment.problem.layout.point_columns(label)[:, 2]
    place = adjustment.state.point[label, :2]
    design = np.column_stack([np.ones(len(label)), place - place.mean(axis=0)])
    rest = np.eye(len(label)) - design @ np.linalg.pinv(design)
    joint = adjustment.minimum.factor.joint(columns)
    return np.asarray(np.einsum("ij,jk,ik->i", rest, joint, rest, optimize=True))


def _classified(search: _Search) -> _Search:
    """Each label on the ground or off it, by what all picks say of it and of the others."""
    seen, known = search.seen(search.noise)
    rough = search.roughness_m[known]
    now: Mixture = mixture(seen, rough, search.off[known].astype(np.float64))
    least = np.maximum(LEAST_HEIGHT_M, RELIEFS * np.hypot(now.relief_m, rough))
    off = np.zeros(len(search.off), dtype=np.bool_)
    off[known] = (now.off > SURE) & (np.abs(seen.departure_m) > least)
    return replace(search, off=off, relief_m=now.relief_m)


def _is_ground(search: _Search, off: Bools) -> bool:
    """Whether what most labels lie on is the ground, and not the roofs of what stands on it.

    No other level holds as many labels as it, and no lower one a good share of them.
    """
    seen, known = search.seen(search.noise)
    on = ~search.off[known] & (np.sqrt(seen.variance_m2) < ANYWHERE_M / 10)
    height = np.sort(seen.departure_m[off[known]])
    last = np.searchsorted(height, height + 2.0 * LEVEL_WITH_M, side="right")
    level = last - np.arange(len(height))
    lower = level[height < 0].max(initial=0)
    ground = int(on.sum())
    if ground < LEAST_GROUND or level.max(initial=0) >= ground:
        return False
    return bool(lower < LEAST_GROUND - 1 or lower < LOWER * ground)
