"""Ground points as they are handed on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from off_ground import with_third_coordinates
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.ground_planes import PLANE_SIZE
from uavgram.estimation.survey.unknowns import State, apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Geodetic, Relief, World
from uavgram.stages.reconstruct import reconstruct
from uavgram.stages.refine import refine

WORLD = World(origin=Geodetic(50.4452, -104.6189, 577.0), height_datum="msl", gauge="world")
NOWHERE = World(origin=None, height_datum="msl", gauge="plane")


@pytest.fixture(scope="module")
def adjustment(scene_factory: Callable[..., Scene]) -> Adjustment:
    return refine(scene_factory(2).survey, SolveOptions())[0].adjustment


def test_positions_and_covariances_are_those_of_the_adjustment(adjustment: Adjustment) -> None:
    points = reconstruct(adjustment, WORLD)
    world, covariance = adjustment.points()
    np.testing.assert_array_equal(points.position_world_m, world)
    np.testing.assert_array_equal(points.covariance_m2, covariance[:, :2, :2])
    for k in (0, 5):
        joint = adjustment.joint_points(np.array([k]))[1]
        np.testing.assert_allclose(points.covariance_m2[k], joint[:2, :2], rtol=1e-6, atol=1e-12)


def test_ellipses_hold_95_of_100_draws_and_point_along_the_largest_spread(
    adjustment: Adjustment,
) -> None:
    points = reconstruct(adjustment, WORLD)
    rng = np.random.default_rng(0)
    for k in range(3):
        draws = rng.multivariate_normal(np.zeros(2), points.covariance_m2[k], 20000)
        azimuth = points.ellipse_azimuth_rad[k]
        along = draws @ [np.sin(azimuth), np.cos(azimuth)]
        across = draws @ [np.cos(azimuth), -np.sin(azimuth)]
        major, minor = points.ellipse_95_m[k]
        inside = (along / major) ** 2 + (across / minor) ** 2 <= 1
        assert inside.mean() == pytest.approx(0.95, abs=0.008)
        assert along.std() == pytest.approx(major / 2.4477, rel=0.03)
        assert across.std() == pytest.approx(minor / 2.4477, rel=0.03)


def test_latitude_and_longitude_are_those_of_proj(adjustment: Adjustment) -> None:
    points = reconstruct(adjustment, WORLD)
    back = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lat_0=50.4452 "
        "+lon_0=-104.6189 +h_0=577 +step +inv +proj=cart +ellps=WGS84"
    )
    east, north, up = points.position_world_m.T
    longitude, latitude, _ = back.transform(east, north, up)
    np.testing.assert_allclose(points.latitude_deg, latitude, atol=1e-11)
    np.testing.assert_allclose(points.longitude_deg, longitude, atol=1e-11)


def test_without_an_earth_there_is_no_latitude(adjustment: Adjustment) -> None:
    assert np.isnan(reconstruct(adjustment, NOWHERE).latitude_deg).all()


def test_every_point_names_the_frames_that_see_it(adjustment: Adjustment) -> None:
    points, survey = reconstruct(adjustment, WORLD), adjustment.survey
    for label, frames in zip(points.label, points.frames, strict=True):
        k = survey.label.index(label)
        expected = {survey.frame_id[f] for f in survey.pick_frame[survey.pick_label == k]}
        assert set(frames) == expected


def off_plane(adjustment: Adjustment, state: State) -> Floats:
    """(K,) heights over the plane of each point's area, less its stated height."""
    survey, pivot = adjustment.survey, adjustment.problem.pivot_m[adjustment.survey.area]
    world, _, _ = adjustment.problem.world_points(state, np.arange(len(survey.label)))
    plane = state.plane.reshape(-1, PLANE_SIZE)[survey.area]
    rise = plane[:, 0] + np.sum(plane[:, 1:] * (world[:, :2] - pivot), axis=1)
    return np.asarray(world[:, 2] - rise - survey.height_above_m)


def test_on_a_plane_nothing_departs_from_it(adjustment: Adjustment) -> None:
    points = reconstruct(adjustment, WORLD)
    assert not points.departure_m.any()
    assert not points.departure_sigma_m.any()
    assert not points.departs.any()


