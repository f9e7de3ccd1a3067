"""The ground's planes: heights and slopes by area, and what rough ground adds to an ellipse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.ground_planes import (
    GroundPlanes,
    compute_area_centroids,
    make_first_planes,
)
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

VERGE = (1, 3)


@pytest.fixture
def survey() -> Survey:
    return make_scene(0, labels=5, verge=VERGE).survey


def test_every_label_lies_on_the_plane_of_its_area(survey: Survey) -> None:
    pivot = np.array([[0.0, 0.0], [10.0, 20.0]])
    planes = np.array([1.0, 0.1, 0.0, 5.0, 0.0, -0.2])
    label = np.array([0, 1, 3])
    surface = GroundPlanes(survey, pivot).at(planes, np.zeros(0), label, np.array([[3.0, 4.0]] * 3))
    np.testing.assert_allclose(surface.height_m, [1.3, 8.2, 8.2])
    np.testing.assert_allclose(surface.slope, [[0.1, 0.0], [0.0, -0.2], [0.0, -0.2]])
    np.testing.assert_allclose(surface.by_unknowns[1], [1.0, -7.0, -16.0])
    assert GroundPlanes(survey, pivot).columns(label).tolist() == [[0, 1, 2], [3, 4, 5], [3, 4, 5]]


def test_a_plane_that_is_the_gauge_is_no_unknown(survey: Survey) -> None:
    ground = GroundPlanes(replace(survey, gauge="plane"), np.zeros(2))
    label = np.array([0, 1])
    assert ground.size == 3
    surface = ground.at(np.array([0.0, 0, 0, 0.4, 0, 0]), np.zeros(0), label, np.ones((2, 2)))
    assert surface.by_unknowns.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert ground.columns(label).tolist() == [[0, 1, 2], [0, 1, 2]]
    (prior,) = ground.priors()
    assert prior.area == "verge"
    assert prior.mean[0] == pytest.approx(0.4)  # above the first area's plane


def test_first_planes_lie_as_far_apart_as_stated(survey: Survey) -> None:
    np.testing.assert_allclose(make_first_planes(survey.grounds, 7.0), [7.0, 0, 0, 7.4, 0, 0])


def test_an_area_that_lost_its_points_has_the_middle_of_the_scene(survey: Survey) -> None:
    alone = replace(survey, area=np.zeros(5, dtype=int))
    point = np.arange(10.0).reshape(5, 2)
    np.testing.assert_array_equal(compute_area_centroids(alone, point), [[4.0, 5.0]] * 2)
    np.testing.assert_array_equal(compute_area_centroids(survey, point), [[4.0, 5.0], [4.0, 5.0]])


def points_of(roughness: float) -> tuple[Adjustment, Floats]:
    scene = make_scene(6, frames=1, labels=6, lines=0, noise=0.0, tilt=0.8, roughness=roughness)
    adjustment = refine(scene.survey, SolveOptions())[0].adjustment
    return adjustment, adjustment.points()[1][:, :2, :2]


def test_rough_ground_lengthens_an_ellipse_along_the_ray() -> None:
    # A point dz above the plane shifts by dz tan(view angle), away from the camera's foot.
    rough, smooth = 0.2, 0.0
    _, before = points_of(smooth)
    adjustment, after = points_of(rough)
    state = adjustment.state
    world = adjustment.points()[0]
    ray = world - state.center[0]
    shift = rough * ray[:, :2] / ray[:, 2:]
    assert np.linalg.norm(shift, axis=1).min() > 0.05
    expected = before + shift[:, :, None] * shift[:, None, :]
    np.testing.assert_allclose(after, expected, rtol=0.02, atol=1e-4)


def test_only_the_area_that_is_rough_has_longer_ellipses() -> None:
    scene = make_scene(6, frames=1, labels=6, lines=0, noise=0.0, tilt=0.8, verge=VERGE)
    verge = replace(scene.survey.grounds[1], roughness_sigma_m=0.2)
    rough = replace(scene.survey, grounds=(scene.survey.ground, verge))
    plain, uneven = (
        refine(survey, SolveOptions())[0].adjustment for survey in (scene.survey, rough)
    )
    before, after = (
        adjustment.points()[1][:, :2, :2].trace(axis1=1, axis2=2) for adjustment in (plain, uneven)
    )
    on = plain.survey.area == 1
    assert 0 < on.sum() < len(on)
    np.testing.assert_allclose(after[~on], before[~on], rtol=1e-6)
    assert (after[on] > before[on] + 0.0025).all()
