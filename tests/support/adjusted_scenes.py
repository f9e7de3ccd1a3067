"""Adjustments of scenes from their truth: the search for first values and gross errors is left out.

The start moves no minimum. That the search finds it is shown elsewhere.
"""

from __future__ import annotations

import numpy as np
from scenes import Scene

from uavgram.estimation.solver.levenberg_marquardt import minimise
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import advance_state

AT_REST = 1e-6
"""Predicted reduction at which the iterations end: a thousandth of a sigma, squared."""


def adjust_from_truth(scene: Scene) -> Adjustment | None:
    """Adjust a scene from its truth; None if the iterations do not come to rest."""
    survey = scene.survey
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    layout = problem.layout
    minimum = minimise(
        scene.truth,
        problem.evaluate,
        lambda state, step: advance_state(layout, state, step),
        layout.size,
        layout.structure,
        at_rest=AT_REST,
    )
    if not minimum.converged:
        return None
    return Adjustment(problem, minimum, minimum.factor.covariance())
