"""Linearised observations of single photos against differences."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from photo_draws import photo_scene

from uavgram.estimation.first_poses.photo_problem import (
    PhotoProblem,
    PhotoRows,
    Photos,
    SharedErrors,
    State,
)
from uavgram.model.arrays import Floats

EASTWARD = np.array([0.8, -0.6])
UNKNOWNS = 6 + 2 + 3 + 1


@pytest.fixture(scope="module")
def problem() -> PhotoProblem:
    """One photo with lengths, two coordinates, and errors of camera, ground and tape."""
    scene = photo_scene(1, slope=True, joined=True)
    root = np.zeros((9, 2))
    root[:2, 0], root[4, 1] = 20.0, 0.01
    shared = SharedErrors(scene.shared.calibration, root, np.diag([0.3, 0.05, 0.05]), 2e-3)
    photos = scene.draws
    return PhotoProblem(
        shared,
        photos._replace(
            toward=np.broadcast_to(EASTWARD, (1, 2, 2)),
            placed=np.array([[1, 4]]),
            reading_m=np.concatenate([photos.reading_m, [[3.0, 4.0]]], axis=1),
            reading_weight=np.concatenate([photos.reading_weight, [[50.0, 20.0]]], axis=1),
        ),
    )


def state_of(photos: Photos) -> State:
    rng = np.random.default_rng(4)
    place = rng.uniform([-14.0, -10.0], [14.0, 10.0], (1, photos.pixel_px.shape[1], 2))
    common = rng.standard_normal((1, UNKNOWNS - 6))
    return State(photos.center + 0.2, np.array([[0.02, -0.03, 0.1]]), place, common)


def moved(state: State, step: Floats) -> State:
    return State(
        state.center + step[:3], state.turn + step[3:6], state.place, state.common + step[6:]
    )


def test_slopes_by_unknowns_are_those_of_differences(problem: PhotoProblem) -> None:
    state = state_of(problem.photos)
    here = problem.compute_rows(problem.photos, state)

    def rows(step: Floats) -> PhotoRows:
        return problem.compute_rows(problem.photos, moved(state, step))

    start = np.zeros(UNKNOWNS)
    error = central_differences(lambda step: rows(step).error[0], start, 1e-5)
    assert_derivative(here.shift[0], error, 1e-6)
    # At fixed places the errors of the picks change too, and the readings with both.
    off = central_differences(lambda step: rows(step).off[0], start, 1e-5)
    by_error = here.by_error[0].reshape(len(off), -1)
    both = here.by_unknown[0] + by_error @ here.shift[0].reshape(by_error.shape[1], -1)
    assert_derivative(-both, off, 1e-6)


def test_slopes_by_errors_of_picks_are_those_of_differences(problem: PhotoProblem) -> None:
    state = state_of(problem.photos)
    here = problem.compute_rows(problem.photos, state)
    for point in range(state.place.shape[1]):
        for axis in (0, 1):

            def rows(step: Floats, at: tuple[int, int] = (point, axis)) -> PhotoRows:
                place = state.place.copy()
                place[0, at[0], at[1]] += step[0]
                return problem.compute_rows(problem.photos, state._replace(place=place))

            every = central_differences(lambda s: rows(s).error[0], np.zeros(1), 1e-5)
            off = central_differences(lambda s: rows(s).off[0], np.zeros(1), 1e-5)
            error = every[point]
            assert_derivative(-here.by_error[0, :, point] @ error, off, 1e-6)
            unit = np.eye(2)[axis]
            assert here.to_place[0, point] @ error[:, 0] == pytest.approx(unit, abs=1e-7)
