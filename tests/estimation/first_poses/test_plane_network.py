"""Frames joined over a plane by the points that they share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scenes import Scene

from uavgram.estimation.first_poses.known_frames import PlaneNetwork
from uavgram.geometry.camera.projection import back_project
from uavgram.model.survey import Survey


def grown(survey: Survey, scene: Scene) -> PlaneNetwork:
    """All frames joined to the first, which stands where it is."""
    lens = survey.calibration
    network = PlaneNetwork(survey, back_project(lens.model, lens.parameters, survey.pixel_px))
    network.place(0, scene.truth.center[0], scene.truth.rotation[0])
    network.grow({})
    return network


def test_a_frame_that_does_not_fit_places_no_points_for_others(
    scene_factory: Callable[..., Scene],
) -> None:
    """One with two labels swapped shares most points with the first, so it would come first."""
    scene = scene_factory(1, frames=4, telemetry=False, gauge="plane", noise=0.0, tilt=0.4)
    survey, frame, label = scene.survey, scene.survey.pick_frame, scene.survey.pick_label
    pixel = survey.pixel_px.copy()
    swapped = [int(np.flatnonzero((frame == 1) & (label == k))[0]) for k in (0, 3)]
    pixel[swapped] = pixel[swapped[::-1]]
    # The first frame shows points 0 to 5, the second all, the others all but 0.
    keep = ~((frame == 0) & (label > 5)) & ~((frame > 1) & (label == 0))
    survey = replace(
        survey,
        pick_frame=frame[keep],
        pick_label=label[keep],
        pixel_px=pixel[keep],
        pick_sigma_px=survey.pick_sigma_px[keep],
    )
    network = grown(survey, scene)
    good = [0, 2, 3]
    np.testing.assert_allclose(network.point, scene.truth.point, atol=1e-4)
    np.testing.assert_allclose(network.center[good], scene.truth.center[good], atol=1e-3)
