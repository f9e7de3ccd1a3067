"""A shutter that reads row by row, and no log: ties show it, and how much of it stays unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from likelihood_scenes import beginning, with_found
from scenes import make_scene
from tied_flights import FOCAL_PX, HALF_PX, Conditions, tied_flight
from tied_surveys import PICK_PX, tied_survey

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.camera import Readout
from uavgram.model.frames import CandidatePoses
from uavgram.model.options import SolveOptions
from uavgram.model.survey import RollingShutter, Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.rolling_shutter import (
    RATE_RAD_S,
    USUAL_M_S,
    add_motion_by_photos,
)
from uavgram.stages.refine.tied_frames import add_tied_frames

LABELS = 16
READOUT_S = 0.03


def strips(readout_s: float, seed: int) -> tuple[Survey, Floats]:
    """A flight to and fro, two lengths across each other; labels are ties, picked; their truth."""
    flight = tied_flight(Conditions(photos=8, seed=seed, density=80.0, readout_s=readout_s))
    survey = tied_survey(flight).survey
    rays = flight.sightings
    rng = np.random.default_rng((5, seed))
    often = np.flatnonzero(np.bincount(rays.point[~flight.wrong]) >= 3)
    chosen = rng.choice(often, LABELS, replace=False)
    rows = np.flatnonzero(np.isin(rays.point, chosen) & ~flight.wrong)
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    pixel = FOCAL_PX * rays.ray[rows, :2] / rays.ray[rows, 2:] + HALF_PX
    place = flight.point[chosen]
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    start = np.array([0, 1])
    end = np.argmax(apart[:2, 2:], axis=1) + 2
    picked = replace(
        survey,
        label=tuple(f"L{k:02d}" for k in range(LABELS)),
        height_above_m=np.zeros(LABELS),
        height_sigma_m=np.zeros(LABELS),
        is_free=np.zeros(LABELS, np.bool_),
        identification_sigma_m=np.zeros(0),
        area=np.zeros(LABELS, np.int64),
        pick_frame=np.array([frame[f"p{f:02d}.jpg"] for f in rays.frame[rows]]),
        pick_label=np.array([int(np.flatnonzero(chosen == t)[0]) for t in rays.point[rows]]),
        pixel_px=pixel + rng.normal(0, PICK_PX, pixel.shape),
        pick_sigma_px=np.full(len(rows), PICK_PX),
        line_start=start,
        line_end=end,
        length_m=apart[start, end] + rng.normal(0, 0.01, 2),
        length_sigma_m=np.full(2, 0.01),
        line_name=("a", "b"),
        line_tape=(),
        line_along=(),
    )
    return picked, place


def z_of(adjustment: Adjustment, place: Floats) -> Floats:
    """Errors of all distances between labels, over their sigmas."""
    own = [int(name[1:]) for name in adjustment.survey.label]
    one, other = np.triu_indices(len(own), 1)
    value, gradient, columns = adjustment.problem.lengths_between(adjustment.state, one, other)
    true = np.linalg.norm(place[own][one] - place[own][other], axis=1)
    sigma = np.sqrt(adjustment.minimum.factor.variances(columns, gradient))
    return np.asarray((value - true) / sigma)


def test_derivatives_where_velocities_turn_with_the_camera() -> None:
    scene = make_scene(3, telemetry=False, gauge="plane")
    found = with_found(scene.survey, chains=1, ties=3)
    motion = np.random.default_rng(1).normal(0, 5.0, (len(found.frame_id), 6)) * [1, 1, 1, 0, 0, 0]
    rolling = RollingShutter(
        readout=Readout(value_s=0.05, sigma_s=0.03), motion=motion, by_photos=True
    )
    survey = replace(found, rolling=rolling)
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    layout = problem.layout
    begun = replace(beginning(problem, scene.truth), readout=np.array([0.05]))
    rng = np.random.default_rng(2)
    state = apply_increment(layout, begun, 0.01 * rng.normal(size=layout.size))
    blocks = problem.evaluate(state)
    assert blocks is not None
    block, h = blocks["ties"], 1e-5
    row = 4
    numeric = []
    for column in block.columns[row]:
        step = np.zeros(layout.size)
        step[column] = h
        ahead, behind = (
            problem.evaluate(apply_increment(layout, state, side * step)) for side in (1, -1)
        )
        assert ahead is not None
        assert behind is not None
        numeric.append((ahead["ties"].residual[row] - behind["ties"].residual[row]) / (2 * h))
    np.testing.assert_allclose(
        block.jacobian[row], np.array(numeric).T, atol=2e-6 * np.abs(block.jacobian).max()
    )


def test_ties_show_a_shutter_of_which_nobody_said_anything() -> None:
    survey, place = strips(READOUT_S, 1)
    refined, messages = refine(survey, SolveOptions())
    assert "shutter-found" in {one.code for one in messages}
    assert refined.adjustment.survey.rolling is not None
    z = z_of(refined.adjustment, place)
    assert np.sqrt(np.mean(z**2)) < 2.0  # its distances share few errors


def test_rows_that_are_read_at_once_stay_so() -> None:
    survey, _ = strips(0.0, 1)
    refined, messages = refine(survey, SolveOptions())
    assert "shutter-found" not in {one.code for one in messages}
    assert refined.adjustment.survey.rolling is None


def test_the_way_from_photo_to_photo_is_the_motion() -> None:
    survey, _ = strips(0.0, 1)
    flight = tied_flight(Conditions(photos=8, seed=1, density=80.0))
    begun, _ = add_tied_frames(survey)
    rolling = add_motion_by_photos(begun).rolling
    assert rolling is not None
    order = [int(name[1:3]) for name in survey.frame_id]
    way = np.gradient(flight.center[order], axis=0)
    inner = [1, 2, 5, 6]  # of two lines of four
    ahead = np.einsum("fji,fj->fi", flight.rotation[order], way)[inner]
    found = rolling.motion[inner, :3]
    size = np.linalg.norm(found, axis=1) * np.linalg.norm(ahead, axis=1)
    assert (np.sum(found * ahead, axis=1) > 0.95 * size).all()


TAKEN_S = 1.7e9 + np.array([0.0, 1.3, 2.1, 4.0, 5.2, 6.0, 7.7, 9.0])


def flown(survey: Survey, center: Floats, time_s: Floats, sigma_s: float) -> Survey:
    """The survey with photos at places, level cameras, and times; its shutter is known."""
    poses = tuple(
        CandidatePoses(
            frame_id=name,
            center_world_m=place[None],
            world_from_camera=np.eye(3)[None],
            misfit=np.zeros(1),
        )
        for name, place in zip(survey.frame_id, center, strict=True)
    )
    return replace(
        survey,
        calibration=replace(survey.calibration, readout=Readout(value_s=0.03, sigma_s=0.003)),
        candidate_poses=poses,
        time_s=time_s,
        time_sigma_s=np.full(len(time_s), sigma_s),
    )


@pytest.fixture(scope="module")
def tied() -> Survey:
    """Eight photos with ties, in whatever order the survey has them."""
    survey, _ = strips(0.0, 1)
    return survey


def test_times_of_photos_tell_how_fast_each_of_them_moved(tied: Survey) -> None:
    late = TAKEN_S - TAKEN_S[0]
    center = np.column_stack([3.0 * late + 0.2 * late**2, 0.5 * late, np.full(8, 40.0)])
    order = np.random.default_rng(4).permutation(8)  # names need not follow the times
    rolling = add_motion_by_photos(flown(tied, center[order], TAKEN_S[order], 0.001)).rolling
    assert rolling is not None
    found = rolling.motion[np.argsort(order)]
    # A parabola is what it is taken for: exact where there are photos on both sides.
    np.testing.assert_allclose(found[1:-1, 0], 3.0 + 0.4 * late[1:-1], rtol=1e-6)
    np.testing.assert_allclose(found[:, 1], 0.5, rtol=1e-6)
    assert np.all(found[:, 2:] == 0.0)
    assert rolling.readout.value_s == 0.03
    assert 0.003 < rolling.readout.sigma_s < 0.0036
    assert rolling.rate_sigma_rad_s < RATE_RAD_S


def test_times_to_whole_seconds_give_one_speed_for_all(tied: Survey) -> None:
    late = TAKEN_S - TAKEN_S[0]
    center = np.column_stack([6.0 * late, 0.0 * late, np.full(8, 40.0)])
    seconds = np.floor(TAKEN_S)  # two of them the same
    rolling = add_motion_by_photos(flown(tied, center, seconds, 12**-0.5)).rolling
    assert rolling is not None
    np.testing.assert_allclose(rolling.motion[:, 0], 6.0, rtol=0.05)
    assert np.ptp(rolling.motion[:, 0]) < 1e-9
    # Each time is wrong by up to a second of the nine: worth a tenth of the speed, not a hundredth.
    assert 0.0035 < rolling.readout.sigma_s < 0.008


@pytest.mark.parametrize(
    "time_s",
    [
        np.full(8, 1.7e9),  # copied files
        1.7e9 + 3600.0 * np.arange(8),
        1.7e9 + 0.01 * np.arange(8),
        np.where(np.arange(8) == 3, np.nan, TAKEN_S),
    ],
)
def test_times_that_cannot_be_those_of_the_photos_are_not_believed(
    tied: Survey, time_s: Floats
) -> None:
    center = np.column_stack([10.0 * np.arange(8), np.zeros(8), np.full(8, 40.0)])
    rolling = add_motion_by_photos(flown(tied, center, time_s, 0.001)).rolling
    assert rolling is not None
    np.testing.assert_allclose(rolling.motion[:, 0], USUAL_M_S)
    assert rolling.readout.sigma_s > 0.015
