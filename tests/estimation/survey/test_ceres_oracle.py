"""The joint solution equals that of Ceres, on a likelihood written anew from its description."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from ceres_known import residuals
from ceres_likelihood import Likelihood
from known_scenes import Placed, with_known
from scenes import make_scene

from uavgram.estimation.solver.normal_equations import NormalEquations
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.known_kinds import KNOWN_KINDS
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.model.arrays import Floats, Ints
from uavgram.model.observations import KnownThing
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

RAISED = {0: 1.4, 2: 0.9, 5: 0.12}
"""Labels off the ground, and by how much."""

ONE_FRAME: dict[str, Any] = {
    "frames": 1, "labels": 8, "lines": 9, "telemetry": False, "gauge": "plane", "spread": 7.0
}  # fmt: skip
FLIGHT: dict[str, Any] = {"frames": 3, "labels": 7, "lines": 4, "control": 3}
GROUND: dict[str, dict[str, Any]] = {
    "one frame, lengths only": ONE_FRAME,
    "flight, lengths and control": FLIGHT,
}


def compared(survey: Survey) -> tuple[Floats, Floats, float]:
    """Differences from Ceres: estimates [sigmas], sigmas and cost, relative."""
    adjustment = refine(survey, SolveOptions())[0].adjustment
    problem, layout = adjustment.problem, adjustment.problem.layout
    state, normal = _to_the_end(adjustment)
    joint = normal.factor().joint(np.arange(layout.size))
    ours = np.sqrt(np.diag(joint))
    interior = slice(layout.first_intrinsic, layout.first_plane)
    basis = problem.intrinsic_basis  # Ceres has pixels, we have sigmas
    ours[interior] = np.sqrt(np.diag(basis @ joint[interior, interior] @ basis.T))
    sigma = {
        "point": ours[: layout.first_frame].reshape(layout.points, -1),
        "frame": ours[layout.first_frame : layout.first_intrinsic].reshape(-1, 6),
        "interior": ours[interior],
        "plane": ours[layout.first_plane : layout.first_telemetry] if layout.plane else np.ones(3),
        "flight": ours[layout.first_telemetry :],
    }
    likelihood = Likelihood(adjustment.survey, state, problem.pivot_m[0], sigma)
    found, theirs, cost = likelihood.solve()
    expected = np.zeros(layout.size)
    expected[interior] = (problem.intrinsics(state) - survey.calibration.parameters) / ours[
        interior
    ]
    known = _in_use(adjustment, likelihood)
    return found - expected[known], theirs - 1.0, cost / normal.cost - 1.0


def _to_the_end(adjustment: Adjustment) -> tuple[State, NormalEquations]:
    """The package's minimum and its normal equations, without the rest of a step not worth taking.

    That is 1e-5 sigmas of all unknowns together (`levenberg_marquardt.CONVERGED`), more than the
    two programs are apart.
    """
    problem, state = adjustment.problem, adjustment.state
    layout = problem.layout
    for _ in range(3):
        blocks = problem.evaluate(state)
        assert blocks is not None
        normal = NormalEquations(list(blocks.values()), layout.size)
        state = advance_state(layout, state, -normal.factor().solve(normal.gradient))
    return state, normal


def _in_use(adjustment: Adjustment, likelihood: Likelihood) -> Ints:
    """The unknowns that Ceres has too: of points on the ground, not the third one."""
    layout = adjustment.problem.layout
    used = np.ones(layout.size, dtype=np.bool_)
    columns = layout.point_columns(np.arange(layout.points))
    for own, block in zip(columns, likelihood.point, strict=True):
        used[own[len(block) :]] = False
    return np.flatnonzero(used)


@pytest.mark.parametrize("options", GROUND.values(), ids=GROUND.keys())
def test_estimates_and_sigmas_equal_those_of_ceres(options: dict[str, Any]) -> None:
    moved, sigma, cost = compared(make_scene(21, **options).survey)

    assert np.abs(moved).max() < 1e-6
    assert np.abs(sigma).max() < 1e-5
    assert abs(cost) < 1e-9


OFF_GROUND: dict[str, tuple[dict[str, Any], dict[int, float]]] = {
    "free, stated with a sigma, stated exactly": (FLIGHT, {0: np.inf, 2: 0.05, 5: 0.0}),
    "free without a log": (
        ONE_FRAME | {"frames": 3, "ends": ((1, 3), (3, 4), (4, 6), (6, 7), (7, 1), (1, 6))},
        dict.fromkeys(RAISED, np.inf),
    ),
}


@pytest.mark.parametrize(("options", "sigma"), OFF_GROUND.values(), ids=OFF_GROUND.keys())
def test_heights_equal_those_of_ceres(options: dict[str, Any], sigma: dict[int, float]) -> None:
    scene = make_scene(21, heights=RAISED, **options)
    moved, sigmas, cost = compared(with_heights(scene.survey, sigma))

    assert np.abs(moved).max() < 1e-6
    assert np.abs(sigmas).max() < 1e-5
    assert abs(cost) < 1e-9


def with_heights(survey: Survey, sigma: dict[int, float]) -> Survey:
    """Each stated a little wrongly, unless it is stated exactly (0) or not at all (infinite)."""
    above, deviation = np.array(survey.height_above_m), np.zeros(len(survey.label))
    for label, own in sigma.items():
        deviation[label] = own
        above[label] += 0.02 * (0 < own < np.inf)
    free = np.isinf(deviation)
    return replace(
        survey,
        height_above_m=np.where(free, 0.0, above),
        height_sigma_m=np.where(free, 0.0, deviation),
        is_free=free,
    )


YARD = np.array(
    [
        *[(-4, -3, 0), (4, -3, 0), (4, 3, 0), (-4, 3, 0), (0, -3, 0)],
        *[(-1, 0, 1.4), (1, 0, 1.4), (1, 2, 1.4), (-1, 2, 1.4), (-1, 0, 0)],
    ]
)
"""A rectangle on the ground, the middle of its first side; a car's roof, and the ground below its
first corner."""

KNOWN: dict[str, tuple[int, ...]] = {
    "distance": (0, 1),
    "polyline": (0, 1, 2),
    "area": (0, 1, 2, 3),
    "angle": (1, 6, 9),
    "line_distance": (4, 5, 6),
    "height": (5,),
    "horizontal_distance": (9, 6),
    "vertical_distance": (9, 8),
    "slope": (1, 6),
    "plane_distance": (9, 5, 6, 7),
    "azimuth": (0, 6),
    "right_angle": (0, 1, 2),
    "collinear": (0, 4, 1),
    "parallel": (5, 6, 8, 7),
    "coplanar": (5, 6, 7, 8),
    "level": (5, 6, 7),
    "vertical": (9, 5),
    "equal_lengths": (0, 1, 3, 2),
}
"""Which of its points are known to be so, or at a value."""


def test_known_things_equal_those_of_ceres() -> None:
    """All kinds at once, each near enough to the truth, and of a sigma that lets it tell."""
    things = []
    for k, (kind, label) in enumerate(KNOWN.items()):
        sigma = 0.3 if KNOWN_KINDS[kind].unit == "deg" else 0.05
        none = 1e-12 if KNOWN_KINDS[kind].has_value else np.nan
        thing = KnownThing(index=k, name=kind, kind=kind, label=label, value=none, sigma=1.0)
        flat = YARD[list(label)] * [1.0, 1.0, 0.0]
        there = residuals(thing, YARD[list(label)], flat, on_ground=False)[0]
        things.append(replace(thing, value=none if np.isnan(none) else there, sigma=sigma))
    scene = make_scene(2, frames=2, labels=len(YARD) + 1, lines=3)
    placed = Placed(world=YARD, value=np.nan, truth=np.zeros(0))
    yard = with_known(scene, "area", placed, 1.0, np.random.default_rng(2), 0.0).survey
    moved, sigmas, cost = compared(replace(yard, known=tuple(things)))

    assert np.abs(moved).max() < 1e-6
    assert np.abs(sigmas).max() < 1e-5
    assert abs(cost) < 1e-9
