"""The part of a large survey that what happens at some points can bend.

Observations far away hardly move with these points, and what hardly moves is a plane: there the
adjustment's own linear model is enough. Near by the likelihood itself is asked, of a survey of the
photos that show the points and of those that share points with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.selection import Selection, select_picks
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats, Ints, rows_of
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import Sightings

RINGS = 2
"""Photos that show the points; and those that share points with them."""

FEW = 40
"""Photos of a survey that is its own neighbourhood: a part of it would cost as much."""

MOST = 0.5
"""Share of the photos from which on a part is not worth it."""


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Part of an adjusted survey, or all of it.

    Attributes
    ----------
    problem
        The likelihood of its observations.
    columns
        (n,) where its unknowns stand among those of the whole survey.
    state
        Its unknowns, as they were adjusted.
    """

    problem: SurveyProblem
    columns: Ints
    state: State


def neighbourhood(adjustment: Adjustment, label: Ints) -> Neighbourhood:
    """What surrounds some points: all of a small survey.

    A survey without a world of its own is small, and held by its first photo.
    """
    survey = adjustment.survey
    frames = len(survey.frame_id)
    every = np.arange(adjustment.problem.layout.size)
    whole = Neighbourhood(adjustment.problem, every, adjustment.state)
    if is_small(survey):
        return whole
    near = _frames_around(survey, label)
    if np.count_nonzero(near) > MOST * frames:
        return whole
    seen = replace(survey, matches=_within(survey.matches, near), ties=_within(survey.ties, near))
    return _part(adjustment, select_picks(seen, near[survey.pick_frame]))


def is_small(survey: Survey) -> bool:
    """Whether the whole survey is the neighbourhood of any of its points."""
    return len(survey.frame_id) <= FEW or survey.gauge == "plane"


def _frames_around(survey: Survey, label: Ints) -> Bools:
    """(F,) which photos show the points, or share a point with one that does."""
    matches, ties = survey.matches, survey.ties
    labels = len(survey.label)
    chained = np.append(survey.pick_label, 0)[matches.pick][matches.point]
    frame = np.concatenate([survey.pick_frame, matches.frame, ties.frame])
    point = np.concatenate([survey.pick_label, chained, labels + ties.point])
    asked = np.zeros(labels + ties.points, dtype=np.bool_)
    asked[label] = True
    near = np.zeros(len(survey.frame_id), dtype=np.bool_)
    for _ in range(RINGS):
        near[frame[asked[point]]] = True
        asked[point[near[frame]]] = True
    return near


def _within(sightings: Sightings, near: Bools) -> Sightings:
    """Those in photos near by; all points keep their places."""
    return replace(sightings, **rows_of(sightings, np.flatnonzero(near[sightings.frame]), "n"))


def _part(adjustment: Adjustment, part: Selection) -> Neighbourhood:
    whole, survey = adjustment.problem, part.survey
    used = np.isin(part.line_index, whole.line_index)
    problem = SurveyProblem(survey, whole.pivot_m, used)
    layout, of = problem.layout, whole.layout
    size, frames = layout.point_size, part.frame_index
    tape = np.array([whole.tapes.index(name) for name in problem.tapes], dtype=np.int64)
    tie = np.concatenate([part.chain_index, adjustment.survey.matches.points + part.tie_index])
    picked = np.searchsorted(adjustment.survey.identified, part.label_index[survey.identified])
    columns = [
        of.point_columns(part.label_index)[:, :size],
        of.picked_columns(picked)[:, :size],
        of.tie_columns(tie)[:, :size],
        of.first_frame + of.frame_size * frames[:, None] + np.arange(layout.frame_size),
        np.arange(of.first_intrinsic, of.first_tape),
        of.first_tape + tape,
        np.arange(of.first_readout, of.size),
    ]
    state = adjustment.state
    return Neighbourhood(
        problem,
        np.concatenate([own.ravel() for own in columns]),
        replace(
            state,
            point=state.point[part.label_index, :size],
            picked=state.picked[picked][:, :size],
            tie=state.tie[tie][:, :size],
            center=state.center[frames],
            rotation=state.rotation[frames],
            turning=state.turning[frames] if layout.turning else np.zeros((len(frames), 0)),
            tape=state.tape[tape],
        ),
    )


def groups(place_m: Floats, most: int) -> list[Ints]:
    """Rows of places (n, 2) in groups of up to `most`: halved along the longer way, and again."""
    waiting, found = [np.arange(len(place_m))], []
    while waiting:
        rows = waiting.pop()
        if len(rows) <= most:
            found.append(rows)
            continue
        axis = int(np.argmax(np.ptp(place_m[rows], axis=0)))
        rows = rows[np.argsort(place_m[rows, axis], kind="stable")]
        waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]
    return found
