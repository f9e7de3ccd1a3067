"""Lines of sight of picks as other photos show them: against rays that meet levels."""

from __future__ import annotations

import numpy as np
import pytest
from place_only_scenes import place_only

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.model.arrays import Floats
from uavgram.pipeline.match.search import HEIGHTS_M, project_sightline
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.seed.headings import find_headings


@pytest.fixture(scope="module")
def adjustment() -> Adjustment:
    survey, _ = find_headings(place_only(7).survey)
    keep = np.ones(len(survey.pick_frame), dtype=np.bool_)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    return find_best_minima(Participants(survey, keep, none, {})).adjustment


def at_level(
    adjustment: Adjustment, frames: tuple[int, int], pixel: Floats, level: Floats
) -> Floats:
    """The pixel of another frame that shows what lies on a plane under a pixel."""
    state, camera = adjustment.state, adjustment.survey.calibration
    lens, still = adjustment.problem.intrinsics(state), np.zeros(6)
    here, there = (RowPoses(state.center[f], state.rotation[f], still) for f in frames)
    pivot = adjustment.problem.pivot_m[0]
    world = intersect_ground(*sight_lines(camera, lens, here, pixel), level, pivot)
    return project_rows(camera, lens, there, world)


def test_a_line_leads_from_below_the_ground_up_in_steps_of_a_pixel(adjustment: Adjustment) -> None:
    survey, plane = adjustment.survey, adjustment.state.plane[:3]
    frame, label = int(survey.pick_frame[4]), int(survey.pick_label[4])
    pixel = survey.pixel_px[4] + np.array([0.7, -0.4])  # not where the label was adjusted to
    others = np.array([f for f in range(len(survey.frame_id)) if f != frame])

    line = project_sightline(adjustment, (frame, label), others, pixel)

    height = np.linspace(HEIGHTS_M[0], HEIGHTS_M[2], len(line.pixel_px))
    assert height[line.lowest - 1] < HEIGHTS_M[1] <= height[line.lowest]
    longest = np.linalg.norm(np.diff(line.pixel_px, axis=0), axis=2).max(axis=1)
    assert 0.4 < np.median(longest) < 1.1
    for k in (0, len(height) // 2, len(height) - 1):
        above = plane + np.array([height[k], 0.0, 0.0])
        ground = [at_level(adjustment, (frame, f), pixel, above) for f in others]
        np.testing.assert_allclose(line.pixel_px[k], ground, atol=1e-3)


def test_photos_are_compared_by_what_lies_level(adjustment: Adjustment) -> None:
    survey = adjustment.survey
    frame, label, pixel = int(survey.pick_frame[4]), int(survey.pick_label[4]), survey.pixel_px[4]
    other = (frame + 1) % len(survey.frame_id)
    line = project_sightline(adjustment, (frame, label), np.array([other]), pixel)
    k = len(line.pixel_px) // 3
    sight = RowPoses(adjustment.state.center[frame], adjustment.state.rotation[frame], np.zeros(6))
    lens = adjustment.problem.intrinsics(adjustment.state)
    center, ray = sight_lines(survey.calibration, lens, sight, pixel)
    height = np.linspace(HEIGHTS_M[0], HEIGHTS_M[2], len(line.pixel_px))[k]
    above = adjustment.state.plane[:3] + np.array([height, 0.0, 0.0])
    up = intersect_ground(center, ray, above, adjustment.problem.pivot_m[0])[2]
    level = np.array([up, 0.0, 0.0])
    ends = [
        at_level(adjustment, (frame, other), pixel + way * step, level)
        for step in 0.5 * np.eye(2)
        for way in (1.0, -1.0)
    ]

    np.testing.assert_allclose(line.affine[k, 0], np.subtract(ends[0::2], ends[1::2]).T, atol=2e-3)
