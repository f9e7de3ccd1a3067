"""First values of tie points: only of those well in front of all their cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from place_only_scenes import LENS, place_only
from scenes import cv_pixels

from uavgram.estimation.first_poses.first_points import add_first_ties
from uavgram.estimation.first_poses.network import FirstValues
from uavgram.model.survey import Sightings

UP_M = 30.0


@pytest.mark.parametrize(("away_m", "ties"), [(0.1, 0), (3.0, 1)])
def test_a_point_beside_a_camera_has_no_first_value(away_m: float, ties: int) -> None:
    """The camera moves by more than a decimetre while it reads its rows."""
    scene = place_only(3, frames=6, labels=11)
    place = np.array([1.0, 2.0, UP_M])
    forward = scene.rotation[0][:, 2]
    center = np.stack([place - away_m * forward, place - [8.0, 0.0, -40.0]])
    pixel = np.concatenate(
        [cv_pixels(LENS, center[k], scene.rotation[k], place[None])[0] for k in range(2)]
    )
    survey = replace(
        scene.survey,
        ties=Sightings(
            frame=np.array([0, 1]),
            point=np.zeros(2, np.int64),
            pixel_px=pixel,
            sigma_px=np.full(2, 0.15),
            row=np.arange(2),
            pick=np.array([-1]),
        ),
    )
    count = len(survey.label)
    poses = np.concatenate([center, scene.center[2:]]), scene.rotation
    values = FirstValues(np.zeros((count, 2)), *poses, 0.0, np.zeros(count))

    usable, first = add_first_ties(survey, values)

    assert usable.ties.points == len(first) == ties
    np.testing.assert_allclose(first, place[None][:ties], atol=1e-3)
