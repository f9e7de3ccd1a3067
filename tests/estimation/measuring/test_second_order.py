"""Second-order terms against sampling, where first order is enough and where not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import make_scene

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.measuring.second_order import compute_second_order_terms, make_moves
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.measure import (
    check_second_order,
    describe_approximation,
    measurement_results,
    sample_observations,
)
from uavgram.stages.refine import refine

ALONE: dict[str, Any] = {"frames": 1, "telemetry": False, "gauge": "plane"}
PAIRS = ((0, 6), (1, 7), (2, 8), (3, 9), (4, 10), (5, 11))


def frames_of(survey: Survey) -> Frames:
    n = len(survey.frame_id)
    return Frames(
        frame_id=survey.frame_id, time_utc_s=np.arange(n, dtype=float) * 2.0,
        sigma_time_s=np.full(n, 0.4), matched=np.ones(n, dtype=bool), reason=("",) * n,
        clock_offset_s=0.0, clock_offset_sigma_s=1.0,
    )  # fmt: skip


def compared(
    survey: Survey, requests: tuple[MeasurementRequest, ...], count: int = 0
) -> SimpleNamespace:
    adjustment = refine(survey, SolveOptions())[0].adjustment
    frames = frames_of(survey)
    measured = propagate(adjustment, requests, frames)
    first, _ = measurement_results(measured)
    second, messages = check_second_order(adjustment, measured, first, frames)
    drawn = sample_observations(adjustment, requests, frames, count, 1)[0] if count else None
    return SimpleNamespace(first=first, second=second, messages=messages, sampled=drawn)


def distance(*points: str) -> MeasurementRequest:
    return MeasurementRequest(name="-".join(points), kind="distance", points=points)


@pytest.mark.parametrize("options", [{}, {**ALONE, "ends": PAIRS, "tilt": 0.4}])
def test_where_first_order_holds_nothing_is_said(
    options: dict[str, Any],
) -> None:
    survey = make_scene(3, **options).survey
    area = MeasurementRequest(name="a", kind="area", points=("P0", "P1", "P2"))
    found = compared(survey, (distance("P0", "P1"), area))
    assert not found.second.off.any()
    assert found.messages == ()
    np.testing.assert_allclose(found.second.sigma, found.first.sigma, rtol=0.02)
    assert (np.abs(found.second.curvature) < 0.05).all()


@pytest.mark.parametrize("bias_m", [2.0, 400.0, 5e3])
def test_an_error_that_all_points_share_says_nothing_of_what_parts_them(bias_m: float) -> None:
    survey = make_scene(3).survey
    assert survey.telemetry is not None
    telemetry = replace(survey.telemetry, position_bias_sigma_m=np.full(3, bias_m))
    area = MeasurementRequest(name="a", kind="area", points=("P0", "P1", "P2"))
    found = compared(replace(survey, telemetry=telemetry), (distance("P0", "P1"), area))
    assert not found.second.off.any()
    np.testing.assert_allclose(found.second.sigma, found.first.sigma, rtol=0.02)


def test_heights_over_the_ground_are_as_uncertain_as_to_first_order() -> None:
    """What points depart from the ground moves them hardly more than the ground itself does."""
    scene = make_scene(3, heights={0: 1.5, 3: 2.0, 4: -0.5}, control=2)
    survey = with_third_coordinates(scene, free=(0, 7), stated={3: 0.1}).survey
    heights = [MeasurementRequest(name=p, kind="height", points=(p,)) for p in ("P0", "P3", "P7")]
    found = compared(survey, tuple(heights))
    np.testing.assert_allclose(found.second.sigma, found.first.sigma, rtol=0.05)


def test_two_points_that_nearly_coincide_are_further_apart_than_first_order_says() -> None:
    # Their distance of two sigmas is never negative, and errors across it make it longer.
    scene = make_scene(3, ends=PAIRS, tilt=0.4, **ALONE)
    survey = scene.survey
    pixel = np.array(survey.pixel_px)
    pixel[1] = pixel[0] + [0.6, 0.0]
    changed = scene_with(survey, pixel, keep=(2, 3, 4, 5))
    found = compared(changed, (distance("P0", "P1"),), 300)
    assert found.second.off[0]
    assert "'P0-P1'" in found.messages[0].text
    bias = found.sampled.mean - found.first.value
    assert found.second.bias[0] == pytest.approx(bias[0], rel=0.35)
    assert found.second.bias[0] > 0.2 * found.first.sigma[0]


def test_a_sigma_that_is_as_good_is_not_called_more_realistic() -> None:
    assert describe_approximation(0.0181, 0.0184, 0.011, "m") == (
        "the value tends to be 0.011 m too large"
    )
    assert "there is no solution" in describe_approximation(0.2, np.nan, np.nan, "m")
    assert describe_approximation(0.2, 0.3, -0.1, "m") == (
        "± 0.3 m is more realistic than ± 0.2 m, and the value tends to be 0.1 m too small"
    )


@pytest.mark.parametrize(
    ("sigma", "bias", "count"), [(1.09, 0.49, 0), (0.91, -0.49, 0), (1.11, 0.0, 1), (1.0, -0.51, 1)]
)
def test_differences_that_matter_to_nobody_are_not_reported(
    sigma: float, bias: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = make_scene(3, ends=PAIRS, tilt=0.4, **ALONE)
    found = compared(scene.survey, (distance("P0", "P1"),), 2)
    first = found.first.sigma
    terms = SimpleNamespace(sigma=sigma * first, bias=bias * first, curvature=0.0 * first)
    monkeypatch.setattr("uavgram.stages.measure.compute_curvature", lambda *_: terms)

    again = compared(scene.survey, (distance("P0", "P1"),), 2)

    assert again.second.off.sum() == len(again.messages) == count


def scene_with(survey: Survey, pixel: Floats, keep: tuple[int, ...]) -> Survey:
    lines = {
        name: getattr(survey, name)[list(keep)]
        for name in ("line_start", "line_end", "length_m", "length_sigma_m")
    }
    return replace(survey, pixel_px=pixel, **lines)


def test_near_the_horizon_second_order_follows_the_sampled_sigma() -> None:
    scene = make_scene(3, ends=PAIRS, tilt=0.4, **ALONE)
    survey = scene.survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    # A pick that looks along a ray only a few of its sigmas below the horizon.
    rotation = adjustment.state.rotation[0]
    fx, fy, cx, cy = adjustment.problem.intrinsics(adjustment.state)[:4]
    down = np.deg2rad(0.5)
    ray = rotation.T @ np.array([0.0, np.cos(down), -np.sin(down)])
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    assert ray[2] > 0
    far, _ = cv2.projectPoints(ray[None] / ray[2], np.zeros(3), np.zeros(3), matrix, np.zeros(5))
    pixel = np.array(survey.pixel_px)
    pixel[0] = far[0, 0]
    calibration = replace(
        survey.calibration,
        parameters=np.array([*survey.calibration.parameters[:4], 0, 0, 0, 0, 0]),
        covariance=np.zeros((9, 9)),
    )
    changed = replace(scene_with(survey, pixel, keep=(1, 2, 3, 4, 5)), calibration=calibration)
    found = compared(changed, (distance("P0", "P1"), distance("P2", "P3")), 100)
    assert found.second.off.tolist() == [True, False]
    ratio = found.sampled.sigma / found.first.sigma
    assert not 0.8 < ratio[0] < 1.25
    assert 0.8 < ratio[1] < 1.25


def test_a_time_that_is_short_for_its_sigma_makes_a_speed_doubtful() -> None:
    survey = make_scene(4, frames=2, labels=8).survey
    one = int(np.flatnonzero(survey.pick_frame == 0)[0])
    other = int(np.flatnonzero(survey.pick_frame == 1)[-1])
    names = [survey.label[survey.pick_label[k]] for k in (one, other)]
    keep = ~np.isin(survey.pick_label, survey.pick_label[[one, other]])
    keep[[one, other]] = True
    survey = replace(
        survey,
        pick_frame=survey.pick_frame[keep],
        pick_label=survey.pick_label[keep],
        pixel_px=survey.pixel_px[keep],
        pick_sigma_px=survey.pick_sigma_px[keep],
    )
    request = MeasurementRequest(name="v", kind="speed", points=tuple(names))
    found = compared(survey, (request,))
    assert found.second.off[0]
    assert found.second.bias[0] > 0


# Second-order terms of quadratic functions of normal errors: by the law, and by draws.


def test_moments_of_quadratic_forms() -> None:
    """Mean and variance of g e + e H e / 2: as they are known, and as draws have them."""
    rng = np.random.default_rng(19)
    slope, root = rng.standard_normal((3, 5)), rng.standard_normal((3, 5, 5))
    bent = root + np.swapaxes(root, 1, 2)

    def values(error: np.ndarray) -> np.ndarray:
        flat = 7.0 + error @ slope.T
        return np.asarray(flat + 0.5 * np.einsum("si,mij,sj->sm", error, bent, error))

    directions = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    found = compute_second_order_terms(values(make_moves(directions)), np.full(3, 7.0))
    assert found.bias == pytest.approx(0.5 * np.trace(bent, axis1=1, axis2=2))
    assert found.variance == pytest.approx(0.5 * np.sum(bent**2, axis=(1, 2)))
    drawn = values(rng.standard_normal((200_000, 5)))
    whole = np.sum(slope**2, axis=1) + found.variance
    assert drawn.mean(axis=0) - 7.0 == pytest.approx(found.bias, abs=5e-3 * np.sqrt(whole.max()))
    assert drawn.var(axis=0) == pytest.approx(whole, rel=0.02)


def test_without_a_solution_there_is_no_term() -> None:
    values = np.zeros((6, 2))
    values[3, 1] = np.nan
    found = compute_second_order_terms(values, np.zeros(2))
    assert np.isnan(found.variance).tolist() == [False, True]
