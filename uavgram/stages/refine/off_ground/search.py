"""The search for labels that stand off the ground.

Every label that two photos show gets a departure of its own with a wide prior; the plane that most
labels lie on is the ground, and what stands clear of it, by more than the ground's own relief
explains, stands off it. Everything goes at the stated noise, times what the picks show of their own
when nothing is asked of the ground; picks that stray have less weight.
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
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.ground.plane_of_most import plane_of_most
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.softened import iterate
from uavgram.stages.refine.continued import carried, lines_used
from uavgram.stages.refine.off_ground.rivals import one_wrong_pick_explains

MISFIT = 0.05
"""Probability below which the picks of the survey, or of its worst label, ask for a search."""

LEAST_GROUND = 4
"""Labels that have to lie on the ground, for others to stand off it."""

SURE = 0.99
"""Probability with which a label stands off the ground."""

LEAST_HEIGHT_M, RELIEFS = 0.1, 4.0
"""Departure below which relief explains it: at least so much, and so many times the relief."""

MOST_NOISE = 30.0
"""Variance factor of the picks beyond which something else is wrong, and nothing can be told."""

FEW, FEW_NOISE = 4, 1.6
"""So few heights have to leave no more variance factor of the picks: where they do, something else
is wrong, two swapped labels say. Many may stand beside picks that are less exact than stated."""

KERB_M = 0.1
"""By which points of a plane lie off it, when the plane is looked for."""

MOST_AT_ONCE = 300
"""Labels whose covariances are looked at together."""

ROUNDS, EACH, FIRST = 10, 10, 30
"""Rounds of the search, iterations of each, and of the first."""

NEAR = 1e-4
"""Predicted fall of the sum of squares, a hundredth of a sigma squared, from which on a round is at
rest: the next one changes the weights, and the adjustment after the search starts from it anew."""

STRAY = 2.5
"""Residual of a pick, in sigmas of the others, beyond which the search gives it less weight."""

SCALE, SLACK_M = 0.02, 0.05
"""By which known lengths may be wrong in the search: a share of each, and metres."""

MEDIAN = 1.1774
"""Of the length of two independent residuals of variance 1: the root of 2 log 2."""

SAME = 0.1
"""Relative change of the weight of a stray pick that is not worth another adjustment."""

TRIMMED = 0.85
"""Share of the labels, best first, by which the noise of the picks is judged."""

STATED_WEIGHT = 20.0
"""Of the stated sigma of picks beside it, as so many residuals."""

SURE_OF = 3.0
"""Sigmas of its height in that of a point anywhere, from which on a label tells where it is."""

LEVEL_WITH_M = 0.15
"""Labels within so much of each other's height lie at one level."""

LOWER = 0.25
"""A level below the plane with so many labels, as a share of those on it, may be the ground."""


