"""Poses as tags: place, both conventions of angles, accuracies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.errors import GeometryError
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.frames import GeoTags, Poses
from uavgram.model.survey import Geodetic, World
from uavgram.stages.products.geotags import geotag

WORLD = World(origin=Geodetic(-33.7, 151.3, 2.0), height_datum="msl", gauge="world")


def looking(forward: Sequence[float], up: Sequence[float]) -> Floats:
    """Rotation of a camera with its optical axis and image up along directions in the world."""
    z, y = np.array(forward, float), -np.array(up, float)
    return np.column_stack([np.cross(y, z), y, z])


def tags_of(rotation: Floats, covariance: Floats | None = None) -> GeoTags:
    covariance = np.eye(6) if covariance is None else covariance
    poses = Poses(
        frame_id=("a.jpg",),
        center_world_m=np.array([[10.0, 20.0, 50.0]]),
        world_from_camera=rotation[None],
        covariance=covariance[None],
    )
    return geotag(poses, ("/a.jpg",), ("seed",), WORLD)


@pytest.mark.parametrize(
    ("forward", "up", "nadir_deg", "gimbal_deg"),
    [  # world axes east, north, up; Pix4D's examples beside what a gimbal says
        ((0, 0, -1), (0, 1, 0), (0, 0, 0), (0, -90, 0)),
        ((0, 0, -1), (1, 0, 0), (90, 0, 0), (90, -90, 0)),
        ((0, 0, -1), (-1, 0, 0), (270, 0, 0), (270, -90, 0)),
        ((0, 0.6, -0.8), (0, 0.8, 0.6), (0, np.degrees(np.arcsin(0.6)), 0), (0, None, 0)),
    ],
)
def test_angles_follow_the_documented_examples(
    forward: tuple[float, ...],
    up: tuple[float, ...],
    nadir_deg: tuple[float, ...],
    gimbal_deg: tuple[float | None, ...],
) -> None:
    tags = tags_of(looking(forward, up))
    expected = [np.degrees(-np.arcsin(0.8)) if a is None else a for a in gimbal_deg]

    np.testing.assert_allclose(np.degrees(tags.nadir_ypr_rad[0]), nadir_deg, atol=1e-9)
    np.testing.assert_allclose(np.degrees(tags.gimbal_ypr_rad[0]), expected, atol=1e-9)


def test_both_conventions_mean_one_rotation() -> None:
    rotation = Rotation.random(random_state=4).as_matrix()
    tags = tags_of(rotation)
    ned = Rotation.from_euler("ZYX", tags.gimbal_ypr_rad[0]).as_matrix()
    body = Rotation.from_euler("ZYX", tags.nadir_ypr_rad[0]).as_matrix()

    enu_from_ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(enu_from_ned @ ned[:, 0], rotation[:, 2], atol=1e-12)
    np.testing.assert_allclose(enu_from_ned @ body[:, 2], rotation[:, 2], atol=1e-12)
    np.testing.assert_allclose(enu_from_ned @ body[:, 0], -rotation[:, 1], atol=1e-12)


def test_accuracies_are_the_larger_horizontal_axis_and_the_height() -> None:
    covariance = np.eye(6)
    covariance[:2, :2] = [[5.0, 4.0], [4.0, 5.0]]  # axes 3 and 1
    covariance[2, 2] = 4.0
    tags = tags_of(np.eye(3), covariance)

    assert tags.sigma_horizontal_m[0] == pytest.approx(3.0)
    assert tags.sigma_vertical_m[0] == pytest.approx(2.0)


def test_the_place_is_that_of_the_projection_centre_in_the_worlds_datum() -> None:
    tags = tags_of(np.eye(3))
    latitude, longitude, height = geodetic_from_enu(
        np.array([[10.0, 20.0, 50.0]]), (-33.7, 151.3, 2.0)
    )

    assert (tags.latitude_deg[0], tags.longitude_deg[0]) == (latitude[0], longitude[0])
    assert tags.height_m[0] == height[0]
    assert tags.datum == "msl"


def test_a_survey_without_place_has_nothing_to_hand_over() -> None:
    nowhere = World(origin=None, height_datum="msl", gauge="plane")
    poses = Poses(
        frame_id=("a",),
        center_world_m=np.zeros((1, 3)),
        world_from_camera=np.eye(3)[None],
        covariance=np.eye(6)[None],
    )

    with pytest.raises(GeometryError, match="nothing ties this survey to the earth"):
        geotag(poses, ("a",), ("refined",), nowhere)
