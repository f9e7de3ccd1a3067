"""Which things a photo may show, against what it does show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.views.survey.outlines import VisiblePolylines, project_from, sample_polyline


@pytest.mark.parametrize("sweep", [0.0, 0.4])
def test_nothing_that_a_photo_shows_is_out_of_its_sight_and_most_of_the_rest_is(
    sweep: float,
) -> None:
    made = survey.build(clean=True)
    moved = np.broadcast_to(sweep * np.array([3.0, -2.0, 0.5, 0.1, -0.15, 0.05]), (20, 6))
    result = replace(made, frames=replace(made.frames, sweep=moved.copy()))
    rng = np.random.default_rng(3)
    start = rng.uniform([-90.0, -90.0, -5.0], [90.0, 90.0, 15.0], (400, 3))
    end = start + rng.normal(0.0, 8.0, (400, 3))
    strips = [sample_polyline(strip) for strip in np.stack([start, end], axis=1)]
    in_sight = VisiblePolylines(result, strips)
    shown, told = (np.zeros((20, 400), np.bool_) for _ in range(2))
    for frame in range(20):
        pixel = project_from(result, row_poses(result, frame), np.stack(strips))
        shown[frame] = np.isfinite(pixel[..., 0]).any(axis=1)
        told[frame, in_sight.of(frame)] = True

    assert shown.sum() > 300
    assert not (shown & ~told).any()
    assert told.mean() < 0.5
