"""Pose by points, lines, lengths and a log: derivatives, honest sigmas, the survey's own way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from scipy.stats import chi2

from uavgram.estimation.first_poses.pose_problem import (
    FeatureRows,
    intersect_ground_picks,
    intersect_ground_rays,
)
from uavgram.estimation.solver.batched import minimise_each
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.observed import Observations
from uavgram.model.options import GroundOptions, SolveOptions
from uavgram.model.survey.known import NO_KNOWN
from uavgram.model.survey.observations import KnownLines, KnownWorldPoints, Picks
from uavgram.pipeline.measure.compute import adjust_survey
from uavgram.stages.assemble import assemble
from uavgram.synthetic.study.method_scenes import MethodScenes, Setting, draw_scenes
from uavgram.synthetic.study.methods import find_minima, find_point_starts

USES: dict[str, dict[str, bool]] = {
    "points": {"start_place": True},
    "lines": {"start_on_line": True, "end_on_line": True},
    "lengths": {"length": True},
    "all": {"start_place": True, "end_on_line": True, "length": True},
}
LOGGED = ("lengths", "all")


@pytest.fixture(scope="module")
def scenes() -> MethodScenes:
    return draw_scenes(Setting(name="usual"), 6, 150, 5)


def rows_of(scenes: MethodScenes, name: str) -> FeatureRows:
    logged = scenes.logged if name in LOGGED else None
    return replace(scenes.rows, logged=logged, **USES[name])  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [*USES, "held"])
def test_the_reduced_slope_is_that_of_the_sum_of_squares(name: str) -> None:
    """Along the way that the points go with the pose, which is what eliminating them means."""
    few = draw_scenes(Setting(name="usual"), 4, 2, 9)
    which = np.arange(2)
    rows = rows_of(few, "lengths" if name == "held" else name)
    if name == "held":
        rows = replace(rows, logged=None, held=(few.center + 0.2, few.rotation))
    point, good = intersect_ground_picks(rows, few.center, few.rotation)
    assert good.all()
    state = few.center + 0.1, few.rotation, point + 0.05
    linear = rows.linearise(which, state)
    with_pose = linear._replace(rest=(linear.rest[0] * 0.0, linear.rest[1]))

    def half_cost(step: np.ndarray) -> np.ndarray:
        moved = rows.move(state, with_pose, np.broadcast_to(step, (2, 6)))
        return 0.5 * rows.linearise(which, moved).cost

    numeric = central_differences(half_cost, np.zeros(6), 1e-6)
    assert_derivative(linear.gradient[:, None], numeric[:, None], 1e-4)


@pytest.mark.parametrize("name", USES)
def test_sums_of_squares_and_poses_are_as_stated(scenes: MethodScenes, name: str) -> None:
    rows = rows_of(scenes, name)
    ends = find_minima(rows, (scenes.center[:, None], scenes.rotation[:, None]))
    count, degrees = len(scenes.center), rows.degrees

    assert ends.converged.all()
    total = float(ends.cost.sum())
    assert chi2.ppf(5e-4, count * degrees) <= total <= chi2.ppf(1 - 5e-4, count * degrees)
    off = (ends.state[0][:, 0] - scenes.center)[:, :, None]
    covariance = np.linalg.inv(ends.normal[:, 0])[:, :3, :3]
    squares = float(np.sum(off.swapaxes(1, 2) @ np.linalg.solve(covariance, off)))
    assert chi2.ppf(5e-4, 3 * count) <= squares <= chi2.ppf(1 - 5e-4, 3 * count)


def test_pixels_meet_the_ground_with_right_derivatives(scenes: MethodScenes) -> None:
    lens, pixel = scenes.rows.calibration, scenes.rows.pixel_px[:4, :2]
    center, rotation = scenes.center[:4], scenes.rotation[:4]
    _, _, by_pixel = intersect_ground_rays(lens, pixel, center, rotation)

    def moved(shift: np.ndarray) -> np.ndarray:
        return intersect_ground_rays(lens, pixel + shift, center, rotation)[0]

    assert_derivative(by_pixel, central_differences(moved, np.zeros(2), 1e-3), 1e-5)


def surveyed(scenes: MethodScenes, k: int) -> Refined:
    """One scene the survey's own way: starts as control points, lengths taped."""
    rows, lines = scenes.rows, scenes.rows.pixel_px.shape[1]
    names = [f"{end}{i}" for i in range(lines) for end in "ab"]
    count = len(names)
    place = np.column_stack([rows.place_m[k, :, 0], np.zeros(lines)])
    sigma = np.column_stack([np.full((lines, 2), rows.place_sigma_m), np.full(lines, 1e3)])
    observed = Observations(
        calibration=rows.calibration,
        picks=Picks(
            image=("photo",) * count,
            label=tuple(names),
            pixel_px=rows.pixel_px[k].reshape(-1, 2),
            sigma_px=np.full(count, rows.pick_sigma_px),
            height_m=np.full(count, np.nan),
        ),
        lines=KnownLines(
            name=tuple(f"l{i}" for i in range(lines)),
            start=tuple(names[::2]),
            end=tuple(names[1::2]),
            length_m=rows.length_m[k],
            sigma_m=np.full(lines, rows.length_sigma_m),
            adjust=np.ones(lines, dtype=np.bool_),
        ),
        known=NO_KNOWN,
        control=KnownWorldPoints(label=tuple(names[::2]), world_m=place, sigma_m=sigma),
        ground=GroundOptions(height_sigma_m=1e-6, slope_sigma_deg=1e-6, roughness_sigma_m=0.0),
        picks_sigma_px=1.0,
        photos=("photo",),
    )
    observed = replace(observed, tape=replace(observed.tape, scale_sigma=0.0))
    survey = assemble(observed).survey
    refined, _ = adjust_survey(survey, SolveOptions(noise="stated"))
    return refined


def test_it_is_the_surveys_own_pose(scenes: MethodScenes) -> None:
    """To 1e-3 of a sigma, the survey's ground being known to a micrometre."""
    rows = replace(scenes.rows, start_place=True, length=True)
    ends = find_minima(rows, find_point_starts(scenes))
    for k in range(3):
        state = surveyed(scenes, k).adjustment.state
        sigma = np.sqrt(np.diag(np.linalg.inv(ends.normal[k, 0])))
        assert np.abs((state.center[0] - ends.state[0][k, 0]) / sigma[:3]).max() < 1e-3


def test_a_start_below_the_ground_is_no_pose(scenes: MethodScenes) -> None:
    rows = rows_of(scenes, "points")
    point, _ = intersect_ground_picks(rows, scenes.center, scenes.rotation)
    ends = minimise_each(rows, (scenes.center * [1, 1, -1], scenes.rotation.copy(), point))

    assert np.isinf(ends.cost).all()
    assert not ends.converged.any()