@dataclass(frozen=True, eq=False)
class Search:
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
    is_first
        Whether the adjustment is still the one that was handed in.
    """

    stated: Survey
    adjustment: Adjustment
    candidate: Bools
    off: Bools
    relief_m: float
    is_first: bool = True

    @property
    def noise(self) -> float:
        """Variance factor of the picks, as `noise_of_most` has it."""
        return noise_of_most(self.adjustment)

    @property
    def roughness_m(self) -> Floats:
        """(K,) stated of the ground under each label."""
        return np.array([g.roughness_sigma_m for g in self.stated.grounds])[self.stated.area]

    def seen(self, noise: float) -> tuple[Seen, Ints]:
        """What the picks say of departures, at their own noise, and of which labels they do."""
        found = seen_departures(self.adjustment, self.adjustment.problem.third.sigma_m)
        known = np.flatnonzero(self.candidate & np.isfinite(found.variance_m2))
        return Seen(found.departure_m[known], noise * found.variance_m2[known]), known

    def readjusted(self, most: int = EACH) -> Search:
        """Adjusted anew with what is now known of the labels, and less weight for stray picks."""
        sigma = np.where(self.off, ANYWHERE_M, self.relief_m)
        survey = replace(
            self.stated,
            height_sigma_m=np.where(self.candidate, sigma, self.stated.height_sigma_m),
            pick_sigma_px=self.stated.pick_sigma_px * self._stray_picks(),
            length_sigma_m=self._length_sigma_m(),
        )
        now = self.adjustment
        problem = SurveyProblem(survey, now.problem.pivot_m, lines_used(now))
        minimum = iterate(problem, carried(now, problem), most, at_rest=NEAR)
        after = Adjustment(problem, minimum, minimum.factor.covariance())
        return replace(self, adjustment=after, is_first=False)

    def _stray_picks(self) -> Floats:
        """(P,) factors of the sigmas of picks; 1 before anything is known of the labels."""
        survey = self.adjustment.survey
        if self.is_first:
            return np.ones(len(survey.pick_sigma_px))
        size = np.linalg.norm(self.adjustment.minimum.blocks["pixels"].residual, axis=1)
        size = size * survey.pick_sigma_px / self.stated.pick_sigma_px
        usual = max(1.0, float(np.median(size)) / MEDIAN)
        return np.asarray(np.maximum(1.0, size / (STRAY * usual)))

    def _length_sigma_m(self) -> Floats:
        """(L,) of known lengths, which only say how large all is: a wrong one is no height."""
        return self.stated.length_sigma_m + SCALE * self.stated.length_m + SLACK_M


def noise_of_most(adjustment: Adjustment) -> float:
    """Variance factor of the picks, at least one: of most labels, the worst left out."""
    fit = label_misfit(adjustment)
    use = fit.redundancy > 0.2
    order = np.argsort(fit.squares[use] / fit.redundancy[use])
    best = np.flatnonzero(use)[order][: int(np.ceil(TRIMMED * len(order)))]
    squares, degrees = fit.squares[best].sum() / TRIMMED, fit.redundancy[best].sum()
    return max(1.0, float((squares + STATED_WEIGHT) / (degrees + STATED_WEIGHT)))


def searched(adjustment: Adjustment, survey: Survey, *, again: bool) -> Search | None:
    """The search's end; None where all fits, or nothing can be told.

    Parameters
    ----------
    adjustment
        Where it begins.
    survey
        Its observations, the heights as they were stated.
    again
        Whether labels that were found before have free heights in it, so that it fits.

    Raises
    ------
    SingularError
        An unknown is not determined.
    """
    fit = label_misfit(adjustment)
    candidate = (fit.photos >= 2) & ~survey.off_ground
    if candidate.sum() <= LEAST_GROUND or (not again and _all_fit(fit)):
        return None
    search = _settled(Search(survey, adjustment, candidate, candidate, 0.0).readjusted(FIRST))
    about = _about_planes(search)
    if about is None:
        return None
    search = _classified(about.readjusted())
    for _ in range(ROUNDS):
        last, search = search, _classified(search.readjusted())
        if np.array_equal(search.off, last.off):
            break
    else:
        return None
    if search.noise > MOST_NOISE:
        return None
    sigma_px = survey.pick_sigma_px * np.sqrt(search.noise)
    off = search.off & ~one_wrong_pick_explains(search.adjustment, search.off, sigma_px)
    if off.any() and (_leaves_misfit(search, off) or not _is_ground(search, off)):
        return None
    return replace(search, off=off)


def _leaves_misfit(search: Search, off: Bools) -> bool:
    return bool(off.sum() <= FEW and search.noise > FEW_NOISE)


def _settled(search: Search) -> Search:
    """At rest, with each candidate's height free and little weight for picks that stray."""
    for _ in range(ROUNDS):
        last, search = search, search.readjusted()
        change = search.adjustment.survey.pick_sigma_px / last.adjustment.survey.pick_sigma_px
        if search.adjustment.minimum.converged and np.abs(np.log(change)).max() < SAME:
            break
    return search


