"""Many steps at once lead where each of them leads alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from increments import compute_increment

from uavgram.estimation.survey.unknowns import (
    Layout,
    State,
    advance_state,
    apply_increment,
    select_states,
    stack,
    unstack,
)
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats

FLAT = Layout(
    points=5, point_size=2, frames=4, intrinsics=3, plane=3, relief=2, telemetry=12, tape=1,
    free_gauge=False,
)  # fmt: skip
LAYOUTS = {
    "flat": FLAT,
    "free gauge": replace(FLAT, plane=0, telemetry=0, free_gauge=True),
    "ties": replace(FLAT, point_size=3, ties=4, turning=True, readout=1),
    "one point": replace(FLAT, points=1),
}


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("way", [apply_increment, advance_state])
def test_each_state_is_that_of_its_own_step(
    name: str, way: Callable[[Layout, State, Floats], State]
) -> None:
    layout, rng = LAYOUTS[name], np.random.default_rng(5)
    state = State(
        point=rng.normal(size=(layout.points, layout.point_size)),
        center=9.0 * rng.normal(size=(4, 3)),
        rotation=exp_so3(rng.normal(size=(4, 3))),
        intrinsic=np.zeros(3),
        plane=rng.normal(size=3),
        relief=np.zeros(2),
        telemetry=np.zeros(layout.telemetry),
        tape=np.zeros(1),
        readout=np.zeros(layout.readout),
        tie=rng.normal(size=(layout.ties, layout.point_size)),
        turning=np.zeros((4, 3 if layout.turning else 0)),
    )
    steps = 0.1 * rng.normal(size=(6, layout.size))

    together = list(unstack(way(layout, state, steps)))

    assert len(together) == len(steps)
    for found, step in zip(together, steps, strict=True):
        alone = way(layout, state, step)
        for field in fields(State):
            one, other = getattr(found, field.name), getattr(alone, field.name)
            assert one.shape == other.shape, field.name
            np.testing.assert_allclose(one, other, atol=1e-12, err_msg=field.name)


def test_states_that_stand_together_move_each_by_its_own_step() -> None:
    layout, rng = LAYOUTS["ties"], np.random.default_rng(6)
    begin = [
        State(
            point=rng.normal(size=(5, 3)), center=9.0 * rng.normal(size=(4, 3)),
            rotation=exp_so3(rng.normal(size=(4, 3))), intrinsic=np.zeros(3),
            plane=rng.normal(size=3), relief=np.zeros(2), telemetry=np.zeros(12), tape=np.zeros(1),
            readout=np.zeros(1), tie=rng.normal(size=(4, 3)), turning=np.zeros((4, 3)),
        )
        for _ in range(3)
    ]  # fmt: skip
    steps = 0.1 * rng.normal(size=(3, layout.size))
    ends = advance_state(layout, stack(begin), steps)

    for own, end, step in zip(begin, unstack(ends), steps, strict=True):
        apart = compute_increment(layout, advance_state(layout, own, step), end)
        np.testing.assert_allclose(apart, 0.0, atol=1e-12)
    back = compute_increment(layout, stack(begin), ends)
    for row, own in enumerate(begin):
        np.testing.assert_allclose(
            back[row], compute_increment(layout, own, select_states(ends, row)), atol=1e-12
        )


def test_no_steps_lead_nowhere() -> None:
    layout = LAYOUTS["flat"]
    state = State(
        np.ones((5, 2)) * np.arange(5)[:, None], np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)),
        np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(12), np.zeros(1),
    )  # fmt: skip
    assert not list(unstack(advance_state(layout, state, np.zeros((0, layout.size)))))
