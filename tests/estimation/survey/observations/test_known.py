"""Known things as observations: derivatives at zero and away from it, in every unit and place."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.known_kinds import KNOWN_KINDS
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.known import KnownRows, compute_known_rows
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import State, apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.observations import ON_LINE, KnownThing, LinePosition, do_lines_fix_plan

# Corners of a square of 4 m and a fifth point in line with two of them; then the same 1.5 m up.
SQUARE = np.array([[-2.0, 0], [2, 0], [2, 4], [-2, 4], [6, 0]])
GRID = np.concatenate([SQUARE, SQUARE, [[0.0, 1.0], [1.0, -3.0]]])
FREE = np.isin(np.arange(12), range(5, 10))

EXACT: dict[str, tuple[str, tuple[int, ...], float]] = {
    "distance": ("distance", (0, 6), 4.2720018726587655),
    "polyline": ("polyline", (0, 1, 2, 3), 12.0),
    "area": ("area", (0, 1, 2, 3), 16.0),
    "angle": ("angle", (0, 1, 2), 90.0),
    "from a line": ("line_distance", (2, 0, 1), 4.0),
    "on a line": ("line_distance", (1, 0, 4), 0.0),
    "on a line in the air": ("line_distance", (6, 5, 9), 0.0),
    "height over the ground": ("height", (6,), 1.5),
    "height over another point": ("height", (0, 6), 1.5),
    "level distance": ("horizontal_distance", (0, 6), 4.0),
    "up": ("vertical_distance", (0, 6), 1.5),
    "level": ("vertical_distance", (5, 6), 0.0),
    "slope": ("slope", (0, 6), 20.556045219583467),
    "level slope": ("slope", (5, 6), 0.0),
    "from a plane": ("plane_distance", (6, 0, 1, 2), 1.5),
    "in a plane": ("plane_distance", (9, 5, 6, 7), 0.0),
    "box over the ground": ("volume", (5, 6, 7, 8), 24.0),
    "azimuth": ("azimuth", (0, 6), 90.0),
    "azimuth of north": ("azimuth", (0, 3), 0.0),
    "right angle": ("right_angle", (0, 1, 2), np.nan),
    "right angle in the air": ("right_angle", (1, 0, 5), np.nan),
    "collinear": ("collinear", (0, 1, 4), np.nan),
    "collinear in the air": ("collinear", (5, 6, 9), np.nan),
    "parallel": ("parallel", (0, 1, 3, 2), np.nan),
    "parallel walls": ("parallel", (0, 5, 1, 6), np.nan),
    "coplanar": ("coplanar", (0, 1, 6, 5, 9), np.nan),
    "level line": ("level", (5, 6, 7), np.nan),
    "vertical": ("vertical", (1, 6), np.nan),
    "equal lengths": ("equal_lengths", (0, 1, 1, 2, 5, 6), np.nan),
}


def exact_scene() -> Scene:
    """A scene of the square and its roof, with all that is known of them met exactly."""
    scene = make_scene(3, noise=0.0, roughness=0.05)
    things = tuple(
        KnownThing(index=i, name=name, kind=kind, label=label, value=value, sigma=0.01 * (i + 1))
        for i, (name, (kind, label, value)) in enumerate(EXACT.items())
    )
    point = np.column_stack([GRID, 1.5 * FREE])
    survey = replace(scene.survey, known=things, is_free=FREE)
    return replace(scene, survey=survey, truth=replace(scene.truth, point=point))


def problem_of(scene: Scene) -> SurveyProblem:
    return SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))


def test_what_is_met_exactly_has_no_residual() -> None:
    scene = exact_scene()
    rows = compute_known_rows(problem_of(scene), scene.truth, scene.survey.known)

    assert set(rows.thing.tolist()) == set(range(len(EXACT)))
    assert np.abs(rows.value).max() < 1e-12


@pytest.mark.parametrize("away_m", [0.0, 0.03])
def test_derivatives_are_central_differences_at_zero_too(away_m: float) -> None:
    scene = exact_scene()
    problem = problem_of(scene)
    layout = problem.layout
    state = apply_increment(
        layout, scene.truth, away_m * np.random.default_rng(1).normal(size=layout.size)
    )
    found = compute_known_rows(problem, state, scene.survey.known)
    analytic = np.zeros((len(found.value), layout.size))
    np.add.at(analytic, (np.arange(len(analytic))[:, None], found.columns), found.gradient)

    numeric = np.stack([slope(problem, state, k) for k in range(layout.size)], axis=1)
    scale = np.abs(numeric).max(axis=1, keepdims=True)
    assert scale.min() > 0.1  # every row says something
    assert np.abs(analytic - numeric).max(axis=1) == pytest.approx(0.0, abs=1e-6 * scale.max())


def slope(problem: SurveyProblem, state: State, column: int) -> Floats:
    """Central difference of all rows by one unknown."""
    step = np.zeros(problem.layout.size)
    step[column] = 1e-6
    ahead, behind = (
        compute_known_rows(
            problem, apply_increment(problem.layout, state, way * step), problem.survey.known
        ).value
        for way in (1, -1)
    )
    return np.asarray((ahead - behind) / 2e-6)


def test_rows_say_how_they_change_when_a_point_stands_higher() -> None:
    scene = exact_scene()
    found, raised = 6, np.where(np.arange(len(GRID)) == 6, 1e-6, 0.0)
    ahead, behind = (
        rows_of(replace(scene, survey=replace(scene.survey, height_above_m=way * raised)))
        for way in (1, -1)
    )
    rows = rows_of(scene)
    by_up = np.where(rows.label == found, rows.by_up, 0.0).sum(axis=1)
    from_ground = [i for i, name in enumerate(EXACT) if "over the ground" in name]
    others = ~np.isin(rows.thing, from_ground)

    assert np.abs(by_up).max() > 1.0
    expected = (ahead.value - behind.value) / 2e-6
    np.testing.assert_allclose(by_up[others], expected[others], atol=1e-6)


def rows_of(scene: Scene) -> KnownRows:
    return compute_known_rows(problem_of(scene), scene.truth, scene.survey.known)


def test_on_the_ground_only_what_is_along_it_counts() -> None:
    scene = exact_scene()
    rows = compute_known_rows(problem_of(scene), scene.truth, scene.survey.known)
    count = dict(zip(EXACT, np.bincount(rows.thing).tolist(), strict=True))

    assert [count["on a line"], count["collinear"], count["parallel"]] == [1, 1, 1]
    assert [count["on a line in the air"], count["collinear in the air"]] == [2, 2]
    assert count["parallel walls"] == 2


def test_a_known_thing_is_an_observation_in_its_own_sigmas() -> None:
    scene = exact_scene()
    problem = problem_of(scene)
    layout = problem.layout
    state = apply_increment(
        layout, scene.truth, 0.02 * np.random.default_rng(2).normal(size=layout.size)
    )
    blocks = problem.evaluate(state)
    rows = compute_known_rows(problem, state, scene.survey.known)

    assert blocks is not None
    sigma = np.array([thing.sigma for thing in scene.survey.known])[rows.thing]
    names = np.array([thing.name for thing in scene.survey.known])[rows.thing]
    # The ground below is rough, and only the smooth one is adjusted.
    sigma[names == "height over the ground"] = np.hypot(
        sigma[names == "height over the ground"], 0.05
    )
    simple = names != "box over the ground"
    found = blocks["known"].residual[:, 0] * sigma
    np.testing.assert_allclose(found[simple], rows.value[simple], rtol=1e-12)
    assert {thing.kind for thing in scene.survey.known} == set(KNOWN_KINDS)


@pytest.mark.parametrize(
    ("kind", "label", "where", "says"),
    [
        ("vertical", (0, 1), "rough ground", False),
        ("vertical", (1, 6), "rough ground", True),
        ("coplanar", (0, 1, 2, 3), "rough ground", True),
        ("coplanar", (0, 1, 2, 3), "smooth ground", False),
        ("coplanar", (0, 1, 2, 6), "smooth ground", True),
        ("plane_distance", (0, 1, 2, 3), "smooth ground", False),
        ("level", (0, 1), "smooth ground", True),
        ("level", (0, 1), "gauge", False),
        ("slope", (0, 1), "gauge", False),
        ("collinear", (0, 1, 4), "gauge", True),
        ("height", (0,), "rough ground", False),
        ("height", (6,), "smooth ground", True),
        ("volume", (0, 1, 2, 3), "smooth ground", False),
        ("azimuth", (0, 1), "smooth ground", True),
        ("azimuth", (0, 6), "gauge", False),
    ],
)
def test_what_the_ground_says_anyway_is_no_observation(
    kind: str, label: tuple[int, ...], where: str, *, says: bool
) -> None:
    rough = 0.05 if where == "rough ground" else 0.0
    gauge: Literal["world", "plane"] = "plane" if where == "gauge" else "world"
    scene = make_scene(3, noise=0.0, roughness=rough, gauge=gauge, telemetry=gauge == "world")
    thing = KnownThing(index=0, name="k", kind=kind, label=label, value=0.0, sigma=0.1)
    survey = replace(scene.survey, known=(thing,), is_free=FREE)

    assert [one.name for one in problem_of(replace(scene, survey=survey)).known] == ["k"] * says


# Lines of known position in the likelihood: their rows, what is left of them, and derivatives.


SIGMA = np.array([[0.02, 0.01, 0.03], [0.01, 0.03, 0.02]])


def on_line(label: tuple[int, ...], ends: object, *, has_height: bool = False) -> KnownThing:
    position = LinePosition(
        ends_m=np.array(ends, dtype=np.float64),
        sigma_m=SIGMA,
        straightness_m=0.004,
        has_height=has_height,
    )
    return KnownThing(
        index=0,
        name="kerb",
        kind=ON_LINE,
        label=label,
        value=float("nan"),
        sigma=position.across_m,
        position=position,
    )


def scene_of(*, has_height: bool) -> Scene:
    """Three points exactly on a line, as the truth has it."""
    scene = make_scene(3, noise=0.0)
    point = scene.truth.point.copy()
    point[:3] = [[-4.0, -2.0], [0.0, 0.0], [6.0, 3.0]]
    truth = replace(scene.truth, point=point)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    world, _, _ = problem.world_points(truth, np.arange(3))
    far = world[2] + 0.5 * (world[2] - world[0])
    thing = on_line((0, 1, 2), [world[0], far], has_height=has_height)
    return replace(scene, survey=replace(scene.survey, known=(thing,)), truth=truth)


@pytest.mark.parametrize("has_height", [False, True])
def test_derivatives_are_central_differences(*, has_height: bool) -> None:
    scene = scene_of(has_height=has_height)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    block = compute_known_rows(problem, scene.truth, problem.known).block()
    dense = np.zeros((len(block.residual), layout.size))
    np.add.at(dense, (np.arange(len(dense))[:, None], block.columns), block.jacobian[:, 0])

    assert len(dense) == 3 * (1 + has_height)
    assert np.abs(block.residual).max() < 1e-9
    for column in range(layout.size):
        step = np.zeros(layout.size)
        step[column] = 1e-5
        ahead, behind = (
            compute_known_rows(
                problem, apply_increment(layout, scene.truth, sign * step), problem.known
            ).block()
            for sign in (1.0, -1.0)
        )
        slope = (ahead.residual - behind.residual)[:, 0] / 2e-5
        np.testing.assert_allclose(slope, dense[:, column], atol=2e-6 * np.abs(dense).max())


def test_squares_are_those_of_the_joint_covariance() -> None:
    scene = scene_of(has_height=True)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    moved = apply_increment(
        layout, scene.truth, 0.01 * np.random.default_rng(1).normal(size=layout.size)
    )
    rows = compute_known_rows(problem, moved, problem.known)
    whole = rows.covariance(np.arange(6))

    assert np.abs(whole - np.diag(np.diag(whole))).max() > 1e-5
    squares = float(np.sum(rows.block().residual ** 2))
    assert squares == pytest.approx(float(rows.value @ np.linalg.solve(whole, rows.value)))
    np.testing.assert_allclose(rows.sigma**2, np.diag(whole))


def test_a_line_stays_as_long_as_one_of_its_points() -> None:
    survey = scene_of(has_height=False).survey
    some = select_picks(survey, survey.pick_label != 1).survey
    none = select_picks(survey, survey.pick_label > 2).survey

    assert [thing.label for thing in some.known] == [(0, 1)]
    assert none.known == ()


def test_lines_place_a_survey_with_three_points_on_two_directions() -> None:
    east, also_east = [[0, 0, 0], [9, 0, 0]], [[0, 5, 0], [9, 5.2, 0]]
    north = [[0, 0, 0], [0, 9, 0]]

    assert do_lines_fix_plan([on_line((0, 1), east), on_line((2,), north)])
    assert not do_lines_fix_plan([on_line((0, 1), east), on_line((2, 3), also_east)])
    assert not do_lines_fix_plan([on_line((0,), east), on_line((1,), north)])