def _all_fit(fit: LabelMisfit) -> bool:
    tested = fit.redundancy > 0.5
    each = chdtrc(np.maximum(fit.redundancy, 0.5), fit.squares)[tested]
    together = chdtrc(max(fit.redundancy.sum(), 0.5), fit.squares.sum())
    return bool(each.min(initial=1.0) * tested.sum() > MISFIT and together > MISFIT)


def _about_planes(search: Search) -> Search | None:
    """Labels off the plane that most labels of their area lie on; None where there is no such."""
    adjustment = search.adjustment
    noise = search.noise
    seen, known = search.seen(noise)
    off, relief = np.zeros(len(search.candidate), dtype=np.bool_), []
    for area in range(len(search.stated.grounds)):
        rows = np.flatnonzero(search.stated.area[known] == area)
        if len(rows) < LEAST_GROUND:
            continue
        label = known[rows]
        place, height = adjustment.state.point[label, :2], adjustment.state.point[label, 2]
        shape = _relative_variance(adjustment, label, seen.variance_m2[rows] / noise)
        sigma = np.sqrt(noise * shape + KERB_M**2)
        plane = plane_of_most(place, height, sigma)
        if plane is None:
            return None
        stands = np.abs(height - plane) > 3.0 * sigma
        off[label] = stands
        relief.append(1.4826 * float(np.median(np.abs(height - plane)[~stands])))
    if not relief:
        return None
    return replace(search, off=off, relief_m=max(0.02, *relief))


def _relative_variance(adjustment: Adjustment, label: Ints, whole_m2: Floats) -> Floats:
    """(n,) variances of departures, less what any plane takes up of them.

    Of more than `MOST_AT_ONCE` labels, the share that it takes up is that of the median of so many.

    Parameters
    ----------
    adjustment
        With these departures as unknowns.
    label
        (n,) by index.
    whole_m2
        (n,) their variances.
    """
    some = slice(None, None, int(np.ceil(len(label) / MOST_AT_ONCE)))
    place = adjustment.state.point[label[some], :2]
    columns = adjustment.problem.layout.point_columns(label[some])[:, 2]
    design = np.column_stack([np.ones(len(place)), place - place.mean(axis=0)])
    rest = np.eye(len(place)) - design @ np.linalg.pinv(design)
    joint = adjustment.minimum.factor.joint(columns)
    own = np.einsum("ij,jk,ik->i", rest, joint, rest, optimize=True)
    if len(own) == len(label):
        return np.asarray(own)
    return np.asarray(whole_m2 * min(1.0, float(np.median(own / whole_m2[some]))))


def _classified(search: Search) -> Search:
    """Each label on the ground or off it, by what all picks say of it and of the others."""
    seen, known = search.seen(search.noise)
    if not len(known):
        return replace(search, off=np.zeros_like(search.off))
    rough = search.roughness_m[known]
    now: Mixture = mixture(seen, rough, search.off[known].astype(np.float64))
    least = np.maximum(LEAST_HEIGHT_M, RELIEFS * np.hypot(now.relief_m, rough))
    off = np.zeros(len(search.off), dtype=np.bool_)
    off[known] = (now.off > SURE) & (np.abs(seen.departure_m) > least)
    return replace(search, off=off, relief_m=now.relief_m)


def _is_ground(search: Search, off: Bools) -> bool:
    """Whether what most labels lie on is the ground, and not the roofs of what stands on it.

    No other level holds as many labels as it, and no lower one a good share of them.
    """
    seen, known = search.seen(search.noise)
    on = ~search.off[known] & (np.sqrt(seen.variance_m2) < ANYWHERE_M / SURE_OF)
    height = np.sort(seen.departure_m[off[known]])
    last = np.searchsorted(height, height + 2.0 * LEVEL_WITH_M, side="right")
    level = last - np.arange(len(height))
    lower = level[height < 0].max(initial=0)
    ground = int(on.sum())
    if ground < LEAST_GROUND or level.max(initial=0) >= ground:
        return False
    return bool(lower < LEAST_GROUND - 1 or lower < LOWER * ground)