def test_departures_are_heights_over_the_plane_and_their_sigmas_follow_from_all_unknowns() -> None:
    """Rough ground with a crown beside smooth ground; the gradient by central differences."""
    survey = make_scene(4, roughness=0.08, verge=(3, 5, 7), heights={0: 0.4, 3: 0.7}).survey
    crown = Relief(kind="quadratic", sigma_m=0.1, scale_m=9.0, knots_m=np.zeros((1, 2)))
    first, second = survey.grounds
    grounds = (replace(first, relief=crown), replace(second, roughness_sigma_m=0.0))
    refined, _ = refine(replace(survey, grounds=grounds), SolveOptions(noise="stated"))
    rough = refined.adjustment
    points = reconstruct(rough, WORLD)
    layout = rough.problem.layout
    gradient = np.empty((layout.points, layout.size))
    for k, step in enumerate(1e-4 * np.eye(layout.size)):
        ahead, back = (apply_increment(layout, rough.state, sign * step) for sign in (1.0, -1.0))
        gradient[:, k] = (off_plane(rough, ahead) - off_plane(rough, back)) / 2e-4
    joint = rough.minimum.factor.joint(np.arange(layout.size))
    sigma = np.sqrt(np.diag(gradient @ joint @ gradient.T))

    np.testing.assert_allclose(points.departure_m, off_plane(rough, rough.state), atol=1e-9)
    np.testing.assert_allclose(points.departure_sigma_m, sigma, rtol=1e-4, atol=1e-9)
    assert points.departs.tolist() == (rough.survey.area == 0).tolist()
    assert np.abs(points.departure_m[points.departs]).min() > 1e-4
    assert not points.departure_m[~points.departs].any()


def test_each_height_says_where_it_is_from() -> None:
    scene = make_scene(2, frames=6, labels=16, heights={3: 1.4, 5: 0.9, 8: 1.5})
    height = np.where(np.arange(16) == 8, scene.survey.height_above_m, 0.0)
    free = np.arange(16) == 5
    survey = replace(scene.survey, height_above_m=height, is_free=free)
    refined = refine(survey, SolveOptions())[0]

    points = reconstruct(refined.adjustment, WORLD, refined.off_ground)

    sources = dict(zip(points.label, points.height_source, strict=True))
    off = {"P3": "found", "P5": "free", "P8": "stated"}
    assert sources == {f"P{k}": off.get(f"P{k}", "ground") for k in range(16)}


def test_departures_are_right_within_their_sigmas() -> None:
    """Chi-square of all departures of ten rough scenes, five-sigma bounds of its mean."""
    squares = []
    for seed in range(10):
        scene = make_scene(seed, roughness=0.15)
        points = reconstruct(
            refine(scene.survey, SolveOptions(noise="stated"))[0].adjustment, WORLD
        )
        truth = dict(zip(scene.survey.label, scene.truth.point[:, 2].tolist(), strict=True))
        error = points.departure_m - [truth[label] for label in points.label]
        squares.extend((error / points.departure_sigma_m) ** 2)
    bound = 5.0 * np.sqrt(2.0 * 4.0 / len(squares))  # a factor 4: those of a scene go together
    assert np.mean(squares) == pytest.approx(1.0, abs=bound)


def test_points_off_the_ground_say_where_their_heights_are_from() -> None:
    scene = make_scene(2, heights={0: 1.4, 3: 2.0, 5: 0.8})
    survey = with_third_coordinates(scene, free=(0,), stated={5: 0.05}).survey
    adjustment = refine(survey, SolveOptions(noise="stated"))[0].adjustment
    points = reconstruct(adjustment, WORLD)
    rows = np.array([0, 3, 5])

    assert [points.height_source[row] for row in rows] == ["free", "stated", "stated"]
    assert np.flatnonzero(points.is_off_ground).tolist() == rows.tolist()
    in_space = points.relative.covariance_m3
    np.testing.assert_array_equal(in_space[rows], adjustment.relative_points_in_space(rows))
    assert np.isnan(np.delete(in_space, rows, axis=0)).all()
