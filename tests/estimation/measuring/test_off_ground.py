"""What is measured from points off the ground: derivatives, truth, sampling, second order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import NO_TIMES, Scene, make_scene
from scipy.stats import chi2

from uavgram.estimation.measuring.error_budget import (
    ASSUMED_RELIEF_M,
    compute_height_derivatives,
    compute_shifts,
)
from uavgram.estimation.measuring.propagation import MeasuredValues, compute_values, propagate
from uavgram.estimation.measuring.second_order import compute_curvature
from uavgram.estimation.survey.adjustment import Adjustment, compute_heights
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Relief, Survey
from uavgram.stages.measure import compute_profiles, sample_observations
from uavgram.stages.refine import refine

HEIGHTS = {0: 1.5, 4: 0.6, 7: 2.5, 8: 1.1}
ROUGH_M = 0.05


def ask(kind: MeasurementKind, points: str, **parameters: float) -> MeasurementRequest:
    """Points by their numbers."""
    return MeasurementRequest(
        name=f"{kind} {points}",
        kind=kind,
        points=tuple(f"P{k}" for k in points.split()),
        parameters=tuple(parameters.items()),
    )


REQUESTS = (
    ask("height", "0"),
    ask("height", "4"),
    ask("height", "1 7"),
    ask("vertical_distance", "7 0"),
    ask("horizontal_distance", "0 7"),
    ask("slope", "2 7"),
    ask("plane_distance", "0 1 2 3"),
    ask("plane_distance", "1 0 4 7"),
    ask("volume", "0 4 8"),
    ask("volume", "0 1 8"),
    ask("volume", "0 4 8", level=-1.0),
    ask("volume", "0 4 8 1 2 3", plane=1.0),
    ask("profile", "0 1 4"),
    ask("distance", "0 1"),
    ask("area", "0 4 8"),
    ask("angle", "1 0 2"),
)


def scene_of(seed: int, *, rough: bool = False, noise: float = 1.0) -> Scene:
    """Points 0 and 7 free, 8 stated with a sigma, 4 free too, all others on the ground."""
    roughness = ROUGH_M if rough else 0.0
    scene = make_scene(seed, heights=HEIGHTS, roughness=roughness, noise=noise)
    above = scene.survey.height_above_m
    stated = with_third_coordinates(scene, free=(0, 4, 7), stated={8: 0.2})
    truth = stated.truth.point.copy()
    if noise:
        error = 0.2 * np.random.default_rng(seed).standard_normal()
        told = stated.survey.height_above_m.copy()
        told[8] -= error
        truth[8, 2] += error
        survey = replace(stated.survey, height_above_m=told)
        return replace(stated, survey=survey, truth=replace(stated.truth, point=truth))
    assert (above[[1, 2, 3]] == 0).all()
    return stated


def adjusted(survey: Survey) -> Adjustment:
    return refine(survey, SolveOptions(noise="stated"))[0].adjustment


def measured(adjustment: Adjustment) -> MeasuredValues:
    return propagate(adjustment, REQUESTS, NO_TIMES)


@pytest.mark.parametrize("rough", [False, True])
def test_gradients_by_the_unknowns_equal_central_differences(*, rough: bool) -> None:
    survey = scene_of(3, rough=rough).survey
    knots = np.array([[-5.0, 0], [4, 6]])
    relief = Relief(kind="correlated", sigma_m=0.2, scale_m=8.0, knots_m=knots)
    survey = replace(survey, grounds=(replace(survey.ground, relief=relief),))
    adjustment = adjusted(survey)
    found = measured(adjustment)
    assert found.why_not == ()
    layout, rng = adjustment.problem.layout, np.random.default_rng(1)
    for _ in range(6):
        step = rng.normal(size=layout.size) * 1e-5
        ends = [
            compute_values(
                adjustment.problem,
                apply_increment(layout, adjustment.state, sign * step),
                REQUESTS,
                NO_TIMES,
            )
            for sign in (1, -1)
        ]
        numeric = (ends[0] - ends[1]) / 2.0
        np.testing.assert_allclose(found.gradient.T @ step, numeric, rtol=1e-5, atol=1e-9)


def truth_of(scene: Scene) -> Floats:
    """Values of the requests by formulas of their own: the ground is a plane, and rough."""
    p, h = scene.world, dict(HEIGHTS)
    base = p - np.array([[0, 0, h.get(k, 0.0)] for k in range(len(p))])

    def plane(at: int, *three: int) -> float:
        a, b, c = p[list(three)]
        normal = np.cross(b - a, c - a)
        return float((p[at] - a) @ normal / np.linalg.norm(normal))

    def prism(*corners: int, below: Floats) -> float:
        a, b, c = p[list(corners), :2]
        area = 0.5 * abs(np.linalg.det([b - a, c - a]))
        return float(area * (p[list(corners), 2] - below).mean())

    along = p[7] - p[2]
    coefficients = np.linalg.solve(np.column_stack([p[1:4, :2], np.ones(3)]), p[1:4, 2])
    corners = [0, 4, 8]
    over = np.column_stack([p[corners, :2], np.ones(3)]) @ coefficients
    legs = p[0] - p[1], p[2] - p[0]
    cosine = -legs[0] @ legs[1] / np.linalg.norm(legs[0]) / np.linalg.norm(legs[1])
    area = np.linalg.norm(np.cross(p[4] - p[0], p[8] - p[0])) / 2
    return np.array([
        h[0], h[4], p[7, 2] - p[1, 2], p[0, 2] - p[7, 2],
        np.hypot(*(p[0] - p[7])[:2]), np.degrees(np.arcsin(along[2] / np.linalg.norm(along))),
        plane(0, 1, 2, 3), plane(1, 0, 4, 7),
        prism(0, 4, 8, below=base[corners, 2]), prism(0, 1, 8, below=base[[0, 1, 8], 2]),
        prism(0, 4, 8, below=np.full(3, -1.0)), prism(0, 4, 8, below=over),
        np.hypot(*(p[0] - p[4])[:2]), np.linalg.norm(p[0] - p[1]), area,
        np.degrees(np.arccos(cosine)),
    ])  # fmt: skip


def test_exact_data_give_the_true_values() -> None:
    scene = scene_of(11, noise=0.0)
    found = measured(adjusted(scene.survey))
    truth = truth_of(scene)
    np.testing.assert_allclose(found.value, truth, atol=1e-4)
    assert (found.sigma > 1e-4).all()


def test_values_are_as_uncertain_as_they_say() -> None:
    z = []
    for seed in range(15):
        scene = scene_of(seed, rough=True)
        found = measured(adjusted(scene.survey))
        z.append((found.value - truth_of(scene)) / found.sigma)
    total = np.sum(np.square(z), axis=0)
    np.testing.assert_array_less(total, chi2.ppf(1 - 1e-5, len(z)))
    np.testing.assert_array_less(chi2.ppf(1e-5, len(z)), total)
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.3  # they hang together, and so not by chi2


def test_a_height_is_that_of_the_table_of_points() -> None:
    adjustment = adjusted(scene_of(5, rough=True).survey)
    height, sigma = compute_heights(adjustment)
    found = measured(adjustment)
    np.testing.assert_allclose(found.value[:2], height[[0, 4]])
    np.testing.assert_allclose(found.sigma[:2], sigma[[0, 4]])
    # It holds the ground's roughness, which no photo of the point shows.
    assert (found.sigma[:2] > ROUGH_M).all()


def test_two_heights_from_one_rough_place_share_its_error() -> None:
    adjustment = adjusted(scene_of(5, rough=True).survey)
    requests = (REQUESTS[0], replace(REQUESTS[0], name="again"), ask("volume", "0 4 8"))
    covariance = propagate(adjustment, requests, NO_TIMES).covariance
    assert covariance[0, 1] == pytest.approx(covariance[0, 0])
    assert covariance[0, 2] > 0


def test_sampling_gives_the_sigmas_of_first_and_second_order() -> None:
    adjustment = adjusted(scene_of(5, rough=True).survey)
    found = measured(adjustment)
    sampled, messages = sample_observations(adjustment, REQUESTS, NO_TIMES, 60, 1)
    assert messages == ()
    # Relative standard deviation of a sampled sigma: sqrt(1 / 2n), and up to four of them.
    np.testing.assert_allclose(sampled.sigma, found.sigma, rtol=4 / np.sqrt(2 * 60))
    second = compute_curvature(adjustment, found, NO_TIMES)
    np.testing.assert_allclose(second.sigma, found.sigma, rtol=0.02)


def test_relief_below_a_free_point_moves_its_height_and_not_its_place() -> None:
    adjustment = adjusted(scene_of(11, noise=0.0).survey)
    found = measured(adjustment)
    by_relief = compute_height_derivatives(
        adjustment, found, np.arange(len(adjustment.survey.label))
    )
    np.testing.assert_allclose(by_relief[0, 0], -1.0, atol=1e-6)
    distance, rise = 13, 2
    np.testing.assert_allclose(by_relief[0, distance], 0.0, atol=1e-6)
    assert by_relief[1, rise] != 0  # the other end lies on the ground
    assert compute_shifts(adjustment, found).relief[0] == pytest.approx(ASSUMED_RELIEF_M, rel=1e-6)


WHY = {
    "slope": (ask("slope", "0 1"), "lie one above the other"),
    "level": (ask("horizontal_distance", "0 1"), "lie one above the other"),
    "profile": (ask("profile", "0 2 1"), "give it no direction"),
    "plane": (ask("plane_distance", "7 1 2 3"), "many planes go through them"),
    "volume": (ask("volume", "0 2 1 3"), "crosses itself"),
    "strip": (ask("volume", "1 2 3", level=0.0), "in line, seen from above"),
    "base": (ask("volume", "4 5 6 1 2 3", plane=1.0), "in line, or their plane is upright"),
    "top": (ask("volume", "1 4 6 5", top=1.0, level=0.0), "in sight of all"),
    "on the ground": (ask("height", "5"), "'P5' is a point on it: let its height be found"),
    "stated": (ask("height", "9"), "'P9' is 0.7 m over it, as stated"),
}


@pytest.mark.parametrize(("request_", "why"), WHY.values(), ids=WHY)
def test_what_cannot_be_measured_says_why(request_: MeasurementRequest, why: str) -> None:
    scene = make_scene(3, heights={9: 0.7}, noise=0.0)
    adjustment = adjusted(with_third_coordinates(scene, free=(0,)).survey)
    points = adjustment.state.point
    # A wall's foot and top; a strip of points in line; a square with a corner outside.
    points[[0, 1], :2] = 1.0
    points[[2, 3], :2] = [[2.0, 2.0], [4.0, 4.0]]
    if request_.kind == "volume" and not request_.parameters:
        points[[0, 1, 2, 3], :2] = [[0, 0], [4, 0], [4, 4], [0, 4]]
    found = propagate(adjustment, (request_,), NO_TIMES)
    assert np.isnan(found.value).all()
    assert why in found.why_not[0][1]


def test_without_a_log_nothing_tells_the_height_between_ground_points() -> None:
    scene = make_scene(3, telemetry=False, gauge="plane")
    found = propagate(adjusted(scene.survey), (ask("height", "0 1"),), NO_TIMES)
    assert "up is only known as" in found.why_not[0][1]


def test_a_profile_has_the_sigmas_of_its_measurements() -> None:
    adjustment = adjusted(scene_of(5, rough=True).survey)
    line = ask("profile", "1 0 4 2 7")
    table = compute_profiles(adjustment, (line, ask("profile", "1 99")))
    assert table.label == line.points
    single = propagate(
        adjustment,
        (line, *(ask("vertical_distance", f"1 {k}") for k in "042"), ask("height", "0")),
        NO_TIMES,
    )
    assert table.place_m[-1, 0] == pytest.approx(single.value[0])
    assert table.sigma_m[-1, 0] == pytest.approx(single.sigma[0])
    np.testing.assert_allclose(table.place_m[1:4, 2], single.value[1:4])
    np.testing.assert_allclose(table.sigma_m[1:4, 2], single.sigma[1:4])
    # Height over the first point less that over the ground is the ground's.
    assert table.place_m[1, 2] - table.place_m[1, 3] == pytest.approx(single.value[4])
    less = np.array([0.0, 1, 0, 0, -1])
    assert table.sigma_m[1, 3] == pytest.approx(np.sqrt(less @ single.covariance @ less))
    assert table.place_m[3, 3] == table.place_m[3, 2]  # a point on the ground is the ground
    assert (table.sigma_m[0] == 0).all()
    assert (table.sigma_m[[0, -1], 1] == 0).all()
    assert [(name, rows.tolist()) for name, rows in table.each()] == [(line.name, list(range(5)))]
