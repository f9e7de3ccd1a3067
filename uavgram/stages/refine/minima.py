"""The minima of the likelihood: from every start, the distinct ones that explain the data."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Adjustment, Refined
from uavgram.estimation.first_values import FirstValues
from uavgram.estimation.least_squares import Minimum, minimise
from uavgram.estimation.normal_equations import SingularError
from uavgram.estimation.survey_problem import SurveyProblem
from uavgram.estimation.survey_select import select_lines, select_picks
from uavgram.estimation.survey_state import State, move
from uavgram.model.arrays import Bools
from uavgram.model.survey import Survey
from uavgram.stages.refine.starts import first_values, unusable

AS_GOOD = 0.001
"""Probability below which an alternative's extra cost rules it out."""


def adjust(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """One adjustment of the picks in `keep`, all minima; picks without first values are left."""
    reason = dict(reason)
    while True:
        if not keep.any():
            raise GeometryError(
                "no usable pick is left; the picks were left out because: "
                + "; ".join(sorted(set(reason.values())))
            )
        selection = select_picks(survey, keep)
        line_used = ~line_removed[selection.line_index]
        starts = first_values(select_lines(selection.survey, line_used))
        skipped = [unusable(selection.survey, values) for values in starts]
        # Of several poses that explain the lengths, one that sees sky where points were picked
        # comes after those that see ground.
        fewest = min(skipped, key=len)
        if not fewest:
            break
        left = selection.pick_index[list(fewest)]
        reason |= dict(zip(left.tolist(), fewest.values(), strict=True))
        keep = keep.copy()
        keep[left] = False
    possible = [v for v, without in zip(starts, skipped, strict=True) if not without]
    adjustment, *alternatives = _minima(selection.survey, possible, line_used)
    return Refined(
        adjustment=adjustment,
        pick_index=selection.pick_index,
        line_index=selection.line_index,
        removals=(),
        pick_removed=np.zeros(0, dtype=bool),
        line_removed=line_removed,
        pick_reason=reason,
        alternatives=tuple(alternatives),
    )


def _minima(survey: Survey, starts: list[FirstValues], line_used: Bools) -> list[Adjustment]:
    """The best minimum, and every other one that explains the observations nearly as well."""
    found = []
    undetermined: GeometryError | None = None
    for values in starts:
        try:
            found.append(_minimise(survey, values, line_used))
        except GeometryError as error:  # one start may lie where two solutions merge
            undetermined = undetermined or error
    if undetermined is not None and not found:
        raise undetermined
    found.sort(key=lambda minimum: minimum[1].cost)
    limit = found[0][1].cost + float(chi2.ppf(1 - AS_GOOD, 1))
    minima = [_adjustment(*found[0])]
    for problem, minimum in found[1:]:
        as_good = minimum.converged and minimum.cost < limit
        if as_good and all(_apart(known, minimum.state) for known in minima):
            minima.append(_adjustment(problem, minimum))
    return minima


def _minimise(
    survey: Survey, values: FirstValues, line_used: Bools
) -> tuple[SurveyProblem, Minimum[State]]:
    pivot = np.median(values.point_m, axis=0)  # one pick near the horizon does not drag it away
    problem = SurveyProblem(survey, pivot, line_used)
    layout = problem.layout
    point = np.zeros((layout.points, layout.point_size))
    point[:, :2] = values.point_m
    state = State(
        point=point,
        center=np.array(values.center),
        rotation=np.array(values.rotation),
        intrinsic=np.zeros(layout.intrinsics),
        plane=np.array([values.height_m, 0.0, 0.0]),
        telemetry=problem.telemetry_mean if layout.telemetry else np.zeros(0),
    )
    try:
        minimum = minimise(
            state,
            problem.evaluate,
            lambda now, step: move(layout, now, step),
            layout.size,
            layout.structure,
        )
    except SingularError as error:
        raise GeometryError(
            f"the observations do not determine {layout.describe(error.index, survey)}: add known "
            "lengths or picks there, or leave it out"
        ) from error
    return problem, minimum


def _adjustment(problem: SurveyProblem, minimum: Minimum[State]) -> Adjustment:
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _apart(adjustment: Adjustment, other: State) -> bool:
    """Whether another minimum has points elsewhere, by more than a thousandth of the scene."""
    here = adjustment.state.point[:, :2]
    span = np.ptp(here, axis=0).max()
    return bool(np.abs(here - other.point[:, :2]).max() > 1e-3 * span)
