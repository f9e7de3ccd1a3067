"""Priors of the ground: planes, relief, and the departures of points from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observations.priors import Prior, make_independent_prior
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Remedy, propose_free_heights
from uavgram.model.survey import Survey

if TYPE_CHECKING:
    from uavgram.estimation.survey.ground_planes import PlanePrior
    from uavgram.estimation.survey.likelihood import SurveyProblem


GROUND = ErrorSource(
    "ground",
    "how well the height and slope of the ground are known",
    "Points picked in more photos, from other sides, or a stated height would help there.",
)


@dataclass(frozen=True, eq=False)
class ThirdCoordinate:
    """Prior of the departure of each of K points, in metres up.

    A point is at ground(east, north) + stated height + departure. Where the ground is smooth and
    the height exact, there is no departure. If any point of a survey has one, all points have the
    unknown, and it is `idle` where nothing uses it.

    Attributes
    ----------
    rough, stated, free, idle
        Labels by index: on rough ground, at a height that was stated with a sigma, at an entirely
        unknown height, and all others.
    sigma_m
        (K,) sigma of the departure; 1 where it is idle and where it is free, without meaning there.
    """

    rough: Ints
    stated: Ints
    free: Ints
    idle: Ints
    sigma_m: Floats

    @classmethod
    def of(cls, survey: Survey) -> ThirdCoordinate:
        """Return the departures of the points of a survey."""
        roughness = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
        free, stated = survey.is_free, survey.height_sigma_m > 0
        departs = free | stated | (roughness > 0)
        beside = survey.ties.constraints
        roughness[beside.label] *= beside.uneven
        sigma = np.hypot(roughness, survey.height_sigma_m)
        return cls(
            rough=np.flatnonzero((roughness > 0) & ~stated & ~free),
            stated=np.flatnonzero(stated & ~free),
            free=np.flatnonzero(free),
            idle=np.flatnonzero(~departs),
            sigma_m=np.where(departs & ~free, sigma, 1.0),
        )

    @property
    def is_unknown(self) -> bool:
        """Return whether any point has a departure."""
        return len(self.idle) < len(self.sigma_m)

    @property
    def departs(self) -> Bools:
        """(K,) mask of the points that have a departure."""
        departs = np.ones(len(self.sigma_m), dtype=np.bool_)
        departs[self.idle] = False
        return departs


class Departures(Observation):
    """Departures of points from the ground; a free point has no prior.

    Roughness of the ground, heights stated with a sigma, and unknowns that nothing uses.
    """

    kinds = (
        Kind("roughness", GROUND, "unevenness of the ground", is_core=True, by_size=True),
        Kind("heights", GROUND, "stated heights above the ground", is_core=True),
        Kind("idle", GROUND, "heights that nothing uses", role="construction"),
    )

    @cached_property
    def label(self) -> Ints:
        """(n,) labels of the points, by index."""
        third = self.problem.third
        return {"roughness": third.rough, "heights": third.stated, "idle": third.idle}[self.name]

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the heights above the ground that are stated with a sigma, one for each label."""
        survey, picks = truth.problem.survey, stated.picks
        sigma = np.where(survey.is_free, 0.0, survey.height_sigma_m)
        height = truth.height_m + sigma * truth.rng.standard_normal(len(truth.row))
        k = np.array([truth.row[name] for name in picks.label], dtype=np.int64)
        drawn = np.isfinite(picks.height_m) & (sigma[k] > 0)
        again = replace(picks, height_m=np.where(drawn, height[k], picks.height_m))
        return replace(stated, picks=again)

    def is_part(self) -> bool:
        """Return whether any point has a third unknown, and one of them is of this kind."""
        return self.problem.layout.point_size == 3 and len(self.label) > 0

    def rows(self, state: State) -> Block | None:
        """Compare the departures with 0."""
        weight = 1.0 / self.problem.third.sigma_m[self.label]
        columns = 3 * self.label[:, None] + 2  # with departures, each point has three unknowns
        off = state.point[..., self.label, 2] * weight
        return Block(off[..., None], columns, weight[:, None, None])

    def axis(self, member: Member) -> str:
        """Return ``departure of 'P' from the plane`` or ``height of 'P'``."""
        (label,) = self.subjects(member.row)["labels"]
        is_height = self.name == "heights"
        return f"height of {label!r}" if is_height else f"departure of {label!r} from the plane"

    def title(self, member: Member) -> str:
        """Return ``height of the ground at 'P'`` or ``height of 'P'``."""
        (label,) = self.subjects(member.row)["labels"]
        where = "of" if self.name == "heights" else "of the ground at"
        return f"height {where} {label!r}"

    def suspect(self, member: Member) -> str:
        """Return ``height of 'P'``, of a point on the ground with a hint."""
        (label,) = self.subjects(member.row)["labels"]
        hint = "" if self.name == "heights" else " (it may stand above the ground)"
        return f"height of {label!r}{hint}"

    def remedy(self, row: int) -> Remedy | None:
        """Return that its height is to be found from its photos, if there are several."""
        survey = self.problem.survey
        frames = survey.pick_frame[survey.pick_label == self.label[row]]
        several = len(np.unique(frames)) > 1
        return propose_free_heights(self.subjects(row)["labels"]) if several else None

    def subjects(self, row: int) -> Subjects:
        """Return its label."""
        return {"labels": (str(self.problem.survey.label[self.label[row]]),)}


