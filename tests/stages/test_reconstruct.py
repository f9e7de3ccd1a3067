"""Ground points as they are handed on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyproj
import pytest
from scenes import Scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.options import SolveOptions
from uavgram.model.survey.world import Geodetic, World
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
