"""What known things miss on planes, against world coordinates and differences."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from lanes import lane

from uavgram.estimation.first_poses.plane_search import (
    PlaneThing,
    compute_rows,
    count_rows,
    fit_heights,
)
from uavgram.geometry.ground import conditions, measurements
from uavgram.model.arrays import Floats

NONE = np.zeros(6)
THINGS = {
    "distance": (4, 1),
    "horizontal_distance": (0, 5),
    "polyline": (0, 4, 2),
    "line_distance": (4, 0, 1),
    "area": (0, 1, 4, 5),
    "angle": (0, 4, 5),
    "right_angle": (0, 1, 4),
    "parallel": (0, 1, 4, 5),
    "equal_lengths": (0, 1, 4, 5, 2, 4),
}


def seen(seed: int) -> tuple[Floats, Floats, Floats]:
    """World points (6, 3) of a scene, their rays (6, 3), and the plane m (3,)."""
    scene = lane(seed)
    camera = (scene.world - scene.center) @ scene.rotation
    return scene.world, camera / camera[:, 2:], -scene.rotation[2] / scene.center[2]


def by_world(kind: str, points: Floats) -> Floats:
    """The same of points in the world."""
    if kind in {"right_angle", "equal_lengths"}:
        return np.asarray(getattr(conditions, kind)(points).value)
    if kind == "parallel":
        return np.abs(conditions.parallel(points, on_ground=True).value)
    name = "distance" if kind == "horizontal_distance" else kind
    value = getattr(measurements, name)(points)[0]
    return np.array([np.degrees(value) if kind == "angle" else value])


@pytest.mark.parametrize("kind", THINGS)
def test_on_the_true_plane_they_are_as_in_the_world(kind: str) -> None:
    for seed in range(5):
        world, ray, plane = seen(seed)
        thing = PlaneThing(kind, THINGS[kind], 0.0, 1.0)
        found = compute_rows(plane[None], ray, NONE, (thing,)).value[0]
        if kind == "parallel":  # which way round depends on the axes within the plane
            found = np.abs(found)
        np.testing.assert_allclose(found, by_world(kind, world[list(THINGS[kind])]), rtol=1e-9)
        assert len(found) == count_rows(kind, len(THINGS[kind]))


@pytest.mark.parametrize("kind", THINGS)
def test_derivatives_by_the_plane_equal_differences(kind: str) -> None:
    thing = PlaneThing(kind, THINGS[kind], 3.0, 1.0)
    for seed in range(5):
        _, ray, plane = seen(seed)
        scale = np.linalg.norm(plane)

        def value(change: Floats, ray: Floats = ray, plane: Floats = plane) -> Floats:
            shifted = (plane + change * np.linalg.norm(plane))[None]
            return np.asarray(compute_rows(shifted, ray, NONE, (thing,)).value[0])

        found = compute_rows(plane[None], ray, NONE, (thing,)).by_plane[0] * scale
        assert_derivative(found, central_differences(value, np.zeros(3)), 1e-6)


@pytest.mark.parametrize("kind", THINGS)
def test_sigmas_hold_the_picks_as_they_work_on_that_plane(kind: str) -> None:
    thing = PlaneThing(kind, THINGS[kind], 3.0, 0.02)
    if kind == "equal_lengths":  # its fifth point is its third again: two picks here
        thing = thing._replace(pick=(0, 1, 4, 5, 2, 3))
    _, ray, plane = seen(7)
    sigma = np.array([1.0, 2, 3, 4, 5, 6]) * 1e-4

    def value(change: Floats) -> Floats:
        moved = ray.copy()
        moved[:, :2] += change.reshape(6, 2)
        return np.asarray(compute_rows(plane[None], moved, NONE, (thing,)).value[0])

    jacobian = central_differences(value, np.zeros(12), 1e-6)
    wanted = np.sqrt(0.02**2 + jacobian**2 @ np.repeat(sigma, 2) ** 2)
    found = compute_rows(plane[None], ray, sigma, (thing,)).sigma[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_what_holds_on_every_plane_alike_has_no_rows() -> None:
    for kind in ("collinear", "level", "vertical", "coplanar"):
        assert count_rows(kind, 4) == 0
    # Three points in line, seen from anywhere: in line on every plane.
    _, ray, _ = seen(1)
    ray[2] = 0.4 * ray[0] + 0.6 * ray[1]
    for plane in np.array([[0.0, 0, 0.03], [0.01, 0.005, 0.02], [-0.004, 0.008, 0.05]]):
        place = ray[:3] / (ray[:3] @ plane)[:, None]
        offset = conditions.line_offset(place[[2, 0, 1]]).value
        np.testing.assert_allclose(offset, 0.0, atol=1e-12)


def test_a_point_behind_the_camera_is_nowhere() -> None:
    _, ray, plane = seen(2)
    thing = PlaneThing("distance", (0, 1), 3.0, 1.0)
    assert np.isnan(compute_rows(-plane[None], ray, NONE, (thing,)).value).all()


@pytest.mark.parametrize("kinds", [("distance",), ("area",), ("line_distance", "area", "angle")])
def test_over_the_true_normal_the_height_is_the_true_one(kinds: tuple[str, ...]) -> None:
    world, ray, plane = seen(3)
    things = tuple(
        PlaneThing(k, THINGS[k], by_world(k, world[list(THINGS[k])])[0], 0.01) for k in kinds
    )
    normal = (plane / np.linalg.norm(plane))[None]
    height = fit_heights(normal, ray, np.full(6, 1e-4), things)
    np.testing.assert_allclose(height, 1.0 / np.linalg.norm(plane))