class Relief(Observation):
    """Smooth departures of the ground from its planes."""

    kind = Kind(
        "relief",
        GROUND,
        "shape of the ground",
        role="construction",
        is_core=True,
        is_judged=True,
        by_size=True,
    )

    def is_part(self) -> bool:
        """Return whether an area has a relief."""
        return bool(self.problem.layout.relief)

    def rows(self, state: State) -> Block | None:
        """Compare the coefficients with 0."""
        sigma = self.problem.ground.relief_sigma_m
        return make_independent_prior(state.relief, sigma, self.problem.layout.first_relief)


class Plane(Prior):
    """Prior of the plane of an area; the first area's group has the kind's name."""

    kind = Kind(
        "plane",
        GROUND,
        "plane of the ground",
        axes=("ground height", "ground slope east", "ground slope north"),
        units=("m", "deg", "deg"),
        is_core=True,
    )

    def __init__(self, problem: SurveyProblem, kind: Kind, prior: PlanePrior) -> None:
        super().__init__(problem, kind)
        self._prior = prior
        self._is_first = prior.area == problem.survey.ground.name

    @classmethod
    def of(cls, problem: SurveyProblem) -> Iterator[Observation]:
        """Yield a group for each area whose plane is an unknown."""
        return (cls(problem, cls.kind, each) for each in problem.ground.priors())

    @property
    def name(self) -> str:
        """``plane``, or ``plane of verge``."""
        return self.kind.name if self._is_first else f"plane of {self._prior.area}"

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the stated height of the first area; without a world there is none."""
        ground, free = stated.ground, truth.problem.survey.gauge == "plane"
        true = 0.0 if free else float(truth.state.plane[0])
        height = true + ground.height_sigma_m * truth.rng.standard_normal()
        return replace(stated, ground=replace(ground, height_m=float(height)))

    def rows(self, state: State) -> Block | None:
        """Compare height and slopes with their prior means."""
        layout, prior = self.problem.layout, self._prior
        unknown = state.plane[..., state.plane.shape[-1] - layout.plane :]
        off = unknown[..., prior.first : prior.first + len(prior.mean)] - prior.mean
        return make_independent_prior(off, prior.sigma, layout.first_plane + prior.first)

    def axis(self, member: Member) -> str:
        """Return ``ground height``, or ``ground height of 'verge'``."""
        what = super().axis(member)
        return what if self._is_first else f"{what} of {self._prior.area!r}"
