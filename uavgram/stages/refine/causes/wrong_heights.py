"""Hypotheses on labels off the ground."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    ObservationChange,
    compare_hypotheses,
    derive_picks_by_place,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Ints
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.survey import Cause, Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import GROSS_ERROR_LOG_ODDS, Diagnosis, Hypothesis
from uavgram.stages.refine.causes.stray_picks import STRAY_DECREASE, find_stray_picks, labels_of
from uavgram.stages.refine.off_ground import off_ground_message
from uavgram.stages.refine.robust_candidate import OFF_GROUND_M

MAX_LABELS = 300
"""Largest number of labels whose heights are tested."""

MIN_PICKS = 3
"""Least number of picks of a label that separate a wrong pick from a height."""


def find_freed_heights(survey: Survey, causes: Sequence[Cause]) -> frozenset[str]:
    """Return the names of labels that some causes put off the ground."""
    mends = [cause.mend for cause in causes if cause.mend is not None]
    return frozenset(survey.label[k] for mend in mends for k, free in mend.free.items() if free)


def propose_heights(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose heights off the ground for labels with picks that do not fit."""
    adjustment, at = diagnosis.adjustment, labels_of(diagnosis)
    if not adjustment.minimum.converged:
        return
    label = np.unique(adjustment.survey.pick_label[_stray_rows(diagnosis)])
    picks = np.bincount(adjustment.survey.pick_label, minlength=len(adjustment.survey.label))
    asked = label[(picks[label] >= MIN_PICKS) & ~adjustment.survey.off_ground[label]]
    if not len(asked):
        return
    moved = {int(k): _raise_point(adjustment, int(k)) for k in asked[:MAX_LABELS]}
    found = compare_hypotheses(adjustment, [(one,) for one in moved.values()])
    height = dict(zip(moved, (float(one.value[0]) for one in found), strict=True))
    index = {int(a): k for k, a in enumerate(at) if a >= 0}
    for k, one in moved.items():
        if abs(height[k]) < OFF_GROUND_M:
            continue
        yield Hypothesis(
            message=partial(_height_message, adjustment.survey.label[k], int(picks[k])),
            mend=SurveyCorrection(free={index[k]: True}),
            moved=(one,),
            price=GROSS_ERROR_LOG_ODDS + float(np.log(len(adjustment.survey.label))),
        )


HEIGHT_UNITS = ((1.0 / 0.3048, "feet"), (100.0, "centimetres"))
"""Number of units in a metre in which heights may be typed; the foot by definition of 1959."""

MIN_TYPED_M, MIN_TYPED = 1.5, 2
"""Least stated height [m] that may be typed in another unit: a car's corner in feet; and the least
number of them. A single one is found as a gross error."""


def propose_heights_in_other_unit(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all large stated heights were typed in another unit, as those of a car."""
    survey = diagnosis.survey
    label = np.flatnonzero(~survey.is_free & (survey.height_above_m >= MIN_TYPED_M))
    if len(label) < MIN_TYPED:
        return
    names = tuple(survey.label[k] for k in label)
    for size, unit in HEIGHT_UNITS:
        yield Hypothesis(
            message=partial(_unit_message, names, unit),
            freed=partial(_convert_heights, label, size),
            is_of_all=True,
            promise=diagnosis.cost,  # the decrease of the sum of squares is at most all of it
            price=GROSS_ERROR_LOG_ODDS + float(np.log(len(HEIGHT_UNITS))),
            settles=frozenset(names),
        )


def _convert_heights(label: Ints, size: float, survey: Survey) -> Survey:
    height_m = survey.height_above_m.copy()
    height_m[label] /= size
    return replace(survey, height_above_m=height_m)


def _unit_message(names: tuple[str, ...], unit: str, _: HypothesisTest | None) -> Message:
    return Message(
        "warning",
        "heights-wrong-unit",
        f"The stated heights of {join_names(map(repr, names))} seem to be in {unit}, not in "
        "metres: everything fits if they are. Correct their heights.",
        labels=names,
    )


def _stray_rows(diagnosis: Diagnosis) -> Ints:
    """Return picks of the adjustment that do not fit."""
    found = find_stray_picks(diagnosis)
    row = np.full(len(diagnosis.survey.pick_frame), -1)
    row[diagnosis.refined.pick_index] = np.arange(len(diagnosis.refined.pick_index))
    return row[found.pick[found.taking & (found.fall > STRAY_DECREASE)]]


def _raise_point(adjustment: Adjustment, label: int) -> ObservationChange:
    """Return the effect of the height [m] of a label of the adjustment on its picks."""
    rows = np.flatnonzero(adjustment.survey.pick_label == label)
    return ObservationChange("pixels", rows, derive_picks_by_place(adjustment, rows, np.eye(3)[2:]))


def _height_message(label: str, photos: int, found: HypothesisTest | None) -> Message:
    height, sigma = (
        (float("nan"), float("nan"))
        if found is None
        else (float(found.value[0]), float(np.sqrt(found.covariance[0, 0])))
    )
    return off_ground_message(label, height, sigma, photos)
