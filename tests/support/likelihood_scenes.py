"""Surveys with every kind of row: relief, matches and tie points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.survey import Relief, Sightings, Survey

PATCH_PX, MATCH_PX = 0.03, 0.06

RELIEFS = (
    Relief(kind="quadratic", sigma_m=0.2, scale_m=9.0, knots_m=np.array([[1.0, 2.0]])),
    Relief(
        kind="correlated",
        sigma_m=0.1,
        scale_m=6.0,
        knots_m=np.array([[0.0, 0.0], [5.0, 1.0], [-4.0, 6.0], [3.0, -7.0]]),
    ),
)


def with_relief(survey: Survey) -> Survey:
    """The survey, each of its areas with a relief of another kind."""
    grounds = zip(survey.grounds, RELIEFS, strict=True)
    return replace(survey, grounds=tuple(replace(g, relief=relief) for g, relief in grounds))


def with_found(survey: Survey, *, chains: int, ties: int) -> Survey:
    """The survey with its first picks found again in other frames, and some tie points.

    The places are arbitrary: those of other picks of the same labels, and of picks of others.
    """
    frame, label = survey.pick_frame, survey.pick_label
    point, where, pixel, sigma, pick = [], [], [], [], []
    for chain in range(chains):
        first = int(np.flatnonzero(label == chain)[0])
        for row in np.flatnonzero(label == chain):
            point.append(chain)
            where.append(int(frame[row]))
            pixel.append(survey.pixel_px[row])
            sigma.append(PATCH_PX if row == first else MATCH_PX)
        pick.append(first)
    matches = Sightings(
        frame=np.array(where, dtype=np.int64),
        point=np.array(point, dtype=np.int64),
        pixel_px=np.array(pixel).reshape(-1, 2),
        sigma_px=np.array(sigma),
        row=np.arange(len(where)),
        pick=np.array(pick, dtype=np.int64),
    )
    rows = np.flatnonzero(label < ties)
    tied = Sightings(
        frame=frame[rows],
        point=label[rows],
        pixel_px=survey.pixel_px[rows],
        sigma_px=np.full(len(rows), 0.1),
        row=rows,
        pick=np.full(ties, -1),
    )
    return replace(survey, matches=matches, ties=tied)


def beginning(problem: SurveyProblem, truth: State) -> State:
    """The truth, with chains and ties where the labels are that they were made of."""
    survey, layout = problem.survey, problem.layout
    chain = survey.pick_label[survey.matches.pick]
    tie = np.arange(survey.ties.points)
    point = np.zeros((layout.points, layout.point_size))
    point[:, : truth.point.shape[1]] = truth.point
    padded = replace(truth, point=point)
    world, _, _ = problem.world_points(padded, np.arange(layout.points))
    own = [point[chain], world[tie][:, : layout.point_size]]
    turning = np.zeros((layout.frames, layout.frame_size - 6))
    return replace(padded, tie=np.concatenate(own), turning=turning)
