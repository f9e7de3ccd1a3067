"""Identification: the point that people picked, alike in all photos, is not quite the one meant.

Lengths, control points and what is measured are of the meant point, clicks show the picked one.
More photos do not average the offset between the two away. Chains of matches are of the picked
point as well: they show it again, and nothing of the meant one but its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats, Ints

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem
    from uavgram.estimation.survey.unknowns import State

LINKED_M = 0.001
"""Sigma of the difference in height above the ground between the picked and the meant point [m]."""


class PickedPoints:
    """The points that people picked, in the likelihood of a survey.

    Parameters
    ----------
    problem
        The likelihood: its layout is there already.
    """

    def __init__(self, problem: SurveyProblem) -> None:
        survey, layout = problem.survey, problem.layout
        self._label, matches = survey.identified, survey.matches
        picked = layout.picked_columns(np.arange(len(self._label)))
        self._sigma = np.repeat(survey.identification_sigma_m[self._label], 2)
        self._level = _columns(picked[:, :2], layout.point_columns(self._label)[:, :2])
        self._chain = np.arange(matches.points if layout.point_size == 3 else 0)
        self._linked = np.append(self._label, survey.pick_label[matches.pick[self._chain]])
        own = np.concatenate([picked, layout.tie_columns(self._chain)])
        self._upright = _columns(own[:, 2:], layout.point_columns(self._linked)[:, 2:])

    def blocks(self, state: State) -> dict[str, Block]:
        """What holds picked points and chains of matches to the points that were meant.

        Returns
        -------
        dict
            ``identification``: (2Q, 1) offsets of each picked point, east and then north.
            ``linked``: (Q + chains, 1) how much higher than the meant one each is over its ground.
        """
        blocks: dict[str, Block] = {}
        if len(self._label):
            off = (state.picked - state.point[..., self._label, :])[..., :2]
            off = off.reshape(*off.shape[:-2], -1)
            blocks["identification"] = _differences(off, self._level, self._sigma)
        if len(self._upright):
            own = np.concatenate([state.picked, state.tie[..., self._chain, :]], axis=-2)
            off = (own - state.point[..., self._linked, :])[..., 2]
            blocks["linked"] = _differences(off, self._upright, np.full(off.shape[-1], LINKED_M))
        return blocks


def _columns(own: Ints, other: Ints) -> Ints:
    """(n, 2) pairs of unknowns from (m, k) of two kinds."""
    return np.stack([own.ravel(), other.ravel()], axis=1)


def _differences(off: Floats, columns: Ints, sigma: Floats) -> Block:
    """Rows for (..., n) differences of two unknowns each, over their sigmas (n,)."""
    jacobian = np.stack([1.0 / sigma, -1.0 / sigma], axis=1)[:, None, :]
    return Block((off / sigma)[..., None], columns, jacobian)
