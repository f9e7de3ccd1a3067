"""Picked pixels in other photos: against rays that meet the ground, and by central differences."""

from __future__ import annotations

import numpy as np
import pytest
from place_only_scenes import place_only

from uavgram.estimation.measuring.predicted_pixels import PickedPixels, transfer_pixels
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.unknowns import State, apply_increment
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.model.arrays import Floats
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.seed.headings import find_headings


@pytest.fixture(scope="module")
def adjustment() -> Adjustment:
    """Of a survey in which every third pick is left out."""
    survey, _ = find_headings(place_only(7).survey)
    keep = np.arange(len(survey.pick_frame)) % 3 > 0
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    return find_best_minima(Participants(survey, keep, none, {})).adjustment


@pytest.fixture(scope="module")
def clicked(adjustment: Adjustment) -> PickedPixels:
    survey = adjustment.survey
    beside = survey.pixel_px + np.array([0.9, -0.6])  # not where the label was adjusted to
    return PickedPixels(survey.pick_frame, survey.pick_label, beside)


def on_ground(
    adjustment: Adjustment, state: State, here: int, there: int, label: int, pixel_px: Floats
) -> Floats:
    """The pixel of another frame that shows the same place, as far off the plane as the label."""
    camera, lens = adjustment.survey.calibration, adjustment.problem.intrinsics(state)
    still = np.zeros(6)
    first = RowPoses(state.center[here], state.rotation[here], still)
    second = RowPoses(state.center[there], state.rotation[there], still)
    pivot = adjustment.problem.pivot_m[0]
    ground = np.add(state.plane[:3], [state.point[label, 2], 0.0, 0.0])
    world = intersect_ground(*sight_lines(camera, lens, first, pixel_px), ground, pivot)
    return project_rows(camera, lens, second, world)


def test_place_and_affine_are_those_of_the_ground_under_the_pixel(
    adjustment: Adjustment, clicked: PickedPixels
) -> None:
    found = transfer_pixels(adjustment, None, clicked)
    names = adjustment.survey.frame_id

    assert len(found.click) > 20
    for k, click in enumerate(found.click.tolist()):
        here, there = int(clicked.frame[click]), names.index(found.frame_id[k])
        label, pixel, state = clicked.label[click], clicked.pixel_px[click], adjustment.state
        assert here != there
        place = on_ground(adjustment, state, here, there, label, pixel)
        assert found.pixel_px[k] == pytest.approx(place, abs=2e-3)  # the affine's own curvature
        steps = 0.5 * np.eye(2)
        ahead = [on_ground(adjustment, state, here, there, label, pixel + step) for step in steps]
        back = [on_ground(adjustment, state, here, there, label, pixel - step) for step in steps]
        assert found.affine[k] == pytest.approx(np.subtract(ahead, back).T, abs=2e-3)


def test_covariance_is_that_of_all_unknowns_but_the_place_of_the_point(
    adjustment: Adjustment, clicked: PickedPixels
) -> None:
    found = transfer_pixels(adjustment, None, clicked)
    layout, state = adjustment.problem.layout, adjustment.state
    joint = adjustment.minimum.factor.joint(np.arange(layout.size))
    sigma = np.sqrt(np.diag(joint))

    for k in range(0, len(found.click), 9):
        click = int(found.click[k])
        here = int(clicked.frame[click])
        there = adjustment.survey.frame_id.index(found.frame_id[k])
        by_unknown = np.zeros((2, layout.size))
        for column in range(layout.size):
            step = np.zeros(layout.size)
            step[column] = 1e-3 * sigma[column]
            ends = [
                on_ground(
                    adjustment,
                    apply_increment(layout, state, way * step),
                    here,
                    there,
                    clicked.label[click],
                    clicked.pixel_px[click],
                )
                for way in (1.0, -1.0)
            ]
            by_unknown[:, column] = (ends[0] - ends[1]) / (2 * step[column])
        expected = by_unknown @ joint @ by_unknown.T
        size = np.trace(expected)
        assert found.covariance_px2[k] == pytest.approx(expected, abs=0.01 * size)


def test_what_both_photos_have_in_common_does_not_make_it_uncertain(
    adjustment: Adjustment, clicked: PickedPixels
) -> None:
    """Places of all photos are off by metres together, the transfer by a part of that."""
    found = transfer_pixels(adjustment, None, clicked)
    radius = np.sqrt(np.trace(found.covariance_px2, axis1=1, axis2=2))
    scale = adjustment.survey.calibration.parameters[0] / adjustment.state.center[:, 2].mean()
    spread = np.sqrt(np.einsum("fii->fi", adjustment.frame_covariance())[:, 0].min()) * scale

    assert np.median(radius) < 0.3 * spread
