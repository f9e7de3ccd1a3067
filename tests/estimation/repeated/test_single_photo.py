"""Many draws of one photo: the same minima as of other solvers, and honest covariances."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest
from photo_draws import HEIGHT_M, Scene, photo_scene, residuals, start_of
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.estimation.repeated.single_photo import adjust_photos, intersect_ground
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Floats


@pytest.mark.parametrize(("slope", "joined"), [(False, False), (True, False), (True, True)])
def test_the_minimum_is_that_of_scipy_over_all_unknowns(slope: bool, joined: bool) -> None:  # noqa: FBT001
    scene = photo_scene(3, slope=slope, joined=joined)
    found = adjust_photos(scene.design, scene.draws, (scene.center, scene.rotation))
    assert found.converged.all()
    for draw in range(3):
        best = least_squares(
            partial(residuals, scene, draw),
            start_of(scene, draw),
            jac="3-point",
            method="trf",
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        assert found.cost[draw] == pytest.approx(2 * best.cost, abs=1e-9)
        off = np.concatenate(
            [
                found.center_world_m[draw] - best.x[:3],
                Rotation.from_matrix(
                    (scene.draws.world_from_camera[draw] @ turn(best.x[3:6])).T
                    @ found.world_from_camera[draw]
                ).as_rotvec(),
            ]
        )
        sigma = np.sqrt(np.diag(found.covariance[draw]))
        assert np.abs(off / sigma).max() < 1e-5


def turn(vector: Floats) -> Floats:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


@pytest.mark.parametrize("joined", [False, True])
def test_errors_are_as_large_as_the_covariances_say(joined: bool) -> None:  # noqa: FBT001
    scene = photo_scene(2000, seed=3, slope=True, joined=joined)
    found = adjust_photos(scene.design, scene.draws)
    assert found.converged.all()
    error = pose_errors(scene, found.center_world_m, found.world_from_camera)
    weight = np.linalg.inv(found.covariance)
    total = float(np.einsum("bi,bij,bj->", error, weight, error))
    assert chi2.ppf(1e-4, 6 * len(error)) < total < chi2.isf(1e-4, 6 * len(error))
    # The cost has as many degrees of freedom as there are lengths: each pose beforehand and each
    # sighting stand against an unknown.
    free = len(scene.design.line) * len(error)
    assert chi2.ppf(1e-4, free) < float(found.cost.sum()) < chi2.isf(1e-4, free)


def pose_errors(scene: Scene, center: Floats, rotation: Floats) -> Floats:
    back = np.swapaxes(np.broadcast_to(scene.rotation, rotation.shape), 1, 2)
    return np.concatenate([center - scene.center, log_so3(back @ rotation)], axis=1)


def test_where_it_begins_does_not_matter() -> None:
    scene = photo_scene(300, seed=5)
    near = adjust_photos(scene.design, scene.draws, (scene.center, scene.rotation))
    far = adjust_photos(scene.design, scene.draws)
    both = near.converged & far.converged
    assert both.all()
    sigma = np.sqrt(np.einsum("bii->bi", near.covariance))
    off = pose_errors(scene, near.center_world_m, near.world_from_camera) - pose_errors(
        scene, far.center_world_m, far.world_from_camera
    )
    assert np.abs(off / sigma).max() < 1e-6


def test_what_does_not_come_to_rest_is_marked_and_nothing_else_suffers() -> None:
    scene = photo_scene(50, seed=7)
    behind = scene.draws.center_world_m.copy()
    behind[:5, 2] -= 2 * HEIGHT_M  # below the ground: no end is in front of the camera
    draws = dataclasses.replace(scene.draws, center_world_m=behind)
    found = adjust_photos(scene.design, draws)
    assert not found.converged[:5].any()
    assert np.isnan(found.cost[:5]).all()
    assert np.isnan(found.covariance[:5]).all()
    alone = adjust_photos(scene.design, scene.draws)
    assert np.allclose(found.center_world_m[5:], alone.center_world_m[5:], atol=1e-9)


def test_pixels_meet_the_ground_where_the_points_stand() -> None:
    scene = photo_scene(1, slope=True)
    pose = scene.center[None], scene.rotation[None]
    place = intersect_ground(scene.design, scene.draws, pose)
    # A pixel is HEIGHT_M / 2250 m: the draw's noise, five sigmas of it on tilted ground.
    assert np.abs(place[0] - scene.ends_m).max() < 8 * 0.8 * HEIGHT_M / 2250
