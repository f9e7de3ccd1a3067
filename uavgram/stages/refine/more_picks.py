"""A few picks more on an adjustment, from where it stands: within milliseconds, and without a search.

Nothing is looked for that could be wrong, and the noise stays as it was learnt: that is for the
adjustment that follows. What it is good for is where the poses, and the new picks, say that other
photos show the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, sight_lines
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.softened import iterate
from uavgram.stages.refine.continued import lines_used

ITERATIONS = 4
"""A pick of a new label changes nothing but its point; another one of a known label little."""


@dataclass(frozen=True, eq=False)
class MorePicks:
    """m picks by name: label (m,), index of the frame (m,), pixel (m, 2), sigma (m,) [px].

    A label that the adjustment does not have lies on the ground of the first area.
    """

    label: Sequence[str]
    frame: Ints
    pixel_px: Floats
    sigma_px: Floats


def with_more_picks(adjustment: Adjustment, more: MorePicks) -> Adjustment:
    """The adjustment with picks that it does not have yet.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    more
        Picks in its frames. New labels that no sight line leads to the ground for are left out.

    Raises
    ------
    SingularError
        An unknown is not determined.
    ValueError
        A pick lies behind its camera.
    """
    survey, state = adjustment.survey, adjustment.state
    ground = _on_ground(adjustment, more)
    known = {label: k for k, label in enumerate(survey.label)}
    new: dict[str, int] = {}
    for row, label in enumerate(more.label):
        if label not in known and np.isfinite(ground[row]).all():
            new.setdefault(label, row)
    place = known | {label: len(known) + k for k, label in enumerate(new)}
    used = np.array([k for k, label in enumerate(more.label) if label in place], dtype=np.int64)
    wider = _with_labels(survey, tuple(new))
    wider = replace(
        wider,
        pick_frame=np.append(survey.pick_frame, more.frame[used]),
        pick_label=np.append(survey.pick_label, [place[more.label[k]] for k in used]).astype(int),
        pixel_px=np.concatenate([survey.pixel_px, more.pixel_px[used]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, more.sigma_px[used]),
        pick_is_target=np.append(survey.pick_is_target, np.zeros(len(used), np.bool_)),
    )
    point = np.zeros((len(wider.label), state.point.shape[1]))
    point[: len(known)] = state.point
    point[len(known) :, :2] = ground[list(new.values()), :2]
    problem = SurveyProblem(wider, adjustment.problem.pivot_m, lines_used(adjustment))
    minimum = iterate(problem, replace(state, point=point), ITERATIONS)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _with_labels(survey: Survey, labels: tuple[str, ...]) -> Survey:
    """A survey with more labels, on the ground of its first area.

    What the adjustment has learnt of how far points on the ground depart from it holds for them.
    """
    none = np.zeros(len(labels))
    plain = (survey.height_above_m == 0.0) & ~survey.is_free & (survey.area == 0)
    departs = float(survey.height_sigma_m[plain].max(initial=0.0))
    return replace(
        survey,
        label=(*survey.label, *labels),
        height_above_m=np.append(survey.height_above_m, none),
        height_sigma_m=np.append(survey.height_sigma_m, none + departs),
        is_free=np.append(survey.is_free, none.astype(np.bool_)),
        area=np.append(survey.area, none.astype(np.int64)),
    )


def _on_ground(adjustment: Adjustment, more: MorePicks) -> Floats:
    """(m, 3) where sight lines meet the first area's plane; NaN where they do not."""
    state, problem = adjustment.state, adjustment.problem
    poses = RowPoses(
        state.center[more.frame], state.rotation[more.frame], adjustment.sweep()[more.frame]
    )
    lens = problem.intrinsics(state)
    lines = sight_lines(problem.survey.calibration, lens, poses, more.pixel_px)
    return intersect_ground(*lines, state.plane[:3], problem.pivot_m[0])
