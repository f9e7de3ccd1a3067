"""Identification: the point that people picked, alike in all photos, is not quite the one meant.

Lengths, control points and what is measured are of the meant point, clicks show the picked one.
More photos do not average the offset between the two away. Chains of matches are of the picked
point as well: they show it again, and nothing of the meant one but its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import Kind, Observation
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

LINKED_M = 0.001
"""Sigma of the difference in height above the ground between the picked and the meant point [m]."""


class Identification(Observation):
    """Offsets, east and north, between the points that people picked and those that were meant."""

    kind = Kind(
        "identification",
        "identification",
        "what was picked, beside what was meant",
        role="untested",
        is_core=True,
        by_size=True,
    )

    def __init__(self, problem: SurveyProblem, kind: Kind) -> None:
        super().__init__(problem, kind)
        survey, layout = problem.survey, problem.layout
        self._label = survey.identified
        self._sigma = np.repeat(survey.identification_sigma_m[self._label], 2)
        picked = layout.picked_columns(np.arange(len(self._label)))
        self._level = _columns(picked[:, :2], layout.point_columns(self._label)[:, :2])

    def is_part(self) -> bool:
        """Whether people may have picked beside what was meant."""
        return len(self._label) > 0

    def rows(self, state: State) -> Block | None:
        """Compute (2Q, 1) offsets of each picked point, east and then north."""
        off = (state.picked - state.point[..., self._label, :])[..., :2]
        return _differences(off.reshape(*off.shape[:-2], -1), self._level, self._sigma)


class Linked(Observation):
    """Heights of picked points and of chains of matches, as of the points that were meant."""

    kind = Kind(
        "linked",
        "identification",
        "heights of what was picked, as of what was meant",
        role="construction",
    )

    def __init__(self, problem: SurveyProblem, kind: Kind) -> None:
        super().__init__(problem, kind)
        survey, layout, matches = problem.survey, problem.layout, problem.survey.matches
        label = survey.identified
        self._chain = np.arange(matches.points if layout.point_size == 3 else 0)
        self._linked = np.append(label, survey.pick_label[matches.pick[self._chain]])
        picked = layout.picked_columns(np.arange(len(label)))
        own = np.concatenate([picked, layout.tie_columns(self._chain)])
        self._upright = _columns(own[:, 2:], layout.point_columns(self._linked)[:, 2:])

    def is_part(self) -> bool:
        """Whether such a point has a height of its own."""
        return len(self._upright) > 0

    def rows(self, state: State) -> Block | None:
        """Compute (Q + chains, 1) how much higher than the meant one each is over its ground."""
        own = np.concatenate([state.picked, state.tie[..., self._chain, :]], axis=-2)
        off = (own - state.point[..., self._linked, :])[..., 2]
        return _differences(off, self._upright, np.full(off.shape[-1], LINKED_M))


def _columns(own: Ints, other: Ints) -> Ints:
    """(n, 2) pairs of unknowns from (m, k) of two kinds."""
    return np.stack([own.ravel(), other.ravel()], axis=1)


def _differences(off: Floats, columns: Ints, sigma: Floats) -> Block:
    """Rows for (..., n) differences of two unknowns each, over their sigmas (n,)."""
    jacobian = np.stack([1.0 / sigma, -1.0 / sigma], axis=1)[:, None, :]
    return Block((off / sigma)[..., None], columns, jacobian)
